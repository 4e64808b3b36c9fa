"""Pieces are relaxed here, several side by side: from a layout to the network that is measured in it, to the minimum of its energy.

On triangles and under a stretch the network depends on the layout in which its directions are measured. L-BFGS measures them anew every
few iterations, so that its estimate of what is left knows what follows from them. Any other scheme relaxes such a piece in rounds, and
its directions are updated between them.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.sums import range_offsets
from warpflat.flattening.relaxation_task import RelaxationTask, RelaxedPiece
from warpflat.model.join import join_networks
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import Energies, Outcome
from warpflat.solver.gauss_newton import gauss_newton_pays, relax_gauss_newton
from warpflat.solver.grain_alignment import grain_alignments
from warpflat.solver.multigrid.coarsen import can_coarsen, coarsenings_of, is_coarsest
from warpflat.solver.multigrid.solve import multigrid_pays, relax_multilevel
from warpflat.solver.quasi_newton import Measure, quasi_newton_pays, relax_quasi_newton
from warpflat.solver.relax import relax
from warpflat.solver.relaxation import Relaxation

Scheme = Literal["quasi-newton", "multigrid", "gauss-newton", "steps"]

__all__ = ["relax_pieces"]


# Tolerances of all rounds but the last are looser by this factor: their layout only serves to update directions.
_ROUND_TOLERANCE = 30.0
# Such a round also ends once a multigrid cycle takes no more than this share of the energy away,
_ROUND_GAIN = 3e-3
# and once a layout that can be free of strain is strained by no more than this.
_ROUND_STRAIN = 1e-6
# Directions are final once a round has moved the piece by no more than this share of its size, on average.
_SETTLED_SHIFT = 2e-4
# Quads across the grain get a note where they are this many times as stiff in shear as the cloth.
_NOTED_EXCESS = 3.0


def _grain_notes(network: SpringNetwork) -> list[str]:
    """Return a note on quads whose edges run across the threads, if they are much too stiff in shear."""
    excess = network.spring_arrays.shear_excess
    if network.model != "springs" or excess < _NOTED_EXCESS:
        return []
    return [
        f"the grain runs aslant over the mesh's quads, whose springs are then {excess:.0f} times as stiff in shear as "
        f'{network.fabric.name}; model = "membrane" measures that exactly'
    ]


def relax_pieces(
    tasks: Sequence[RelaxationTask],
    networks: Sequence[SpringNetwork],
    starts: Sequence[FloatArray],
    *,
    direction_updates: Sequence[int],
    needs_isotropic_start: Sequence[bool] | None = None,
) -> list[RelaxedPiece]:
    """Relax several pieces; those that are relaxed in the same way lie side by side in one relaxation.

    Args:
        tasks: of one fabric, grain, model, device, stage and set of options.
        networks: the network of each piece, measured in its start.
        starts: the layout of each piece, #V by 2 [m].
        direction_updates: for each piece, how many times its directions are updated at most.
        needs_isotropic_start: for each piece, whether it is first relaxed roughly as an isotropic sheet; none is if not given.
    """
    isotropic = needs_isotropic_start or [False] * len(tasks)
    kinds: dict[tuple[Scheme, int, bool, int], list[int]] = {}
    for number, (task, network) in enumerate(zip(tasks, networks, strict=True)):
        scheme = _scheme(task, network)
        alone = number if scheme == "quasi-newton" else 0
        kinds.setdefault((scheme, direction_updates[number], isotropic[number], alone), []).append(number)
    relaxed: dict[int, RelaxedPiece] = {}
    for (scheme, updates, isotropic_start, _), numbers in kinds.items():
        batch = _Batch(
            [tasks[number] for number in numbers],
            [networks[number] for number in numbers],
            [starts[number] for number in numbers],
        )
        results = batch.relax(scheme=scheme, direction_updates=updates, isotropic_start=isotropic_start)
        if scheme == "steps":
            for number in numbers:
                tasks[number].notes += _plain_step_notes(tasks[number], networks[number])
        relaxed |= zip(numbers, results, strict=True)
    for number, task in enumerate(tasks):
        # The springs of earlier rounds are gone: only those that the pattern has count.
        task.notes += _grain_notes(relaxed[number].network)
    return [relaxed[number] for number in range(len(tasks))]


def _plain_step_notes(task: RelaxationTask, network: SpringNetwork) -> list[str]:
    """Return a note on a piece that is relaxed by plain steps though it is large enough for coarser levels."""
    if task.options.solver == "plain" or is_coarsest(network.surface):
        return []
    cause = (
        "no coarser mesh is worth having" if multigrid_pays(network) else "the cloth is soft and the triangles are few"
    )
    return [f"relaxed by plain steps alone: {cause}"]


def _scheme(task: RelaxationTask, network: SpringNetwork) -> Scheme:
    """Return how a piece is relaxed."""
    if task.options.solver == "plain":
        return "steps"
    if quasi_newton_pays(network):
        return "quasi-newton"
    if multigrid_pays(network) and can_coarsen(network.surface):
        return "multigrid"
    return "gauss-newton" if gauss_newton_pays(network) else "steps"


class _Stopped(Exception):
    """A callback has stopped the relaxation of pieces."""

    def __init__(self, state: Relaxation) -> None:
        super().__init__()
        self.state = state


class _Batch:
    """The relaxation in which the pieces of several tasks lie side by side."""

    def __init__(
        self, tasks: Sequence[RelaxationTask], networks: Sequence[SpringNetwork], starts: Sequence[FloatArray]
    ) -> None:
        self._tasks = tasks
        self._options = tasks[0].options
        self._first = range_offsets([net.vertex_count for net in networks]).tolist()
        self._put(networks, np.concatenate(starts))

    def _put(self, networks: Sequence[SpringNetwork], start: FloatArray) -> None:
        alignments = [
            alignment
            for task, (first, end) in zip(self._tasks, pairwise(self._first), strict=True)
            for alignment in grain_alignments(task.surface, task.datum, start[first:end], first=first)
        ]
        self._state = Relaxation(join_networks(networks), self._options, start=start, alignments=alignments)

    def relax(self, *, scheme: Scheme, direction_updates: int, isotropic_start: bool) -> list[RelaxedPiece]:
        """Relax the pieces in rounds, between which their directions are updated.

        Args:
            scheme: how they are relaxed.
            direction_updates: how many times directions are updated at most.
            isotropic_start: whether the pieces are relaxed roughly as isotropic sheets first.
        """
        started = time.perf_counter()
        begin = self._state.check_start().energies
        steps, work = self._state.steps, self._state.work_units
        try:
            outcome = self._relax(scheme, direction_updates, isotropic_start)
        except _Stopped as stopped:
            outcome = self._outcome_of_stop(stopped.state, steps, work, started)
        outcome, state = replace(outcome, seconds=time.perf_counter() - started), self._state
        layout, check = state.positions(), state.status
        for task in self._tasks:
            task.notes += [note for note in outcome.notes if note not in task.notes]
        return [
            RelaxedPiece(
                network=net,
                positions=layout[own],
                begin=Energies(*begin[piece].tolist()),
                outcome=replace(
                    outcome,
                    converged=bool(check.at_rest[piece]),
                    steps=int(check.steps[piece]),
                    work_units=float(check.work_units[piece]),
                    energy_change=float(check.change[piece]),
                    residual=float(check.residual[piece]),
                    energies=Energies(*check.energies[piece].tolist()),
                ),
            )
            for piece, (net, own) in enumerate(zip(state.network.pieces, state.vertex_ranges, strict=True))
        ]

    def _relax(self, scheme: Scheme, direction_updates: int, isotropic_start: bool) -> Outcome:
        stage = self._tasks[0].stage_name
        self._report(self._state, "develop" if stage == "relax" else stage)
        if isotropic_start:
            own, start = self._state.vertex_ranges, self._state.positions()
            self._put(
                [task.build_isotropic_network(start[at]) for task, at in zip(self._tasks, own, strict=True)], start
            )
            self._update_directions(scheme)
        if scheme == "quasi-newton":
            follows = self._tasks[0].follows_layout(self._state.network)
            return self._round(scheme, measure=self._measure if follows else None)
        for _ in range(direction_updates):
            if self._update_directions(scheme) <= _SETTLED_SHIFT:
                break
        return self._round(scheme)

    def _outcome_of_stop(self, state: Relaxation, steps: int, work: float, started: float) -> Outcome:
        """Return the outcome of a relaxation that was stopped: what its last layout is, which is kept."""
        whole = self._state
        state.copy_into(whole)
        if whole.network.fabric is not self._tasks[0].fabric:
            # It was stopped as an isotropic sheet.
            layout, own = whole.positions(), whole.vertex_ranges
            self._put([task.build_network(layout[at]) for task, at in zip(self._tasks, own, strict=True)], layout)
            whole, before = self._state, whole
            whole.steps, whole.work_units = before.steps, before.work_units
            whole.check_start()
        whole.evaluate_at_rest()
        whole.check_convergence(1.0)
        for task in self._tasks:
            task.stopped = True
            task.notes.append("the callback stopped the relaxation before it was at rest")
        return whole.make_outcome(steps, work, began_at=started)

    def _update_directions(self, scheme: Scheme) -> float:
        """Relax the pieces roughly and measure directions there; return the largest mean shift of a piece as a share of its size."""
        state = self._state
        state.options = replace(
            self._options,
            energy_tolerance=_ROUND_TOLERANCE * self._options.energy_tolerance,
            residual_tolerance=_ROUND_TOLERANCE * self._options.residual_tolerance,
        )
        state.least_strain = _ROUND_STRAIN
        before = state.positions()
        self._round(scheme, least_gain=_ROUND_GAIN)
        layout = state.positions()
        after = self._measure(layout, layout)
        after.steps, after.restarts, after.work_units = state.steps, state.restarts, state.work_units
        return max(_moved(before[own], layout[own]) for own in state.vertex_ranges)

    def _measure(self, layout: FloatArray, directions: FloatArray) -> Relaxation:
        """Return the state that goes on from a layout (#V by 2 [m]), with directions measured in another one."""
        own = self._state.vertex_ranges
        self._put([task.build_network(directions[at]) for task, at in zip(self._tasks, own, strict=True)], layout)
        return self._state

    def _round(
        self,
        scheme: Scheme,
        *,
        least_gain: float | None = None,
        measure: Measure | None = None,
    ) -> Outcome:
        listens = any(task.callback is not None for task in self._tasks)
        each_step = self._each_step if listens else None
        if scheme == "quasi-newton":
            return relax_quasi_newton(
                self._state, measure=measure, least_gain=least_gain, watch=self._watch, each_step=each_step
            )
        if scheme == "gauss-newton":
            return relax_gauss_newton(self._state, least_gain=least_gain, watch=self._watch, each_step=each_step)
        if scheme == "steps":
            return relax(self._state, watch=self._watch, each_step=each_step)
        # After an edit the layout is near the minimum; only a grid comes nearer by nested iteration from its coarser levels.
        nested = self._state.steps == 0 and (
            self._tasks[0].stage_name == "relax"
            or all(coarsenings_of(task.surface)[0].smooth_interpolation is not None for task in self._tasks)
        )
        return relax_multilevel(
            self._state, nested=nested, least_gain=least_gain, watch=self._watch, each_step=each_step
        )

    def _watch(self, state: Relaxation, energies: Energies, residual: float) -> None:
        for piece, number in enumerate(state.piece_numbers):
            spring, guard, _ = state.status.energies[piece].tolist()
            task = self._tasks[number]
            task.history.append((float(state.steps), spring + guard, guard, float(state.status.residual[piece])))

    def _each_step(self, state: Relaxation, energies: Energies, residual: float) -> None:
        self._report(state, self._tasks[0].stage_name)

    def _report(self, state: Relaxation, stage: str) -> None:
        for piece, number in enumerate(state.piece_numbers):
            self._tasks[number].report_progress(stage, state, piece)
        if any(task.stopped for task in self._tasks):
            raise _Stopped(state)


def _moved(before: FloatArray, after: FloatArray) -> float:
    """Return how far a layout (#V by 2 [m]) has moved on average, apart from a shift of the whole, as a share of its size."""
    way = after - before
    return float(np.sqrt(np.var(way, axis=0).sum()) / np.linalg.norm(np.ptp(after, axis=0)))
