"""The paper's step, approximate implicit integration (eqs. 4 to 10), and its loops with eq. (11).

With spring-wise stiffness k_ij, K_i = sum_j k_ij, and the step h, one step from velocities v and positions x is

    F~_i  = F_i + h sum_j k_ij (v_j - v_i)                                                    (7)
    dv_i  = [F~_i h + h^2 sum_j k_ij dv_j] / (m_i + h^2 K_i)                                  (8)
    dv_j ~= F~_j h / (m_j + h^2 K_j)                                                          (9)
    dv_i  = [F~_i h + h^2 sum_j k_ij F~_j h / (m_j + h^2 K_j)] / (m_i + h^2 K_i)              (10)
    v_i  += dv_i,    x_i += h v_i                                                             (4)

Two gathers per step and no matrix: `Relaxation.step` launches `gather_forces` for (7) and (9), and `advance` for (10) and (4)
(`warpflat.kernels.implicit`). Two things are added. Velocities are set to zero whenever the forces begin to brake the motion (kinetic
damping, as in dynamic relaxation); otherwise the energy oscillates, and progress is as slow as diffusion. And no vertex moves so far in
one step that a face could be mirrored.

Every relaxation begins with `take_first_steps`, which ends where by eq. (11) a step gains little. `relax_by_steps` goes on to the minimum.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.compile import launch_quietly
from warpflat.core.errors import InputError
from warpflat.core.launch import Launch, record
from warpflat.core.launch import Sequence as LaunchSequence
from warpflat.core.sums import dot
from warpflat.flat.model.membrane import corner_sums
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.springs import springs_along_cells
from warpflat.flat.solver.grain import GrainAlignment, align_grain, hold_grain, remove_rotation
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.stop import Energies, Outcome, Status, relative_change
from warpflat.kernels.cells import ACTING, ALL, CellForces
from warpflat.kernels.constraints import evaluate_seams
from warpflat.kernels.implicit import (
    BondForces,
    VertexForces,
    advance,
    gather_forces,
    gather_potential,
    stop,
)
from warpflat.kernels.membrane import bound_membrane
from warpflat.kernels.springs import compute_spring_energy, compute_spring_tension

__all__ = [
    "IMPLICIT_STEP",
    "IMPLICIT_STEP_AT_REST",
    "Relaxation",
    "TangentMatrix",
    "Watch",
    "relax_by_steps",
    "take_first_steps",
]

# Factors of the viscosity, of the velocity and of its change in `kernels.implicit`: the paper's step, and from zero velocities, where the
# viscosity is zero.
IMPLICIT_STEP, IMPLICIT_STEP_AT_REST = (1.0, 1.0, 1.0), (0.0, 1.0, 1.0)
# The guard takes several times as long as the check of a cell, and acts in some places of a piece only. So each thread
# takes this many ranges, spread over the piece.
_TURNS = 4
# Steps between two updates of a membrane's tangent stiffness.
_MATRIX_INTERVAL = 100
# The first steps are looked at after so many of them, and are at most so many. In woven cloth an iteration of L-BFGS takes as long as one
# or two.
_FIRST_STEPS_PER_CHECK, _MOST_FIRST_STEPS = 3, 10


class Relaxation:
    """A network in a layout: the paper's step from there, its energies and forces, and whether it is at rest.

    Attributes:
        network: the model.
        options: of the relaxation; a later change of the time step has no effect.
        alignments: the pieces whose datum, the grain, is kept along +y.
        least_strain: a layout that stores less energy than this strain everywhere counts as free of strain, and at rest.
        position: #V vec2d [m]. velocity: #V vec2d [m/s]. force: #V vec2d, of the last evaluated state [N]. load: #V vec2d, constant
            forces [N]. All on the network's device.
        takes_first_steps: whether these are the paper's steps with which a relaxation begins.
        steps: number of steps taken. work_units: all work, in steps of this mesh. restarts: how often velocities were set to zero.
        status: the result of the last check.
    """

    def __init__(
        self,
        network: SpringNetwork,
        options: RelaxOptions,
        *,
        start: FloatArray,
        alignments: Sequence[GrainAlignment] = (),
    ) -> None:
        """Place a network at rest in a layout (#V by 2 [m])."""
        n, f, device = network.vertex_count, network.face_count, network.device
        if np.shape(start) != (n, 2):
            raise InputError(f"start layout has shape {np.shape(start)}; must be ({n}, 2), a point per vertex")
        self.network, self.options, self.alignments, self.least_strain = network, options, alignments, 1e-9
        self.time_step = options.time_step
        self.position = wp.array(np.ascontiguousarray(start), dtype=wp.vec2d, device=device)
        self.velocity, self.force, self.load, anchor, first_guess = (
            wp.zeros(n, dtype=wp.vec2d, device=device) for _ in range(5)
        )
        self._power, stiffness, reach = (wp.zeros(n, dtype=wp.float64, device=device) for _ in range(3))
        self._forces = at = VertexForces()
        at.force, at.power, at.first_guess, at.stiffness = self.force, self._power, first_guess, stiffness
        at.anchor, at.reach, at.guarded = anchor, reach, wp.zeros(n, dtype=wp.int8, device=device)
        # Pages that are never touched take no memory: those of faces are written only where cells act.
        at.driving_force = wp.empty(n, dtype=wp.vec2d, device=device)
        self._cell_forces = cells = CellForces()
        cells.acting, cells.clearance = wp.zeros(f, dtype=wp.int8, device=device), wp.zeros(f, wp.float64, device)
        cells.force, cells.viscosity = (wp.empty(4 * f, dtype=wp.vec2d, device=device) for _ in range(2))
        cells.stiffness = wp.empty(4 * f, dtype=wp.float64, device=device)
        self._seam_forces = seams = BondForces()
        seams.force, seams.viscosity = (wp.zeros(4 * network.seam_count, wp.vec2d, device) for _ in range(2))
        seams.stiffness = wp.zeros(4 * network.seam_count, wp.float64, device)
        self._coefficients = wp.array(np.array([IMPLICIT_STEP]), dtype=wp.vec3d, device=device)
        # Read as soon as they are written, so that they share memory with what only steps need.
        self._vertex_energy, self._face_energy, self._rest_force = self._power, cells.stiffness[:f], at.driving_force
        self._views: dict[int, NDArray[Any]] = {}
        self.matrix = TangentMatrix(network) if network.model == "membrane" else None
        self.steps = self.restarts = 0
        self.takes_first_steps = False
        self.work_units = 0.0
        self.status: Status

    # --- the step

    def step(self, *, check_cells: bool = True) -> None:
        """Take one approximate implicit step: eqs. (7) and (9), kinetic damping, eqs. (10) and (4).

        Args:
            check_cells: look in all cells for where the guard acts and how far vertices may move; else that is as at the last such step,
                which takes half of the time.
        """
        self._set_coefficients(IMPLICIT_STEP)
        (self._evaluate_forces if check_cells else self._evaluate_acting).launch()
        if self.options.kinetic_damping and self._total(self._power) < 0.0:
            self._stop.launch()
            self.restarts += 1
        self._advance.launch()
        self.steps += 1

    def evaluate_at_rest(self) -> None:
        """Set the velocities to zero and evaluate the forces of the present layout."""
        self.velocity.zero_()
        self._set_coefficients(IMPLICIT_STEP_AT_REST)
        self._evaluate_forces.launch()

    def hold_grain(self) -> None:
        """Turn each piece so that the chord of its datum points up, and hold it there.

        A load that is spread over the piece balances the torque of the cloth, and the velocities lose their rotation.
        """
        if not self.alignments:
            return
        arrays = self.position, self.velocity, self.load, self.force, self.network.spring_stiffness
        on_host = [self._on_host(array) for array in arrays]
        hold_grain(self.alignments, *on_host)
        if not self.network.device.is_cpu:
            for array, values in zip(arrays[:3], on_host, strict=False):
                array.assign(values)

    @cached_property
    def _evaluate_forces(self) -> LaunchSequence:
        return self._evaluation(ALL)

    @cached_property
    def _evaluate_acting(self) -> LaunchSequence:
        return self._evaluation(ACTING)

    def _evaluation(self, scope: int) -> LaunchSequence:
        net, x, v = self.network, self.position, self.velocity
        how = [self.time_step, self._coefficients, scope]
        own = [x, v, net.mass, net.spring_stiffness, net.springs, net.cells, self._cell_forces]
        given = [*own, net.bonds, self._seam_forces, self.load, *how]
        gather = self._on_vertices(gather_forces, given, [self._forces], turns=_TURNS)
        cells = self._on_cells("step", [x, v], how, [self._cell_forces], turns=_TURNS)
        return LaunchSequence([*cells, *self._evaluate_seams, gather])

    def _on_vertices(self, kernel: wp.Kernel, given: list[Any], made: list[Any], turns: int = 1) -> Launch:
        """Record the launch of a kernel over all vertices."""
        net = self.network
        return record(kernel, dim=net.vertex_count, inputs=given, outputs=made, device=net.device, turns=turns)

    def _on_cells(self, kernel: str, where: list[Any], how: list[Any], made: list[Any], turns: int = 1) -> list[Launch]:
        """Record the launches over the cells of each model of its kernel of that name."""
        net = self.network
        return [
            record(
                getattr(each, kernel),
                dim=each.count,
                first=each.first,
                inputs=[*where, net.cells, each.parameters, *how],
                outputs=made,
                device=net.device,
                turns=turns,
            )
            for each in net.cell_models
        ]

    @cached_property
    def _evaluate_seams(self) -> list[Launch]:
        net, seams = self.network, self._seam_forces
        given = [self.position, self.velocity, net.seams, self.time_step]
        made = [seams.force, seams.viscosity, seams.stiffness]
        if net.seams is None:
            return []
        return [record(evaluate_seams, dim=net.seam_count, inputs=given, outputs=made, device=net.device)]

    @cached_property
    def _stop(self) -> Launch:
        at = self._forces
        given = [self.network.mass, self.force, at.stiffness, self.time_step]
        return self._on_vertices(stop, given, [self.velocity, at.driving_force, at.first_guess])

    @cached_property
    def _advance(self) -> Launch:
        net = self.network
        given = [net.mass, net.springs, net.bonds, self._forces, self.time_step, self._coefficients]
        return self._on_vertices(advance, given, [self.position, self.velocity])

    def _set_coefficients(self, coefficients: tuple[float, float, float]) -> None:
        values = self._on_host(self._coefficients)
        if tuple(values[0]) != coefficients:
            values[0] = coefficients
            if not self.network.device.is_cpu:
                self._coefficients.assign(values)
                self._views[id(self._coefficients)] = values

    # --- layout, energies and forces

    def _on_host(self, array: wp.array) -> NDArray[Any]:
        """Return the values of a buffer; on the CPU a view of the buffer itself, kept to save the call of Warp."""
        view = self._views.get(id(array))
        if view is None:
            view = array.numpy()
            if self.network.device.is_cpu or array is self._coefficients:
                self._views[id(array)] = view
        return view

    def _total(self, values: wp.array, first: int = 0, count: int | None = None) -> float:
        """Return the sum of an array on the device, or of so many entries from the first on."""
        end = len(values) if count is None else first + count
        if self.network.device.is_cpu:
            return float(np.sum(self._on_host(values)[first:end]))
        return float(wp.utils.array_sum(values[first:end]))

    def positions(self) -> FloatArray:
        """Return a copy of the layout, #V by 2 [m]."""
        return np.array(self.position.numpy(), dtype=np.float64, copy=True)

    def place(self, positions: FloatArray) -> None:
        """Set the layout to #V by 2 [m]."""
        if self.network.device.is_cpu:
            # A view; Warp's own copy takes as long as a tenth of an iteration on a small piece.
            self._on_host(self.position)[...] = positions
        else:
            self.position.assign(positions)

    def energies(self) -> Energies:
        """Return the energies of the present layout [J]."""
        self._measure_potential.launch()
        spring, guard = self._total(self._vertex_energy), 0.0
        for each in self.network.cell_models:
            stored = self._total(self._face_energy, each.first, each.count)
            spring, guard = (spring, guard + stored) if each.model == "springs" else (spring + stored, guard)
        return Energies(spring, guard)

    def evaluate(self) -> tuple[float, FloatArray]:
        """Return the energy of the cloth in the present layout [J], and the forces of cloth and seams, #V by 2 [N]; no step may follow."""
        self._evaluate_potential.launch()
        energy = self._total(self._vertex_energy) + self._total(self._face_energy)
        return energy, np.array(self._on_host(self._rest_force))

    def forces(self) -> FloatArray:
        """Return the forces of the cloth and its seams in the present layout at rest, #V by 2 [N]; no step may follow."""
        return self.evaluate()[1]

    def cloth_force(self) -> FloatArray:
        """Return the forces of the cloth and its seams, without the load, at the last evaluated state, #V by 2 [N]."""
        return np.asarray(self.force.numpy() - self.load.numpy())

    def largest_force(self) -> float:
        """Return the largest of these [N], without forces that only turn pieces whose grain is held."""
        force = self.cloth_force()
        remove_rotation(self.alignments, self.position.numpy(), force, self.network.spring_stiffness.numpy())
        return float(np.sqrt(np.einsum("ij,ij->i", force, force).max()))

    def residual(self) -> float:
        """Return the largest force over the mean force of the springs, at the last evaluated state.

        The mean has a floor of 1e-9 K L, the force of a spring strained by 1e-9, so that a layout without strain counts as at rest.
        """
        net, springs = self.network, self.network.spring_arrays
        self._on_vertices(compute_spring_tension, [self.position, net.springs], [self._vertex_energy]).launch()
        mean = self._total(self._vertex_energy) / net.spring_count
        floor = 1e-9 * dot(springs.listed_stiffness, springs.listed_length) / len(springs.listed_length)
        return self.largest_force() / max(mean, floor)

    @cached_property
    def _measure_potential(self) -> LaunchSequence:
        given, made = [self.position, self.network.springs], [self._vertex_energy]
        cells = self._on_cells("energy", [self.position], [], [self._face_energy])
        return LaunchSequence([self._on_vertices(compute_spring_energy, given, made), *cells])

    @cached_property
    def _evaluate_potential(self) -> LaunchSequence:
        net, of_faces = self.network, [self._face_energy, self._cell_forces]
        given = [self.position, net.springs, net.cells, self._cell_forces, net.bonds, self._seam_forces]
        gather = self._on_vertices(gather_potential, given, [self._vertex_energy, self._rest_force], turns=_TURNS)
        cells = self._on_cells("potential", [self.position], [], of_faces, turns=_TURNS)
        return LaunchSequence([*cells, *self._evaluate_seams, gather])

    # --- convergence

    @cached_property
    def negligible_energy(self) -> float:
        """The energy under the least strain everywhere [J]."""
        return self.network.spring_arrays.energy_of_strain(self.least_strain)

    def is_free_of_strain(self, potential: float) -> bool:
        """Return whether an energy of the cloth [J] is negligible, seams included: forces left are rounding errors."""
        if potential > self.negligible_energy or self.network.seams is None:
            return potential <= self.negligible_energy
        return potential + self.network.seam_energy(self.position) <= self.negligible_energy

    def check_start(self) -> Status:
        """Check convergence before the first step: only a layout free of strain is at rest."""
        energies = self.energies()
        self.status = Status(energies=energies, at_rest=self.is_free_of_strain(energies.potential))
        return self.status

    def check_convergence(self, steps: float) -> Status:
        """Check eq. (11) and the residual force against the tolerances, so many steps after the last check."""
        before, energies, residual = self.status.energies.potential, self.energies(), self.residual()
        now, free = energies.potential, self.is_free_of_strain(energies.potential)
        change = relative_change(before, now, steps) if now > self.negligible_energy else 0.0
        at_rest = change <= self.options.energy_tolerance and residual <= self.options.residual_tolerance
        self.status = Status(energies=energies, residual=residual, at_rest=at_rest or free)
        return self.status

    def make_outcome(self, steps_before: int, work_before: float, *, began_at: float) -> Outcome:
        """Return the outcome by the last check.

        Args:
            steps_before, work_before: steps and work units at the beginning.
            began_at: `time.perf_counter` at the beginning [s].
        """
        if math.isinf(self.status.residual):
            # No step was left to take before a check.
            self.evaluate_at_rest()
            energies = self.status.energies
            at_rest = self.is_free_of_strain(energies.potential)
            self.status = Status(energies=energies, residual=self.residual(), at_rest=at_rest)
        status = self.status
        return Outcome(
            converged=status.at_rest,
            steps=self.steps - steps_before,
            work_units=self.work_units - work_before,
            residual=status.residual,
            energies=status.energies,
            seconds=time.perf_counter() - began_at,
        )


Watch = Callable[[Relaxation], None]
"""A callback: takes the state, whose `status` is that of the last check."""


def take_first_steps(state: Relaxation, *, each_step: Watch | None = None) -> Outcome | None:
    """Take the paper's steps while by eq. (11) they gain more than `first_steps_gain`.

    Args:
        state: where to start, checked, upright, no cell mirrored; holds the layout after the steps.
        each_step: called after every step.

    Returns:
        What they have come to; None if none was taken. A layout that is no better than the start is not kept.
    """
    options, network, status = state.options, state.network, state.status
    most = min(_MOST_FIRST_STEPS, options.max_steps - state.steps)
    first = before = status.energies.potential + network.seam_energy(state.position)
    if options.first_steps_gain >= 1.0 or most <= 0 or status.at_rest or not math.isfinite(first):
        return None
    began_at, steps_before, work_before, start = time.perf_counter(), state.steps, state.work_units, state.positions()
    state.takes_first_steps, gains = True, True
    while gains and state.steps - steps_before < most:
        count = min(_FIRST_STEPS_PER_CHECK, most - (state.steps - steps_before))
        for number in range(count):
            state.step(check_cells=number == 0)
            state.work_units += 1.0
            if each_step is not None:
                each_step(state)
        energies = state.energies()
        now = energies.potential + network.seam_energy(state.position)
        # Eq. (11).
        gains = now < before and relative_change(before, now, count) > options.first_steps_gain
        before = now
    state.takes_first_steps = False
    state.velocity.zero_()
    layout = state.positions() if before < first else start
    align_grain(state.alignments, layout)
    if not before < first:
        energies = status.energies
    elif network.seams is None and network.bonds.freedom.numpy().all():
        # Nothing holds a piece in its place, from which steps drift by some millimetres. L-BFGS leaves its first vertex where it is.
        for each in state.alignments:
            layout[each.vertices] += start[each.vertices][0] - layout[each.vertices][0]
    state.place(layout)
    state.status = Status(energies=energies)
    return Outcome(
        converged=True,
        steps=state.steps - steps_before,
        work_units=state.work_units - work_before,
        residual=math.nan,
        energies=energies,
        seconds=time.perf_counter() - began_at,
    )


def relax_by_steps(state: Relaxation, *, watch: Watch | None = None, each_step: Watch | None = None) -> Outcome:
    """Take the paper's steps until the energy, by eq. (11), and the residual force have come to rest, or the step limit is reached.

    Args:
        state: where to start; holds the relaxed layout afterwards.
        watch: called every `check_every` steps.
        each_step: called after every step.
    """
    options, status = state.options, state.check_start()
    began_at, steps_before, work_before = time.perf_counter(), state.steps, state.work_units
    while not status.at_rest and state.steps < options.max_steps:
        count = min(options.check_every, options.max_steps - state.steps)
        for _ in range(count):
            state.step()
            state.work_units += 1.0
            if each_step is not None:
                each_step(state)
        state.hold_grain()
        status = state.check_convergence(count)
        if state.matrix is not None and state.steps % _MATRIX_INTERVAL < count:
            state.matrix.update(state.position)
        if watch is not None:
            watch(state)
    return state.make_outcome(steps_before, work_before, began_at=began_at)


class TangentMatrix:
    """The k_ij of a network with pieces whose model is the membrane.

    A network is built with the k_ij of a cloth at rest. A cell whose shape in the plane differs much from that on the
    body, such as a sliver that the development has opened, is much softer. With the stiffness at rest its corners would
    creep back for ten thousand steps.
    """

    def __init__(self, network: SpringNetwork) -> None:
        """Prepare updates of this network; nothing is changed before `update` is called."""
        self._network = network
        cells = network.cell_arrays
        self._is_measured = np.zeros(network.cell_count, dtype=bool)
        for each in network.cell_models:
            if each.model == "membrane":
                begin, end = cells.of_face[[each.first, each.first + each.count]]
                self._is_measured[begin:end] = True
        side = springs_along_cells(network.spring_arrays, cells).reshape(-1, 3)
        self._side = side[self._is_measured].ravel()
        self._weight = wp.zeros(3 * network.cell_count, dtype=wp.float64, device=network.device)

    def update(self, position: wp.array) -> None:
        """Set the k_ij to a bound of the membrane's stiffness at positions (#V vec2d [m]) without mirrored cells."""
        network = self._network
        assert network.cloth is not None
        launch_quietly(
            bound_membrane,
            dim=network.face_count,
            inputs=[position, network.cells, network.cloth, 0],
            outputs=[self._weight],
            device=network.device,
        )
        weight = np.where(self._is_measured[:, None], self._weight.numpy().reshape(-1, 3), 0.0)
        stiffness = network.spring_arrays.stiffness.copy()
        sums = np.bincount(self._side, weight[self._is_measured].ravel(), minlength=network.spring_count)
        stiffness[self._side] = sums[self._side]
        network.update_stiffness(stiffness)
        network.cloth.held.assign(corner_sums(weight).ravel())
