"""Coarsening of a mesh: a quarter of its vertices, faces between them, and the transfer between the two meshes.

The vertices of the coarser mesh are vertices of the finer one. A rectangular grid of quads keeps every second row and
column; quads on any other lattice, with concave corners, holes or cracks, also keep all rows and columns in which the
border turns. Any other mesh loses vertices by edge collapses, an independent set of them in each pass, until about a
quarter is left: a vertex collapses into the neighbour that leaves the best triangles, and a border vertex only along
the border. So corners, holes and cracks remain: the two sides of a crack have different vertices, and nothing joins
them.

In a pass vertices collapse one after the other, and the rings of the neighbours that stay are kept up to date. A vertex
looks for its best neighbour only if no neighbour of it has collapsed in the pass. At the end the triangles with three
different corners left are the faces.
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
from warpflat.core.compile import launch_quietly
from warpflat.core.launch import record
from warpflat.core.sums import range_offsets
from warpflat.core.threads import thread_count
from warpflat.kernels.coarsen import Ring, collapse, locate, order_rings, sort_corners
from warpflat.kernels.prolongation import compose_rows
from warpflat.model.springs import spring_geometry
from warpflat.solver.multigrid.cubic_interpolation import GridProlongation, LatticeProlongation
from warpflat.solver.multigrid.grid_coarsening import (
    CoarsenedGrid,
    Transfer,
    can_be_coarsened,
    coarsened_grid,
)
from warpflat.surface.cells import face_creases, make_cells
from warpflat.surface.grid import rows_and_columns
from warpflat.surface.mesh import Surface, once_per_surface, store_results
from warpflat.surface.triangles import triangulate

__all__ = [
    "Coarsening",
    "can_coarsen",
    "coarsen",
    "coarsenings_of",
    "hierarchy_in_background",
    "inherit_levels",
    "is_coarsest",
    "iterate_coarsenings",
]


# A mesh of at most this many vertices is the coarsest. Grids go further down than other meshes, whose few faces would
# make a poor piece.
_COARSEST = 250
_COARSEST_GRID = 100
# Passes of collapses to one level; the share of vertices left at which they end; the least share that a level must lose
# to be worth having.
_PASSES = 10
_SHARE_LEFT = 0.27
_LEAST_LOSS = 0.3
# A pass first collapses the vertices that leave triangles of this quality (1: equilateral), then others down to the
# least quality; if too few collapse, the lower least quality applies.
_GOOD = 0.6
_LEAST_QUALITIES = (0.3, 0.15)
# Surfaces of more vertices are worth a thread of their own for their levels.
_WORTH_A_THREAD = 5_000
# Capacity of a ring, unless it has more entries from the start; the ring of an inner vertex has about six.
_RING_CAPACITY = 16
# Initial capacity of a row of the prolongation; it has about four entries.
_ENTRIES = 8


@dataclass(frozen=True, kw_only=True)
class Coarsening:
    """The step from a mesh to the next coarser one.

    Attributes:
        surface: the coarser mesh; its vertices are the finer one's, and it has no lines.
        kept: #C, the finer mesh's vertices that it keeps.
        transfer: weights that interpolate layouts on the finer mesh, and whose transpose restricts forces.
        face_of: #G, for each of its faces one of the finer ones in or beside it.
        smooth_interpolation: cubic interpolation of layouts on the finer mesh, for quads on a lattice.
    """

    surface: Surface
    kept: IntArray
    transfer: Transfer
    face_of: IntArray
    smooth_interpolation: GridProlongation | LatticeProlongation | None = None

    @property
    def prolongation(self) -> csr_array:
        """The weights of linear interpolation, #V by #C; rows add up to 1."""
        return self.transfer.prolongation


def is_coarsest(surface: Surface) -> bool:
    """Return whether a mesh is small enough to have no coarser one."""
    return len(surface.vertices) <= (_COARSEST_GRID if surface.is_quad.all() else _COARSEST)


def coarsen(surface: Surface, layout: FloatArray | None = None) -> Coarsening | None:
    """Make the next coarser mesh.

    Args:
        surface: the finer mesh, of any size.
        layout: #V by 2, a layout of it without mirrored faces [m]. Given, edge collapses mirror no triangle in it;
            otherwise triangles are checked on the body only.

    Returns:
        None where no coarser mesh is worth having.
    """
    grid = coarsened_grid(surface)
    if grid is not None:
        return _coarsen_quads(surface, grid)
    return None if rows_and_columns(surface) is not None else _collapse_edges(surface, layout)


def _coarsen_quads(surface: Surface, grid: CoarsenedGrid) -> Coarsening:
    return Coarsening(
        surface=_coarse_quads(surface, surface.vertices[grid.kept], grid.faces, grid.of_faces),
        kept=grid.kept,
        transfer=grid.transfer,
        face_of=grid.face_of,
        smooth_interpolation=grid.make_interpolation(surface),
    )


_inherited: WeakKeyDictionary[Surface, Coarsening] = WeakKeyDictionary()


@once_per_surface
def _next(surface: Surface) -> Coarsening | None:
    return _inherited.pop(surface, None) or coarsen(surface)


def inherit_levels(surface: Surface, other: Surface) -> None:
    """Give a surface the coarser levels of another one with the same faces, and with vertices not far from its own."""
    for step in coarsenings_of(other):
        if step.smooth_interpolation is None:
            part = _coarse_surface(surface, surface.vertices[step.kept], step.surface.faces, step.surface.of_faces)
            _inherited[surface] = replace(step, surface=part)
        # Lattices share what follows from their faces anyway.
        following = _next(surface)
        if following is None:
            return
        surface = following.surface


def can_coarsen(surface: Surface) -> bool:
    """Return whether a surface has a coarser level. For a grid none is made."""
    if is_coarsest(surface):
        return False
    grid = rows_and_columns(surface)
    return _next(surface) is not None if grid is None else can_be_coarsened(grid)


@once_per_surface
def coarsenings_of(surface: Surface) -> tuple[Coarsening, ...]:
    """Return all coarser meshes of a surface, the finest first, checked on the body; made once for each surface."""
    return tuple(iterate_coarsenings(surface))


def iterate_coarsenings(surface: Surface) -> Iterator[Coarsening]:
    """Iterate over the coarser meshes of a surface, the finest first; each is made when it is reached."""
    while not is_coarsest(surface):
        step = _next(surface)
        if step is None:
            return
        yield step
        surface = step.surface


@contextmanager
def hierarchy_in_background(surface: Surface) -> Iterator[None]:
    """Make the coarser meshes of a large surface in another thread; they are ready at the end of the `with` block.

    For triangle meshes this includes all that depends on no layout. Those of a grid do not take long.
    """
    few = thread_count() == 1 or len(surface.vertices) < _WORTH_A_THREAD
    if few or rows_and_columns(surface) is not None:
        yield
        return
    with ThreadPoolExecutor(max_workers=1) as other:
        prepared = other.submit(_prepare_levels, surface)
        yield
        prepared.result()


def _prepare_levels(surface: Surface) -> None:
    for step in coarsenings_of(surface):
        if step.smooth_interpolation is None:
            make_cells(step.surface)
            spring_geometry(step.surface)
            _ = step.transfer.transpose


def _coarse_quads(surface: Surface, vertices: FloatArray, faces: IntArray, of_faces: dict[str, Any]) -> Surface:
    """Return a coarser mesh of quads, without creases: these make no difference to a correction of the finer level."""
    part = _coarse_surface(surface, vertices, faces, of_faces)
    store_results(part, {face_creases: np.full(len(faces), -1, dtype=np.int8)})
    return part


def _coarse_surface(
    surface: Surface, vertices: FloatArray, faces: NDArray[np.integer], of_faces: dict[str, Any] | None = None
) -> Surface:
    """Return a surface of these vertices (#C by 3 [m]) and faces, with what is known of the faces."""
    return Surface(
        vertices=vertices,
        faces=faces.astype(np.int32, copy=False),
        name=surface.name,
        input_vertices=vertices,
        input_index=np.arange(len(vertices), dtype=np.int32),
        of_faces={} if of_faces is None else of_faces,
    )


# --- any other mesh


def _collapse_edges(surface: Surface, layout: FloatArray | None) -> Coarsening | None:
    count = len(surface.vertices)
    triangles, face = surface.faces[:, :3], np.arange(len(surface.faces), dtype=np.int32)
    if surface.is_quad.any():
        triangles, face = triangulate(surface.faces)
    ring = _make_ring(surface.vertices, layout, triangles)
    if ring.degree.numpy().min() < 0:
        return None
    target, beside, gone = (wp.zeros(count, dtype=wp.int32, device="cpu") for _ in range(3))
    passes, remain = np.zeros(1, dtype=np.int32), np.full(1, count, dtype=np.int32)
    for least in _LEAST_QUALITIES:
        launch_quietly(
            collapse,
            dim=1,
            inputs=[ring, least, _GOOD, int(_SHARE_LEFT * count), _PASSES],
            outputs=[passes, remain, target, beside, gone],
            device="cpu",
        )
    if remain[0] > (1.0 - _LEAST_LOSS) * count:
        return None
    parent = wp.empty(count, dtype=wp.vec3i, device="cpu")
    weight = wp.empty(count, dtype=wp.vec3d, device="cpu")
    record(locate, dim=count, inputs=[ring, gone, target], outputs=[parent, weight], device="cpu").launch()
    kept = np.flatnonzero(gone.numpy() == 0).astype(np.int32)
    corners = _final_vertices(gone.numpy(), parent.numpy()[:, 0])[triangles]
    whole = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    corners = corners[whole]
    prolongation = _prolongation(gone, parent, weight, int(passes[0]))
    return Coarsening(
        surface=_coarse_surface(surface, surface.vertices[kept], np.column_stack([corners, np.full(len(corners), -1)])),
        kept=kept,
        transfer=Transfer(lambda: prolongation),
        face_of=face[whole],
    )


def _final_vertices(gone: IntArray, into: IntArray) -> IntArray:
    """Return the kept vertex into which each vertex has finally collapsed, #V, by its number among those kept.

    Args:
        gone: #V, the pass in which a vertex collapsed; 0 if it is kept.
        into: #V, the vertex into which it collapsed then.
    """
    end = np.where(gone == 0, np.arange(len(gone), dtype=np.int32), into)
    for _ in range(int(gone.max()).bit_length()):
        end = end[end]
    return (np.cumsum(gone == 0, dtype=np.int32) - 1)[end]


def _prolongation(gone: wp.array, parent: wp.array, weight: wp.array, passes: int) -> csr_array:
    """Return the weights of interpolation, #V by #C: a collapsed vertex has the weighted sum of its parents' rows."""
    count, capacity = len(gone), _ENTRIES * len(gone)
    row, offset = np.empty(count, dtype=np.int32), np.zeros(count + 1, dtype=np.int32)
    while offset[-1] == 0:
        column, value = np.empty(capacity, dtype=np.int32), np.empty(capacity)
        given, made = [gone, parent, weight, passes], [row, offset, column, value]
        launch_quietly(compose_rows, dim=1, inputs=given, outputs=made, device="cpu")
        capacity *= 2
    kept, end = count - np.count_nonzero(gone.numpy()), offset[-1]
    return csr_array(csr_array((value[:end], column[:end], offset), shape=(count, kept))[row])


def _make_ring(vertices: FloatArray, layout: FloatArray | None, triangles: IntArray) -> Ring:
    count = len(vertices)
    ring = Ring()
    ring.vertices = _as_input(vertices, wp.vec3d)
    ring.layout = _as_input(np.zeros((0, 2)) if layout is None else layout, wp.vec2d)
    around = np.bincount(triangles.ravel(), minlength=count)
    slots, sides = (range_offsets(places) for places in (np.maximum(around + 2, _RING_CAPACITY), around))
    ring.offset = _as_input(slots, wp.int32)
    ring.degree = wp.zeros(count, dtype=wp.int32, device="cpu")
    ring.neighbor = wp.empty(int(slots[-1]), dtype=wp.int32, device="cpu")
    side = wp.empty(int(sides[-1]), dtype=wp.vec2i, device="cpu")
    begin, corners = _as_input(sides, wp.int32), _as_input(triangles, wp.vec3i)
    launch_quietly(sort_corners, dim=1, inputs=[corners, begin], outputs=[ring.degree, side], device="cpu")
    order = record(
        order_rings, dim=count, inputs=[ring.offset, begin, side], outputs=[ring.degree, ring.neighbor], device="cpu"
    )
    order.launch()
    return ring


def _as_input(values: NDArray[np.generic], dtype: type) -> wp.array:
    """Return the values as an array for a kernel that only reads them."""
    return wp.array(np.ascontiguousarray(values), dtype=dtype, device="cpu", copy=False)
