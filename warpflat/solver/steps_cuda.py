"""Runs of steps on a CUDA device, each captured as one graph without a check by the host in between."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpflat.core.launch import Launch, record_copy, record_zero
from warpflat.core.launch import Sequence as LaunchSequence
from warpflat.solver.piece_sums_cuda import DevicePieceSums
from warpflat.solver.smoother import IMPLICIT_STEP, IMPLICIT_STEP_AT_REST, chebyshev_coefficients
from warpflat.solver.step_buffers import StepBuffers

__all__ = ["DeviceSteps"]

# Steps of one graph: a multiple of all intervals between two checks of all cells.
_LONGEST_RUN = 32
# Smoothing steps of one run, at most.
_MOST_SMOOTHING = 8


class DeviceSteps:
    """The steps of `warpflat.solver.relaxation.Relaxation`, recorded as runs of launches."""

    def __init__(self, buffers: StepBuffers, pieces: DevicePieceSums, *, damped: bool) -> None:
        """Prepare runs over the buffers of a state.

        Args:
            buffers, pieces: of the state.
            damped: whether velocities of pieces become zero when their forces brake the motion.
        """
        self._buffers, self._pieces, self._damped = buffers, pieces, damped
        coefficients = [IMPLICIT_STEP, IMPLICIT_STEP_AT_REST, *map(chebyshev_coefficients, range(_MOST_SMOOTHING))]
        self._coefficients = wp.array(np.array(coefficients), dtype=wp.vec3d, device=buffers.network.device)
        self._recorded: dict[tuple[str, int, int, bool], LaunchSequence] = {}
        self._at_rest = LaunchSequence(
            [record_zero(buffers.velocity), self._set_coefficients(1), *buffers.evaluate.launches]
        )

    def evaluate_at_rest(self) -> None:
        """Set the velocities to zero and evaluate the forces."""
        self._at_rest.launch()

    def sweep(self, steps: int, check_interval: int, *, evaluated: bool) -> None:
        """Take the paper's steps; see `Relaxation.sweep`."""
        while steps > 0:
            count = min(steps, _LONGEST_RUN)
            self._run("sweep", count, check_interval, evaluated)
            steps, evaluated = steps - count, False

    def smooth(self, steps: int, check_interval: int, *, evaluated: bool) -> None:
        """Take smoothing steps from rest; see `Relaxation.smooth`."""
        self._run("smooth", steps, check_interval, evaluated)

    def _run(self, kind: str, steps: int, check_interval: int, evaluated: bool) -> None:
        key = kind, steps, check_interval, evaluated
        recorded = self._recorded.get(key)
        if recorded is None:
            recorded = self._recorded[key] = LaunchSequence(self._launches(*key))
        recorded.launch()

    def _launches(self, kind: str, steps: int, check_interval: int, evaluated: bool) -> list[Launch]:
        buffers, smooth = self._buffers, kind == "smooth"
        damping = self._pieces.damping if self._damped and not smooth else []
        launches = list[Launch]()
        for number in range(steps):
            if smooth:
                launches.append(self._set_coefficients(2 + number))
            elif number < 2:
                # As in `Relaxation.sweep`.
                launches.append(self._set_coefficients(1 if evaluated and number == 0 else 0))
            if number % check_interval:
                launches += buffers.evaluate_guarded.launches
            elif number or not evaluated:
                launches += buffers.evaluate.launches
            launches += [*damping, buffers.advance]
        return launches

    def _set_coefficients(self, number: int) -> Launch:
        return record_copy(self._coefficients, self._buffers.coefficients, begin=number)
