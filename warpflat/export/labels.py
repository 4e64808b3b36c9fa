"""Where labels go on a drawing so that no two overlap."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.core.polyline import points_at_lengths, polyline_length, resample

__all__ = [
    "LabelRoom",
    "Spot",
    "along_line",
    "away_from",
    "beside",
    "beyond_ends",
    "in_batches",
    "leader_of",
    "points_on",
    "rectangles",
    "spread",
]

# From the end of a leader to its text [in].
_GAP = 0.04


@dataclass(frozen=True, kw_only=True)
class Spot:
    """A place for a text: its middle [in], the angle [rad] of its baseline, and the end of its leader, if any."""

    x: float
    y: float
    angle: float
    leader: tuple[float, float] | None = None


class LabelRoom:
    """The room on one page [in]: boxes and labels that are taken, and whether another label still fits."""

    def __init__(self) -> None:
        self._discs = np.empty((0, 3))
        self._passable = np.empty((0, 3))

    def take_box(self, left: float, bottom: float, right: float, top: float) -> None:
        """Keep labels out of a box."""
        width, height = max(right - left, 1e-6), max(top - bottom, 1e-6)
        flat = width >= height
        middle = Spot(x=0.5 * (left + right), y=0.5 * (bottom + top), angle=0.0 if flat else 0.5 * math.pi)
        self._add(_discs([middle], max(width, height), min(width, height))[0])

    def take_line(self, points: FloatArray, thickness: float, *, passable: bool = False) -> None:
        """Keep labels off a polyline (#N by 2) [in], and leaders, unless it is passable."""
        for a, b in pairwise(points):
            length = float(np.linalg.norm(b - a))
            spot = Spot(x=float(a[0] + b[0]) / 2, y=float(a[1] + b[1]) / 2, angle=float(np.arctan2(*(b - a)[::-1])))
            discs = _discs([spot], length + thickness, thickness)[0]
            if passable:
                self._passable = np.concatenate([self._passable, discs])
            else:
                self._add(discs)

    def place(
        self,
        spots: Iterable[Spot],
        width: float,
        height: float,
        page: tuple[float, float, float, float],
        avoid: FloatArray | None = None,
        *,
        may_cross: bool = True,
    ) -> Spot | None:
        """Take the first of `spots` at which a text of this size [in] lies free within `page`, and its leader over no other, or None.

        The lines whose points (`points_on`) are in `avoid` are crossed only where every other spot is worse, and if they may be.
        """
        lines = np.empty((0, 2)) if avoid is None else avoid
        left, bottom, right, top = page
        taken = np.concatenate([self._discs, self._passable])
        off_lines = np.concatenate([taken, np.column_stack([lines, np.zeros(len(lines))])])
        # A few at a time where one look is enough: to make a spot may take longer than to look at it.
        spots = list(spots) if may_cross else spots
        for obstacles in (off_lines, taken)[: 1 + may_cross]:
            for some in in_batches(spots):
                discs = _discs(some, width, height)
                low = (discs[..., :2] - discs[..., 2:]).min(axis=1)
                high = (discs[..., :2] + discs[..., 2:]).max(axis=1)
                fits = np.flatnonzero((low >= (left, bottom)).all(axis=1) & (high <= (right, top)).all(axis=1))
                for k in fits[_apart(discs[fits], obstacles)].tolist():
                    if self._lets_pass(some[k], width):
                        self._add(discs[k])
                        return some[k]
        return None

    def _lets_pass(self, spot: Spot, width: float) -> bool:
        """Whether a spot's leader runs over nothing; where it begins a line may have its own."""
        leader = leader_of(spot, width)
        if leader is None:
            return True
        ink = points_on(leader, 0.03)[3:]
        return bool(_apart(np.column_stack([ink, np.full(len(ink), 0.01)])[None], self._discs).all())

    def _add(self, discs: FloatArray) -> None:
        self._discs = np.concatenate([self._discs, discs])


def leader_of(spot: Spot, width: float) -> FloatArray | None:
    """2 by 2, the leader from where it begins to a text so wide [in]; None of a spot without one."""
    if spot.leader is None:
        return None
    side = np.copysign(1.0, spot.x - spot.leader[0])
    return np.array([spot.leader, (spot.x - side * (0.5 * width + _GAP), spot.y)])


def rectangles(spots: Sequence[Spot], width: float, height: float) -> FloatArray:
    """#S by #N by 2, points all over a text of this size at each spot [in]."""
    along = np.linspace(-0.5 * width, 0.5 * width, max(3, math.ceil(width / height)))
    x, y = (of.ravel() for of in np.meshgrid(along, (-0.5 * height, 0.0, 0.5 * height)))
    return np.stack(_turned(spots, x, y), axis=-1)


def _turned(spots: Sequence[Spot], x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """#S by #N each, where points along and across a text (#N) come to at each spot."""
    at = np.array([(spot.x, spot.y, math.cos(spot.angle), math.sin(spot.angle)) for spot in spots])
    left, low, c, s = at.T[:, :, None]
    return left + c * x - s * y, low + s * x + c * y


def spread(wanted: Sequence[float], apart: float, low: float, high: float) -> list[float]:
    """Places as near as may be to those wanted, which fall, each at least so far below the one before, between the bounds if there is room.

    Those that come too near to each other move together, as far up as down.
    """
    groups: list[tuple[float, int]] = []  # the middle of each, and how many
    for place in wanted:
        middle, count = place, 1
        while groups and groups[-1][0] - middle < 0.5 * (groups[-1][1] + count) * apart:
            above, more = groups.pop()
            middle, count = (above * more + middle * count) / (more + count), more + count
        groups.append((middle, count))
    places = [middle + (0.5 * (count - 1) - k) * apart for middle, count in groups for k in range(count)]
    for i, least in enumerate(low + apart * np.arange(len(places))[::-1]):
        places[i] = max(places[i], float(least))
    return [min(place, high - apart * i) for i, place in enumerate(places)]


def in_batches(spots: Iterable[Spot]) -> Iterator[list[Spot]]:
    """A few at first, since one of these will often do, then more at a time."""
    left, count = iter(spots), 4
    while some := list(islice(left, count)):
        yield some
        count = min(2 * count, 64)


def _apart(discs: FloatArray, others: FloatArray) -> BoolArray:
    """#S, of each set of discs (#S by #N by 3) whether none overlaps one of the others (#M by 3)."""
    away = discs[:, :, None, :2] - others[:, :2]
    reach = discs[:, :, None, 2] + others[:, 2]
    return np.asarray((np.einsum("snmk,snmk->snm", away, away) >= reach**2).all(axis=(1, 2)))


def _discs(spots: Sequence[Spot], width: float, height: float) -> FloatArray:
    """#S by #N by 3: middles and radius of discs that cover a turned rectangle along its length, at each spot."""
    count = max(1, math.ceil(width / height))
    places = ((np.arange(count) + 0.5) / count - 0.5) * width
    radius = 0.5 * math.hypot(height, width / count) * 0.95
    x, y = _turned(spots, places, np.zeros(count))
    return np.stack([x, y, np.full_like(x, radius)], axis=-1)


def points_on(line: FloatArray, step: float) -> FloatArray:
    """#N by 2, points on a polyline (#M by 2) [in], no farther apart along it than a step, its ends among them."""
    return resample(line, np.linspace(0.0, 1.0, max(2, math.ceil(polyline_length(line) / max(step, 1e-3)) + 1)))


def along_line(line: FloatArray, width: float, clearance: float) -> Iterator[Spot]:
    """Spots beside a polyline (#N by 2) [in] and parallel to it, from its middle outwards, on either side."""
    total = polyline_length(line)
    if total < 1.05 * width:
        return
    for share in (0.5, 0.42, 0.58, 0.35, 0.65, 0.28, 0.72, 0.22, 0.78, 0.16, 0.84, 0.1, 0.9):
        centre = min(max(share * total, 0.52 * width), total - 0.52 * width)
        stretch = points_at_lengths(line, centre + np.linspace(-0.5, 0.5, 9) * width)
        before, after = stretch[[0, -1]]
        direction = (after - before) / max(float(np.linalg.norm(after - before)), 1e-12)
        if direction[0] < -1e-3 or (abs(direction[0]) <= 1e-3 and direction[1] < 0):
            direction = -direction
        # Beside the whole stretch, however it bends.
        bend = (stretch - before) @ np.array([-direction[1], direction[0]])
        middle = 0.5 * (before + after)
        for offset in (float(bend.max()) + clearance, float(bend.min()) - clearance):
            x, y = middle + offset * np.array([-direction[1], direction[0]])
            yield Spot(x=float(x), y=float(y), angle=math.atan2(direction[1], direction[0]))


def beyond_ends(line: FloatArray, width: float, height: float) -> Iterator[Spot]:
    """Level spots just beyond either end of a polyline (#N by 2) [in]."""
    for end, inner in ((line[-1], line[-2]), (line[0], line[1])):
        outwards = end - inner
        right = 1.0 if outwards[0] >= 0 else -1.0
        yield Spot(x=float(end[0] + right * (0.5 * width + 0.08)), y=float(end[1]), angle=0.0)
        up = 1.0 if outwards[1] >= 0 else -1.0
        yield Spot(x=float(end[0]), y=float(end[1] + up * (0.5 * height + 0.08)), angle=0.0)


# How far out and how much higher a text may stand than the point that it names [in], the nearest first; rather out than up or down.
_AROUND = sorted(
    (
        (0.08 + 0.06 * step, rise)
        for step in range(24)
        for rise in (0.0, 0.07, -0.07, 0.15, -0.15, 0.25, -0.25, 0.36, -0.36)
    ),
    key=lambda way: math.hypot(*way) + 0.5 * abs(way[1]),
)


def beside(
    points: Sequence[tuple[float, float]], width: float, sides: Sequence[float], *, level: float | None = None
) -> Iterator[Spot]:
    """Level spots to the sides (right 1, left -1) of points [in], the nearest first, each with a leader to its point.

    At a `level`, if one is given; there a text that stands right beside its point has no leader.
    """
    for far, rise in _AROUND:
        for point in points:
            y = (point[1] if level is None else level) + rise
            touches = level is not None and far == _AROUND[0][0] and abs(y - point[1]) < 0.05
            for side in sides:
                x = point[0] + side * (far + 0.5 * width)
                yield Spot(x=x, y=y, angle=0.0, leader=None if touches else point)


def away_from(line: FloatArray, width: float) -> Iterator[Spot]:
    """Level spots away from the middle of a polyline (#N by 2) [in], each with a leader to it."""
    middle = line[len(line) // 2]
    for side in (1.0, -1.0):
        for far in (0.25, 0.5, 0.8, 1.2):
            for lift in (0.0, 0.25, -0.25, 0.5, -0.5):
                x, y = float(middle[0]) + side * (0.5 * width + far), float(middle[1]) + lift
                yield Spot(x=x, y=y, angle=0.0, leader=(float(middle[0]), float(middle[1])))
