"""The pieces of a picture that were drafted, not flattened: collars, cuffs, waistbands, ruffles, pockets; outlines in rows at its foot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.patches import Polygon

from warpflat.core import FloatArray
from warpflat.flat import Surface
from warpflat.pattern.export.figure import GREY, INK, Pen
from warpflat.pattern.export.picture_page import draw_scale_bar, pack_rows

__all__ = ["DraftedOutline", "DraftedRows", "worn_words"]

_CLOTH = (0.95, 0.94, 0.91)
# Heading, room for a name above each outline, and gaps between outlines [in].
_HEADING, _NAME, _GAP = 0.36, 0.20, 0.22
_SIZE, _HEADING_SIZE = 8.0, 9.5  # [pt]


@dataclass(frozen=True, kw_only=True, eq=False)
class DraftedOutline:
    """A drafted piece.

    Attributes:
        name: that is written above it.
        points: #P by 2 [m], its sewing line, closed, the first point not repeated.
        worn: its copies where they are worn; none of what lies within the garment.
    """

    name: str
    points: FloatArray
    worn: Sequence[Surface] = ()


def worn_words(pieces: Sequence[DraftedOutline]) -> str:
    """Return what the body shows of drafted pieces, in words, and which lie within the garment."""
    within = dict.fromkeys(each.name.partition(", ")[0] for each in pieces if not each.worn)
    shown = ["grey: drafted for its edges, laid by its seams"] if any(each.worn for each in pieces) else []
    return "; ".join([*shown, *([f"not shown on the body: {', '.join(within)}"] if within else [])])


class DraftedRows:
    """Outlines in rows, longer side across.

    Attributes:
        height: of all rows [in].
    """

    def __init__(self, pen: Pen, pieces: Sequence[DraftedOutline], width: float, page_scale: float) -> None:
        """Lay the pieces out.

        Args:
            pen: that measures words.
            pieces: what is drawn.
            width: of the rows [in].
            page_scale: of the other pieces [in/m]; where the longest piece does not fit at that, all are drawn smaller.
        """
        outlines = []
        for piece in pieces:
            wide, high = np.ptp(piece.points, axis=0)
            upright = np.column_stack([piece.points[:, 1], -piece.points[:, 0]])
            outlines.append(piece.points if wide >= high else upright)
        self._scale = min(page_scale, (width - _GAP) / max(float(np.ptp(points[:, 0])) for points in outlines))
        self._smaller = self._scale < page_scale * (1.0 - 1e-9)
        self._names = [piece.name for piece in pieces]
        self._outlines = [self._scale * points for points in outlines]
        sizes = [
            (
                max(float(np.ptp(points[:, 0])), pen.measure(name, _SIZE)[0]) + _GAP,
                float(np.ptp(points[:, 1])) + _NAME + _GAP,
            )
            for name, points in zip(self._names, self._outlines, strict=True)
        ]
        # A name that is wider than the page is shortened where it is written.
        sizes = [(min(wide, width), high) for wide, high in sizes]
        self._places, _, tall = pack_rows(sizes, width)
        self.height = tall + _HEADING

    def draw(self, pen: Pen, left: float, top: float) -> None:
        """Draw the rows with their upper left corner at (`left`, `top`) [in]."""
        heading = "drafted for the edges that they are sewn to"
        pen.write(left, top - 0.14, heading, _HEADING_SIZE, color=GREY, fontstyle="italic")
        if self._smaller:
            draw_scale_bar(pen, left + pen.measure(heading, _HEADING_SIZE)[0] + 0.25, top - 0.17, self._scale)
        top -= _HEADING
        for name, points, (across, down) in zip(self._names, self._outlines, self._places, strict=True):
            pen.write(left + across, top - down - 0.5 * _NAME, name, _SIZE)
            corner = np.array([left + across, top - down - _NAME])
            at = corner + (points - [points[:, 0].min(), points[:, 1].max()])
            pen.axes.add_patch(Polygon(at, facecolor=_CLOTH, edgecolor=INK, linewidth=0.8, zorder=3))
