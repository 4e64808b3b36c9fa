"""Seams walked: the second side of each laid along the first by its length, right sides together, with the notches of both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpflat.core import FloatArray, points_at_lengths
from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece, SeamReport
from warpflat.pattern.drafting.notches import SeamLine, copied_together, opposite_length

__all__ = ["WalkedSeam", "walk_seams"]


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkedSeam:
    """The two sides of a seam laid along each other, as they are sewn: a convex one along a hollow one too.

    Attributes:
        report: the lengths of both sides, and how far their notches miss each other.
        line: #P by 2 [m], the first side; its pieces lie to the left, darts are closed.
        notches: #N by 2 [m] of each side, at the places of that line where they come to lie.
    """

    report: SeamReport
    line: FloatArray
    notches: tuple[FloatArray, FloatArray]


def walk_seams(drafted: DraftedGarment) -> tuple[WalkedSeam, ...]:
    """Walk every seam of a drafted garment, in all its sizes."""
    reports, groups = {(seam.name, seam.size): seam for seam in drafted.seams}, copied_together(drafted.pattern.seams)
    walked = []
    for size, row in drafted.pieces.items():
        pieces: dict[str, DraftedPiece] = {piece.name: piece for piece in row}
        for seam in drafted.pattern.seams:
            lines = [SeamLine(side, pieces) for side in seam.sides]
            # The edges of the first side as one line, each running on from the one before, piece to the left.
            joined = np.zeros((0, 2))
            for points, side in zip(lines[0].lines, lines[0].side, strict=True):
                part = points * [1.0, -1.0] if side.reversed else points
                if len(joined):
                    (x, y), (u, v) = joined[-1] - joined[-2], part[1] - part[0]
                    cosine, sine = np.array([x * u + y * v, u * y - v * x]) / (np.hypot(x, y) * np.hypot(u, v))
                    part = (part - part[0]) @ np.array([[cosine, sine], [-sine, cosine]]) + joined[-1]
                joined = np.concatenate([joined, part[1:] if len(joined) else part])
            first, second = (line.marked(groups[seam.name]) for line in lines)
            second = np.array([opposite_length(seam, lines, 1, float(at)) for at in second])
            walked.append(
                WalkedSeam(
                    report=reports[seam.name, size],
                    line=joined,
                    notches=(points_at_lengths(joined, first), points_at_lengths(joined, second)),
                )
            )
    return tuple(walked)
