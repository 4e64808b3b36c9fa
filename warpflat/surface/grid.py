"""Rectangular grids of quads, however their vertices are numbered."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.surface.mesh import Surface, once_per_surface
from warpflat.surface.topology import half_edges_of, twins_of

__all__ = ["rows_and_columns"]

IntArray = NDArray[np.int32]


@once_per_surface
def rows_and_columns(surface: Surface) -> IntArray | None:
    """#rows by #columns vertices of a rectangular grid of quads, else None."""
    faces, count = surface.faces, len(surface.vertices)
    if not surface.is_quad.all():
        return None
    columns = int(np.ptp(faces[0])) - 1
    if columns >= 2 and count % columns == 0:
        # Most grids are numbered row by row, which is seen at once.
        grid = np.arange(count, dtype=np.int32).reshape(-1, columns)
        corner = faces[0] - faces[0].min()
        in_order = sorted(corner.tolist()) == [0, 1, columns, columns + 1]
        if in_order and np.array_equal(faces, grid[:-1, :-1].reshape(-1, 1) + corner):
            return grid
    he = half_edges_of(surface)
    twin = twins_of(he)
    around = np.bincount(faces.ravel(), minlength=count)
    corners = np.flatnonzero(around == 1)
    if len(corners) != 4 or ((around != 1) & (around != 2) & (around != 4)).any():
        return None
    # The side from one corner to the next, and then row after row to its left: the edge across each quad from a row's.
    on_border = np.flatnonzero(twin < 0)
    after = np.full(count, -1, dtype=np.int64)
    after[he.tail[on_border]] = he.head[on_border]
    leaving = np.full(count, -1, dtype=np.int64)
    leaving[he.tail[on_border]] = on_border
    side = [int(corners[0])]
    while len(side) <= count:
        side.append(int(after[side[-1]]))
        if around[side[-1]] == 1:
            break
    columns = len(side)
    if columns < 2 or count % columns or (count // columns - 1) * (columns - 1) != len(faces):
        return None
    rows = [np.array(side)]
    edge = leaving[side[:-1]]
    for _ in range(count // columns - 1):
        opposite = he.next[he.next[edge]]
        row = np.append(he.head[opposite], he.tail[opposite[-1]])
        if (row[1:-1] != he.tail[opposite[:-1]]).any():
            return None
        rows.append(row)
        edge = twin[opposite]
        if (edge < 0).any() != (edge < 0).all():
            return None
    grid = np.stack(rows)
    if (edge >= 0).any() or len(np.unique(grid)) != count:
        return None
    return grid.astype(np.int32)
