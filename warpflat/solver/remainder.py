"""An estimate of what a relaxation has still to do: the energy that it would release, and how far the outline would move."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.solver.options import RelaxOptions

__all__ = ["CycleRemainder", "Remainder", "RemainderEstimate", "looked_back"]

# The last share of all iterations is looked back upon, and no fewer than so many: where convergence is slow, a few iterations move little
# though much is left. What follows releases at most so many times their energy, and moves the outline at most so many times as far. The
# factors were chosen on draped meshes and forms; `benchmarks/stopping.py` measures on others what they are worth.
_SHARE, _FEWEST = 0.15, 4
_ENERGY_FACTOR, _OUTLINE_FACTOR = 1.0, 2.75
# Multigrid cycles reduce what is left by about the same factor each: by no less than the first, and by no more than the second is assumed.
# The sum of all that follow the last one, times this, is the estimate. On the irregular bodice of 200,000 vertices the energy that was
# left after each cycle but the first was at most 0.45 of what that cycle had released; the estimate is three times or more.
_CYCLE_FACTOR_BOUNDS = (0.5, 0.98)
_CYCLE_SAFETY = 3.0
# No estimate is smaller: a share of the energy, and a distance [m].
_LEAST_SHARE, _LEAST_DISTANCE = 1e-4, 5e-5


@dataclass(frozen=True, kw_only=True)
class Remainder:
    """What is left to relax, as estimated.

    Attributes:
        energy_share: the energy still to be released, over the present one.
        outline_mm: the farthest way that a point of the border still goes [mm].
    """

    energy_share: float = np.inf
    outline_mm: float = np.inf

    def is_small(self, options: RelaxOptions) -> bool:
        """Return whether both are within the options; never where a tolerance is stricter than by default, which is then met."""
        default = RelaxOptions()
        strict = (
            options.energy_tolerance < default.energy_tolerance
            or options.residual_tolerance < default.residual_tolerance
        )
        small = self.energy_share <= options.energy_left and self.outline_mm <= options.outline_left_mm
        return small and not strict


def looked_back(iterations: int) -> int:
    """Return on how many of the last iterations a descent looks back after so many."""
    return max(_FEWEST, math.ceil(_SHARE * iterations))


class RemainderEstimate:
    """The last layouts of a descent, and the estimate that follows from them."""

    def __init__(self, border: IntArray) -> None:
        """Start without a layout.

        Args:
            border: the vertices of the outline.
        """
        self._border = border
        self._iterations = 0
        self._last: deque[tuple[float, FloatArray, float]] = deque()

    def add(self, energy: float, positions: FloatArray, fraction: float) -> Remainder:
        """Add the layout of the next iteration and return what is left after it.

        It is infinite after few iterations, and where together they have not gone as far as one whole step: what moves little since a
        face would be mirrored, or the border cross itself, is not at rest.

        Args:
            energy: of the layout [J].
            positions: #V by 2 [m], turned upright.
            fraction: of the step that has led there.
        """
        self._iterations += 1
        outline = positions[self._border]
        self._last.append((energy, outline, fraction))
        count = looked_back(self._iterations)
        if len(self._last) <= count:
            return Remainder()
        while len(self._last) > count + 1:
            self._last.popleft()
        if sum(fraction for *_, fraction in self._last) - self._last[0][2] < 1.0:
            return Remainder()
        moved = outline - self._last[0][1]
        moved -= moved.mean(axis=0)
        distance = float(np.linalg.norm(moved, axis=1).max(initial=0.0))
        energies = [each for each, *_ in self._last]
        # The range: where directions have been measured anew the energy may also have risen.
        share = (max(energies) - min(energies)) / max(energy, 1e-300)
        return Remainder(
            energy_share=max(_ENERGY_FACTOR * share, _LEAST_SHARE),
            outline_mm=1e3 * max(_OUTLINE_FACTOR * distance, _LEAST_DISTANCE),
        )


class CycleRemainder:
    """The gains and the ways of the last two multigrid cycles, and the estimate that follows from their ratio (Aitken)."""

    def __init__(self, border: IntArray) -> None:
        """Start without a cycle.

        Args:
            border: the vertices of the outline.
        """
        self._border = border
        self._gain = self._way = np.inf
        self._outline: FloatArray | None = None

    def begin(self, positions: FloatArray) -> None:
        """Keep the outline before a cycle; `positions` are #V by 2 [m], upright."""
        self._outline = positions[self._border]

    def add(self, gain: float, energy: float, positions: FloatArray) -> Remainder:
        """Return what is left after a cycle; infinite after the first.

        Args:
            gain: the energy that it has released [J]; negative where the energy has risen.
            energy: at its end [J].
            positions: at its end, #V by 2 [m], upright.
        """
        assert self._outline is not None
        moved = positions[self._border] - self._outline
        moved -= moved.mean(axis=0)
        way = float(np.linalg.norm(moved, axis=1).max(initial=0.0))
        left = Remainder(
            energy_share=max(_sum_of_rest(abs(gain), self._gain) / max(energy, 1e-300), _LEAST_SHARE),
            outline_mm=1e3 * max(_sum_of_rest(way, self._way), _LEAST_DISTANCE),
        )
        known = np.isfinite(self._gain)
        self._gain, self._way = abs(gain), way
        return left if known else Remainder()


def _sum_of_rest(last: float, before: float) -> float:
    """Return the sum of the steps that follow the last two, each smaller by their ratio, with a margin."""
    ratio = float(np.clip(last / max(before, 1e-300), *_CYCLE_FACTOR_BOUNDS))
    return _CYCLE_SAFETY * last * ratio / (1.0 - ratio)
