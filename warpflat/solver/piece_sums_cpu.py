"""Sums over the pieces of a network, and the rotation of pieces, by NumPy on arrays of the host."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.sums import range_offsets
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import Iterate
from warpflat.solver.grain_alignment import GrainAlignment, hold_grain, remove_rotation
from warpflat.solver.step_buffers import StepBuffers

__all__ = ["HostPieceSums"]


class HostPieceSums:
    """Sums over the pieces of a state on the host; `warpflat.solver.piece_sums_cuda` has those on a CUDA device.

    Attributes:
        vertex_ranges: the slice of each piece's vertices.
    """

    def __init__(self, network: SpringNetwork, buffers: StepBuffers) -> None:
        """Prepare sums over the buffers of a network."""
        self._network, self._buffers = network, buffers
        self._vertex_begin = range_offsets([net.vertex_count for net in network.pieces])
        self._face_begin = range_offsets([net.face_count for net in network.pieces])
        self.vertex_ranges = [slice(*ends) for ends in pairwise(self._vertex_begin.tolist())]

    def guard_acts(self) -> bool:
        """Return whether the guard acts anywhere at the last evaluated state."""
        return bool(self._buffers.on_host(self._buffers.guarded).any())

    def may_move(self) -> bool:
        """Return whether any velocity may be other than zero."""
        return bool(self._buffers.velocity.numpy().any())

    def damp(self) -> int:
        """Set the velocities of pieces to zero whose forces brake their motion; return how many pieces that were."""
        buffers = self._buffers
        power = _sums(buffers.on_host(buffers.power), self._vertex_begin)
        braked = np.flatnonzero(power < 0.0) if power.min() < 0.0 else ()
        for piece in braked:
            buffers.stop[piece].launch()
        return len(braked)

    def take_stop_count(self) -> int:
        """Return how many pieces were stopped that `damp` has not reported yet, and reset the count."""
        return 0

    def mirrored(self) -> BoolArray:
        """Return whether each piece has a mirrored or collapsed cell at the last evaluated state, #P."""
        clearance = self._buffers.on_host(self._buffers.face_clearance)
        return np.logical_or.reduceat(clearance <= 0.0, self._face_begin[:-1])

    def work_of_load(self) -> FloatArray:
        """Return the sum of load times position of each piece, #P [J]."""
        load, position = (self._buffers.on_host(array) for array in (self._buffers.load, self._buffers.position))
        return np.array([np.einsum("ij,ij->", load[own], position[own]) for own in self.vertex_ranges])

    def element_energies(self) -> tuple[FloatArray, FloatArray]:
        """Return the energies of springs and of cells as last measured, #P each [J]."""
        buffers = self._buffers
        springs = _sums(buffers.on_host(buffers.vertex_energy), self._vertex_begin)
        return springs, _sums(buffers.on_host(buffers.face_energy), self._face_begin)

    def vertex_sums(self) -> FloatArray:
        """Return sums of the values last measured at the vertices, #P: kinetic energies [J], or spring tensions [N]."""
        return _sums(self._buffers.vertex_energy.numpy(), self._vertex_begin)

    def force_norms(self) -> FloatArray:
        """Return the norm of the forces on the vertices of each piece at the last evaluated state, #P [N]."""
        force = self._buffers.force.numpy()
        return np.array([np.linalg.norm(force[own]) for own in self.vertex_ranges])

    def largest_forces(self, alignments: Sequence[GrainAlignment]) -> FloatArray:
        """Return the largest cloth force on a vertex of each piece, #P [N], without forces that turn aligned pieces."""
        force = self.cloth_force()
        weight = self._network.spring_stiffness.numpy()
        remove_rotation(alignments, self._buffers.position.numpy(), force, weight)
        return np.sqrt(np.maximum.reduceat(np.einsum("ij,ij->i", force, force), self._vertex_begin[:-1]))

    def hold_grain(self, alignments: Sequence[GrainAlignment]) -> None:
        """Turn aligned pieces and balance their torque (see `warpflat.solver.grain_alignment`)."""
        buffers = self._buffers
        position, velocity, load, force = (
            array.numpy() for array in (buffers.position, buffers.velocity, buffers.load, buffers.force)
        )
        hold_grain(alignments, position, velocity, load, force, self._network.spring_stiffness.numpy())

    def cloth_force(self) -> FloatArray:
        """Return the forces of the cloth and its seams, without the load, at the last evaluated state, #V by 2 [N]."""
        return np.asarray(self._buffers.force.numpy() - self._buffers.load.numpy())

    def iterate(self) -> Iterate:
        """Return the layout and the forces of the cloth there, as just evaluated; may share memory with the buffers."""
        return self._buffers.position.numpy(), self.cloth_force()

    def loaded_iterate(self) -> Iterate:
        """Return the layout and all forces there, the load included; may share memory with the buffers."""
        return self._buffers.position.numpy(), self._buffers.force.numpy()

    def scratch(self) -> FloatArray:
        """Return a buffer that is free for any use until the forces are evaluated, #V by 2."""
        return np.asarray(self._buffers.first_guess.numpy())


def _sums(values: FloatArray, begin: IntArray) -> FloatArray:
    """Return the sum of each range of the values; `begin` holds where the ranges begin and where the last one ends."""
    # NumPy sums a whole array pairwise, which loses less.
    return values.sum(keepdims=True) if len(begin) == 2 else np.add.reduceat(values, begin[:-1])
