"""What the driver asks of the pieces of a state whose arrays lie on a CUDA device: worked out there, but for a few numbers a piece.

`warpflat.solver.piece_sums_cpu` has the same for arrays that are the host's own, and says what each of these is.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import pairwise

import numpy as np
import warp as wp

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.core.device_sums import DeviceSums
from warpflat.core.launch import Launch, launch_each, record
from warpflat.core.launch import Sequence as LaunchSequence
from warpflat.core.sums import range_offsets
from warpflat.kernels.implicit import count_braked, stop_braked
from warpflat.kernels.prolongation import inject
from warpflat.kernels.reduce import subtract
from warpflat.kernels.rigid_motion import MOMENTS, Turn, strongest_of_blocks, sum_moments, turn_pieces
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import Mark
from warpflat.solver.grain_alignment import GrainAlignment
from warpflat.solver.step_buffers import StepBuffers

__all__ = ["DevicePieceSums"]


class DevicePieceSums:
    """As `HostPieceSums`."""

    def __init__(self, network: SpringNetwork, buffers: StepBuffers) -> None:
        """Of a network and what its steps leave behind."""
        self._network, self._buffers, self._device = network, buffers, network.device
        counts = [net.vertex_count for net in network.pieces]
        begin = range_offsets(counts)
        self.vertices = [slice(*ends) for ends in pairwise(begin.tolist())]
        self._of_vertices = DeviceSums(counts, self._device)
        self._of_faces = DeviceSums([net.face_count for net in network.pieces], self._device)
        self._stopped = wp.zeros(len(counts), dtype=wp.int32, device=self._device)
        piece = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
        self._piece_of = wp.array(piece, dtype=wp.int32, device=self._device)
        self._held: _Held | None = None
        self._damping: LaunchSequence | None = None

    def guard_acts(self) -> bool:
        # To look costs more than to go through cells that do not act.
        return True

    @property
    def damping(self) -> list[Launch]:
        """What lets pieces whose forces begin to brake the motion rest, and counts them."""
        net, buffers, power = self._network, self._buffers, self._of_vertices.result
        stop = record(
            stop_braked,
            dim=net.vertex_count,
            inputs=[self._piece_of, power, net.mass, buffers.force, buffers.stiffness, buffers.time_step],
            outputs=[buffers.velocity, buffers.driving_force, buffers.first_guess],
            device=self._device,
        )
        count = record(count_braked, dim=len(power), inputs=[power], outputs=[self._stopped], device=self._device)
        return [*self._of_vertices.summing(buffers.power), stop, count]

    def damp(self) -> int:
        if self._damping is None:
            self._damping = LaunchSequence(self.damping)
        self._damping.launch()
        return 0

    def stopped(self) -> int:
        """How many pieces have been stopped, one as often as it was, since this was asked last."""
        count = int(self._stopped.numpy().sum())
        self._stopped.zero_()
        return count

    def mirrored(self) -> BoolArray:
        return np.asarray(self._of_faces.least(self._buffers.face_clearance) <= 0.0)

    def work_of_load(self) -> FloatArray:
        return self._of_vertices.dots(self._buffers.load, self._buffers.position)

    def measured(self) -> tuple[FloatArray, FloatArray]:
        return self.of_vertices(), self._of_faces.sums(self._buffers.face_energy)

    def moves(self) -> bool:
        """Whether a velocity may be other than zero: to look would take as long as to measure the motion."""
        return True

    def of_vertices(self) -> FloatArray:
        return self._of_vertices.sums(self._buffers.vertex_energy)

    def force_sizes(self) -> FloatArray:
        return np.sqrt(self._of_vertices.dots(self._buffers.force, self._buffers.force))

    def strongest(self, upright: Sequence[GrainAlignment]) -> FloatArray:
        held = self._hold(upright)
        held.measure()
        if held.strongest is None:
            held.strongest = self._of_vertices.least_after(partial(self._record_strongest, held))
        return np.sqrt(-self._of_vertices.of(held.strongest))

    def _record_strongest(self, held: _Held, least: wp.array) -> Launch:
        buffers, weight = self._buffers, self._network.spring_stiffness
        given = [buffers.position, buffers.force, buffers.load, weight, held.piece, held.turn, self._of_vertices.blocks]
        return record(strongest_of_blocks, dim=len(least), inputs=given, outputs=[least], device=self._device)

    def hold_grain(self, upright: Sequence[GrainAlignment]) -> None:
        held = self._hold(upright)
        held.measure(ends=True)
        held.go.launch()

    def cloth_force(self) -> FloatArray:
        return np.asarray(self._cloth_force().numpy())

    def _cloth_force(self) -> wp.array:
        force, load = self._buffers.force, self._buffers.load
        alone = wp.empty_like(force)
        launch_each(subtract, len(force), [force, load], [alone], device=self._device)
        return alone

    def mark(self) -> Mark:
        return self._buffers.position, self._cloth_force()

    def mark_with_load(self) -> Mark:
        return self._buffers.position, self._buffers.force

    def room(self) -> wp.array:
        return self._buffers.first_guess

    def _hold(self, upright: Sequence[GrainAlignment]) -> _Held:
        if self._held is None or self._held.upright is not upright:
            self._held = _Held(self._network, self._buffers, upright)
        return self._held


class _Held:
    """Pieces that are held upright: those that are sewn together, say, are one network, and each is held.

    Attributes:
        upright: which. piece: #V, which of them a vertex is of, -1 where of none. turn: how each of them turns.
        go: turns them so. strongest: looks for the largest force.
    """

    strongest: LaunchSequence | None = None

    def __init__(self, network: SpringNetwork, buffers: StepBuffers, upright: Sequence[GrainAlignment]) -> None:
        device, every = network.device, np.arange(network.vertex_count, dtype=np.int32)
        self.upright, self._network, self._buffers = upright, network, buffers
        own = [every[each.vertices] for each in upright]
        self._sizes = np.array([len(vertices) for vertices in own])[:, None]
        piece = np.full(len(every), -1, dtype=np.int32)
        for number, vertices in enumerate(own):
            piece[vertices] = number
        # Blocks of each, and of what lies between.
        first = np.flatnonzero(np.diff(piece, prepend=-2))
        self._part = np.searchsorted(first, [vertices[0] for vertices in own])
        self._sums = DeviceSums(np.diff(first, append=len(every)).tolist(), device)
        self.piece = wp.array(piece, dtype=wp.int32, device=device)
        self.turn = Turn()
        for name in ("centre", "by", "middle"):
            setattr(self.turn, name, wp.zeros(len(own), dtype=wp.vec2d, device=device))
        for name in ("spin", "torque"):
            setattr(self.turn, name, wp.zeros(len(own), dtype=wp.float64, device=device))
        chords = np.array([[each.lower, each.upper] for each in upright], dtype=np.int32).ravel()
        self._chord = wp.array(chords, dtype=wp.int32, device=device)
        self._ends = wp.empty(len(chords), dtype=wp.vec2d, device=device)
        self._moments = wp.empty(MOMENTS * (len(self._sums.blocks) - 1), dtype=wp.float64, device=device)
        self.go = record(
            turn_pieces,
            dim=network.vertex_count,
            inputs=[network.spring_stiffness, self.piece, self.turn],
            outputs=[buffers.position, buffers.velocity, buffers.load],
            device=device,
        )

    def measure(self, *, ends: bool = False) -> None:
        """Find out how the pieces turn; with their ends, how they are to be turned."""
        if not self.upright:
            return
        net, buffers, device = self._network, self._buffers, self._network.device
        blocks = self._sums.blocks
        given = [buffers.position, buffers.velocity, buffers.force, buffers.load, net.spring_stiffness, blocks]
        launch_each(sum_moments, len(blocks) - 1, given, [self._moments], device=device)
        of_parts = np.add.reduceat(self._moments.numpy().reshape(-1, MOMENTS), self._sums.first_block[:-1])
        weight, moment, second, place, force, torque, motion, swing = np.split(
            of_parts[self._part], np.cumsum([1, 2, 1, 2, 2, 1, 2]), axis=1
        )
        middle = moment / weight
        inertia = np.maximum(second - weight * (middle**2).sum(axis=1, keepdims=True), 1e-300)
        found = {
            "middle": middle,
            "torque": (torque - _cross(middle, force)) / inertia,
            "spin": (swing - _cross(middle, motion)) / inertia,
        }
        if ends:
            launch_each(inject, len(self._chord), [self._chord, buffers.position], [self._ends], device=device)
            at = self._ends.numpy().reshape(-1, 2, 2)
            chord = at[:, 1] - at[:, 0]
            length = np.linalg.norm(chord, axis=1, keepdims=True)
            with np.errstate(invalid="ignore", divide="ignore"):
                # i |c| / c: from the chord to straight up.
                by = np.where(length > 0.0, np.stack([chord[:, 1], chord[:, 0]], axis=1) / length, [1.0, 0.0])
            found |= {"by": by, "centre": place / self._sizes}
        for name, values in found.items():
            getattr(self.turn, name).assign(values if values.shape[1] == 2 else values[:, 0])


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """#P by 1, of vectors (#P by 2)."""
    return (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[:, None]
