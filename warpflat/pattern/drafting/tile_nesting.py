"""Pieces nested on a grid of tiles so that few tiles are printed, or on a strip of cloth so that little is taken.

Pieces are turned into cells, fine enough for paper, and laid one by one, the largest first, where they take up the
fewest new tiles (or the least cloth). Free places are found by a correlation with what is occupied, as in raster
nesting. Several orders are tried; the same input always gives the same result, on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core import BoolArray, FloatArray

if TYPE_CHECKING:
    from shapely import Polygon

__all__ = [
    "CELL",
    "Mask",
    "Places",
    "TurnedShape",
    "first_free",
    "nest_on_strip",
    "nest_on_tiles",
    "orders",
    "touched_cells",
]


#: Cells are about this wide [m], at most.
CELL = 0.008
# Sheets up to which everything is tried, and cells of a tile at least, down and across.
_MANY, _FEWEST = 150, 4
# A shape becomes cells block by block of so many each way.
_BLOCK = 6
# Transforms of masks are kept in so much memory [B].
_KEPT = 2**27
#: Orders of the pieces that are tried.
ORDERS = 8
#: What one more row or column of the whole sheet counts as, in tiles: a long strip is hard to glue and to lay out.
SPREAD = 0.2


@dataclass(frozen=True, kw_only=True, eq=False)
class TurnedShape:
    """A place on the sheet.

    Attributes:
        quarters: quarter turns counter-clockwise.
        corner: lower left of the turned shape's box [m], y upwards.
    """

    quarters: int
    corner: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Mask:
    """A shape in one position as cells, rows downwards."""

    cells: BoolArray
    quarters: int
    extent: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class _Grid:
    """Tiles of cells.

    Attributes:
        cell: width and height of a cell [m].
        per_tile: cells of a tile, down and across.
        shared: cells of the strip that a tile shares with the one before it, down and across.
        tiles: rows and columns.
    """

    cell: FloatArray
    per_tile: tuple[int, int]
    shared: tuple[int, int]
    tiles: tuple[int, int]
    _touched: dict[int, FloatArray] = field(default_factory=dict)

    def touched(self, mask: Mask) -> FloatArray:
        """Return which tiles a mask touches (1, else 0), by the cell of a tile where it starts and the tile: down and across."""
        if id(mask) not in self._touched:
            # By the cell of a tile where the mask starts, which of its rows or columns lie in the tiles from there on. The strip that a
            # tile shares with the one before is printed there, and does not count.
            ends = []
            for size, per_tile, shared in zip(mask.cells.shape, self.per_tile, self.shared, strict=True):
                start, tile = np.arange(per_tile)[:, None], np.arange((size + per_tile - 2) // per_tile + 1)
                low = np.clip(tile * per_tile + shared - start, 0, size)
                ends.append((low, np.maximum(low, np.clip((tile + 1) * per_tile - start, 0, size))))
            (top, bottom), (left, right) = ends
            sums = np.pad(np.cumsum(np.cumsum(mask.cells, axis=0), axis=1), ((1, 0), (1, 0)))

            def at(row: NDArray[Any], column: NDArray[Any]) -> NDArray[Any]:
                return np.asarray(sums[row[:, :, None, None], column])

            cells = at(bottom, right) - at(top, right) - at(bottom, left) + at(top, left)
            self._touched[id(mask)] = (cells > 0).astype(np.float32)
        return self._touched[id(mask)]

    def tiles_under(self, mask: Mask, row: int, column: int) -> BoolArray:
        """Return the tiles that a mask takes at one place."""
        (i, first), (j, left) = divmod(row, self.per_tile[0]), divmod(column, self.per_tile[1])
        covered, tiles = self.touched(mask)[first, :, left, :] > 0.0, np.zeros(self.tiles, dtype=bool)
        part = tiles[i : i + covered.shape[0], j : j + covered.shape[1]]
        part |= covered[: part.shape[0], : part.shape[1]]
        return tiles


def nest_on_tiles(
    shapes: Sequence[Polygon], *, step: FloatArray, overlap: float, gap: float
) -> tuple[list[TurnedShape], FloatArray]:
    """Lay shapes on a grid of tiles so that few tiles have anything on them.

    Args:
        shapes: polygons [m].
        step: from one tile to the next, across and up [m].
        overlap: of neighbouring tiles [m].
        gap: between shapes and to the sheet's border [m].

    Returns:
        The place of each shape, and the sheet's width and height [m], which are those of whole tiles.
    """
    total = sum(float(shape.area) for shape in shapes)
    needed = int(np.ceil(total / float(np.prod(step))))
    # What takes more sheets is laid in coarser cells, by fewer tries: the work stays that of so many sheets.
    coarser = max(1.0, np.sqrt(needed / _MANY))
    per_tile = tuple(max(_FEWEST, int(np.ceil(side / (CELL * coarser)))) for side in step[::-1])
    cell = step / per_tile[::-1]
    shared = (int(overlap // cell[1]), int(overlap // cell[0]))
    masks = [_masks(shape, cell, gap, (0, 1, 2, 3)) for shape in shapes]
    # The numbers of columns that are tried: around a square sheet, and wide enough for every shape.
    narrowest = max(min(mask.cells.shape[1] for mask in row) for row in masks)
    least = max(1, int(np.ceil((narrowest - shared[1]) / per_tile[1])))
    square = max(least, round(np.sqrt(1.4 * needed * per_tile[0] / per_tile[1])))
    counts = list(range(least, max(least, square) + 3)) if coarser == 1.0 else [max(least, square)]
    # How many rows of tiles each shape takes where it is lowest, of its positions that fit into the columns.
    heights = []
    for count in counts:
        across = count * per_tile[1] + shared[1]
        low = [min(len(mask.cells) for mask in row if mask.cells.shape[1] <= across) for row in masks]
        heights.append([max(1, int(np.ceil((height - shared[0]) / per_tile[0]))) for height in low])
    sizes = [(max(height) + needed // count + 2, count) for count, height in zip(counts, heights, strict=True)]
    # Where shapes do not fit together there is room at last for all above each other.
    stacked = sum(max(len(mask.cells) for mask in row) // per_tile[0] + 1 for row in masks)
    best: tuple[float, list[tuple[Mask, int, int]]] | None = None
    for tries in (sizes, [(stacked, counts[-1])]):
        for tiles in tries if best is None else []:
            grid = _Grid(cell=cell, per_tile=(per_tile[0], per_tile[1]), shared=shared, tiles=tiles)
            sheet = Places((tiles[0] * per_tile[0] + shared[0], tiles[1] * per_tile[1] + shared[1]))
            for order in orders(masks)[: None if coarser == 1.0 else 2]:
                best = _lay(masks, order, grid, sheet, np.inf if best is None else best[0]) or best
    assert best is not None
    # Places on the sheet [m], y upwards, and its size, without unused rows and columns at its end.
    shapes_laid = best[1]
    margin = gap / 2 + CELL / 20
    right = max(column * cell[0] + mask.extent[0] for mask, _, column in shapes_laid) + 2 * margin
    lower = max(row * cell[1] + mask.extent[1] for mask, row, _ in shapes_laid) + 2 * margin
    size = np.maximum(1, np.ceil((np.array([right, lower]) - overlap) / step - 1e-9)) * step + overlap
    places = []
    for mask, row, column in shapes_laid:
        top = size[1] - row * cell[1] - margin
        corner = np.array([column * cell[0] + margin, top - mask.extent[1]])
        places.append(TurnedShape(quarters=mask.quarters, corner=corner))
    return places, size


def nest_on_strip(shapes: Sequence[Polygon], *, width: float, gap: float) -> float | None:
    """Return the length [m] of a strip of some width [m] that shapes take; None if one is too wide.

    Shapes lie with y along the strip and may be turned round, not across.
    """
    across = int(np.floor(width / CELL))
    cell = np.array([width / across, CELL])
    masks = [_masks(shape, cell, gap, (0, 2)) for shape in shapes]
    if any(row[0].cells.shape[1] > across for row in masks):
        return None
    # Boxes in shelves take twice their area and the tallest (Coffman et al. 1980); what takes more gets a longer strip, up to all above
    # each other. Where shapes lie does not hang on that.
    tall = [row[0].cells.shape[0] for row in masks]
    strip = min(sum(tall), 2 * sum(row[0].cells.size for row in masks) // across + max(tall))
    places = Places((strip, across))

    def laid(order: Sequence[int]) -> int | None:
        """Return the rows that shapes take in an order, each where it is lowest; None where the strip is too short."""
        places.clear()
        length = 0
        for k in order:
            free = [places.free(mask) for mask in masks[k]]
            if not all(each.any() for each in free):
                return None
            found = [(*first_free(each), mask) for each, mask in zip(free, masks[k], strict=True)]
            row, column, mask = min(found, key=lambda item: (max(length, item[0] + len(item[2].cells)), item[0]))
            places.take(mask, row, column)
            length = max(length, row + len(mask.cells))
        return length

    lengths = list[int]()
    for order in orders(masks):
        while (length := laid(order)) is None:
            strip = min(2 * strip, sum(tall))
            places = Places((strip, across))
        lengths.append(length)
    return min(lengths) * float(cell[1])


def first_free(free: BoolArray) -> tuple[int, int]:
    """Return the row and the column of the first free place, of which there is one: the lowest row, and there the lowest column."""
    row, column = divmod(int(np.argmax(free)), free.shape[1])
    return row, column


def _masks(shape: Polygon, cell: FloatArray, gap: float, turns: Sequence[int]) -> list[Mask]:
    """Return a shape as cells in its positions, grown by half of the gap; a cell that it touches is its own."""
    from shapely.affinity import rotate

    found = []
    for quarters in turns:
        turned = rotate(shape, 90.0 * quarters, origin=(0, 0)) if quarters else shape
        grown = turned.simplify(CELL / 20).buffer(gap / 2 + CELL / 20)
        low, high = np.array(grown.bounds[:2]), np.array(grown.bounds[2:])
        columns, rows = np.maximum(1, np.ceil((high - low) / cell - 1e-9)).astype(int)
        extent = np.array(turned.bounds[2:]) - np.array(turned.bounds[:2])
        cells = touched_cells(grown, np.array([low[0], high[1]]), cell, (int(rows), int(columns)))
        found.append(Mask(cells=cells, quarters=quarters, extent=extent))
    return found


def touched_cells(area: Polygon, corner: FloatArray, cell: FloatArray, shape: tuple[int, int]) -> BoolArray:
    """Return which cells a polygon touches, by row and column from the upper left corner on."""
    import shapely

    def boxes(row: NDArray[np.integer], column: NDArray[np.integer], size: int) -> Any:
        left, top = corner[0] + size * cell[0] * column, corner[1] - size * cell[1] * row
        return shapely.box(left, top - size * cell[1], left + size * cell[0], top)

    # Most blocks of cells lie within the polygon or beside it.
    shapely.prepare(area)
    row, column = np.indices([-(-side // _BLOCK) for side in shape])
    blocks = boxes(row, column, _BLOCK)
    touched = shapely.intersects(area, blocks)
    mixed = touched & ~shapely.contains_properly(area, blocks)
    cells, unknown = (
        each.repeat(_BLOCK, axis=0).repeat(_BLOCK, axis=1)[: shape[0], : shape[1]] for each in (touched, mixed)
    )
    row, column = np.nonzero(unknown)
    cells[row, column] = shapely.intersects(area, boxes(row, column, 1))
    return np.ascontiguousarray(cells)


def orders(masks: Sequence[Sequence[Mask]]) -> list[list[int]]:
    """Return orders of the shapes: by falling area, by falling height, and some at random near these."""
    area = np.array([row[0].cells.sum() for row in masks], dtype=float)
    tall = np.array([row[0].cells.shape[0] for row in masks], dtype=float)
    random = np.random.default_rng(0)
    orders = [np.argsort(-area, kind="stable"), np.argsort(-tall, kind="stable")]
    while len(orders) < ORDERS:
        orders.append(np.argsort(-area * random.uniform(0.4, 1.6, len(area)), kind="stable"))
    return [list(order) for order in dict.fromkeys(tuple(order.tolist()) for order in orders)]


def _lay(
    masks: Sequence[Sequence[Mask]], order: Sequence[int], grid: _Grid, sheet: Places, below: float
) -> tuple[float, list[tuple[Mask, int, int]]] | None:
    """Lay shapes in an order; return the price in tiles and each one's mask, row and column.

    None if one finds no room, or as soon as the price is no longer `below` what was had before: it only grows.
    """
    sheet.clear()
    used = np.zeros(grid.tiles, dtype=bool)
    places: dict[int, tuple[Mask, int, int]] = {}
    for k in order:
        best: tuple[float, Mask, int, int] | None = None
        for mask in masks[k]:
            if (np.array(mask.cells.shape) > sheet.occupied.shape).any():
                continue
            # A place costs the new tiles that it takes, and a little for rows, columns and distance.
            free = sheet.free(mask)
            (per_row, per_column), tile_rows = grid.per_tile, grid.tiles[0]
            down, across = free.shape
            touched, cells = grid.touched(mask), mask.cells
            over = touched.shape[1], touched.shape[3]
            new = np.zeros(np.add(used.shape, over), dtype=np.float32)
            new[: used.shape[0], : used.shape[1]] = ~used
            windows = np.lib.stride_tricks.sliding_window_view(new, over)  # by the tile where a mask starts
            cost = np.tensordot(windows, touched, axes=([2, 3], [1, 3])).transpose(0, 2, 1, 3)
            flat = cost.reshape((tile_rows + 1) * per_row, -1)[:down, :across]
            r, c = np.arange(down)[:, None], np.arange(across)[None, :]
            # Among places that take equally few tiles: a compact sheet, and the upper left.
            lower, right = (r + cells.shape[0]) / per_row, (c + cells.shape[1]) / per_column
            lowest = int(np.flatnonzero(used.any(axis=1))[-1]) + 1 if used.any() else 0
            widest = int(np.flatnonzero(used.any(axis=0))[-1]) + 1 if used.any() else 0
            spread = SPREAD * (np.maximum(0, np.ceil(lower) - lowest) + np.maximum(0, np.ceil(right) - widest))
            price = np.where(free, flat + spread + 1e-3 * (lower + right), np.inf)
            row, column = divmod(int(np.argmin(price)), price.shape[1])
            if np.isfinite(price[row, column]) and (best is None or price[row, column] < best[0] - 1e-9):
                best = float(price[row, column]), mask, row, column
        if best is None:
            return None
        places[k] = best[1:]
        sheet.take(*best[1:])
        used |= grid.tiles_under(*best[1:])
        total = float(used.sum()) + SPREAD * (int(used.any(axis=1).sum()) + int(used.any(axis=0).sum()))
        if total >= below:
            return None
    return total, [places[k] for k in range(len(masks))]


class Places:
    """The free places of masks on one sheet, by correlation with what is occupied; transforms are kept, as far as memory allows."""

    def __init__(self, shape: tuple[int, int]) -> None:
        from scipy.fft import next_fast_len, rfft2

        self.occupied = np.zeros(shape, dtype=bool)
        self._size = (next_fast_len(shape[0], real=True), next_fast_len(shape[1], real=True))
        self._transform = lambda cells: rfft2(cells.astype(np.float32), s=self._size)
        self._masks: dict[tuple[tuple[int, ...], bytes], Any] = {}
        self._here: Any = None

    def take(self, mask: Mask, row: int, column: int) -> None:
        """Lay a mask."""
        down, across = mask.cells.shape
        self.occupied[row : row + down, column : column + across] |= mask.cells
        self._here = None

    def free(self, mask: Mask) -> BoolArray:
        """Return the places (row, column of the upper left) at which a mask meets nothing that is occupied."""
        from scipy.fft import irfft2

        down, across = np.array(self.occupied.shape) - mask.cells.shape + 1
        if not self.occupied.any():
            return np.ones((down, across), dtype=bool)
        if self._here is None:
            self._here = self._transform(self.occupied)
        # Equal pieces share one.
        key = mask.cells.shape, mask.cells.tobytes()
        transform = self._masks.get(key)
        if transform is None:
            transform = np.conj(self._transform(mask.cells))
            if (len(self._masks) + 1) * transform.nbytes <= _KEPT:
                self._masks[key] = transform
        meets = irfft2(self._here * transform, s=self._size)
        return np.asarray(meets[:down, :across] < 0.5)

    def clear(self) -> None:
        """Take everything away."""
        self.occupied[:] = False
        self._here = None
