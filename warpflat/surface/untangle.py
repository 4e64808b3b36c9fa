"""A layout with a few mirrored faces, smoothed where they are until none is left."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.surface.mesh import Surface
from warpflat.surface.topology import corner_triangles, half_edges

__all__ = ["untangle"]


def untangle(
    surface: Surface, positions: NDArray[np.float64], *, least_area: float = 1e-3, most_sweeps: int = 200
) -> tuple[NDArray[np.float64], int]:
    """Move the vertices of mirrored faces, and those beside, towards the mean of their neighbours until all faces agree.

    Meant for the odd face that a first layout turns over: far from such faces nothing moves. Neighbours count with one
    over the length of their edge on the body; a vertex of the border moves between its neighbours on the border only.

    Args:
        surface: the piece.
        positions: #V by 2 [m], the layout.
        least_area: a corner triangle with less than this share of its area on the body counts as mirrored.
        most_sweeps: give up after so many; a layout that is folded at large is not mended from its edges.

    Returns:
        #V by 2 positions [m], and how many corner triangles are still mirrored (0: done).
    """
    corner, _, _ = corner_triangles(surface.faces)
    p = surface.vertices[corner]
    body = 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    start, end, weight = _neighbours(surface)
    size = len(surface.vertices)
    total = np.bincount(start, weights=weight, minlength=size)
    flat = np.array(positions, dtype=np.float64)
    mirrored = _signed_areas(corner, flat) <= least_area * body
    for _ in range(most_sweeps):
        if not mirrored.any():
            break
        moving = np.zeros(size, dtype=bool)
        moving[corner[mirrored]] = True
        moving[start[moving[end]]] = True
        edge = moving[start]
        mean = np.stack(
            [np.bincount(start[edge], weights=weight[edge] * flat[end[edge], k], minlength=size) for k in (0, 1)],
            axis=1,
        )
        flat[moving] = 0.5 * (flat[moving] + mean[moving] / total[moving, None])
        mirrored = _signed_areas(corner, flat) <= least_area * body
    return flat, int(mirrored.sum())


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
