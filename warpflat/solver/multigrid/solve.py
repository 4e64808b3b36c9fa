"""Multigrid relaxation: approximate implicit steps smooth, and coarser meshes correct the long-range errors.

A step moves each vertex by its neighbours only, so that the number of steps grows with the number of vertices. Here
each level is a spring network of its own, with the same fabric, guard and steps, on a quarter of the vertices of the
next finer one (`warpflat.solver.multigrid.coarsen`). A cycle (full approximation scheme, Brandt 1977; Brandt and Livne
2011) has six parts:

1. A few smoothing steps from rest on the fine level (`warpflat.solver.smoother`); in a soft cloth on a lattice the
   last one relaxes whole rows and columns (`kernels.line_solve`).
2. Restriction: the coarse level starts from the positions of its vertices on the fine one, under the load that makes
   its forces the restricted residual forces.
3. A cycle on the coarse level, down to the coarsest, which is relaxed by steps.
4. Correction: the displacement of the coarse vertices is interpolated and added on the fine level.
5. Smoothing steps again. They reduce the strain that linear interpolation causes between the coarse vertices. If the
   energy is then higher than before 4, only a half of both is taken, or a quarter ...
6. On the finest level, minimisation of the energy over the subspace of the last cycles' corrections.

Nested iteration gives the start: the coarsest level is relaxed first, and each finer one starts from the coarser one's
layout. The minimum is that of the fine level alone. The tolerances are those of `relax`, with a step's work as the
unit. On triangles a piece is also at rest when by estimate little is left (`warpflat.solver.remainder`).

Where cycles make too little progress on triangle meshes, another method finishes: Gauss-Newton steps in soft cloth
(`warpflat.solver.gauss_newton`), plain steps with a membrane.
Otherwise cycles end, with a note, after as much work as a user may wait for.

Pieces side by side (`warpflat.model.join`) have levels of their own, which are joined level by level; a piece without a
coarser mesh stays as it is on the levels below. Step fractions and convergence are decided piece by piece.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from warpflat.core.arrays import BoolArray
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import Outcome
from warpflat.solver.gauss_newton import gauss_newton_pays, relax_gauss_newton
from warpflat.solver.multigrid.acceleration import SubspaceAcceleration
from warpflat.solver.multigrid.cycle import accelerated_cycle
from warpflat.solver.multigrid.levels import ENERGY_WORK, FORCE_WORK, Levels
from warpflat.solver.multigrid.nested_iteration import nested_iteration
from warpflat.solver.relax import Watch, relax
from warpflat.solver.relaxation import Relaxation
from warpflat.solver.remainder import CycleRemainder, Remainder
from warpflat.surface.injective import border_edges_of

__all__ = ["multigrid_pays", "relax_multilevel"]


# K/G from which levels are of little use on triangles, for meshes of at most this many vertices.
_SOFT = 35.0
_FEW_VERTICES = 1_200
# Work units of cycles on triangle meshes after which another method goes on: Gauss-Newton steps in a soft cloth, at
# once from the latter K/G on; plain steps with a membrane that is not isotropic. On clean meshes cycles are at rest by
# then; slivers would take them tens of thousands.
_PATIENCE = 600.0
_VERY_SOFT = 200.0
_PATIENCE_WITH_MEMBRANE = 300.0
# Work units times vertices after which cycles end where no other method goes on; an irregular bodice of 400,000 takes 3e7.
_MOST_WORK = 5e8
_TOO_FINE = "a coarser mesh, or a cut, may help"
_NO_LEVEL = "every coarser mesh has mirrored faces at the first layout, or none is worth having"
_SLOW_CYCLES = "coarser meshes bring a membrane that is not isotropic to rest too slowly"
# Limit on how often levels are made anew, after the piece has moved far from the layout at which they were made.
_RENEWALS = 8


@dataclass(kw_only=True)
class _PieceProgress:
    """The progress of one piece: whether its cycles gain too little to go on, its acceleration, and what is left to relax."""

    estimate: CycleRemainder
    left: Remainder = field(default_factory=Remainder)
    gains_little: bool = False
    acceleration: SubspaceAcceleration = field(default_factory=SubspaceAcceleration)


@dataclass(kw_only=True)
class _CycledPieces:
    """Pieces that are cycled together, and the progress of each."""

    state: Relaxation
    levels: Levels
    progress: Sequence[_PieceProgress]
    renewals: int = 0

    @property
    def finished(self) -> BoolArray:
        """#P, true for pieces at rest and for those whose cycles gain too little."""
        return self.state.status.at_rest | [piece.gains_little for piece in self.progress]

    def without_finished(self) -> _CycledPieces | None:
        """Return the unfinished pieces, to be cycled on their own; None where that would not pay."""
        finished = self.finished
        if not self.state.is_worth_shrinking(finished):
            return None
        pieces = np.flatnonzero(~finished).tolist()
        state = self.state.extract(pieces)
        state.evaluate_at_rest()
        progress = [self.progress[piece] for piece in pieces]
        levels = self.levels.extract(state, pieces)
        return _CycledPieces(state=state, levels=levels, progress=progress, renewals=self.renewals)

    def cycle(self, least_gain: float | None, each_step: Watch | None) -> None:
        """Run one accelerated cycle, and check convergence."""
        state = self.state
        after_step = None if each_step is None else lambda: self.notify(each_step)
        if self.levels.is_outdated and self.renewals < _RENEWALS:
            self.levels, self.renewals = Levels(state), self.renewals + 1
        work, before = state.work_units, state.positions()
        for piece, own in zip(self.progress, state.vertex_ranges, strict=True):
            piece.estimate.begin(before[own])
        del before
        accelerated_cycle(self.levels, [piece.acceleration for piece in self.progress], after_step)
        state.hold_grain()
        self.levels.update_matrices()
        state.evaluate_at_rest()
        state.work_units += FORCE_WORK + ENERGY_WORK
        status = state.check_convergence(state.work_units - work)
        if not self.levels.is_lattice:
            self._end_where_little_is_left()
        for number, piece in enumerate(self.progress):
            piece.gains_little = least_gain is not None and status.gain[number] <= least_gain * status.potential[number]

    def _end_where_little_is_left(self) -> None:
        """Count pieces as at rest whose next cycles would change next to nothing; a residual force alone ends far too late."""
        state, layout = self.state, self.state.positions()
        for number, (piece, own) in enumerate(zip(self.progress, state.vertex_ranges, strict=True)):
            gain, energy = float(state.status.gain[number]), float(state.status.potential[number])
            piece.left = piece.estimate.add(gain, energy, layout[own])
            state.status.at_rest[number] |= piece.left.is_small(state.options)

    def notify(self, call: Watch | None) -> None:
        """Pass the state and its last check to a callback, if there is one."""
        if call is not None:
            call(self.state, self.state.status.total, self.state.status.worst_residual)


def multigrid_pays(network: SpringNetwork) -> bool:
    """Return whether cycles take less work than steps: always, but for soft cloth on a small mesh of triangles."""
    if network.surface.is_quad.all():
        return True
    return network.vertex_count > _FEW_VERTICES or network.fabric.softness < _SOFT


def _patience(network: SpringNetwork) -> float:
    """Return the work units of cycles after which another method goes on, or they end."""
    if network.surface.is_quad.any() or network.seams is not None:
        return math.inf
    if network.model == "membrane" and not network.fabric.is_isotropic:
        return _PATIENCE_WITH_MEMBRANE
    if gauss_newton_pays(network):
        return 0.0 if network.fabric.softness >= _VERY_SOFT else _PATIENCE
    return max(_PATIENCE, _MOST_WORK / network.vertex_count)


def relax_multilevel(
    state: Relaxation,
    *,
    levels: Levels | None = None,
    nested: bool = True,
    least_gain: float | None = None,
    watch: Watch | None = None,
    each_step: Watch | None = None,
) -> Outcome:
    """Cycle until the energy and the residual force have come to rest, or the step limit is reached.

    Args:
        state: where to start; holds the relaxed layout afterwards.
        levels: of this state, if they exist already.
        nested: start by nested iteration; otherwise cycles begin at the present layout, as after an edit.
        least_gain: stop, at rest or not, after a cycle that releases no more than this share of the energy; if given.
        watch: called after every cycle with the state, its energies and the residual. With several pieces the state is
            that of the pieces still cycled; its `piece_numbers` tell which.
        each_step: called after every step on the finest level and every cycle, with the energies and the residual of
            the last check.
    """
    began_at, steps_before, work_before = time.perf_counter(), state.steps, state.work_units
    if not state.has_status:
        state.hold_grain()
        state.check_start()
    state.hold_grain()
    levels = Levels(state, repair=nested) if levels is None else levels
    if len(levels.sizes) == 1:
        outcome = relax(state, watch=watch, each_step=each_step)
        return replace(outcome, notes=(f"relaxed by plain steps alone: {_NO_LEVEL}",))
    pieces = _CycledPieces(state=state, levels=levels, progress=_progress_of(state.network.pieces))
    if nested:
        nested_iteration(levels)
        state.hold_grain()
        state.check_start()
        pieces.notify(each_step)
    levels.update_matrices()
    state.evaluate_at_rest()
    state.work_units += FORCE_WORK
    notes = _cycle_until_rest(pieces, work_before, least_gain=least_gain, watch=watch, each_step=each_step)
    outcome = state.make_outcome(steps_before, work_before, began_at=began_at)
    left = max((piece.left for piece in pieces.progress), key=lambda each: each.outline_mm)
    return replace(outcome, notes=notes, left=left if np.isfinite(left.outline_mm) else None)


def _progress_of(networks: Sequence[SpringNetwork]) -> list[_PieceProgress]:
    return [_PieceProgress(estimate=CycleRemainder(border_edges_of(network.surface).tail)) for network in networks]


def _cycle_until_rest(
    pieces: _CycledPieces,
    work_before: float,
    *,
    least_gain: float | None,
    watch: Watch | None,
    each_step: Watch | None,
) -> tuple[str, ...]:
    """Cycle pieces until all are finished, or another method has gone on; the result is copied into their state.

    Returns:
        A note if plain steps have gone on, or cycles have ended too early.
    """
    notes: tuple[str, ...] = ()
    whole, options, patience = pieces.state, pieces.state.options, _patience(pieces.state.network)
    while not pieces.finished.all() and pieces.state.work_units - work_before < options.max_steps:
        spent = pieces.state.work_units - work_before
        if spent >= patience:
            notes = _finish(pieces, spent, least_gain=least_gain, watch=watch, each_step=each_step)
            break
        unfinished = pieces.without_finished()
        if unfinished is not None:
            pieces.state.copy_into(whole)
            pieces = unfinished
        pieces.cycle(least_gain, each_step)
        pieces.notify(watch)
        pieces.notify(each_step)
    pieces.state.copy_into(whole)
    return notes


def _finish(
    pieces: _CycledPieces, spent: float, *, least_gain: float | None, watch: Watch | None, each_step: Watch | None
) -> tuple[str, ...]:
    """Go on by another method with pieces whose cycles have spent so many work units; return a note, as `_cycle_until_rest`."""
    state = pieces.state
    for piece in pieces.progress:
        piece.left = Remainder()
    if state.network.model == "membrane" and not state.network.fabric.is_isotropic:
        relax(state, watch=watch, each_step=each_step)
        return (f"plain steps went on after {spent:.0f} work units: {_SLOW_CYCLES}",)
    if gauss_newton_pays(state.network):
        max_work = state.options.max_steps - spent
        relax_gauss_newton(state, max_work=max_work, least_gain=least_gain, watch=watch, each_step=each_step)
        return ()
    return (f"not at rest after {spent:.0f} work units of cycles: {_TOO_FINE}",)
