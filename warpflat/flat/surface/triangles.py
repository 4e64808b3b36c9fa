"""Faces split into triangles, and the diagonals of quads.

Faces are #F by 4 vertex indices with -1 in the last column of a triangle; #F by 3 stands for triangles only.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.flat.surface.connectivity import join_labels
from warpflat.flat.surface.half_edges import four_columns

__all__ = ["corner_means", "corner_triangles", "selected_rows", "triangulate", "unfold_quad_diagonals"]

Number = TypeVar("Number", bound=np.generic)

# Corners of a quad's four corner triangles: before, corner, after.
_CORNER_TRIANGLES = np.array([[3, 0, 1], [0, 1, 2], [1, 2, 3], [2, 3, 0]])


def corner_means(values: FloatArray, faces: NDArray[np.integer]) -> FloatArray:
    """Return the mean of the values (#V or #V by #D) at the corners of each face (#F by 4, -1 as the fourth of a triangle)."""
    used = (faces >= 0).reshape(*faces.shape, *(1 for _ in values.shape[1:]))
    return np.asarray(np.where(used, values[faces], 0.0).sum(axis=1) / used.sum(axis=1))


def triangulate(
    faces: ArrayLike, *, other_diagonal: bool | BoolArray = False, distinct: bool = False
) -> tuple[IntArray, IntArray]:
    """Split faces into triangles: #T by 3 vertices, in the order of the faces and with their winding, and #T, the face of each.

    Args:
        faces: #F by 4.
        other_diagonal: one value or #F; true splits a quad along its corners 1-3 instead of 0-2.
        distinct: true to turn diagonals that join two vertices which a side or another diagonal joins already, where the quads leave
            that choice, so that the triangles are a manifold; it takes a second for a million quads.
    """
    quads = four_columns(faces)
    is_quad = quads[:, 3] >= 0
    turn = np.broadcast_to(np.asarray(other_diagonal, dtype=bool), is_quad.shape) & is_quad
    if distinct and is_quad.any():
        turn = _distinct_diagonals(quads, is_quad, turn)
    rolled = np.where(turn[:, None], np.roll(quads, -1, axis=1), quads)
    both = np.stack([rolled[:, [0, 1, 2]], rolled[:, [0, 2, 3]]], axis=1)
    keep = np.column_stack([np.ones(len(quads), dtype=bool), is_quad])
    face = np.repeat(np.arange(len(quads), dtype=np.int32), 2).reshape(-1, 2)
    return np.ascontiguousarray(both[keep]), face[keep]


def _distinct_diagonals(faces: IntArray, is_quad: BoolArray, turn: BoolArray) -> BoolArray:
    """Return #F, which quads are split along 1-3, so that no edge arises twice.

    Quads beside one that must turn are matched to diagonals of their own; all others keep theirs.
    """
    stride = np.int64(faces.max()) + 1

    def keys(a: IntArray, b: IntArray) -> NDArray[np.int64]:
        return np.minimum(a, b) * stride + np.maximum(a, b)

    rows = np.flatnonzero(is_quad)
    corners = faces[rows].astype(np.int64).T
    both = np.stack([keys(corners[0], corners[2]), keys(corners[1], corners[3])], axis=1)
    chosen = both[np.arange(len(rows)), turn[rows].astype(np.int64)]
    ordered = np.sort(chosen)
    triangles = faces[~is_quad].astype(np.int64).T
    sides = np.concatenate(
        [keys(row[k], row[(k + 1) % count]) for row, count in ((corners, 4), (triangles, 3)) for k in range(count)]
    )
    sides.sort()

    def are_sides(wanted: NDArray[np.int64]) -> BoolArray:
        return sides[np.minimum(np.searchsorted(sides, wanted), len(sides) - 1)] == wanted

    if not (ordered[1:] == ordered[:-1]).any() and not are_sides(ordered).any():
        return turn
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import maximum_bipartite_matching

    known, column = np.unique(both, return_inverse=True)
    column = column.reshape(-1, 2)
    free = ~are_sides(known)
    used = np.bincount(column[np.arange(len(rows)), turn[rows].astype(np.int64)], minlength=len(known))
    amiss = (used > 1) | ((used > 0) & ~free)
    part = join_labels(len(rows) + len(known), np.repeat(np.arange(len(rows)), 2), len(rows) + column.ravel())
    near = np.flatnonzero(np.isin(part[: len(rows)], part[len(rows) :][amiss]))
    open_to = free[column[near]]
    at, slot = np.nonzero(open_to)
    graph = coo_array((np.ones(len(at)), (at, column[near[at], slot])), shape=(len(near), len(known))).tocsr()
    match = maximum_bipartite_matching(graph, perm_type="column")
    found = match >= 0
    out = turn.copy()
    out[rows[near[found]]] = column[near[found], 1] == match[found]
    return out


def corner_triangles(faces: ArrayLike) -> tuple[IntArray, IntArray, FloatArray]:
    """Return triangles that measure both splits of each quad at once.

    A triangle gives itself with weight 1; a quad gives its four corner triangles (before, corner, after) with weight
    1/2: their weighted areas sum to the mean of both ways of splitting it.

    Returns:
        #C by 3 vertices in the order of the faces, wound as they are; #C, the face of each; #C, the weight.
    """
    quads = four_columns(faces)
    is_quad = quads[:, 3] >= 0
    if is_quad.all():
        corners = np.take(quads, _CORNER_TRIANGLES, axis=1).reshape(-1, 3)
        return corners, np.repeat(np.arange(len(quads), dtype=np.int32), 4), np.full(len(corners), 0.5)
    if not is_quad.any():
        return np.ascontiguousarray(quads[:, :3]), np.arange(len(quads), dtype=np.int32), np.ones(len(quads))
    corners = np.take(quads, _CORNER_TRIANGLES, axis=1)
    corners[~is_quad, 0] = quads[~is_quad, :3]
    keep = np.repeat(is_quad[:, None], 4, axis=1)
    keep[:, 0] = True
    face = np.repeat(np.arange(len(quads), dtype=np.int32), 4).reshape(-1, 4)[keep]
    return corners[keep], face, np.where(is_quad[face], 0.5, 1.0)


def unfold_quad_diagonals(
    vertices: FloatArray, faces: IntArray, *, crease: NDArray[np.int8] | None = None
) -> tuple[FloatArray, IntArray]:
    """Measure both diagonals of each quad on the surface.

    A bent quad is two triangles that meet in one diagonal; the other diagonal is the distance between their far
    corners once one of them is turned about the shared one into the plane of its neighbour. A planar quad gives the
    plain distance, also where it is not convex; a bent one is never shortened.

    Args:
        vertices: #V by 3, positions [m].
        faces: #F by 4, -1 in the last column of a triangle.
        crease: #F, along which diagonal a quad is creased (0 for corners 0-2, 1 for 1-3, else -1): that one is straight.

    Returns:
        #Q by 2 lengths [m], of corners 0-2 (across the hinge 1-3) and of corners 1-3 (across the hinge 0-2); and #Q,
        the face of each row.
    """
    # Not for those who only triangulate: Warp takes a third of a second to load, as long as reading a film does.
    from warpflat.core.launch import launch_each
    from warpflat.kernels.unfold import unfold_diagonals

    is_quad = faces[:, 3] >= 0
    index = np.flatnonzero(is_quad).astype(np.int32)
    lengths = np.empty((len(index), 2))
    bent = np.full(len(index), -1, dtype=np.int8) if crease is None else selected_rows(crease, is_quad)
    launch_each(unfold_diagonals, len(index), [vertices, selected_rows(faces, is_quad), bent], [lengths])
    return lengths, index


def selected_rows(array: NDArray[Number], chosen: BoolArray) -> NDArray[Number]:
    """Return the chosen rows of an array, or the array itself without a copy if all are chosen."""
    return array if chosen.all() else array[chosen]
