"""Pieces side by side on a sheet, grain upwards, for screens and printers (the marker packs cloth instead)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core import FloatArray
from warpflat.pattern.drafting.draft import nest_label
from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.drafting.polygons import mapped

__all__ = ["Placed", "Sheet", "covered_rings", "lay_out", "nests"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """A piece in one or more sizes on a sheet.

    Attributes:
        pieces: upon each other.
        matrix: 2 by 3, from the pieces' coordinates to the sheet's [m]: a turn and a shift.
    """

    pieces: tuple[DraftedPiece, ...]
    matrix: FloatArray

    @property
    def offset(self) -> FloatArray:
        """Shift from the pieces' coordinates to the sheet's [m]."""
        return self.matrix[:, 2]

    def on_sheet(self, points: FloatArray) -> FloatArray:
        """Return points of the pieces (#P by 2 [m]) on the sheet."""
        return mapped(points, self.matrix)

    def on_piece(self, points: FloatArray) -> FloatArray:
        """Return points of the sheet (#P by 2 [m]) in the pieces' coordinates."""
        return (points - self.matrix[:, 2]) @ self.matrix[:, :2]


@dataclass(frozen=True, kw_only=True, eq=False)
class Sheet:
    """Pieces on a sheet, whose origin is its lower left.

    Attributes:
        placed: where each lies.
        size: width and height in use [m].
        reserved: lower left [m] of the block that is kept free; None without one.
    """

    placed: tuple[Placed, ...]
    size: FloatArray
    reserved: FloatArray | None = None


def nests(garment: DraftedGarment) -> list[tuple[DraftedPiece, ...]]:
    """Return each piece in all its drafted sizes."""
    return [garment.all_sizes(name) for name in garment.piece_names]


def covered_rings(group: Sequence[DraftedPiece]) -> list[FloatArray]:
    """Return what pieces that lie upon each other cover: their cut lines, and the box of a label beside them (#P by 2 [m] each)."""
    label = nest_label(group)
    return [*(piece.cut_line for piece in group), *([] if label.leader is None else [label.box])]


def lay_out(
    groups: Sequence[tuple[DraftedPiece, ...]],
    *,
    width: float = 1.5,
    gap: float = 0.010,
    page_height: float | None = None,
    reserved: tuple[float, float] | None = None,
) -> Sheet:
    """Lay pieces in rows from top to bottom, the tallest first.

    Args:
        groups: pieces that lie upon each other (a nest of sizes, or a single piece).
        width: of the sheet [m]; a wider group gets a row of its own and the sheet grows.
        gap: between pieces and to the sheet's border [m].
        page_height: [m]; a row that would cross a multiple of it starts at the next one, if it fits on a page.
        reserved: width and height [m] of a block that is kept free; the sheet says where.
    """
    boxes = []
    for group in groups:
        points = np.concatenate(covered_rings(group))
        boxes.append((points.min(axis=0), points.max(axis=0)))
    extents = [high - low for low, high in boxes] + ([np.array(reserved)] if reserved is not None else [])
    # Boxes by falling height, each in the first row with room: (box, left edge).
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
    top, places = 0.0, {}
    for row in rows:
        height = max(float(extents[i][1]) for i, _ in row)
        if page_height is not None and height + 2 * gap <= page_height:
            page = int(top // page_height + 1e-9)
            if top + height + 2 * gap > (page + 1) * page_height + 1e-9:
                top = (page + 1) * page_height
        for i, x in row:
            places[i] = np.array([x, top + gap + float(extents[i][1])])
        top += height + gap
    total = np.array([max(places[i][0] + extents[i][0] for i in places), top]) + gap
    corners = {i: np.array([place[0], total[1] - place[1]]) for i, place in places.items()}
    placed = []
    for i, group in enumerate(groups):
        matrix = np.column_stack([np.eye(2), corners[i] - boxes[i][0]])
        placed.append(Placed(pieces=tuple(group), matrix=matrix))
    return Sheet(placed=tuple(placed), size=total, reserved=corners.get(len(groups)))
