"""Nested iteration: the coarsest level is relaxed first, and each finer level starts from the coarser one's layout."""

from __future__ import annotations

import math

import numpy as np

from warpflat.solver.multigrid.acceleration import SubspaceAcceleration
from warpflat.solver.multigrid.cycle import accelerated_cycle, cycle, solve_coarsest
from warpflat.solver.multigrid.levels import Levels
from warpflat.surface.untangle import untangle

__all__ = ["nested_iteration", "relax_cascade_start"]

# The share of the first forces to which those of the coarsest level fall.
_COARSEST_FORCE_SHARE = 5e-3
_CYCLES_ALONG_LINES = 2


def nested_iteration(levels: Levels) -> None:
    """Relax the coarsest level, and start each finer one from there; the finest level is not cycled yet."""
    last = len(levels.all) - 1
    for level in levels.all[1:]:
        level.state.load.zero_()
    solve_coarsest(levels, _COARSEST_FORCE_SHARE)
    for number in range(last - 1, -1, -1):
        level = levels.all[number]
        _start_from_coarser(levels, number)
        assert level.transfer is not None
        sizes = [net.vertex_count for net in level.state.network.pieces]
        if number and any(n > len(step.kept) for n, step in zip(sizes, level.transfer.coarsenings, strict=True)):
            cycle(levels, number, brief=_starts_smoothly(levels))
    levels.starts_rough = not (levels.is_lattice or levels.is_soft)


def relax_cascade_start(levels: Levels) -> None:
    """Run nested iteration and a cycle on the finest level; two accelerated ones where the smoother uses lines.

    In a cloth so soft more is left after nested iteration, and cycles reduce it further.
    """
    nested_iteration(levels)
    accelerations = [SubspaceAcceleration() for _ in range(levels.piece_count)]
    if not levels.all[0].has_lines:
        levels.evaluate_forces(0)
        cycle(levels, 0, brief=_starts_smoothly(levels))
        return
    for _ in range(_CYCLES_ALONG_LINES):
        levels.evaluate_forces(0)
        accelerated_cycle(levels, accelerations)


def _starts_smoothly(levels: Levels) -> bool:
    """Return whether each level starts so near to rest that only rough errors are left."""
    return levels.is_grid and levels.all[0].state.network.is_stiff


def _start_from_coarser(levels: Levels, number: int) -> None:
    """Start a level from the coarser one's layout, or else from its own layout plus the coarser one's correction.

    The former is smoother, the latter keeps the details of the finer mesh. Pieces whose energy neither lowers stay
    where they are.
    """
    state, transfer = levels.all[number].state, levels.all[number].transfer
    assert transfer is not None
    before, energy = state.positions(), levels.objective(number)
    interpolations = [each.smooth_interpolation for each in transfer.coarsenings]
    if None in interpolations:
        transfer.prolong_layout.launch()
    layout, coarse = state.positions(), transfer.coarse.positions()
    for interpolate, own, below in zip(interpolations, state.vertex_ranges, transfer.coarse.vertex_ranges, strict=True):
        if interpolate is not None:
            layout[own] = interpolate(coarse[below])
    state.position.assign(layout)
    interpolated = levels.objective(number)
    mirrored = np.flatnonzero(np.isinf(interpolated))
    if len(mirrored):
        # Mirrored faces, such as single ones at a border.
        left = np.zeros(len(interpolated), dtype=bool)
        for piece in mirrored.tolist():
            own = state.vertex_ranges[piece]
            layout[own], left[piece] = untangle(state.network.pieces[piece].surface, layout[own])
        state.position.assign(layout)
        interpolated = np.where(left, math.inf, levels.objective(number))
    lower = interpolated < energy
    if not lower.all():
        for piece in np.flatnonzero(~lower).tolist():
            own = state.vertex_ranges[piece]
            layout[own] = before[own]
        state.position.assign(layout)
        transfer.compute_correction(state)
        levels.line_search(number, transfer.base, transfer.correction, energy, ~lower)
