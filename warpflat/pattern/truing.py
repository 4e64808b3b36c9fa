"""Corners trued: where pieces meet at the end of a seam, the edge that runs on across it is smooth once it is sewn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.pattern.curves import Curve
from warpflat.pattern.end_turn import REACH, end_direction, turned_end
from warpflat.pattern.fitting import EdgeKey
from warpflat.pattern.piece_parts import Edge
from warpflat.pattern.pieces import Piece, Seam, SeamSide

__all__ = ["CornerReport", "true_corners"]

#: Corners whose angles are this [rad] or more from running on are meant to be corners.
MEANT = np.radians(20.0)
#: Turns less than this [rad] are left out.
LEAST_TURN = np.radians(0.05)
#: Turned edges are turned again for what bounds and kept lengths have left, so many times.
ROUNDS = 2

#: The end of an edge: the edge, and whether it is its last point.
End = tuple[EdgeKey, bool]


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

    def angle(self, curves: Mapping[EdgeKey, Curve]) -> float:
        """Return the sum of the angles [rad]."""
        return sum(_inner_angle(curves[arrive[0]], curves[leave[0]]) for arrive, leave in self.ends)


def true_corners(
    pieces: Sequence[Piece], seams: Sequence[Seam], curves: Mapping[EdgeKey, Curve]
) -> tuple[dict[EdgeKey, Curve], list[CornerReport]]:
    """Turn the ends of edges until the edges run on smoothly across seams and closed darts, and meet folds squarely.

    The turns are the smallest, by least squares over all corners, so that each piece takes its half of a difference.
    An end is turned over its last 30 to 60 mm and moves at most 3 mm; an edge that is sewn keeps its length. Legs of
    darts and edges on a fold stay. Corners more than 20 degrees from running on are left: they are meant.

    Args:
        pieces: of one size.
        seams: between them.
        curves: of all edges, in their piece's direction.

    Returns:
        All curves, and a report on each corner.
    """
    start = dict(curves)
    corners = [
        corner
        for corner in _distinct([*_seam_corners(pieces, seams), *_fold_corners(pieces)])
        if abs(corner.angle(start) - corner.wanted) < MEANT
    ]
    sewn = {(side.piece, side.edge) for seam in seams for row in seam.sides for side in row}
    turns: dict[End, float] = {}
    trued, moves = dict(start), dict[End, float]()
    for _ in range(ROUNDS):
        for end, turn in _least_turns(corners, trued).items():
            turns[end] = turns.get(end, 0.0) + turn
        trued, moves = _turned(start, turns, sewn)
        trued, moves = _without_crossings(pieces, start, trued, moves)
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


def _least_turns(corners: Sequence[_Corner], curves: Mapping[EdgeKey, Curve]) -> dict[End, float]:
    """Return the smallest turns outwards [rad] of edges' ends that give all corners their wanted angles."""
    ends = sorted({end for corner in corners for end in corner.outer})
    if not ends:
        return {}
    place = {end: k for k, end in enumerate(ends)}
    rates = np.zeros((len(corners), len(ends)))
    for row, corner in zip(rates, corners, strict=True):
        for end in (end for pair in corner.ends for end in pair):
            if end in place:
                row[place[end]] += 1.0
    missing = np.array([corner.wanted - corner.angle(curves) for corner in corners])
    solved = np.linalg.lstsq(rates, missing, rcond=1e-9)[0]
    return {end: float(turn) for end, turn in zip(ends, solved, strict=True) if abs(turn) > LEAST_TURN}


def _turned(
    start: Mapping[EdgeKey, Curve], turns: Mapping[End, float], sewn: set[EdgeKey]
) -> tuple[dict[EdgeKey, Curve], dict[End, float]]:
    """Return all curves with their ends turned, and the largest move [m] of each end."""
    curves, moves = dict(start), {}
    for (key, at_end), turn in turns.items():
        curve, reach = curves[key], min(REACH, 0.45 * start[key].length)
        # The outside lies to the right of a curve in its piece's direction.
        flipped = curve.reversed() if at_end else curve
        result, move = turned_end(flipped, turn if at_end else -turn, reach, keep_length=key in sewn)
        curves[key], moves[key, at_end] = (result.reversed() if at_end else result), move
    return curves, moves


def _without_crossings(
    pieces: Sequence[Piece], start: Mapping[EdgeKey, Curve], trued: dict[EdgeKey, Curve], moves: dict[End, float]
) -> tuple[dict[EdgeKey, Curve], dict[End, float]]:
    """Return the curves, with those of a piece as they were where its border would cross itself."""
    import shapely

    for piece in pieces:
        keys = [(piece.name, edge.name) for edge in piece.edges]
        if all(trued[key] is start[key] for key in keys):
            continue
        outlines = [
            shapely.Polygon(np.concatenate([curves[key].sample()[:-1] for key in keys])) for curves in (start, trued)
        ]
        if outlines[0].is_valid and not outlines[1].is_valid:
            trued = trued | {key: start[key] for key in keys}
            moves = {end: move for end, move in moves.items() if end[0] not in keys}
    return trued, moves


def _inner_angle(arrive: Curve, leave: Curve) -> float:
    """Return the angle [rad] inside a piece between an edge and the next one, counter-clockwise."""
    (x, y), (u, v) = -end_direction(arrive.reversed()), end_direction(leave)
    return float(np.pi - np.arctan2(x * v - y * u, x * u + y * v))


def _seam_corners(pieces: Sequence[Piece], seams: Sequence[Seam]) -> Iterator[_Corner]:
    """Yield the corners at both ends of every seam, and at the mouth of every dart."""
    by_name = {piece.name: piece for piece in pieces}
    for seam in seams:
        for last in (False, True):
            sides = [row[-1 if last else 0] for row in seam.sides]
            corner = _corner_between(by_name, seam.name, [(side, last != side.reversed) for side in sides])
            if corner is not None:
                yield corner
    for piece in pieces:
        for dart in piece.darts:
            left, right = (SeamSide(piece=piece.name, edge=name) for name in (dart.left, dart.right))
            corner = _corner_between(by_name, dart.name, [(left, False), (right, True)])
            if corner is not None:
                yield corner


def _corner_between(pieces: Mapping[str, Piece], seam: str, sides: Sequence[tuple[SeamSide, bool]]) -> _Corner | None:
    """Return the corner at which the edges beside both sides of a seam run on; None where one is no such edge.

    Args:
        pieces: by name.
        seam: its name.
        sides: each side's edge, and whether its last point is the corner.
    """
    # The ends of a strip are cut straight across, wherever on a piece they come to lie.
    if len({pieces[side.piece].role == "strip" for side, _ in sides}) > 1:
        return None
    pairs, outer = [], []
    for side, at_end in sides:
        edges = pieces[side.piece].edges
        number = [edge.name for edge in edges].index(side.edge)
        other = edges[(number + (1 if at_end else -1)) % len(edges)]
        if other.kind in ("fold", "dart") or other.name == side.edge:
            return None
        seam_end, outer_end = ((side.piece, side.edge), at_end), ((side.piece, other.name), not at_end)
        pairs.append((seam_end, outer_end) if at_end else (outer_end, seam_end))
        outer.append(outer_end)
    runs_on = " to ".join(f"{piece}.{edge}" for (piece, edge), _ in outer)
    return _Corner(place=f"{seam}: {runs_on}", ends=tuple(pairs), outer=tuple(outer), wanted=np.pi)


def _fold_corners(pieces: Sequence[Piece]) -> Iterator[_Corner]:
    """Yield the corners at both ends of every fold."""
    for piece in pieces:
        for number, fold in enumerate(piece.edges):
            if fold.kind != "fold":
                continue
            for at_end in (False, True):
                other: Edge = piece.edges[(number + (1 if at_end else -1)) % len(piece.edges)]
                if other.kind in ("fold", "dart"):
                    continue
                ends: tuple[End, End] = (((piece.name, fold.name), at_end), ((piece.name, other.name), not at_end))
                yield _Corner(
                    place=f"{piece.name}.{fold.name}: {other.name}",
                    ends=(ends if at_end else ends[::-1],),
                    outer=(ends[1],),
                    wanted=np.pi / 2,
                )


def _distinct(corners: Sequence[_Corner]) -> list[_Corner]:
    """Return the corners, each set of ends once."""
    return list({frozenset(corner.ends): corner for corner in corners}.values())
