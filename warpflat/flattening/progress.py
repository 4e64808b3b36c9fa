"""Where a run stands, and the lines of its history."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from warpflat.core.arrays import FloatArray
from warpflat.model.network import SpringNetwork
from warpflat.model.strain import worn_strain
from warpflat.solver.convergence import Energies
from warpflat.solver.relaxation import Relaxation
from warpflat.surface.mesh import Surface

__all__ = ["Progress", "Stage"]


@dataclass(frozen=True, kw_only=True)
class Stage:
    """A line of the history: energies [J] when a stage had ended, and what it took.

    `residual` is the largest force on a vertex over the mean spring force; `work_units` counts approximate implicit
    steps over all vertices.
    """

    name: str
    spring_energy_j: float
    guard_energy_j: float
    strain_energy_j: float
    steps: int
    work_units: float
    seconds: float
    converged: bool
    residual: float | None

    @property
    def potential_j(self) -> float:
        """What is minimised: springs and guard."""
        return self.spring_energy_j + self.guard_energy_j

    def as_dict(self) -> dict[str, Any]:
        """As in `metrics.json`."""
        return dict(self.__dict__)


class Progress:
    """Where a run stands; what a callback gets after every step, and after every cycle of levels.

    Attributes:
        stage: "develop", before the first step, then "relax"; "cut:NAME" and "close:NAME" where darts open and close, "fabric:NAME" and
            "surface:NAME" after a change of these, "refine" on a mesh with a path drawn for a cut.
        step: approximate implicit steps so far, on the piece's own mesh.
        work_units: all work so far, in such steps.
        max_steps: at most so many.
        spring_energy: [J], of the last look (see `RelaxOptions.check_every`).
        residual: largest force over mean spring force, likewise.
    """

    def __init__(
        self, stage: str, state: Relaxation, *, energies: Energies, residual: float, max_steps: int, piece: int = 0
    ) -> None:
        """Hold on to the running state, of which it is this piece; nothing is copied before it is asked for."""
        self.stage = stage
        self.step = state.steps
        self.work_units = state.work_units
        self.max_steps = max_steps
        self.spring_energy = energies.spring
        self.guard_energy = energies.guard
        self.residual = residual
        self._state = state
        self._piece = piece

    @property
    def surface(self) -> Surface:
        """The surface with the present topology: after a cut its vertices are doubled."""
        return self._network.surface

    def positions(self) -> FloatArray:
        """#V by 2, the layout [m], a copy."""
        return self._state.positions()[self._state.vertex_ranges[self._piece]]

    def face_energy_density(self) -> FloatArray:
        """#F, strain energy per flat area [J/m2]."""
        return worn_strain(self._network, self.positions()).energy_density

    @property
    def _network(self) -> SpringNetwork:
        return self._state.network.pieces[self._piece]
