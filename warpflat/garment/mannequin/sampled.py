"""Values sampled along a row, or at the vertices of a mesh: made smooth, what they are between samples, and where they are extreme."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from warpflat.core import BoolArray, FloatArray, IntArray

__all__ = ["neighbour_mean", "row_at", "rows_around", "smooth", "smoothstep", "summit"]


def smooth(values: FloatArray, sigma: float) -> FloatArray:
    """Return rows of values (#S by ...) smoothed by a Gaussian of a standard deviation [rows]; the end rows go on beyond the ends."""
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(values, sigma, axis=0, mode="nearest"))


def smoothstep(share: FloatArray) -> FloatArray:
    """Return shares from 0 to 1 that rise from 0 and to 1 without a corner (Hermite's cubic)."""
    return share * share * (3.0 - 2.0 * share)


def row_at(values: FloatArray, heights: FloatArray, height: float) -> FloatArray:
    """Return what rows of values (#S by ...) at rising heights (#S [m]) are at a height between them."""
    at = float(np.clip(np.interp(height, heights, np.arange(len(heights))), 0.0, len(heights) - 1.001))
    i, f = int(at), at - int(at)
    return np.asarray((1.0 - f) * values[i] + f * values[i + 1])


def summit(y: FloatArray, values: FloatArray, row: int) -> float:
    """Return the height where the parabola through `row` and its neighbours has its extreme [m]."""
    a, b, c = values[row - 1 : row + 2]
    bend = a - 2.0 * b + c
    if abs(bend) < 1e-9:
        return float(y[row])
    return float(y[row] + np.clip(0.5 * (a - c) / bend, -1.0, 1.0) * (y[row + 1] - y[row]))


def rows_around(rows: BoolArray, row: int) -> slice:
    """Return the unbroken rows around `row` that are true, as it is."""
    off = np.flatnonzero(~rows)
    before, after = off[off < row], off[off > row]
    return slice(int(before[-1]) + 1 if len(before) else 0, int(after[0]) if len(after) else len(rows))


def neighbour_mean(edges: IntArray, count: int) -> csr_array:
    """Return the matrix (#V by #V, sparse) of the mean of each vertex's neighbours.

    Args:
        edges: #E by 2, each once.
        count: #V.
    """
    from scipy.sparse import coo_array

    both = np.concatenate([edges, edges[:, ::-1]])
    degree = np.bincount(both[:, 0], minlength=count)
    return csr_array(coo_array((1.0 / degree[both[:, 0]], tuple(both.T)), shape=(count, count)))
