"""Seams walked: the two sides of each laid upon each other, right sides together, with their notches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.polyline import points_at_lengths
from warpflat.pattern.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.notches import SeamLine
from warpflat.pattern.pieces import Seam

__all__ = ["WalkedSeam", "walk_seams"]

#: Sides are compared at so many places.
PLACES = 201


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkedSeam:
    """The two sides of a seam laid upon each other as near as they come.

    Attributes:
        name, size: of the seam.
        sides: #P by 2 [m] each, at the places that are sewn together; the pieces lie to the left, darts are closed.
        notches: #N by 2 [m] of each side.
        distance_mm: the largest distance of two places that are sewn together [mm].
        difference_mm: by how much the second side is too long for its ease [mm].
        notch_mm: the largest distance along the seam from a notch to the notch, or the joint, that it meets [mm]; None
            without notches.
    """

    name: str
    size: str
    sides: tuple[FloatArray, FloatArray]
    notches: tuple[FloatArray, FloatArray]
    distance_mm: float
    difference_mm: float
    notch_mm: float | None


def walk_seams(drafted: DraftedGarment) -> tuple[WalkedSeam, ...]:
    """Walk every seam of a drafted garment, in all its sizes."""
    return tuple(
        _walk(seam, {piece.name: piece for piece in pieces}, size)
        for size, pieces in drafted.pieces.items()
        for seam in drafted.garment.seams
    )


def _walk(seam: Seam, pieces: dict[str, DraftedPiece], size: str) -> WalkedSeam:
    """Lay the second side of a seam upon the first."""
    import shapely

    lines = [SeamLine(side, pieces) for side in seam.sides]
    shares = np.linspace(0.0, 1.0, PLACES)
    opposite = np.array([seam.reach(float(share), 1.0) for share in shares]) / (1.0 + seam.ease)
    # The edges of each side as one line, each running on from the one before, piece to the left.
    drawn = []
    for line in lines:
        joined = np.zeros((0, 2))
        for points, side in zip(line.lines, line.side, strict=True):
            part = points * [1.0, -1.0] if side.reversed else points
            if len(joined):
                (x, y), (u, v) = joined[-1] - joined[-2], part[1] - part[0]
                cosine, sine = np.array([x * u + y * v, u * y - v * x]) / (np.hypot(x, y) * np.hypot(u, v))
                part = (part - part[0]) @ np.array([[cosine, sine], [-sine, cosine]]) + joined[-1]
            joined = np.concatenate([joined, part[1:] if len(joined) else part])
        drawn.append(joined)
    first, second = (
        points_at_lengths(joined, part * line.length)
        for joined, part, line in zip(drawn, (shares, opposite), lines, strict=True)
    )
    # Kabsch: the turn that brings the places nearest to each other.
    middles = first.mean(axis=0), second.mean(axis=0)
    left, _, right = np.linalg.svd((second - middles[1]).T @ (first - middles[0]))
    turn = left @ np.diag([1.0, np.sign(np.linalg.det(left @ right))]) @ right
    second = (second - middles[1]) @ turn + middles[0]
    # The lengths [m] along each side at which its edges have notches, those of a turned copy included.
    marked = []
    for line in lines:
        found = {
            float(start + shapely.LineString(points).project(shapely.Point(notch.at)))
            for piece, edge, points, start in zip(line.pieces, line.edges, line.lines, line.joints, strict=False)
            for notch in piece.notches
            if notch.edge == edge.name
        }
        marked.append(np.array(sorted(found)))
    if seam.sides[0] == seam.sides[1]:
        notch_mm = 0.0 if len(marked[0]) else None
    else:
        # The largest distance from a notch to the nearest notch or joint of the other side.
        joints = [np.concatenate([row, line.joints]) for row, line in zip(marked, lines, strict=True)]
        reached = np.array([seam.reach(float(length), lines[0].length) for length in joints[0]])
        gaps = [float(np.abs(joints[1] - length).min()) for length in reached[: len(marked[0])]]
        gaps += [float(np.abs(reached - length).min()) for length in marked[1]]
        notch_mm = 1000.0 * max(gaps) if gaps else None
    notches = [points_at_lengths(line, lengths) for line, lengths in zip(drawn, marked, strict=True)]
    notches[1] = (notches[1] - middles[1]) @ turn + middles[0]
    return WalkedSeam(
        name=seam.name,
        size=size,
        sides=(first, second),
        notches=(notches[0], notches[1]),
        distance_mm=1000.0 * float(np.linalg.norm(first - second, axis=1).max()),
        difference_mm=1000.0 * (lines[1].length - lines[0].length * (1.0 + seam.ease)),
        notch_mm=notch_mm,
    )
