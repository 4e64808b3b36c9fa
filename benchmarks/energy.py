"""What is minimised: the one measure for every solver, and what L-BFGS is given."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation

FloatArray = NDArray[np.float64]


class LayoutEnergy:
    """Energy of a network, springs with their guard or cells, at any layout; and the springs, or the k_ij of cells, as a Laplacian.

    Attributes:
        count: #V.
    """

    def __init__(self, network: SpringNetwork) -> None:
        """Take what is needed of the network."""
        self.count, self._springs = network.vertex_count, network.spring_arrays
        self._state = Relaxation(network, RelaxOptions(), start=np.zeros((self.count, 2)))
        rows, ones = np.arange(self._springs.count), np.ones(self._springs.count)
        tail, head = (csr_matrix((ones, (rows, ends)), (len(rows), self.count)) for ends in self._springs.ends.T)
        # Differences along springs as a matrix: its transpose gathers.
        self._along = head - tail
        faces = network.surface.faces
        hourglass = np.zeros((0, 4)) if self._springs.hourglass is None else self._springs.hourglass
        held = np.flatnonzero(hourglass.any(axis=1))
        at = (np.repeat(np.arange(len(held)), 4), faces[held].ravel())
        self._hourglass = csr_matrix((hourglass[held].ravel(), at), (len(held), self.count))

    def value(self, positions: FloatArray) -> float:
        """[J]; infinite if a cell is mirrored."""
        self._state.place(positions)
        return self._state.energies().potential

    def value_and_gradient(self, positions: FloatArray) -> tuple[float, FloatArray]:
        """[J] and #V by 2 [N]."""
        self._state.place(positions)
        energy, force = self._state.evaluate()
        return energy, -force

    def toward_rest(self, positions: FloatArray) -> FloatArray:
        """#V by 2: sum of k L times the unit vector of each spring around a vertex (the right-hand side of majorization)."""
        d = self._along @ positions
        length = np.maximum(np.linalg.norm(d, axis=1), 1e-300)
        return self._along.T @ ((self._springs.stiffness * self._springs.rest_length / length)[:, None] * d)

    def laplacian(self) -> csr_matrix:
        """#V by #V, of the stiffnesses of springs and against waves [N/m]."""
        stiffness = self._springs.stiffness[:, None]
        return (self._along.T @ self._along.multiply(stiffness) + self._hourglass.T @ self._hourglass).tocsr()
