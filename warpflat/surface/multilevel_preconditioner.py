"""A preconditioner for diffusion over a surface: sums over cubes of space, each twice as large as those before (Bramble et al. 1990).

Jacobi's alone takes a number of iterations that grows as the length of diffusion over that of an edge.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator

from warpflat.core.arrays import FloatArray
from warpflat.core.sparse import factor_symmetric

__all__ = ["multilevel_preconditioner"]

# The first cubes are so many edges wide; there are sums down to a level of at most so many cubes, which is solved.
_FIRST_CUBE = 1.5
_COARSEST = 3_000


def multilevel_preconditioner(matrix: csr_array, places: FloatArray, edge_length: float) -> LinearOperator:
    """Return an approximate inverse of a symmetric matrix of diffusion, the sum of those on all levels.

    Args:
        matrix: #V by #V, positive definite.
        places: #V by 3 [m].
        edge_length: of a typical edge [m].
    """
    cube = np.floor((places - places.min(axis=0)) / (_FIRST_CUBE * edge_length)).astype(np.int64)
    inverse, into = [1.0 / matrix.diagonal()], []
    while matrix.shape[0] > _COARSEST:
        _, sizes_y, sizes_z = (cube.max(axis=0) + 1).tolist()
        _, first, label = np.unique(
            (cube[:, 0] * sizes_y + cube[:, 1]) * sizes_z + cube[:, 2], return_index=True, return_inverse=True
        )
        rows = np.arange(len(label) + 1, dtype=np.int32)
        sums = csr_array((np.ones(len(label)), label.astype(np.int32), rows), shape=(len(label), len(first)))
        matrix = (sums.T @ (matrix @ sums)).tocsr()
        inverse.append(1.0 / matrix.diagonal())
        into.append(label)
        cube = cube[first] // 2
    solve = factor_symmetric(matrix)

    def apply(residual: FloatArray) -> FloatArray:
        residuals: list[FloatArray] = [residual]
        for label, own in zip(into, inverse[1:], strict=True):
            residuals.append(np.bincount(label, residuals[-1], minlength=len(own)).astype(np.float64, copy=False))
        result: FloatArray = solve(residuals[-1])
        for level in range(len(into) - 1, -1, -1):
            result = result[into[level]]
            result += inverse[level] * residuals[level]
        return result

    return LinearOperator((len(places), len(places)), matvec=apply, dtype=np.float64)
