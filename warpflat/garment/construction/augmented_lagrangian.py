"""Minimisation under equations: an augmented Lagrangian, for garments whose pieces are sewn together.

Each equation c(x) = 0 of the network (a seam's two lengths, a straight line, a fixed length) is held by 1/2 k (c + o)^2 with a finite
stiffness k. A round minimises the energy of cloth and equations. Then the offset o grows by the residual c, until all equations hold
(Nocedal and Wright, Numerical Optimization, chapter 17). The first round begins with the paper's steps, unless an earlier relaxation under
the same equations goes on. L-BFGS takes the rest, over one factor of the Gauss-Newton stiffness J^T J of cloth and equations, so that stiff
equations cost no more iterations than soft ones. Contact (`warpflat.flat.solver.contact`) may be a term of the energy.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core import FloatArray
from warpflat.flat import (
    MOST_FACTORED,
    Barrier,
    Cloth,
    Descent,
    Energy,
    Metric,
    Outcome,
    Relaxation,
    RelaxOptions,
    SpringNetwork,
    StiffnessFactor,
    align_grain,
    equation_rows,
    relax_by_steps,
    take_first_steps,
)

__all__ = ["ConstrainedOutcome", "factor_pays", "relax_under_equations"]

# A round ends when by the metric the next step could release at most this times the squared residual tolerance, as a share of the energy,
# or after so many steps. With more left, the sums of eased seams move by more than the offsets correct (0.2: a dress bounced).
_NEGLIGIBLE_RELEASE = 0.02
_STEPS_PER_ROUND = 200
_MOST_ROUNDS = 50
# Rounds over which the violation must come down, or the equations contradict each other.
_PATIENCE = 10
# After so many steps the factor is made again at the end of a round.
_STEPS_PER_FACTOR = 25
# Of the paper's steps alone: steps of a round at most, since the residuals of a whole seam take a dozen rounds, whether the cloth has come
# to rest before the offsets grow or only begun to. After every few rounds the next ones become a quarter longer: offsets that follow cloth
# that still swings keep it swinging.
_PAPER_STEPS_PER_ROUND, _ROUNDS_UNTIL_LONGER, _PAPER_PATIENCE = 40, 5, 20


Correction = Callable[[FloatArray, Callable[[FloatArray], FloatArray] | None], FloatArray]


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
    """Return whether the stiffness of a network is factored: if it is not too large, and the paper's steps alone are not asked for."""
    return options.solver != "paper" and network.vertex_count <= MOST_FACTORED


def _stiffness_metric(state: Relaxation) -> Metric:
    """Factor the stiffness of cloth and equations in the present layout."""
    return Metric(StiffnessFactor(state.network, state.positions(), state.alignments), state.alignments)


def relax_under_equations(
    state: Relaxation,
    correction: Correction = lambda residuals, _: residuals,
    violation: Callable[[FloatArray], float] = lambda residuals: 0.0,
    *,
    on_round: Callable[[FloatArray], None] = lambda residuals: None,
    gap: float = 0.0,
) -> ConstrainedOutcome:
    """Minimise the energy of pieces under the equations of their network, if it has some.

    Args:
        state: where to start, no cell mirrored; holds the relaxed layout afterwards.
        correction: of residuals (#P [m]), by how much the offsets grow; it may ask by how much residuals then change, by the metric,
            where that has been factored.
        violation: of residuals (#P [m]), the largest over its tolerance: up to 1 all equations hold.
        on_round: called after each round with the residuals.
        gap: with contact between stretches of a piece's border, the distance below which it acts [m]; then no piece may lie over
            itself at the start, and none does at the end. 0 for none.
    """
    network, options, violations = state.network, state.options, list[float]()
    if not factor_pays(network, options):
        return _relax_by_steps(state, correction, violation, on_round)
    start = state.positions()
    align_grain(state.alignments, start)
    state.place(start)
    state.check_start()
    # Steps know no contact. Where offsets are known, an earlier minimum goes on, in which the forces of seams and cloth balance: to the
    # steps a seam's tension is a large energy, and they would carry soft cloth along a flat valley.
    goes_on = network.seams is not None and network.seams.offset.numpy().any()
    # Factored before the steps: they leave seams and cloth beside them compressed, where the stiffness is a poor guide.
    metric = _stiffness_metric(state)
    first = None if gap or goes_on else take_first_steps(state)
    layout = None if first is None else state.positions()
    began_at, steps_before, work_before = time.perf_counter(), state.steps, state.work_units
    problem = Cloth(Energy(state, Barrier.of(network, gap) if gap else None), metric)
    descent = Descent(problem, problem.at(state.positions()))
    factored_at = 0

    def is_at_rest() -> bool:
        # Pieces that lie flat without strain, as those of a bag, have no energy of which to take a share.
        energy = descent.point.energy
        least = _NEGLIGIBLE_RELEASE * options.residual_tolerance**2 * energy
        return energy <= state.negligible_energy or descent.release <= least

    while True:
        most = min(_STEPS_PER_ROUND, options.max_steps - state.steps) + descent.iterations
        before = descent.iterations
        while descent.iterations < most and descent.step() and not is_at_rest():
            pass
        state.steps += descent.iterations - before
        state.work_units = work_before + descent.work_units
        state.place(descent.point.positions)
        residuals = network.seam_residuals(state.position)
        violations.append(violation(residuals))
        on_round(residuals)
        state.evaluate_at_rest()
        status = state.check_convergence(1.0)
        at_rest = status.at_rest or is_at_rest()
        state.status = replace(status, at_rest=at_rest)
        # Twice, since within the tolerances of the equations the energy may still change.
        done = at_rest and (network.seams is None or (len(violations) > 1 and max(violations[-2:]) <= 1.0))
        contradictory = not done and _stagnates(violations, _PATIENCE)
        if done or contradictory or state.steps >= options.max_steps or len(violations) == _MOST_ROUNDS:
            outcome = state.make_outcome(steps_before, work_before, began_at=began_at)
            return ConstrainedOutcome(
                outcome=replace(outcome, first_steps=first, first_layout=layout),
                residuals=residuals,
                satisfied=violations[-1] <= 1.0,
                contradictory=contradictory,
            )
        if network.seams is not None:
            grown = correction(residuals, _response(network, descent.point.positions, problem.metric))
            network.seams.offset.assign(network.seams.offset.numpy() + grown)
        is_stale = descent.iterations - factored_at > _STEPS_PER_FACTOR
        if is_stale:
            problem.metric = _stiffness_metric(state)
            factored_at = descent.iterations
        descent.renew(forget=is_stale)


def _response(network: SpringNetwork, positions: FloatArray, metric: Metric) -> Callable[[FloatArray], FloatArray]:
    """Return by how much residuals change, by a metric without contacts, where offsets grow by given lengths, each #P by #K [m]."""
    assert network.seams is not None
    root, rows = np.sqrt(network.seams.stiffness.numpy())[:, None], equation_rows(network, positions)

    def respond(growth: FloatArray) -> FloatArray:
        changed = rows @ -metric.factor.solve(rows.T @ (root * growth))
        return np.divide(changed, root, out=np.zeros_like(changed), where=root > 0.0)

    return respond


def _relax_by_steps(
    state: Relaxation,
    correction: Correction,
    violation: Callable[[FloatArray], float],
    on_round: Callable[[FloatArray], None],
) -> ConstrainedOutcome:
    """Relax by the paper's steps alone, let the offsets grow, and repeat until all is at rest and the equations hold in two rounds running.

    See `relax_under_equations` for the arguments.
    """
    seams, options, violations = state.network.seams, state.options, list[float]()
    if seams is None:
        outcome = relax_by_steps(state)
        return ConstrainedOutcome(outcome=outcome, residuals=np.zeros(0), satisfied=True, contradictory=False)
    while True:
        longer = len(violations) // _ROUNDS_UNTIL_LONGER * _PAPER_STEPS_PER_ROUND // 4
        most = state.steps + _PAPER_STEPS_PER_ROUND + longer
        state.options = replace(options, max_steps=min(options.max_steps, most))
        outcome, residuals = relax_by_steps(state), state.network.seam_residuals(state.position)
        violations.append(violation(residuals))
        on_round(residuals)
        done = outcome.converged and len(violations) > 1 and max(violations[-2:]) <= 1.0
        contradictory = not done and _stagnates(violations, _PAPER_PATIENCE)
        if done or contradictory or state.steps >= options.max_steps:
            satisfied = violations[-1] <= 1.0
            return ConstrainedOutcome(
                outcome=outcome, residuals=residuals, satisfied=satisfied, contradictory=contradictory
            )
        seams.offset.assign(seams.offset.numpy() + correction(residuals, None))


def _stagnates(violations: Sequence[float], patience: int) -> bool:
    """Return whether equations no longer come nearer to holding, by their violation after each round.

    They contradict each other if it has come down by less than a tenth over `patience` rounds.
    """
    before, lately = violations[:-patience], violations[-patience:]
    return bool(before) and min(lately) > max(0.9 * min(before), 1.0)
