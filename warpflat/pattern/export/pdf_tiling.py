"""Sheets of a printed pattern: paper sizes, and how pieces are spread over tiles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray
from warpflat.pattern.drafting.layout import Sheet, covered_rings
from warpflat.pattern.drafting.words import letters_of

if TYPE_CHECKING:
    from shapely import Geometry, Polygon

__all__ = ["LEGEND_SIZE", "SIZE_DASHES", "Paper", "Tiling", "make_tiling"]

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


@dataclass(frozen=True, kw_only=True)
class Paper:
    """A kind of paper.

    Attributes:
        name: for the reader.
        width, height: [m].
        margin: what printers leave white [m].
        overlap: of neighbouring tiles [m].
        endless: the page is as large as everything needs.
        line_width: lines are so many times as wide as on paper.
    """

    name: str
    width: float
    height: float
    margin: float
    overlap: float
    endless: bool = False
    line_width: float = 1.0

    @property
    def step(self) -> FloatArray:
        """Distance from one tile to the next [m], across and up."""
        return np.array([self.width, self.height]) - 2 * self.margin - self.overlap

    @property
    def tiled(self) -> bool:
        """True if the paper is so small that a piece spreads over several sheets."""
        return self.width < 0.5 and not self.endless


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

    @property
    def joints(self) -> list[FloatArray]:
        """The lines along which sheets meet or end, 2 by 2 [m]: each sheet's left and upper line lies on its neighbours."""
        if not self.joined:
            return []
        step, (width, height) = self.paper.step, self.sheet.size
        across = [np.array([[k * step[0], 0.0], [k * step[0], height]]) for k in range(self.columns + 1)]
        down = [np.array([[0.0, height - k * step[1]], [width, height - k * step[1]]]) for k in range(self.rows + 1)]
        return across + down

    @property
    def outside(self) -> Geometry:
        """What no sheet shows, around all that is shown."""
        import shapely

        shown = shapely.union_all([self.window(tile) for tile in self.tiles])
        return shown.buffer(0.1, join_style="mitre").difference(shown)

    def window(self, tile: tuple[int, int]) -> Polygon:
        """Return what a tile shows of the sheet."""
        import shapely

        corner = self.corner(*tile)
        return shapely.box(*corner, *(corner + self.paper.step + self.paper.overlap))

    def name(self, row: int, column: int) -> str:
        """Return the name of a tile, such as "B3" for the second row and the third column."""
        return f"{letters_of(row)}{column + 1}"


#: Width and height [m] of the legend's block.
LEGEND_SIZE = (0.180, 0.128)
#: Half the width [m] of a cutting line.
LINE = 0.00025


def make_tiling(sheet: Sheet, paper: Paper) -> Tiling:
    """Choose the tiles of a sheet on which something is drawn."""
    import shapely

    step = paper.step
    columns = max(1, int(np.ceil((sheet.size[0] - paper.overlap) / step[0] - 1e-9)))
    rows = max(1, int(np.ceil((sheet.size[1] - paper.overlap) / step[1] - 1e-9)))
    tiling = Tiling(paper=paper, rows=rows, columns=columns, tiles=(), sheet=sheet)
    # What is drawn: pieces, labels beside them, the reserved block.
    shapes = [
        shapely.Polygon(placed.on_sheet(ring)) for placed in sheet.placed for ring in covered_rings(placed.pieces)
    ]
    if sheet.reserved is not None:
        shapes.append(shapely.box(*sheet.reserved, *(sheet.reserved + LEGEND_SIZE)))
    # The tiles on which a part of a shape lies that no other tile shows.
    # Lines are drawn with their middle on the border.
    drawn = shapely.union_all([shape.buffer(LINE) for shape in shapes])
    tiles = [(row, column) for row in range(tiling.rows) for column in range(tiling.columns)]
    parts = {tile: drawn.intersection(tiling.window(tile)) for tile in tiles}
    kept = {tile for tile, part in parts.items() if part.area > 0.0}
    for tile in sorted(kept, key=lambda tile: (parts[tile].area, tile)):
        around = [tiling.window(other) for other in kept - {tile} if max(np.abs(np.subtract(other, tile))) == 1]
        if parts[tile].difference(shapely.union_all(around)).area < 1e-9:
            kept.remove(tile)
    shown = tuple(tile for tile in tiles if tile in kept)
    # Sheets are joined if a shape spreads over two of them.
    lower_left = [tiling.corner(*tile) + np.array([0.0, tiling.paper.overlap]) for tile in shown]
    cells = [shapely.box(*corner, *(corner + tiling.paper.step)) for corner in lower_left]
    return replace(
        tiling, tiles=shown, joined=any(sum(cell.intersects(shape) for cell in cells) > 1 for shape in shapes)
    )
