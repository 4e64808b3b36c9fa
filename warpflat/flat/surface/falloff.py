"""Values given along a few lines of a mesh, interpolated harmonically in between."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.flat.surface.half_edges import mesh_edges

__all__ = ["falloff_weights"]


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
    from scipy.sparse import coo_matrix, diags
    from scipy.sparse.linalg import spsolve

    value, known = np.zeros(count), np.zeros(count, dtype=bool)
    for stop in stops:
        known[stop] = True
    for vertices, values in given:
        value[vertices], known[vertices] = values, True
    free = np.flatnonzero(~known)
    if len(free):
        ends = mesh_edges(faces)
        ones = np.ones(2 * len(ends))
        rows, columns = np.concatenate([ends[:, 0], ends[:, 1]]), np.concatenate([ends[:, 1], ends[:, 0]])
        joined = coo_matrix((ones, (rows, columns)), shape=(count, count)).tocsr()
        laplacian = (diags(np.asarray(joined.sum(axis=1)).ravel()) - joined).tocsr()
        value[free] = spsolve(laplacian[free][:, free].tocsc(), joined[free] @ value)
    return value
