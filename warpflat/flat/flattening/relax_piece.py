"""A piece is relaxed here: from a layout to the network that is measured in it, to the minimum of its energy.

The network of springs, and of cells under a pressure, depends on the layout in which its directions are measured. L-BFGS
measures them anew every few iterations, so that its estimate of what is left knows what follows from them. The paper's steps alone relax
such a piece in rounds, and its directions are updated between them.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.flat.flattening.progress import STEPS
from warpflat.flat.flattening.relaxation_task import RelaxationTask, RelaxedPiece
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.grain import grain_alignments
from warpflat.flat.solver.minimise import relax
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.solver.stop import Outcome

__all__ = ["relax_piece"]


# Tolerances of all rounds but the last are looser by this factor: their layout only serves to update directions.
_ROUND_TOLERANCE = 30.0
# Such a round also ends once some iterations take no more than this share of the energy away,
_ROUND_GAIN = 3e-3
# and once a layout that can be free of strain is strained by no more than this.
_ROUND_STRAIN = 1e-6
# Directions are final once a round has moved the piece by no more than this share of its size, on average.
_SETTLED_SHIFT = 2e-4


class _Stopped(Exception):
    """A callback has stopped the relaxation."""


def relax_piece(
    task: RelaxationTask,
    network: SpringNetwork,
    start: FloatArray,
    *,
    direction_updates: int,
    needs_isotropic_start: bool = False,
) -> RelaxedPiece:
    """Relax a piece.

    Args:
        task: what is relaxed, and how.
        network: measured in the start.
        start: #V by 2 [m].
        direction_updates: of the paper's steps alone, how many times directions are updated at most.
        needs_isotropic_start: whether it is first relaxed roughly as an isotropic sheet.
    """
    piece = _Piece(task, network, start)
    started, begin = time.perf_counter(), piece.state.check_start().energies
    try:
        outcome = piece.relax(direction_updates, needs_isotropic_start)
    except _Stopped:
        outcome = piece.outcome_of_stop(started)
    before = 0.0 if outcome.first_steps is None else outcome.first_steps.seconds
    outcome = replace(outcome, seconds=time.perf_counter() - started - before)
    state = piece.state
    return RelaxedPiece(network=state.network, positions=state.positions(), begin=begin, outcome=outcome)


class _Piece:
    """A piece on its way, whose network is measured anew."""

    def __init__(self, task: RelaxationTask, network: SpringNetwork, start: FloatArray) -> None:
        self._task = task
        self._put(network, start)

    def _put(self, network: SpringNetwork, start: FloatArray) -> Relaxation:
        alignments = grain_alignments(self._task.surface, self._task.datum, start)
        self.state = Relaxation(network, self._task.options, start=start, alignments=alignments)
        return self.state

    def relax(self, direction_updates: int, isotropic_start: bool) -> Outcome:
        task = self._task
        self._report("develop" if task.stage_name == "relax" else task.stage_name)
        if isotropic_start:
            start = self.state.positions()
            self._put(task.build_isotropic_network(start), start)
            self._update_directions()
        if task.options.solver == "paper":
            for _ in range(direction_updates):
                if self._update_directions() <= _SETTLED_SHIFT:
                    break
            return self._relax()
        follows = task.follows_layout(self.state.network)
        return self._relax(measure=self._measure if follows else None)

    def _relax(self, **how: object) -> Outcome:
        task = self._task

        def watch(state: Relaxation) -> None:
            energies, residual = state.status.energies, state.status.residual
            task.history.append((float(state.steps), energies.potential, energies.guard, residual))

        def each_step(state: Relaxation) -> None:
            self._report(STEPS if state.takes_first_steps else task.stage_name)

        listener = None if task.callback is None else each_step
        return relax(self.state, watch=watch, each_step=listener, **how)  # type: ignore[arg-type]

    def outcome_of_stop(self, started: float) -> Outcome:
        """Return the outcome of a relaxation that was stopped: what its last layout is, which is kept."""
        task, state = self._task, self.state
        if state.network.fabric is not task.fabric:
            # It was stopped as an isotropic sheet.
            layout, before = state.positions(), state
            state = self._put(task.build_network(layout), layout)
            state.steps, state.work_units = before.steps, before.work_units
            state.check_start()
        state.evaluate_at_rest()
        state.check_convergence(1.0)
        task.stopped = True
        task.notes.append("the callback stopped the relaxation before it was at rest")
        return replace(state.make_outcome(0, 0.0, began_at=started), converged=False)

    def _update_directions(self) -> float:
        """Relax the piece roughly and measure directions there; return how far it has moved on average, as a share of its size."""
        state, options = self.state, self._task.options
        state.options = replace(
            options,
            energy_tolerance=_ROUND_TOLERANCE * options.energy_tolerance,
            residual_tolerance=_ROUND_TOLERANCE * options.residual_tolerance,
        )
        state.least_strain = _ROUND_STRAIN
        before = state.positions()
        self._relax(least_gain=_ROUND_GAIN, first_steps=False)
        layout = state.positions()
        after = self._measure(layout, layout)
        after.steps, after.restarts, after.work_units = state.steps, state.restarts, state.work_units
        return float(np.sqrt(np.var(layout - before, axis=0).sum()) / np.linalg.norm(np.ptp(layout, axis=0)))

    def _measure(self, layout: FloatArray, directions: FloatArray) -> Relaxation:
        """Return the state that goes on from a layout (#V by 2 [m]), with directions measured in another one."""
        return self._put(self._task.build_network(directions), layout)

    def _report(self, stage: str) -> None:
        self._task.report_progress(stage, self.state)
        if self._task.stopped:
            raise _Stopped
