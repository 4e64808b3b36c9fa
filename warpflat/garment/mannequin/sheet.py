"""Sheets of the grid's vertices as one graph: chest, blades and shoulders above the bust, the fork below the hip."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray, IntArray
from warpflat.garment.mannequin.layout import LEG_LEVELS, Layout
from warpflat.garment.mannequin.sampled import neighbour_mean

__all__ = ["fill_fork", "fill_sheet", "sheet_laplacian"]

# How strongly a sheet is drawn to a scan, against one for its own smoothness, on a grid of 10 mm; and how often the fork is.
_ATTRACT, _FORK_ROUNDS = 0.25, 6


def sheet_laplacian(layout: Layout, first_row: int) -> tuple[IntArray, Any, NDArray[np.int64]]:
    """Return the umbrella operator of the sheet.

    Args:
        layout: the grid.
        first_row: the lowest of the closed rows that belong to the sheet.

    Returns:
        the sheet's vertices (#S), the operator (#S by #S sparse: mean of the neighbours minus the vertex), and for
        every vertex of the layout its row in it, -1 for those outside.
    """
    grids = [_closed(layout.rings[first_row:]), layout.front, layout.back, *layout.yokes.values()]
    return _umbrella(layout, grids)


def fill_fork(values: FloatArray, layout: Layout, attract: Callable[[FloatArray], FloatArray] | None = None) -> None:
    """Set the rows between the loops of hip and crotch curve and the thighs to the smoothest sheet through what is around.

    Args:
        values: layout.vertex_count by 3, places or displacements [m], changed in place.
        layout: the grid.
        attract: maps places of the sheet, #P by 3 [m], to those that it is drawn to.
    """
    # The fork reaches from two rows above the hip to two below the thighs.
    hip, thigh = layout.level_row["hip"], layout.leg_row[LEG_LEVELS[1]]
    legs = [_closed(grid[: thigh + 3]) for grid in layout.legs.values()]
    ids, laplacian, local = _umbrella(layout, [_closed(layout.rings[hip : hip + 3]), *legs])
    last = layout.leg_row["leg_thigh"]
    free = local[np.concatenate([grid[1:last].ravel() for grid in layout.legs.values()])]
    # The outermost rows have no neighbours beyond them, so nothing can be smooth there.
    rims = [layout.rings[hip + 2], *(grid[last + 2] for grid in layout.legs.values())]
    inner = np.setdiff1d(np.arange(len(ids)), local[np.concatenate(rims)])
    fill_sheet(values, layout, ids, laplacian[inner], free)
    if attract is not None:
        fill_sheet(values, layout, ids, laplacian[inner], free, attract=attract, rounds=_FORK_ROUNDS)


def fill_sheet(
    values: FloatArray,
    layout: Layout,
    ids: IntArray,
    operator: Any,
    free: NDArray[np.int64],
    *,
    target: FloatArray | float = 0.0,
    attract: Callable[[FloatArray], FloatArray] | None = None,
    rounds: int = 0,
) -> None:
    """Set some vertices of a sheet to where an operator of all of them comes nearest to its target, by least squares.

    Args:
        values: layout.vertex_count by 3, places or displacements [m], changed in place.
        layout: the grid.
        ids: #S, the sheet's vertices.
        operator: #R by #S, sparse.
        free: rows of `ids` that are set.
        target: #R by 3.
        attract: maps the places of those, #P by 3 [m], to those that they are drawn to, as they lie when asked.
        rounds: how often.
    """
    from scipy import sparse
    from scipy.sparse.linalg import factorized

    columns, known = operator.tocsc(), np.setdiff1d(np.arange(len(ids)), free)
    unknown = columns[:, free]
    right = np.asarray(unknown.T @ (target - columns[:, known] @ values[ids[known]]))
    matrix = unknown.T @ unknown
    if attract is None:
        values[ids[free]] = factorized(matrix.tocsc())(right)
        return
    # The operator shrinks with the square of the edge.
    pull = (_ATTRACT * (layout.resolution / 0.010) ** 2) ** 2
    solve = factorized((matrix + pull * sparse.identity(len(free))).tocsc())
    for _ in range(rounds):
        values[ids[free]] = solve(right + pull * attract(values[ids[free]]))


def _closed(grid: IntArray) -> IntArray:
    return np.hstack([grid, grid[:, :1]])


def _umbrella(layout: Layout, grids: list[IntArray]) -> tuple[IntArray, Any, NDArray[np.int64]]:
    from scipy import sparse

    across = [np.stack([g[:, :-1], g[:, 1:]], -1).reshape(-1, 2) for g in grids]
    along = [np.stack([g[:-1], g[1:]], -1).reshape(-1, 2) for g in grids]
    edges = np.unique(np.sort(np.concatenate(across + along), axis=1), axis=0)
    ids = np.unique(edges)
    local = np.full(layout.vertex_count, -1)
    local[ids] = np.arange(len(ids))
    return ids, (neighbour_mean(local[edges], len(ids)) - sparse.identity(len(ids))).tocsr(), local
