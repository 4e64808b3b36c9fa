"""Noise of a scan's vertices, smoothed away where it is there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from warpflat.core.arrays import FloatArray

__all__ = ["smooth_noise"]

# A scan is noisy if its vertices waver off the skin by more than this share of their distance: smooth meshes of bodies by
# 0.03, those with 2 mm of noise on each coordinate by 0.18.
_WAVERS = 0.08
# Taubin's shares of a step towards the neighbours' mean and of the step back, and how many of both.
_SHRINK, _GROW, _STEPS = 0.50, -0.53, 10


def smooth_noise(points: FloatArray, triangles: NDArray[np.int64]) -> tuple[FloatArray, float]:
    """Return vertices without noise, which neither shrink nor lose their shape, and how far they wavered.

    Args:
        points: #P by 3, any unit.
        triangles: #T by 3.

    Returns:
        Vertices; the median distance along the normal by which noise moved them, 0 if they were left as they are.

    Source: Taubin, "A signal processing approach to fair surface design", 1995.
    """
    from scipy.sparse import coo_array

    ends = np.concatenate([triangles[:, :2], triangles[:, 1:], triangles[:, ::2]])
    ends = np.unique(np.sort(ends, axis=1), axis=0)
    both = np.concatenate([ends, ends[:, ::-1]])
    size = len(points)
    degree = np.bincount(both[:, 0], minlength=size).astype(float)
    beside = np.linalg.norm(points[both[:, 0]] - points[both[:, 1]], axis=1)
    distance = np.bincount(both[:, 0], beside, minlength=size) / degree
    mean = coo_array((1.0 / degree[both[:, 0]], (both[:, 0], both[:, 1])), shape=(size, size)).tocsr()
    corners = points[triangles]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = np.column_stack([
        np.bincount(triangles.ravel(), np.repeat(facing[:, k], 3), minlength=size) for k in range(3)
    ])  # fmt: skip
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    # A curved skin stands off its neighbours' mean, too, but evenly: what differs from the neighbours is noise.
    off = ((points - mean @ points) * normal).sum(axis=1)
    wavers = np.abs(off - mean @ off)
    if np.median(wavers / distance) < _WAVERS:
        return points, 0.0
    even = _even(points, mean)
    # Twicing: what was smoothed away is smoothed and added back, which returns most of what was shape.
    return even + _even(points - even, mean), float(np.median(wavers))


def _even(values: FloatArray, mean: csr_array) -> FloatArray:
    """Return values smoothed by Taubin's steps, `mean` the matrix of the neighbours' mean."""
    for _ in range(_STEPS):
        for share in (_SHRINK, _GROW):
            values = values + share * (mean @ values - values)
    return values
