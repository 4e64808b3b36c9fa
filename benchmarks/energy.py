"""What is minimised, springs, guard, and what else holds quads, in NumPy: the one measure for every solver, and what L-BFGS is given."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from warpflat.fabric.fabric import grain_axes
from warpflat.model.network import SpringNetwork

FloatArray = NDArray[np.float64]


class LayoutEnergy:
    """Energy of a network of springs with their guard, at any layout.

    Attributes:
        ends, rest_length, stiffness: of the springs (#S by 2, #S [m], #S [N/m]).
        count: #V.
    """

    def __init__(self, network: SpringNetwork) -> None:
        """Take what is needed of the network."""
        springs, cells, fabric = network.spring_arrays, network.cell_arrays, network.fabric
        self.count = network.vertex_count
        self.ends, self.rest_length, self.stiffness = springs.ends, springs.rest_length, springs.stiffness
        rows, ones = np.arange(len(self.ends)), np.ones(len(self.ends))
        shape = (len(self.ends), self.count)
        # Differences along springs and along the cells' edges 0-1 and 0-2 as matrices: their transposes gather.
        self._along = csr_matrix((ones, (rows, self.ends[:, 1])), shape) - csr_matrix(
            (ones, (rows, self.ends[:, 0])), shape
        )
        corner = cells.corner
        rows, ones, shape = np.arange(len(corner)), np.ones(len(corner)), (len(corner), self.count)
        here = csr_matrix((ones, (rows, corner[:, 0])), shape)
        self._sides = [csr_matrix((ones, (rows, corner[:, k])), shape) - here for k in (1, 2)]
        self._edges, self._weight = cells.edges, cells.weight
        self._shear = None if springs.shear_deficit is None else springs.shear_deficit[cells.face]
        hourglass = np.zeros((0, 4)) if springs.hourglass is None else springs.hourglass
        held = np.flatnonzero(hourglass.any(axis=1))
        at = (np.repeat(np.arange(len(held)), 4), cells.faces[held].ravel())
        self._hourglass = csr_matrix((hourglass[held].ravel(), at), (len(held), self.count))
        warp, weft = grain_axes(network.grain_angle)
        onset_warp, onset_weft = map(float, network.guard.onset)
        self._threads = [
            (warp, fabric.stiffness_warp, onset_warp),
            (weft, fabric.stiffness_weft, onset_weft),
        ]

    def springs(self, positions: FloatArray) -> float:
        """sum 1/2 k (l - L)^2 [J]."""
        return 0.5 * float(self.stiffness @ (self._lengths(positions)[1] - self.rest_length) ** 2)

    def value(self, positions: FloatArray) -> float:
        """[J]; infinite if a cell is mirrored."""
        return self._evaluate(positions, gradient=False)[0]

    def value_and_gradient(self, positions: FloatArray) -> tuple[float, FloatArray]:
        """[J] and #V by 2 [N]."""
        return self._evaluate(positions, gradient=True)

    def toward_rest(self, positions: FloatArray) -> FloatArray:
        """#V by 2: sum of k L times the unit vector of each spring around a vertex (the right-hand side of majorization)."""
        d, length = self._lengths(positions)
        scale = self.stiffness * self.rest_length / np.maximum(length, 1e-300)
        return self._along.T @ (scale[:, None] * d)

    def laplacian(self) -> csr_matrix:
        """#V by #V, of the stiffnesses of springs and against waves [N/m]."""
        return (
            self._along.T @ self._along.multiply(self.stiffness[:, None]) + self._hourglass.T @ self._hourglass
        ).tocsr()

    def _lengths(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        d = self._along @ positions
        return d, np.sqrt(np.einsum("ij,ij->i", d, d))

    def _evaluate(self, positions: FloatArray, *, gradient: bool) -> tuple[float, FloatArray]:
        d, length = self._lengths(positions)
        waves = self._hourglass @ positions
        energy = 0.5 * float(self.stiffness @ (length - self.rest_length) ** 2) + 0.5 * float(np.square(waves).sum())
        slope = np.zeros_like(positions)
        a, b = (side @ positions for side in self._sides)
        det = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        if det.min() <= 0.0:
            return math.inf, slope
        if gradient:
            scale = self.stiffness * (1.0 - self.rest_length / np.maximum(length, 1e-300))
            slope += self._along.T @ (scale[:, None] * d) + self._hourglass.T @ waves
        # Columns of D^-1 times a thread e: how much of the edges 0-1 and 0-2 runs along it.
        density = np.zeros(len(det))
        pulls = []

        def wear(x: FloatArray | float, y: FloatArray | float) -> tuple[FloatArray, FloatArray]:
            share = np.column_stack([x * b[:, 1] - y * b[:, 0], y * a[:, 0] - x * a[:, 1]]) / det[:, None]
            return share, np.einsum("cij,cj->ci", self._edges, share)

        for thread, stiffness, onset in self._threads:
            share, worn = wear(*thread)
            stretch = np.sqrt(np.einsum("ij,ij->i", worn, worn))
            excess = np.maximum(stretch - 1.0 - onset, 0.0)
            density += 0.5 * stiffness * excess**2
            pulls.append((share, worn, stiffness * excess / stretch))
        if self._shear is not None:
            (share, worn), (across, turned) = wear(*self._shear.T), wear(-self._shear[:, 1], self._shear[:, 0])
            angle = np.einsum("ij,ij->i", worn, turned)
            density += 0.5 * angle**2
            pulls += [(share, turned, angle), (across, worn, angle)]
        area = 0.5 * det * self._weight
        energy += float(area @ density)
        acting = np.flatnonzero(density) if gradient else np.empty(0, dtype=int)
        if len(acting):
            # d(area psi)/dD = area (psi I - F^T P) D^-T, P = sum of p (F e) e^T; column k of the product is a force's.
            inverse = np.stack(
                [
                    np.column_stack([b[acting, 1], -b[acting, 0]]),
                    np.column_stack([-a[acting, 1], a[acting, 0]]),
                ],
                axis=1,
            )
            inverse /= det[acting, None, None]
            deformation = self._edges[acting] @ inverse
            forces = density[acting, None, None] * inverse
            for share, worn, pull in pulls:
                back = np.einsum("cji,cj->ci", deformation, worn[acting])
                forces -= pull[acting, None, None] * share[acting][:, :, None] * back[:, None, :]
            forces *= area[acting, None, None]
            for k, side in enumerate(self._sides):
                slope += side[acting].T @ forces[:, k]
        return energy, slope
