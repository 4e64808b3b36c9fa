"""What a relaxation says of itself: energies, a look in between, and how it ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import BoolArray, FloatArray

__all__ = ["ConvergenceStatus", "Energies", "Mark", "Outcome", "Vectors"]


@dataclass(frozen=True)
class Energies:
    """[J]: of the springs (of the membrane, where that is the model), of the guard (see `warpflat.model.network`), of the motion."""

    spring: float
    guard: float
    kinetic: float

    @property
    def potential(self) -> float:
        """What is minimised: springs and guard."""
        return self.spring + self.guard

    @property
    def total(self) -> float:
        """Potential and kinetic."""
        return self.spring + self.guard + self.kinetic


@dataclass(frozen=True, kw_only=True)
class ConvergenceStatus:
    """What a look at a running relaxation says of each of its pieces.

    Attributes:
        energies: #P by 3, of the springs or the membrane, of the guard, of the motion [J].
        residual: #P, largest force on a vertex over the mean force of the springs; infinite before it is known.
        gain: #P, what the springs' and the guard's energy has lost since the look before [J].
        change: #P, eq. (11), that over the energy and the steps in between.
        at_rest: #P, whether change and residual are within the tolerances, or the piece is free of strain.
        steps, work_units: #P, what it has taken so far.
    """

    energies: FloatArray
    residual: FloatArray
    gain: FloatArray
    change: FloatArray
    at_rest: BoolArray
    steps: NDArray[np.int64]
    work_units: FloatArray

    @property
    def potential(self) -> FloatArray:
        """#P, what is minimised [J]."""
        return self.energies[:, 0] + self.energies[:, 1]

    @property
    def total(self) -> Energies:
        """Of all pieces."""
        return Energies(*self.energies.sum(axis=0).tolist())

    def of(self, pieces: Sequence[int]) -> ConvergenceStatus:
        """What it says of some of them."""
        return ConvergenceStatus(**{name: values[list(pieces)] for name, values in vars(self).items()})


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """How a relaxation ended; of several pieces, the energies of all and the worst of what is left.

    Attributes:
        converged: false if it ran into its step limit.
        steps: approximate implicit steps taken on the piece's own mesh.
        work_units: all work, in such steps.
        restarts: how often the velocities were set to zero.
        energy_change: last relative change of the energy per step, eq. (11).
        residual: largest force on a vertex over the mean spring force.
        energies: at the end [J].
        seconds: wall clock.
    """

    converged: bool
    steps: int
    work_units: float
    restarts: int
    energy_change: float
    residual: float
    energies: Energies
    seconds: float


Vectors = Any
Mark = tuple[Vectors, Vectors]
