"""Sums over all vertices of a piece, on one core.

A linear algebra library wakes threads of its own for a product of ten thousand numbers, and lets them spin for a while afterwards, on
the cores on which the kernels' ranges are to run: a quarter of the time of a relaxation. These are as fast and wake nobody.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["dot", "products", "weighted_rows"]

FloatArray = NDArray[np.float64]

# Products of so many columns are small enough to stay on one core.
_COLUMNS = 512


def dot(a: FloatArray, b: FloatArray) -> float:
    """The sum of all products of numbers at the same place."""
    return float(np.einsum("i,i->", a.ravel(), b.ravel()))


def products(a: FloatArray, b: FloatArray) -> FloatArray:
    """#A by #B, scalar products of the rows of `a` (#A by #N) with those of `b` (#B by #N)."""
    total = np.zeros((len(a), len(b)))
    for begin in range(0, a.shape[1], _COLUMNS):
        some = slice(begin, begin + _COLUMNS)
        total += a[:, some] @ b[:, some].T
    return total


def weighted_rows(weight: FloatArray, rows: FloatArray) -> FloatArray:
    """#N, the sum of rows (#A by #N), each times its weight (#A)."""
    total = weight[0] * rows[0]
    for k in range(1, len(rows)):
        total += weight[k] * rows[k]
    return np.asarray(total)
