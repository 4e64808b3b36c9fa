"""Quasi-Newton relaxation: L-BFGS over one sparse factor (Liu et al. 2017), for meshes small enough to be factored.

The metric is the Laplacian of the surface times the cloth's stiffness (`warpflat.surface.laplacian`): the same factor gives the
as-rigid start. The memory of L-BFGS learns what the metric does not say, as the difference between shear and stretch. A step is halved
until the energy falls; it is infinite where a face is mirrored, so that none ever is. The chord of the datum stays exactly upright.

Contact (`warpflat.solver.contact`) adds its barrier to the energy and its stiffness to the metric, and takes the same steps.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.sums import dot
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import Outcome
from warpflat.solver.grain_alignment import GrainAlignment, align_grain
from warpflat.solver.options import RelaxOptions
from warpflat.solver.relax import Watch
from warpflat.solver.relaxation import Relaxation
from warpflat.solver.remainder import Remainder, RemainderEstimate, looked_back
from warpflat.surface.connectivity import border_of
from warpflat.surface.laplacian import factor_pays, laplacian_solver

__all__ = ["Descent", "Measure", "Metric", "Point", "Problem", "quasi_newton_pays", "relax_quasi_newton"]

# Corrections that L-BFGS remembers.
_MEMORY = 8
# A piece is at rest when so many iterations together have released less than the energy tolerance allows, each,
_REST_INTERVAL = 10
# and when by the metric the next one could release at most this times the squared residual tolerance, as a share of the energy.
_NEGLIGIBLE_RELEASE = 0.004
# It is at rest, however large the force on a vertex of a sliver, if that is a smaller share still.
_SMALLER = 0.3
# The first step that is tried is longer than the last one taken by at most this factor.
_LONGER = 4.0
_LEAST_FRACTION, _ARMIJO = 1e-16, 1e-4
# Rounding of the metric's solution, in single precision.
_ROUNDING = 1e-6
# Work units of an iteration: two evaluations of the forces and the solution; and of each layout that is tried.
_WORK, _TRIAL_WORK = 3.0, 0.5

# Directions are measured no more often than after so many iterations.
_RENEWAL = 6
# A rise of the energy from one measurement of directions to the next, as a share, that makes them follow the layout by less.
_RISE = 1e-4

Measure = Callable[[FloatArray, FloatArray], Relaxation]
"""Returns the state to go on with from a layout, with directions measured in another one, each #V by 2 [m]."""

Solve = Callable[[FloatArray], FloatArray]


def quasi_newton_pays(network: SpringNetwork) -> bool:
    """Return whether L-BFGS may be the fastest: for one piece of few vertices, nothing sewn."""
    return network.seams is None and factor_pays(network.surface)


@dataclass(frozen=True, kw_only=True)
class Point:
    """A layout (#V by 2 [m]), the energy there [J], infinite where it is not allowed, and its gradient (#V by 2 [N])."""

    positions: FloatArray
    energy: float
    gradient: FloatArray


P = TypeVar("P", bound=Point)


class Problem(Protocol[P]):
    """An energy of layouts, and a metric for its steps."""

    def at(self, positions: FloatArray) -> P:
        """Evaluate a layout."""

    def solver(self, point: P) -> Solve:
        """Return the solution by the metric at a point."""


class Metric:
    """The Laplacian of a piece times its stiffness, with the chord of the datum held upright, plus stiffnesses of rank one."""

    def __init__(self, network: SpringNetwork, alignments: Sequence[GrainAlignment]) -> None:
        fabric = network.fabric
        self._stiffness = max(fabric.stiffness_warp, fabric.stiffness_weft)
        self._solve = laplacian_solver(network.surface)
        self._chords = np.array([[each.upper, each.lower, each.lower] for each in alignments]).reshape(-1, 3)
        self._across = np.array([[each.direction[1], -each.direction[0]] for each in alignments]).reshape(-1, 2)
        # The inverse's columns at vertices that have touched; most of the border never does.
        self._column: dict[int, FloatArray] = {}
        self._count = network.vertex_count

    def _columns(self, vertices: IntArray) -> FloatArray:
        new = [vertex for vertex in vertices.tolist() if vertex not in self._column]
        if new:
            unit = np.zeros((self._count, len(new)))
            unit[new, np.arange(len(new))] = 1.0 / self._stiffness
            self._column |= zip(new, self._solve(unit).T, strict=True)
        return np.stack([self._column[vertex] for vertex in vertices.tolist()])

    def solver(self, vertices: IntArray | None = None, lever: FloatArray | None = None) -> Solve:
        """Return the solution by the metric plus a row J^T J for each contact; it does not move chords sideways.

        Args:
            vertices: #C by 3, of contacts, if any.
            lever: #C by 3 by 2, the row's entries [(N/m)^1/2].
        """
        chord = np.zeros((len(self._chords), 3, 2))
        chord[:, 0], chord[:, 1] = self._across, -self._across
        rigid, contacts = (
            np.arange(len(chord)),
            np.arange(len(chord), len(chord) + (0 if lever is None else len(lever))),
        )
        vertices = self._chords if vertices is None else np.concatenate([self._chords, vertices])
        lever = chord if lever is None else np.concatenate([chord, lever])
        if len(vertices) == 0:
            return lambda force: self._solve(force) / self._stiffness
        own, at = np.unique(vertices, return_inverse=True)
        rows = np.zeros((2, len(vertices), len(own)))
        number = np.repeat(np.arange(len(vertices)), 3)
        for axis in range(2):
            np.add.at(rows[axis], (number, at.ravel()), lever[:, :, axis].ravel())
        columns = self._columns(own)
        table = columns[:, own]
        # By Woodbury's formula; a chord is a row of infinite stiffness.
        inner = np.eye(len(vertices))
        inner[rigid, rigid] = 0.0
        inner += sum(row @ table @ row.T for row in rows)
        # Contacts so stiff that 1 is lost beside them would leave it singular.
        inner[contacts, contacts] *= 1.0 + _ROUNDING

        def solve(force: FloatArray) -> FloatArray:
            step = self._solve(force) / self._stiffness
            pull = np.linalg.solve(inner, sum(rows[axis] @ step[own, axis] for axis in range(2)))
            for axis in range(2):
                step[:, axis] -= (rows[axis].T @ pull) @ columns
            for (upper, lower, _), across in zip(self._chords, self._across, strict=True):
                # What is left is rounding, which would add up over the steps.
                half = 0.5 * across * (across @ (step[upper] - step[lower]))
                step[upper] -= half
                step[lower] += half
            return step

        return solve


class _Memory:
    """The last corrections of L-BFGS (Nocedal and Wright, algorithm 7.4), all of them in one product (Byrd et al. 1994)."""

    def __init__(self, numbers: int, most: int) -> None:
        # Rows are used in turn; the oldest is overwritten. Single precision is enough for directions.
        rows: NDArray[np.float32] = np.empty((2, most, numbers), dtype=np.float32)
        self._steps, self._changes = rows[0], rows[1]
        self._order: list[int] = []
        # Scalar product of the step in each row with the change in each.
        self._table = np.zeros((most, most))

    @property
    def is_empty(self) -> bool:
        """True if nothing is remembered."""
        return not self._order

    def clear(self) -> None:
        """Forget everything."""
        self._order = []

    def add(self, step: FloatArray, change: FloatArray) -> None:
        """Remember a step and the change of the gradient along it, if the energy is convex there."""
        curvature = dot(step, change)
        if curvature <= 1e-12 * math.sqrt(dot(step, step) * dot(change, change)):
            return
        most = len(self._table)
        row = self._order[0] if len(self._order) == most else len(self._order)
        self._order = [*self._order[-most + 1 :], row]
        self._steps[row], self._changes[row] = step.ravel(), change.ravel()
        used = len(self._order)
        self._table[:used, row] = _products(self._steps[:used], change)

    def direction(self, gradient: FloatArray, solve: Solve) -> FloatArray:
        """Return the direction of descent."""
        if self.is_empty:
            return -solve(gradient)
        used, order = len(self._order), self._order
        steps, changes = self._steps[:used], self._changes[:used]
        # Each step times the changes that came with and after it.
        table = np.triu(self._table[np.ix_(order, order)])
        share: FloatArray = np.empty(used)
        share[order] = np.linalg.solve(table, _products(steps, gradient)[order])
        z = solve(gradient - np.einsum("i,ij->j", share, changes).reshape(gradient.shape))
        own: FloatArray = np.empty(used)
        own[order] = np.linalg.solve(table.T, np.diag(table) * share[order] - _products(changes, z)[order])
        return -z - np.einsum("i,ij->j", own, steps).reshape(z.shape)


def _products(rows: NDArray[np.float32], vectors: FloatArray) -> FloatArray:
    """Return the scalar products of rows (#N by #M) with vectors of #M numbers."""
    return np.asarray(np.einsum("ij,j->i", rows, vectors.ravel()))


class Descent(Generic[P]):
    """A running minimisation.

    Attributes:
        point: the present one.
        history: the energies of all points so far [J].
        fraction: how much of the last direction was taken, 1 for a whole step.
        tried: layouts that have been evaluated.
        release: the energy that the last step could have released, by the metric [J].
        is_stuck: whether no step makes the energy fall any more.
    """

    def __init__(self, problem: Problem[P], start: P, *, memory: int = _MEMORY) -> None:
        """Begin at a point; L-BFGS remembers the last `memory` corrections."""
        self._problem = problem
        self.point, self.history = start, [start.energy]
        self._memory, self.fraction = _Memory(start.positions.size, memory), 1.0
        self.tried, self.release, self.is_stuck = 1, np.inf, False

    @property
    def gain(self) -> float:
        """The range of the last few energies, which the iterations between have released [J]; infinite if there were fewer."""
        count = max(_REST_INTERVAL, looked_back(self.iterations))
        last = self.history[-1 - count :]
        return max(last) - min(last) if len(last) > count else np.inf

    @property
    def iterations(self) -> int:
        """Steps taken."""
        return len(self.history) - 1

    @property
    def work_units(self) -> float:
        """All work, in approximate implicit steps."""
        return _WORK * self.iterations + _TRIAL_WORK * self.tried

    @property
    def change(self) -> float:
        """Eq. (11) for the last iteration."""
        return (self.history[-2] - self.history[-1]) / max(self.history[-1], 1e-300) if len(self.history) > 1 else 0.0

    def is_at_rest(self, options: RelaxOptions, share: float = 1.0) -> bool:
        """Return whether the last iterations have released next to nothing, and the next could release no more than a share of that."""
        return (
            self.is_stuck or self.gain <= _REST_INTERVAL * options.energy_tolerance * self.point.energy
        ) and self.release <= share * _NEGLIGIBLE_RELEASE * options.residual_tolerance**2 * self.point.energy

    def step(self) -> bool:
        """Take one step; return False, and stay, where none makes the energy fall."""
        while True:
            direction = self._memory.direction(self.point.gradient, self._problem.solver(self.point))
            descent = dot(self.point.gradient, direction)
            self.release = -0.5 * descent
            new = self._search(direction, descent)
            if new is not None:
                break
            if self._memory.is_empty:
                self.is_stuck = True
                return False
            self._memory.clear()
            self.fraction = 1.0
        self._memory.add(new.positions - self.point.positions, new.gradient - self.point.gradient)
        self.point = new
        self.history.append(new.energy)
        return True

    def renew(self, *, forget: bool = False) -> None:
        """Evaluate the present point again, as the energy has changed, and forget past corrections if the metric has."""
        if forget:
            self._memory.clear()
        self.point = self._problem.at(self.point.positions)
        self.history[-1] = self.point.energy
        self.is_stuck = False

    def _search(self, direction: FloatArray, descent: float) -> P | None:
        """Halve a step until the energy falls enough. Where steps are short, the next one seldom is much longer."""
        fraction = min(1.0, _LONGER * self.fraction)
        while descent < 0.0 and fraction > _LEAST_FRACTION:
            new = self._problem.at(self.point.positions + fraction * direction)
            self.tried += 1
            if new.energy <= self.point.energy + _ARMIJO * fraction * descent:
                self.fraction = fraction
                return new
            fraction *= 0.5
        return None


class _Cloth:
    """The energy of a network alone."""

    def __init__(self, state: Relaxation) -> None:
        self.state = state
        self._solve = Metric(state.network, state.alignments).solver()

    def at(self, positions: FloatArray) -> Point:
        """Evaluate a layout."""
        self.state.place(positions)
        energies, force = self.state.evaluate_potential()
        return Point(positions=positions, energy=float(energies.sum()), gradient=-force)

    def solver(self, point: Point) -> Solve:
        """Return the solution by the metric, which is the same everywhere."""
        return self._solve


class _Directions:
    """The layout in which the directions of springs are measured.

    It is the present one. On slivers of soft cloth that makes short edges swing to and fro for ever. So once the energy rises, the layout
    follows the present one by half the way only, then by a quarter, and so on.
    """

    def __init__(self, measure: Measure, positions: FloatArray) -> None:
        self._measure, self._layout = measure, positions
        self._share, self._energy, self._measured = 1.0, np.inf, 0

    def is_due(self, iterations: int) -> bool:
        """Return whether directions are to be measured after so many iterations: once on each stretch that is looked back upon."""
        return iterations - self._measured >= max(_RENEWAL, looked_back(iterations))

    def renew(self, state: Relaxation, point: Point, iterations: int) -> Relaxation:
        """Return the state to go on with from a point, reached after so many iterations."""
        self._measured = iterations
        self._layout = self._layout + self._share * (point.positions - self._layout)
        new = self._measure(point.positions, self._layout)
        new.steps, new.restarts, new.work_units = state.steps, state.restarts, state.work_units
        new.has_status, new.status = True, state.status
        energy = float(new.potentials().sum())
        if energy > (1.0 + _RISE) * self._energy:
            self._share *= 0.5
        self._energy = energy
        return new


def relax_quasi_newton(
    state: Relaxation,
    *,
    measure: Measure | None = None,
    least_gain: float | None = None,
    watch: Watch | None = None,
    each_step: Watch | None = None,
) -> Outcome:
    """Minimise the energy of one piece until it is at rest, or the step limit is reached.

    Args:
        state: where to start, no cell mirrored; holds the relaxed layout afterwards.
        measure: measures the springs' directions anew, if the energy depends on them.
        least_gain: stop, at rest or not, once some iterations release no more than this share of the energy; if given.
        watch: called every few iterations with the state, its energies and the residual.
        each_step: called after every iteration, with the energies and the residual of the last check.
    """
    began_at, steps_before, work_before = time.perf_counter(), state.steps, state.work_units
    if state.check_start().at_rest.all():
        return state.make_outcome(steps_before, work_before, began_at=began_at)
    start = state.positions()
    align_grain(state.alignments, start)
    problem = _Cloth(state)
    point = problem.at(start)
    if not np.isfinite(point.energy):
        return state.make_outcome(steps_before, work_before, began_at=began_at)
    descent, options = Descent(problem, point), state.options
    estimate, left = RemainderEstimate(border_of(state.network.surface)), Remainder()
    directions = None if measure is None else _Directions(measure, start)

    done = False
    while not done:
        moved = descent.step()
        state.steps += moved
        state.work_units = work_before + descent.work_units
        if moved and each_step is not None:
            each_step(state, state.status.total, state.status.worst_residual)
        left = estimate.add(descent.point.energy, descent.point.positions, descent.fraction)
        near = left.is_small(options) or descent.is_at_rest(options)
        done = not moved or state.work_units - work_before >= options.max_steps
        done |= least_gain is not None and descent.gain <= least_gain * descent.point.energy
        if done or near or descent.iterations % options.check_every == 0:
            _check(state, descent, near, left)
            done |= bool(state.status.at_rest.all())
            if watch is not None:
                watch(state, state.status.total, state.status.worst_residual)
        if not done and directions is not None and directions.is_due(descent.iterations):
            problem.state = state = directions.renew(state, descent.point, descent.iterations)
            descent.renew()
    outcome = state.make_outcome(steps_before, work_before, began_at=began_at)
    return replace(outcome, left=left if np.isfinite(left.outline_mm) else None)


def _check(state: Relaxation, descent: Descent[Point], near: bool, left: Remainder) -> None:
    """Check convergence at the present layout: little left, or the tolerances are met, or free of strain.

    Args:
        state: holds the status afterwards.
        descent: where it is.
        near: whether it may be at rest.
        left: what is left by estimate.
    """
    state.place(descent.point.positions)
    state.evaluate_at_rest()
    status, options = state.check_convergence(1.0), state.options
    residual = status.residual * _without_reaction(state)
    small = left.is_small(options) or residual <= options.residual_tolerance or descent.is_at_rest(options, _SMALLER)
    free = descent.point.energy <= state.negligible_energy
    state.status = replace(status, residual=residual, at_rest=(near & small) | free, change=np.array([descent.change]))


def _without_reaction(state: Relaxation) -> float:
    """Return the largest force without that which keeps the chord upright, over the largest one without that which turns the piece."""
    force, (largest,) = state.cloth_force(), state.piece_sums.largest_forces(state.alignments)
    for each in state.alignments:
        across = np.array([each.direction[1], -each.direction[0]])
        reaction = 0.5 * across * (across @ (force[each.upper] - force[each.lower]))
        force[each.upper] -= reaction
        force[each.lower] += reaction
    return float(np.linalg.norm(force, axis=1).max() / max(largest, 1e-300))
