"""The sewn cloth comes to rest on the body: minimisation over a sparse factor, and dynamic relaxation.

Dynamic relaxation brings the cloth out of the body first. Rounds of an augmented Lagrangian follow (Simo and Laursen 1992): each
minimises by L-BFGS over the factor of a stiffness (`draping.drape_energy`), with fewer steps to a factor where rest is near,
with the normal forces and the bounds of friction of the round before; then body and friction take over the forces that they had at its
end, whether the cloth lies a micrometre in the body or beside it. What would swing for ten thousand explicit steps takes some dozens.
Dynamic relaxation says whether the cloth is at rest, and does the rest if it is not.

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

from warpflat.core import BoolArray, FloatArray, Sequence, StepError, record
from warpflat.flat import Descent
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.drape_energy import DrapeEnergy
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.sewn_cloth import SewnCloth
from warpflat.kernels.drape_steps import advance_drape, watch_power
from warpflat.kernels.reduce import sum_blocks

__all__ = ["DrapedCloth", "relax_drape"]

# Steps for which the body's planes hold, and after which the forces are looked at.
_STEPS_PER_PLANE = 10
_STEPS_PER_CHECK = 100
# No vertex may have more force left than so many times the mean that is allowed.
_WORST = 100.0
# Steps of dynamic relaxation at the start: they bring the cloth out of the body and find what it presses on.
_FIRST_STEPS = 300
# No vertex goes farther than this in a round [m]: planes and metric are those of its start.
_LONGEST_ROUND = 0.1
# A garment that is held by nothing and whose top has sunk by this much has left its place on the body [m].
_FALLEN = 0.4
# Rounds of the augmented Lagrangian, after which dynamic relaxation goes on alone, and steps of L-BFGS in each. Fewer steps where rest is
# near let hanging cloth wander: with 8 in place of 40 trousers took 1.8 times as long, a jumpsuit 1.4, leggings 1.5, a shirt as long.
_MOST_ROUNDS, _STEPS_PER_ROUND = 80, 40
# Corrections that L-BFGS remembers; hanging cloth has more soft modes than 8.
_MEMORY = 20
# A round ends when the mean force is at most this share of what is allowed; rest is near at so many times what is allowed.
_ROUND_ENDS, _NEARLY_AT_REST = 0.4, 20.0
# Where the cloth has so much less force left than body and planes bring with each round, these are what lasts.
_CONTACT_LEADS = 0.1
# The rounds end when, on planes found anew, the mean force is at most so many times what is allowed.
_SETTLED = 5.0
# Dynamic relaxation goes on while a hundred steps of it leave less than this share.
_EASES = 0.8
# A round, or a hundred steps, gains if it leaves less than this share of the least force so far. After so many rounds without gain the
# rounds end, and after so many steps of dynamic relaxation beside them the cloth is given up.
_GAINS, _ROUNDS_IN_VAIN, _STEPS_IN_VAIN = 0.95, 30, 3000
_BLOCKS = 64


@dataclass(frozen=True, kw_only=True, eq=False)
class DrapedCloth:
    """Cloth on a body.

    Attributes:
        positions: #V by 3 [m].
        pressing: #V, normal force on the body [N].
        residual: mean force that is left over a vertex's mean weight.
        converged: whether the cloth is at rest.
        fell_off: whether it was given up because nothing on the body holds it.
        stalled: whether it was given up because its forces did not become smaller.
        steps: of dynamic relaxation.
        rounds: of minimisation between them.
        seconds: wall clock.
    """

    positions: FloatArray
    pressing: FloatArray
    residual: float
    converged: bool
    fell_off: bool
    stalled: bool
    steps: int
    rounds: int
    seconds: float

    def check_held(self) -> None:
        """Refuse cloth that has fallen off.

        Raises:
            StepError: it has.
        """
        if self.fell_off:
            raise StepError(
                f"falls off: nothing on the body holds the garment, its top has sunk by over {_FALLEN:g} m, or to the legs; "
                "make it narrower there, or name in [drape] a line that stays: hold = [...]"
            )


class _DynamicRelaxation:
    """Steps with fictitious masses, on the arrays of an energy."""

    def __init__(self, cloth: SewnCloth, energy: DrapeEnergy) -> None:
        self._energy, device, count = energy, energy.device, len(cloth.designed)
        self.pressing, self._power, self._residual = (wp.zeros(count, wp.float64, device) for _ in range(3))
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
        self._energy.renew_layers()
        for _ in range(steps // _STEPS_PER_PLANE):
            self._round.launch()

    def check(self) -> tuple[float, float]:
        """Return the mean and the largest force that was left before the last step, over the mean weight of a vertex."""
        left, mean = self._residual.numpy(), float(self._energy.weight.mean())
        return float(left.mean()) / mean, float(left.max()) / mean


def relax_drape(
    cloth: SewnCloth,
    body: Body | None,
    *,
    options: DrapeOptions | None = None,
    held: BoolArray | None = None,
    start: FloatArray | None = None,
    legs: float = -np.inf,
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
        legs: height below which the body is two legs [m]: what has sunk there from above has lost its hold.
        callback: called with the number of steps and the residual at every check.
        observer: called with the places (#V by 3 [m]) at the start and at every check.

    Returns:
        the cloth; `converged` is False if it met the step limit before it was at rest, was given up, or fell off.
    """
    began, options = time.perf_counter(), options or DrapeOptions()
    start = cloth.designed if start is None else start
    energy = DrapeEnergy(cloth, body, options, np.zeros(len(start), bool) if held is None else held)
    relaxation = _DynamicRelaxation(cloth, energy)
    energy.motion.position.assign(start)
    steps, rounds, residual, left = 0, 0, np.inf, np.inf
    observe = observer or (lambda _: None)
    observe(start)
    top = float(start[:, 1].max())
    lowest = -np.inf if energy.is_held else max(top - _FALLEN, legs if legs < top else -np.inf)
    fell_off, before, stalled = False, np.inf, False
    least, gained, least_left, gained_round = np.inf, 0, np.inf, 0
    while not (fell_off or stalled):
        relaxation.run(_STEPS_PER_CHECK)
        steps += _STEPS_PER_CHECK
        residual, worst = relaxation.check()
        observe(energy.motion.position.numpy())
        converged = steps > _STEPS_PER_CHECK and residual <= options.tolerance and worst <= _WORST * options.tolerance
        if callback is not None:
            callback(steps, residual)
        if converged or steps >= options.max_steps:
            break
        least, gained = (residual, steps) if residual < _GAINS * least else (least, gained)
        stalled = steps - gained >= _STEPS_IN_VAIN
        # Dynamic relaxation goes on by itself as long as it serves.
        if residual < _EASES * before:
            before = residual
            continue
        before, carried = np.inf, np.inf
        while steps >= _FIRST_STEPS and rounds < min(_MOST_ROUNDS, gained_round + _ROUNDS_IN_VAIN) and not fell_off:
            if rounds == 0:
                energy.load_contact()
            rounds += 1
            near = left <= _NEARLY_AT_REST * options.tolerance
            # A round of the augmented Lagrangian: some steps, then body and friction take over the forces that they had.
            places = energy.motion.position.numpy().copy()
            energy.bound(places, _LONGEST_ROUND)
            energy.factor(places, near=near)
            descent, left = Descent(energy, energy.at(places), memory=_MEMORY), np.inf
            ends = _ROUND_ENDS * options.tolerance
            while descent.iterations < _STEPS_PER_ROUND and left > ends and descent.step():
                left = energy.mean_force(descent.point)
            left = energy.mean_force(descent.point)
            stiffer = left <= _NEARLY_AT_REST * options.tolerance or left <= _CONTACT_LEADS * carried
            energy.carry_contact(descent.point.positions, stiffer=stiffer)
            energy.renew_layers()
            energy.motion.velocity.zero_()
            places = energy.motion.position.numpy().copy()
            # The mean force on the planes that this round found anew.
            carried = energy.mean_force(energy.at(places))
            observe(places)
            fell_off = float(places[:, 1].max()) < lowest
            least_left, gained_round = (
                (carried, rounds) if carried < _GAINS * least_left else (least_left, gained_round)
            )
            if left <= options.tolerance and carried <= _SETTLED * options.tolerance:
                break
    return DrapedCloth(
        positions=energy.motion.position.numpy().copy(), pressing=relaxation.pressing.numpy().copy(),
        residual=residual, converged=converged, fell_off=fell_off, stalled=stalled, steps=steps, rounds=rounds,
        seconds=time.perf_counter() - began,
    )  # fmt: skip
