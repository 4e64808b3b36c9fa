"""Silhouettes of views: what of its box a view covers, so that views and words can stand close to each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.export.picture_views import View
from warpflat.export.raster import rasterise

__all__ = ["BETWEEN", "HEADING", "Silhouette", "Words", "heading_room", "place_views"]

_COLUMNS = 120  # along the width of a view
HEADING = 0.34  # [in], as all that follows: above the cloth, with its heading
BETWEEN = 0.34  # cloth of a view from that of the view above, with names between
_ABOVE = 0.2  # cloth below words, with a name between
_HALF_HEADING = 0.4


class Silhouette:
    """How far the cloth of a view lies from the upper and the lower edge of its box, in columns of one width.

    Attributes:
        width, height: of the box [m].
        below_top: #C, from the upper edge down to the cloth [m]; infinite in a column without cloth.
        above_bottom: #C, likewise from the lower edge up.
        area: that the view covers [m2].
    """

    def __init__(self, view: View) -> None:
        width, height = (max(float(size), 1e-9) for size in view.size[:2])
        self.width, self.height = width, height
        pitch = width / _COLUMNS
        rows = int(np.clip(np.ceil(height / pitch), 1, 10 * _COLUMNS))
        grid = np.empty((len(view.points), 3))
        grid[:, 0] = (view.points[:, 0] - view.low[0]) / pitch
        grid[:, 1] = rows * (1.0 - (view.points[:, 1] - view.low[1]) / height)
        grid[:, 2] = view.points[:, 2]
        covered = rasterise(grid, view.facets.triangles, (rows, _COLUMNS)).triangle >= 0
        any_cloth, step = covered.any(axis=0), height / rows
        self.below_top = np.where(any_cloth, covered.argmax(axis=0) * step, np.inf)
        self.above_bottom = np.where(any_cloth, covered[::-1].argmax(axis=0) * step, np.inf)
        self.area = float(covered.sum()) * pitch * step

    def columns(self, left: float, right: float) -> slice:
        """Return the columns between two places, measured from the left edge [m]."""
        first, last = (int(np.floor(place / self.width * _COLUMNS)) for place in (left, right))
        return slice(max(first, 0), max(last + 1, 0))

    def room_above(self, left: float, right: float) -> float:
        """Return how far the cloth between two places lies below the upper edge [m]; infinite if there is none."""
        return float(self.below_top[self.columns(left, right)].min(initial=np.inf))

    def room_below(self, left: float, right: float) -> float:
        """Return how far the cloth between two places lies above the lower edge [m]; infinite if there is none."""
        return float(self.above_bottom[self.columns(left, right)].min(initial=np.inf))

    def overlap_below(self, lower: Silhouette, shift: float) -> float:
        """Return how far the box of another view may reach up into this one's, without cloth upon cloth [m].

        Args:
            lower: the view below.
            shift: of its left edge to the right of this one's [m].
        """
        places = (np.arange(_COLUMNS) + 0.5) * self.width / _COLUMNS - shift
        number = np.floor(places / lower.width * _COLUMNS).astype(int)
        inside = (number >= 0) & (number < _COLUMNS)
        gaps: FloatArray = self.above_bottom[inside] + lower.below_top[number[inside]]
        return float(gaps.min(initial=np.inf))


@dataclass(frozen=True, kw_only=True)
class Words:
    """A box of words above the views of a piece [in]: between `left` and `right`, down to `bottom` below the cell's upper edge."""

    left: float
    right: float
    bottom: float


def place_views(
    silhouettes: Sequence[Silhouette],
    scale: float,
    *,
    width: float,
    stacked: bool,
    words: Sequence[Words],
    top: float,
    has_headings: bool,
) -> list[tuple[float, float]]:
    """Place the views of a piece side by side or one below the other, as near to words and to each other as their outlines allow.

    Args:
        silhouettes: of the views, from the left or from the top.
        scale: [in/m].
        width: of the cell [in].
        stacked: whether they stand one below the other.
        words: above them.
        top: the highest place of a view, below the cell's upper edge [in].
        has_headings: whether a word stands above the middle of each view.

    Returns:
        For each view how far its box is to the right and below the cell's upper left corner [in].
    """
    sizes = [(scale * shape.width, scale * shape.height) for shape in silhouettes]
    spare = (width - sum(wide for wide, _ in sizes)) / len(sizes)
    places, left = list[tuple[float, float]](), 0.0
    for shape, (wide, _) in zip(silhouettes, sizes, strict=True):
        x = 0.5 * (width - wide) if stacked else left + 0.5 * spare
        left += wide + spare
        low = top
        for box in words:
            low = max(
                low, box.bottom + _ABOVE - scale * shape.room_above((box.left - x) / scale, (box.right - x) / scale)
            )
            if (
                has_headings
                and box.left < x + 0.5 * wide + _HALF_HEADING
                and box.right > x + 0.5 * wide - _HALF_HEADING
            ):
                low = max(low, box.bottom + HEADING - heading_room(shape, scale))
        if stacked and places:
            before, (x_before, low_before) = silhouettes[len(places) - 1], places[-1]
            bottom = low_before + scale * before.height
            low = max(low, bottom + BETWEEN - scale * before.overlap_below(shape, (x - x_before) / scale))
            if has_headings:
                middle = (x + 0.5 * wide - x_before) / scale
                above = before.room_below(middle - _HALF_HEADING / scale, middle + _HALF_HEADING / scale)
                low = max(low, bottom + BETWEEN + HEADING - heading_room(shape, scale) - scale * above)
        places.append((x, low))
    if not stacked:
        # The lower ones are as low as they must be; others stand in the middle of their room.
        floor = max(low + high for (_, low), (_, high) in zip(places, sizes, strict=True))
        places = [(x, 0.5 * (low + floor - high)) for (x, low), (_, high) in zip(places, sizes, strict=True)]
    return places


def heading_room(shape: Silhouette, scale: float) -> float:
    """Return how far the cloth below the heading of a view is from the view's upper edge [in]."""
    half = _HALF_HEADING / scale
    room = scale * shape.room_above(0.5 * shape.width - half, 0.5 * shape.width + half)
    return min(room, scale * shape.height)
