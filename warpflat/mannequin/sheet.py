"""The sheet above the bust: chest, blades and shoulders as one graph of the grid's vertices."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import IntArray
from warpflat.mannequin.layout import Layout

__all__ = ["sheet_laplacian"]


def sheet_laplacian(layout: Layout, first_row: int) -> tuple[IntArray, Any, NDArray[np.int64]]:
    """Return the umbrella operator of the sheet.

    Args:
        layout: the grid.
        first_row: the lowest of the closed rows that belong to the sheet.

    Returns:
        the sheet's vertices (#S), the operator (#S by #S sparse: mean of the neighbours minus the vertex), and for
        every vertex of the layout its row in it, -1 for those outside.
    """
    from scipy import sparse

    closed = layout.rings[first_row:]
    grids = [np.hstack([closed, closed[:, :1]]), layout.front, layout.back, *layout.yokes.values()]
    across = [np.stack([g[:, :-1], g[:, 1:]], -1).reshape(-1, 2) for g in grids]
    along = [np.stack([g[:-1], g[1:]], -1).reshape(-1, 2) for g in grids]
    edges = np.unique(np.sort(np.concatenate(across + along), axis=1), axis=0)
    ids = np.unique(edges)
    local = np.full(layout.vertex_count, -1)
    local[ids] = np.arange(len(ids))
    a, b = local[edges].T
    n = len(ids)
    adjacency = sparse.coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), (n, n)).tocsr()
    degree = np.asarray(adjacency.sum(axis=1)).ravel()
    return ids, (sparse.diags(1.0 / degree) @ adjacency - sparse.identity(n)).tocsr(), local
