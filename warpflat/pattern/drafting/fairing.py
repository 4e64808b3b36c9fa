"""Fairing: the smoothest curve near a line of points, with few inflections, as drawn by hand with a ruler and a curve."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from warpflat.core import BoolArray, FloatArray, arc_lengths, points_at_lengths, unit
from warpflat.pattern.drafting.curves import farthest

__all__ = ["FairLine", "bend_one_way", "count_inflections", "fair_lines", "fairest_line"]

#: A line is faired at places this far apart [m], but at no fewer and no more of them than this.
STEP, FEWEST, MOST = 0.003, 24, 200
#: A bend counts if the line turns by more than this [rad] before it bends back.
LEAST_BEND = np.radians(1.0)
#: Waves that are tried: the first [m], the factor from each to the next, and how many.
FIRST_WAVE, GROWTH, WAVES = 0.03, 1.3, 20
#: How much more a point that the line must meet counts than another place.
_MET = 1e6
#: A gentle line turns by at most this [rad] within this length [m], if the bound allows it.
GENTLE, WITHIN = np.radians(8.0), 0.03
#: An inflection is drawn away if the line need not move farther than this for it [m]. The waist of a side seam is one to keep.
WORTH = 0.0006


@dataclass(frozen=True, kw_only=True, eq=False)
class FairLine:
    """A faired line.

    Attributes:
        points: #P by 2 [m], where the given points come to lie.
        shift: the largest distance of a given point from the line [m].
        inflections: of the line.
        turn: the sharpest turn within :data:`WITHIN` [rad].
    """

    points: FloatArray
    shift: float
    inflections: int
    turn: float


def count_inflections(points: FloatArray) -> int:
    """Return how often a line (#P by 2 [m]) changes between bending left and bending right, by a degree or more each.

    A line and its mirror image have as many: it is counted from both ends, and the lower count is taken.
    """
    angles = _directions(_evenly(points)[1]).tolist()
    return min(_changes_of_bend(angles), _changes_of_bend(angles[::-1]))


def _directions(points: FloatArray) -> FloatArray:
    """Return the direction of each step of a line (#P by 2), #P - 1 [rad], without jumps by whole turns."""
    steps = np.diff(points, axis=0)
    return np.asarray(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))


def _changes_of_bend(angles: list[float]) -> int:
    """Return how often the direction [rad] of a line turns back by more than :data:`LEAST_BEND`."""
    count, sign, low, high = 0, 0, np.inf, -np.inf
    for angle in angles:
        low, high = angle if angle < low else low, angle if angle > high else high
        turned = 1 if angle - low > LEAST_BEND else -1 if high - angle > LEAST_BEND else 0
        if turned:
            # The next bend begins where this one ends.
            count, sign, low, high = count + (sign == -turned), turned, angle, angle
    return count


def fair_lines(
    points: FloatArray,
    waves: Iterable[float],
    straight: BoolArray | None = None,
    met: BoolArray | None = None,
    mirrored: tuple[bool, bool] = (False, False),
) -> Iterator[FairLine]:
    """Yield for each wave the line p that minimises the integral of |p - p0|^2 + (wave / 2 pi)^6 |p'''|^2 along its length.

    A wave of the given length loses half of its height, a shorter one more. Circles stay nearly as they are: what is
    kept small is the change of curvature (Moreton and Sequin 1992). The waves share the equations.

    Args:
        points: #P by 2 [m], p0.
        waves: [m].
        straight: #P, points in a row that come to lie on one straight line, if some do.
        met: #P, points that the line goes through, as those at which a girth was measured; of a straight row only where it allows.
        mirrored: whether the line goes on beyond its first and its last point as its mirror image in an upright line.
    """
    places, even = _evenly(points)
    is_straight, weight = _straight_places(points, places, straight), _weights(points, places, met)
    first = 0
    for at_end in (False, True):
        if mirrored[at_end]:
            image = even * [-1.0, 1.0] + [2.0 * even[-1 if at_end else first, 0], 0.0]
            added = slice(-2, None, -1) if at_end else slice(None, 0, -1)
            rows = [(even, image[added]), (is_straight, is_straight[added]), (weight, weight[added])]
            even, is_straight, weight = (np.concatenate(row if at_end else row[::-1]) for row in rows)
            first += 0 if at_end else len(image) - 1
    # The points are sums of free ones (#P by #F): those in a straight row lie between the ends of the row.
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_straight, [False]]).astype(np.int8)))
    sums = np.eye(len(is_straight))
    inner = np.zeros(len(is_straight), dtype=bool)
    for begin, end in edges.reshape(-1, 2):
        last = end - 1
        share = (np.arange(begin + 1, last) - begin) / max(last - begin, 1)
        sums[begin + 1 : last] = 0.0
        sums[begin + 1 : last, begin], sums[begin + 1 : last, last] = 1.0 - share, share
        inner[begin + 1 : last] = True
    basis = sums[:, ~inner]
    bend = np.diff(basis, n=3, axis=0)
    weighed = basis.T * weight
    near, bent, wanted = weighed @ basis, bend.T @ bend, weighed @ even
    # A free point meets only those near it in the row: the equations have a band.
    row, column = np.nonzero((near != 0.0) | (bent != 0.0))
    width = int(np.abs(row - column).max())
    banded = np.zeros((2, 2 * width + 1, len(near)))
    banded[:, width + row - column, column] = near[row, column], bent[row, column]
    for wave in waves:
        stiffness = (wave / (2 * np.pi * places[1])) ** 6
        solved = solve_banded((width, width), banded[0] + stiffness * banded[1], wanted)
        yield _fair(points, places, (basis @ solved)[first : first + len(places)])


def bend_one_way(
    points: FloatArray, wave: float, *, straight: BoolArray | None = None, met: BoolArray | None = None
) -> FairLine | None:
    """Return the line that is as near and as fair as that of :func:`fair_lines` among those that bend to one side only.

    The line is a graph over the chord of its ends: a straight line and hinges of one sign (non-negative least squares).

    Args:
        points: #P by 2 [m].
        wave: one of those of :func:`fair_lines` [m].
        straight, met: as in :func:`fair_lines`.

    Returns:
        The line; None if it is no graph over its chord.
    """
    from scipy.optimize import nnls

    places, even = _evenly(points)
    chord = even[-1] - even[0]
    along = unit(chord)
    across = np.array([-along[1], along[0]])
    x, y = (even - even[0]) @ along, (even - even[0]) @ across
    if np.diff(x).min() <= 0.0:
        return None
    side = np.sign(y.sum()) or 1.0
    is_straight = _straight_places(points, places, straight)
    bends = np.array([at for at in range(1, len(x) - 1) if not is_straight[at - 1 : at + 2].all()])
    # The straight line's height and slope may have either sign.
    basis = np.column_stack([np.ones_like(x), -np.ones_like(x), x, -x, -np.maximum(x[:, None] - x[bends], 0.0)])
    bend = (wave / (2 * np.pi * places[1])) ** 3 * np.diff(basis, n=3, axis=0)
    root = np.sqrt(_weights(points, places, met))
    rows, wanted = np.vstack([root[:, None] * basis, bend]), np.concatenate([root * side * y, np.zeros(len(bend))])
    shares, _ = nnls(rows, wanted, maxiter=100 * len(x))
    smooth = even[0] + x[:, None] * along + side * (basis @ shares)[:, None] * across
    return _fair(points, places, smooth)


def fairest_line(
    points: FloatArray,
    bound: float,
    *,
    straight: BoolArray | None = None,
    met: BoolArray | None = None,
    mirrored: tuple[bool, bool] = (False, False),
    one_way: bool = False,
    gentle: bool = False,
) -> FairLine | None:
    """Return the line within a bound that has few inflections for little shift; None if no line is within it.

    Args:
        points, straight, met, mirrored: as in :func:`fair_lines`.
        bound: [m].
        one_way: whether a line that bends to one side only is preferred, with the longest wave within the bound.
        gentle: whether a corner is drawn as a curve, too, as far as the bound allows, if that takes no inflection more and hardly turns
            the line's ends, where it meets others.
    """
    best: FairLine | None = None
    least = np.inf
    for tried in fair_lines(points, FIRST_WAVE * GROWTH ** np.arange(WAVES), straight, met, mirrored):
        if tried.shift > bound:
            break
        cost = tried.shift + WORTH * tried.inflections
        if best is None or (tried.inflections < best.inflections and cost < least):
            best, least = tried, cost
        elif (
            gentle
            and best.turn > GENTLE
            and tried.turn < best.turn
            and tried.inflections <= best.inflections
            and _end_turn(points, tried.points) <= GENTLE
        ):
            best = tried
        if best.inflections == 0 and not (gentle and best.turn > GENTLE):
            break
    if not one_way or (best is not None and best.inflections == 0):
        return best
    for wave in FIRST_WAVE * GROWTH ** np.arange(WAVES):
        bent = bend_one_way(points, float(wave), straight=straight, met=met)
        if bent is None or bent.shift > bound:
            break
        best = bent
    return best


def _end_turn(first: FloatArray, second: FloatArray) -> float:
    """Return by how much the last centimetre at either end of a line (#P by 2 [m]) differs in direction from another one's [rad]."""
    angles = []
    for line in (first, second):
        length = arc_lengths(line)[-1]
        ends = points_at_lengths(line, [0.0, 0.01, length - 0.01, length])
        angles.append(np.arctan2(*(ends[[1, 3]] - ends[[0, 2]]).T))
    turned = angles[1] - angles[0]
    return float(np.abs((turned + np.pi) % (2.0 * np.pi) - np.pi).max())


def _fair(points: FloatArray, places: FloatArray, smooth: FloatArray) -> FairLine:
    """Return a faired line (#S by 2 [m]) of some points, with its measures; the points keep their places along the line [m] (#S)."""
    placed = points_at_lengths(smooth, np.interp(arc_lengths(points), places, arc_lengths(smooth)))
    evenly, even = _evenly(smooth)
    angles = _directions(even)
    apart = min(max(1, round(WITHIN / evenly[1])), len(angles) - 1)
    turn = float(np.abs(angles[apart:] - angles[:-apart]).max())
    # The line goes on straight beyond its ends.
    away = 0.02 * unit(np.stack([smooth[0] - smooth[1], smooth[-1] - smooth[-2]]))
    shift = farthest(np.vstack([smooth[0] + away[0], smooth, smooth[-1] + away[1]]), points)
    return FairLine(points=placed, shift=shift, inflections=count_inflections(smooth), turn=turn)


def _straight_places(points: FloatArray, places: FloatArray, straight: BoolArray | None) -> BoolArray:
    """Return which places along a line lie between points that come to lie straight."""
    if straight is None or not straight.any():
        return np.zeros(len(places), dtype=bool)
    first, last = arc_lengths(points)[straight][[0, -1]] + places[1] * np.array([-1.0, 1.0])
    return np.asarray((places >= first) & (places <= last))


def _weights(points: FloatArray, places: FloatArray, met: BoolArray | None) -> FloatArray:
    """Return how much each place along a line counts: those nearest to points that are to be met count more."""
    weight = np.ones(len(places))
    if met is not None:
        weight[np.rint(arc_lengths(points)[met] / places[1]).astype(np.int64)] = _MET
    return weight


def _evenly(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return lengths along a line [m] that are evenly apart, and the points there (#P by 2 [m])."""
    arc = arc_lengths(points)
    places = np.linspace(0.0, arc[-1], int(np.clip(np.ceil(arc[-1] / STEP), FEWEST, MOST)))
    return places, points_at_lengths(points, places)
