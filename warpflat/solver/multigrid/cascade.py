"""The cascadic start of large lattices: a small lattice is relaxed, and its layout interpolated by cubics at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.model.join import join_networks
from warpflat.solver.grain_alignment import align_grain
from warpflat.solver.multigrid.hierarchy import CascadeStart, make_cascade_start
from warpflat.solver.multigrid.levels import ENERGY_WORK, Levels
from warpflat.solver.multigrid.nested_iteration import relax_cascade_start
from warpflat.solver.relaxation import Relaxation

__all__ = ["start_from_cascade"]


# Lattices of more vertices start from a relaxed small one of at most that many: from this size on cubic interpolation
# leaves a few hundredths of a per cent of the energy.
_LARGE = 5_000


def start_from_cascade(state: Relaxation) -> Levels | None:
    """Start pieces that are large lattices from a relaxed small one, and the others where their own levels lead.

    No level in between is made or evaluated. Convergence is checked at the end.

    Returns:
        The levels of what was relaxed. None if no piece is such a lattice, or if any piece's energy would not be lower;
        then all stay where they were.
    """
    pieces, layout = state.network.pieces, state.positions()
    starts = [
        make_cascade_start(net, layout[own], _LARGE) if net.vertex_count > _LARGE else None
        for net, own in zip(pieces, state.vertex_ranges, strict=True)
    ]
    if not any(starts):
        return None
    status_before = state.status
    networks = [net if start is None else start.network for net, start in zip(pieces, starts, strict=True)]
    layouts = [
        layout[own] if start is None else start.layout for own, start in zip(state.vertex_ranges, starts, strict=True)
    ]
    coarse = Relaxation(join_networks(networks), state.options, start=np.concatenate(layouts))
    levels = Levels(coarse, repair=True)
    relax_cascade_start(levels)
    state.work_units += coarse.work_units * coarse.network.vertex_count / state.network.vertex_count
    for start in starts:
        if start is not None and start.coarse_level is not None:
            levels.cascade_levels[start.coarse_level.coarsening.surface] = start.coarse_level
    interpolated = _interpolate(coarse, starts)
    align_grain(state.alignments, interpolated)
    state.position.assign(interpolated)
    state.work_units += ENERGY_WORK
    if (state.check_start().potential < status_before.potential).all():
        return levels
    state.position.assign(layout)
    state.status = status_before
    return None


def _interpolate(coarse: Relaxation, starts: Sequence[CascadeStart | None]) -> FloatArray:
    """Return the layout of all pieces, #V by 2 [m], from the relaxed small lattices."""
    layouts, relaxed = list[FloatArray](), coarse.positions()
    for own, start in zip(coarse.vertex_ranges, starts, strict=True):
        fine = relaxed[own]
        for interpolate in () if start is None else start.interpolations:
            fine = interpolate(fine)
        layouts.append(fine)
    return layouts[0] if len(layouts) == 1 else np.concatenate(layouts)
