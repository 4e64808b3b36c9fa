"""Sheets of a printed pattern: paper sizes, and how pieces are spread over tiles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.pattern.draft import nest_label
from warpflat.pattern.layout import Sheet

if TYPE_CHECKING:
    from shapely import Polygon

__all__ = ["LEGEND_SIZE", "SIZE_COLOURS", "SIZE_DASHES", "Paper", "Tiling", "make_tiling"]

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
    """A kind of paper.

    Attributes:
        name: for the reader.
        width, height: [m].
        margin: what printers leave white [m].
        overlap: of neighbouring tiles [m].
    """

    name: str
    width: float
    height: float
    margin: float
    overlap: float

    @property
    def step(self) -> FloatArray:
        """Distance from one tile to the next [m], across and up."""
        return np.array([self.width, self.height]) - 2 * self.margin - self.overlap

    @property
    def tiled(self) -> bool:
        """True if the paper is so small that a piece spreads over several sheets."""
        return self.width < 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Tiling:
    """The tiles of a sheet that are printed.

    Attributes:
        paper: of one tile.
        rows, columns: rows count from the top, columns from the left.
        tiles: (row, column) of each page, in their order.
        sheet: what is printed.
        joined: whether a piece spreads over two tiles.
    """

    paper: Paper
    rows: int
    columns: int
    tiles: tuple[tuple[int, int], ...]
    sheet: Sheet
    joined: bool = True

    def corner(self, row: int, column: int) -> FloatArray:
        """Return the lower left of a tile on the sheet [m]."""
        step = self.paper.step
        return np.array([column * step[0], float(self.sheet.size[1]) - (row + 1) * step[1] - self.paper.overlap])

    def name(self, row: int, column: int) -> str:
        """Return the name of a tile, such as "B3" for the second row and the third column."""
        letters = ""
        row += 1
        while row:
            row, digit = divmod(row - 1, 26)
            letters = chr(ord("A") + digit) + letters
        return f"{letters}{column + 1}"


#: Width and height [m] of the legend's block.
LEGEND_SIZE = (0.180, 0.128)


def make_tiling(sheet: Sheet, paper: Paper) -> Tiling:
    """Choose the tiles of a sheet on which something is drawn."""
    step = paper.step
    columns = max(1, int(np.ceil((sheet.size[0] - paper.overlap) / step[0] - 1e-9)))
    rows = max(1, int(np.ceil((sheet.size[1] - paper.overlap) / step[1] - 1e-9)))
    tiling = Tiling(paper=paper, rows=rows, columns=columns, tiles=(), sheet=sheet)
    shapes = _drawn_shapes(sheet)
    tiles = _drawn_tiles(tiling, shapes)
    return replace(tiling, tiles=tiles, joined=_is_joined(tiling, tiles, shapes))


def _drawn_shapes(sheet: Sheet) -> list[Polygon]:
    """Return the areas of a sheet that are drawn on: pieces, labels beside them, the reserved block."""
    import shapely

    shapes = [shapely.Polygon(piece.cut_line + placed.offset) for placed in sheet.placed for piece in placed.pieces]
    labels = [(nest_label(placed.pieces), placed.offset) for placed in sheet.placed]
    shapes += [shapely.Polygon(label.box + offset) for label, offset in labels if label.leader is not None]
    if sheet.reserved is not None:
        shapes.append(shapely.box(*sheet.reserved, *(sheet.reserved + LEGEND_SIZE)))
    return shapes


def _drawn_tiles(tiling: Tiling, shapes: Sequence[Polygon]) -> tuple[tuple[int, int], ...]:
    """Return the tiles on which a part of a shape lies."""
    import shapely

    paper, tree = tiling.paper, shapely.STRtree(shapes)
    tiles = []
    for row in range(tiling.rows):
        for column in range(tiling.columns):
            # The strips on the right and below belong to the neighbours, except on the last tiles.
            low, high = tiling.corner(row, column), tiling.corner(row, column) + paper.step
            high += np.array([paper.overlap if column == tiling.columns - 1 else 0.0, paper.overlap])
            low += np.array([0.0, 0.0 if row == tiling.rows - 1 else paper.overlap])
            if len(tree.query(shapely.box(*low, *high), predicate="intersects")):
                tiles.append((row, column))
    return tuple(tiles)


def _is_joined(tiling: Tiling, tiles: Sequence[tuple[int, int]], shapes: Sequence[Polygon]) -> bool:
    """Return whether a shape spreads over two tiles."""
    import shapely

    lower_left = [tiling.corner(*tile) + np.array([0.0, tiling.paper.overlap]) for tile in tiles]
    cells = [shapely.box(*corner, *(corner + tiling.paper.step)) for corner in lower_left]
    return any(sum(cell.intersects(shape) for cell in cells) > 1 for shape in shapes)
