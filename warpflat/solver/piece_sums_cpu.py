"""What the driver asks of the pieces of a state whose arrays are the host's own."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.sums import range_offsets
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import Mark
from warpflat.solver.grain_alignment import GrainAlignment, hold_grain, remove_rotation
from warpflat.solver.step_buffers import StepBuffers

__all__ = ["HostPieceSums"]


class HostPieceSums:
    """Sums over pieces, and pieces as wholes, by NumPy; `warpflat.solver.piece_sums_cuda` has the same for a CUDA device.

    Attributes:
        vertices: of each piece, its vertices.
    """

    def __init__(self, network: SpringNetwork, buffers: StepBuffers) -> None:
        """Of a network and what its steps leave behind."""
        self._network, self._buffers = network, buffers
        self._vertex_begin = range_offsets([net.vertex_count for net in network.pieces])
        self._face_begin = range_offsets([net.face_count for net in network.pieces])
        self.vertices = [slice(*ends) for ends in pairwise(self._vertex_begin.tolist())]

    def guard_acts(self) -> bool:
        """Whether it does anywhere, at the last evaluated state."""
        return bool(self._buffers.on_host(self._buffers.guarded).any())

    def damp(self) -> int:
        """Velocities of pieces whose forces begin to brake the motion become zero; how many of them."""
        buffers = self._buffers
        power = _sums(buffers.on_host(buffers.power), self._vertex_begin)
        braked = np.flatnonzero(power < 0.0) if power.min() < 0.0 else ()
        for piece in braked:
            buffers.stop[piece].launch()
        return len(braked)

    def stopped(self) -> int:
        """How many of them there were besides."""
        return 0

    def mirrored(self) -> BoolArray:
        """#P, whether a piece has cells that are mirrored or without area, at the last evaluated state."""
        clearance = self._buffers.on_host(self._buffers.face_clearance)
        return np.logical_or.reduceat(clearance <= 0.0, self._face_begin[:-1])

    def work_of_load(self) -> FloatArray:
        """#P, sum of load times place [J]."""
        load, position = (self._buffers.on_host(array) for array in (self._buffers.load, self._buffers.position))
        return np.array([np.einsum("ij,ij->", load[here], position[here]) for here in self.vertices])

    def measured(self) -> tuple[FloatArray, FloatArray]:
        """#P each, the energies of springs and cells that have been measured last [J]."""
        buffers = self._buffers
        springs = _sums(buffers.on_host(buffers.vertex_energy), self._vertex_begin)
        return springs, _sums(buffers.on_host(buffers.face_energy), self._face_begin)

    def of_vertices(self) -> FloatArray:
        """#P, sums of what has been measured last at the vertices: energies of the motion [J], or pulls [N]."""
        return _sums(self._buffers.vertex_energy.numpy(), self._vertex_begin)

    def moves(self) -> bool:
        """Whether a velocity may be other than zero."""
        return bool(self._buffers.velocity.numpy().any())

    def force_sizes(self) -> FloatArray:
        """#P, the norm of all forces on the vertices at the last evaluated state [N]."""
        force = self._buffers.force.numpy()
        return np.array([np.linalg.norm(force[here]) for here in self.vertices])

    def strongest(self, upright: Sequence[GrainAlignment]) -> FloatArray:
        """#P, the largest force of the cloth on a vertex [N], but for what only turns a piece that is held upright."""
        force = self.cloth_force()
        weight = self._network.spring_stiffness.numpy()
        remove_rotation(upright, self._buffers.position.numpy(), force, weight)
        return np.sqrt(np.maximum.reduceat(np.einsum("ij,ij->i", force, force), self._vertex_begin[:-1]))

    def hold_grain(self, upright: Sequence[GrainAlignment]) -> None:
        """See `warpflat.solver.grain_alignment`."""
        buffers = self._buffers
        position, velocity, load, force = (
            array.numpy() for array in (buffers.position, buffers.velocity, buffers.load, buffers.force)
        )
        hold_grain(upright, position, velocity, load, force, self._network.spring_stiffness.numpy())

    def cloth_force(self) -> FloatArray:
        """#V by 2, forces of the cloth and the seams alone, at the last evaluated state [N]."""
        return np.asarray(self._buffers.force.numpy() - self._buffers.load.numpy())

    def mark(self) -> Mark:
        """Where it is, and the forces of the cloth there, as they have just been evaluated; perhaps of the buffers themselves."""
        return self._buffers.position.numpy(), self.cloth_force()

    def mark_with_load(self) -> Mark:
        """The same with all forces."""
        return self._buffers.position.numpy(), self._buffers.force.numpy()

    def room(self) -> FloatArray:
        """#V by 2, what is spare until forces are evaluated."""
        return np.asarray(self._buffers.first_guess.numpy())


def _sums(values: FloatArray, begin: IntArray) -> FloatArray:
    """The sum of each range of the values; `begin` has its begins and the last end."""
    # Of a whole array NumPy adds in pairs, which loses less.
    return values.sum(keepdims=True) if len(begin) == 2 else np.add.reduceat(values, begin[:-1])
