"""The one rule by which a minimisation ends, and its report: energies, eq. (11), and what is left in energy and in the outline.

Eq. (11) of the paper compares the energies of two steps, |U(t+h) - U(t)| / U(t) <= epsilon. On its own it stops too early where progress is
slow. A residual force alone stops far too late. So a relaxation ends when by estimate at most a small share of the energy is still to be
released and no point of the outline still moves by much, or when eq. (11) and the residual force are both within their tolerances.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.flat.solver.options import RelaxOptions

__all__ = ["Energies", "Outcome", "Remainder", "RemainderEstimate", "Status", "looked_back", "relative_change"]

# The last share of all iterations is looked back upon, and no fewer than so many: where convergence is slow, a few iterations move little
# though much is left. What follows releases at most so many times their energy, and moves the outline at most so many times as far. The
# factors were chosen on draped meshes and forms; `benchmarks/stopping.py` measures on others what they are worth.
_SHARE, _FEWEST = 0.15, 4
_ENERGY_FACTOR, _OUTLINE_FACTOR = 1.0, 2.75
# No estimate is smaller: a share of the energy, and a distance [m].
_LEAST_SHARE, _LEAST_DISTANCE = 1e-4, 5e-5


def relative_change(before: float, after: float, steps: float = 1.0) -> float:
    """Return eq. (11), |U(t+h) - U(t)| / U(t), from two energies [J] and the steps between them."""
    if not math.isfinite(before):
        return math.inf
    return abs(before - after) / (max(steps, 1.0) * max(after, 1e-300))


@dataclass(frozen=True)
class Energies:
    """The energies of a layout [J].

    Attributes:
        spring: of the springs, or of the membrane where that is the model.
        guard: of the guard (see `warpflat.flat.model.network`).
    """

    spring: float
    guard: float

    @property
    def potential(self) -> float:
        """The energy that is minimised: springs and guard."""
        return self.spring + self.guard


@dataclass(frozen=True, kw_only=True)
class Status:
    """The result of a check.

    Attributes:
        energies: at the check.
        residual: largest force on a vertex over the mean force of the springs; infinite before the first evaluation.
        at_rest: whether it may end.
    """

    energies: Energies
    residual: float = math.inf
    at_rest: bool = False


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


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome of a relaxation.

    Attributes:
        converged: false if it ran into its step limit.
        steps: approximate implicit steps, or iterations of L-BFGS.
        work_units: all work, in approximate implicit steps over all vertices.
        residual: largest force on a vertex over the mean spring force; not a number after first steps.
        energies: at the end [J].
        seconds: wall clock.
        left: the estimate of what was still to be relaxed, where there is one.
        first_steps: of the paper's steps with which it began; None where it did not.
        first_layout: #V by 2, the layout after these [m].
    """

    converged: bool
    steps: int
    work_units: float
    residual: float
    energies: Energies
    seconds: float
    left: Remainder | None = None
    first_steps: Outcome | None = None
    first_layout: FloatArray | None = field(default=None, repr=False)
