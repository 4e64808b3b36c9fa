"""Relaxation: the strain energy of a network is released by approximate implicit integration (paper, section III).

The step is the paper's; two things are added. Velocities are set to zero whenever the forces begin to brake the motion
(kinetic damping, as in dynamic relaxation: the energy swings otherwise, and progress is as slow as diffusion), and no
vertex moves so far in one step that a face could be mirrored.

Several pieces may be relaxed side by side as one joined network (`warpflat.model.join`): each is damped, looked at and judged on its
own, and leaves when it has come to rest, as soon as it is worth while to go on with fewer.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import InitVar, dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import warp as wp

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.core.errors import InputError, expect, is_number, nearest
from warpflat.core.launch import launch_each
from warpflat.core.sums import dot
from warpflat.kernels.prolongation import correct
from warpflat.model.join import join_networks
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import ConvergenceStatus, Energies, Outcome
from warpflat.solver.grain_alignment import GrainAlignment
from warpflat.solver.membrane_stiffness import TangentMatrix
from warpflat.solver.piece_sums_cpu import HostPieceSums
from warpflat.solver.piece_sums_cuda import DevicePieceSums
from warpflat.solver.smoother import STEADY, STILL, smoother_coefficients
from warpflat.solver.step_buffers import StepBuffers
from warpflat.solver.steps_cuda import DeviceSteps

__all__ = ["SOLVERS", "RelaxOptions", "Relaxation", "Solver", "Watch", "given_options", "relax"]


Solver = Literal["multilevel", "plain"]
SOLVERS: tuple[Solver, ...] = ("multilevel", "plain")

# Steps between two looks at the stiffness that a membrane has where it is.
_FOLLOW_EVERY = 100
# Pieces leave the others once they have this share of the vertices: to make the others anew takes as long as a dozen steps.
_LEAVE = 0.2


@dataclass(frozen=True, kw_only=True)
class RelaxOptions:
    """How the energy is released, and when that is done.

    Attributes:
        time_step: h [s]. The minimum does not depend on it; steps to it stop falling above 1e-3.
        energy_tolerance: eq. (11): relative change of the energy per step.
        residual_tolerance: largest force on a vertex over the mean force of the springs; after whole steps
            (`warpflat.solver.gauss_newton`) it is enough, too, that forces could release next to nothing.
        max_steps: a state that has taken so many is not stepped on, and says so (`converged` is false); with levels, their work counts in
            steps of the piece's own mesh, and a cycle that has begun is ended.
        check_every: steps between two looks at energies and convergence.
        kinetic_damping: set velocities to zero when the forces begin to brake the motion.
        solver: "multilevel" (see `warpflat.solver.multigrid.solve`; garments are sewn by plain steps all the same), or
            "plain", the paper's steps alone.
    """

    time_step: float = 0.01
    energy_tolerance: float = 1e-6
    residual_tolerance: float = 5e-3
    max_steps: int = 20_000
    check_every: int = 10
    kinetic_damping: bool = True
    solver: Solver = "multilevel"

    def validate(self) -> None:
        """Raise InputError for a value out of its bounds; names the value."""
        for key, low, high in (
            ("time_step", 1e-9, 1e9),
            ("energy_tolerance", 0.0, 1.0),
            ("residual_tolerance", 1e-12, 1e3),
            ("max_steps", 1, 10**9),
            ("check_every", 1, 10**6),
        ):
            value = getattr(self, key)
            if not (is_number(value) and math.isfinite(value)):
                raise InputError(f"relax: {key} = {value!r} is not a number")
            if not low <= value <= high:
                raise InputError(f"relax: {key} = {value!r} is out of range; must be {low:g} to {high:g}")
            if key in ("max_steps", "check_every") and not is_number(value, whole=True):
                raise InputError(f"relax: {key} = {value!r} is not a whole number")
        if not isinstance(self.kinetic_damping, bool):
            raise InputError(f"relax: kinetic_damping = {self.kinetic_damping!r} is neither True nor False")
        if self.solver not in SOLVERS:
            raise InputError(f"relax: solver {self.solver!r} is unknown; {nearest(str(self.solver), SOLVERS)}")


def given_options(options: RelaxOptions | None) -> RelaxOptions:
    """The options of a relaxation, or those that it has if none are given.

    Raises:
        InputError: they are something else, or a value is out of its bounds.
    """
    if options is None:
        return RelaxOptions()
    expect(options, RelaxOptions, "relax", "a RelaxOptions, such as RelaxOptions(max_steps=5000)")
    options.validate()
    return options


@dataclass
class Relaxation:
    """A running relaxation: its state, steps from it, and how it stands.

    Attributes:
        network: the model.
        options: of `relax`; the time step is fixed once made.
        start: #V by 2, the first layout [m].
        upright: of each piece the vertices whose chord is kept along +y, the ends of the datum: it is the grain, and
            nothing else says how the piece lies on the cloth, so that it would turn for ever to please a guard bound to
            the plane.
        least_strain: a layout that stores less energy than this strain everywhere counts as free of strain, and at rest.
        position: #V vec2d [m]. velocity: #V vec2d [m/s]. force: #V vec2d, of the last evaluated state [N]. load: #V vec2d,
            constant forces [N]. anchor: #V vec2d, where all cells were last looked at [m]. spare: #V vec2d, for anybody, until
            forces are evaluated. On the network's device.
        steps: taken. work_units: all work, in steps of this mesh; those of coarser levels count by their vertices.
        vertices: of each piece, its vertices.
        numbers: of each piece, which it was before others left.
        looked: whether there was a look yet. last: what the last one said.
    """

    network: SpringNetwork
    options: RelaxOptions
    start: InitVar[FloatArray]
    upright: Sequence[GrainAlignment] = ()
    least_strain: float = 1e-9

    def __post_init__(self, start: FloatArray) -> None:
        n = self.network.vertex_count
        if np.shape(start) != (n, 2):
            raise InputError(f"start layout has shape {np.shape(start)}; must be ({n}, 2), a point per vertex")
        self._buffers = buffers = StepBuffers(self.network, self.options.time_step, start)
        self.position, self.velocity = buffers.position, buffers.velocity
        self.force, self.load = buffers.force, buffers.load
        self.anchor, self.spare = buffers.anchor, buffers.first_guess
        pieces = self.network.pieces
        self.pieces, self._far_steps = self._pieces_of()
        self.vertices = self.pieces.vertices
        self.numbers: Sequence[int] = range(len(pieces))
        self._spring_count = np.array([net.spring_count for net in pieces])
        self.matrix = TangentMatrix(self.network) if self.network.model == "membrane" else None
        self.steps = 0
        self.work_units = 0.0
        self._restarts = 0
        self.last: ConvergenceStatus
        self.looked = False
        # Whether the guard acted anywhere when all cells were last looked at before a step.
        self._acts = False

    def _pieces_of(self) -> tuple[HostPieceSums | DevicePieceSums, DeviceSteps | None]:
        """What looks at the pieces where the arrays are, and the steps where these are not the host's."""
        if self.network.device.is_cpu:
            return HostPieceSums(self.network, self._buffers), None
        pieces = DevicePieceSums(self.network, self._buffers)
        return pieces, DeviceSteps(self._buffers, pieces, damped=self.options.kinetic_damping)

    @property
    def restarts(self) -> int:
        """How often the velocities of a piece were set to zero."""
        self._restarts += self.pieces.stopped()
        return self._restarts

    @restarts.setter
    def restarts(self, count: int) -> None:
        self.pieces.stopped()
        self._restarts = count

    # --- what is measured against

    @cached_property
    def negligible_energy(self) -> FloatArray:
        """#P [J], what the least strain stores everywhere."""
        springs = (net.spring_arrays for net in self.network.pieces)
        # Each spring is listed twice.
        return (
            0.25
            * self.least_strain**2
            * np.array([dot(s.listed_stiffness * s.listed_length, s.listed_length) for s in springs])
        )

    @cached_property
    def _mean_stiffness_force(self) -> FloatArray:
        """#P [N], the mean of k L."""
        springs = (net.spring_arrays for net in self.network.pieces)
        return np.array([dot(s.listed_stiffness, s.listed_length) / len(s.listed_length) for s in springs])

    # --- steps

    def step(self) -> None:
        """One approximate implicit step."""
        self.sweep(1)

    def sweep(
        self,
        steps: int,
        each_step: Callable[[], None] | None = None,
        *,
        watch_every: int = 1,
        evaluated: bool = False,
    ) -> None:
        """Some steps in a row; from rest, if `evaluated`.

        Args:
            steps: how many.
            each_step: called after each; must change neither places nor velocities.
            watch_every: all cells are looked at before one step of so many. In between only those in which the guard acts are
                evaluated, and no vertex leaves the reach that it had: three times as fast, and as good where steps are to smooth.
            evaluated: of the state as it is, all cells have been looked at already.
        """
        if self._far_steps is not None and each_step is None:
            self._far_steps.sweep(steps, watch_every, evaluated=evaluated)
            self.steps += steps
            return
        for number in range(steps):
            if number < 2:
                # Forces that have been evaluated were so at rest: they hold no viscosity, and none is due yet.
                self._buffers.go_at(STILL if evaluated and number == 0 else STEADY)
            self._evaluate(number, watch_every, evaluated=evaluated)
            if self.options.kinetic_damping:
                self._restarts += self.pieces.damp()
            self._advance(each_step)

    def smooth(
        self,
        steps: int,
        each_step: Callable[[], None] | None = None,
        *,
        watch_every: int = 1,
        evaluated: bool = False,
    ) -> None:
        """Some steps from rest that take what is rough (`warpflat.solver.smoother`). Arguments as of `sweep`."""
        if self._far_steps is not None and each_step is None:
            self._far_steps.smooth(steps, watch_every, evaluated=evaluated)
            self.steps += steps
            return
        for number in range(steps):
            self._buffers.go_at(smoother_coefficients(number))
            self._evaluate(number, watch_every, evaluated=evaluated)
            self._advance(each_step)

    def _evaluate(self, number: int, watch_every: int, *, evaluated: bool) -> None:
        """The forces before a step, of so many before it in a row."""
        buffers = self._buffers
        if number % watch_every:
            (buffers.evaluate_on if self._acts else buffers.evaluate_unguarded).launch()
            return
        if number or not evaluated:
            buffers.evaluate.launch()
        self._acts = watch_every > 1 and self.pieces.guard_acts()

    def _advance(self, each_step: Callable[[], None] | None) -> None:
        self._buffers.advance.launch()
        self.steps += 1
        if each_step is not None:
            each_step()

    def evaluate_at_rest(self) -> None:
        """The forces of the present layout; velocities become zero."""
        if self._far_steps is not None:
            self._far_steps.evaluate_at_rest()
            return
        self.velocity.zero_()
        self._buffers.go_at(STILL)
        self._buffers.evaluate.launch()

    def step_along_lines(self) -> None:
        """One step along the rows and columns of pieces on a lattice, all vertices of a line at once; velocities become zero."""
        self.evaluate_at_rest()
        if self._buffers.along_lines is not None:
            self._buffers.along_lines.launch()

    def mirrored_pieces(self) -> BoolArray:
        """#P, whether a piece has cells that are mirrored or without area, at the last evaluated state."""
        return self.pieces.mirrored()

    def move(self, base: wp.array, way: wp.array, share: float, pieces: BoolArray) -> None:
        """Let these pieces (#P) go from `base` (#V vec2d [m]) by a share of `way`, as far as each vertex is free to."""
        count, device, freedom = self.network.vertex_count, self.network.device, self.network.bonds.freedom
        if pieces.all():
            launch_each(correct, count, [base, way, share, freedom], [self.position], device=device)
            return
        for here in (self.vertices[piece] for piece in np.flatnonzero(pieces)):
            given = [base, way, share, freedom, here.start]
            wp.launch(correct, dim=here.stop - here.start, inputs=given, outputs=[self.position], device=device)

    def work_of_load(self) -> FloatArray:
        """#P, sum of load times place [J]."""
        return self.pieces.work_of_load()

    def potentials(self) -> FloatArray:
        """#P by 2, energies of the springs and of the cells of the present layout [J], the cells' guard or membrane."""
        self._buffers.measure.launch()
        return np.array(self.pieces.measured()).T

    def energies(self) -> Energies:
        """Energies of the present state [J]."""
        return Energies(*self.piece_energies().sum(axis=0).tolist())

    def piece_energies(self) -> FloatArray:
        """#P by 3, the same of each piece."""
        spring, cells = self.potentials().T
        kinetic = np.zeros_like(spring)
        if self.pieces.moves():
            self._buffers.measure_motion.launch()
            kinetic = self.pieces.of_vertices()
        if self.network.model == "springs":
            return np.stack([spring, cells, kinetic], axis=1)
        return np.stack([cells, np.zeros_like(cells), kinetic], axis=1)

    def begin(self) -> ConvergenceStatus:
        """The look before the first step, by which only what is free of strain is at rest."""
        residual, gain, change = np.full((3, len(self.vertices)), np.inf)
        energies = self.piece_energies()
        at_rest = self._without_strain(energies[:, 0] + energies[:, 1])
        return self._say(energies, residual=residual, gain=gain, change=change, at_rest=at_rest)

    def look(self, work: float) -> ConvergenceStatus:
        """How energy and residual are now, so many steps' work after the last look."""
        before, energies, residual = self.last.potential, self.piece_energies(), self.residuals()
        now = energies[:, 0] + energies[:, 1]
        strained = now > self.negligible_energy
        with np.errstate(invalid="ignore"):  # both infinite, with mirrored cells
            gain = before - now
            change = np.where(strained, np.abs(gain) / (work * np.where(strained, now, 1.0)), 0.0)
        at_rest = (change <= self.options.energy_tolerance) & (residual <= self.options.residual_tolerance)
        at_rest |= self._without_strain(now)
        return self._say(energies, residual=residual, gain=gain, change=change, at_rest=at_rest)

    def _without_strain(self, potential: FloatArray) -> BoolArray:
        """#P, whether nothing is left to release, in the cloth or in its seams: what a vertex is pulled by then is rounding."""
        negligible = np.asarray(potential <= self.negligible_energy)
        if self.network.seams is None or not negligible.any():
            return negligible
        return np.asarray(potential + self.network.seam_energy(self.position) <= self.negligible_energy)

    def _say(
        self, energies: FloatArray, *, residual: FloatArray, gain: FloatArray, change: FloatArray, at_rest: BoolArray
    ) -> ConvergenceStatus:
        self.looked = True
        self.last = ConvergenceStatus(
            energies=energies,
            residual=residual,
            gain=gain,
            change=change,
            at_rest=at_rest,
            steps=np.full(len(energies), self.steps),
            work_units=np.full(len(energies), self.work_units),
        )
        return self.last

    def may_leave(self, pieces: BoolArray) -> bool:
        """Whether these pieces (#P) are so large a part that it pays to go on without them."""
        sizes = np.array([here.stop - here.start for here in self.vertices])
        return bool(sizes[pieces].sum() >= _LEAVE * sizes.sum())

    def keep(self, pieces: Sequence[int]) -> Relaxation:
        """Some of the pieces, as they are, as a relaxation of their own."""
        rows = np.concatenate([np.arange(here.start, here.stop) for here in (self.vertices[piece] for piece in pieces)])
        number = np.full(self.network.vertex_count, -1)
        number[rows] = np.arange(len(rows))
        upright = [
            GrainAlignment(
                lower=int(number[piece.lower]),
                upper=int(number[piece.upper]),
                vertices=slice(int(number[piece.vertices.start]), int(number[piece.vertices.stop - 1]) + 1),
            )
            for piece in self.upright
            if number[piece.lower] >= 0
        ]
        network = join_networks([self.network.pieces[piece] for piece in pieces])
        start = self.positions()[rows]
        kept = Relaxation(network, self.options, start=start, upright=upright, least_strain=self.least_strain)
        kept.velocity.assign(self.velocity.numpy()[rows])
        kept.load.assign(self.load.numpy()[rows])
        kept.steps, kept.restarts, kept.work_units = self.steps, self.restarts, self.work_units
        kept.numbers = [self.numbers[piece] for piece in pieces]
        kept.looked, kept.last = True, self.last.of(pieces)
        if kept.matrix is not None:
            kept.matrix.follow(kept.position)
        return kept

    def give(self, whole: Relaxation) -> None:
        """Put what these pieces have come to where all of them are."""
        if self is whole:
            return
        position = whole.positions()
        for here, number in zip(self.vertices, self.numbers, strict=True):
            position[whole.vertices[number]] = self.positions()[here]
        whole.position.assign(position)
        whole.steps, whole.work_units = max(whole.steps, self.steps), max(whole.work_units, self.work_units)
        whole.restarts = max(whole.restarts, self.restarts)
        for name, values in vars(self.last).items():
            vars(whole.last)[name][list(self.numbers)] = values

    def hold_grain(self) -> None:
        """Turn each piece so that the chord of its datum points up, and hold it there.

        A load that is spread over the piece balances the torque with which the cloth would turn; what turning there is
        in the velocities is taken out.
        """
        if not self.upright:
            return
        self.pieces.hold_grain(self.upright)

    def forces(self) -> FloatArray:
        """#V by 2, forces of the cloth and of what it is tied by, in the present layout at rest [N]."""
        self.evaluate_at_rest()
        return self.cloth_force()

    def cloth_force(self) -> FloatArray:
        """#V by 2, forces of the cloth and the seams alone, at the last evaluated state [N]."""
        return self.pieces.cloth_force()

    def residual(self) -> float:
        """The worst of `residuals`."""
        return float(self.residuals().max())

    def residuals(self) -> FloatArray:
        """#P, largest force on a vertex of the piece, at the last evaluated state, over the mean force of its springs.

        Forces that only turn the whole piece are left out where it is held upright. The mean has a floor of 1e-9 K L, the
        force of a spring strained by 1e-9, so that a layout without strain counts as at rest.
        """
        self._buffers.measure_pull.launch()
        mean = self.pieces.of_vertices() / self._spring_count
        floor = 1e-9 * self._mean_stiffness_force
        return self.pieces.strongest(self.upright) / np.maximum(mean, floor)

    def outcome(self, steps: int, work_units: float, *, begun: float) -> Outcome:
        """How it has ended, by the last look; it began with so many steps and so much work behind it, when the clock
        (`time.perf_counter`) stood so."""
        if np.isinf(self.last.residual).any():
            # There was no step left to take before a look.
            self.evaluate_at_rest()
            at_rest = self._without_strain(self.last.potential)
            self.last = replace(self.last, residual=self.residuals(), at_rest=at_rest)
        look = self.last
        return Outcome(
            converged=bool(look.at_rest.all()),
            steps=self.steps - steps,
            work_units=self.work_units - work_units,
            restarts=self.restarts,
            energy_change=float(look.change.max()),
            residual=float(look.residual.max()),
            energies=look.total,
            seconds=time.perf_counter() - begun,
        )

    def positions(self) -> FloatArray:
        """#V by 2, a copy [m]."""
        return np.array(self.position.numpy(), dtype=np.float64, copy=True)


Watch = Callable[[Relaxation, Energies, float], None]


def relax(state: Relaxation, *, watch: Watch | None = None, each_step: Watch | None = None) -> Outcome:
    """Step until the energy and the residual force have come to rest, or the step limit is reached.

    Args:
        state: where to start; holds the relaxed layout afterwards.
        watch: called every `check_every` steps with the state, its energies and the residual; of several pieces, with the state of those
            that are still stepped (its `numbers` say which).
        each_step: called after every step, with the energies and the residual of the last look.
    """
    options, whole = state.options, state
    begun, first, work = time.perf_counter(), state.steps, state.work_units
    look = state.begin()

    def stepped() -> None:
        assert each_step is not None
        state.work_units += 1.0
        each_step(state, look.total, float(look.residual.max()))

    while not look.at_rest.all() and state.steps < options.max_steps:
        if state.may_leave(look.at_rest):
            state.give(whole)
            state = state.keep(np.flatnonzero(~look.at_rest).tolist())
            look = state.last
        chunk = min(options.check_every, options.max_steps - state.steps)
        if each_step is None:
            state.sweep(chunk)
            state.work_units += chunk
        else:
            state.sweep(chunk, stepped)
        state.hold_grain()
        look = state.look(chunk)
        if state.matrix is not None and state.steps % _FOLLOW_EVERY < chunk:
            state.matrix.follow(state.position)
        if watch is not None:
            watch(state, look.total, float(look.residual.max()))
    state.give(whole)
    return whole.outcome(first, work, begun=begun)
