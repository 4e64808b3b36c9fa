"""A layout with a few mirrored faces, smoothed where they are until none is left."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.surface.mesh import Surface
from warpflat.surface.topology import corner_triangles, half_edges, stable_order

__all__ = ["untangle"]


# So many sweeps without fewer mirrored triangles than ever before, and the rest will not help either.
_PATIENCE = 25


def untangle(
    surface: Surface, positions: NDArray[np.float64], *, least_area: float = 1e-3, most_sweeps: int = 200
) -> tuple[NDArray[np.float64], int]:
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

    Returns:
        #V by 2 positions [m], and how many corner triangles are still mirrored (0: done).
    """
    corner, _, _ = corner_triangles(surface.faces)
    p = surface.vertices[corner]
    body = 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    flat = np.array(positions, dtype=np.float64)
    mirrored = np.flatnonzero(_signed_areas(corner, flat) <= least_area * body)
    if len(mirrored) == 0:
        return flat, 0
    size = len(flat)
    start, end, weight = _neighbours(surface)
    total = np.bincount(start, weights=weight, minlength=size)
    of_start, of_end, of_vertex = (_Rows(keys, size) for keys in (start, end, corner.ravel()))
    fewest, since = len(mirrored), 0
    for _ in range(most_sweeps):
        turned = np.unique(corner[mirrored])
        moving = np.union1d(turned, start[of_end.at(turned)[0]])
        pair, row = of_start.at(moving)
        share = weight[pair]
        mean = np.stack([np.bincount(row, share * flat[end[pair], k], minlength=len(moving)) for k in (0, 1)], axis=1)
        flat[moving] = 0.5 * (flat[moving] + mean / total[moving, None])
        near = np.unique(of_vertex.at(moving)[0] // 3)
        mirrored = near[_signed_areas(corner[near], flat) <= least_area * body[near]]
        fewest, since = (len(mirrored), 0) if len(mirrored) < fewest else (fewest, since + 1)
        if len(mirrored) == 0 or since > _PATIENCE:
            break
    return flat, len(mirrored)


class _Rows:
    """Which entries of an array of whole numbers below `size` have which value."""

    def __init__(self, keys: NDArray[np.integer], size: int) -> None:
        self._order = stable_order(keys)
        self._offset = np.concatenate([[0], np.cumsum(np.bincount(keys, minlength=size))])

    def at(self, values: NDArray[np.integer]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The entries with these values, value by value and in their own order; and for each the position of its value."""
        first, count = self._offset[values], self._offset[values + 1] - self._offset[values]
        row = np.repeat(np.arange(len(values)), count)
        return self._order[np.arange(len(row)) + np.repeat(first - np.cumsum(count) + count, count)], row


def _neighbours(surface: Surface) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Pairs of a vertex and one of the neighbours that it moves between, with the weight of that."""
    he = half_edges(surface.faces)
    edges = he.edges.astype(np.int64)
    on_rim = he.count == 1
    border = np.zeros(len(surface.vertices), dtype=bool)
    border[edges[on_rim]] = True
    start, end = np.concatenate([edges, edges[:, ::-1]]).T
    keep = ~border[start] | np.tile(on_rim, 2)
    start, end = start[keep], end[keep]
    length = np.linalg.norm(surface.vertices[start] - surface.vertices[end], axis=1)
    return start, end, 1.0 / np.maximum(length, np.finfo(float).tiny)


def _signed_areas(corner: NDArray[np.int32], flat: NDArray[np.float64]) -> NDArray[np.float64]:
    a, b = flat[corner[:, 1]] - flat[corner[:, 0]], flat[corner[:, 2]] - flat[corner[:, 0]]
    return np.asarray(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
