"""Sheets of a printed pattern: paper sizes, and how pieces are spread over tiles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.pattern.draft import nest_label
from warpflat.pattern.layout import Sheet

if TYPE_CHECKING:
    pass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    pass

__all__ = ["LEGEND_SIZE", "SIZE_COLOURS", "SIZE_DASHES", "Paper", "Tiling"]

#: Dashes [mm] by which sizes are told apart on paper, also without colour.
SIZE_DASHES: tuple[tuple[float, ...], ...] = (
    (),
    (8, 2),
    (3, 2),
    (10, 2, 2, 2),
    (1, 1.5),
    (6, 1.5, 1, 1.5, 1, 1.5),
    (14, 3),
)


SIZE_COLOURS = ("#000000", "#0060a8", "#b8460b", "#5b2a86", "#00766c", "#8a6d00", "#9b1b5a")


@dataclass(frozen=True, kw_only=True)
class Paper:
    """A sheet of paper: `width`, `height`, the `margin` that printers leave white, the `overlap` of tiles, all [m]."""

    name: str
    width: float
    height: float
    margin: float
    overlap: float

    @property
    def step(self) -> FloatArray:
        """How far one tile lies from the next [m], across and up."""
        return np.array([self.width, self.height]) - 2 * self.margin - self.overlap

    @property
    def tiled(self) -> bool:
        """True for papers so small that a piece spreads over several."""
        return self.width < 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Tiling:
    """Which tiles of a sheet are printed: rows from the top, columns from the left, and their pages in order.

    `joined` is false where no piece spreads over two tiles.
    """

    paper: Paper
    rows: int
    columns: int
    tiles: tuple[tuple[int, int], ...]
    sheet: Sheet
    joined: bool = True

    def corner(self, row: int, column: int) -> FloatArray:
        """Lower left of a tile on the sheet [m]."""
        step = self.paper.step
        return np.array([column * step[0], float(self.sheet.size[1]) - (row + 1) * step[1] - self.paper.overlap])

    def name(self, row: int, column: int) -> str:
        """As "B3": second row, third column."""
        letters = ""
        row += 1
        while row:
            row, digit = divmod(row - 1, 26)
            letters = chr(ord("A") + digit) + letters
        return f"{letters}{column + 1}"


def make_tiling(sheet: Sheet, paper: Paper) -> Tiling:
    import shapely

    step = paper.step
    columns = max(1, int(np.ceil((sheet.size[0] - paper.overlap) / step[0] - 1e-9)))
    rows = max(1, int(np.ceil((sheet.size[1] - paper.overlap) / step[1] - 1e-9)))
    tiling = Tiling(paper=paper, rows=rows, columns=columns, tiles=(), sheet=sheet)
    shapes = [shapely.Polygon(piece.cut_line + placed.offset) for placed in sheet.placed for piece in placed.pieces]
    labels = [(nest_label(placed.pieces), placed.offset) for placed in sheet.placed]
    shapes += [shapely.Polygon(label.box + offset) for label, offset in labels if label.leader is not None]
    if sheet.reserved is not None:
        shapes.append(shapely.box(*sheet.reserved, *(sheet.reserved + LEGEND_SIZE)))
    tree = shapely.STRtree(shapes)
    tiles = []
    for row in range(rows):
        for column in range(columns):
            # The strips on the right and below belong to the neighbours, but for the last ones.
            low, high = tiling.corner(row, column), tiling.corner(row, column) + step
            high += np.array([paper.overlap if column == columns - 1 else 0.0, paper.overlap])
            low += np.array([0.0, 0.0 if row == rows - 1 else paper.overlap])
            if len(tree.query(shapely.box(*low, *high), predicate="intersects")):
                tiles.append((row, column))
    cells = [
        shapely.box(*c, *(c + step)) for c in (tiling.corner(*tile) + np.array([0.0, paper.overlap]) for tile in tiles)
    ]
    joined = any(sum(cell.intersects(shape) for cell in cells) > 1 for shape in shapes)
    return replace(tiling, tiles=tuple(tiles), joined=joined)


#: Width and height [m] of the block that :func:`draw_legend` draws.
LEGEND_SIZE = (0.180, 0.128)
