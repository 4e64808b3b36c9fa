"""Multilevel relaxation: the approximate implicit steps smooth, coarser meshes of the same piece carry what is far.

A step tells each vertex of its neighbours only, so that the number of steps grows with the number of vertices. Here each level is a
spring network of its own, with the same fabric, guard and steps, on a quarter of the vertices of the next finer one
(`warpflat.coarsen`). A cycle (full approximation scheme, Brandt 1977; Brandt and Livne 2011):

1. a few steps from rest on the fine level;
2. the coarse level starts where its vertices are, under the load that gives it the fine level's residual forces there;
3. the same on the coarse level, down to the coarsest, which is relaxed by steps;
4. the way the coarse vertices have gone is carried up, as far as it lowers the fine energy and mirrors no face;
5. a few steps from rest again.

Nested iteration gives the start: the coarsest level is relaxed first, and each finer one is moved as far as the coarser
went. The minimum is that of the fine level alone, and what says that it is reached is what `relax` asks for, with a step's
work as the unit.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import warp as wp
from numpy.typing import NDArray
from scipy.sparse import csr_array

from warpflat.carry import GridCarry
from warpflat.coarsen import Coarser, coarser, coarser_surfaces, is_coarsest
from warpflat.fabric import Fabric
from warpflat.kernels.transfer import Weights, coarse_difference, coarse_load, inject, transfer
from warpflat.launching import Launch, record
from warpflat.network import SpringNetwork
from warpflat.relax import Outcome, Relaxation, RelaxOptions, Watch, relax
from warpflat.surface.untangle import untangle

__all__ = ["Levels", "levels_pay", "relax_multilevel", "softness"]

FloatArray = NDArray[np.float64]

# The coarsest is relaxed by so many steps at a time until its forces have come down to this share of what they were, in a cycle and at
# the very first, or so many times the vertices along its side: a crack that opens is slow there too.
_BOTTOM_STEPS = 8
_AT_REST = 0.1
_AT_REST_FIRST = 1e-3
_MOST_BOTTOM_STEPS = 24.0
# Grids of more vertices are not cycled on the way up: cubics from this size on leave a few hundredths of a per cent.
_CYCLED = int(__import__("os").environ.get("CYC", 5_000))
# Steps before and after, at least, and at most where cycles gain little: after one that gains more than this share of what the one
# before gained, they are twice as many.
_LEAST_STEPS = 4
_MOST_STEPS = 256
_VERY_SLOW = 0.6
# From this share on, cycles are followed by a leap, from what is remembered of so many of them.
_SLOW = 0.05
_DEPTH = 6
# K/G from which coarse triangles are of little use; likewise on a piece of more than so many vertices.
_SOFT = 35.0
_MANY = 2_000
_SOFT_OF_MANY = 100.0
# How often levels are made anew, since the piece has come far from where they were made.
_RENEWALS = 8
# Of a correction, the least share that is tried.
_LEAST_SHARE = 0.05
# Steps between two looks at all cells.
_WATCH_EVERY = 4
# Least curvature, over what its parts would have apart, of a direction that cycles leave to be followed.
_SOUND = 1e-3
# In units of a step: evaluating the forces, evaluating the energy.
_FORCE_WORK = 1.0
_ENERGY_WORK = 0.5


@dataclass(frozen=True, kw_only=True)
class _Way:
    """The way from a level to the next coarser one and back.

    Attributes:
        coarse: the coarser level.
        down: its vertices go where they are on the finer one. load: it gets the finer one's residual forces.
        differ: how far it has come from `base`, #V of the finer level. up: that, as `correction` of the finer level.
        carry: its layout, as that of the finer level.
    """

    coarse: Relaxation
    down: Launch
    load: Launch
    differ: Launch
    up: Launch
    carry: Launch
    base: wp.array
    correction: wp.array
    smooth_carry: GridCarry | None


@dataclass
class _Level:
    """A level, and its way down, but for the coarsest."""

    state: Relaxation
    way: _Way | None = None


def _weights(matrix: csr_array, device: wp.Device) -> Weights:
    weights = Weights()
    weights.offset = wp.array(matrix.indptr.astype(np.int32), dtype=wp.int32, device=device)
    weights.column = wp.array(matrix.indices.astype(np.int32), dtype=wp.int32, device=device)
    weights.weight = wp.array(matrix.data.astype(np.float64), dtype=wp.float64, device=device)
    return weights


def _strain_fields(network: SpringNetwork, layout: FloatArray) -> tuple[FloatArray, FloatArray]:
    """#S, k L^2 of the springs, and 3 by #S, c^4, s^4 and c^2 s^2 of their directions: what each stores of uniform strains."""
    s = network.spring_arrays
    d = layout[s.ends[:, 1]] - layout[s.ends[:, 0]]
    c2 = d[:, 0] ** 2 / np.maximum(np.einsum("ij,ij->i", d, d), 1e-300)
    return s.stiffness * s.rest_length**2, np.stack([c2 * c2, (1.0 - c2) ** 2, c2 * (1.0 - c2)])


def _calibrated(
    network: SpringNetwork, layout: FloatArray, fine: SpringNetwork, fine_layout: FloatArray
) -> SpringNetwork:
    """The coarse network with its springs weighed by their directions, so that under uniform strains it stores what the fine one
    does: edge springs on triangles store that only roughly, each mesh in its own way."""
    if network.model != "springs" or network.surface.is_quad.all():
        return network
    energy, fields = _strain_fields(fine, fine_layout)
    wished = fields @ energy
    energy, fields = _strain_fields(network, layout)
    factor = np.linalg.lstsq((fields * energy) @ fields.T, wished, rcond=1e-6)[0]
    s = network.spring_arrays
    return replace(network, spring_arrays=replace(s, stiffness=np.clip(factor @ fields, 0.1, 10.0) * s.stiffness))


class Levels:
    """The levels of a piece, finest first; made once, and good for any number of relaxations of the same network.

    Attributes:
        sizes: vertices of each level.
        stale: a coarse level had mirrored cells where the finer one had come to; make the levels anew there.
    """

    def __init__(self, finest: Relaxation) -> None:
        """Of a relaxation and its present layout, which must mirror no face."""
        self._levels = [_Level(finest)]
        self.stale = False
        layout = finest.positions()
        # Those that the surface has anyway, as far as they are not mirrored where it lies; and beyond, some that are not.
        ready = iter(coarser_surfaces(finest.network.surface))
        while not is_coarsest(self._levels[-1].state.network.surface):
            step = next(ready, None)
            if step is None or not self._go_down(step, layout):
                ready = iter(())
                step = coarser(self._levels[-1].state.network.surface, layout)
                if step is None or not self._go_down(step, layout):
                    break
            layout = layout[step.kept]

    def _go_down(self, step: Coarser, layout: FloatArray) -> bool:
        """Add a level, unless some of its cells are mirrored where it lies."""
        fine = self._levels[-1]
        coarse = self._coarse(fine.state, step, layout)
        coarse.evaluate_at_rest()
        if coarse.mirrored_cells():
            return False
        fine.way = self._way(fine.state, step, coarse)
        self._levels.append(_Level(coarse))
        return True

    @property
    def sizes(self) -> list[int]:
        """Vertices of each level, finest first."""
        return [level.state.network.vertex_count for level in self._levels]

    @staticmethod
    def _coarse(fine: Relaxation, step: Coarser, fine_layout: FloatArray) -> Relaxation:
        net, layout = fine.network, fine_layout[step.kept]
        network = SpringNetwork.build(
            step.surface,
            net.fabric,
            layout,
            grain_angle=net.grain_angle,
            device=net.device,
            model=net.model,
            stretch=None if net.stretch is None else net.stretch[step.face_of],
        )
        network = _calibrated(network, layout, net, fine_layout)
        # What threads are held by is a matter of the finest mesh.
        network.guard = net.guard
        return Relaxation(network, fine.options, start=layout)

    @staticmethod
    def _way(fine: Relaxation, step: Coarser, coarse: Relaxation) -> _Way:
        device, n, c = coarse.network.device, fine.network.vertex_count, coarse.network.vertex_count
        kept = wp.array(step.kept, dtype=wp.int32, device=device)
        prolongation = _weights(step.prolongation, device)
        restriction = _weights(step.restriction, device)
        base, correction = (wp.zeros(n, dtype=wp.vec2d, device=device) for _ in range(2))
        difference = wp.zeros(c, dtype=wp.vec2d, device=device)
        return _Way(
            coarse=coarse,
            down=record(inject, dim=c, inputs=[kept, fine.position], outputs=[coarse.position], device=device),
            load=record(
                coarse_load, dim=c, inputs=[restriction, fine.force, coarse.force], outputs=[coarse.load], device=device
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
            smooth_carry=step.smooth_carry,
        )

    # --- the parts of a cycle

    def _count(self, level: int, units: float) -> None:
        finest = self._levels[0].state
        finest.work_units += units * self._levels[level].state.network.vertex_count / finest.network.vertex_count

    def smooth(self, level: int, steps: int, each_step: Callable[[], None] | None = None) -> None:
        """Some steps from rest."""
        state = self._levels[level].state
        state.velocity.zero_()
        state.sweep(steps, each_step, watch_every=_WATCH_EVERY)
        self._count(level, steps)

    def _settle(self, share: float) -> None:
        """Relax the coarsest level until its forces have come down to a share of what they were."""
        last = len(self._levels) - 1
        state = self._levels[last].state
        state.evaluate_at_rest()
        aim = share * float(np.linalg.norm(state.force.numpy()))
        for _ in range(math.ceil(_MOST_BOTTOM_STEPS * math.sqrt(self.sizes[last]) / _BOTTOM_STEPS)):
            state.sweep(_BOTTOM_STEPS, watch_every=_WATCH_EVERY)
            self._count(last, _BOTTOM_STEPS)
            if float(np.linalg.norm(state.force.numpy())) <= aim:
                break

    def _objective(self, level: int) -> float:
        self._count(level, _ENERGY_WORK)
        state = self._levels[level].state
        return sum(state.potential()) - state.work_of_load()

    def cycle(self, level: int, steps: int, each_step: Callable[[], None] | None = None) -> None:
        """One cycle from this level down and up again."""
        state, way = self._levels[level].state, self._levels[level].way
        if way is None:
            self._settle(_AT_REST)
            return
        self.smooth(level, steps, each_step)
        state.evaluate_at_rest()
        self._count(level, _FORCE_WORK)
        way.down.launch()
        way.coarse.load.zero_()
        way.coarse.evaluate_at_rest()
        self._count(level + 1, _FORCE_WORK)
        if way.coarse.mirrored_cells():
            self.stale = True
        else:
            way.load.launch()
            self.cycle(level + 1, steps)
            self._correct(level, way)
        self.smooth(level, steps, each_step)

    def _correct(self, level: int, way: _Way) -> None:
        """Add the coarse level's correction, or a half, a quarter ... of it, so that the energy does not rise."""
        state = self._levels[level].state
        before = self._objective(level)
        wp.copy(way.base, state.position)
        way.differ.launch()
        way.up.launch()
        share = 1.0
        while share > _LEAST_SHARE:
            state.move(way.base, way.correction, share)
            if self._objective(level) <= before:
                return
            share *= 0.5
        wp.copy(state.position, way.base)

    def leap(self, memory: CycleMemory, begin: FloatArray, force: FloatArray) -> None:
        """Go on from where a cycle on the finest level has led to where the cycles before say that the energy is least, if it is lower
        there.

        Args:
            memory: of the cycles before; gets this one.
            begin: #V by 2, where the cycle began [m].
            force: #V by 2, of the cloth there [N].
        """
        state = self._levels[0].state
        end = state.positions()
        energy = self._objective(0)
        self._count(0, _FORCE_WORK)
        further = memory.lowest(begin, force, end, state.forces())
        if further is not None:
            state.position.assign(further)
            if not self._objective(0) < energy:
                state.position.assign(end)

    def follow(self) -> None:
        """Let the matrices of a membrane's steps bound its stiffness in the present layouts."""
        for level in self._levels:
            if level.state.matrix is not None:
                level.state.matrix.follow(level.state.position)

    def rise(self, steps: int) -> None:
        """Nested iteration: relax the coarsest level, and move each finer one as far as it went; the finest is not cycled yet."""
        last = len(self._levels) - 1
        for level in self._levels[1:]:
            level.state.load.zero_()
        self._settle(_AT_REST_FIRST)
        for number in range(last - 1, -1, -1):
            smooth = self._rise_to(number)
            if number and (self.sizes[number] <= _CYCLED or not smooth):
                self.cycle(number, steps)

    def _rise_to(self, level: int) -> bool:
        """Start a level where the coarser one ended, or else moved as far as it went: the former is smoother, the latter keeps
        what only the finer mesh has. Where neither lowers the energy, it stays where it is.

        Returns:
            Whether it starts where cubics carried it.
        """
        state, way = self._levels[level].state, self._levels[level].way
        assert way is not None
        before, energy = state.positions(), self._objective(level)
        if way.smooth_carry is None:
            way.carry.launch()
        else:
            state.position.assign(way.smooth_carry(way.coarse.positions()))
        carried = self._objective(level)
        if math.isinf(carried):
            # Turned faces, the odd one at a border, say.
            mended, left = untangle(state.network.surface, state.positions())
            state.position.assign(mended)
            carried = math.inf if left else self._objective(level)
        if carried < energy:
            return way.smooth_carry is not None
        state.position.assign(before)
        self._correct(level, way)
        return False


class CycleMemory:
    """The last few cycles: how far they led, and how much the forces fell on the way. In the plane of these ways the energy is known,
    to second order, and least somewhere (locally optimal conjugate gradients; Knyazev 2001).

    A strip beside a crack, say, bent by a coarse level as if it were stiffer or softer than it is, nears its place by the same
    share with each cycle.
    """

    def __init__(self, depth: int) -> None:
        """Of so many cycles."""
        self._depth = depth
        self._ways: list[FloatArray] = []
        self._falls: list[FloatArray] = []

    def lowest(self, begin: FloatArray, force: FloatArray, end: FloatArray, left: FloatArray) -> FloatArray | None:
        """#V by 2, where the energy is least [m]; None where that cannot be told.

        Args:
            begin, end: #V by 2, of the last cycle [m].
            force, left: #V by 2, forces at its begin and end [N].
        """
        self._ways.append((end - begin).ravel())
        self._falls.append((force - left).ravel())
        del self._ways[: -self._depth], self._falls[: -self._depth]
        ways = np.stack(self._ways)
        curvature = ways @ np.stack(self._falls).T
        curvature = 0.5 * (curvature + curvature.T)
        size = np.sqrt(np.abs(np.diag(curvature)))
        if not (size > 0.0).all():
            return None
        values, axes = np.linalg.eigh(curvature / np.outer(size, size))
        sound = values > _SOUND
        share = axes[:, sound] @ ((axes[:, sound].T @ (ways @ left.ravel() / size)) / values[sound]) / size
        return end + (share @ ways).reshape(end.shape)


def levels_pay(network: SpringNetwork) -> bool:
    """Whether cycles take less work than plain steps: on grids always; on triangles, of which coarse ones carry less the softer the shear
    is, the more vertices there are."""
    if network.surface.is_quad.all():
        return True
    return softness(network.fabric) < (_SOFT_OF_MANY if network.vertex_count > _MANY else _SOFT)


def softness(fabric: Fabric) -> float:
    """K/G: how much stiffer the fabric is along its threads than in shear."""
    return max(fabric.stiffness_warp, fabric.stiffness_weft) / fabric.shear_stiffness


def first_steps(network: SpringNetwork) -> int:
    """Steps before and after, for a fabric: a soft shear leaves errors along threads that only accelerated steps smooth."""
    return int(min(max(round(1.7 * math.sqrt(softness(network.fabric))), _LEAST_STEPS), 16))


def relax_multilevel(
    state: Relaxation,
    *,
    levels: Levels | None = None,
    nested: bool = True,
    enough: float | None = None,
    watch: Watch | None = None,
    each_step: Watch | None = None,
) -> Outcome:
    """Cycles until the energy and the residual force have come to rest, or the step limit is reached.

    Args:
        state: where to start; holds the relaxed layout afterwards.
        levels: of this state, if they are there already.
        nested: start from the coarsest level; without, cycles begin at the present layout, as after an edit.
        enough: it is over, at rest or not, after a cycle that takes no more than this share of the energy away; if given.
        watch: called after every cycle with the state, its energies and the residual.
        each_step: called after every step on the finest level, with the energies and the residual of the last look.
    """
    options: RelaxOptions = state.options
    begun = time.perf_counter()
    state.hold_upright()
    levels = Levels(state) if levels is None else levels
    if len(levels.sizes) == 1:
        return relax(state, watch=watch, each_step=each_step)
    first, start, renewals = state.steps, state.work_units, 0
    before = state.energies()
    change, residual, gained, slow = math.inf, math.inf, math.inf, False
    steps = first_steps(state.network)

    def look() -> None:
        if each_step is not None:
            each_step(state, before, residual)

    if nested:
        levels.rise(steps)
        state.hold_upright()
        before = state.energies()
        look()
    converged, near, memory = False, False, CycleMemory(_DEPTH)
    state.evaluate_at_rest()
    state.work_units += _FORCE_WORK
    while not converged and state.work_units - start < options.max_steps and not near:
        if levels.stale and renewals < _RENEWALS:
            levels, renewals = Levels(state), renewals + 1
        work = state.work_units
        levels.follow()
        begin, force = state.positions(), state.cloth_force()
        levels.cycle(0, steps, look)
        if slow:
            levels.leap(memory, begin, force)
        state.hold_upright()
        state.evaluate_at_rest()
        now = state.energies()
        state.work_units += _FORCE_WORK + _ENERGY_WORK
        residual = state.residual()
        at_rest = now.potential <= state.negligible_energy
        gain = before.potential - now.potential
        change = 0.0 if at_rest else abs(gain) / ((state.work_units - work) * now.potential)
        converged = change <= options.energy_tolerance and residual <= options.residual_tolerance
        near = enough is not None and gain <= enough * now.potential
        slow = abs(gain) > _SLOW * gained
        if abs(gain) > _VERY_SLOW * gained:
            steps = min(2 * steps, _MOST_STEPS)
        before, gained = now, abs(gain)
        if watch is not None:
            watch(state, now, residual)
    return Outcome(
        converged=converged,
        steps=state.steps - first,
        work_units=state.work_units - start,
        restarts=state.restarts,
        energy_change=change,
        residual=residual,
        energies=before,
        seconds=time.perf_counter() - begun,
    )
