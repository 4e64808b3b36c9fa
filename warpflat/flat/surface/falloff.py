"""Values given along a few lines of a mesh, interpolated harmonically in between."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.sparse import factor_symmetric
from warpflat.flat.surface.half_edges import mesh_edges

__all__ = ["falloff_weights", "harmonic_values"]


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


def falloff_weights(
    faces: IntArray, given: Sequence[tuple[IntArray, FloatArray]], stops: Sequence[IntArray], count: int
) -> FloatArray:
    """Interpolate values given at some vertices over a mesh.

    Args:
        faces: #F by 4, -1 last in a triangle.
        given: rows of vertices with a value for each.
        stops: rows of vertices with 0.
        count: #V.

    Returns:
        #V, the values given, and harmonic in between.
    """
    value, known = np.zeros(count), np.zeros(count, dtype=bool)
    for stop in stops:
        known[stop] = True
    for vertices, values in given:
        value[vertices], known[vertices] = values, True
    return harmonic_values(faces, value, known)
