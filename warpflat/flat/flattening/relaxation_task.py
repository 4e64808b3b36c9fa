"""A piece that is to be relaxed: its cloth, the networks that are measured in its layouts, and the record of its relaxation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import warp as wp

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.flat.fabric.fabric import DEFAULT_FABRIC, Fabric, grain_axes
from warpflat.flat.fabric.library import as_fabric
from warpflat.flat.flattening.develop import Development
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.model.membrane import Model
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.wear import Wear, intended_stretch
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.solver.stop import Energies, Outcome
from warpflat.flat.surface.mesh import Surface

__all__ = ["RelaxationTask", "RelaxedPiece"]

# Each round leaves about a fifth of the error of the lengths before it, so that more rounds than this would change little.
_MAX_UPDATES = 6


@dataclass
class RelaxationTask:
    """A piece that is to be relaxed, and the record of its relaxation.

    Attributes:
        surface, fabric, grain_angle, model, wear: the piece and its cloth, as `flatten` takes them.
        device, options: where and how it is relaxed.
        callback: called with its `Progress`.
        datum: vertices of the line that stays upright.
        stage_name: name of the stage in its history.
        history: a row per convergence check: step, model energy [J], guard energy [J], residual.
        notes: what was chosen or is worth a warning, one sentence each.
        stopped: whether the callback has stopped the relaxation.
    """

    surface: Surface
    fabric: Fabric
    grain_angle: float
    device: wp.Device
    options: RelaxOptions
    callback: Callable[[Progress], bool | None] | None
    datum: IntArray
    model: Model
    stage_name: str = "relax"
    wear: Wear | None = None

    history: list[tuple[float, float, float, float]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    stopped: bool = False

    def shrink_to_rest(self, development: Development) -> Development:
        """Shrink a development by the mean stretch with which the piece is to be worn; return it as it is without one."""
        stretch, _ = self._wanted_stretch(development.positions)
        if stretch is None:
            return development
        shrink = sum(
            np.outer(axis, axis) / s for axis, s in zip(grain_axes(self.grain_angle), stretch.mean(0), strict=True)
        )
        return replace(development, positions=development.positions @ shrink)

    def _wanted_stretch(self, positions: FloatArray) -> tuple[FloatArray | None, tuple[str, ...]]:
        if self.wear is None:
            return None, ()
        return intended_stretch(self.surface, self.fabric, positions, self.wear, grain_angle=self.grain_angle)

    def build_network(self, positions: FloatArray) -> SpringNetwork:
        """Build the piece's network, with directions measured in a layout (#V by 2 [m])."""
        stretch, notes = self._wanted_stretch(positions)
        network = SpringNetwork.build(
            self.surface,
            self.fabric,
            positions,
            grain_angle=self.grain_angle,
            device=self.device,
            model=self.model,
            stretch=stretch,
        )
        self.notes += [note for note in notes if note not in self.notes]
        return network

    def build_isotropic_network(self, positions: FloatArray) -> SpringNetwork:
        """Build the network of the piece as an isotropic sheet without a stretch, with directions measured in a layout (#V by 2 [m]).

        Such a sheet does not shear more easily than it stretches, so that it unfolds from a bad start without folds of its threads.
        """
        reference = as_fabric(DEFAULT_FABRIC)
        return SpringNetwork.build(
            self.surface, reference, positions, grain_angle=self.grain_angle, device=self.device, model=self.model
        )

    def needs_isotropic_start(self, development: Development) -> bool:
        """Return whether the piece is relaxed as an isotropic sheet first.

        A harmonic map stores so much energy that cloth which is soft in shear would come to rest in folds of its threads.
        """
        return development.method == "harmonic" and not development.as_rigid and not self.fabric.is_isotropic

    def follows_layout(self, network: SpringNetwork) -> bool:
        """Return whether the energy of the piece's network depends on the layout in which it is measured."""
        springs = self.model == "springs"
        return self._is_tight or (springs and (not self.fabric.is_isotropic or network.spring_arrays.long_quads > 0))

    @property
    def _is_tight(self) -> bool:
        """Whether the lengths for an intended stretch depend on the layout."""
        return self.wear is not None and self.wear.is_tight and (self.model == "springs" or bool(self.wear.pressure))

    def max_direction_updates(self, *, mended: bool = False) -> int:
        """Return how many times the network is measured anew at most: once where the development was mended, and often for a stretch."""
        return _MAX_UPDATES if self._is_tight else int(mended)

    def report_progress(self, stage: str, state: Relaxation) -> None:
        """Call the callback with the state at the last convergence check; it may stop the relaxation."""
        if self.callback is not None:
            answer = self.callback(Progress(stage, state, max_steps=self.options.max_steps))
            self.stopped = self.stopped or answer is True


@dataclass(frozen=True, kw_only=True)
class RelaxedPiece:
    """A relaxed piece.

    Attributes:
        network: with directions as they were measured last.
        positions: #V by 2, the layout [m].
        begin: energies at the start.
        outcome: how it ended.
    """

    network: SpringNetwork
    positions: FloatArray
    begin: Energies
    outcome: Outcome
