"""The Laplacian of a surface, factored once: the metric in which layouts of a small mesh are compared.

It is the stiffness matrix of linear finite elements on the cells (the cotangent Laplacian), so that x^T L x is the integral of a
displacement's squared gradient. What resists in a layout is the deformation of its cells, slivers among them, however small they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array

from warpflat.core.arrays import FloatArray
from warpflat.core.sparse import factor_symmetric
from warpflat.surface.cells import make_cells
from warpflat.surface.mesh import Surface, once_per_surface

__all__ = ["Laplacian", "factor_pays", "laplacian_of"]

# The most vertices of a surface that is factored. A factor takes 1.8 KB a vertex, and its entries grow faster than the mesh.
_MOST_VERTICES = 60_000
# The same for meshes of quads alone: on larger ones multigrid cycles are as fast, and on grids faster.
_MOST_OF_QUADS = 4_000

# A cell counts as at least so high, over its length.
_LEAST_HEIGHT = 1e-4
# Added to the diagonal, over its mean, to hold a piece as a whole.
_REGULARISATION = 1e-7


@dataclass(frozen=True, kw_only=True, eq=False)
class Laplacian:
    """The Laplacian of a surface and its factor.

    Attributes:
        gradient: #C by #V, complex: times a layout x + i y it gives the sum over each cell's edges of weight times conj(as on the
            body) times (in the layout). An edge weighs half the cotangent opposite to it, times the share with which its cell counts.
        matrix: #V by #V.
        solve: returns the solution for right sides of #V or #V by #N; a little is added that holds the piece as a whole.
    """

    gradient: csr_array
    matrix: csc_array
    solve: Callable[[FloatArray], FloatArray]

    def as_rigid_step(self, positions: FloatArray) -> FloatArray:
        """Return a layout (#V by 2 [m]) in which each cell is nearer to a rotated copy of itself.

        One local and one global step of the as-rigid-as-possible layout (Liu et al. 2008).
        """
        place = np.ascontiguousarray(positions, dtype=np.float64).view(np.complex128)[:, 0]
        rotation = self.gradient @ place
        rotation /= np.maximum(np.abs(rotation), np.finfo(float).tiny)
        right = self._divergence @ rotation - self.matrix @ place
        return positions + self.solve(right.view(np.float64).reshape(-1, 2))

    @cached_property
    def _divergence(self) -> csr_array:
        return csr_array(self.gradient.conj().T)


def factor_pays(surface: Surface) -> bool:
    """Return whether a surface has so few vertices that it is worth while to factor its Laplacian."""
    return len(surface.vertices) <= (_MOST_OF_QUADS if surface.is_quad.all() else _MOST_VERTICES)


@once_per_surface
def laplacian_of(surface: Surface) -> Laplacian:
    """Return the Laplacian of a surface and its factor, computed once."""
    cells = make_cells(surface)
    length, x, y = cells.laid.T
    y = np.maximum(y, _LEAST_HEIGHT * np.maximum(length, np.abs(x)))
    rest = np.stack([np.zeros_like(length), length, x + 1j * y], axis=1)
    cotangent = np.stack([x / y, (length - x) / y, (x * (x - length) + y * y) / (length * y)], axis=1)
    weight, begin, end = 0.5 * cells.weight[:, None] * cotangent, [1, 2, 0], [2, 0, 1]
    corner, count = cells.corner, len(surface.vertices)
    a, b, each = corner[:, begin].ravel(), corner[:, end].ravel(), np.arange(count)
    diagonal = np.bincount(np.append(a, b), np.tile(weight.ravel(), 2), minlength=count)
    values = np.concatenate([-weight.ravel(), -weight.ravel(), diagonal])
    places = np.concatenate([a, b, each]), np.concatenate([b, a, each])
    matrix = coo_array((values, places), shape=(count, count)).tocsc()
    held = matrix.copy()
    held.setdiag(diagonal + _REGULARISATION * diagonal.mean())
    edge = weight * (rest[:, end] - rest[:, begin]).conj()
    at_corner, offset = edge[:, begin] - edge[:, end], np.arange(0, 3 * len(corner) + 1, 3)
    gradient = csr_array((at_corner.ravel(), corner.ravel(), offset), shape=(len(corner), count))
    return Laplacian(gradient=gradient, matrix=matrix, solve=factor_symmetric(held))
