"""Products of many vectors at once, stored coordinates first: NumPy handles three long rows several times as fast as many short ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray

__all__ = ["cross", "dot", "norm", "points_at"]


def points_at(vertices: FloatArray, index: NDArray[np.integer]) -> FloatArray:
    """Return the rows of `vertices` (#V by 3) at indices, as 3 by the shape of `index`."""
    return np.take(vertices.T, index, axis=1)


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the scalar products of vectors (3 by any shape)."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def norm(a: FloatArray) -> FloatArray:
    """Return the lengths of vectors (3 by any shape)."""
    return np.asarray(np.sqrt(dot(a, a)))


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the vector products of vectors (3 by any shape)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
