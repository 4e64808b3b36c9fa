"""Relaxation under equations: quasi-Newton steps on an augmented Lagrangian, for garments whose pieces are sewn together.

Each equation c(x) = 0 of the network is held by 1/2 k (c + o)^2 with a finite stiffness k. L-BFGS (`warpflat.solver.quasi_newton`)
minimises the energy of cloth and equations. Its metric is one sparse factor of their Gauss-Newton stiffness J^T J, so that stiff
equations cost no more steps than soft ones. After each round the offset o grows by the residual c, until all equations hold (Nocedal and
Wright, Numerical Optimization, chapter 17). Contact (`warpflat.solver.contact`) may be a part of the energy; its stiffness is
added to the metric by Woodbury's formula.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array

from warpflat.core.arrays import FloatArray
from warpflat.core.sparse import factor_symmetric
from warpflat.kernels.constraints import LENGTHS, LINEAR, STRAIGHT
from warpflat.model.network import SpringNetwork
from warpflat.solver.contact import Barrier, ContactPoint, evaluate_with_contact
from warpflat.solver.convergence import Outcome
from warpflat.solver.gauss_newton import GaussNewtonSteps
from warpflat.solver.grain_alignment import align_grain
from warpflat.solver.options import RelaxOptions
from warpflat.solver.quasi_newton import Descent, Solve
from warpflat.solver.relaxation import Relaxation

__all__ = ["ConstrainedOutcome", "factor_pays", "relax_under_equations", "stagnates"]

# A round ends when by the metric the next step could release at most this times the squared residual tolerance, as a share of the energy,
# or after so many steps.
_NEGLIGIBLE_RELEASE = 0.1
_STEPS_PER_ROUND = 200
_MOST_ROUNDS = 50
# Rounds over which the violation must come down, or the equations contradict each other.
_PATIENCE = 10
# After so many steps the factor is made again at the end of a round.
_STEPS_PER_FACTOR = 25
# The most vertices of a network that is factored: a factor's entries grow faster than the mesh.
_MOST_VERTICES = 100_000
# Stiffness added to hold pieces as a whole, over the mean of the diagonal.
_REGULARISATION = 1e-9


@dataclass(frozen=True, kw_only=True)
class ConstrainedOutcome:
    """The end of a relaxation under equations.

    Attributes:
        outcome: of the cloth.
        residuals: #P, c of each equation [m].
        satisfied: whether all equations hold.
        contradictory: whether they come no nearer to holding.
    """

    outcome: Outcome
    residuals: FloatArray
    satisfied: bool
    contradictory: bool


def factor_pays(network: SpringNetwork, options: RelaxOptions) -> bool:
    """Return whether a network is relaxed by `relax_under_equations`: if it is not too large, and plain steps are not asked for."""
    return options.solver != "plain" and network.vertex_count <= _MOST_VERTICES


class _SewnCloth:
    """The energy of a network and its equations, and the factor of its stiffness in the layout at the start."""

    def __init__(self, state: Relaxation, gap: float) -> None:
        self._state = state
        self._barrier = Barrier.of(state.network, gap) if gap else None
        self.factor_again()

    def factor_again(self) -> None:
        """Factor the stiffness in the present layout of the state."""
        self._solve = _metric(self._state)
        # The inverse's columns at coordinates of vertices that have touched.
        self._column: dict[int, FloatArray] = {}

    def at(self, positions: FloatArray) -> ContactPoint:
        """Evaluate a layout."""
        return evaluate_with_contact(self._state, self._barrier, positions)

    def solver(self, point: ContactPoint) -> Solve:
        """Return the solution by the metric: the factor plus the stiffness of the contacts."""
        base, touch = self._solve, point.touch
        if len(touch.vertices) == 0:
            return base
        coordinates, at = np.unique(2 * touch.vertices[:, :, None] + np.arange(2), return_inverse=True)
        rows = np.zeros((len(touch.vertices), len(coordinates)))
        number = np.repeat(np.arange(len(rows)), 6)
        np.add.at(rows, (number, at.ravel()), touch.rows.ravel())
        for coordinate in coordinates.tolist():
            if coordinate not in self._column:
                unit = np.zeros(point.positions.size)
                unit[coordinate] = 1.0
                self._column[coordinate] = base(unit.reshape(-1, 2)).ravel()
        columns = np.stack([self._column[coordinate] for coordinate in coordinates.tolist()])
        inner = np.eye(len(rows)) + rows @ columns[:, coordinates] @ rows.T

        def solve(force: FloatArray) -> FloatArray:
            step = base(force).ravel()
            pull = np.linalg.solve(inner, rows @ step[coordinates])
            return np.asarray(step - (rows.T @ pull) @ columns).reshape(-1, 2)

        return solve


def _metric(state: Relaxation) -> Solve:
    """Factor the Gauss-Newton stiffness of cloth and equations in the present layout."""
    network, positions = state.network, state.positions()
    matrix = GaussNewtonSteps(network, state.alignments).matrix(positions)
    free = network.bonds.freedom.numpy().ravel()
    if network.seams is not None:
        rows = _equation_rows(network, positions) @ diags_array(free)
        matrix = csc_array(matrix + rows.T @ rows)
    diagonal = matrix.diagonal()
    matrix.setdiag(diagonal + _REGULARISATION * diagonal.mean() + (free == 0.0) * diagonal.max())
    factor = factor_symmetric(matrix)
    # The chords keep their directions exactly: their rows are Lagrange multipliers.
    chords = np.zeros((len(state.alignments), len(free)))
    for row, each in zip(chords, state.alignments, strict=True):
        across = np.array([each.direction[1], -each.direction[0]])
        row.reshape(-1, 2)[[each.upper, each.lower]] = across, -across
    columns = factor(np.ascontiguousarray(chords.T))
    inner = chords @ columns

    def solve(force: FloatArray) -> FloatArray:
        step = factor(np.ascontiguousarray(force.ravel()))
        return np.asarray(step - columns @ np.linalg.solve(inner, chords @ step)).reshape(-1, 2)

    return solve


def relax_under_equations(
    state: Relaxation,
    correction: Callable[[FloatArray], FloatArray] = lambda residuals: residuals,
    violation: Callable[[FloatArray], float] = lambda residuals: 0.0,
    *,
    on_round: Callable[[FloatArray], None] | None = None,
    gap: float = 0.0,
) -> ConstrainedOutcome:
    """Minimise the energy of pieces under the equations of their network, if it has some.

    Args:
        state: where to start, no cell mirrored; holds the relaxed layout afterwards.
        correction: of residuals (#P [m]), by how much the offsets grow.
        violation: of residuals (#P [m]), the largest over its tolerance: up to 1 all equations hold.
        on_round: called after each round with the residuals.
        gap: with contact between stretches of a piece's border, the distance below which it acts [m]; then no piece may lie over
            itself at the start, and none does at the end. 0 for none.
    """
    began_at, steps_before, work_before = time.perf_counter(), state.steps, state.work_units
    network, options, violations = state.network, state.options, list[float]()
    start = state.positions()
    align_grain(state.alignments, start)
    state.place(start)
    state.check_start()
    problem = _SewnCloth(state, gap)
    descent = Descent(problem, problem.at(state.positions()))
    factored_at = 0
    while True:
        _run_round(descent, state)
        state.work_units = work_before + descent.work_units
        state.place(descent.point.positions)
        residuals = network.seam_residuals(state.position)
        violations.append(violation(residuals))
        if on_round is not None:
            on_round(residuals)
        state.evaluate_at_rest()
        status = state.check_convergence(1.0)
        at_rest = bool(status.at_rest.all()) or _is_at_rest(descent, options)
        state.status = replace(status, at_rest=np.full(len(status.at_rest), at_rest))
        # Twice, since within the tolerances of the equations the energy may still change.
        done = at_rest and (network.seams is None or (len(violations) > 1 and max(violations[-2:]) <= 1.0))
        contradictory = not done and stagnates(violations, _PATIENCE)
        if done or contradictory or state.steps >= options.max_steps or len(violations) == _MOST_ROUNDS:
            outcome = state.make_outcome(steps_before, work_before, began_at=began_at)
            return ConstrainedOutcome(
                outcome=outcome, residuals=residuals, satisfied=violations[-1] <= 1.0, contradictory=contradictory
            )
        if network.seams is not None:
            network.seams.offset.assign(network.seams.offset.numpy() + correction(residuals))
        is_stale = descent.iterations - factored_at > _STEPS_PER_FACTOR
        if is_stale:
            problem.factor_again()
            factored_at = descent.iterations
        descent.renew(forget=is_stale)


def _run_round(descent: Descent[ContactPoint], state: Relaxation) -> None:
    for _ in range(min(_STEPS_PER_ROUND, state.options.max_steps - state.steps)):
        if not descent.step():
            break
        state.steps += 1
        if _is_at_rest(descent, state.options):
            break


def _is_at_rest(descent: Descent[ContactPoint], options: RelaxOptions) -> bool:
    return descent.release <= _NEGLIGIBLE_RELEASE * options.residual_tolerance**2 * descent.point.energy


def stagnates(violations: Sequence[float], patience: int) -> bool:
    """Return whether equations no longer come nearer to holding, by their violation after each round.

    They contradict each other if it has come down by less than a tenth over `patience` rounds.
    """
    before, lately = violations[:-patience], violations[-patience:]
    return bool(before) and min(lately) > max(0.9 * min(before), 1.0)


def _equation_rows(network: SpringNetwork, positions: FloatArray) -> csr_array:
    """Return the gradients of a network's equations times the roots of their stiffnesses, #P by 2 #V [(N/m)^1/2]."""
    seams = network.seams
    assert seams is not None
    ends, kind = seams.ends.numpy().reshape(-1, 4), seams.kind.numpy()
    gradient = np.array(seams.lever.numpy()).reshape(-1, 4, 2) * (kind == LINEAR)[:, None, None]
    x = positions[ends]
    first, second = _unit(x[:, 1] - x[:, 0]), _unit(x[:, 3] - x[:, 2])
    ratio = seams.ratio.numpy()[:, None]
    of_lengths = np.stack([-first, first, ratio * second, -ratio * second], axis=1)
    chord = x[:, 2] - x[:, 1]
    u = _unit(chord)
    across = np.stack([-u[:, 1], u[:, 0]], axis=1)
    share = np.einsum("ij,ij->i", x[:, 0] - x[:, 1], u) / np.maximum(np.linalg.norm(chord, axis=1), 1e-300)
    of_line = np.stack(
        [across, (share - 1.0)[:, None] * across, -share[:, None] * across, np.zeros_like(across)], axis=1
    )
    gradient = np.where((kind == LENGTHS)[:, None, None], of_lengths, gradient)
    gradient = np.where((kind == STRAIGHT)[:, None, None], of_line, gradient)
    gradient *= np.sqrt(seams.stiffness.numpy())[:, None, None]
    columns = 2 * ends[:, :, None] + np.arange(2)
    rows = csr_array(
        (gradient.ravel(), columns.ravel(), 8 * np.arange(len(ends) + 1)), shape=(len(ends), 2 * len(positions))
    )
    rows.sum_duplicates()
    return rows


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)[:, None])
