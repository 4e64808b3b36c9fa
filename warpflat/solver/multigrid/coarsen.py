"""One coarser level of a piece: a quarter of its vertices, faces between them, and how layouts go between the two.

The vertices of the coarser level are vertices of the finer one. A rectangular grid of quads keeps every second row and column, quads on
any other lattice, with concave corners, holes or cracks, all those too in which the border turns. Any other mesh loses vertices by edges
that collapse, an independent set of them at a time, until about a quarter is left: a vertex vanishes into the neighbour that leaves
the best triangles, on the border only along the border. So corners, holes and cracks stay what they are: two sides of a crack have
different vertices, and nothing joins them.

In a pass one vertex goes after the other, while the rings of neighbours that stay are kept up to date; only those beside which none has
gone yet look for the neighbour that is best. The triangles are made at the end, of those that have three different corners left.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import warp as wp
from numpy.typing import NDArray
from scipy.sparse import csr_array

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.launch import record
from warpflat.core.sums import begins
from warpflat.core.threads import thread_count
from warpflat.kernels.coarsen import Ring, collapse, compose_rows, order_rings, place, sort_corners
from warpflat.model.springs import unweighed_springs
from warpflat.solver.multigrid.cubic_interpolation import GridProlongation, LatticeProlongation
from warpflat.solver.multigrid.grid_coarsening import (
    CoarsenedGrid,
    ResamplingKind,
    Transfer,
    can_be_coarsened,
    coarsened_grid,
    resampled_grid,
    thirds_of,
)
from warpflat.surface.cells import cells_of, creases_of
from warpflat.surface.grid import rows_and_columns
from warpflat.surface.mesh import Surface, once_per_surface, store_results
from warpflat.surface.row_major_grid import row_major_grid
from warpflat.surface.triangles import triangulate

__all__ = [
    "Coarser",
    "coarser",
    "coarser_surfaces",
    "has_coarser",
    "hierarchy_in_background",
    "inherit_levels",
    "is_coarsest",
    "resampled_surface",
    "steps_down",
]


# A level of at most so many vertices is the coarsest; grids go further down than other meshes, of which too few faces make a poor
# piece.
_COARSEST = 250
_COARSEST_GRID = 100
# Passes of collapses to one level, the share of vertices from which on there are no more, and the least share that a level must lose to be
# worth having.
_PASSES = 10
_ENOUGH = 0.27
_LEAST_GAIN = 0.3
# A pass takes first the vertices that leave triangles of this quality (1: equilateral), then the others down to the least; where
# that does not make them fewer, worse ones.
_GOOD = 0.6
_LEAST_QUALITIES = (0.3, 0.15)
# Levels of a surface of more vertices are worth a thread of their own.
_WORTH_A_THREAD = 5_000
# Entries that a ring may have, unless it has more from the start; that of a vertex inside has six or so.
_ROOM = 16
# Entries for which a row of the prolongation has room at first; it has four or so.
_ENTRIES = 8


@dataclass(frozen=True, kw_only=True)
class Coarser:
    """A coarser level.

    Attributes:
        surface: of the level; its vertices are the finer level's, without lines.
        kept: #C, the finer level's vertices that it has.
        transfer: weights by which layouts go up, and forces down.
        face_of: #G, for each of its faces one of the finer level's that lies in or beside it.
        smooth_carry: of quads on a lattice, what carries layouts up by cubics.
        is_lowest: whether it is relaxed without a coarser one.
    """

    surface: Surface
    kept: IntArray
    transfer: Transfer
    face_of: IntArray
    smooth_carry: GridProlongation | LatticeProlongation | None = None
    is_lowest: bool = False

    @property
    def prolongation(self) -> csr_array:
        """#V by #C, rows add up to 1."""
        return self.transfer.prolongation


def is_coarsest(surface: Surface) -> bool:
    """Whether a level is small enough to have no coarser one."""
    return len(surface.vertices) <= (_COARSEST_GRID if surface.is_quad.all() else _COARSEST)


def coarser(surface: Surface, layout: FloatArray | None = None) -> Coarser | None:
    """The next coarser level, or None where none is to be had.

    Args:
        surface: the finer one, of any size.
        layout: #V by 2, of it, without mirrored faces [m]; triangles that collapses leave are not mirrored in it either. Without,
            they are good on the body only.
    """
    thinned = coarsened_grid(surface)
    if thinned is not None:
        return _step_to(surface, thinned)
    return None if rows_and_columns(surface) is not None else _collapsed(surface, layout)


def _step_to(surface: Surface, thinned: CoarsenedGrid) -> Coarser:
    return Coarser(
        surface=_part_of_quads(surface, surface.vertices[thinned.kept], thinned.faces, thinned.of_faces),
        kept=thinned.kept,
        transfer=thinned.transfer,
        face_of=thinned.face_of,
        smooth_carry=thinned.carry(surface),
    )


_inherited: WeakKeyDictionary[Surface, Coarser] = WeakKeyDictionary()


@once_per_surface
def _next(surface: Surface) -> Coarser | None:
    return _inherited.pop(surface, None) or coarser(surface)


def inherit_levels(surface: Surface, other: Surface) -> None:
    """Let a surface have the coarser levels of another one of the same faces, whose vertices do not lie far from its own."""
    for step in coarser_surfaces(other):
        if step.smooth_carry is None:
            part = _part(surface, surface.vertices[step.kept], step.surface.faces, step.surface.of_faces)
            _inherited[surface] = replace(step, surface=part)
        # Lattices share what their faces tell anyway.
        following = _next(surface)
        if following is None:
            return
        surface = following.surface


def has_coarser(surface: Surface) -> bool:
    """Whether a surface has a coarser level; of a grid none is made to tell, since one that is large starts without them."""
    if is_coarsest(surface):
        return False
    grid = rows_and_columns(surface)
    return _next(surface) is not None if grid is None else can_be_coarsened(grid)


@once_per_surface
def coarser_surfaces(surface: Surface) -> tuple[Coarser, ...]:
    """All coarser levels of a surface, good on the body, the finest first, down to the coarsest; made once for each surface."""
    return tuple(steps_down(surface))


def steps_down(surface: Surface) -> Iterator[Coarser]:
    """The same, each made when it is asked for."""
    while not is_coarsest(surface):
        step = _next(surface)
        if step is None:
            return
        yield step
        surface = step.surface


def resampled_surface(surface: Surface, kind: ResamplingKind) -> tuple[Surface, GridProlongation, IntArray] | None:
    """Return a small grid that is spread over a large one, made once for each surface; None of a surface that is no grid.

    Returns:
        the grid (see `warpflat.solver.multigrid.grid_coarsening.resampled_grid`), the interpolation of its layouts on the large one,
        and #G, for each of its faces one of the large grid's that lies in it.
    """
    known = _spreads(surface)
    if kind not in known:
        known[kind] = _spread(surface, kind)
    return known[kind]


@once_per_surface
def _spreads(surface: Surface) -> dict[ResamplingKind, tuple[Surface, GridProlongation, IntArray] | None]:
    return {}


def _spread(surface: Surface, kind: ResamplingKind) -> tuple[Surface, GridProlongation, IntArray] | None:
    spread = resampled_grid(surface, kind)
    if spread is None:
        return None
    carry = spread.carry(surface)
    part = _part_of_quads(surface, carry.sample(surface.vertices), spread.faces, spread.of_faces)
    thirds = thirds_of(part) if kind == "thirds" else None
    if thirds is not None:
        _inherited[part] = replace(_step_to(part, thirds), is_lowest=True)
    return part, carry, spread.face_of


@contextmanager
def hierarchy_in_background(surface: Surface) -> Iterator[None]:
    """Make `coarser_surfaces` of a large surface, and what no layout changes of those of triangles, on another core while the body runs;
    be done with all at its end. Those of a grid, which starts from one spread over it, are not needed so soon, nor take long."""
    if thread_count() == 1 or len(surface.vertices) < _WORTH_A_THREAD or row_major_grid(surface) is not None:
        yield
        return
    with ThreadPoolExecutor(max_workers=1) as other:
        made = other.submit(_prepare_levels, surface)
        yield
        made.result()


def _prepare_levels(surface: Surface) -> None:
    for step in coarser_surfaces(surface):
        if step.smooth_carry is None:
            cells_of(step.surface)
            unweighed_springs(step.surface)
            _ = step.transfer.transpose


def _part_of_quads(surface: Surface, vertices: FloatArray, faces: IntArray, of_faces: dict[str, Any]) -> Surface:
    """A coarser level of quads. Creases are not looked for there: a level is only to lead to where the finer one is at rest, and as to that
    there is no difference."""
    part = _part(surface, vertices, faces, of_faces)
    store_results(part, {creases_of: np.full(len(faces), -1, dtype=np.int8)})
    return part


def _part(
    surface: Surface, vertices: FloatArray, faces: NDArray[np.integer], of_faces: dict[str, Any] | None = None
) -> Surface:
    """The surface with these vertices (#C by 3 [m]) and faces, and what is known of the faces."""
    return Surface(
        vertices=vertices,
        faces=faces.astype(np.int32, copy=False),
        name=surface.name,
        input_vertices=vertices,
        input_index=np.arange(len(vertices), dtype=np.int32),
        of_faces={} if of_faces is None else of_faces,
    )


# --- any other mesh


def _collapsed(surface: Surface, layout: FloatArray | None) -> Coarser | None:
    count = len(surface.vertices)
    triangles, face = surface.faces[:, :3], np.arange(len(surface.faces), dtype=np.int32)
    if surface.is_quad.any():
        triangles, face = triangulate(surface.faces)
    ring = _ring_of(surface.vertices, layout, triangles)
    if ring.degree.numpy().min() < 0:
        return None
    target, beside, gone = (wp.zeros(count, dtype=wp.int32, device="cpu") for _ in range(3))
    passes, remain = np.zeros(1, dtype=np.int32), np.full(1, count, dtype=np.int32)
    for least in _LEAST_QUALITIES:
        wp.launch(
            collapse,
            dim=1,
            inputs=[ring, least, _GOOD, int(_ENOUGH * count), _PASSES],
            outputs=[passes, remain, target, beside, gone],
            device="cpu",
        )
    if remain[0] > (1.0 - _LEAST_GAIN) * count:
        return None
    parent = wp.empty(count, dtype=wp.vec3i, device="cpu")
    weight = wp.empty(count, dtype=wp.vec3d, device="cpu")
    record(place, dim=count, inputs=[ring, gone, target], outputs=[parent, weight], device="cpu").launch()
    kept = np.flatnonzero(gone.numpy() == 0).astype(np.int32)
    corners = _ends(gone.numpy(), parent.numpy()[:, 0])[triangles]
    whole = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    corners = corners[whole]
    prolongation = _prolongation(gone, parent, weight, int(passes[0]))
    return Coarser(
        surface=_part(surface, surface.vertices[kept], np.column_stack([corners, np.full(len(corners), -1)])),
        kept=kept,
        transfer=Transfer(lambda: prolongation),
        face_of=face[whole],
    )


def _ends(gone: IntArray, into: IntArray) -> IntArray:
    """#V, the number among those kept of where each has vanished in the end. into: #V, where at first, in pass `gone`."""
    end = np.where(gone == 0, np.arange(len(gone), dtype=np.int32), into)
    for _ in range(int(gone.max()).bit_length()):
        end = end[end]
    return (np.cumsum(gone == 0, dtype=np.int32) - 1)[end]


def _prolongation(gone: wp.array, parent: wp.array, weight: wp.array, passes: int) -> csr_array:
    """#V by #C: the row of a vertex that is gone is the sum of its parents' rows by its weights."""
    count, room = len(gone), _ENTRIES * len(gone)
    row, offset = np.empty(count, dtype=np.int32), np.zeros(count + 1, dtype=np.int32)
    while offset[-1] == 0:
        column, value = np.empty(room, dtype=np.int32), np.empty(room)
        given, made = [gone, parent, weight, passes], [row, offset, column, value]
        wp.launch(compose_rows, dim=1, inputs=given, outputs=made, device="cpu")
        room *= 2
    kept, end = count - np.count_nonzero(gone.numpy()), offset[-1]
    return csr_array(csr_array((value[:end], column[:end], offset), shape=(count, kept))[row])


def _ring_of(vertices: FloatArray, layout: FloatArray | None, triangles: IntArray) -> Ring:
    count = len(vertices)
    ring = Ring()
    ring.vertices = _given(vertices, wp.vec3d)
    ring.layout = _given(np.zeros((0, 2)) if layout is None else layout, wp.vec2d)
    around = np.bincount(triangles.ravel(), minlength=count)
    room, sides = (begins(places) for places in (np.maximum(around + 2, _ROOM), around))
    ring.offset = _given(room, wp.int32)
    ring.degree = wp.zeros(count, dtype=wp.int32, device="cpu")
    ring.neighbor = wp.empty(int(room[-1]), dtype=wp.int32, device="cpu")
    side = wp.empty(int(sides[-1]), dtype=wp.vec2i, device="cpu")
    begin, corners = _given(sides, wp.int32), _given(triangles, wp.vec3i)
    wp.launch(sort_corners, dim=1, inputs=[corners, begin], outputs=[ring.degree, side], device="cpu")
    order = record(
        order_rings, dim=count, inputs=[ring.offset, begin, side], outputs=[ring.degree, ring.neighbor], device="cpu"
    )
    order.launch()
    return ring


def _given(values: NDArray[np.generic], dtype: type) -> wp.array:
    """The values for a kernel that does not write to them."""
    return wp.array(np.ascontiguousarray(values), dtype=dtype, device="cpu", copy=False)
