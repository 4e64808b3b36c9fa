"""Nested iteration: a coarse level is relaxed first, and each finer level starts from the coarser one's layout.

On triangles that is the finest level whose Laplacian is cheap to factor: as-rigid iterations unfold it, and L-BFGS relaxes it to the end,
however crushed the faces of the first layout are. Steps on the coarsest level would come to a halt at them, and leave all finer levels at
a hundred times the least energy. Lattices, and layouts that as-rigid iterations do not unfold, begin with steps on the coarsest level.
"""

from __future__ import annotations

import math

import numpy as np

from warpflat.solver.multigrid.cycle import cycle, solve_coarsest
from warpflat.solver.multigrid.levels import Levels
from warpflat.solver.quasi_newton import relax_quasi_newton
from warpflat.surface.as_rigid import as_rigid_layout
from warpflat.surface.untangle import untangle

__all__ = ["nested_iteration"]

# The share of the first forces to which those of the coarsest level fall.
_COARSEST_FORCE_SHARE = 5e-3
# A level of triangles of at most this many vertices is relaxed by L-BFGS, in less time than a cycle of 100,000 vertices takes.
_MOST_FACTORED = 5_000


def nested_iteration(levels: Levels) -> None:
    """Relax a coarse level, and start each finer one from there; the finest level is not cycled yet."""
    for level in levels.all[1:]:
        level.state.load.zero_()
    first = _relax_factored(levels)
    if first is None:
        first = len(levels.all) - 1
        solve_coarsest(levels, _COARSEST_FORCE_SHARE)
    for number in range(first - 1, -1, -1):
        level = levels.all[number]
        _start_from_coarser(levels, number)
        assert level.transfer is not None
        sizes = [net.vertex_count for net in level.state.network.pieces]
        if number and any(n > len(step.kept) for n, step in zip(sizes, level.transfer.coarsenings, strict=True)):
            cycle(levels, number)
    levels.starts_rough = not (levels.is_lattice or levels.is_soft)


def _relax_factored(levels: Levels) -> int | None:
    """Relax the finest level that is cheap to factor, by as-rigid iterations and L-BFGS.

    Returns:
        Its index; None if there is no such level, or if as-rigid iterations do not unfold one of its pieces.
    """
    number = next((k for k, size in enumerate(levels.sizes) if size <= _MOST_FACTORED * levels.piece_count), 0)
    if levels.is_lattice or number == 0:
        return None
    state, layout = levels.all[number].state, levels.all[number].state.positions()
    for piece, own in enumerate(state.vertex_ranges):
        unfolded = as_rigid_layout(state.network.pieces[piece].surface, layout[own])
        if unfolded is None:
            return None
        layout[own] = unfolded
    state.position.assign(layout)
    state.check_start()
    for piece in range(levels.piece_count):
        part = state.extract([piece])
        outcome = relax_quasi_newton(part)
        part.copy_into(state)
        levels.count_work(number, outcome.work_units * part.network.vertex_count / state.network.vertex_count)
    return number


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
