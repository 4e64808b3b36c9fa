"""Relaxation by approximate implicit steps alone (paper, section III), until a piece is at rest."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from warpflat.solver.convergence import Energies, Outcome
from warpflat.solver.relaxation import Relaxation

__all__ = ["Watch", "relax"]

# Steps between two updates of a membrane's tangent stiffness.
_MATRIX_INTERVAL = 100

Watch = Callable[[Relaxation, Energies, float], None]
"""A callback: takes the state, its energies and its residual."""


def relax(state: Relaxation, *, watch: Watch | None = None, each_step: Watch | None = None) -> Outcome:
    """Step until the energy and the residual force have come to rest, or the step limit is reached.

    Args:
        state: where to start; holds the relaxed layout afterwards.
        watch: called every `check_every` steps with the state, its energies and the residual. With several pieces the
            state is that of the pieces still stepped; its `piece_numbers` tell which.
        each_step: called after every step, with the energies and the residual of the last check.
    """
    options, whole = state.options, state
    began_at, steps_before, work_before = time.perf_counter(), state.steps, state.work_units
    status = state.check_start()

    def after_step() -> None:
        assert each_step is not None
        state.work_units += 1.0
        each_step(state, status.total, status.worst_residual)

    while not status.at_rest.all() and state.steps < options.max_steps:
        if state.is_worth_shrinking(status.at_rest):
            state.copy_into(whole)
            state = state.extract(np.flatnonzero(~status.at_rest).tolist())
            status = state.status
        count = min(options.check_every, options.max_steps - state.steps)
        if each_step is None:
            state.sweep(count)
            state.work_units += count
        else:
            state.sweep(count, after_step)
        state.hold_grain()
        status = state.check_convergence(count)
        if state.matrix is not None and state.steps % _MATRIX_INTERVAL < count:
            state.matrix.update(state.position)
        if watch is not None:
            watch(state, status.total, status.worst_residual)
    state.copy_into(whole)
    return whole.make_outcome(steps_before, work_before, began_at=began_at)
