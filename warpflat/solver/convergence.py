"""The report of a relaxation: energies, convergence from check to check, and outcome."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.solver.remainder import Remainder

__all__ = ["ConvergenceStatus", "Energies", "Iterate", "Outcome", "Vectors"]

Vectors = Any
"""#V by 2 vectors: a NumPy array, or a Warp array of #V vec2d on a device."""

Iterate = tuple[Vectors, Vectors]
"""A layout [m] and the forces on its vertices [N]."""


@dataclass(frozen=True)
class Energies:
    """The energies of a state [J].

    Attributes:
        spring: of the springs, or of the membrane where that is the model.
        guard: of the guard (see `warpflat.model.network`).
        kinetic: of the motion.
    """

    spring: float
    guard: float
    kinetic: float

    @property
    def potential(self) -> float:
        """The energy that is minimised: springs and guard."""
        return self.spring + self.guard

    @property
    def total(self) -> float:
        """Potential and kinetic energy."""
        return self.spring + self.guard + self.kinetic


@dataclass(frozen=True, kw_only=True)
class ConvergenceStatus:
    """The result of a convergence check, piece by piece.

    Attributes:
        energies: #P by 3, energies of the springs or the membrane, of the guard, of the motion [J].
        residual: #P, largest force on a vertex over the mean force of the springs; infinite before the first
            evaluation.
        gain: #P, the potential energy lost since the last check [J].
        change: #P, eq. (11): the gain over the energy and over the steps in between.
        at_rest: #P, whether change and residual are within the tolerances, or the piece is free of strain.
        steps, work_units: #P, steps taken and work spent so far.
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
        """The energy of each piece that is minimised, #P [J]."""
        return self.energies[:, 0] + self.energies[:, 1]

    @property
    def total(self) -> Energies:
        """The energies of all pieces together."""
        return Energies(*self.energies.sum(axis=0).tolist())

    @property
    def worst_residual(self) -> float:
        """The largest residual of any piece."""
        return float(self.residual.max())

    def select(self, pieces: Sequence[int]) -> ConvergenceStatus:
        """Return the status of these pieces alone."""
        return ConvergenceStatus(**{name: values[list(pieces)] for name, values in vars(self).items()})


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome of a relaxation; for several pieces, the sum of their energies and the worst of their residuals.

    Attributes:
        converged: false if it ran into its step limit.
        steps: approximate implicit steps taken on the piece's own mesh.
        work_units: all work, in such steps.
        restarts: how often the velocities were set to zero.
        energy_change: last relative change of the energy per step, eq. (11).
        residual: largest force on a vertex over the mean spring force.
        energies: at the end [J].
        seconds: wall clock.
        notes: why plain steps went on where cycles were meant to, one sentence each.
        left: the estimate of what was still to be relaxed, where there is one.
    """

    converged: bool
    steps: int
    work_units: float
    restarts: int
    energy_change: float
    residual: float
    energies: Energies
    seconds: float
    notes: tuple[str, ...] = ()
    left: Remainder | None = None
