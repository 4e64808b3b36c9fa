"""Where labels go on a drawing so that no two overlap."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

__all__ = ["LabelRoom", "Spot", "along_line", "away_from", "beyond_ends"]


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

    def take_box(self, left: float, bottom: float, right: float, top: float) -> None:
        """Keep labels out of a box."""
        width, height = max(right - left, 1e-6), max(top - bottom, 1e-6)
        flat = width >= height
        middle = Spot(x=0.5 * (left + right), y=0.5 * (bottom + top), angle=0.0 if flat else 0.5 * math.pi)
        self._add(_discs(middle, max(width, height), min(width, height)))

    def take_line(self, points: NDArray[np.float64], thickness: float) -> None:
        """Keep labels off a polyline (#N by 2) [in]."""
        for a, b in pairwise(points):
            length = float(np.linalg.norm(b - a))
            spot = Spot(x=float(a[0] + b[0]) / 2, y=float(a[1] + b[1]) / 2, angle=float(np.arctan2(*(b - a)[::-1])))
            self._add(_discs(spot, length + thickness, thickness))

    def place(
        self,
        spots: Sequence[Spot],
        width: float,
        height: float,
        page: tuple[float, float, float, float],
        avoid: Sequence[NDArray[np.float64]] = (),
    ) -> Spot | None:
        """Take the first of `spots` at which a text of this size [in] lies free within `page`, or None.

        The lines in `avoid` (#N by 2 each) are crossed only where every other spot is worse.
        """
        lines = np.concatenate([_resampled(line, 0.5 * height) for line in avoid]) if avoid else np.empty((0, 2))
        off_lines = np.column_stack([lines, np.zeros(len(lines))])
        left, bottom, right, top = page
        for obstacles in (np.concatenate([self._discs, off_lines]), self._discs):
            for spot in spots:
                discs = _discs(spot, width, height)
                low, high = (discs[:, :2] - discs[:, 2:]).min(axis=0), (discs[:, :2] + discs[:, 2:]).max(axis=0)
                if low[0] < left or low[1] < bottom or high[0] > right or high[1] > top:
                    continue
                distance = np.hypot(*(discs[:, None, :2] - obstacles[None, :, :2]).transpose(2, 0, 1))
                if (distance >= discs[:, None, 2] + obstacles[None, :, 2]).all():
                    self._add(discs)
                    return spot
        return None

    def _add(self, discs: NDArray[np.float64]) -> None:
        self._discs = np.concatenate([self._discs, discs])


def _discs(spot: Spot, width: float, height: float) -> NDArray[np.float64]:
    """#N by 3: middles and radius of discs that cover a turned rectangle along its length."""
    count = max(1, math.ceil(width / height))
    places = ((np.arange(count) + 0.5) / count - 0.5) * width
    radius = 0.5 * math.hypot(height, width / count) * 0.95
    return np.column_stack(
        [spot.x + places * math.cos(spot.angle), spot.y + places * math.sin(spot.angle), np.full(count, radius)]
    )


def _resampled(line: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    reached = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    places = np.linspace(0.0, reached[-1], max(2, math.ceil(reached[-1] / max(step, 1e-3)) + 1))
    return np.column_stack([np.interp(places, reached, line[:, axis]) for axis in range(2)])


def along_line(line: NDArray[np.float64], width: float, clearance: float) -> Iterator[Spot]:
    """Spots beside a polyline (#N by 2) [in] and parallel to it, from its middle outwards, on either side."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    total = float(steps.sum())
    if total < 1.05 * width:
        return
    reached = np.concatenate([[0.0], np.cumsum(steps)])

    def at(distance: float) -> NDArray[np.float64]:
        return np.array([np.interp(distance, reached, line[:, axis]) for axis in range(2)])

    for share in (0.5, 0.35, 0.65, 0.22, 0.78, 0.1, 0.9):
        centre = min(max(share * total, 0.52 * width), total - 0.52 * width)
        before, after = at(centre - 0.5 * width), at(centre + 0.5 * width)
        direction = (after - before) / max(float(np.linalg.norm(after - before)), 1e-12)
        if direction[0] < -1e-3 or (abs(direction[0]) <= 1e-3 and direction[1] < 0):
            direction = -direction
        # Beside the whole stretch, however it bends.
        bend = (np.array([at(centre + shift * width) for shift in np.linspace(-0.5, 0.5, 9)]) - before) @ np.array(
            [-direction[1], direction[0]]
        )
        middle = 0.5 * (before + after)
        for offset in (float(bend.max()) + clearance, float(bend.min()) - clearance):
            x, y = middle + offset * np.array([-direction[1], direction[0]])
            yield Spot(x=float(x), y=float(y), angle=math.atan2(direction[1], direction[0]))


def beyond_ends(line: NDArray[np.float64], width: float, height: float) -> Iterator[Spot]:
    """Level spots just beyond either end of a polyline (#N by 2) [in]."""
    for end, inner in ((line[-1], line[-2]), (line[0], line[1])):
        outwards = end - inner
        right = 1.0 if outwards[0] >= 0 else -1.0
        yield Spot(x=float(end[0] + right * (0.5 * width + 0.08)), y=float(end[1]), angle=0.0)
        up = 1.0 if outwards[1] >= 0 else -1.0
        yield Spot(x=float(end[0]), y=float(end[1] + up * (0.5 * height + 0.08)), angle=0.0)


def away_from(line: NDArray[np.float64], width: float) -> Iterator[Spot]:
    """Level spots away from the middle of a polyline (#N by 2) [in], each with a leader to it."""
    middle = line[len(line) // 2]
    for side in (1.0, -1.0):
        for far in (0.25, 0.5, 0.8, 1.2):
            for lift in (0.0, 0.25, -0.25, 0.5, -0.5):
                x, y = float(middle[0]) + side * (0.5 * width + far), float(middle[1]) + lift
                yield Spot(x=x, y=y, angle=0.0, leader=(float(middle[0]), float(middle[1])))
