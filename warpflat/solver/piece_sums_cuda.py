"""Sums over the pieces of a network, and the rotation of pieces, by kernels on a CUDA device.

Only a few numbers a piece are copied to the host. `warpflat.solver.piece_sums_cpu` has the same methods for arrays of
the host, and describes each of them.
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
from warpflat.kernels.rigid_motion import MOMENTS, Turn, largest_force_of_blocks, sum_moments, turn_pieces
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import Iterate
from warpflat.solver.grain_alignment import GrainAlignment
from warpflat.solver.step_buffers import StepBuffers

__all__ = ["DevicePieceSums"]


class DevicePieceSums:
    """Sums over the pieces of a state on a CUDA device, with the methods of `HostPieceSums`."""

    def __init__(self, network: SpringNetwork, buffers: StepBuffers) -> None:
        """Prepare sums over the buffers of a network."""
        self._network, self._buffers, self._device = network, buffers, network.device
        counts = [net.vertex_count for net in network.pieces]
        begin = range_offsets(counts)
        self.vertex_ranges = [slice(*ends) for ends in pairwise(begin.tolist())]
        self._over_vertices = DeviceSums(counts, self._device)
        self._over_faces = DeviceSums([net.face_count for net in network.pieces], self._device)
        self._stopped = wp.zeros(len(counts), dtype=wp.int32, device=self._device)
        piece = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
        self._piece_of = wp.array(piece, dtype=wp.int32, device=self._device)
        self._rotation: _PieceRotation | None = None
        self._damping: LaunchSequence | None = None

    def guard_acts(self) -> bool:
        # A check costs more than a pass over cells in which the guard does not act.
        return True

    @property
    def damping(self) -> list[Launch]:
        """The launches that stop pieces whose forces brake their motion, and count them."""
        net, buffers, power = self._network, self._buffers, self._over_vertices.result
        stop = record(
            stop_braked,
            dim=net.vertex_count,
            inputs=[self._piece_of, power, net.mass, buffers.force, buffers.stiffness, buffers.time_step],
            outputs=[buffers.velocity, buffers.driving_force, buffers.first_guess],
            device=self._device,
        )
        count = record(count_braked, dim=len(power), inputs=[power], outputs=[self._stopped], device=self._device)
        return [*self._over_vertices.summing(buffers.power), stop, count]

    def damp(self) -> int:
        if self._damping is None:
            self._damping = LaunchSequence(self.damping)
        self._damping.launch()
        return 0

    def take_stop_count(self) -> int:
        count = int(self._stopped.numpy().sum())
        self._stopped.zero_()
        return count

    def mirrored(self) -> BoolArray:
        return np.asarray(self._over_faces.least(self._buffers.face_clearance) <= 0.0)

    def work_of_load(self) -> FloatArray:
        return self._over_vertices.dots(self._buffers.load, self._buffers.position)

    def element_energies(self) -> tuple[FloatArray, FloatArray]:
        return self.vertex_sums(), self._over_faces.sums(self._buffers.face_energy)

    def may_move(self) -> bool:
        # A check would take as long as measuring the kinetic energy.
        return True

    def vertex_sums(self) -> FloatArray:
        return self._over_vertices.sums(self._buffers.vertex_energy)

    def force_norms(self) -> FloatArray:
        return np.sqrt(self._over_vertices.dots(self._buffers.force, self._buffers.force))

    def largest_forces(self, alignments: Sequence[GrainAlignment]) -> FloatArray:
        rotation = self._rotation_of(alignments)
        rotation.measure()
        if rotation.largest_force is None:
            rotation.largest_force = self._over_vertices.least_after(partial(self._record_largest_force, rotation))
        return np.sqrt(-self._over_vertices.of(rotation.largest_force))

    def _record_largest_force(self, rotation: _PieceRotation, least: wp.array) -> Launch:
        buffers, weight, blocks = self._buffers, self._network.spring_stiffness, self._over_vertices.blocks
        given = [buffers.position, buffers.force, buffers.load, weight, rotation.piece, rotation.turn, blocks]
        return record(largest_force_of_blocks, dim=len(least), inputs=given, outputs=[least], device=self._device)

    def hold_grain(self, alignments: Sequence[GrainAlignment]) -> None:
        rotation = self._rotation_of(alignments)
        rotation.measure(chords=True)
        rotation.turn_pieces.launch()

    def cloth_force(self) -> FloatArray:
        return np.asarray(self._cloth_force().numpy())

    def _cloth_force(self) -> wp.array:
        force, load = self._buffers.force, self._buffers.load
        cloth = wp.empty_like(force)
        launch_each(subtract, len(force), [force, load], [cloth], device=self._device)
        return cloth

    def iterate(self) -> Iterate:
        return self._buffers.position, self._cloth_force()

    def loaded_iterate(self) -> Iterate:
        return self._buffers.position, self._buffers.force

    def scratch(self) -> wp.array:
        return self._buffers.first_guess

    def _rotation_of(self, alignments: Sequence[GrainAlignment]) -> _PieceRotation:
        if self._rotation is None or self._rotation.alignments is not alignments:
            self._rotation = _PieceRotation(self._network, self._buffers, alignments)
        return self._rotation


class _PieceRotation:
    """The rotation of the pieces whose grain is held, each on its own even where several are sewn to one network.

    Attributes:
        alignments: the pieces.
        piece: #V, the aligned piece of each vertex, -1 for none.
        turn: centre, angle, angular velocity and torque of each piece, as last measured.
        turn_pieces: turns the pieces by these.
        largest_force: finds the largest force of each piece of the network.
    """

    largest_force: LaunchSequence | None = None

    def __init__(self, network: SpringNetwork, buffers: StepBuffers, alignments: Sequence[GrainAlignment]) -> None:
        device, every = network.device, np.arange(network.vertex_count, dtype=np.int32)
        self.alignments, self._network, self._buffers = alignments, network, buffers
        own = [every[each.vertices] for each in alignments]
        self._sizes = np.array([len(vertices) for vertices in own])[:, None]
        piece = np.full(len(every), -1, dtype=np.int32)
        for number, vertices in enumerate(own):
            piece[vertices] = number
        # Ranges of vertices, of one aligned piece or of none: the parts of a cut piece have several.
        first = np.flatnonzero(np.diff(piece, prepend=-2))
        self._piece_of_range = piece[first]
        self._sums = DeviceSums(np.diff(first, append=len(every)).tolist(), device)
        self.piece = wp.array(piece, dtype=wp.int32, device=device)
        self.turn = Turn()
        for name in ("centre", "by", "middle"):
            setattr(self.turn, name, wp.zeros(len(own), dtype=wp.vec2d, device=device))
        for name in ("spin", "torque"):
            setattr(self.turn, name, wp.zeros(len(own), dtype=wp.float64, device=device))
        chords = np.array([[each.lower, each.upper] for each in alignments], dtype=np.int32).ravel()
        self._chord = wp.array(chords, dtype=wp.int32, device=device)
        self._direction = np.array([each.direction for each in alignments]).reshape(-1, 2)
        self._chord_ends = wp.empty(len(chords), dtype=wp.vec2d, device=device)
        self._moments = wp.empty(MOMENTS * (len(self._sums.blocks) - 1), dtype=wp.float64, device=device)
        self.turn_pieces = record(
            turn_pieces,
            dim=network.vertex_count,
            inputs=[network.spring_stiffness, self.piece, self.turn],
            outputs=[buffers.position, buffers.velocity, buffers.load],
            device=device,
        )

    def measure(self, *, chords: bool = False) -> None:
        """Measure torque and angular velocity of each piece; with `chords`, also the angle by which to turn it."""
        if not self.alignments:
            return
        net, buffers, device = self._network, self._buffers, self._network.device
        blocks = self._sums.blocks
        given = [buffers.position, buffers.velocity, buffers.force, buffers.load, net.spring_stiffness, blocks]
        launch_each(sum_moments, len(blocks) - 1, given, [self._moments], device=device)
        range_sums = np.add.reduceat(self._moments.numpy().reshape(-1, MOMENTS), self._sums.first_block[:-1])
        held = self._piece_of_range >= 0
        piece_sums = np.zeros((len(self.alignments), MOMENTS))
        np.add.at(piece_sums, self._piece_of_range[held], range_sums[held])
        weight, moment, second, place, force, torque, motion, swing = np.split(
            piece_sums, np.cumsum([1, 2, 1, 2, 2, 1, 2]), axis=1
        )
        middle = moment / weight
        inertia = np.maximum(second - weight * (middle**2).sum(axis=1, keepdims=True), 1e-300)
        found = {
            "middle": middle,
            "torque": (torque - _cross(middle, force)) / inertia,
            "spin": (swing - _cross(middle, motion)) / inertia,
        }
        if chords:
            launch_each(inject, len(self._chord), [self._chord, buffers.position], [self._chord_ends], device=device)
            ends = self._chord_ends.numpy().reshape(-1, 2, 2)
            chord = ends[:, 1] - ends[:, 0]
            length = np.linalg.norm(chord, axis=1, keepdims=True)
            with np.errstate(invalid="ignore", divide="ignore"):
                # d |c| / c: from the chord to its direction d.
                along = np.einsum("ij,ij->i", chord, self._direction)
                by = np.where(
                    length > 0.0, np.stack([along, _cross(chord, self._direction)[:, 0]], 1) / length, [1.0, 0.0]
                )
            found |= {"by": by, "centre": place / self._sizes}
        for name, values in found.items():
            getattr(self.turn, name).assign(values if values.shape[1] == 2 else values[:, 0])


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the cross products of vectors (#P by 2), #P by 1."""
    return (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[:, None]
