"""A layout with a few mirrored faces, smoothed where they are until none is left."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.launch import launch_each
from warpflat.kernels.strain import measure_flat_cells
from warpflat.surface.half_edges import half_edges_of
from warpflat.surface.mesh import Surface
from warpflat.surface.triangles import corner_triangles
from warpflat.surface.unfold import corners_of
from warpflat.surface.vectors import cross, norm, points_at

__all__ = ["signed_cell_areas", "untangle"]


# So many sweeps without fewer mirrored triangles than ever before, and the rest will not help either.
_PATIENCE = 25
# Vertices that are so many rings away from mirrored triangles are ready to be moved; more, once sweeps come there.
_RINGS = 6


def untangle(
    surface: Surface,
    positions: FloatArray,
    *,
    least_area: float = 1e-3,
    most_sweeps: int = 200,
    suspects: NDArray[np.integer] | None = None,
) -> tuple[FloatArray, int]:
    """Move the vertices of mirrored faces, and those beside, towards the mean of their neighbours until all faces agree.

    Meant for the odd face that a first layout turns over: far from such faces nothing moves, and nothing is looked at.
    Neighbours count with one over the length of their edge on the body; a vertex of the border moves between its neighbours
    on the border only.

    Args:
        surface: the piece.
        positions: #V by 2 [m], the layout.
        least_area: a corner triangle with less than this share of its area on the body counts as mirrored.
        most_sweeps: give up after so many, or once sweeps stop helping; a layout that is folded at large is not mended from
            its edges.
        suspects: where all that are mirrored is known, these corner triangles; no others are looked at to begin with.

    Returns:
        #V by 2 positions [m], and how many corner triangles are still mirrored (0: done).
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
    for _ in range(most_sweeps):
        if not patch.inside[turned].all():
            patch = _Patch(surface, np.flatnonzero(patch.near), _RINGS)
        moving = np.union1d(turned, patch.pulled[turned].indices)
        flat[moving] = 0.5 * (flat[moving] + patch.pull[moving] @ flat / patch.total[moving])
        mirrored = crushed(patch.corner[np.unique(patch.around[moving].indices)])
        turned = np.unique(mirrored)
        fewest, since = (len(mirrored), 0) if len(mirrored) < fewest else (fewest, since + 1)
        if len(mirrored) == 0 or since > _PATIENCE:
            break
    return flat, len(mirrored)


class _Patch:
    """Some vertices and those up to so many rings around them.

    Attributes:
        near: #V, whether a vertex is one of these. inside: #V, whether its neighbours are, too.
        pull: #V by #V, the weights of the neighbours that each of these moves between; of others none. pulled: its transpose. total: #V by
            1, its rows' sums.
        corner: #N by 3, the corner triangles at these vertices. around: #V by #N, which of them lie around each vertex.
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
        self.pull = csr_array((weight[keep], (start[keep], end[keep])), shape=(count, count))
        self.pulled, self.total = self.pull.T.tocsr(), self.pull.sum(axis=1)[:, None]
        self.corner, _, _ = corner_triangles(surface.faces[faces])
        offset = np.arange(0, self.corner.size + 1, 3)
        self.around = csc_array(
            (np.ones(self.corner.size, dtype=np.int8), self.corner.ravel(), offset), shape=(count, len(self.corner))
        ).tocsr()


def _faces_at(surface: Surface, vertices: NDArray[np.integer]) -> IntArray:
    """The faces that have some of these vertices, in their order."""
    around = corners_of(surface)
    begin, counts = around.offset[vertices], np.diff(around.offset)[vertices]
    first = np.cumsum(counts) - counts
    return np.unique(around.entry[np.repeat(begin - first, counts) + np.arange(counts.sum())] // 4)


def signed_cell_areas(corner: IntArray, positions: FloatArray) -> FloatArray:
    """#C, signed areas of triangles (#C by 3) in the plane [m2]; 0 or less where one is mirrored or collapsed."""
    area = np.empty(len(corner))
    given = [np.ascontiguousarray(positions), np.ascontiguousarray(corner, dtype=np.int32)]
    launch_each(measure_flat_cells, len(corner), given, [area])
    return area
