"""Boxes on a page or a table: in rows, or wherever there is room."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from warpflat.core import FloatArray

__all__ = ["pack_boxes", "pack_rows", "rows_on_table"]


def pack_rows(sizes: Sequence[tuple[float, float]], width: float) -> tuple[list[tuple[float, float]], float, float]:
    """Place boxes in turn from left to right, in rows one below the other; arguments and results as of :func:`pack_boxes`."""
    places, right, top, foot, widest = list[tuple[float, float]](), 0.0, 0.0, 0.0, 0.0
    for wide, high in sizes:
        if right + wide > width * (1.0 + 1e-9):
            right, top = 0.0, foot
        places.append((right, top))
        right, foot = right + wide, max(foot, top + high)
        widest = max(widest, right)
    return places, widest, foot


def rows_on_table(sizes: FloatArray, gap: float) -> FloatArray:
    """Return the lower left corner of each of several boxes, laid out in rows, so many that the whole is near to 16 by 9.

    Args:
        sizes: #B by 2 [m].
        gap: between boxes and between rows [m].
    """
    spaced = [(wide + gap, high + gap) for wide, high in sizes.tolist()]
    whole, widest = sum(wide for wide, _ in spaced), float(sizes[:, 0].max())

    def in_rows(rows: int) -> FloatArray:
        places, _, _ = pack_rows(spaced, max(1.05 * whole / rows, widest) + gap)
        left, top = np.array(places).T
        foot = top + sizes[:, 1]
        return np.column_stack([left, foot.max() - foot])

    def unlikeness(corners: FloatArray) -> float:
        wide, high = (corners + sizes).max(axis=0)
        return abs(math.log(max(wide, 1e-9) / max(high, 1e-9) * 9.0 / 16.0))

    return min(map(in_rows, range(1, 5)), key=unlikeness)


def pack_boxes(sizes: Sequence[tuple[float, float]], width: float) -> tuple[list[tuple[float, float]], float, float]:
    """Place boxes in turn, each as high as it goes and then as far to the left (bottom-left rule on a skyline).

    Burke, Kendall and Whitwell, "A new placement heuristic for the orthogonal stock-cutting problem", 2004, describe such skylines.

    Args:
        sizes: width and height of each box, no wider than the page.
        width: of the page.

    Returns:
        The left and upper edge of each box, measured from the page's upper left corner; the width and the height that they take.
    """
    # Where the free room begins: from each place to the right, up to the next place.
    skyline, places = [(0.0, 0.0)], []
    for wide, high in sizes:
        spots = [(_depth(skyline, left, wide), left) for left, _ in skyline if left + wide <= width * (1.0 + 1e-9)]
        top, left = min(spots)
        places.append((left, top))
        right, after = left + wide, _depth(skyline, left + wide, 0.0)
        skyline = [spot for spot in skyline if not left <= spot[0] <= right]
        skyline = sorted([*skyline, (left, top + high), (right, after)])
    taken = [(left + wide, top + high) for (left, top), (wide, high) in zip(places, sizes, strict=True)]
    return places, max(right for right, _ in taken), max(foot for _, foot in taken)


def _depth(skyline: Sequence[tuple[float, float]], left: float, wide: float) -> float:
    """Return how far down the boxes reach between `left` and `left + wide`."""
    before = [depth for start, depth in skyline if start <= left + 1e-9]
    return max([before[-1], *(depth for start, depth in skyline if left < start < left + wide - 1e-9)])
