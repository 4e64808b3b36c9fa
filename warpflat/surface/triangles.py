"""Faces split into triangles, and the diagonals of quads.

Faces are #F by 4 vertex indices with -1 in the last column of a triangle; #F by 3 stands for triangles only.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.launch import launch_each
from warpflat.kernels.unfold import unfold_diagonals
from warpflat.surface.half_edges import four_columns

__all__ = ["corner_triangles", "selected_rows", "triangulate", "unfold_quad_diagonals"]

Number = TypeVar("Number", bound=np.generic)

# Corners of a quad's four corner triangles: before, corner, after.
_CORNER_TRIANGLES = np.array([[3, 0, 1], [0, 1, 2], [1, 2, 3], [2, 3, 0]])


def triangulate(faces: ArrayLike, *, other_diagonal: bool | BoolArray = False) -> tuple[IntArray, IntArray]:
    """Split faces into triangles: #T by 3 vertices, in the order of the faces and with their winding, and #T, the face of each.

    Args:
        faces: #F by 4.
        other_diagonal: one value or #F; true splits a quad along its corners 1-3 instead of 0-2.
    """
    quads = four_columns(faces)
    is_quad = quads[:, 3] >= 0
    turn = np.broadcast_to(np.asarray(other_diagonal, dtype=bool), is_quad.shape) & is_quad
    rolled = np.where(turn[:, None], np.roll(quads, -1, axis=1), quads)
    both = np.stack([rolled[:, [0, 1, 2]], rolled[:, [0, 2, 3]]], axis=1)
    keep = np.column_stack([np.ones(len(quads), dtype=bool), is_quad])
    face = np.repeat(np.arange(len(quads), dtype=np.int32), 2).reshape(-1, 2)
    return np.ascontiguousarray(both[keep]), face[keep]


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
    is_quad = faces[:, 3] >= 0
    index = np.flatnonzero(is_quad).astype(np.int32)
    lengths = np.empty((len(index), 2))
    bent = np.full(len(index), -1, dtype=np.int8) if crease is None else selected_rows(crease, is_quad)
    launch_each(unfold_diagonals, len(index), [vertices, selected_rows(faces, is_quad), bent], [lengths])
    return lengths, index


def selected_rows(array: NDArray[Number], chosen: BoolArray) -> NDArray[Number]:
    """Return the chosen rows of an array, or the array itself without a copy if all are chosen."""
    return array if chosen.all() else array[chosen]
