"""The levels of a relaxation, coarser meshes as spring networks of their own, and the operations on one level.

`warpflat.solver.multigrid.cycle` has the cycle over them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.model.join import join_networks
from warpflat.solver.convergence import Iterate
from warpflat.solver.multigrid.acceleration import SubspaceAcceleration
from warpflat.solver.multigrid.cubic_interpolation import GridProlongation
from warpflat.solver.multigrid.hierarchy import CoarseLevel, drop_caches, identity_coarsening, make_coarse_levels
from warpflat.solver.multigrid.level_transfer import LevelTransfer, make_level_transfer, set_displacement
from warpflat.solver.options import RelaxOptions
from warpflat.solver.relaxation import Relaxation

__all__ = ["CHECK_INTERVAL", "ENERGY_WORK", "FORCE_WORK", "Level", "Levels"]


# Smoothing steps before and after a correction on the finest level, and on coarser ones, where they cost little; fewer where a line
# relaxation step follows.
_STEPS, _STEPS_COARSE, _STEPS_BEFORE_LINES = 3, 4, 2
# From this K/G on they are the paper's: the guard acts there, and a step in its direction may go further than a Chebyshev step can bear.
_SOFT = 12.0
# Steps between two checks of all cells.
CHECK_INTERVAL = 4
# The least fraction of a displacement that a line search tries.
LEAST_FRACTION = 0.05
# Work of evaluating the forces, of a line relaxation step and of evaluating the energy, in steps.
FORCE_WORK = 1.0
LINE_WORK = 2.0
ENERGY_WORK = 0.5


@dataclass
class Level:
    """A level.

    Attributes:
        state: layout and forces of all pieces on this level.
        steps: smoothing steps before and after a correction.
        transfer: to the next coarser level; None on the coarsest.
        has_lines: whether smoothing ends with a line relaxation step.
    """

    state: Relaxation
    steps: int
    transfer: LevelTransfer | None = None
    has_lines: bool = False


class Levels:
    """The levels of a relaxation, finest first; made once, and good for any number of relaxations of the same network.

    Attributes:
        all: the levels.
        is_lattice, is_grid: whether every piece lies on a lattice of quads; on a rectangular grid.
        is_soft: whether the cloth is soft in shear.
        accelerations: of each piece, while a cycle on the finest level is accelerated.
        starts_rough: whether the next cycle on the finest level starts from a rough layout.
        is_outdated: a coarse level had mirrored cells at the finer level's layout; make the levels anew there.
    """

    def __init__(self, finest: Relaxation, *, repair: bool = False) -> None:
        """Make the levels of a relaxation at its present layout, which must mirror no face.

        Args:
            finest: the pieces themselves.
            repair: turn back cells of coarser levels that are mirrored at this layout, as at the start of a nested
                iteration, which leaves the layout; otherwise make levels without mirrored cells.
        """
        layout, pieces = finest.positions(), finest.network.pieces
        hierarchies = [
            make_coarse_levels(net, layout[own], repair=repair)
            for net, own in zip(pieces, finest.vertex_ranges, strict=True)
        ]
        for coarse_levels, net in zip(hierarchies, pieces, strict=True):
            drop_caches(net, coarse_levels)
        depth = max(len(coarse_levels) for coarse_levels in hierarchies)
        for coarse_levels, net, own in zip(hierarchies, pieces, finest.vertex_ranges, strict=True):
            lowest, where = (
                (coarse_levels[-1].network, coarse_levels[-1].layout) if coarse_levels else (net, layout[own])
            )
            while len(coarse_levels) < depth:
                same = identity_coarsening(lowest.surface)
                coarse_levels.append(CoarseLevel(coarsening=same, network=lowest, layout=where))
        self._join(finest, hierarchies)

    def _join(self, finest: Relaxation, hierarchies: Sequence[Sequence[CoarseLevel]]) -> None:
        """Join the pieces' hierarchies level by level, and record the transfers between the levels."""
        self._hierarchies = hierarchies
        kinds = [coarse_levels[0].coarsening.smooth_interpolation for coarse_levels in hierarchies if coarse_levels]
        self.is_lattice = None not in kinds
        self.is_grid = all(isinstance(kind, GridProlongation) for kind in kinds)
        self.is_soft = finest.network.fabric.softness >= _SOFT
        self.accelerations: Sequence[SubspaceAcceleration] = ()
        self.starts_rough = False
        self.is_outdated = False
        self.all = [Level(finest, steps=_STEPS)]
        for coarse_levels in zip(*hierarchies, strict=True):
            coarse = Level(_join_states(coarse_levels, finest.options), steps=_STEPS_COARSE)
            fine = self.all[-1]
            if fine.transfer is None:
                coarsenings = [each.coarsening for each in coarse_levels]
                fine.transfer = make_level_transfer(fine.state, coarsenings, coarse.state)
            self.all.append(coarse)
        if finest.network.uses_line_relaxation:
            for level in self.all:
                _use_lines(level)
        self.update_matrices()

    def extract(self, finest: Relaxation, pieces: Sequence[int]) -> Levels:
        """Return the levels of some of the pieces, of which `finest` is the relaxation."""
        part = Levels.__new__(Levels)
        part._join(finest, [self._hierarchies[piece] for piece in pieces])
        part.is_outdated = self.is_outdated
        return part

    @property
    def piece_count(self) -> int:
        """The number of pieces."""
        return len(self._hierarchies)

    @property
    def sizes(self) -> list[int]:
        """The number of vertices of each level, finest first."""
        return [level.state.network.vertex_count for level in self.all]

    def update_matrices(self) -> None:
        """Set the step matrices of a membrane to bounds of its stiffness in the present layouts."""
        for level in self.all:
            if level.state.matrix is not None:
                level.state.matrix.update(level.state.position)

    # --- operations on one level

    def count_work(self, level: int, units: float) -> None:
        """Add work on a level, in steps of that level, to the finest level's work units."""
        finest = self.all[0].state
        finest.work_units += units * self.all[level].state.network.vertex_count / finest.network.vertex_count

    def evaluate_forces(self, level: int) -> None:
        """Evaluate the forces at rest on a level, and count the work."""
        self.all[level].state.evaluate_at_rest()
        self.count_work(level, FORCE_WORK)

    def objective(self, level: int) -> FloatArray:
        """Return what each piece minimises on a level, #P [J]: its potential energy less the work of its load."""
        self.count_work(level, ENERGY_WORK)
        state = self.all[level].state
        return np.asarray(state.potentials().sum(axis=1) - state.work_of_load())

    def smooth(
        self,
        level: int,
        each_step: Callable[[], None] | None = None,
        *,
        evaluated: bool = False,
        steps: int | None = None,
    ) -> FloatArray:
        """Take smoothing steps from rest on a level; in soft cloth on a lattice the last one is a line relaxation step.

        Args:
            level: index of the level.
            each_step: called after each step.
            evaluated: the forces there have just been evaluated.
            steps: how many; the level's own number if not given.

        Returns:
            #P, the objective afterwards [J].
        """
        state, steps = self.all[level].state, self.all[level].steps if steps is None else steps
        state.velocity.zero_()
        take_steps = state.sweep if self.is_soft else state.smooth
        take_steps(steps, each_step, check_interval=CHECK_INTERVAL, evaluated=evaluated)
        self.count_work(level, steps)
        if not self.all[level].has_lines:
            return self.objective(level)
        energy = self.step_along_lines(level)
        if each_step is not None:
            each_step()
        return energy

    def step_along_lines(self, level: int) -> FloatArray:
        """Take a line relaxation step, halved until the objective does not rise; return the objective, #P [J]."""
        state, before = self.all[level].state, self.objective(level)
        state.step_along_lines()
        self.count_work(level, LINE_WORK)
        return self.backtrack(level, state.anchor, state.scratch, before, self.objective(level))

    def backtrack(
        self, level: int, base: wp.array, displacement: wp.array, before: FloatArray, energy: FloatArray
    ) -> FloatArray:
        """Halve the way from `base` to the present layout for pieces whose objective has risen.

        Args:
            level: index of the level.
            base: #V vec2d, the layout before [m].
            displacement: #V vec2d, overwritten with the way from there [m].
            before: #P, the objective in that layout [J].
            energy: #P, the present objective [J].

        Returns:
            #P, the objective afterwards [J].
        """
        higher = ~(energy <= before)
        if higher.any():
            set_displacement(self.all[level].state, base, displacement)
            halved = self.line_search(level, base, displacement, before, higher, first_fraction=0.5)
            energy = np.where(higher, halved, energy)
        return energy

    def line_search(
        self,
        level: int,
        base: wp.array,
        displacement: wp.array,
        before: FloatArray,
        pieces: BoolArray,
        *,
        first_fraction: float = 1.0,
    ) -> FloatArray:
        """Move pieces by a fraction of a displacement, halved until their objective is not above that before.

        Below the least fraction a piece returns to `base`.

        Args:
            level: index of the level.
            base, displacement: #V vec2d [m].
            before: #P, the objective at `base` [J].
            pieces: #P, which ones to move.
            first_fraction: the first fraction to try.

        Returns:
            #P, the objective afterwards [J]; that before for all other pieces.
        """
        # Only energies are measured here: evaluating forces would overwrite a displacement in the scratch buffer.
        state, fraction, energy = self.all[level].state, first_fraction, before
        while pieces.any():
            state.move_along(base, displacement, fraction, pieces)
            if fraction == 0.0:
                break
            now = self.objective(level)
            energy = np.where(pieces & (now <= before), now, energy)
            pieces = pieces & ~(now <= before)
            fraction = 0.5 * fraction if fraction > LEAST_FRACTION else 0.0
        return energy

    # --- acceleration on one level

    def begin_acceleration(self, level: int, accelerations: Sequence[SubspaceAcceleration], iterate: Iterate) -> None:
        """Begin a cycle of each piece at the iterate of all."""
        for each, own in zip(accelerations, self.all[level].state.vertex_ranges, strict=True):
            each.begin_cycle((iterate[0][own], iterate[1][own]))

    def add_iterate(self, level: int, accelerations: Sequence[SubspaceAcceleration], iterate: Iterate) -> None:
        """Add the iterate of all pieces to the subspace of each."""
        for each, own in zip(accelerations, self.all[level].state.vertex_ranges, strict=True):
            each.add_iterate((iterate[0][own], iterate[1][own]))

    def minimise_in_subspace(
        self,
        level: int,
        accelerations: Sequence[SubspaceAcceleration],
        energy: FloatArray,
    ) -> FloatArray:
        """Move each piece to the minimum in its subspace, as far as its objective is lower there.

        Args:
            level: index of the level.
            accelerations: of each piece.
            energy: #P, the present objective [J].

        Returns:
            #P, the objective afterwards [J].
        """
        state, transfer = self.all[level].state, self.all[level].transfer
        out = state.piece_sums.scratch()
        found = np.array(
            [each.minimise_in_subspace(out[own]) for each, own in zip(accelerations, state.vertex_ranges, strict=True)]
        )
        # The cycle is over, and its own buffer is free.
        base = wp.empty_like(state.position) if transfer is None else transfer.base
        wp.copy(base, state.position)
        return self.line_search(level, base, state.scratch, energy, found)


def _join_states(coarse_levels: Sequence[CoarseLevel], options: RelaxOptions) -> Relaxation:
    """Return the state of the pieces' coarse levels side by side."""
    layouts = [each.layout for each in coarse_levels]
    start = layouts[0] if len(layouts) == 1 else np.concatenate(layouts)
    return Relaxation(join_networks([each.network for each in coarse_levels]), options, start=start)


def _use_lines(level: Level) -> None:
    """End smoothing with line relaxation where a piece has lines; with fewer steps before if every piece has."""
    network = level.state.network
    level.has_lines = network.line_arrays is not None
    if all(piece.line_arrays is not None for piece in network.pieces):
        level.steps = _STEPS_BEFORE_LINES
