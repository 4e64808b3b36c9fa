"""Seams that close a ring, as a crown's to the sides of a hat: they are sewn after those that run to an edge, which they cross."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.polyline import arc_lengths, points_at_lengths
from warpflat.pattern.pieces import Piece, Seam, SeamSide

__all__ = ["seam_rings"]

# A copy of a piece, and the number of the edge that begins at one of its corners.
_Corner = tuple[str, int, bool, int]
# An end of a seam: its number, and whether it is its last end.
_End = tuple[int, bool]

# Directions of edges are taken over this [m].
_NEAR = 0.01
# A seam runs straight on through a joint in another one if that parts the angles around the joint within this share of half.
_STRAIGHT = 0.15


def seam_rings(seams: Sequence[Seam], pieces: Mapping[str, Piece]) -> dict[str, int]:
    """Return the number of its ring for each seam that is part of one, by its name.

    A ring is a row of seams that run straight on into each other until they are back at the first. Around a joint of seams the angles of
    the pieces are added up: the seam opposite goes straight on. A ring is sewn when all that crosses it is sewn.

    Args:
        seams: of one size.
        pieces: by name.
    """
    # The corners of both sides at each end of a seam, and the ends of seams along the two edges of each corner.
    corners: dict[_End, tuple[_Corner, _Corner]] = {}
    at_corner: dict[_Corner, list[tuple[_End, int]]] = {}
    for number, seam in enumerate(seams):
        for last in (False, True):
            found = tuple(_corner(row[-1 if last else 0], pieces, last) for row in seam.sides)
            corners[number, last] = found[0], found[1]
            for side, corner in enumerate(found):
                at_corner.setdefault(corner, []).append(((number, last), side))

    def straight_on(end: _End) -> _End | None:
        turned, passed, here, side = 0.0, list[tuple[float, _End]](), end, 0
        while True:
            corner = corners[here][side]
            turned += _angle(corner, pieces)
            beyond = [each for each in at_corner[corner] if each != (here, side)]
            if len(beyond) != 1 or len(passed) > len(corners):
                # The edge of the garment, or a joint within a seam.
                return None
            here, side = beyond[0][0], 1 - beyond[0][1]
            if here == end:
                break
            passed.append((turned, here))
        share, opposite = min(((abs(t / turned - 0.5), each) for t, each in passed), default=(1.0, end))
        return opposite if share < _STRAIGHT else None

    rings: dict[str, int] = {}
    for first in range(len(seams)):
        if seams[first].name in rings:
            continue
        row, end = [first], (first, True)
        closed = any(len({corners[first, last][side] for last in (False, True)}) == 1 for side in (0, 1))
        while not closed and (following := straight_on(end)) is not None and len(row) <= len(seams):
            number, last = following
            if number == first:
                closed = True
                break
            row.append(number)
            end = number, not last
        if closed:
            ring = len(set(rings.values()))
            rings |= {seams[number].name: ring for number in row}
    return rings


def _corner(side: SeamSide, pieces: Mapping[str, Piece], last: bool) -> _Corner:
    """Return the corner of a piece at the first or last end of a seam's side."""
    edges = [edge.name for edge in pieces[side.piece].edges]
    number = edges.index(side.edge) + (last != side.reversed)
    return side.piece, side.copy, side.mirrored, number % len(edges)


def _angle(corner: _Corner, pieces: Mapping[str, Piece]) -> float:
    """Return the angle of a piece at a corner [rad]."""
    edges, number = pieces[corner[0]].edges, corner[-1]

    def away(points: FloatArray) -> FloatArray:
        return points_at_lengths(points, [min(_NEAR, float(arc_lengths(points)[-1]))])[0] - points[0]

    (x0, y0), (x1, y1) = away(edges[number].points), away(edges[number - 1].points[::-1])
    return float(np.arctan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1) % (2.0 * np.pi))
