"""`flatten`: one surface becomes one relaxed pattern."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import warp as wp
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from warpflat.core.arrays import IntArray
from warpflat.core.compile import start_warp
from warpflat.core.errors import InputError, expect, expect_callback, nearest
from warpflat.core.text import area_words
from warpflat.flat.fabric.fabric import DEFAULT_FABRIC, Fabric
from warpflat.flat.fabric.library import as_fabric
from warpflat.flat.flattening.datum import resolve_datum
from warpflat.flat.flattening.develop import Development, flat_layout, turn_upright
from warpflat.flat.flattening.keep_apart import keep_apart
from warpflat.flat.flattening.progress import Progress, laid_stage
from warpflat.flat.flattening.relax_piece import relax_piece
from warpflat.flat.flattening.relaxation_task import RelaxationTask
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.flattening.start import choose_start, given_start
from warpflat.flat.model.membrane import ModelChoice, check_model, choose_model
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.wear import Wear, unused_stretch
from warpflat.flat.solver.collapse import iterate_coarsenings
from warpflat.flat.solver.options import RelaxOptions, given_options
from warpflat.flat.surface.connectivity import border_of
from warpflat.flat.surface.grid import rows_and_columns
from warpflat.flat.surface.half_edges import half_edges_of
from warpflat.flat.surface.laplacian import factor_pays
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.normals import flat_areas
from warpflat.flat.surface.triangles import triangulate
from warpflat.flat.surface.untangle import untangle

__all__ = ["flatten", "nearly_closed_notes"]

# A border that lies flat around an area has a square of at least 4 pi times that; of half as much it is a hemisphere's.
_LEAST_SHARE = 0.5
# A larger piece is flattened on a coarser mesh first; one of fewer vertices gains nothing by that.
_COARSE = 10_000


def flatten(
    surface: Surface,
    *,
    fabric: Fabric | str = DEFAULT_FABRIC,
    datum: str | ArrayLike | None = None,
    grain_angle: float = 0.0,
    model: ModelChoice = "auto",
    wear: Wear | None = None,
    start: ArrayLike | None = None,
    relax: RelaxOptions | None = None,
    callback: Callable[[Progress], bool | None] | None = None,
    device: str | None = None,
) -> Flattening:
    """Flatten one piece: develop it from its datum line, then relax its mass-spring model to the minimum of its energy.

    By default the relaxation begins with the paper's approximate implicit steps, eqs. (4) to (10), which end where by eq. (11) they gain
    little (`RelaxOptions.first_steps_gain`); L-BFGS over one factor takes the rest. The stages "steps" and "relax" tell both. With
    `RelaxOptions(solver="paper")` the steps go on alone. A piece of more than 10,000 vertices, or a grid of more than 100,000, starts from
    its layout on a coarser mesh. Where it would lie over itself, contact parts it, without steps. Strain energies are eqs. (1) to (3).

    Args:
        surface: the piece; `read_surface` reads one from a mesh file.
        fabric: a `Fabric`, or a name of the library (`warpflat fabrics` lists it).
        datum: the line from which it is developed and which becomes the grain: a name in `surface.lines`, or vertex
            indices along mesh edges; if not given, the line along the long axis through the middle.
        grain_angle: of the warp against the datum, degrees; 45 cuts on the bias.
        model: "springs", the paper's, exact on quads along the grain, or "membrane", the cloth measured cell by cell, exact on any mesh;
            "auto" takes springs where they are exact. What is minimised is reported as `model_energy_j` for both.
        wear: the stretch or pressure it is meant to be worn with; the pattern is cut so much smaller.
        start: a layout of one's own to be relaxed from, #V by 2 in any unit; no face of it may be mirrored.
        relax: options of the relaxation.
        callback: called with a `Progress` for the development (step 0) and after every step; True stops there, and the result is kept.
        device: Warp device, "cpu" or "cuda:0"; Warp's own choice if not given.

    Raises:
        InputError: what was given cannot be flattened; one line says what, where, and what would be right.
    """
    check_surface(surface)
    expect_callback(callback)
    settings = check_settings(fabric, grain_angle=grain_angle, model=model, wear=wear, relax=relax, device=device)
    developed = develop_piece(surface, datum, settings, callback, start)
    # Refuse a stretch along threads that do not run around the body, which is known once the piece is developed.
    wear, notes = developed.task.wear, developed.task.notes
    unused = [] if wear is None else [unused_stretch(wear, around) for around in ("warp", "weft")]
    for message in unused:
        if message in notes:
            raise InputError(f"piece {developed.task.surface.name!r}: wear: {message}; leave it out, or the pressure")
    return relax_developed(developed)


def check_surface(surface: object) -> None:
    """Raise InputError for what is no `Surface`."""
    expect(surface, Surface, "surface", "a Surface, as read_surface or make_surface gives it")


@dataclass(frozen=True, kw_only=True)
class FlattenSettings:
    """The checked settings of `flatten` that several pieces have in common."""

    fabric: Fabric
    grain_angle: float
    model: ModelChoice
    wear: Wear | None
    options: RelaxOptions
    device: wp.Device


def check_settings(
    fabric: Fabric | str,
    *,
    grain_angle: float,
    model: ModelChoice,
    wear: Wear | None,
    relax: RelaxOptions | None,
    device: str | None,
) -> FlattenSettings:
    """Look up what is named, and fill in what is not given.

    Raises:
        InputError: an unknown name, or a number out of its bounds.
    """
    cloth = as_fabric(fabric)
    options = given_options(relax)
    if wear is not None:
        expect(wear, Wear, "wear", "a Wear")
    angle = np.asarray(grain_angle)
    if angle.ndim or angle.dtype.kind not in "iuf" or not np.isfinite(angle):
        raise InputError(f"grain_angle = {grain_angle!r} is not a number of degrees")
    check_model(model)
    start_warp()
    try:
        if device == "cuda" and not wp.get_cuda_devices():
            raise ValueError("no CUDA device")  # Warp would look for one, and print why there is none
        chosen = wp.get_device(device)
    except Exception as error:
        devices: Sequence[str] = [d.alias for d in wp.get_devices()]
        raise InputError(f"device {device!r} is not available; {nearest(str(device), devices)}") from error
    return FlattenSettings(
        fabric=cloth, grain_angle=grain_angle, model=model, wear=wear, options=options, device=chosen
    )


@dataclass(frozen=True, kw_only=True)
class DevelopedPiece:
    """A piece that has been developed and is to be relaxed.

    Attributes:
        task: its relaxation.
        datum_name: its name, or how it was chosen.
        development: its first layout, shrunk by the stretch with which it is to be worn.
        network: measured in the development.
        notes: on the datum, and on a piece that is nearly closed.
        seconds: time spent so far.
    """

    task: RelaxationTask
    datum_name: str
    development: Development
    network: SpringNetwork
    notes: tuple[str, ...]
    seconds: float


def develop_piece(
    surface: Surface,
    datum: str | ArrayLike | None,
    settings: FlattenSettings,
    callback: Callable[[Progress], bool | None] | None,
    start: ArrayLike | None = None,
) -> DevelopedPiece:
    """Develop a piece from its datum and measure its network there: the first half of `flatten`.

    Raises:
        InputError: it cannot be developed.
    """
    line, line_name, notes = resolve_datum(surface, datum)
    begun = time.perf_counter()
    coarse = None if start is not None else _flatten_coarser(surface, line, settings)
    given = coarse or (choose_start(surface, line) if start is None else given_start(surface, line, start))
    task = RelaxationTask(
        surface,
        settings.fabric,
        settings.grain_angle,
        settings.device,
        settings.options,
        callback,
        line,
        choose_model(settings.model, surface, settings.fabric, given.positions, grain_angle=settings.grain_angle),
        wear=settings.wear,
    )
    development = coarse or task.shrink_to_rest(given)
    network = task.build_network(development.positions)
    return DevelopedPiece(
        task=task,
        datum_name=line_name,
        development=development,
        network=network,
        notes=(*notes, *nearly_closed_notes(surface)),
        seconds=time.perf_counter() - begun,
    )


def _flatten_coarser(surface: Surface, line: IntArray, settings: FlattenSettings) -> Development | None:
    """Flatten a large piece on a mesh of a quarter of its vertices and return that layout, interpolated; None where the piece is small or
    that fails.

    That mesh starts from a coarser one itself (nested iteration). Folds, overlaps and contact are settled there, with few vertices.

    Args:
        surface: the piece.
        line: its datum.
        settings: of the piece; the paper's steps alone start from its development.
    """
    is_near = rows_and_columns(surface) is not None and factor_pays(surface)
    if settings.options.solver == "paper" or is_near or len(surface.vertices) <= _COARSE:
        return None
    step = None if flat_layout(surface, line) is not None else next(iterate_coarsenings(surface), None)
    if step is None:
        return None
    # Adjacent vertices have collapsed into one, or into adjacent ones; where the line comes back to one, it goes on from there.
    coarse_line: list[int] = []
    for vertex in step.into[line].tolist():
        if vertex in coarse_line:
            del coarse_line[coarse_line.index(vertex) :]
        coarse_line.append(vertex)
    # Springs would be another cloth on the coarser mesh, which is of triangles.
    settings = replace(settings, model="membrane" if settings.model == "membrane" else "auto")
    try:
        flat = relax_developed(develop_piece(step.surface, coarse_line, settings, None))
    except InputError:
        # What is said of the piece names its own vertices.
        return None
    layout, left = untangle(surface, step.prolongation @ flat.positions)
    return None if left else Development(positions=turn_upright(layout, line), method="coarse", mended=True)


def relax_developed(piece: DevelopedPiece) -> Flattening:
    """Relax a developed piece: the second half of `flatten`."""
    task, development = piece.task, piece.development
    end = relax_piece(
        task,
        piece.network,
        development.positions,
        direction_updates=task.max_direction_updates(mended=development.mended),
        needs_isotropic_start=task.needs_isotropic_start(development),
    )
    developed = laid_stage("develop", piece.network, development.positions, end.begin, seconds=piece.seconds)
    positions, stages = keep_apart(task, end, development.positions, np.empty(0, dtype=np.int32))
    return Flattening(
        surface=task.surface,
        fabric=task.fabric,
        datum=task.datum,
        datum_name=piece.datum_name,
        grain_angle=task.grain_angle,
        network=end.network,
        development=development,
        positions=positions,
        stages=(developed, *stages),
        history=np.array(task.history),
        notes=(*task.surface.notes, *piece.notes, *development.notes, *task.notes),
        relaxation_notes=tuple(task.notes),
        wear=task.wear,
        options=task.options,
    )


def nearly_closed_notes(surface: Surface) -> list[str]:
    """Return a note on a piece whose border is too short for its area, naming the cut that would make a pattern of it.

    The cut runs along edges from the border to the vertex farthest from it. Without it the piece is flattened all the same, but
    the cloth would have to stretch by a multiple.
    """
    he = half_edges_of(surface)
    length = np.linalg.norm(surface.vertices[he.edges[:, 1]] - surface.vertices[he.edges[:, 0]], axis=1)
    border = float(length[he.count == 1].sum())
    area = float(flat_areas(surface.vertices, triangulate(surface.faces)[0]).sum())
    if border == 0.0 or border**2 >= _LEAST_SHARE * 4.0 * np.pi * area:
        return []
    count = len(surface.vertices)
    graph = csr_array((length, he.edges.T), shape=(count, count))
    away, _, source = dijkstra(
        graph, directed=False, indices=border_of(surface), min_only=True, return_predecessors=True
    )
    away = np.where(np.isfinite(away), away, -1.0)
    tip = int(away.argmax())
    first, last = (int(surface.input_index[vertex]) for vertex in (source[tip], tip))
    return [
        f"the piece is nearly closed: its border of {100 * border:.1f} cm is too short to lie flat around {area_words(area)}; a cut "
        f"of {100 * away[tip]:.1f} cm from vertex {first} to vertex {last} would make a pattern of it"
    ]
