"""Multilevel relaxation: the approximate implicit steps smooth, coarser meshes of the same piece carry what is far.

A step tells each vertex of its neighbours only, so that the number of steps grows with the number of vertices. Here each level is a
spring network of its own, with the same fabric, guard and steps, on a quarter of the vertices of the next finer one
(`warpflat.solver.multigrid.coarsen`). A cycle (full approximation scheme, Brandt 1977; Brandt and Livne 2011):

1. a few steps from rest on the fine level (`warpflat.solver.smoother`), in a soft cloth on a lattice the last along its rows and columns
   (`kernels.thread_lines`);
2. the coarse level starts where its vertices are, under the load that gives it the fine level's residual forces there;
3. the same on the coarse level, down to the coarsest, which is relaxed by steps;
4. the way the coarse vertices have gone is carried up;
5. a few steps from rest again, after which the energy must not be higher than before 4: straight between the coarse vertices, the way
   strains what lies between them, and only these steps let go of that. If it is higher, a half of both is taken, a quarter ...;
6. on the finest level, the piece goes on to where what it remembers of its cycles says that the energy is least.

Nested iteration gives the start: the coarsest level is relaxed first, and each finer one is moved as far as the coarser
went. The minimum is that of the fine level alone, and what says that it is reached is what `relax` asks for, with a step's
work as the unit.

Where cycles take too little away, between triangles, others go on: whole implicit steps in cloth soft in shear
(`warpflat.solver.gauss_newton`), plain ones with a membrane.

Of several pieces side by side (`warpflat.model.join`) each has levels of its own, which are joined level by level; a piece that has no
coarser one stays as it is on those below. How much of a correction is taken, and whether the piece is at rest, is told piece by piece.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from warpflat.core.arrays import BoolArray
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import Outcome
from warpflat.solver.gauss_newton import gauss_newton_pays, relax_gauss_newton
from warpflat.solver.multigrid.acceleration import SubspaceAcceleration
from warpflat.solver.multigrid.cascade import cascade_up
from warpflat.solver.multigrid.cycle import ENERGY_WORK, FORCE_WORK, Levels
from warpflat.solver.relax import Relaxation, RelaxOptions, Watch, relax

__all__ = ["multigrid_pays", "relax_multilevel"]


# K/G from which levels are of little use on triangles of which there are no more vertices than this.
_SOFT = 35.0
_FEW = 1_200
# Work units of cycles between triangles after which others go on: whole steps in a soft cloth, from the latter K/G on at once, plain steps
# with a membrane that is not the same in all directions. On clean meshes cycles are at rest by then; slivers would take them ten thousands.
_PATIENCE = 600.0
_VERY_SOFT = 200.0
_PATIENCE_WITH_MEMBRANE = 300.0
# How often levels are made anew, since the piece has come far from where they were made.
_RENEWALS = 8


@dataclass(kw_only=True)
class _Pace:
    """How a piece nears its minimum.

    Attributes:
        near: whether cycles take too little away to go on.
        memory: of cycles.
    """

    near: bool = False
    memory: SubspaceAcceleration = field(default_factory=SubspaceAcceleration)


@dataclass(kw_only=True)
class _Cycles:
    """Pieces that are cycled together, and the pace of each."""

    state: Relaxation
    levels: Levels
    paces: Sequence[_Pace]
    renewals: int = 0

    @property
    def done(self) -> BoolArray:
        """#P, whether a piece has come to rest, or near enough."""
        return self.state.last.at_rest | [pace.near for pace in self.paces]

    def without_done(self) -> _Cycles | None:
        """The pieces that are not done, to be cycled on their own; None where that would not pay."""
        done = self.done
        return self._of(np.flatnonzero(~done).tolist()) if self.state.may_leave(done) else None

    def _of(self, pieces: Sequence[int]) -> _Cycles:
        state = self.state.keep(pieces)
        state.evaluate_at_rest()
        paces = [self.paces[piece] for piece in pieces]
        return _Cycles(state=state, levels=self.levels.keep(state, pieces), paces=paces, renewals=self.renewals)

    def go(self, enough: float | None, each_step: Callable[[], None] | None) -> None:
        """One cycle, and a look."""
        state, paces = self.state, self.paces
        if self.levels.stale and self.renewals < _RENEWALS:
            self.levels, self.renewals = Levels(state), self.renewals + 1
        work = state.work_units
        self.levels.remember([pace.memory for pace in paces])
        self.levels.leap(self.levels.cycle(0, each_step))
        state.hold_grain()
        self.levels.follow()
        state.evaluate_at_rest()
        state.work_units += FORCE_WORK + ENERGY_WORK
        look = state.look(state.work_units - work)
        for piece, pace in enumerate(paces):
            pace.near = enough is not None and look.gain[piece] <= enough * look.potential[piece]


def multigrid_pays(network: SpringNetwork) -> bool:
    """Whether cycles take less work than plain or whole steps: always but for a soft cloth on a small mesh of triangles."""
    if network.surface.is_quad.all():
        return True
    return network.vertex_count > _FEW or network.fabric.softness < _SOFT


def _patience(network: SpringNetwork) -> float:
    """Work units of cycles after which other steps go on."""
    if network.surface.is_quad.any():
        return math.inf
    if network.model == "membrane":
        return math.inf if network.fabric.is_isotropic else _PATIENCE_WITH_MEMBRANE
    if not gauss_newton_pays(network):
        return math.inf
    return 0.0 if network.fabric.softness >= _VERY_SOFT else _PATIENCE


def relax_multilevel(
    state: Relaxation,
    *,
    levels: Levels | None = None,
    nested: bool = True,
    enough: float | None = None,
    watch: Watch | None = None,
    each_step: Watch | None = None,
) -> Outcome:
    """Cycles until the energy and the residual force have come to rest, or the step limit is reached.

    Args:
        state: where to start; holds the relaxed layout afterwards.
        levels: of this state, if they are there already.
        nested: start from the coarsest level; without, cycles begin at the present layout, as after an edit.
        enough: it is over, at rest or not, after a cycle that takes no more than this share of the energy away; if given.
        watch: called after every cycle with the state, its energies and the residual; of several pieces, with the state of those that
            are still cycled together (its `numbers` say which).
        each_step: called after every step on the finest level and every cycle, with the energies and the residual of the last look.
    """
    options: RelaxOptions = state.options
    begun = time.perf_counter()
    whole, first, start = state, state.steps, state.work_units
    if not state.looked:
        state.hold_grain()
        state.begin()
    below = cascade_up(state) if nested and levels is None else None
    if below is None:
        state.hold_grain()
    elif each_step is not None:
        each_step(state, state.last.total, float(state.last.residual.max()))
    levels, carried = Levels(state, mend=nested, below=below) if levels is None else levels, below is not None
    # What is not among the levels themselves is not needed any more.
    del below
    if len(levels.sizes) == 1:
        return relax(state, watch=watch, each_step=each_step)
    cycles = _Cycles(state=state, levels=levels, paces=[_Pace() for _ in state.vertices])

    def tell(call: Watch | None) -> None:
        if call is not None:
            look = cycles.state.last
            call(cycles.state, look.total, float(look.residual.max()))

    if nested and not carried:
        levels.rise()
        state.hold_grain()
        state.begin()
        tell(each_step)
    levels.follow()
    state.evaluate_at_rest()
    state.work_units += FORCE_WORK
    patience = _patience(state.network)
    while not cycles.done.all() and cycles.state.work_units - start < options.max_steps:
        spent = cycles.state.work_units - start
        if spent >= patience:
            if state.network.model == "membrane":
                relax(cycles.state, watch=watch, each_step=each_step)
            else:
                most = options.max_steps - spent
                relax_gauss_newton(cycles.state, most=most, enough=enough, watch=watch, each_step=each_step)
            break
        left = cycles.without_done()
        if left is not None:
            cycles.state.give(whole)
            cycles = left
        cycles.go(enough, None if each_step is None else lambda: tell(each_step))
        tell(watch)
        tell(each_step)
    cycles.state.give(whole)
    return whole.outcome(first, start, begun=begun)
