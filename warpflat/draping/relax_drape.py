"""The sewn cloth comes to rest on the body: minimisation over a sparse factor, and dynamic relaxation.

L-BFGS over the factor of a stiffness (`warpflat.draping.drape_energy`) moves the garment as a whole near to rest: what would
swing for ten thousand explicit steps takes some dozens. It leaves local forces behind, where cloth wrinkles as fine as the
mesh and no step may be long. Dynamic relaxation takes these away. What it does not halve is slow, and a few steps of L-BFGS
follow. Cloth that lies on the body is left to dynamic relaxation.

Each step of dynamic relaxation gathers the forces at every vertex, lets the body and its friction act on them, and moves the
vertex by its velocity. Masses are fictitious: the sums of the stiffness around each vertex, so that any step is stable. The body is one
plane per vertex, renewed every ten steps. The cloth is at rest by its forces, never by its velocities.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import warp as wp

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.core.launch import Sequence, record
from warpflat.draping.body import Body
from warpflat.draping.drape_energy import DrapeEnergy
from warpflat.draping.options import DrapeOptions
from warpflat.draping.sewn_cloth import SewnCloth
from warpflat.kernels.drape import advance_drape, watch_power
from warpflat.kernels.reduce import sum_blocks
from warpflat.solver.quasi_newton import Descent

__all__ = ["DrapedCloth", "relax_drape"]

# Steps for which the body's planes hold, and after which the forces are looked at.
_STEPS_PER_PLANE = 10
_STEPS_PER_CHECK = 100
# Fictitious mass over the sum of the stiffness around a vertex. A quarter is the limit of stability at small strains;
# at 1 wrinkled cloth on a bodice keeps chattering, at 2 it comes to rest.
_MASS_SCALE = 2.0
# No vertex may have more force left than so many times the mean that is allowed.
_WORST = 100.0
# Cloth hangs, and swings, where a larger share of its vertices is farther from the body than this [m]. Dynamic relaxation alone
# brings cloth that lies on a body to rest in half of the time.
_FREE, _HANGING_SHARE = 0.01, 0.2
# Rounds of the minimisation at the start, and steps in each. A round that releases less than this share of all is the last.
_MOST_ROUNDS, _STEPS_PER_ROUND, _SMALL_RELEASE = 6, 60, 0.005
# Tension that is added to the factor [N/m], and by how much it falls from round to round. Cloth without tension has next to no
# stiffness across its plane: steps would be too long there.
_PULL, _PULL_FALLS = 20.0, 0.6
# After so many steps of dynamic relaxation that have not halved the residual, so many of L-BFGS over a factor with little tension.
_STEPS_PER_LOOK, _STEPS_PER_CORRECTION, _SMALL_PULL = 300, 6, 0.3
_BLOCKS = 64


@dataclass(frozen=True, kw_only=True, eq=False)
class DrapedCloth:
    """Cloth on a body.

    Attributes:
        positions: #V by 3 [m].
        pressing: #V, normal force on the body [N].
        residual: mean force that is left over a vertex's mean weight.
        converged: whether the cloth is at rest.
        steps: that were taken.
        seconds: wall clock.
    """

    positions: FloatArray
    pressing: FloatArray
    residual: float
    converged: bool
    steps: int
    seconds: float


class _DynamicRelaxation:
    """Steps with fictitious masses, on the arrays of an energy."""

    def __init__(self, cloth: SewnCloth, energy: DrapeEnergy) -> None:
        self._energy, device, count = energy, energy.device, len(cloth.designed)
        self.pressing, self._power, self._residual = (wp.zeros(count, wp.float64, device) for _ in range(3))
        energy.motion.mass = wp.array(_MASS_SCALE * _stiffness_sums(cloth), dtype=wp.float64, device=device)
        halted, blocks = wp.zeros(1, wp.int32, device), min(_BLOCKS, count)
        begin = wp.array(np.linspace(0, count, blocks + 1), dtype=wp.int32, device=device)
        sums = wp.zeros(blocks, wp.float64, device)
        inputs = [energy.motion, energy.contact, *energy.forces_of, halted]
        outputs = [self._power, self._residual, self.pressing]
        step = [
            *energy.evaluate_cells,
            record(advance_drape, dim=count, inputs=inputs, outputs=outputs, least=256, device=device),
            record(sum_blocks, dim=blocks, inputs=[self._power, begin], outputs=[sums], device=device),
            record(watch_power, dim=1, inputs=[sums], outputs=[halted], device=device),
        ]
        self._round = Sequence([*energy.planes, *(step * _STEPS_PER_PLANE)])
        self._keep = sums

    def run(self, steps: int) -> None:
        """Take steps from the present places."""
        for _ in range(steps // _STEPS_PER_PLANE):
            self._round.launch()

    def check(self) -> tuple[float, float]:
        """Return the mean and the largest force that was left before the last step, over the mean weight of a vertex."""
        left, mean = self._residual.numpy(), float(self._energy.weight.mean())
        return float(left.mean()) / mean, float(left.max()) / mean


def _stiffness_sums(cloth: SewnCloth) -> FloatArray:
    """Return #V, bounds of the sums of the stiffness around each vertex [N/m], by Gershgorin's discs."""
    fabric, (corner, _, gradient, area), (laplacian, stiffness) = cloth.fabric, cloth.cells(), cloth.laplacian()
    along = np.stack([-(gradient[:, :2] + gradient[:, 2:]), gradient[:, :2], gradient[:, 2:]], axis=1)
    size = np.abs(along)
    total = size.sum(axis=1, keepdims=True)
    steepest = []
    for direction in ("warp", "weft"):
        points = np.array([(0.0, 0.0), *getattr(fabric, f"curve_{direction}")])
        slopes = np.diff(points[:, 1]) / np.diff(points[:, 0])
        steepest.append(max(getattr(fabric, f"stiffness_{direction}"), *slopes.tolist(), 0.0))
    share = 1.0 / (1.0 - fabric.poisson_ratio**2 * fabric.stiffness_weft / fabric.stiffness_warp)
    k = share * (1.0 + fabric.poisson_ratio) * np.array(steepest) + 2.0 * fabric.shear_stiffness
    own = (size * total) @ k
    own += fabric.shear_stiffness * (size * total[:, :, ::-1]).sum(axis=2)
    sums = np.bincount(corner.ravel(), (own * area[:, None]).ravel(), minlength=len(cloth.designed))
    entries = abs(laplacian)
    return np.asarray(sums + entries @ (stiffness * entries.sum(axis=1)))


def relax_drape(
    cloth: SewnCloth,
    body: Body | None,
    *,
    options: DrapeOptions | None = None,
    held: BoolArray | None = None,
    start: FloatArray | None = None,
    callback: Callable[[int, float], None] | None = None,
    observer: Callable[[FloatArray], None] | None = None,
) -> DrapedCloth:
    """Let the cloth come to rest on a body.

    Args:
        cloth: the sewn cloth.
        body: on whose device it is draped; None for cloth that hangs freely, on the CPU.
        options: friction, tolerance and limits.
        held: #V, vertices that do not move.
        start: #V by 3 [m]; the designed surface if not given.
        callback: called with the number of steps and the residual at every check.
        observer: called with the places (#V by 3 [m]) at the start and at every check.

    Returns:
        the cloth; `converged` is False if it met the step limit before it was at rest.
    """
    began, options = time.perf_counter(), options or DrapeOptions()
    start = cloth.designed if start is None else start
    energy = DrapeEnergy(cloth, body, options, np.zeros(len(start), bool) if held is None else held)
    relaxation = _DynamicRelaxation(cloth, energy)
    hangs = body is None or float(np.mean(body.gaps(start) > _FREE)) > _HANGING_SHARE
    energy.motion.position.assign(_minimise(energy, start) if hangs else start)
    observe = observer or (lambda _: None)
    observe(start)
    steps, residual, before, converged = 0, np.inf, np.inf, False
    while steps < options.max_steps and not converged:
        relaxation.run(_STEPS_PER_CHECK)
        steps += _STEPS_PER_CHECK
        residual, worst = relaxation.check()
        observe(energy.motion.position.numpy())
        converged = steps > _STEPS_PER_CHECK and residual <= options.tolerance and worst <= _WORST * options.tolerance
        if callback is not None:
            callback(steps, residual)
        if hangs and not converged and steps < options.max_steps and steps % _STEPS_PER_LOOK == 0:
            if residual > 0.5 * before:
                _correct(energy)
            before = residual
    return DrapedCloth(
        positions=energy.motion.position.numpy().copy(), pressing=relaxation.pressing.numpy().copy(),
        residual=residual, converged=converged, steps=steps,
        seconds=time.perf_counter() - began,
    )  # fmt: skip


def _minimise(energy: DrapeEnergy, start: FloatArray) -> FloatArray:
    """Minimise the energy coarsely by rounds of L-BFGS, each with planes and a factor of its own.

    Args:
        energy: of the cloth.
        start: #V by 3 [m].

    Returns:
        #V by 3, places [m] from where the next round would release little.
    """
    x, released, gain = start, 0.0, np.inf
    for number in range(_MOST_ROUNDS):
        energy.renew_contact(x, sticking=number == 0)
        energy.factor(x, _PULL * _PULL_FALLS**number)
        descent = Descent(energy, energy.at(x))
        for _ in range(_STEPS_PER_ROUND):
            if not descent.step():
                break
        x, gain = descent.point.positions, descent.history[0] - descent.point.energy
        released += gain
        if gain <= _SMALL_RELEASE * released:
            break
    return x


def _correct(energy: DrapeEnergy) -> None:
    """Move what is slow, as the swing of a skirt, by a few steps of L-BFGS; what is quick is left to dynamic relaxation."""
    x = energy.motion.position.numpy().copy()
    energy.renew_contact(x)
    energy.factor(x, _SMALL_PULL)
    descent = Descent(energy, energy.at(x))
    for _ in range(_STEPS_PER_CORRECTION):
        if not descent.step():
            break
    energy.motion.position.assign(descent.point.positions)
    energy.motion.velocity.zero_()
