"""Cuts of a piece as they are sewn; those that do not open, such as a placket in flat cloth, are lines in the pattern."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, IntArray
from warpflat.flat import join_labels, seam_kind

if TYPE_CHECKING:
    from warpflat.flat import AppliedCut, Crack, Flattening

__all__ = ["CLOSED", "are_closed", "close_cuts", "seams_of_cuts"]

#: A cut whose sides lie nearer to each other than this [m] everywhere is a line, and legs of a dart that overlap by no more before
#: its tip are closed there: patterns are drawn to 0.1 mm.
CLOSED = 1e-4


def seams_of_cuts(result: Flattening) -> list[tuple[str, AppliedCut, Crack]]:
    """Return the seams of all cuts of a piece, each with its name in the pattern and its cut."""
    return [
        (cut.name if len(cut.seams) == 1 else f"{cut.name}_{number}", cut, seam)
        for cut in result.cuts
        for number, seam in enumerate(cut.seams, start=1)
    ]


def are_closed(positions: FloatArray, seam: Crack) -> bool:
    """Return whether a dart or a fish-eye dart lies closed in the plane (#P by 2 [m]); a seam between pieces never does."""
    if seam_kind(seam) == "parting":
        return False
    return bool(np.linalg.norm(positions[seam.left] - positions[seam.right], axis=1).max() < CLOSED)


def close_cuts(
    faces: IntArray, lines: Mapping[str, IntArray], seams: Mapping[str, Crack], *, count: int
) -> tuple[IntArray, dict[str, IntArray]]:
    """Return the faces (#F by 4) with the two sides of cuts joined, and the lines with one of each cut's name.

    Args:
        faces: of the cut surface, of `count` vertices.
        lines: feature lines by name.
        seams: the cuts to be closed, by name.
        count: of the vertices.
    """
    left = np.concatenate([np.asarray(seam.left, dtype=np.int64) for seam in seams.values()])
    right = np.concatenate([np.asarray(seam.right, dtype=np.int64) for seam in seams.values()])
    label = join_labels(count, left, right)
    _, first = np.unique(label, return_index=True)
    joined = first[label].astype(np.int32)
    whole = np.where(faces >= 0, joined[faces], -1).astype(np.int32)
    closed = {name: joined[seam.left] for name, seam in seams.items()}
    kept = {
        name: joined[line]
        for name, line in lines.items()
        if not any(np.isin(joined[line], other).all() for other in closed.values())
    }
    return whole, {**kept, **closed}
