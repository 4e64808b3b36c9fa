"""The cut: vertices on a path are doubled, and the relaxation goes on from where the pattern lies, so the crack opens.

A cut is always made on the uncut surface, with all the cuts before it: paths may then meet, cross and branch as they
like, and what they have in common with one another is a matter of the surface alone. The layout is carried over corner by
corner, since cutting changes neither the number of faces nor their order. No spring has to be removed: those across the
path belonged to the faces on both sides, and each side keeps its own share.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.polyline import arc_lengths
from warpflat.flattening.applied_cut import AppliedCut, seam_kind
from warpflat.flattening.datum import choose_datum
from warpflat.flattening.develop import develop
from warpflat.flattening.edit import expect_unsewn, relax_cut
from warpflat.flattening.progress import Progress
from warpflat.flattening.result import Flattening
from warpflat.model.network import SpringNetwork
from warpflat.model.strain import strain_energy
from warpflat.solver.relax import Relaxation, RelaxOptions, given_options
from warpflat.surface.cut.cut_mesh import Cut, Seam, cut_along_many
from warpflat.surface.cut.dart import dart_measure
from warpflat.surface.cut.pieces import Piece, apply_cut, split_pieces
from warpflat.surface.cut.split_faces import split_faces_along
from warpflat.surface.grid import cut_lattice, lattice_of
from warpflat.surface.half_edges import mesh_edges
from warpflat.surface.mesh import Surface, face_results
from warpflat.surface.paths.edge_paths import path_length
from warpflat.surface.paths.trace import SurfacePath
from warpflat.surface.untangle import untangle

__all__ = [
    "CutPlan",
    "DartMove",
    "carry_layout",
    "cut",
    "draw_line",
    "line_part",
    "move_dart",
    "refine_along",
    "replace_paths",
    "separate",
]


_LEAST_AREA = 0.01


@dataclass(frozen=True, kw_only=True, eq=False)
class CutPlan:
    """A cut to be made.

    Attributes:
        name: what it is called.
        paths: rows of vertices of the uncut surface along its edges; several are made at once.
        tip_back: how far the tips of its darts are drawn back [m].
    """

    name: str
    paths: tuple[IntArray, ...]
    tip_back: float = 0.0


def line_part(surface: Surface, name: str, part: tuple[float, float] = (0.0, 1.0)) -> IntArray:
    """A feature line or a part of it, as vertices; its ends are the line's vertices nearest to the given shares.

    Args:
        surface: with the line.
        name: the line's.
        part: from where to where, in shares of its length.

    Raises:
        InputError: there is no such line (names the nearest), or the part is shorter than an edge.
    """
    if name not in surface.lines:
        raise InputError(f"piece {surface.name!r} has no line {name!r} to cut along; {nearest(name, surface.lines)}")
    line = np.asarray(surface.lines[name], dtype=np.int32)
    arc = arc_lengths(surface.vertices[line])
    station = arc / max(float(arc[-1]), np.finfo(float).tiny)
    first, last = (int(np.argmin(np.abs(station - share))) for share in part)
    if not (min(part) >= 0.0 and max(part) <= 1.0) or first == last:
        raise InputError(
            f"part = [{part[0]:g}, {part[1]:g}] of line {name!r} holds no edge of the mesh; give two shares of its length "
            "from 0 to 1 that lie further apart"
        )
    return line[first : last + 1] if first < last else line[last : first + 1][::-1]


def draw_line(surface: Surface, name: str, path: SurfacePath) -> Surface:
    """The surface with a path worked into its edges, as a line of that name.

    Raises:
        InputError: the name is taken, or the path crosses itself.
    """
    if name in surface.lines:
        raise InputError(f"piece {surface.name!r} already has a line {name!r}; call the cut something else")
    drawn = split_faces_along(surface, path)
    return replace(drawn.surface, lines={**drawn.surface.lines, name: drawn.path})


def cut(
    result: Flattening,
    plan: CutPlan | str,
    *,
    relax: RelaxOptions | None = None,
    callback: Callable[[Progress], None] | None = None,
) -> Flattening:
    """Cut a flattened piece and relax it further from its present layout.

    Args:
        result: the piece, cut before or not.
        plan: the cut, or the name of a feature line to be cut along from end to end.
        relax: options of the relaxation.
        callback: called with a `Progress` before the first step (the crack still closed) and after every step.

    Returns:
        The piece with the crack open; what a cut from border to border leaves is still one object, see :func:`separate`.

    Raises:
        InputError: the path leaves the mesh, repeats a vertex, runs along the border or an earlier cut, or separates
            nothing; or a cut of that name has been made, or the piece has been sewn. The message names the vertex.
    """
    expect_unsewn(result)
    if isinstance(plan, str):
        plan = CutPlan(name=plan, paths=(line_part(result.surface, plan),))
    if plan.name in [made.name for made in result.cuts]:
        raise InputError(f"piece {result.surface.name!r} has been cut along {plan.name!r} already")
    plans = [CutPlan(name=made.name, paths=made.paths, tip_back=made.tip_back) for made in result.cuts]
    made = _make(result.surface, [*plans, plan])
    positions = carry_layout(result.positions, result.faces, made.surface.faces, len(made.surface.vertices))
    return relax_cut(
        result,
        made.surface,
        positions,
        stage=f"cut:{plan.name}",
        cuts=made.cuts,
        options=given_options(relax),
        callback=callback,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Made:
    surface: Surface
    cuts: tuple[AppliedCut, ...]
    cut: Cut | None


def _make(surface: Surface, plans: Sequence[CutPlan]) -> _Made:
    """All cuts at once on the uncut surface."""
    if not plans:
        return _Made(surface=surface, cuts=(), cut=None)
    topology = cut_along_many(
        surface.faces, [path for plan in plans for path in plan.paths], vertex_count=len(surface.vertices)
    )
    owner = {edge: number for number, plan in enumerate(plans) for path in plan.paths for edge in _edges(path)}
    seams: list[list[Seam]] = [[] for _ in plans]
    for seam in topology.seams:
        seams[owner[_edges(seam.path)[0]]].append(seam)
    applied = [
        AppliedCut(
            name=plan.name,
            paths=tuple(np.asarray(path, dtype=np.int32) for path in plan.paths),
            seams=tuple(own),
            length=path_length(surface, plan.paths),
            tip_back=plan.tip_back,
        )
        for plan, own in zip(plans, seams, strict=True)
    ]
    # What the cut has had to know of the new faces, the relaxation asks for again.
    cut_surface = replace(apply_cut(surface, topology), of_faces=topology.of_faces)
    if topology.component_count == 1:
        lattice = cut_lattice(cut_surface, surface, topology.vertex_origin)
        topology.of_faces.update(face_results(topology.faces, {lattice_of: lattice}))
    return _Made(surface=cut_surface, cuts=tuple(applied), cut=topology)


def _edges(path: ArrayLike) -> list[tuple[int, int]]:
    row = np.asarray(path).tolist()
    return [(min(a, b), max(a, b)) for a, b in pairwise(row)]


def carry_layout(positions: FloatArray, faces: IntArray, new_faces: IntArray, count: int) -> FloatArray:
    """A layout in another numbering of the same faces, bit for bit; where copies are glued, the mean of them.

    Args:
        positions: #P by 2 [m].
        faces, new_faces: #F by 4, the same faces and corners in the old and in the new numbering.
        count: vertices of the new numbering, of which the first keep their numbers.
    """
    carried = np.zeros((count, 2))
    kept = min(count, len(positions))
    carried[:kept] = positions[:kept]
    # Only where a corner has another number than before is there anything to do.
    other = np.zeros(count, dtype=bool)
    other[new_faces[new_faces != faces]] = True
    used = (new_faces >= 0) & other[new_faces]
    pairs = np.unique(np.column_stack([new_faces[used], faces[used]]), axis=0)
    number = np.bincount(pairs[:, 0], minlength=count)
    for axis in range(2):
        total = np.bincount(pairs[:, 0], positions[pairs[:, 1], axis], minlength=count)
        carried[number > 0, axis] = total[number > 0] / number[number > 0]
    return carried


def refine_along(result: Flattening, name: str, path: SurfacePath) -> tuple[Flattening, IntArray]:
    """The same piece with a path worked into its edges, and the path's vertices; the pattern lies where it lay.

    The refined mesh has springs of its own: compare energies with those of the refined piece, once it is relaxed.

    Raises:
        InputError: as :func:`draw_line`.
    """
    expect_unsewn(result)
    if name in result.surface.lines:
        raise InputError(f"piece {result.surface.name!r} already has a line {name!r}; call the cut something else")
    old = result.surface
    # The cuts made so far and the datum are carried through as lines of their own.
    hidden = {f"\0{c}.{k}": row for c, made in enumerate(result.cuts) for k, row in enumerate(made.paths)}
    drawn = split_faces_along(replace(old, lines={**old.lines, **hidden, "\0datum": result.datum}), path)
    through = drawn.surface.lines
    kept = {key: line for key, line in through.items() if not key.startswith("\0")}
    surface = replace(drawn.surface, lines={**kept, name: drawn.path})
    plans = [
        replace_paths(made, tuple(through[f"\0{c}.{k}"] for k in range(len(made.paths))))
        for c, made in enumerate(result.cuts)
    ]
    made = _make(surface, plans)
    positions = np.zeros((len(made.surface.vertices), 2))
    for slot in range(4):
        face = np.flatnonzero(surface.faces[:, slot] >= 0)
        corner, base = surface.faces[face, slot], drawn.face_origin[face]
        place = np.zeros((len(face), 2))
        for k in range(3):
            vertex, weight = drawn.vertex_support[corner, k], drawn.vertex_weights[corner, k]
            at = np.argmax(old.faces[base] == vertex[:, None], axis=1)
            place += np.where(vertex >= 0, weight, 0.0)[:, None] * result.positions[result.faces[base, at]]
        positions[made.surface.faces[face, slot]] = place
    network = _network_of(result, made.surface, positions, drawn.face_origin)
    refined = replace(
        result, surface=surface, network=network, positions=positions, cuts=made.cuts, datum=through["\0datum"]
    )
    return refined, drawn.path


def _network_of(result: Flattening, surface: Surface, positions: FloatArray, face_origin: IntArray) -> SpringNetwork:
    """The result's model on a surface whose faces are (parts of) its own."""
    stretch = result.network.stretch
    return SpringNetwork.build(
        surface,
        result.fabric,
        positions,
        grain_angle=result.grain_angle,
        device=result.network.device,
        model=result.network.model,
        stretch=None if stretch is None else stretch[face_origin],
    )


def replace_paths(made: AppliedCut, paths: tuple[IntArray, ...]) -> CutPlan:
    """The plan of a cut that was made, along other paths."""
    return CutPlan(name=made.name, paths=paths, tip_back=made.tip_back)


@dataclass(frozen=True, kw_only=True, eq=False)
class DartMove:
    """A dart closed and another opened in its place.

    Attributes:
        result: the piece afterwards.
        closed, opened: names of the cuts.
        energy_before, energy_both, energy_after: what is minimised, springs and guard, with the old dart, with both open, with the new
            one [J].
        angle_before, angle_after: of the old dart and of the new one, all their seams together [rad].
    """

    result: Flattening
    closed: str
    opened: str
    energy_before: float
    energy_both: float
    energy_after: float
    angle_before: float
    angle_after: float


def move_dart(
    result: Flattening,
    close: str,
    plan: CutPlan,
    *,
    relax: RelaxOptions | None = None,
    callback: Callable[[Progress], None] | None = None,
) -> DartMove:
    """Rotate a dart to another line: open the new one, then sew the old one shut and relax.

    Args:
        result: with the old dart.
        close: the name of its cut.
        plan: the new dart, in the numbering of the uncut surface.
        relax: options of both relaxations.
        callback: called as by :func:`cut`.

    Raises:
        InputError: there is no such cut, or the new path is refused as by :func:`cut`.
    """
    if close not in [made.name for made in result.cuts]:
        raise InputError(
            f"piece {result.surface.name!r} has no cut {close!r} to close; {nearest(close, [c.name for c in result.cuts])}"
        )
    both = cut(result, plan, relax=relax, callback=callback)
    left = [replace_paths(made, made.paths) for made in both.cuts if made.name != close]
    made = _make(both.surface, left)
    closing = [seam for one in both.cuts if one.name == close for seam in one.seams]
    drawn = _drawn_together(both.network.surface, both.positions, closing)
    positions = carry_layout(drawn, both.faces, made.surface.faces, len(made.surface.vertices))
    # What that has folded is turned back before the springs take over; if it cannot be, the piece is developed anew.
    positions, folded = untangle(made.surface, positions, least_area=_LEAST_AREA)
    if folded:
        positions = develop(made.surface, both.datum).positions
    after = relax_cut(
        both,
        made.surface,
        positions,
        stage=f"close:{close}",
        cuts=made.cuts,
        options=given_options(relax),
        callback=callback,
    )
    return DartMove(
        result=after,
        closed=close,
        opened=plan.name,
        energy_before=result.stages[-1].potential_j,
        energy_both=both.stages[-1].potential_j,
        energy_after=after.stages[-1].potential_j,
        angle_before=_angle_of(result, close),
        angle_after=_angle_of(after, plan.name),
    )


def _drawn_together(surface: Surface, positions: FloatArray, seams: Sequence[Seam]) -> FloatArray:
    """The layout with both sides of cracks moved to the middle, and everything else moved along harmonically."""
    from scipy.sparse import coo_matrix, diags
    from scipy.sparse.linalg import spsolve

    shift = np.zeros_like(positions)
    fixed = np.zeros(len(positions), dtype=bool)
    for seam in seams:
        middle = 0.5 * (positions[seam.left] + positions[seam.right])
        for side in (seam.left, seam.right):
            shift[side] = middle - positions[side]
            fixed[side] = True
    edges = mesh_edges(surface.faces)
    ones = np.ones(2 * len(edges))
    rows, columns = np.concatenate([edges[:, 0], edges[:, 1]]), np.concatenate([edges[:, 1], edges[:, 0]])
    joined = coo_matrix((ones, (rows, columns)), shape=(len(positions), len(positions))).tocsr()
    degree = np.asarray(joined.sum(axis=1)).ravel()
    # Pieces that no crack touches stay; the tiny share of a vertex itself keeps their equations solvable.
    laplacian = diags(degree + 1e-9) - joined
    free = np.flatnonzero(~fixed)
    if len(free):
        pull = joined[free][:, np.flatnonzero(fixed)] @ shift[fixed]
        shift[free] = spsolve(laplacian.tocsr()[free][:, free].tocsc(), pull).reshape(-1, 2)
    return positions + shift


def _angle_of(result: Flattening, name: str) -> float:
    """Of all darts of a cut together [rad]."""
    seams = next(made.seams for made in result.cuts if made.name == name)
    darts = [seam for seam in seams if seam_kind(seam) == "dart"]
    return sum(dart_measure(result.positions, seam.left, seam.right).angle for seam in darts)


def separate(result: Flattening) -> tuple[Flattening, ...]:
    """One result per piece that the cuts have left, each with its name, its own network, measures and cuts.

    One piece comes back as it is. The names end in where the pieces lie to each other (see
    :func:`warpflat.surface.cut.pieces.split_pieces`); energies of the last stage are those of the piece, the stages before
    it those of the whole.
    """
    made = _make(result.surface, [replace_paths(one, one.paths) for one in result.cuts])
    return tuple(_part(result, piece) for piece in _parted(result.surface, made)) or (result,)


def cut_surfaces(surface: Surface, plans: Sequence[CutPlan]) -> tuple[Surface, ...]:
    """What all cuts will leave of a surface, names and lines included, without flattening anything.

    Raises:
        InputError: as :func:`cut`.
    """
    made = _make(surface, plans)
    return tuple(piece.surface for piece in _parted(surface, made)) or (made.surface,)


def _parted(surface: Surface, made: _Made) -> tuple[Piece, ...]:
    """The pieces that cuts leave; none where it is still one."""
    if made.cut is None or made.cut.component_count == made.cut.components_before == 1:
        return ()
    # A cut by several paths that parts the cloth is named by place like any other.
    kind = "split" if made.cut.kind == "network" else made.cut.kind
    return split_pieces(surface, replace(made.cut, kind=kind))


def _part(result: Flattening, piece: Piece) -> Flattening:
    used = np.unique(piece.vertex_origin)
    number = np.full(len(result.surface.vertices), -1, dtype=np.int32)
    number[used] = np.arange(len(used), dtype=np.int32)
    origin = number[piece.vertex_origin]
    corners = piece.surface.faces
    glued = replace(
        piece.surface,
        vertices=result.surface.vertices[used],
        faces=np.where(corners >= 0, origin[corners], -1).astype(np.int32),
        lines={name: origin[line] for name, line in piece.surface.lines.items()},
        input_index=result.surface.input_index[used],
    )
    # The cut surface keeps the numbers of the uncut one first, then the copies.
    first = {int(v): i for i, v in reversed(list(enumerate(origin.tolist())))}
    own = [first[v] for v in range(len(used))]
    order = np.array(own + sorted(set(range(len(origin))) - set(own)), dtype=np.int64)
    place = np.empty(len(order), dtype=np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    cut_surface = replace(
        piece.surface,
        vertices=piece.surface.vertices[order],
        faces=np.where(corners >= 0, place[corners], -1).astype(np.int32),
        lines={name: place[line] for name, line in piece.surface.lines.items()},
        input_index=piece.surface.input_index[order],
    )
    positions = result.positions[piece.vertex_index[order]]
    network = _network_of(result, cut_surface, positions, piece.face_index)
    in_piece = np.full(len(result.positions), -1, dtype=np.int32)
    in_piece[piece.vertex_index[order]] = np.arange(len(order), dtype=np.int32)
    cuts = [_within(made, in_piece, number) for made in result.cuts]
    datum = glued.lines.get(result.datum_name, np.empty(0, dtype=np.int32))
    energies = Relaxation(network, RelaxOptions(), start=positions).energies()
    last = replace(
        result.stages[-1],
        spring_energy_j=energies.spring,
        guard_energy_j=energies.guard,
        strain_energy_j=strain_energy(network, positions),
    )
    return replace(
        result,
        surface=glued,
        network=network,
        positions=positions,
        datum=datum if len(datum) > 1 else choose_datum(glued),
        datum_name=result.datum_name if len(datum) > 1 else "datum",
        development=replace(result.development, positions=result.development.positions[used]),
        stages=(*result.stages[:-1], last),
        cuts=tuple(made for made in cuts if made.seams),
        alone=None if result.alone is None else _part(result.alone, piece),
    )


def _within(made: AppliedCut, in_piece: IntArray, number: IntArray) -> AppliedCut:
    """A cut as far as both its sides lie in one piece, in that piece's numbering."""
    seams = tuple(
        Seam(path=number[seam.path], left=in_piece[seam.left], right=in_piece[seam.right])
        for seam in made.seams
        if (in_piece[seam.left] >= 0).all() and (in_piece[seam.right] >= 0).all()
    )
    return replace(made, seams=seams, paths=tuple(seam.path for seam in seams))
