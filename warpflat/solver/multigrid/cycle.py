"""The multigrid cycle (full approximation scheme); `warpflat.solver.multigrid.solve` describes its steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.model.network import SpringNetwork
from warpflat.solver.multigrid.acceleration import SubspaceAcceleration
from warpflat.solver.multigrid.level_transfer import LevelTransfer
from warpflat.solver.multigrid.levels import CHECK_INTERVAL, FORCE_WORK, LEAST_FRACTION, Levels

__all__ = ["accelerated_cycle", "cycle", "solve_coarsest"]


# The coarsest level is relaxed by this many steps at a time, until the forces have fallen to this share of what they
# were, or for this many steps per vertex along its side: a crack that opens is slow there too. It also ends once a run
# of steps gains no more than this share of all gained so far: the coarse problem is not worth solving to the last per
# cent.
_COARSEST_STEPS = 8
_COARSEST_FORCE_SHARE = 0.05
_MOST_COARSEST_STEPS = 24.0
_COARSEST_GAIN_SHARE = 0.07
# After every second run the energy is minimised over the subspace of the last runs: a crack opens in a third of the
# steps. A rectangular grid is at rest as soon without. In cycles this is for lattices only: a coarse level of triangles
# stores roughly the energy of the fine level, and is not worth following to its end.
_ACCELERATE_EVERY = 2
# Nested iteration on triangles leaves mostly rough errors, since each mesh is uneven in its own way: in the first cycle
# this many steps before and after the correction save another cycle.
_STEPS_AFTER_ROUGH_START = 12, 8


def cycle(levels: Levels, level: int, each_step: Callable[[], None] | None = None) -> FloatArray:
    """Run one cycle from a level down and up again.

    On the finest level the forces must have been evaluated, and their work counted.

    Args:
        levels: all levels; those from `level` on are changed.
        level: index of the level, 0 for the finest.
        each_step: called after each step on this level.

    Returns:
        #P, the objective at the end [J].
    """
    transfer = levels.all[level].transfer
    if transfer is None:
        return solve_coarsest(levels, _COARSEST_FORCE_SHARE, _COARSEST_GAIN_SHARE)
    pre_steps, post_steps = _smoothing_steps(levels, level)

    before = levels.smooth(level, each_step, evaluated=level == 0, steps=pre_steps)
    _evaluate_residual(levels, level)
    if not _restrict(levels, level, transfer):
        return levels.smooth(level, each_step)
    cycle(levels, level + 1)
    _correct(levels, level, transfer)
    energy = levels.smooth(level, each_step, evaluated=True, steps=post_steps)
    return levels.backtrack(level, transfer.base, transfer.correction, before, energy)


def _smoothing_steps(levels: Levels, level: int) -> tuple[int | None, int | None]:
    """Return the steps before and after the correction; None for the level's own number."""
    if level == 0 and levels.starts_rough:
        levels.starts_rough = False
        return _STEPS_AFTER_ROUGH_START
    return None, None


def _evaluate_residual(levels: Levels, level: int) -> None:
    """Evaluate the residual forces that the coarse level must reduce."""
    if level == 0:
        # The caller has counted the evaluation before the first smoothing step.
        levels.count_work(level, -FORCE_WORK)
    levels.evaluate_forces(level)
    _record_iterate(levels, level)


def _restrict(levels: Levels, level: int, transfer: LevelTransfer) -> bool:
    """Restrict the layout by injection, and the residual forces by the transpose of the prolongation.

    Returns:
        False if every piece has mirrored cells on the coarse level.
    """
    transfer.inject.launch()
    transfer.coarse.load.zero_()
    levels.evaluate_forces(level + 1)
    mirrored = transfer.coarse.mirrored_pieces()
    levels.is_outdated = levels.is_outdated or bool(mirrored.any())
    if mirrored.all():
        return False
    transfer.restrict_load.launch()
    return True


def _correct(levels: Levels, level: int, transfer: LevelTransfer) -> None:
    """Add the prolonged correction, halved for each piece until no cell is mirrored; the forces are evaluated there."""
    state = levels.all[level].state
    transfer.compute_correction(state)
    pieces, fraction = np.ones(len(state.vertex_ranges), dtype=bool), 1.0
    while pieces.any():
        state.move_along(transfer.base, transfer.correction, fraction, pieces)
        state.evaluate_at_rest()
        pieces &= state.mirrored_pieces() & (fraction > 0.0)
        fraction = 0.5 * fraction if fraction > LEAST_FRACTION else 0.0
        if pieces.any():
            levels.count_work(level, FORCE_WORK)
            # Evaluating the forces has overwritten the correction.
            transfer.prolong_correction.launch()
    _record_iterate(levels, level)


def _record_iterate(levels: Levels, level: int) -> None:
    """Add the present iterate of the finest level to its acceleration."""
    if level == 0 and levels.accelerations:
        levels.add_iterate(0, levels.accelerations, levels.all[0].state.piece_sums.iterate())


def solve_coarsest(levels: Levels, force_share: float, gain_share: float = 0.0) -> FloatArray:
    """Relax the coarsest level by steps.

    It ends once the forces of each piece have fallen to `force_share` of what they were, or a run of steps gains less
    than `gain_share` of all gained so far.

    Returns:
        #P, the objective at the end [J].
    """
    last = len(levels.all) - 1
    level, accelerations = levels.all[last], [SubspaceAcceleration() for _ in range(levels.piece_count)]
    state, sums = level.state, level.state.piece_sums
    state.evaluate_at_rest()
    target = force_share * sums.force_norms()
    first = before = now = levels.objective(last)
    accelerated = not levels.is_grid and (levels.is_lattice or not gain_share)
    steps = level.steps if level.has_lines else _COARSEST_STEPS
    if accelerated:
        levels.begin_acceleration(last, accelerations, sums.loaded_iterate())
    for run in range(1, 1 + _most_coarsest_runs(state.network.pieces)):
        state.sweep(steps, check_interval=CHECK_INTERVAL)
        levels.count_work(last, steps)
        now = levels.step_along_lines(last) if level.has_lines else levels.objective(last)
        if accelerated and run % _ACCELERATE_EVERY == 0 and np.isfinite(now).all():
            state.evaluate_at_rest()
            levels.add_iterate(last, accelerations, sums.loaded_iterate())
            now = levels.minimise_in_subspace(last, accelerations, now)
            state.evaluate_at_rest()
            levels.begin_acceleration(last, accelerations, sums.loaded_iterate())
        with np.errstate(invalid="ignore"):  # infinite, with mirrored cells
            slow = before - now < gain_share * (first - now)
        if ((sums.force_norms() <= target) | slow).all():
            break
        before = now
    return now


def _most_coarsest_runs(pieces: Sequence[SpringNetwork]) -> int:
    side = math.sqrt(max(net.vertex_count for net in pieces))
    return math.ceil(_MOST_COARSEST_STEPS * side / _COARSEST_STEPS)


def accelerated_cycle(
    levels: Levels, accelerations: Sequence[SubspaceAcceleration], each_step: Callable[[], None] | None = None
) -> None:
    """Run a cycle from the finest level, then minimise over the subspace of its and past cycles' corrections.

    On triangles the first cycle is not accelerated: most of its correction is rough.

    Args:
        levels: all levels; the forces on the finest one must have been evaluated, and their work counted.
        accelerations: of each piece.
        each_step: called after each step on the finest level.
    """
    sums = levels.all[0].state.piece_sums
    levels.accelerations = accelerations
    levels.begin_acceleration(0, accelerations, sums.iterate())
    energy = cycle(levels, 0, each_step)
    if levels.is_lattice or any(each.past for each in accelerations):
        levels.evaluate_forces(0)
        levels.add_iterate(0, accelerations, sums.iterate())
        levels.minimise_in_subspace(0, accelerations, energy)
