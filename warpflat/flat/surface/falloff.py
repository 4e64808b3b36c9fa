"""Values known at some vertices of a mesh, interpolated harmonically in between."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.sparse import factor_symmetric
from warpflat.flat.surface.half_edges import mesh_edges

__all__ = ["harmonic_values"]


def harmonic_values(faces: IntArray, value: FloatArray, known: BoolArray) -> FloatArray:
    """Return values that are known at some vertices of a mesh, each other one the mean of its neighbours'; 0 in parts without any.

    Args:
        faces: #F by 4, -1 last in a triangle.
        value: #V, or #V by #N; 0 where it is not known.
        known: #V.
    """
    from scipy.sparse import coo_matrix, diags

    count, free, found = len(known), np.flatnonzero(~known), value.copy()
    if len(free):
        ends = mesh_edges(faces)
        both = np.concatenate([ends[:, 0], ends[:, 1]]), np.concatenate([ends[:, 1], ends[:, 0]])
        joined = coo_matrix((np.ones(2 * len(ends)), both), shape=(count, count)).tocsr()
        laplacian = (diags(np.asarray(joined.sum(axis=1)).ravel()) - joined).tocsr()
        found[free] = factor_symmetric(laplacian[free][:, free])(joined[free] @ value)
    return found
