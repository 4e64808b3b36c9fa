"""Large lattices start where a small one of theirs has come to rest: it is carried up to them at once, by cubics."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.model.join import join_networks
from warpflat.solver.grain_alignment import align_grain
from warpflat.solver.multigrid.cycle import ENERGY_WORK, Levels
from warpflat.solver.multigrid.hierarchy import device_levels
from warpflat.solver.relax import Relaxation

__all__ = ["cascade_up"]


# Lattices of more vertices start where a small one has come to rest, of at most so many: cubics from this size on leave a few hundredths
# of a per cent.
_CYCLED = 5_000


def cascade_up(state: Relaxation) -> Levels | None:
    """Start pieces that are large lattices where a small one of theirs has come to rest; the others where their own levels lead.

    Nothing is made or evaluated of the levels in between. The state is looked at in the end.

    Returns:
        The levels of what was relaxed; None where no piece is such a lattice, or one would not be lower than it lies: then
        all are where they were.
    """
    pieces, layout = state.network.pieces, state.positions()
    below = [
        device_levels(net, layout[own], _CYCLED) if net.vertex_count > _CYCLED else None
        for net, own in zip(pieces, state.vertices, strict=True)
    ]
    if not any(below):
        return None
    before = state.last
    networks = [net if way is None else way.network for net, way in zip(pieces, below, strict=True)]
    start = [layout[own] if way is None else way.layout for own, way in zip(state.vertices, below, strict=True)]
    coarse = Relaxation(join_networks(networks), state.options, start=np.concatenate(start))
    levels = Levels(coarse, mend=True)
    levels.start()
    state.work_units += coarse.work_units * coarse.network.vertex_count / state.network.vertex_count
    carried, relaxed = list[FloatArray](), coarse.positions()
    for of, way in zip(coarse.vertices, below, strict=True):
        up = relaxed[of]
        if way is not None:
            if way.rung is not None:
                levels.leading[way.rung.step.surface] = way.rung
            for carry in way.carries:
                up = carry(up)
        carried.append(up)
    there = carried[0] if len(carried) == 1 else np.concatenate(carried)
    align_grain(state.upright, there)
    state.position.assign(there)
    state.work_units += ENERGY_WORK
    if (state.begin().potential < before.potential).all():
        return levels
    state.position.assign(layout)
    state.last = before
    return None
