"""Untangling: a layout with a few mirrored faces is smoothed around them until none is left."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.launch import launch_each
from warpflat.flat.surface.half_edges import half_edges_of
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.triangles import corner_triangles
from warpflat.flat.surface.unfold import corners_of
from warpflat.flat.surface.vectors import cross, norm, points_at
from warpflat.kernels.strain import measure_flat_cells

__all__ = ["signed_cell_areas", "untangle"]


# Sweeps without a new least number of mirrored triangles after which it gives up.
_PATIENCE = 25
# Sweeps after which it gives up in any case.
_MOST_SWEEPS = 200
# Rings of vertices around mirrored triangles that are prepared for moving; more are prepared once sweeps reach their edge.
_RINGS = 6


def untangle(
    surface: Surface,
    positions: FloatArray,
    *,
    least_area: float = 1e-3,
    suspects: NDArray[np.integer] | None = None,
) -> tuple[FloatArray, int]:
    """Move the vertices of mirrored faces, and their neighbours, towards the mean of their neighbours until no face is mirrored.

    It is meant for a few faces that a first layout turns over: far from them nothing moves. The weight of a neighbour is the
    inverse of its edge's length on the body. A vertex on the border moves between its neighbours on the border only.

    Args:
        surface: the piece.
        positions: #V by 2 [m], the layout.
        least_area: a corner triangle with less than this share of its area on the body counts as mirrored.
        suspects: corner triangles that hold all mirrored ones, if they are known.

    Returns:
        #V by 2 positions [m], and the number of corner triangles that are still mirrored (0: done).
    """
    corner, _, _ = corner_triangles(surface.faces)
    flat = np.array(positions, dtype=np.float64)

    def crushed(corner: IntArray) -> IntArray:
        p = points_at(surface.vertices, corner.T)
        body = 0.5 * norm(cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))
        return corner[signed_cell_areas(corner, flat) <= least_area * body]

    mirrored = crushed(corner if suspects is None else corner[suspects])
    if len(mirrored) == 0:
        return flat, 0
    turned = np.unique(mirrored)
    patch = _Patch(surface, turned, _RINGS)
    fewest, since = len(mirrored), 0
    for _ in range(_MOST_SWEEPS):
        if not patch.inside[turned].all():
            patch = _Patch(surface, np.flatnonzero(patch.near), _RINGS)
        moving = np.union1d(turned, patch.transposed[turned].indices)
        flat[moving] = 0.5 * (flat[moving] + patch.weights[moving] @ flat / patch.total[moving])
        mirrored = crushed(patch.corner[np.unique(patch.around[moving].indices)])
        turned = np.unique(mirrored)
        fewest, since = (len(mirrored), 0) if len(mirrored) < fewest else (fewest, since + 1)
        if len(mirrored) == 0 or since > _PATIENCE:
            break
    return flat, len(mirrored)


class _Patch:
    """Some vertices and a number of rings around them.

    Attributes:
        near: #V, true for these vertices.
        inside: #V, true for those whose neighbours are all among them.
        weights: #V by #V, the weights of each of these vertices' neighbours; rows of other vertices are empty.
        transposed: the transpose of `weights`.
        total: #V by 1, the row sums of `weights`.
        corner: #N by 3, the corner triangles at these vertices.
        around: #V by #N, 1 where a corner triangle lies at a vertex.
    """

    def __init__(self, surface: Surface, vertices: NDArray[np.integer], rings: int) -> None:
        from scipy.sparse import csc_array, csr_array

        count, he = len(surface.vertices), half_edges_of(surface)
        self.near = np.zeros(count, dtype=bool)
        faces = _faces_at(surface, vertices)
        self.near[vertices] = True
        for _ in range(rings):
            self.inside = self.near.copy()
            corners = surface.faces[faces]
            self.near[corners[corners >= 0]] = True
            faces = _faces_at(surface, np.flatnonzero(self.near))
        on_rim = he.count == 1
        border = np.zeros(count, dtype=bool)
        border[he.edges[on_rim]] = True
        here = self.near[he.edges[:, 0]] | self.near[he.edges[:, 1]]
        edges, on_rim = he.edges[here], on_rim[here]
        start, end = np.concatenate([edges, edges[:, ::-1]]).T
        ends = points_at(surface.vertices, edges.T)
        weight = np.tile(1.0 / np.maximum(norm(ends[:, 1] - ends[:, 0]), np.finfo(float).tiny), 2)
        keep = self.near[start] & (~border[start] | np.tile(on_rim, 2))
        self.weights = csr_array((weight[keep], (start[keep], end[keep])), shape=(count, count))
        self.transposed, self.total = self.weights.T.tocsr(), self.weights.sum(axis=1)[:, None]
        self.corner, _, _ = corner_triangles(surface.faces[faces])
        offset = np.arange(0, self.corner.size + 1, 3)
        self.around = csc_array(
            (np.ones(self.corner.size, dtype=np.int8), self.corner.ravel(), offset), shape=(count, len(self.corner))
        ).tocsr()


def _faces_at(surface: Surface, vertices: NDArray[np.integer]) -> IntArray:
    """Return the faces at some vertices, sorted."""
    around = corners_of(surface)
    begin, counts = around.offset[vertices], np.diff(around.offset)[vertices]
    first = np.cumsum(counts) - counts
    return np.unique(around.entry[np.repeat(begin - first, counts) + np.arange(counts.sum())] // 4)


def signed_cell_areas(corner: IntArray, positions: FloatArray) -> FloatArray:
    """Return #C, signed areas [m2] of triangles (#C by 3) in the plane; 0 or less where one is mirrored or collapsed."""
    area = np.empty(len(corner))
    given = [np.ascontiguousarray(positions), np.ascontiguousarray(corner, dtype=np.int32)]
    launch_each(measure_flat_cells, len(corner), given, [area])
    return area
