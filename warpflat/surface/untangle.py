"""A layout with a few mirrored faces, smoothed where they are until none is left."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warpflat.kernels.strain import measure_flat_cells
from warpflat.launching import launch_each
from warpflat.surface.mesh import Surface
from warpflat.surface.topology import corner_triangles, half_edges_of
from warpflat.surface.vectors import cross, norm, points_at

if TYPE_CHECKING:
    from scipy.sparse import csr_array

__all__ = ["signed_cell_areas", "untangle"]


# So many sweeps without fewer mirrored triangles than ever before, and the rest will not help either.
_PATIENCE = 25


def untangle(
    surface: Surface,
    positions: NDArray[np.float64],
    *,
    least_area: float = 1e-3,
    most_sweeps: int = 200,
    suspects: NDArray[np.integer] | None = None,
) -> tuple[NDArray[np.float64], int]:
    """Move the vertices of mirrored faces, and those beside, towards the mean of their neighbours until all faces agree.

    Meant for the odd face that a first layout turns over: far from such faces nothing moves, and nothing is looked at.
    Neighbours count with one over the length of their edge on the body; a vertex of the border moves between its neighbours
    on the border only.

    Args:
        surface: the piece.
        positions: #V by 2 [m], the layout.
        least_area: a corner triangle with less than this share of its area on the body counts as mirrored.
        most_sweeps: give up after so many, or once sweeps stop helping; a layout that is folded at large is not mended from
            its edges.
        suspects: where all that are mirrored is known, these corner triangles; no others are looked at to begin with.

    Returns:
        #V by 2 positions [m], and how many corner triangles are still mirrored (0: done).
    """
    from scipy.sparse import csc_array

    corner, _, _ = corner_triangles(surface.faces)
    flat = np.array(positions, dtype=np.float64)

    def crushed(rows: NDArray[np.integer]) -> NDArray[np.integer]:
        p = points_at(surface.vertices, corner[rows].T)
        body = 0.5 * norm(cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))
        return rows[signed_cell_areas(corner[rows], flat) <= least_area * body]

    mirrored = crushed(np.arange(len(corner)) if suspects is None else suspects)
    if len(mirrored) == 0:
        return flat, 0
    pull = _pull(surface)
    total, pulled = pull.sum(axis=1)[:, None], pull.T.tocsr()
    around = csc_array(
        (np.ones(corner.size, dtype=np.int8), corner.ravel(), np.arange(0, corner.size + 1, 3)),
        shape=(len(flat), len(corner)),
    ).tocsr()
    fewest, since = len(mirrored), 0
    for _ in range(most_sweeps):
        turned = np.unique(corner[mirrored])
        moving = np.union1d(turned, pulled[turned].indices)
        flat[moving] = 0.5 * (flat[moving] + pull[moving] @ flat / total[moving])
        mirrored = crushed(np.unique(around[moving].indices))
        fewest, since = (len(mirrored), 0) if len(mirrored) < fewest else (fewest, since + 1)
        if len(mirrored) == 0 or since > _PATIENCE:
            break
    return flat, len(mirrored)


def _pull(surface: Surface) -> csr_array:
    """#V by #V, the weights of the neighbours that each vertex moves between."""
    from scipy.sparse import csr_array

    he = half_edges_of(surface)
    on_rim = he.count == 1
    border = np.zeros(len(surface.vertices), dtype=bool)
    border[he.edges[on_rim]] = True
    start, end = np.concatenate([he.edges, he.edges[:, ::-1]]).T
    ends = points_at(surface.vertices, he.edges.T)
    weight = np.tile(1.0 / np.maximum(norm(ends[:, 1] - ends[:, 0]), np.finfo(float).tiny), 2)
    keep = ~border[start] | np.tile(on_rim, 2)
    return csr_array((weight[keep], (start[keep], end[keep])), shape=(len(border), len(border)))


def signed_cell_areas(corner: NDArray[np.int32], positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """#C, signed areas of triangles (#C by 3) in the plane [m2]; 0 or less where one is mirrored or collapsed."""
    area = np.empty(len(corner))
    given = [np.ascontiguousarray(positions), np.ascontiguousarray(corner, dtype=np.int32)]
    launch_each(measure_flat_cells, len(corner), given, [area])
    return area
