"""Runs: from a piece's layout to the network that is measured in it, to its relaxation; those of several pieces side by side."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import warp as wp

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.sums import begins
from warpflat.fabric.fabric import DEFAULT_FABRIC, Fabric, grain_axes
from warpflat.fabric.library import as_fabric
from warpflat.flattening.develop import Development
from warpflat.flattening.progress import Progress, Stage
from warpflat.model.join import join_networks
from warpflat.model.membrane import Model
from warpflat.model.network import SpringNetwork
from warpflat.model.strain import strain_energy
from warpflat.model.wear import Wear, intended_stretch
from warpflat.solver.convergence import Energies, Outcome
from warpflat.solver.gauss_newton import gauss_newton_pays, relax_gauss_newton
from warpflat.solver.grain_alignment import GrainAlignment
from warpflat.solver.multigrid.coarsen import can_coarsen, coarsenings_of
from warpflat.solver.multigrid.solve import multigrid_pays, relax_multilevel
from warpflat.solver.options import RelaxOptions
from warpflat.solver.relax import relax
from warpflat.solver.relaxation import Relaxation
from warpflat.surface.mesh import Surface

__all__ = ["Relaxed", "Run", "relax_runs"]


# Rounds before the last only turn and shape the layout, since directions are measured again after them: tolerances are so many times the
# others.
_FIRST_ROUND = 30.0
# Each round leaves about a fifth of what the one before was off: directions stand once a round has moved the piece by no more than this
# share of its size, on average, and further rounds than so many would tell little.
_STANDS = 2e-4
_MOST_AGAIN = 6
# And a layout that can be free of strain has told its directions once it is strained by no more than this.
_FIRST_STRAIN = 1e-6
# Quads across the grain are worth a note where they are so many times as stiff in shear as the cloth.
_MUCH_EXCESS = 3.0
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

    history: list[tuple[float, float, float, float]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

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
        return intended_stretch(self.surface, self.fabric, positions, self.wear, grain_angle=self.grain_angle)

    def network_at(self, positions: FloatArray) -> SpringNetwork:
        """The piece's network, with directions measured in a layout."""
        stretch, notes = self._meant(positions)
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

    def reference_at(self, positions: FloatArray) -> SpringNetwork:
        """The piece's network as an isotropic sheet that is worn as it lies: it shears no more easily than it stretches, and so leaves
        a layout that is far astray by the straight way."""
        reference = as_fabric(DEFAULT_FABRIC)
        return SpringNetwork.build(
            self.surface, reference, positions, grain_angle=self.grain_angle, device=self.device, model=self.model
        )

    def needs_isotropic_start(self, development: Development) -> bool:
        """Whether the piece is relaxed as an isotropic sheet first: a harmonic map is so far off, by kilojoules, that cloth soft in shear
        would come to rest in folds of its threads."""
        return development.method == "harmonic" and not self.fabric.is_isotropic

    def measured_again(self, *, mended: bool = False) -> int:
        """How many times at most directions are measured again: until they stand where another layout gives other springs, or other lengths
        for a stretch that is meant; once where they matter to a membrane's steps alone, or a `mended` layout says little of them."""
        springs = self.model == "springs"
        alike = self.fabric.is_isotropic or bool(self.surface.is_quad.all())
        tight = self.wear is not None and self.wear.is_tight and (springs or bool(self.wear.pressure))
        return _MOST_AGAIN if tight or (springs and not alike) else int(mended or not alike)

    def tell(self, stage: str, state: Relaxation, piece: int) -> None:
        """Call back with where this piece of the relaxation stands, by the last look."""
        if self.callback is not None:
            look = state.status
            self.callback(
                Progress(
                    stage,
                    state,
                    energies=Energies(*look.energies[piece].tolist()),
                    residual=float(look.residual[piece]),
                    max_steps=self.options.max_steps,
                    piece=piece,
                )
            )

    def stage(self, name: str, network: SpringNetwork, positions: FloatArray, outcome: Outcome) -> Stage:
        """The line of the history for a stage that ended so."""
        return Stage(
            name=name,
            spring_energy_j=outcome.energies.spring,
            guard_energy_j=outcome.energies.guard,
            strain_energy_j=strain_energy(network, positions),
            steps=outcome.steps,
            work_units=outcome.work_units,
            seconds=outcome.seconds,
            converged=outcome.converged,
            residual=outcome.residual,
        )


@dataclass(frozen=True, kw_only=True)
class Relaxed:
    """A piece, relaxed.

    Attributes:
        network: with directions as they were measured last.
        positions: #V by 2 [m].
        begin: energies at the start.
        outcome: how it ended; the seconds are those of all pieces that were relaxed with it.
    """

    network: SpringNetwork
    positions: FloatArray
    begin: Energies
    outcome: Outcome


def _off_grain(network: SpringNetwork) -> list[str]:
    """What is to be said of quads whose edges lie across the threads."""
    excess = network.spring_arrays.shear_excess
    if network.model != "springs" or excess < _MUCH_EXCESS:
        return []
    return [
        f"the grain runs aslant over the mesh's quads, whose springs are then {excess:.0f} times as stiff in shear as "
        f'{network.fabric.name}; model = "membrane" measures that exactly'
    ]


def relax_runs(
    runs: Sequence[Run],
    networks: Sequence[SpringNetwork],
    starts: Sequence[FloatArray],
    *,
    again: Sequence[int],
    needs_isotropic_start: Sequence[bool] | None = None,
) -> list[Relaxed]:
    """Relax the pieces of several runs, those of a kind side by side.

    Args:
        runs: of one fabric, grain, model, device, stage and set of options.
        networks: of each, measured in its start.
        starts: of each, #V by 2 [m].
        again: for each, how many times at most directions are measured again: it is relaxed in rounds, and they are measured in between.
        astray: for each, whether it is roughly relaxed as an isotropic sheet before; None of none.
    """
    kinds: dict[tuple[bool, int, bool], list[int]] = {}
    for number, (run, network) in enumerate(zip(runs, networks, strict=True)):
        kinds.setdefault(
            (
                _has_levels(run, network),
                again[number],
                needs_isotropic_start is not None and needs_isotropic_start[number],
            ),
            [],
        ).append(number)
    relaxed: dict[int, Relaxed] = {}
    for (levels, times, led), numbers in kinds.items():
        own = [runs[number] for number in numbers]
        batch = _Batch(own, [networks[number] for number in numbers], [starts[number] for number in numbers])
        relaxed |= zip(numbers, batch.relax(levels=levels, again=times, needs_isotropic_start=led), strict=True)
    for number, run in enumerate(runs):
        # Of the springs that the pattern has: those of a start that turned out otherwise are gone.
        run.notes += _off_grain(relaxed[number].network)
    return [relaxed[number] for number in range(len(runs))]


def _has_levels(run: Run, network: SpringNetwork) -> bool:
    return run.options.solver == "multilevel" and multigrid_pays(network) and can_coarsen(network.surface)


class _Batch:
    """Runs of one kind, and the relaxation in which their pieces lie side by side."""

    def __init__(self, runs: Sequence[Run], networks: Sequence[SpringNetwork], starts: Sequence[FloatArray]) -> None:
        self._runs = runs
        self._options = runs[0].options
        self._first = begins([net.vertex_count for net in networks]).tolist()
        self._put(networks, np.concatenate(starts))

    def _put(self, networks: Sequence[SpringNetwork], start: FloatArray) -> None:
        alignments = [
            GrainAlignment(
                lower=first + int(run.datum[0]), upper=first + int(run.datum[-1]), vertices=slice(first, end)
            )
            for run, (first, end) in zip(self._runs, pairwise(self._first), strict=True)
        ]
        self._state = Relaxation(join_networks(networks), self._options, start=start, alignments=alignments)

    def relax(self, *, levels: bool, again: int, needs_isotropic_start: bool) -> list[Relaxed]:
        """Relax them, in rounds between which directions are measured again, so many times at most; as isotropic sheets first where
        they are astray."""
        begun = time.perf_counter()
        begin = self._state.check_start().energies
        stage = self._runs[0].stage_name
        self._tell(self._state, "develop" if stage == "relax" else stage)
        if needs_isotropic_start:
            own, start = self._state.vertex_ranges, self._state.positions()
            self._put([run.reference_at(start[at]) for run, at in zip(self._runs, own, strict=True)], start)
            self._measure_again(levels)
        for _ in range(again):
            if self._measure_again(levels) <= _STANDS:
                break
        outcome, state = replace(self._round(levels), seconds=time.perf_counter() - begun), self._state
        layout, look = state.positions(), state.status
        return [
            Relaxed(
                network=net,
                positions=layout[own],
                begin=Energies(*begin[piece].tolist()),
                outcome=replace(
                    outcome,
                    converged=bool(look.at_rest[piece]),
                    steps=int(look.steps[piece]),
                    work_units=float(look.work_units[piece]),
                    energy_change=float(look.change[piece]),
                    residual=float(look.residual[piece]),
                    energies=Energies(*look.energies[piece].tolist()),
                ),
            )
            for piece, (net, own) in enumerate(zip(state.network.pieces, state.vertex_ranges, strict=True))
        ]

    def _measure_again(self, levels: bool) -> float:
        """Relax them roughly, and measure directions where they then lie; by how much of its size a piece has moved, at most."""
        state = self._state
        state.options = replace(
            self._options,
            energy_tolerance=_FIRST_ROUND * self._options.energy_tolerance,
            residual_tolerance=_FIRST_ROUND * self._options.residual_tolerance,
        )
        state.least_strain = _FIRST_STRAIN
        before = state.positions()
        self._round(levels, least_gain=_FIRST_GAIN)
        layout = state.positions()
        self._put(
            [run.network_at(layout[own]) for run, own in zip(self._runs, state.vertex_ranges, strict=True)], layout
        )
        after = self._state
        after.steps, after.restarts, after.work_units = state.steps, state.restarts, state.work_units
        return max(_moved(before[own], layout[own]) for own in state.vertex_ranges)

    def _round(self, levels: bool, *, least_gain: float | None = None) -> Outcome:
        told = any(run.callback is not None for run in self._runs)
        each_step = self._each_step if told else None
        if not levels and self._options.solver == "multilevel" and gauss_newton_pays(self._state.network):
            return relax_gauss_newton(self._state, least_gain=least_gain, watch=self._watch, each_step=each_step)
        if not levels:
            return relax(self._state, watch=self._watch, each_step=each_step)
        # After an edit the layout is near the minimum already; a grid is nearer once it has been carried up from its coarser levels.
        nested = self._state.steps == 0 and (
            self._runs[0].stage_name == "relax"
            or all(coarsenings_of(run.surface)[0].smooth_interpolation is not None for run in self._runs)
        )
        return relax_multilevel(
            self._state, nested=nested, least_gain=least_gain, watch=self._watch, each_step=each_step
        )

    def _watch(self, state: Relaxation, energies: Energies, residual: float) -> None:
        for piece, number in enumerate(state.piece_numbers):
            spring, guard, _ = state.status.energies[piece].tolist()
            run = self._runs[number]
            run.history.append((float(state.steps), spring, guard, float(state.status.residual[piece])))

    def _each_step(self, state: Relaxation, energies: Energies, residual: float) -> None:
        self._tell(state, self._runs[0].stage_name)

    def _tell(self, state: Relaxation, stage: str) -> None:
        for piece, number in enumerate(state.piece_numbers):
            self._runs[number].tell(stage, state, piece)


def _moved(before: FloatArray, after: FloatArray) -> float:
    """How far a layout (#V by 2 [m]) has moved in itself, on average, as a share of its size."""
    way = after - before
    return float(np.sqrt(np.var(way, axis=0).sum()) / np.linalg.norm(np.ptp(after, axis=0)))
