"""The Laplacian of a surface, factored once: the metric in which layouts of a small mesh are compared.

It is the stiffness matrix of linear finite elements on the cells (the cotangent Laplacian), so that x^T L x is the integral of a
displacement's squared gradient. What resists in a layout is the deformation of its cells, slivers among them, however small they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.surface.cells import make_cells
from warpflat.surface.mesh import Surface, once_per_surface

__all__ = ["Laplacian", "factor_pays", "laplacian_of"]

# The most vertices of a surface that is factored: a factor's entries grow faster than the mesh.
_MOST_VERTICES = 20_000
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
        corner: #C by 3, the cells' vertices.
        rest: #C by 3 by 2, the cells laid flat [m].
        weight: #C by 3, weight of the edge opposite each corner: half its cotangent, times the share with which a cell counts.
        matrix: #V by #V.
        factor: of the matrix, with a little added that holds the piece as a whole.
    """

    corner: IntArray
    rest: FloatArray
    weight: FloatArray
    matrix: csc_array
    factor: SuperLU

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the solution for right sides of #V or #V by #N."""
        return np.asarray(self.factor.solve(np.ascontiguousarray(right)))

    def as_rigid_step(self, positions: FloatArray) -> FloatArray:
        """Return a layout (#V by 2 [m]) in which each cell is nearer to a rotated copy of itself.

        One local and one global step of the as-rigid-as-possible layout (Liu et al. 2008).
        """
        p, rest, weight = positions[self.corner], self.rest, self.weight
        # The best rotation of each cell, as cosine and sine.
        cosine, sine = np.zeros((2, len(weight)))
        edges = []
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            own, now = rest[:, j] - rest[:, i], p[:, j] - p[:, i]
            cosine += weight[:, k] * (own[:, 0] * now[:, 0] + own[:, 1] * now[:, 1])
            sine += weight[:, k] * (own[:, 0] * now[:, 1] - own[:, 1] * now[:, 0])
            edges.append((i, j, own))
        size = np.maximum(np.hypot(cosine, sine), np.finfo(float).tiny)
        cosine, sine = cosine / size, sine / size
        pull = np.zeros((len(self.rest), 3, 2))
        for k, (i, j, own) in enumerate(edges):
            turned = np.stack([cosine * own[:, 0] - sine * own[:, 1], sine * own[:, 0] + cosine * own[:, 1]], axis=1)
            turned *= weight[:, k, None]
            pull[:, j] += turned
            pull[:, i] -= turned
        count, vertex = len(positions), self.corner.ravel()
        right = np.stack([np.bincount(vertex, pull[:, :, axis].ravel(), minlength=count) for axis in range(2)], axis=1)
        return positions + self.solve(right - self.matrix @ positions)


def factor_pays(surface: Surface) -> bool:
    """Return whether a surface has so few vertices that it is worth while to factor its Laplacian."""
    return len(surface.vertices) <= (_MOST_OF_QUADS if surface.is_quad.all() else _MOST_VERTICES)


@once_per_surface
def laplacian_of(surface: Surface) -> Laplacian:
    """Return the Laplacian of a surface and its factor, computed once."""
    cells = make_cells(surface)
    length, x, y = cells.laid.T
    y = np.maximum(y, _LEAST_HEIGHT * np.maximum(length, np.abs(x)))
    nothing = np.zeros_like(length)
    rest = np.stack([nothing, nothing, length, nothing, x, y], axis=1).reshape(-1, 3, 2)
    cotangent = np.stack([x / y, (length - x) / y, (x * (x - length) + y * y) / (length * y)], axis=1)
    corner, weight = cells.corner, 0.5 * cells.weight[:, None] * cotangent
    a, b = corner[:, [1, 2, 0]].ravel(), corner[:, [2, 0, 1]].ravel()
    count, both = len(surface.vertices), np.tile(weight.ravel(), 2)
    of_edge = coo_array((both, (np.append(a, b), np.append(b, a))), shape=(count, count)).tocsr()
    matrix = csc_array(diags_array(np.asarray(of_edge.sum(axis=1)).ravel()) - of_edge)
    held = csc_array(matrix + diags_array(np.full(count, _REGULARISATION * matrix.diagonal().mean())))
    # On meshes with slivers and long rows, columns in this order fill a quarter of what minimum degree on A + A^T fills.
    factor = splu(held, permc_spec="COLAMD", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return Laplacian(corner=corner, rest=rest, weight=weight, matrix=matrix, factor=factor)
