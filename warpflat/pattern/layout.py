"""Pieces side by side on a sheet, grain upwards, for screens and printers (the marker packs cloth instead)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.pattern.draft import nest_label
from warpflat.pattern.drafted import DraftedGarment, DraftedPiece

__all__ = ["Placed", "Sheet", "lay_out", "nests", "taken_by"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """A piece in one or more sizes, shifted by `offset` [m]; `box` is its lower left and upper right on the sheet."""

    pieces: tuple[DraftedPiece, ...]
    offset: FloatArray
    box: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Sheet:
    """What lies where; `size` [m] is the width and height in use, the origin its lower left.

    `reserved` is the lower left [m] of the block that was asked to be kept free, None without one.
    """

    placed: tuple[Placed, ...]
    size: FloatArray
    reserved: FloatArray | None = None


def nests(garment: DraftedGarment) -> list[tuple[DraftedPiece, ...]]:
    """Each piece with all its drafted sizes."""
    first = next(iter(garment.pieces.values()))
    return [garment.all_sizes(piece.name) for piece in first]


def taken_by(group: Sequence[DraftedPiece]) -> FloatArray:
    """#P by 2 [m], the cut lines of pieces that lie upon each other, and the corners of a label beside them."""
    label = nest_label(group)
    return np.concatenate([*(piece.cut_line for piece in group), *([] if label.leader is None else [label.box])])


def lay_out(
    groups: Sequence[tuple[DraftedPiece, ...]],
    *,
    width: float,
    gap: float = 0.010,
    page_height: float | None = None,
    reserved: tuple[float, float] | None = None,
) -> Sheet:
    """Rows of pieces from top to bottom, the tallest first.

    Args:
        groups: pieces that lie upon each other (a nest of sizes, or a single piece).
        width: of the sheet [m]; a wider group gets a row of its own and the sheet grows.
        gap: between pieces and to the sheet's border [m].
        page_height: [m]; a row that would cross a multiple of it starts at the next one, if it fits on a page.
        reserved: width and height [m] of a block that is kept free; the sheet says where.
    """
    boxes = []
    for group in groups:
        points = taken_by(group)
        boxes.append((points.min(axis=0), points.max(axis=0)))
    extents = [high - low for low, high in boxes] + ([np.array(reserved)] if reserved is not None else [])
    rows = _rows(extents, width, gap)
    top, spots = 0.0, {}
    for row in rows:
        height = max(float(extents[i][1]) for i, _ in row)
        if page_height is not None and height + 2 * gap <= page_height:
            page = int(top // page_height + 1e-9)
            if top + height + 2 * gap > (page + 1) * page_height + 1e-9:
                top = (page + 1) * page_height
        for i, x in row:
            spots[i] = np.array([x, top + gap + float(extents[i][1])])
        top += height + gap
    total = np.array([max(spots[i][0] + extents[i][0] for i in spots), top]) + gap
    corners = {i: np.array([spot[0], total[1] - spot[1]]) for i, spot in spots.items()}
    placed = []
    for i, group in enumerate(groups):
        offset = corners[i] - boxes[i][0]
        placed.append(Placed(pieces=tuple(group), offset=offset, box=np.stack([corners[i], corners[i] + extents[i]])))
    return Sheet(placed=tuple(placed), size=total, reserved=corners.get(len(groups)))


def _rows(extents: Sequence[FloatArray], width: float, gap: float) -> list[list[tuple[int, float]]]:
    """Rows of (box, left edge): boxes by falling height, each in the first row with room (first fit decreasing)."""
    rows: list[list[tuple[int, float]]] = []
    ends: list[float] = []
    for i in sorted(range(len(extents)), key=lambda i: (-float(extents[i][1]), i)):
        wide = float(extents[i][0])
        fits = [r for r, end in enumerate(ends) if end + gap + wide + gap <= width + 1e-9]
        if fits:
            rows[fits[0]].append((i, ends[fits[0]] + gap))
            ends[fits[0]] += gap + wide
        else:
            rows.append([(i, gap)])
            ends.append(gap + wide)
    return rows
