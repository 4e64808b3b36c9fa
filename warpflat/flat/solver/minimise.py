"""Minimisation by L-BFGS over a metric: one loop, one line search.

The metric (`warpflat.flat.solver.metric`) is one sparse factor. The memory of L-BFGS learns what it does not say, as the difference between
shear and stretch (Liu et al. 2017; Nocedal and Wright, chapter 7). A step is halved until the energy falls; it is infinite where a face is
mirrored or the border crosses itself, so that neither ever is. The chord of the datum stays exactly upright.

`relax` is the relaxation of a piece: the paper's steps while they gain, then `Descent` to the minimum. Contact, seams and the drape
minimise their own energies by the same `Descent`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.sums import dot
from warpflat.flat.solver.energy import Energy, Point
from warpflat.flat.solver.grain import align_grain
from warpflat.flat.solver.metric import CHEAP, LaplacianFactor, Metric, Solve, StiffnessFactor
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation, Watch, relax_by_steps, take_first_steps
from warpflat.flat.solver.stop import Outcome, Remainder, RemainderEstimate, Status, looked_back
from warpflat.flat.surface.connectivity import border_of

__all__ = ["Cloth", "Descent", "Measure", "Problem", "line_search", "relax"]

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
# A step that was too long is shortened to no less than this share.
_SHORTER = 0.1
_LEAST_FRACTION, _ARMIJO = 1e-16, 1e-4
# Work units of an iteration: two evaluations of the forces and the solution; and of each layout that is tried.
_WORK, _TRIAL_WORK = 3.0, 0.5

# After so many iterations over the Laplacian the cloth's own stiffness is factored, where cells are the cloth; and again after each so many
# times as many.
_FACTORED, _LATER = 15, 2
# if the energy has fallen by this share since.
_CHANGED = 0.03
# Directions are measured no more often than after so many iterations.
_RENEWAL = 6
# A rise of the energy from one measurement of directions to the next, as a share, that makes them follow the layout by less.
_RISE = 1e-4

Measure = Callable[[FloatArray, FloatArray], Relaxation]
"""Returns the state to go on with from a layout, with directions measured in another one, each #V by 2 [m]."""

P = TypeVar("P", bound=Point)


class Problem(Protocol[P]):
    """An energy of layouts, and a metric for its steps."""

    def at(self, positions: FloatArray) -> P:
        """Evaluate a layout."""

    def solver(self, point: P) -> Solve:
        """Return the solution by the metric at a point."""


@dataclass
class Cloth:
    """The energy of a network, with its seams and contacts, and the metric to which each layout adds the stiffness of its contacts."""

    energy: Energy
    metric: Metric
    _due: int = _FACTORED
    _energy_factored: float = np.inf

    def factor_stiffness(self, descent: Descent[Point]) -> None:
        """Take the cloth's own stiffness as the metric, if cells are the cloth, after 15 iterations of a descent, 30, 60 and so on.

        Cloth that has hardly changed since keeps its factor.
        """
        state, point = self.energy.state, descent.point
        if descent.iterations != self._due or state.network.model != "membrane" or len(point.positions) > CHEAP:
            return
        self._due *= _LATER
        if point.energy < (1.0 - _CHANGED) * self._energy_factored:
            self._energy_factored = point.energy
            # Contacts are a million times as stiff as cloth: Woodbury's differences of the inverse would be lost in single precision.
            precision = np.float64 if self.energy.has_contact else np.float32
            own = StiffnessFactor(state.network, point.positions, state.alignments, dtype=precision)
            self.metric = Metric(own, state.alignments)
            descent.renew(forget=True)

    def at(self, positions: FloatArray) -> Point:
        """Evaluate a layout."""
        return self.energy.at(positions)

    def solver(self, point: Point) -> Solve:
        """Return the solution by the metric at a point."""
        return self.metric.solver(point.touch.vertices, point.touch.rows)


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


def line_search(
    at: Callable[[FloatArray], P], start: P, direction: FloatArray, *, longest: float = 1.0
) -> tuple[P | None, float, int]:
    """Shorten a step until the energy falls enough by Armijo's rule (Nocedal and Wright, algorithm 3.1).

    The next one ends where the parabola through both energies and the slope is lowest (their eq. 3.58), between a tenth and a half of the
    last one; it is half as long where a face was mirrored.

    Args:
        at: evaluates a layout.
        start: where the step begins.
        direction: the whole step, #V by 2 or 3 [m].
        longest: the share of it that is tried first.

    Returns:
        The point at its end, None if no step makes the energy fall; the share that was taken; how many layouts were evaluated.
    """
    descent, fraction, tried = dot(start.gradient, direction), longest, 0
    while descent < 0.0 and fraction > _LEAST_FRACTION:
        new = at(start.positions + fraction * direction)
        tried += 1
        if new.energy <= start.energy + _ARMIJO * fraction * descent:
            return new, fraction, tried
        bent = 2.0 * (new.energy - start.energy - fraction * descent)
        fraction *= min(max(-fraction * descent / bent, _SHORTER), 0.5) if np.isfinite(bent) else 0.5
    return None, 0.0, tried


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

    def is_at_rest(self, options: RelaxOptions, share: float = 1.0) -> bool:
        """Return whether the last iterations have released next to nothing, and the next could release no more than a share of that."""
        return (
            self.is_stuck or self.gain <= _REST_INTERVAL * options.energy_tolerance * self.point.energy
        ) and self.release <= share * _NEGLIGIBLE_RELEASE * options.residual_tolerance**2 * self.point.energy

    def step(self) -> bool:
        """Take one step; return False, and stay, where none makes the energy fall."""
        while True:
            direction = self._memory.direction(self.point.gradient, self._problem.solver(self.point))
            self.release = -0.5 * dot(self.point.gradient, direction)
            # Where steps are short, the next one seldom is much longer.
            longest = min(1.0, _LONGER * self.fraction)
            new, fraction, tried = line_search(self._problem.at, self.point, direction, longest=longest)
            self.tried += tried
            if new is not None:
                self.fraction = fraction
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
        new.steps, new.restarts, new.work_units, new.status = (
            state.steps, state.restarts, state.work_units, state.status
        )  # fmt: skip
        energy = new.energies().potential
        if energy > (1.0 + _RISE) * self._energy:
            self._share *= 0.5
        self._energy = energy
        return new


def relax(
    state: Relaxation,
    *,
    measure: Measure | None = None,
    least_gain: float | None = None,
    first_steps: bool = True,
    watch: Watch | None = None,
    each_step: Watch | None = None,
) -> Outcome:
    """Minimise the energy of one piece until it is at rest, or the step limit is reached.

    It begins with the paper's steps, eqs. (4) to (10), which end where by eq. (11) they gain little. L-BFGS over one factor goes on to
    the minimum. With `solver = "paper"` the steps go on alone.

    Args:
        state: where to start, no cell mirrored; holds the relaxed layout afterwards.
        measure: measures the springs' directions anew, if the energy depends on them.
        least_gain: stop, at rest or not, once some iterations release no more than this share of the energy; if given.
        first_steps: whether to begin with the paper's steps.
        watch: called every few iterations with the state after a check.
        each_step: called after every step and iteration.
    """
    if state.options.solver == "paper":
        return relax_by_steps(state, watch=watch, each_step=each_step)
    if state.check_start().at_rest:
        return state.make_outcome(state.steps, state.work_units, began_at=time.perf_counter())
    start = measured = state.positions()
    align_grain(state.alignments, start)
    state.place(start)
    first = take_first_steps(state, each_step=each_step) if first_steps else None
    began_at, steps_before, work_before = time.perf_counter(), state.steps, state.work_units
    start = state.positions()
    layout = None if first is None else start
    problem = Cloth(Energy(state), Metric(LaplacianFactor(state.network), state.alignments))
    point = problem.at(start)
    if not np.isfinite(point.energy):
        return state.make_outcome(steps_before, work_before, began_at=began_at)
    descent, options = Descent(problem, point), state.options
    estimate, left = RemainderEstimate(border_of(state.network.surface)), Remainder()
    directions = None if measure is None else _Directions(measure, measured)

    done = False
    while not done:
        problem.factor_stiffness(descent)
        moved = descent.step()
        state.steps += moved
        state.work_units = work_before + descent.work_units
        if moved and each_step is not None:
            each_step(state)
        left = estimate.add(descent.point.energy, descent.point.positions, descent.fraction)
        near = left.is_small(options) or descent.is_at_rest(options)
        done = not moved or state.work_units - work_before >= options.max_steps
        done |= least_gain is not None and descent.gain <= least_gain * descent.point.energy
        if done or near or descent.iterations % options.check_every == 0:
            # Converged with little left, where the tolerances are met, or free of strain.
            state.place(descent.point.positions)
            state.evaluate_at_rest()
            # Of the force on the ends of a chord, what keeps it upright is no force of the cloth.
            energies, force, largest = state.energies(), state.cloth_force(), state.largest_force()
            for each in state.alignments:
                across = np.array([each.direction[1], -each.direction[0]])
                reaction = 0.5 * across * (across @ (force[each.upper] - force[each.lower]))
                force[each.upper] -= reaction
                force[each.lower] += reaction
            residual = state.residual() * float(np.linalg.norm(force, axis=1).max() / max(largest, 1e-300))
            small = left.is_small(options) or residual <= options.residual_tolerance
            small = small or descent.is_at_rest(options, _SMALLER)
            state.status = Status(
                energies=energies,
                residual=residual,
                at_rest=(near and small) or descent.point.energy <= state.negligible_energy,
            )
            done |= state.status.at_rest
            if watch is not None:
                watch(state)
        if not done and directions is not None and directions.is_due(descent.iterations):
            state = directions.renew(state, descent.point, descent.iterations)
            problem.energy = Energy(state)
            descent.renew()
    outcome = state.make_outcome(steps_before, work_before, began_at=began_at)
    left_to_do = left if np.isfinite(left.outline_mm) else None
    return replace(outcome, left=left_to_do, first_steps=first, first_layout=layout)
