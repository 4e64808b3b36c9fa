"""The end of a curve turned by an angle, over its last stretch and by a bounded move."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.polyline import arc_lengths
from warpflat.pattern.curves import Curve

__all__ = ["REACH", "STRAY", "end_direction", "turned_end"]

#: An end is turned over this much of a curve [m], over less where it would move too far, and not over less than that.
REACH, LEAST_REACH = 0.060, 0.030
#: An end moves at most this far [m].
STRAY = 0.003
#: The stretch that is turned gets this many Béziers, and is measured at so many points.
PARTS, POINTS = 8, 400
#: A curve that turns at a joint by more than this [rad] has a corner there.
KINK = np.radians(5.0)
#: Weights of the bend back by which a curve keeps its length, from none to the most that is tried.
BENDS_BACK = np.linspace(0.0, 4.0, 41)


def end_direction(curve: Curve) -> FloatArray:
    """Return the unit vector in which a curve leaves its first point."""
    steps = curve.bezier[0, 1:] - curve.bezier[0, 0]
    away = steps[np.argmax(np.linalg.norm(steps, axis=1) > 1e-9)]
    return np.asarray(away / np.linalg.norm(away))


def turned_end(curve: Curve, turn: float, reach: float, *, keep_length: bool) -> tuple[Curve, float]:
    """Turn the first end of a curve to its left, and return it with its largest move [m].

    At the share u of the reach L the curve moves along its normal by L tan(turn) u (1 - u)^2 (1 - b u): at its end it
    turns by the whole angle and stays in its place, and beyond the reach it stays as it was. The bend back b keeps its
    length. The turn is less where the curve would move by more than `STRAY`.

    Args:
        curve: that starts at the corner.
        turn: [rad], anticlockwise.
        reach: over which it may move [m].
        keep_length: whether its length is kept.
    """
    reach = min(reach, _first_kink(curve))
    slope = float(np.tan(turn))
    peak = 4.0 / 27.0
    reach = min(reach, max(LEAST_REACH, STRAY / (peak * max(abs(slope), 1e-9))))
    slope = float(np.clip(slope, -STRAY / (peak * reach), STRAY / (peak * reach)))
    stretch = _Stretch(curve, reach)
    back = stretch.bend_back(slope) if keep_length else 0.0
    joint = np.linspace(0.0, 1.0, PARTS + 1)
    place, velocity = stretch.moved(slope, back, joint)
    third = velocity * (stretch.reach / (3 * PARTS))
    turned = np.stack([place[:-1], place[:-1] + third[:-1], place[1:] - third[1:], place[1:]], axis=1)
    turned[0, 0] = curve.bezier[0, 0]
    bezier, straight = stretch.rest
    if len(bezier):
        turned[-1, 3] = bezier[0, 0]
    result = Curve(
        bezier=np.concatenate([turned, bezier]), straight=np.concatenate([np.zeros(PARTS, dtype=bool), straight])
    )
    return result, float(np.abs(_move(slope, back, stretch.reach, np.linspace(0.0, 1.0, 101))[0]).max())


def _move(slope: float, back: float | FloatArray, reach: float, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the move along the normal [m] at shares of the reach, and its derivative by length."""
    move = reach * slope * u * (1 - u) ** 2 * (1 - back * u)
    rate = slope * ((1 - u) * (1 - 3 * u) * (1 - back * u) - back * u * (1 - u) ** 2)
    return move, rate


def _first_kink(curve: Curve) -> float:
    """Return the length [m] up to the first corner inside a curve, or up to its end."""
    arrive, leave = curve.bezier[:-1, 3] - curve.bezier[:-1, 2], curve.bezier[1:, 1] - curve.bezier[1:, 0]
    turn = np.arctan2(arrive[:, 0] * leave[:, 1] - arrive[:, 1] * leave[:, 0], np.einsum("ij,ij->i", arrive, leave))
    kinks = np.flatnonzero(np.abs(turn) > KINK)
    count = int(kinks[0]) + 1 if len(kinks) else len(curve.bezier)
    return Curve(bezier=curve.bezier[:count], straight=curve.straight[:count]).length


class _Stretch:
    """The first stretch of a curve, by its length.

    Attributes:
        reach: its length [m].
        rest: Béziers (#S by 4 by 2) and straightness of what follows.
    """

    def __init__(self, curve: Curve, reach: float) -> None:
        t = np.linspace(0.0, 1.0, POINTS // 4 + 1)
        s = 1 - t
        weights = np.stack([s**3, 3 * s**2 * t, 3 * s * t**2, t**3], axis=1)
        slopes = np.stack([-3 * s**2, 3 * s**2 - 6 * s * t, 6 * s * t - 3 * t**2, 3 * t**2], axis=1)
        places, tangents, reached, total, number, at = [], [], [], 0.0, 0, 1.0
        for number in range(len(curve.bezier)):
            control = curve.bezier[number]
            line = weights @ control
            arc = total + arc_lengths(line)
            tangent = slopes @ control
            places.append(line)
            tangents.append(tangent / np.maximum(np.linalg.norm(tangent, axis=1), 1e-12)[:, None])
            reached.append(arc)
            if arc[-1] >= reach - 1e-4:
                at = float(np.interp(reach, arc, t))
                break
            total = float(arc[-1])
        self._arc, self._place, self._tangent = map(np.concatenate, (reached, places, tangents))
        # A sliver of a Bézier is not worth a joint.
        at = 1.0 if at > 0.98 else at
        self.reach = float(np.interp(at, t, reached[-1]))
        rest, straight = curve.bezier[number + 1 :], curve.straight[number + 1 :]
        if at < 1.0:
            tail = _second_part(curve.bezier[number], at)
            rest = np.concatenate([tail[None], rest])
            straight = np.concatenate([curve.straight[number : number + 1], straight])
        self.rest = rest, straight

    def moved(self, slope: float, back: float, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return moved places (#U by 2 [m]) at shares of the reach, and their derivatives by length."""
        length = u * self.reach
        place, normal, tangent = self._frame(u)
        move, rate = _move(slope, back, self.reach, u)
        step = 1e-4
        ahead, behind = (
            _interpolated(np.clip(length + sign * step, 0.0, self.reach), self._arc, self._tangent) for sign in (1, -1)
        )
        width = np.clip(length + step, 0.0, self.reach) - np.clip(length - step, 0.0, self.reach)
        bend = np.einsum("ij,ij->i", ahead - behind, normal) / width
        return place + move[:, None] * normal, (1 - bend * move)[:, None] * tangent + rate[:, None] * normal

    def _frame(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return places (#U by 2 [m]) at shares of the reach, and the unit normals and tangents there."""
        place, tangent = (_interpolated(u * self.reach, self._arc, values) for values in (self._place, self._tangent))
        tangent /= np.linalg.norm(tangent, axis=1)[:, None]
        return place, np.column_stack([-tangent[:, 1], tangent[:, 0]]), tangent

    def bend_back(self, slope: float) -> float:
        """Return the bend back that keeps the length best, the least of those that keep it within 0.02 mm."""
        u = np.linspace(0.0, 1.0, POINTS + 1)
        place, normal, _ = self._frame(u)
        move, _ = _move(slope, BENDS_BACK[:, None], self.reach, u)
        step = np.diff(place + move[..., None] * normal, axis=1)
        change = np.sqrt((step**2).sum(axis=2)).cumsum(axis=1)[:, -1] - self.reach
        kept = np.flatnonzero(np.abs(change) < 2e-5)
        return float(BENDS_BACK[kept[0] if len(kept) else np.abs(change).argmin()])


def _interpolated(at: FloatArray, arc: FloatArray, values: FloatArray) -> FloatArray:
    """Interpolate vectors (#P by 2) at lengths."""
    return np.column_stack([np.interp(at, arc, values[:, axis]) for axis in range(2)])


def _second_part(control: FloatArray, t: float) -> FloatArray:
    """Return the control points (4 by 2) of a Bézier from the parameter t on, by de Casteljau's scheme."""
    points, last = control, [control[-1]]
    while len(points) > 1:
        points = (1 - t) * points[:-1] + t * points[1:]
        last.append(points[-1])
    return np.array(last[::-1])
