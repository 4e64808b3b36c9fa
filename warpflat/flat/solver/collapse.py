"""Coarser meshes: a quarter of a mesh's vertices, faces between them, and the interpolation from there.

A rectangular grid of quads keeps every second row and column. Any other mesh loses vertices by edge collapses, an independent set of them
in each pass, until about a quarter is left: a vertex collapses into the neighbour that leaves the best triangles, and a border vertex only
along the border. So corners, holes and cracks remain: the two sides of a crack have different vertices, and nothing joins them. In a pass
vertices collapse one after the other, and the rings of the neighbours that stay are kept up to date. A vertex looks for its best neighbour
only if no neighbour of it has collapsed in the pass. At the end the triangles with three different corners left are the faces. Collapsed
vertices lie in the triangles left: these are the weights by which layouts of the coarser mesh are interpolated.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from scipy.sparse import csr_array, kron

from warpflat.core.arrays import IntArray
from warpflat.core.compile import launch_quietly
from warpflat.core.launch import record
from warpflat.core.sums import range_offsets
from warpflat.flat.surface.grid import grid_quads, rows_and_columns
from warpflat.flat.surface.mesh import Surface, once_per_surface
from warpflat.flat.surface.triangles import triangulate
from warpflat.kernels.coarsen import Ring, collapse, compose_rows, locate, order_rings, sort_corners

__all__ = ["Coarsening", "coarsen", "iterate_coarsenings"]


# A mesh of at most this many vertices is the coarsest.
_COARSEST = 250
# Passes of collapses to one level; the share of vertices left at which they end; the least share that a level must lose
# to be worth having.
_PASSES = 10
_SHARE_LEFT = 0.27
_LEAST_LOSS = 0.3
# A pass first collapses the vertices that leave triangles of this quality (1: equilateral), then others down to the
# least quality; if too few collapse, the lower least quality applies.
_GOOD = 0.6
_LEAST_QUALITIES = (0.3, 0.15)
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
        into: #V, the coarser mesh's vertex into which each of the finer one's has collapsed.
        prolongation: #V by #C, weights that interpolate layouts on the finer mesh; rows add up to 1.
        face_of: #G, for each of its faces one of the finer ones in or beside it.
    """

    surface: Surface
    kept: IntArray
    into: IntArray
    prolongation: csr_array
    face_of: IntArray


@once_per_surface
def _next(surface: Surface) -> Coarsening | None:
    grid = rows_and_columns(surface)
    if grid is None:
        return coarsen(surface)
    # Every second row and column of a grid is kept, and the last ones; between them layouts are bilinear.
    place = np.empty(grid.size, dtype=np.int32)
    place[grid.ravel()] = np.arange(grid.size, dtype=np.int32)
    lines = [np.union1d(np.arange(0, count, 2), count - 1) for count in grid.shape]
    # The weights by which the lines kept interpolate all of them, and the nearest of these to each.
    between, nearest = list[csr_array](), list[IntArray]()
    for line, count in zip(lines, grid.shape, strict=True):
        every = np.arange(count)
        before = np.minimum(np.searchsorted(line, every, side="right") - 1, len(line) - 2)
        share = (every - line[before]) / (line[before + 1] - line[before])
        entries = np.column_stack([1.0 - share, share]).ravel()
        columns = np.column_stack([before, before + 1]).astype(np.int32).ravel()
        weights = csr_array((entries, columns, 2 * np.arange(count + 1, dtype=np.int32)), shape=(count, len(line)))
        weights.eliminate_zeros()
        between.append(weights)
        nearest.append(before + (share > 0.5))
    kept = grid[np.ix_(*lines)]
    number = np.arange(kept.size, dtype=np.int32).reshape(kept.shape)
    row, column = (of[surface.faces].min(axis=1) for of in np.divmod(place, grid.shape[1]))
    face_at = np.empty((grid.shape[0] - 1, grid.shape[1] - 1), dtype=np.int32)
    face_at[row, column] = np.arange(len(surface.faces), dtype=np.int32)
    return Coarsening(
        surface=Surface(vertices=surface.vertices[kept.ravel()], faces=grid_quads(number), name=surface.name),
        kept=kept.ravel(),
        into=number[np.ix_(*nearest)].ravel()[place],
        prolongation=csr_array(kron(*between, format="csr"))[place],
        face_of=face_at[np.ix_(*(line[:-1] for line in lines))].ravel(),
    )


def iterate_coarsenings(surface: Surface, smallest: int = _COARSEST) -> Iterator[Coarsening]:
    """Iterate over the coarser meshes of a surface of more than `smallest` vertices, the finest first; each is made once."""
    while len(surface.vertices) > smallest:
        step = _next(surface)
        if step is None:
            return
        yield step
        surface = step.surface


def coarsen(surface: Surface) -> Coarsening | None:
    """Make the next coarser mesh by edge collapses; None where none is worth having."""
    count = len(surface.vertices)
    triangles, face = surface.faces[:, :3], np.arange(len(surface.faces), dtype=np.int32)
    if surface.is_quad.any():
        triangles, face = triangulate(surface.faces)
    # The vertices around each vertex, in their order.
    ring = Ring()
    ring.vertices = _as_input(surface.vertices, wp.vec3d)
    around = np.bincount(triangles.ravel(), minlength=count)
    slots, sides = (range_offsets(places) for places in (np.maximum(around + 2, _RING_CAPACITY), around))
    ring.offset = _as_input(slots, wp.int32)
    ring.degree = wp.zeros(count, dtype=wp.int32, device="cpu")
    ring.neighbor = wp.empty(int(slots[-1]), dtype=wp.int32, device="cpu")
    side = wp.empty(int(sides[-1]), dtype=wp.vec2i, device="cpu")
    begin, corners = _as_input(sides, wp.int32), _as_input(triangles, wp.vec3i)
    launch_quietly(sort_corners, dim=1, inputs=[corners, begin], outputs=[ring.degree, side], device="cpu")
    ordered = [ring.degree, ring.neighbor]
    record(order_rings, dim=count, inputs=[ring.offset, begin, side], outputs=ordered, device="cpu").launch()
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
    # The kept vertex into which each vertex has finally collapsed: pointers are doubled until they end there.
    last = np.where(gone.numpy() == 0, np.arange(count, dtype=np.int32), parent.numpy()[:, 0])
    for _ in range(int(gone.numpy().max()).bit_length()):
        last = last[last]
    into = (np.cumsum(gone.numpy() == 0, dtype=np.int32) - 1)[last]
    corners = into[triangles]
    whole = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    corners = corners[whole]
    coarse = Surface(
        vertices=surface.vertices[kept],
        faces=np.column_stack([corners, np.full(len(corners), -1)]).astype(np.int32),
        name=surface.name,
    )
    prolongation = _prolongation(gone, parent, weight, int(passes[0]))
    return Coarsening(surface=coarse, kept=kept, into=into, prolongation=prolongation, face_of=face[whole])


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


def _as_input(values: np.ndarray[Any, Any], dtype: type) -> wp.array:
    """Return the values as an array for a kernel that only reads them."""
    return wp.array(np.ascontiguousarray(values), dtype=dtype, device="cpu", copy=False)
