"""The progress of a relaxation, and the stages of its history."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.strain import WornStrain, strain_energy, worn_strain
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.solver.stop import Energies, Outcome, Remainder
from warpflat.flat.surface.mesh import Surface

__all__ = ["CONTACT", "STEPS", "Progress", "Stage", "laid_stage", "make_stage", "make_stages"]

#: Name of the stage in which a piece that would lie over itself is kept from it.
CONTACT = "contact"
#: Name of the stage of the paper's steps with which a relaxation begins.
STEPS = "steps"


@dataclass(frozen=True, kw_only=True)
class Stage:
    """An entry of a piece's history: its energies at the end of a stage, and what the stage took.

    Attributes:
        name: "develop", "steps" (the paper's, with which a relaxation begins), "relax", "contact", "cut:NAME" and so on.
        model_energy_j: what is minimised: springs and guard, or membrane and guard [J].
        guard_energy_j: the part of it that keeps faces unfolded [J].
        strain_energy_j: strain energy of the cloth as worn, eq. (3) of the paper [J].
        steps: approximate implicit steps, or iterations of L-BFGS.
        work_units: all work, in approximate implicit steps over all vertices.
        seconds: wall time.
        converged: False if it ended at its step limit.
        residual: largest force on a vertex over the mean spring force; None if there was no relaxation to the end.
        left: the estimate of what was still to be relaxed; None where there is none.
    """

    name: str
    model_energy_j: float
    guard_energy_j: float
    strain_energy_j: float
    steps: int
    work_units: float
    seconds: float
    converged: bool
    residual: float | None
    left: Remainder | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of `stages` in `metrics.json`."""
        return self.__dict__ | {"left": None if self.left is None else dict(self.left.__dict__)}


def laid_stage(
    name: str,
    network: SpringNetwork,
    layout: FloatArray,
    energies: Energies,
    *,
    seconds: float = 0.0,
    converged: bool = True,
) -> Stage:
    """Make the entry of the history for a layout (#V by 2 [m]) to which nothing was relaxed."""
    return Stage(
        name=name, model_energy_j=energies.potential, guard_energy_j=energies.guard, strain_energy_j=strain_energy(network, layout),
        steps=0, work_units=0.0, seconds=seconds, converged=converged, residual=None,
    )  # fmt: skip


def make_stage(name: str, network: SpringNetwork, layout: FloatArray, outcome: Outcome) -> Stage:
    """Make the entry of the history for a relaxation that has ended in a layout (#V by 2 [m])."""
    return replace(
        laid_stage(name, network, layout, outcome.energies, seconds=outcome.seconds, converged=outcome.converged),
        steps=outcome.steps, work_units=outcome.work_units, residual=None if np.isnan(outcome.residual) else outcome.residual,
        left=outcome.left,
    )  # fmt: skip


def make_stages(name: str, network: SpringNetwork, layout: FloatArray, outcome: Outcome) -> tuple[Stage, ...]:
    """Make the entries of the history for a relaxation: of the paper's first steps, if there were any, and its own."""
    relaxed = make_stage(name, network, layout, outcome)
    if outcome.first_steps is None or outcome.first_layout is None:
        return (relaxed,)
    return make_stage(STEPS, network, outcome.first_layout, outcome.first_steps), relaxed


class Progress:
    """The progress of a relaxation, which a callback gets after every step and every iteration of L-BFGS.

    Attributes:
        stage: "develop", before the first step, "steps" during the paper's steps, then "relax"; "cut:NAME" and "close:NAME" where darts
            open and close, "fabric:NAME" and "surface:NAME" after a change of these, "refine" on a mesh with a path drawn for a cut.
        step: approximate implicit steps and iterations of L-BFGS so far.
        work_units: all work so far, in such steps.
        max_steps: at most so many.
        model_energy_j: springs and guard, or membrane and guard, at the last convergence check (see `RelaxOptions.check_every`) [J].
        guard_energy_j: the part of it that keeps faces unfolded [J].
        residual: largest force over mean spring force, at the same check.
    """

    def __init__(self, stage: str, state: Relaxation, *, max_steps: int) -> None:
        """Refer to the running relaxation; its layout is copied when it is asked for."""
        self.stage = stage
        self.step = state.steps
        self.work_units = state.work_units
        self.max_steps = max_steps
        self.model_energy_j = state.status.energies.potential
        self.guard_energy_j = state.status.energies.guard
        self.residual = state.status.residual
        self._state = state

    @property
    def surface(self) -> Surface:
        """The surface in its present topology: after a cut its vertices are doubled."""
        return self._network.surface

    def positions(self) -> FloatArray:
        """Return a copy of the layout, #V by 2 [m]."""
        return self._state.positions()

    def worn_strain(self) -> WornStrain:
        """Return worn strain, stress and strain energy per face."""
        return worn_strain(self._network, self.positions())

    def face_energy_density(self) -> FloatArray:
        """Return the strain energy per flat area of each face, #F [J/m2]."""
        return self.worn_strain().energy_density

    @property
    def _network(self) -> SpringNetwork:
        return self._state.network
