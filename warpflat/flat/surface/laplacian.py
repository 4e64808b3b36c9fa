"""The Laplacian of a surface, factored once: the metric in which layouts of a small mesh are compared.

It is the stiffness matrix of linear finite elements on the cells (the cotangent Laplacian), so that x^T L x is the integral of a
displacement's squared gradient. What resists in a layout is the deformation of its cells, slivers among them, however small they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, diags_array

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.sparse import factor_symmetric
from warpflat.flat.surface.cells import make_cells
from warpflat.flat.surface.mesh import Surface, once_per_surface

__all__ = [
    "MOST_FACTORED",
    "Laplacian",
    "cotangent_matrix",
    "factor_pays",
    "held_laplacian",
    "laplacian_of",
    "laplacian_solver",
]

#: The most vertices of what is factored: a factor takes 0.3 to 0.7 KB a vertex. L-BFGS over it is as fast as multigrid cycles on isotropic
#: grids of up to 10,000 vertices, and in other cloth, on triangles and on ragged pieces up to ten times as fast.
MOST_FACTORED = 100_000

# A cell counts as at least so high, over its length.
_LEAST_HEIGHT = 1e-4
# Added to the diagonal, over its mean, as rounding may leave it singular beside slivers.
_REGULARISATION = 1e-7
# The corners of a cell between which the edge opposite to each corner runs.
_BEGIN, _END = [1, 2, 0], [2, 0, 1]


Solve = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Laplacian:
    """The Laplacian of a surface and its factor.

    Attributes:
        gradient: #C by #V, complex: times a layout x + i y it gives the sum over each cell's edges of weight times conj(as on the
            body) times (in the layout). An edge weighs half the cotangent opposite to it, times the share with which its cell counts.
        matrix: #V by #V.
        solve: the solution by `laplacian_solver`.
    """

    gradient: csr_array
    matrix: csc_array
    solve: Solve

    def as_rigid_step(self, positions: FloatArray) -> FloatArray:
        """Return a layout (#V by 2 [m]) in which each cell is nearer to a rotated copy of itself.

        One local and one global step of the as-rigid-as-possible layout (Liu et al. 2008).
        """
        place = np.ascontiguousarray(positions, dtype=np.float64).view(np.complex128)[:, 0]
        rotation = self.gradient @ place
        rotation /= np.maximum(np.abs(rotation), np.finfo(float).tiny)
        right = (self.gradient.T @ rotation.conj()).conj() - self.matrix @ place
        return positions + self.solve(right.view(np.float64).reshape(-1, 2))


def factor_pays(surface: Surface) -> bool:
    """Return whether a surface has so few vertices that it is worth while to factor its Laplacian."""
    return len(surface.vertices) <= MOST_FACTORED


def laplacian_of(surface: Surface) -> Laplacian:
    """Return the Laplacian of a surface. Only its factor is kept."""
    # The factor first: most memory is taken while it is made.
    solve, matrix = laplacian_solver(surface), cotangent_matrix(surface)
    laid, weight, corner = _cotangent_weights(surface)
    rest = np.zeros((len(laid), 3), dtype=np.complex128)
    rest[:, 1], rest[:, 2] = laid[:, 0], laid[:, 1] - 1j * laid[:, 2]
    edge = weight * (rest[:, _END] - rest[:, _BEGIN])
    at_corner, offset = edge[:, _BEGIN] - edge[:, _END], np.arange(0, 3 * len(corner) + 1, 3, dtype=np.int32)
    gradient = csr_array((at_corner.ravel(), corner.ravel(), offset), shape=(len(corner), len(surface.vertices)))
    return Laplacian(gradient=gradient, matrix=matrix, solve=solve)


@once_per_surface
def laplacian_solver(surface: Surface) -> Solve:
    """Return the solution by the Laplacian for right sides of #V or #V by #N, computed once.

    The factor is in single precision, which takes half of the memory; steps of a minimisation are not the worse for it.
    """
    return factor_symmetric(held_laplacian(surface), dtype=np.float32)


def held_laplacian(surface: Surface) -> csc_array:
    """Return the Laplacian with a spring at one vertex that holds the piece as a whole: forces whose sum is zero do not feel it."""
    matrix = cotangent_matrix(surface)
    diagonal = matrix.diagonal()
    mean = diagonal.mean()
    diagonal += _REGULARISATION * mean
    diagonal[0] += mean
    matrix.setdiag(diagonal)
    return matrix


def cotangent_matrix(surface: Surface) -> csc_array:
    """Return the Laplacian as a matrix (#V by #V)."""
    _, weight, corner = _cotangent_weights(surface)
    count = len(surface.vertices)
    a, b, weight = corner[:, _BEGIN].ravel(), corner[:, _END].ravel(), weight.ravel()
    sides = coo_array((-weight, (a, b)), shape=(count, count)).tocsc()
    matrix = sides + sides.T
    return csc_array(matrix - diags_array(matrix.sum(axis=0)))


def _cotangent_weights(surface: Surface) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return the laid cells (#C by 3), the weights of their edges (#C by 3), and their vertices (#C by 3)."""
    cells = make_cells(surface)
    length, x, y = cells.laid.T
    y = np.maximum(y, _LEAST_HEIGHT * np.maximum(length, np.abs(x)))
    cotangent = np.stack([x / y, (length - x) / y, (x * (x - length) + y * y) / (length * y)], axis=1)
    return np.stack([length, x, y], axis=1), 0.5 * cells.weight[:, None] * cotangent, cells.corner
