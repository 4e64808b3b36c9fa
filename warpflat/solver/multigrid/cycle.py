"""The levels of a relaxation: a piece's coarser meshes as spring networks of their own, and cycles over them.

`warpflat.solver.multigrid.solve` says what a cycle is; here are its parts, and `Levels.rise`, the start level by level.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp
from scipy.sparse import block_diag, csr_array

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.core.launch import Launch, launch_each, record
from warpflat.core.sums import range_offsets
from warpflat.kernels.prolongation import Transpose, Weights, coarse_difference, coarse_load, inject, transfer
from warpflat.kernels.reduce import subtract
from warpflat.model.join import join_networks
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import Mark
from warpflat.solver.multigrid.acceleration import SubspaceAcceleration
from warpflat.solver.multigrid.coarsen import Coarser
from warpflat.solver.multigrid.cubic_interpolation import GridProlongation
from warpflat.solver.multigrid.hierarchy import CoarseLevel, let_go, make_coarse_levels, stay
from warpflat.solver.relax import Relaxation
from warpflat.surface.mesh import Surface
from warpflat.surface.untangle import untangle

__all__ = ["ENERGY_WORK", "FORCE_WORK", "Levels"]


# The coarsest is relaxed by so many steps at a time until its forces have come down to this share of what they were, in a cycle and at
# the very first, or so many times the vertices along its side: a crack that opens is slow there too. In a cycle it is enough, too, once
# they take no more than this share of what all before have taken of its energy: it is not the fine level's to the last per cent.
# After every second time it leaps to where the ways so far say that its energy is least: a crack opens in a third of the steps. A
# rectangular grid is at rest as soon without. In cycles that is for lattices only: a coarse level of triangles stores roughly what the fine
# one does, and is not worth following to its end.
_BOTTOM_STEPS = 8
_LEAP_EVERY = 2
_AT_REST = 0.05
_AT_REST_FIRST = 5e-3
_MOST_BOTTOM_STEPS = 24.0
_LITTLE_GAIN = 0.07
# Steps before and after: few on the finest level, where one takes as long as all below it together, unless it was carried up to along
# straight lines, whose kinks they have to smooth first. In soft cloth, from such a K/G on, one more, and of those that swing: the guard
# acts there, and a push in its direction may go further than a step of the others can bear.
_STEPS = 3
_STEPS_SMOOTH = 2
_STEPS_SOFT = 4
_SOFT = 12.0
# The least share that is tried, of a correction and of a leap.
_LEAST_SHARE = 0.05
_LEAST_OF_LEAP = 0.2
# Steps between two looks at all cells; fewer where sqrt(K/G) times them would be more than this: the guard of a soft cloth begins so early
# that in between cells would come far beyond, and raise the energy.
_WATCH_EVERY = 4
_WATCH_SOFT = 20.0
_CYCLES_ALONG_LINES = 2
# At the start of a stiff cloth on a rectangular grid what is left on levels of no more vertices than this is rough: so many steps take as
# much of it as a cycle, in a third of the time. Beside a crack it is not. The finest level there takes more steps after a correction, since
# the next one has a ninth of its vertices.
_STEPS_INSTEAD, _FEW = 16, 700
_STEPS_AFTER = 7
# What rising between triangles leaves is mostly rough, since each mesh is uneven in its own way: in the first cycle so many steps before
# the correction and after it spare another cycle.
_STEPS_FIRST = 12, 8
# In units of a step: evaluating the forces, a step along lines, evaluating the energy.
FORCE_WORK = 1.0
LINE_WORK = 2.0
ENERGY_WORK = 0.5


@dataclass(frozen=True, kw_only=True)
class _Way:
    """The way from a level to the next coarser one and back.

    Attributes:
        coarse: the coarser level.
        down: its vertices go where they are on the finer one. load: it gets the finer one's residual forces.
        differ: how far it has come from `base`, #V of the finer level. up: that, as `correction` of the finer level, which is there until
            forces are evaluated on that.
        carry: its layout, as that of the finer level.
        steps: of each piece its step down.
    """

    coarse: Relaxation
    down: Launch
    load: Launch
    differ: Launch
    up: Launch
    carry: Launch
    base: wp.array
    correction: wp.array
    steps: Sequence[Coarser]


@dataclass
class _Level:
    """A level, and its way down, but for the coarsest; whether the last of the steps that smooth goes along lines, and how many there are
    before that."""

    state: Relaxation
    steps: int
    way: _Way | None = None
    lines: bool = False


def _weights(blocks: Sequence[csr_array], device: wp.Device) -> Weights:
    """The matrix that has these along its diagonal."""
    weights, matrix = Weights(), _diagonal(blocks)
    weights.offset, weights.column = _pattern(matrix, device)
    weights.weight = wp.array(matrix.data.astype(np.float64, copy=False), dtype=wp.float64, device=device, copy=False)
    return weights


def _transpose(blocks: Sequence[csr_array], device: wp.Device) -> Transpose:
    """Of the same matrix; blocks: of each the transpose, with the numbers of the entries."""
    transpose, first = Transpose(), range_offsets([block.nnz for block in blocks])
    matrix = _diagonal(
        [csr_array((b.data + at, b.indices, b.indptr), shape=b.shape) for b, at in zip(blocks, first, strict=False)]
        if len(blocks) > 1
        else blocks
    )
    transpose.offset, transpose.row = _pattern(matrix, device)
    transpose.entry = wp.array(matrix.data, dtype=wp.int32, device=device, copy=False)
    return transpose


def _diagonal(blocks: Sequence[csr_array]) -> csr_array:
    return blocks[0] if len(blocks) == 1 else csr_array(block_diag(blocks, format="csr"))


def _pattern(matrix: csr_array, device: wp.Device) -> tuple[wp.array, wp.array]:
    """Where rows begin, and the columns; on the CPU the matrix' own arrays."""
    return tuple(
        wp.array(index.astype(np.int32, copy=False), dtype=wp.int32, device=device, copy=False)
        for index in (matrix.indptr, matrix.indices)
    )


class Levels:
    """The levels of a relaxation, finest first; made once, and good for any number of relaxations of the same network.

    Attributes:
        sizes: vertices of each level.
        leading: steps of a larger grid to the finest of these, by their surfaces.
        stale: a coarse level had mirrored cells where the finer one had come to; make the levels anew there.
    """

    def __init__(self, finest: Relaxation, *, mend: bool = False, below: Levels | None = None) -> None:
        """Of a relaxation and its present layout, which must mirror no face.

        Args:
            finest: the pieces themselves.
            mend: turn back what cells of the coarser levels are mirrored where the piece lies, as at the start of a nested iteration, which
                leaves that layout; otherwise make levels that have none.
            below: levels that are there already; what they hold may be used as part of these.
        """
        layout, pieces = finest.positions(), finest.network.pieces
        known = {} if below is None else below.coarse_levels
        ladders = [
            make_coarse_levels(net, layout[own], mend=mend, known=known)
            for net, own in zip(pieces, finest.vertices, strict=True)
        ]
        for coarse_levels, net in zip(ladders, pieces, strict=True):
            let_go(net, coarse_levels)
        depth = max(len(coarse_levels) for coarse_levels in ladders)
        for coarse_levels, net, own in zip(ladders, pieces, finest.vertices, strict=True):
            lowest, where = (
                (coarse_levels[-1].network, coarse_levels[-1].layout) if coarse_levels else (net, layout[own])
            )
            while len(coarse_levels) < depth:
                coarse_levels.append(CoarseLevel(step=stay(lowest.surface), network=lowest, layout=where))
        self._join(finest, ladders, [] if below is None else below._levels, mend=mend)

    def _join(
        self, finest: Relaxation, ladders: Sequence[Sequence[CoarseLevel]], there: Sequence[_Level] = (), *, mend: bool
    ) -> None:
        self._ladders, self._mend = ladders, mend
        carries = [coarse_levels[0].step.smooth_carry for coarse_levels in ladders if coarse_levels]
        self._lattice = None not in carries
        self._grids = all(isinstance(carry, GridProlongation) for carry in carries)
        self._soft = finest.network.fabric.softness >= _SOFT
        few = _STEPS_SOFT if self._soft else _STEPS
        self._levels = [_Level(finest, steps=_STEPS_SMOOTH if self._lattice or not mend else few)]
        self.leading: dict[Surface, CoarseLevel] = {}
        self._watch_every = _watch_every(finest.network)
        self._memories: Sequence[SubspaceAcceleration] = ()
        self._is_rough = False
        self.stale = False
        ready = {tuple(map(id, level.state.network.pieces)): level for level in there}
        for coarse_levels in zip(*ladders, strict=True):
            networks = [rung.network for rung in coarse_levels]
            coarse = ready.get(tuple(map(id, networks)))
            if coarse is not None:
                coarse.steps = few
            else:
                start = (
                    coarse_levels[0].layout
                    if len(coarse_levels) == 1
                    else np.concatenate([rung.layout for rung in coarse_levels])
                )
                coarse = _Level(Relaxation(join_networks(networks), finest.options, start=start), steps=few)
            fine = self._levels[-1]
            if fine.way is None:
                fine.way = self._way(fine.state, [rung.step for rung in coarse_levels], coarse.state)
            self._levels.append(coarse)
        if finest.network.goes_along_lines:
            for level in self._levels:
                _smooth_along_lines(level)
        self.follow()

    def keep(self, finest: Relaxation, pieces: Sequence[int]) -> Levels:
        """Those of some of the pieces, which `finest` is of."""
        kept = Levels.__new__(Levels)
        kept._join(finest, [self._ladders[piece] for piece in pieces], mend=self._mend)
        kept.stale = self.stale
        return kept

    @property
    def coarse_levels(self) -> dict[Surface, CoarseLevel]:
        """The levels of all pieces but the finest, by their surfaces, and those that lead to them."""
        return self.leading | {rung.step.surface: rung for coarse_levels in self._ladders for rung in coarse_levels}

    @property
    def sizes(self) -> list[int]:
        """Vertices of each level, finest first."""
        return [level.state.network.vertex_count for level in self._levels]

    @staticmethod
    def _way(fine: Relaxation, steps: Sequence[Coarser], coarse: Relaxation) -> _Way:
        device, n, c = coarse.network.device, fine.network.vertex_count, coarse.network.vertex_count
        first = range_offsets([net.vertex_count for net in fine.network.pieces])
        ids = [step.kept + at if at else step.kept for step, at in zip(steps, first, strict=False)]
        kept = wp.array(ids[0] if len(ids) == 1 else np.concatenate(ids), dtype=wp.int32, device=device, copy=False)
        prolongation = _weights([step.prolongation for step in steps], device)
        transpose = _transpose([step.transfer.transpose for step in steps], device)
        base, correction = wp.empty(n, dtype=wp.vec2d, device=device), fine.spare
        difference = wp.empty(c, dtype=wp.vec2d, device=device)
        return _Way(
            coarse=coarse,
            down=record(inject, dim=c, inputs=[kept, fine.position], outputs=[coarse.position], device=device),
            load=record(
                coarse_load,
                dim=c,
                inputs=[prolongation, transpose, fine.force, coarse.force],
                outputs=[coarse.load],
                device=device,
            ),
            differ=record(
                coarse_difference, dim=c, inputs=[kept, base, coarse.position], outputs=[difference], device=device
            ),
            up=record(transfer, dim=n, inputs=[prolongation, difference], outputs=[correction], device=device),
            carry=record(
                transfer, dim=n, inputs=[prolongation, coarse.position], outputs=[fine.position], device=device
            ),
            base=base,
            correction=correction,
            steps=steps,
        )

    # --- the parts of a cycle

    def _count(self, level: int, units: float) -> None:
        finest = self._levels[0].state
        finest.work_units += units * self._levels[level].state.network.vertex_count / finest.network.vertex_count

    def smooth(
        self,
        level: int,
        each_step: Callable[[], None] | None = None,
        *,
        evaluated: bool = False,
        steps: int | None = None,
    ) -> FloatArray:
        """Some steps from rest, as many as are usual on the level, or so many; `evaluated` says that the forces there have just been
        evaluated. In a soft cloth on a lattice the last goes along its lines. Returns #P, the energy that they have led to [J]."""
        state, steps = self._levels[level].state, self._levels[level].steps if steps is None else steps
        state.velocity.zero_()
        go = state.sweep if self._soft else state.smooth
        go(steps, each_step, watch_every=self._watch_every, evaluated=evaluated)
        self._count(level, steps)
        if not self._levels[level].lines:
            return self._objective(level)
        energy = self._step_along_lines(level)
        if each_step is not None:
            each_step()
        return energy

    def _step_along_lines(self, level: int) -> FloatArray:
        """One step along the lines, or a half, a quarter ... of it, so that the energy is not higher; returns that, #P [J]."""
        state, before = self._levels[level].state, self._objective(level)
        state.step_along_lines()
        self._count(level, LINE_WORK)
        energy = self._objective(level)
        higher = ~(energy <= before)
        if higher.any():
            _put_way(state, state.anchor, state.spare)
            energy = np.where(higher, self._go(level, state.anchor, state.spare, before, higher, most=0.5), energy)
        return energy

    def _settle(self, share: float, little: float = 0.0) -> FloatArray:
        """Relax the coarsest level until the forces of each piece have come down to a share of what they were, or steps take no more
        than a little share of what all have taken of its energy."""
        last = len(self._levels) - 1
        state, memories = self._levels[last].state, [SubspaceAcceleration() for _ in self._ladders]
        state.evaluate_at_rest()

        aim, most = share * state.pieces.force_sizes(), max(net.vertex_count for net in state.network.pieces)
        first = before = now = self._objective(last)
        leaping, lines = not self._grids and (self._lattice or not little), self._levels[last].lines
        steps = self._levels[last].steps if lines else _BOTTOM_STEPS
        if leaping:
            _begin(state, memories, state.pieces.mark_with_load())
        for number in range(1, 1 + math.ceil(_MOST_BOTTOM_STEPS * math.sqrt(most) / _BOTTOM_STEPS)):
            state.sweep(steps, watch_every=self._watch_every)
            self._count(last, steps)
            now = self._step_along_lines(last) if lines else self._objective(last)
            if leaping and number % _LEAP_EVERY == 0 and np.isfinite(now).all():
                state.evaluate_at_rest()
                _come_to(state, memories, state.pieces.mark_with_load())
                now = self._leap(last, memories, now)
                state.evaluate_at_rest()
                _begin(state, memories, state.pieces.mark_with_load())
            with np.errstate(invalid="ignore"):  # infinite, with mirrored cells
                slow = before - now < little * (first - now)
            if ((state.pieces.force_sizes() <= aim) | slow).all():
                break
            before = now
        return now

    def _objective(self, level: int) -> FloatArray:
        """Of each piece [J]."""
        self._count(level, ENERGY_WORK)
        state = self._levels[level].state
        return np.asarray(state.potentials().sum(axis=1) - state.work_of_load())

    def cycle(self, level: int, each_step: Callable[[], None] | None = None, *, brief: bool = False) -> FloatArray:
        """One cycle from this level down and up again; on the finest one its forces must have been evaluated, and their work counted. If
        it is `brief`, steps alone on the first small level.

        Returns:
            #P, energy at the end [J].
        """
        state, way = self._levels[level].state, self._levels[level].way
        if brief and level and state.network.vertex_count <= _FEW * len(self._ladders):
            return self.smooth(level, steps=_STEPS_INSTEAD)
        if way is None:
            return self._settle(_AT_REST, _LITTLE_GAIN)
        first, self._is_rough = level == 0 and self._is_rough, level > 0 and self._is_rough
        before = self.smooth(level, each_step, evaluated=level == 0, steps=_STEPS_FIRST[0] if first else None)
        if level == 0:
            self._count(level, -FORCE_WORK)
        state.evaluate_at_rest()
        self._count(level, FORCE_WORK)
        if level == 0 and self._memories:
            _come_to(state, self._memories, state.pieces.mark())
        way.down.launch()
        way.coarse.load.zero_()
        way.coarse.evaluate_at_rest()
        self._count(level + 1, FORCE_WORK)
        mirrored = way.coarse.mirrored_pieces()
        self.stale = self.stale or bool(mirrored.any())
        if mirrored.all():
            return self.smooth(level, each_step)
        way.load.launch()
        self.cycle(level + 1, brief=brief)
        self._correct(level, way)
        if level == 0 and self._memories:
            _come_to(state, self._memories, state.pieces.mark())
        steps = _STEPS_FIRST[1] if first else _STEPS_AFTER if brief and level == 0 else None
        energy = self.smooth(level, each_step, evaluated=True, steps=steps)
        higher = ~(energy <= before)
        if higher.any():
            _put_way(state, way.base, way.correction)
            energy = np.where(higher, self._go(level, way.base, way.correction, before, higher, most=0.5), energy)
        return energy

    def _correct(self, level: int, way: _Way) -> None:
        """Add the coarse level's correction, or a half, a quarter ... of it, so that no cell is mirrored; all cells are looked at there."""
        state = self._levels[level].state
        self._carry_correction(state, way)
        turned, share = np.ones(len(state.vertices), dtype=bool), 1.0
        while turned.any():
            state.move(way.base, way.correction, share, turned)
            state.evaluate_at_rest()
            turned &= state.mirrored_pieces() & (share > 0.0)
            share = 0.5 * share if share > _LEAST_SHARE else 0.0
            if turned.any():
                self._count(level, FORCE_WORK)
                way.up.launch()

    @staticmethod
    def _carry_correction(state: Relaxation, way: _Way) -> None:
        wp.copy(way.base, state.position)
        way.differ.launch()
        way.up.launch()

    def _go(
        self,
        level: int,
        base: wp.array,
        by: wp.array,
        before: FloatArray,
        which: BoolArray,
        *,
        most: float = 1.0,
        least: float = _LEAST_SHARE,
    ) -> FloatArray:
        """Let these pieces (#P) go from `base` by the most of a way (#V vec2d [m]), or by a half, a quarter ... of that down to the least,
        so that their energy is not above what it was `before` (#P [J]); or else back to `base`, where it is that.

        Returns:
            #P, their energy where they are [J].
        """
        # Energies are measured on the way, but no forces: those would overwrite what is spare.
        state, share, energy = self._levels[level].state, most, before
        while which.any():
            state.move(base, by, share, which)
            if share == 0.0:
                break
            now = self._objective(level)
            energy = np.where(which & (now <= before), now, energy)
            which = which & ~(now <= before)
            share = 0.5 * share if share > least else 0.0
        return energy

    def remember(self, memories: Sequence[SubspaceAcceleration]) -> None:
        """A cycle on the finest level begins here, to be remembered; `memories` are of each piece."""
        self._memories = memories
        _begin(self._levels[0].state, memories, self._levels[0].state.pieces.mark())

    def leap(self, energy: FloatArray) -> None:
        """Go on from where a cycle on the finest level has led, to where this one and those before say that the energy is least, as far as
        it is lower there; between triangles not on from the first, most of whose way was rough. energy: #P, at its end [J]."""
        if not self._lattice and not any(memory.past for memory in self._memories):
            return
        state = self._levels[0].state
        self._count(0, FORCE_WORK)
        state.evaluate_at_rest()
        _come_to(state, self._memories, state.pieces.mark())
        self._leap(0, self._memories, energy)

    def _leap(self, level: int, memories: Sequence[SubspaceAcceleration], energy: FloatArray) -> FloatArray:
        """The same on any level; returns #P, the energy where that leads to [J]."""
        state, between = self._levels[level].state, self._levels[level].way
        leapt = _put_lowest(state, memories)
        # The cycle is over, and needs its own no more.
        base = wp.empty_like(state.position) if between is None else between.base
        wp.copy(base, state.position)
        return self._go(level, base, state.spare, energy, leapt, least=_LEAST_OF_LEAP)

    def follow(self) -> None:
        """Let the matrices of a membrane's steps bound its stiffness in the present layouts."""
        for level in self._levels:
            if level.state.matrix is not None:
                level.state.matrix.follow(level.state.position)

    def rise(self) -> None:
        """Nested iteration: relax the coarsest level, and move each finer one as far as it went; the finest is not cycled yet."""
        last = len(self._levels) - 1
        for level in self._levels[1:]:
            level.state.load.zero_()
        self._settle(_AT_REST_FIRST)
        for number in range(last - 1, -1, -1):
            self._rise_to(number)
            way = self._levels[number].way
            assert way is not None
            sizes = [net.vertex_count for net in self._levels[number].state.network.pieces]
            if number and any(size > len(step.kept) for size, step in zip(sizes, way.steps, strict=True)):
                self.cycle(number, brief=self._rises_smoothly)
        self._is_rough = not (self._lattice or self._soft)

    @property
    def _rises_smoothly(self) -> bool:
        """Whether each level starts so near to its rest that only what is rough is left."""
        return self._grids and self._levels[0].state.network.is_stiff

    def start(self) -> None:
        """`rise`, and a cycle on the finest level; two of them, each with its leap, where steps go along lines: in such a cloth more is
        left, and cycles take more of it away."""
        self.rise()
        finest = self._levels[0]
        memories = [SubspaceAcceleration() for _ in self._ladders]
        for _ in range(_CYCLES_ALONG_LINES if finest.lines else 1):
            finest.state.evaluate_at_rest()
            self._count(0, FORCE_WORK)
            if not finest.lines:
                self.cycle(0, brief=self._rises_smoothly)
                continue
            self.remember(memories)
            self.leap(self.cycle(0))

    def _rise_to(self, level: int) -> None:
        """Start a level where the coarser one ended, or else moved as far as it went: the former is smoother, the latter keeps
        what only the finer mesh has. Where neither lowers the energy, it stays where it is."""
        state, way = self._levels[level].state, self._levels[level].way
        assert way is not None
        before, energy = state.positions(), self._objective(level)
        smooth = [step.smooth_carry for step in way.steps]
        if None in smooth:
            way.carry.launch()
        layout, coarse = state.positions(), way.coarse.positions()
        for carry, own, of in zip(smooth, state.vertices, way.coarse.vertices, strict=True):
            if carry is not None:
                layout[own] = carry(coarse[of])
        state.position.assign(layout)
        carried = self._objective(level)
        turned = np.flatnonzero(np.isinf(carried))
        if len(turned):
            # Turned faces, the odd one at a border, say.
            left = np.zeros(len(carried), dtype=bool)
            for piece in turned.tolist():
                own = state.vertices[piece]
                layout[own], left[piece] = untangle(state.network.pieces[piece].surface, layout[own])
            state.position.assign(layout)
            carried = np.where(left, math.inf, self._objective(level))
        lower = carried < energy
        if not lower.all():
            for piece in np.flatnonzero(~lower).tolist():
                own = state.vertices[piece]
                layout[own] = before[own]
            state.position.assign(layout)
            self._carry_correction(state, way)
            self._go(level, way.base, way.correction, energy, ~lower)


def _smooth_along_lines(level: _Level) -> None:
    """Let the last steps go along lines, where there are any; two less, if these are everywhere."""
    network = level.state.network
    level.lines = network.line_arrays is not None
    if all(piece.line_arrays is not None for piece in network.pieces):
        level.steps = _STEPS_SMOOTH


def _begin(state: Relaxation, memories: Sequence[SubspaceAcceleration], mark: Mark) -> None:
    """Of all pieces."""
    for memory, own in zip(memories, state.vertices, strict=True):
        memory.begin((mark[0][own], mark[1][own]))


def _come_to(state: Relaxation, memories: Sequence[SubspaceAcceleration], mark: Mark) -> None:
    for memory, own in zip(memories, state.vertices, strict=True):
        memory.come_to((mark[0][own], mark[1][own]))


def _put_lowest(state: Relaxation, memories: Sequence[SubspaceAcceleration]) -> BoolArray:
    """Put the ways to where the energy is least where there is room; #P, whether that could be told."""
    room = state.pieces.room()
    return np.array([memory.lowest(room[own]) for memory, own in zip(memories, state.vertices, strict=True)])


def _put_way(state: Relaxation, base: wp.array, way: wp.array) -> None:
    """How it has come from a layout to where it is."""
    launch_each(subtract, len(way), [state.position, base], [way], device=state.network.device)


def _watch_every(network: SpringNetwork) -> int:
    return int(min(max(_WATCH_SOFT / math.sqrt(network.fabric.softness), 1.0), _WATCH_EVERY))
