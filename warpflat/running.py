"""A run of one piece: from a layout to the network that is measured in it, to its relaxation."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpflat.develop import Development
from warpflat.fabric import Fabric
from warpflat.membrane import Model
from warpflat.multilevel import levels_pay, relax_multilevel
from warpflat.network import SpringNetwork, grain_axes
from warpflat.progress import Progress, Stage
from warpflat.relax import Energies, Outcome, Relaxation, RelaxOptions, Upright, relax
from warpflat.strain import strain_energy
from warpflat.surface import Surface
from warpflat.tightness import Wear, meant_stretch

__all__ = ["Run"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

# A first round only turns and shapes the layout, since directions are measured again after it: tolerances are so many times the others.
_FIRST_ROUND = 30.0
# With levels it is over once a cycle takes no more than this share of the energy away.
_FIRST_GAIN = 3e-3


@dataclass
class Run:
    """A run under way: what it was asked for, and the history it leaves."""

    surface: Surface
    fabric: Fabric
    grain_angle: float
    device: wp.Device
    options: RelaxOptions
    callback: Callable[[Progress], None] | None
    datum: IntArray
    stage_name: str = "relax"
    model: Model = "springs"
    wear: Wear | None = None

    def __post_init__(self) -> None:
        self.history: list[tuple[float, float, float, float]] = []
        self.notes: list[str] = []

    def let_go(self, development: Development) -> Development:
        """The development made smaller by the mean stretch that is meant: the cloth as it was on the body, let go."""
        stretch, _ = self._meant(development.positions)
        if stretch is None:
            return development
        shrink = sum(
            np.outer(axis, axis) / s for axis, s in zip(grain_axes(self.grain_angle), stretch.mean(0), strict=True)
        )
        return replace(development, positions=development.positions @ shrink)

    def _meant(self, positions: FloatArray) -> tuple[FloatArray | None, tuple[str, ...]]:
        if self.wear is None:
            return None, ()
        return meant_stretch(self.surface, self.fabric, positions, self.wear, grain_angle=self.grain_angle)

    def state_at(self, positions: FloatArray, *, after: Relaxation | None = None) -> Relaxation:
        """A relaxation that starts at a layout, with directions measured in it."""
        stretch, notes = self._meant(positions)
        self.notes += [note for note in notes if note not in self.notes]
        network = SpringNetwork.build(
            self.surface,
            self.fabric,
            positions,
            grain_angle=self.grain_angle,
            device=self.device,
            model=self.model,
            stretch=stretch,
        )
        ends = Upright(lower=int(self.datum[0]), upper=int(self.datum[-1]))
        state = Relaxation(network, self.options, start=positions, upright=[ends])
        if after is not None:
            state.steps, state.restarts, state.work_units = after.steps, after.restarts, after.work_units
        return state

    def relax(self, state: Relaxation, *, measure_again: bool) -> tuple[Relaxation, Outcome]:
        """Relax; where the first layout says little of directions, in two rounds, measuring them again in between."""
        first = "develop" if self.stage_name == "relax" else self.stage_name
        self._tell(first, state, state.energies(), float("nan"))
        begun = time.perf_counter()
        clamped = state.network.spring_arrays.clamped_cells
        if clamped:
            self.notes.append(
                f"{clamped:,} quads are so long that their shear springs outweigh the fabric along them; their "
                "structural springs were kept at 5 % of it"
            )
        if measure_again:
            state.options = replace(
                self.options,
                energy_tolerance=_FIRST_ROUND * self.options.energy_tolerance,
                residual_tolerance=_FIRST_ROUND * self.options.residual_tolerance,
            )
            self._relax(state, enough=_FIRST_GAIN)
            state = self.state_at(state.positions(), after=state)
        state.options = self.options
        outcome = self._relax(state)
        seconds = time.perf_counter() - begun
        return state, replace(outcome, steps=state.steps, work_units=state.work_units, seconds=seconds)

    def directions_matter(self) -> bool:
        """Whether another layout gives other springs: in a cloth that is not the same in all directions, between triangles."""
        return not (_is_isotropic(self.fabric) or bool(self.surface.is_quad.all()))

    def _relax(self, state: Relaxation, *, enough: float | None = None) -> Outcome:
        each_step = None if self.callback is None else self._each_step
        if self.options.solver == "plain" or not levels_pay(state.network):
            return relax(state, watch=self._watch, each_step=each_step)
        # After an edit the layout is near the minimum already.
        nested = self.stage_name == "relax" and state.steps == 0
        return relax_multilevel(state, nested=nested, enough=enough, watch=self._watch, each_step=each_step)

    def _watch(self, state: Relaxation, energies: Energies, residual: float) -> None:
        self.history.append((float(state.steps), energies.spring, energies.guard, residual))

    def _each_step(self, state: Relaxation, energies: Energies, residual: float) -> None:
        self._tell(self.stage_name, state, energies, residual)

    def _tell(self, stage: str, state: Relaxation, energies: Energies, residual: float) -> None:
        if self.callback is not None:
            self.callback(
                Progress(stage, state, energies=energies, residual=residual, max_steps=self.options.max_steps)
            )

    def stage(self, name: str, state: Relaxation, *, seconds: float, outcome: Outcome | None = None) -> Stage:
        """The line of the history for a stage that ended in this state."""
        energies = state.energies() if outcome is None else outcome.energies
        steps = 0 if outcome is None else outcome.steps
        return Stage(
            name=name,
            spring_energy_j=energies.spring,
            guard_energy_j=energies.guard,
            strain_energy_j=strain_energy(state.network, state.positions()),
            steps=steps,
            work_units=0.0 if outcome is None else outcome.work_units,
            seconds=seconds,
            converged=True if outcome is None else outcome.converged,
            residual=None if outcome is None else outcome.residual,
        )


def _is_isotropic(fabric: Fabric) -> bool:
    same = np.isclose(fabric.stiffness_warp, fabric.stiffness_weft, rtol=1e-9)
    return bool(same and np.isclose(fabric.shear_stiffness, fabric.stiffness_warp / 2 / (1 + fabric.poisson_ratio)))
