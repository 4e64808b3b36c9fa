"""The extreme of sampled values, between samples."""

from __future__ import annotations

import numpy as np

from warpflat.core import FloatArray

__all__ = ["summit"]


def summit(y: FloatArray, values: FloatArray, row: int) -> float:
    """Return the height where the parabola through `row` and its neighbours has its extreme [m]."""
    a, b, c = values[row - 1 : row + 2]
    bend = a - 2.0 * b + c
    if abs(bend) < 1e-9:
        return float(y[row])
    return float(y[row] + np.clip(0.5 * (a - c) / bend, -1.0, 1.0) * (y[row + 1] - y[row]))
