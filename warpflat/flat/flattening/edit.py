"""Edits of a pattern: another fabric, a moved surface or a cut. The piece is relaxed further from its layout.

An edit takes a fraction of what `flatten` takes: the piece is not developed again, what its faces tell is known already, and it lies near
its new minimum, or is carried there from its coarser levels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError, expect, expect_callback
from warpflat.flat.fabric.fabric import Fabric
from warpflat.flat.fabric.library import as_fabric
from warpflat.flat.flattening.applied_cut import AppliedCut, cut_sides
from warpflat.flat.flattening.datum import datum_extent
from warpflat.flat.flattening.flatten_piece import nearly_closed_notes
from warpflat.flat.flattening.keep_apart import keep_apart
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.flattening.relax_piece import relax_piece
from warpflat.flat.flattening.relaxation_task import RelaxationTask
from warpflat.flat.flattening.result import Flattening, require_unsewn
from warpflat.flat.model.membrane import choose_model
from warpflat.flat.solver.options import RelaxOptions, given_options
from warpflat.flat.surface.cells import inherit_cells
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.edge_paths import path_length
from warpflat.flat.surface.repair.polygons import find_crossed_quads
from warpflat.flat.surface.repair.slivers import degenerate_faces
from warpflat.flat.surface.repair.validate import check_positions
from warpflat.flat.surface.repair.weld import weld_map

__all__ = ["change_fabric", "change_surface", "relax_cut"]


#: A face whose width is no more than this share of the edges around it has no area to be measured by.
_COLLAPSED = 1e-6


def change_fabric(
    result: Flattening,
    fabric: Fabric | str,
    *,
    relax: RelaxOptions | None = None,
    callback: Callable[[Progress], bool | None] | None = None,
) -> Flattening:
    """Change the cloth of a piece and relax it further from its layout, which takes a fraction of the time of `flatten`.

    Args:
        result: the piece, with the cuts it has; it stays as it is.
        fabric: a `Fabric`, or a name of the library.
        relax: options of the relaxation.
        callback: called with a `Progress` before the first step and after every step; the stage is "fabric:NAME".

    Raises:
        InputError: an unknown fabric, an option out of its bounds, or the piece has been sewn.
    """
    expect(result, Flattening, "result", "a Flattening, as flatten gives it")
    cloth = as_fabric(fabric)
    task = _continuation_task(
        result, result.network.surface, cloth, f"fabric:{cloth.name}", given_options(relax), callback
    )
    return replace(_continue(result, task, result.positions), fabric=cloth)


def change_surface(
    result: Flattening,
    surface: Surface | ArrayLike,
    *,
    relax: RelaxOptions | None = None,
    callback: Callable[[Progress], bool | None] | None = None,
) -> Flattening:
    """Move the vertices of a piece's surface and relax it further from its layout, as for a moved feature line or another size.

    Args:
        result: the piece, with the cuts it has; it stays as it is.
        surface: the same mesh, uncut, faces and all in the same order; its vertices may lie anywhere. Or these vertices only, #V by 3
            [m], in the order of `result.surface.vertices`.
        relax: options of the relaxation.
        callback: called with a `Progress` before the first step and after every step; the stage is "surface:NAME".

    Returns:
        The piece on that surface, with the same cuts. Its development stays that of the surface before.

    Raises:
        InputError: the mesh is another one, a vertex is not finite, a face has collapsed or its sides cross, an option out of its bounds,
            or the piece has been sewn.
    """
    expect(result, Flattening, "result", "a Flattening, as flatten gives it")
    before, options = result.surface, given_options(relax)
    expect_callback(callback)
    # The surface with the moved vertices, checked to be the mesh before.
    given = surface
    if isinstance(given, Surface):
        surface = given
        if len(surface.vertices) != len(before.vertices) or not np.array_equal(surface.faces, before.faces):
            raise InputError(
                f"piece {surface.name!r} has another mesh ({len(surface.vertices):,} vertices, {len(surface.faces):,} faces) than "
                f"{before.name!r} ({len(before.vertices):,}, {len(before.faces):,}): flatten it afresh, or keep the faces as they are"
            )
        vertices = check_positions(surface.vertices)
        # Of a surface made by `replace(surface, vertices=...)` what was read has not moved with it.
        if not np.array_equal(given.input_vertices[given.input_index], vertices):
            surface = replace(given, input_vertices=_as_read(before, vertices), input_index=before.input_index)
    else:
        try:
            vertices = check_positions(given)
        except InputError as error:
            raise InputError(
                f"piece {before.name!r}: {error}; give a Surface, or its {len(before.vertices):,} vertices by 3 [m]"
            ) from None
        if len(vertices) != len(before.vertices):
            raise InputError(
                f"piece {before.name!r} has {len(before.vertices):,} vertices, not {len(vertices):,}: give them all, in the order of its "
                "surface.vertices, or flatten another mesh afresh"
            )
        surface = replace(before, vertices=vertices, input_vertices=_as_read(before, vertices))
        vertices = surface.vertices
    collapsed = degenerate_faces(vertices, surface.faces, _COLLAPSED)
    _refuse_faces(surface, collapsed, "has collapsed to a line or a point", "faces need an area")
    crossed = find_crossed_quads(vertices, surface.faces)
    _refuse_faces(
        surface,
        crossed,
        "has become a quad whose sides cross, or is folded by more than 90 degrees",
        "move its vertices along with those around them",
    )
    # The faces stay, and with them what has been found out about the mesh.
    surface = replace(surface, faces=before.faces, of_faces=before.of_faces)
    cut, origin = result.network.surface, result.vertex_origin
    moved = surface
    if cut is not before:
        moved = replace(
            cut,
            vertices=surface.vertices[origin],
            name=surface.name,
            input_vertices=surface.input_vertices,
            input_index=surface.input_index[origin],
        )
    task = _continuation_task(result, moved, result.fabric, f"surface:{surface.name}", options, callback)
    cuts = tuple(replace(made, length=path_length(surface, made.paths)) for made in result.cuts)
    relaxed = _continue(result, task, result.positions)
    # A note on a chosen datum has its length, and one on a nearly closed piece its border and area, which are others now.
    chosen, now = (datum_extent(of, result.datum) for of in (before, surface))
    closed, still = (nearly_closed_notes(of) for of in (before, surface))
    notes = [note.removesuffix(chosen) + now if note.endswith(chosen) else note for note in relaxed.notes]
    notes = [note for note in notes if note not in closed] + still
    return replace(relaxed, surface=surface, cuts=cuts, notes=tuple(notes))


def _refuse_faces(surface: Surface, wrong: NDArray[np.integer], what: str, right: str) -> None:
    if len(wrong):
        corners = ", ".join(str(v) for v in surface.faces[wrong[0]].tolist() if v >= 0)
        more = f" (and {len(wrong) - 1:,} more like it)" if len(wrong) > 1 else ""
        raise InputError(f"piece {surface.name!r}: face {wrong[0]} (vertices {corners}) {what}{more}; {right}")


def _as_read(before: Surface, vertices: FloatArray) -> FloatArray:
    """Return the moved vertices as they were read (#I by 3); those read several times at one place, as in an STL, stay together."""
    as_read = before.input_vertices.copy()
    if len(as_read) > len(vertices):
        place = weld_map(before.input_vertices)
        at_place = np.full(len(place), -1, dtype=np.int32)
        at_place[place[before.input_index]] = np.arange(len(vertices), dtype=np.int32)
        goes = at_place[place] >= 0
        as_read[goes] = vertices[at_place[place[goes]]]
    # Where several vertices lay at one place, each has its own now.
    as_read[before.input_index] = vertices
    return as_read


def relax_cut(
    result: Flattening,
    surface: Surface,
    positions: FloatArray,
    *,
    stage: str,
    cuts: Sequence[AppliedCut],
    options: RelaxOptions,
    callback: Callable[[Progress], bool | None] | None = None,
) -> Flattening:
    """Relax a piece whose topology has changed, as `warpflat.flat.cutting.cut_piece.cut` changes it, further from a layout.

    Args:
        result: of the piece before.
        surface: `result.surface` with vertices doubled (#P), of which the first keep their numbers.
        positions: #P by 2, where to go on from [m].
        stage: what it is called in the history.
        cuts: all that `surface` has.
        options: of the relaxation.
        callback: called with a `Progress` before the first step and after every step.
    """
    inherit_cells(surface, result.surface)
    task = _continuation_task(result, surface, result.fabric, stage, options, callback)
    return _continue(replace(result, cuts=tuple(cuts)), task, positions)


def _continuation_task(
    result: Flattening,
    surface: Surface,
    fabric: Fabric,
    stage: str,
    options: RelaxOptions,
    callback: Callable[[Progress], bool | None] | None,
) -> RelaxationTask:
    """Make the task that relaxes a piece further from a result."""
    require_unsewn(result)
    expect_callback(callback)
    device, model = result.network.device, result.network.model
    if model == "springs" and fabric is not result.fabric:
        # Quads across the grain of the new cloth, where the one before was isotropic.
        model = choose_model("auto", surface, fabric, result.positions, grain_angle=result.grain_angle)
    return RelaxationTask(
        surface,
        fabric,
        result.grain_angle,
        device,
        options,
        callback,
        result.datum,
        model,
        stage,
        wear=result.wear,
    )


def _continue(result: Flattening, task: RelaxationTask, positions: FloatArray) -> Flattening:
    """Relax a task from a layout (#V by 2 [m]), and return the result with its history continued."""
    end = relax_piece(task, task.build_network(positions), positions, direction_updates=task.max_direction_updates())
    apart, stages = keep_apart(task, end, positions, cut_sides(result.cuts))
    return replace(
        result,
        network=end.network,
        positions=apart,
        stages=(*result.stages, *stages),
        history=np.concatenate([result.history.reshape(-1, 4), np.array(task.history).reshape(-1, 4)]),
        # They were found for what it was.
        remedies=(),
        notes=(*(note for note in result.notes if note not in result.relaxation_notes), *task.notes),
        relaxation_notes=tuple(task.notes),
        options=task.options,
    )
