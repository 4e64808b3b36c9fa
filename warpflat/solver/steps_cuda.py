"""Runs of steps on a CUDA device: whole, without a look from the host in between, so that each becomes one graph."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpflat.core.launch import Launch, record_copy, record_zero
from warpflat.core.launch import Sequence as LaunchSequence
from warpflat.solver.piece_sums_cuda import DevicePieceSums
from warpflat.solver.smoother import STEADY, STILL, smoother_coefficients
from warpflat.solver.step_buffers import StepBuffers

__all__ = ["DeviceSteps"]

# Steps of one graph: multiples of all intervals between two looks at all cells. Of smoothing steps there are fewer.
_LONGEST = 32
_SMOOTHING = 8


class DeviceSteps:
    """The same steps as those of `warpflat.solver.relax.Relaxation`, run after run."""

    def __init__(self, buffers: StepBuffers, pieces: DevicePieceSums, *, damped: bool) -> None:
        """Of a state; damped: whether velocities of pieces that are braked become zero."""
        self._buffers, self._pieces, self._damped = buffers, pieces, damped
        paces = [STEADY, STILL, *map(smoother_coefficients, range(_SMOOTHING))]
        self._paces = wp.array(np.array(paces), dtype=wp.vec3d, device=buffers.network.device)
        self._known: dict[tuple[str, int, int, bool], LaunchSequence] = {}
        self._at_rest = LaunchSequence([record_zero(buffers.velocity), self._pace(1), *buffers.evaluate.launches])

    def evaluate_at_rest(self) -> None:
        """Velocities become zero; the forces."""
        self._at_rest.launch()

    def sweep(self, steps: int, watch_every: int, *, evaluated: bool) -> None:
        """The paper's steps."""
        while steps > 0:
            some = min(steps, _LONGEST)
            self._run("sweep", some, watch_every, evaluated)
            steps, evaluated = steps - some, False

    def smooth(self, steps: int, watch_every: int, *, evaluated: bool) -> None:
        """Steps from rest that take what is rough."""
        self._run("smooth", steps, watch_every, evaluated)

    def _run(self, kind: str, steps: int, watch_every: int, evaluated: bool) -> None:
        key = kind, steps, watch_every, evaluated
        known = self._known.get(key)
        if known is None:
            known = self._known[key] = LaunchSequence(self._launches(*key))
        known.launch()

    def _launches(self, kind: str, steps: int, watch_every: int, evaluated: bool) -> list[Launch]:
        buffers, smooth = self._buffers, kind == "smooth"
        damping = self._pieces.damping if self._damped and not smooth else []
        launches = list[Launch]()
        for number in range(steps):
            if smooth:
                launches.append(self._pace(2 + number))
            elif number < 2:
                # As in `Relaxation.sweep`.
                launches.append(self._pace(1 if evaluated and number == 0 else 0))
            if number % watch_every:
                launches += buffers.evaluate_on.launches
            elif number or not evaluated:
                launches += buffers.evaluate.launches
            launches += [*damping, buffers.advance]
        return launches

    def _pace(self, number: int) -> Launch:
        return record_copy(self._paces, self._buffers.pace, begin=number)
