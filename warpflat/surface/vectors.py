"""Many vectors at once, coordinates first: three long rows are worked through several times as fast as many short ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray

__all__ = ["cross", "dot", "norm", "points_at"]


def points_at(vertices: FloatArray, index: NDArray[np.integer]) -> FloatArray:
    """3 by the shape of `index`, the rows of `vertices` (#V by 3) at the indices."""
    return np.take(vertices.T, index, axis=1)


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Scalar products of vectors, 3 by anything."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def norm(a: FloatArray) -> FloatArray:
    """Lengths of vectors, 3 by anything."""
    return np.asarray(np.sqrt(dot(a, a)))


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Vector products, 3 by anything."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
