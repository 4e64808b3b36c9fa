"""The state of a relaxation: layout, velocities and forces of a network, the steps from it, and its convergence.

The step is the paper's (section III), with two additions. Velocities are set to zero whenever the forces begin to brake
the motion (kinetic damping, as in dynamic relaxation); otherwise the energy oscillates, and progress is as slow as
diffusion. And no vertex moves so far in one step that a face could be mirrored.

Several pieces may be relaxed side by side as one joined network (`warpflat.model.join`). Damping, convergence checks
and tolerances apply to each piece on its own. Pieces at rest are removed once it pays to go on with fewer.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import InitVar, dataclass, replace
from functools import cached_property

import numpy as np
import warp as wp

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.compile import launch_quietly
from warpflat.core.errors import InputError
from warpflat.core.launch import launch_each
from warpflat.core.sums import dot
from warpflat.kernels.prolongation import correct
from warpflat.model.join import join_networks
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import ConvergenceStatus, Energies, Outcome
from warpflat.solver.grain_alignment import GrainAlignment
from warpflat.solver.membrane_stiffness import TangentMatrix
from warpflat.solver.options import RelaxOptions
from warpflat.solver.piece_sums_cpu import HostPieceSums
from warpflat.solver.piece_sums_cuda import DevicePieceSums
from warpflat.solver.smoother import IMPLICIT_STEP, IMPLICIT_STEP_AT_REST, chebyshev_coefficients
from warpflat.solver.step_buffers import StepBuffers
from warpflat.solver.steps_cuda import DeviceSteps

__all__ = ["Relaxation"]

# Pieces at rest are removed once they have this share of the vertices: a new joined network takes as long as a dozen
# steps.
_REMOVED_SHARE = 0.2


@dataclass
class Relaxation:
    """A running relaxation.

    Attributes:
        network: the model.
        options: of the relaxation; a later change of the time step has no effect.
        start: #V by 2, the first layout [m].
        alignments: the pieces whose datum, the grain, is kept along +y.
        least_strain: a layout that stores less energy than this strain everywhere counts as free of strain, and at
            rest.
        position: #V vec2d [m]. velocity: #V vec2d [m/s]. force: #V vec2d, of the last evaluated state [N]. load: #V
            vec2d, constant forces [N]. anchor: #V vec2d, the layout at the last check of all cells [m]. scratch: #V
            vec2d, free for any use until the forces are evaluated. All on the network's device.
        steps: number of steps taken.
        work_units: all work, in steps of this mesh; steps of coarser levels count by their vertices.
        vertex_ranges: the slice of each piece's vertices.
        piece_numbers: for each piece, its index in the relaxation from which it was extracted.
        has_status: whether convergence has been checked yet.
        status: the result of the last check.
    """

    network: SpringNetwork
    options: RelaxOptions
    start: InitVar[FloatArray]
    alignments: Sequence[GrainAlignment] = ()
    least_strain: float = 1e-9

    def __post_init__(self, start: FloatArray) -> None:
        n = self.network.vertex_count
        if np.shape(start) != (n, 2):
            raise InputError(f"start layout has shape {np.shape(start)}; must be ({n}, 2), a point per vertex")
        self._buffers = buffers = StepBuffers(self.network, self.options.time_step, start)
        self.position, self.velocity = buffers.position, buffers.velocity
        self.force, self.load = buffers.force, buffers.load
        self.anchor, self.scratch = buffers.anchor, buffers.first_guess
        self.piece_sums, self._device_steps = self._make_piece_sums()
        self.vertex_ranges = self.piece_sums.vertex_ranges
        pieces = self.network.pieces
        self.piece_numbers: Sequence[int] = range(len(pieces))
        self._spring_count = np.array([net.spring_count for net in pieces])
        self.matrix = TangentMatrix(self.network) if self.network.model == "membrane" else None
        self.steps = 0
        self.work_units = 0.0
        self._restarts = 0
        self.status: ConvergenceStatus
        self.has_status = False
        # Whether the guard acted anywhere at the last check of all cells before a step.
        self._guard_acts = False

    def _make_piece_sums(self) -> tuple[HostPieceSums | DevicePieceSums, DeviceSteps | None]:
        """Return the sums over pieces for the network's device, and its runs of steps if it is not the host."""
        if self.network.device.is_cpu:
            return HostPieceSums(self.network, self._buffers), None
        sums = DevicePieceSums(self.network, self._buffers)
        return sums, DeviceSteps(self._buffers, sums, damped=self.options.kinetic_damping)

    @property
    def restarts(self) -> int:
        """The number of times that the velocities of a piece were set to zero."""
        self._restarts += self.piece_sums.take_stop_count()
        return self._restarts

    @restarts.setter
    def restarts(self, count: int) -> None:
        self.piece_sums.take_stop_count()
        self._restarts = count

    # --- scales against which energies and forces are measured

    @cached_property
    def negligible_energy(self) -> FloatArray:
        """The energy of each piece under the least strain everywhere, #P [J]."""
        springs = (net.spring_arrays for net in self.network.pieces)
        # Each spring is listed twice.
        return (
            0.25
            * self.least_strain**2
            * np.array([dot(s.listed_stiffness * s.listed_length, s.listed_length) for s in springs])
        )

    @cached_property
    def _mean_stiffness_force(self) -> FloatArray:
        """The mean of k L over the springs of each piece, #P [N]."""
        springs = (net.spring_arrays for net in self.network.pieces)
        return np.array([dot(s.listed_stiffness, s.listed_length) / len(s.listed_length) for s in springs])

    # --- steps

    def step(self) -> None:
        """Take one approximate implicit step."""
        self.sweep(1)

    def sweep(
        self,
        steps: int,
        each_step: Callable[[], None] | None = None,
        *,
        check_interval: int = 1,
        evaluated: bool = False,
    ) -> None:
        """Take steps of the paper's in a row.

        Args:
            steps: how many.
            each_step: called after each; must change neither positions nor velocities.
            check_interval: all cells are checked for the guard before every such step. In between only the cells in
                which the guard acts are evaluated, and vertices keep within the reach of the last check: three times as
                fast, and as good for smoothing.
            evaluated: the velocities are zero, and all cells of the present layout have been evaluated already.
        """
        if self._device_steps is not None and each_step is None:
            self._device_steps.sweep(steps, check_interval, evaluated=evaluated)
            self.steps += steps
            return
        for number in range(steps):
            if number < 2:
                # Forces that were evaluated at rest hold no viscosity, and none is due in that step.
                at_rest = evaluated and number == 0
                self._buffers.set_coefficients(IMPLICIT_STEP_AT_REST if at_rest else IMPLICIT_STEP)
            self._evaluate(number, check_interval, evaluated=evaluated)
            if self.options.kinetic_damping:
                self._restarts += self.piece_sums.damp()
            self._advance(each_step)

    def smooth(
        self,
        steps: int,
        each_step: Callable[[], None] | None = None,
        *,
        check_interval: int = 1,
        evaluated: bool = False,
    ) -> None:
        """Take Chebyshev smoothing steps from rest (`warpflat.solver.smoother`). See `sweep` for the arguments."""
        if self._device_steps is not None and each_step is None:
            self._device_steps.smooth(steps, check_interval, evaluated=evaluated)
            self.steps += steps
            return
        for number in range(steps):
            self._buffers.set_coefficients(chebyshev_coefficients(number))
            self._evaluate(number, check_interval, evaluated=evaluated)
            self._advance(each_step)

    def _evaluate(self, number: int, check_interval: int, *, evaluated: bool) -> None:
        """Evaluate the forces before step `number` of a run."""
        buffers = self._buffers
        if number % check_interval:
            (buffers.evaluate_guarded if self._guard_acts else buffers.evaluate_unguarded).launch()
            return
        if number or not evaluated:
            buffers.evaluate.launch()
        self._guard_acts = check_interval > 1 and self.piece_sums.guard_acts()

    def _advance(self, each_step: Callable[[], None] | None) -> None:
        self._buffers.advance.launch()
        self.steps += 1
        if each_step is not None:
            each_step()

    def evaluate_at_rest(self) -> None:
        """Set the velocities to zero and evaluate the forces of the present layout."""
        if self._device_steps is not None:
            self._device_steps.evaluate_at_rest()
            return
        self.velocity.zero_()
        self._buffers.set_coefficients(IMPLICIT_STEP_AT_REST)
        self._buffers.evaluate.launch()

    def step_along_lines(self) -> None:
        """Take one line relaxation step along the rows and columns of lattices; velocities become zero."""
        self.evaluate_at_rest()
        if self._buffers.line_step is not None:
            self._buffers.line_step.launch()

    def move_along(self, base: wp.array, direction: wp.array, fraction: float, pieces: BoolArray) -> None:
        """Move pieces to base + fraction * direction, as far as each vertex is free to move.

        Args:
            base, direction: #V vec2d [m].
            fraction: how far to go.
            pieces: #P, which ones to move.
        """
        count, device, freedom = self.network.vertex_count, self.network.device, self.network.bonds.freedom
        if pieces.all():
            launch_each(correct, count, [base, direction, fraction, freedom], [self.position], device=device)
            return
        for own in (self.vertex_ranges[piece] for piece in np.flatnonzero(pieces)):
            given = [base, direction, fraction, freedom, own.start]
            launch_quietly(correct, dim=own.stop - own.start, inputs=given, outputs=[self.position], device=device)

    def hold_grain(self) -> None:
        """Turn each piece so that the chord of its datum points up, and hold it there.

        A load that is spread over the piece balances the torque of the cloth, and the velocities lose their rotation.
        """
        if self.alignments:
            self.piece_sums.hold_grain(self.alignments)

    # --- energies and forces

    def positions(self) -> FloatArray:
        """Return a copy of the layout, #V by 2 [m]."""
        return np.array(self.position.numpy(), dtype=np.float64, copy=True)

    def place(self, positions: FloatArray) -> None:
        """Set the layout to #V by 2 [m]."""
        if self.network.device.is_cpu:
            # A view; Warp's own copy takes as long as a tenth of an iteration on a small piece.
            self.position.numpy()[...] = positions
        else:
            self.position.assign(positions)

    def mirrored_pieces(self) -> BoolArray:
        """Return whether each piece has a mirrored or collapsed cell at the last evaluated state, #P."""
        return self.piece_sums.mirrored()

    def work_of_load(self) -> FloatArray:
        """Return the sum of load times position of each piece, #P [J]."""
        return self.piece_sums.work_of_load()

    def potentials(self) -> FloatArray:
        """Return the energies of springs and of cells (guard or membrane) in the present layout, #P by 2 [J]."""
        self._buffers.measure_potential.launch()
        return np.array(self.piece_sums.element_energies()).T

    def energies(self) -> Energies:
        """Return the energies of the present state [J]."""
        return Energies(*self.piece_energies().sum(axis=0).tolist())

    def piece_energies(self) -> FloatArray:
        """Return the spring (or membrane), guard and kinetic energy of each piece, #P by 3 [J]."""
        spring, cells = self.potentials().T
        kinetic = np.zeros_like(spring)
        if self.piece_sums.may_move():
            self._buffers.measure_motion.launch()
            kinetic = self.piece_sums.vertex_sums()
        if self.network.model == "springs":
            return np.stack([spring, cells, kinetic], axis=1)
        return np.stack([cells, np.zeros_like(cells), kinetic], axis=1)

    def evaluate_potential(self) -> tuple[FloatArray, FloatArray]:
        """Evaluate the present layout at rest; no step may follow.

        Returns:
            #P by 2, the energies of `potentials` [J]; #V by 2, the forces of the cloth and its seams [N].
        """
        self._buffers.evaluate_potential.launch()
        energies = np.array(self.piece_sums.element_energies()).T
        return energies, np.array(self._buffers.on_host(self._buffers.rest_force))

    def forces(self) -> FloatArray:
        """Return the forces of the cloth and its seams in the present layout at rest, #V by 2 [N]; no step may follow."""
        return self.evaluate_potential()[1]

    def cloth_force(self) -> FloatArray:
        """Return the forces of the cloth and its seams, without the load, at the last evaluated state, #V by 2 [N]."""
        return self.piece_sums.cloth_force()

    def residual(self) -> float:
        """Return the largest of the pieces' residuals."""
        return float(self.residuals().max())

    def residuals(self) -> FloatArray:
        """Return the largest force on a vertex of each piece over the mean force of its springs, #P.

        Forces are those of the last evaluated state.

        Forces that only turn a piece whose grain is held are left out. The mean has a floor of 1e-9 K L, the force of a
        spring strained by 1e-9, so that a layout without strain counts as at rest.
        """
        self._buffers.measure_tension.launch()
        mean = self.piece_sums.vertex_sums() / self._spring_count
        floor = 1e-9 * self._mean_stiffness_force
        return self.piece_sums.largest_forces(self.alignments) / np.maximum(mean, floor)

    # --- convergence

    def check_start(self) -> ConvergenceStatus:
        """Check convergence before the first step: only pieces free of strain are at rest."""
        residual, gain, change = np.full((3, len(self.vertex_ranges)), np.inf)
        energies = self.piece_energies()
        at_rest = self._is_free_of_strain(energies[:, 0] + energies[:, 1])
        return self._set_status(energies, residual=residual, gain=gain, change=change, at_rest=at_rest)

    def check_convergence(self, work: float) -> ConvergenceStatus:
        """Check energies and residuals against the tolerances.

        Args:
            work: work since the last check, in steps.
        """
        before, energies, residual = self.status.potential, self.piece_energies(), self.residuals()
        now = energies[:, 0] + energies[:, 1]
        strained = now > self.negligible_energy
        with np.errstate(invalid="ignore"):  # both infinite, with mirrored cells
            gain = before - now
            change = np.where(strained, np.abs(gain) / (work * np.where(strained, now, 1.0)), 0.0)
        at_rest = (change <= self.options.energy_tolerance) & (residual <= self.options.residual_tolerance)
        at_rest |= self._is_free_of_strain(now)
        return self._set_status(energies, residual=residual, gain=gain, change=change, at_rest=at_rest)

    def _is_free_of_strain(self, potential: FloatArray) -> BoolArray:
        """Return whether each piece stores a negligible energy, seams included, #P: forces left are rounding errors."""
        negligible = np.asarray(potential <= self.negligible_energy)
        if self.network.seams is None or not negligible.any():
            return negligible
        return np.asarray(potential + self.network.seam_energy(self.position) <= self.negligible_energy)

    def _set_status(
        self, energies: FloatArray, *, residual: FloatArray, gain: FloatArray, change: FloatArray, at_rest: BoolArray
    ) -> ConvergenceStatus:
        self.has_status = True
        self.status = ConvergenceStatus(
            energies=energies,
            residual=residual,
            gain=gain,
            change=change,
            at_rest=at_rest,
            steps=np.full(len(energies), self.steps),
            work_units=np.full(len(energies), self.work_units),
        )
        return self.status

    def make_outcome(self, steps_before: int, work_before: float, *, began_at: float) -> Outcome:
        """Return the outcome by the last check.

        Args:
            steps_before, work_before: steps and work units at the beginning.
            began_at: `time.perf_counter` at the beginning [s].
        """
        if np.isinf(self.status.residual).any():
            # No step was left to take before a check.
            self.evaluate_at_rest()
            at_rest = self._is_free_of_strain(self.status.potential)
            self.status = replace(self.status, residual=self.residuals(), at_rest=at_rest)
        status = self.status
        return Outcome(
            converged=bool(status.at_rest.all()),
            steps=self.steps - steps_before,
            work_units=self.work_units - work_before,
            restarts=self.restarts,
            energy_change=float(status.change.max()),
            residual=status.worst_residual,
            energies=status.total,
            seconds=time.perf_counter() - began_at,
        )

    # --- some of the pieces on their own

    def is_worth_shrinking(self, finished: BoolArray) -> bool:
        """Return whether the finished pieces (#P) are so large a part that it pays to go on without them."""
        sizes = np.array([own.stop - own.start for own in self.vertex_ranges])
        return bool(sizes[finished].sum() >= _REMOVED_SHARE * sizes.sum())

    def extract(self, pieces: Sequence[int]) -> Relaxation:
        """Return a relaxation of these pieces alone, in their present state."""
        rows = np.concatenate(
            [np.arange(own.start, own.stop) for own in (self.vertex_ranges[piece] for piece in pieces)]
        )
        number = np.full(self.network.vertex_count, -1)
        number[rows] = np.arange(len(rows))
        alignments = [
            replace(
                each,
                lower=int(number[each.lower]),
                upper=int(number[each.upper]),
                vertices=_renumbered(each.vertices, number),
            )
            for each in self.alignments
            if number[each.lower] >= 0
        ]
        network = join_networks([self.network.pieces[piece] for piece in pieces])
        start = self.positions()[rows]
        part = Relaxation(network, self.options, start=start, alignments=alignments, least_strain=self.least_strain)
        part.velocity.assign(self.velocity.numpy()[rows])
        part.load.assign(self.load.numpy()[rows])
        part.steps, part.restarts, part.work_units = self.steps, self.restarts, self.work_units
        part.piece_numbers = [self.piece_numbers[piece] for piece in pieces]
        part.has_status, part.status = True, self.status.select(pieces)
        if part.matrix is not None:
            part.matrix.update(part.position)
        return part

    def copy_into(self, whole: Relaxation) -> None:
        """Copy layout, status and counts of these pieces into the relaxation from which they were extracted."""
        if self is whole:
            return
        position = whole.positions()
        for own, number in zip(self.vertex_ranges, self.piece_numbers, strict=True):
            position[whole.vertex_ranges[number]] = self.positions()[own]
        whole.position.assign(position)
        whole.steps, whole.work_units = max(whole.steps, self.steps), max(whole.work_units, self.work_units)
        whole.restarts = max(whole.restarts, self.restarts)
        for name, values in vars(self.status).items():
            vars(whole.status)[name][list(self.piece_numbers)] = values


def _renumbered(vertices: slice | IntArray, number: IntArray) -> slice | IntArray:
    """Return vertices, a range or indices, by their new numbers (#V)."""
    if isinstance(vertices, slice):
        return slice(int(number[vertices.start]), int(number[vertices.stop - 1]) + 1)
    return number[vertices]
