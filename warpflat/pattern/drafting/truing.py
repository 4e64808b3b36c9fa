"""Corners trued: where pieces meet at the end of a seam, the edge that runs on across it is smooth once it is sewn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core import FloatArray, arc_lengths, turn_between, unit
from warpflat.pattern.drafting.curves import Curve, cubic_weights, split_bezier
from warpflat.pattern.drafting.pieces import Piece, Place, Seam, SeamSide

__all__ = ["CornerReport", "true_corners", "turned_end"]


#: Corners whose angles are the second [rad] or more from running on are meant to be corners; from the first on they are turned less and
#: less, so that rounding decides nothing.
DOUBTED, MEANT = np.radians(17.0), np.radians(20.0)
#: Squared turns, over all corners, count this much beside the squares of what corners miss.
SMALL = 1e-4
#: Turns less than this [rad] are left out.
LEAST_TURN = np.radians(0.05)
#: Turned edges are turned again for what bounds and kept lengths have left, so many times.
ROUNDS = 2

#: The end of an edge: the edge, and whether it is its last point.
End = tuple[Place, bool]


@dataclass(frozen=True, kw_only=True)
class CornerReport:
    """A place where an edge runs on across a seam or a dart, or meets a fold.

    Attributes:
        place: the seam or fold, and the edges that run on.
        size: of the pieces.
        wanted_deg: what the angles are to make together.
        before_deg, after_deg: what they made before and after truing.
        move_mm: the largest move of the edges that meet there [mm].
    """

    place: str
    size: str
    wanted_deg: float
    before_deg: float
    after_deg: float
    move_mm: float


@dataclass(frozen=True, kw_only=True)
class _Corner:
    """Corners of pieces whose angles have one wanted sum; each has the ends of the edges that arrive and leave."""

    place: str
    ends: tuple[tuple[End, End], ...]
    outer: tuple[End, ...]
    wanted: float

    def angle(self, curves: Mapping[Place, Curve]) -> float:
        """Return the sum of the angles [rad] inside the pieces, between an edge and the next one, counter-clockwise."""
        total = 0.0
        for arrive, leave in self.ends:
            total += np.pi - turn_between(-end_direction(curves[arrive[0]].reversed()), end_direction(curves[leave[0]]))
        return total


def true_corners(
    pieces: Sequence[Piece], seams: Sequence[Seam], curves: Mapping[Place, Curve]
) -> tuple[dict[Place, Curve], list[CornerReport]]:
    """Turn the ends of edges until the edges run on smoothly across seams and closed darts, and meet folds squarely.

    The turns are the smallest, by least squares over all corners, so that each piece takes its half of a difference.
    An end is turned over its last 30 to 60 mm and moves at most 3 mm; an edge that is sewn keeps its length. Legs of
    darts and edges on a fold stay. Corners more than 20 degrees from running on are left: they are meant. Of what others miss, those
    17 to 20 degrees from it get a share.

    Args:
        pieces: of one size.
        seams: between them.
        curves: of all edges, in their piece's direction.

    Returns:
        All curves, and a report on each corner.
    """
    import shapely

    start = dict(curves)
    # The corners at both ends of every seam and every fold, and at the mouth of every dart.
    found = dict[frozenset[tuple[End, End]], _Corner]()
    by_name = {piece.name: piece for piece in pieces}
    lines: list[tuple[str, Sequence[Sequence[SeamSide]]]]
    lines = [(seam.name, seam.sides) for seam in (*seams, *(dart for piece in pieces for dart in piece.dart_seams))]
    lines += [
        (f"{piece.name}.{edge.name}", ((SeamSide(piece=piece.name, edge=edge.name),),))
        for piece in pieces
        for edge in piece.edges
        if edge.kind == "fold"
    ]
    for name, rows in lines:
        for last in (False, True):
            joined = [row[-1 if last else 0] for row in rows]
            corner = _corner_between(by_name, name, [(side, last != side.reversed) for side in joined])
            if corner is not None:
                found[frozenset(corner.ends)] = corner
    away = {corner: abs(corner.angle(start) - corner.wanted) for corner in found.values()}
    corners = [corner for corner in found.values() if away[corner] < MEANT]
    shares = np.array([min(1.0, (MEANT - away[corner]) / (MEANT - DOUBTED)) for corner in corners])
    sewn = {side.place for seam in seams for side in seam.stretches}
    turns: dict[End, float] = {}
    trued, moves = dict(start), dict[End, float]()
    for _ in range(ROUNDS):
        for end, turn in _least_turns(corners, shares, trued).items():
            turns[end] = turns.get(end, 0.0) + turn
        # The curves with their ends turned, and the largest move [m] of each end.
        trued, moves = dict(start), {}
        for (key, at_end), turn in turns.items():
            curve, reach = trued[key], min(REACH, 0.45 * start[key].length)
            # The outside lies to the right of a curve in its piece's direction.
            flipped = curve.reversed() if at_end else curve
            result, move = turned_end(flipped, turn if at_end else -turn, reach, keep_length=key in sewn)
            trued[key], moves[key, at_end] = (result.reversed() if at_end else result), move
        # The curves, with those of a piece as they were where its border would cross itself.
        for piece in pieces:
            keys = [(piece.name, edge.name) for edge in piece.edges]
            if all(trued[key] is start[key] for key in keys):
                continue
            outlines = [
                shapely.Polygon(np.concatenate([curves[key].sample()[:-1] for key in keys]))
                for curves in (start, trued)
            ]
            if outlines[0].is_valid and not outlines[1].is_valid:
                trued = trued | {key: start[key] for key in keys}
                moves = {end: move for end, move in moves.items() if end[0] not in keys}
    reports = [
        CornerReport(
            place=corner.place,
            size=pieces[0].size,
            wanted_deg=float(np.degrees(corner.wanted)),
            before_deg=float(np.degrees(corner.angle(start))),
            after_deg=float(np.degrees(corner.angle(trued))),
            move_mm=1000.0 * max((moves.get(end, 0.0) for pair in corner.ends for end in pair), default=0.0),
        )
        for corner in corners
    ]
    return trued, reports


def _least_turns(corners: Sequence[_Corner], shares: FloatArray, curves: Mapping[Place, Curve]) -> dict[End, float]:
    """Return the smallest turns outwards [rad] of edges' ends that give all corners their wanted angles.

    Args:
        corners: all that may be turned.
        shares: #corners, from 0 to 1, of what a corner misses that it gets, were it alone.
        curves: of all edges.
    """
    ends = sorted({end for corner in corners for end in corner.outer})
    if not ends:
        return {}
    place = {end: k for k, end in enumerate(ends)}
    rates, free = np.zeros((len(corners), len(ends))), np.zeros(len(ends))
    for row, corner, share in zip(rates, corners, shares, strict=True):
        for end in (end for pair in corner.ends for end in pair):
            if end in place:
                row[place[end]] += 1.0
        # An end that runs on at a doubted corner alone is as free to turn as that is.
        at = [place[end] for end in corner.outer]
        free[at] = np.maximum(free[at], share)
    missing = np.array([corner.wanted - corner.angle(curves) for corner in corners])
    # Alone, a corner of weight w with one end gets w / (w + SMALL) of what it misses.
    weights = np.sqrt(np.minimum(1.0, SMALL * shares / np.maximum(1.0 - shares, SMALL)))
    system = np.concatenate([weights[:, None] * rates * free, np.sqrt(SMALL) * np.eye(len(ends))])
    solved = free * np.linalg.lstsq(system, np.concatenate([weights * missing, np.zeros(len(ends))]), rcond=None)[0]
    return {end: float(turn) for end, turn in zip(ends, solved, strict=True) if abs(turn) > LEAST_TURN}


def _corner_between(pieces: Mapping[str, Piece], line: str, sides: Sequence[tuple[SeamSide, bool]]) -> _Corner | None:
    """Return the corner at which the edges beside both sides of a seam run on, or the one beside a fold; None without such edges.

    At the tip of a dart no edges run on.

    Args:
        pieces: by name.
        line: name of the seam or fold.
        sides: each side's edge, and whether its last point is the corner.
    """
    # The ends of a strip are cut straight across, wherever on a piece they come to lie; those of collars and cuffs are meant.
    roles = [pieces[side.piece].role for side, _ in sides]
    if len(sides) > 1 and (len({role == "strip" for role in roles}) > 1 or {"collar", "cuff", "hood"} & set(roles)):
        return None
    pairs, outer = [], []
    for side, at_end in sides:
        edges = pieces[side.piece].edges
        number = [edge.name for edge in edges].index(side.edge)
        other = edges[(number + (1 if at_end else -1)) % len(edges)]
        if other.kind in ("fold", "dart") or other.name == side.edge:
            return None
        seam_end, outer_end = (side.place, at_end), ((side.piece, other.name), not at_end)
        pairs.append((seam_end, outer_end) if at_end else (outer_end, seam_end))
        outer.append(outer_end)
    runs_on = " to ".join(f"{piece}.{edge}" for (piece, edge), _ in outer)
    wanted = np.pi / 2 * len(sides)
    return _Corner(place=f"{line}: {runs_on}", ends=tuple(pairs), outer=tuple(outer), wanted=wanted)


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
    return unit(away)


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
    # An end moves up to the first corner inside the curve at most.
    arrive, leave = curve.bezier[:-1, 3] - curve.bezier[:-1, 2], curve.bezier[1:, 1] - curve.bezier[1:, 0]
    angle = np.arctan2(arrive[:, 0] * leave[:, 1] - arrive[:, 1] * leave[:, 0], np.einsum("ij,ij->i", arrive, leave))
    kinks = np.flatnonzero(np.abs(angle) > KINK)
    count = int(kinks[0]) + 1 if len(kinks) else len(curve.bezier)
    reach = min(reach, Curve(bezier=curve.bezier[:count], straight=curve.straight[:count]).length)
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


class _Stretch:
    """The first stretch of a curve, by its length.

    Attributes:
        reach: its length [m].
        rest: Béziers (#S by 4 by 2) and straightness of what follows.
    """

    def __init__(self, curve: Curve, reach: float) -> None:
        t = np.linspace(0.0, 1.0, POINTS // 4 + 1)
        s = 1 - t
        slopes = np.stack([-3 * s**2, 3 * s**2 - 6 * s * t, 6 * s * t - 3 * t**2, 3 * t**2], axis=1)
        places, tangents, reached, total, number, at = [], [], [], 0.0, 0, 1.0
        for number in range(len(curve.bezier)):
            line, tangent = cubic_weights(t) @ curve.bezier[number], slopes @ curve.bezier[number]
            arc = total + arc_lengths(line)
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
            rest = np.concatenate([split_bezier(curve.bezier[number], at)[1][None], rest])
            straight = curve.straight[number:]
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
        """Return the least bend back that keeps the length, or the one that keeps it best."""
        u = np.linspace(0.0, 1.0, POINTS + 1)
        place, normal, _ = self._frame(u)
        move, _ = _move(slope, BENDS_BACK[:, None], self.reach, u)
        step = np.diff(place + move[..., None] * normal, axis=1)
        # Without a turn all is as long as it was; what the points of the stretch lose by their chords is left out.
        chords = np.linalg.norm(np.diff(place, axis=0), axis=1).sum()
        change = np.sqrt((step**2).sum(axis=2)).sum(axis=1) - chords
        crossed = np.flatnonzero(change[:-1] * change[1:] <= 0.0)
        if not len(crossed):
            return float(BENDS_BACK[np.abs(change).argmin()])
        k = int(crossed[0])
        share = change[k] / (change[k] - change[k + 1]) if change[k] != change[k + 1] else 0.0
        return float(BENDS_BACK[k] + share * (BENDS_BACK[k + 1] - BENDS_BACK[k]))


def _interpolated(at: FloatArray, arc: FloatArray, values: FloatArray) -> FloatArray:
    """Interpolate vectors (#P by 2) at lengths."""
    return np.column_stack([np.interp(at, arc, values[:, axis]) for axis in range(2)])
