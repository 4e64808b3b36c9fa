"""Half-edges of a mesh, and the edges, borders and twins that follow from them.

Faces are #F by 4 vertex indices with -1 in the last column of a triangle; #F by 3 stands for triangles only. No function changes
its arguments. Unless a docstring says otherwise, the mesh may be wound inconsistently and an edge may have any number of faces: the
same functions check a mesh that comes in and query it afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core.arrays import IntArray
from warpflat.core.errors import InputError
from warpflat.core.sorting import sort_with_order, stable_argsort
from warpflat.flat.surface.mesh import Surface, once_per_faces, read_only

__all__ = [
    "HalfEdges",
    "border_edges",
    "four_columns",
    "half_edges",
    "half_edges_of",
    "mesh_edges",
    "opposite_half_edges",
    "paired_half_edges",
    "read_only_view",
    "sides_of",
]


@dataclass(frozen=True, kw_only=True)
class HalfEdges:
    """The sides of all faces, in the order of the faces: half-edge h runs from corner h to the next corner of its face.

    Attributes:
        faces: #F by 4.
        edge: #H, the row of each half-edge in `edges`.
        edges: #E by 2, unique edges as (lower, higher) vertex, sorted.
        count: #E, how many faces lie at each edge.
    """

    faces: IntArray
    edge: IntArray
    edges: IntArray
    count: IntArray

    # The arrays below follow from `faces`. They are made when they are first asked for: together they take twice the memory of the rest.

    @cached_property
    def tail(self) -> IntArray:
        """#H, the vertex from which each half-edge runs."""
        return read_only_view(sides_of(self.faces)[0])

    @cached_property
    def head(self) -> IntArray:
        """#H, the vertex to which each half-edge runs."""
        return read_only_view(sides_of(self.faces)[1])

    @cached_property
    def face(self) -> IntArray:
        """#H, the face that each half-edge bounds."""
        return read_only_view(np.repeat(np.arange(len(self.faces), dtype=np.int32), _side_counts(self.faces)))

    @cached_property
    def slot(self) -> IntArray:
        """#H, the column of each half-edge's tail in its face."""
        slots = np.broadcast_to(np.arange(4, dtype=np.int32), self.faces.shape)
        return read_only_view(slots[self.faces >= 0])

    @cached_property
    def next(self) -> IntArray:
        """#H, the half-edge that follows each one around its face."""
        sides = _side_counts(self.faces)
        follow = np.arange(1, len(self.edge) + 1, dtype=np.int32)
        follow[np.cumsum(sides) - 1] -= sides
        return read_only_view(follow)


def half_edges(faces: ArrayLike | HalfEdges) -> HalfEdges:
    """Make the half-edges of faces (#F by 4 or 3) and their unique edges; those that are given are returned."""
    if isinstance(faces, HalfEdges):
        return faces
    quads = four_columns(faces)
    tail, head = sides_of(quads)
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    digits = int(high.max(initial=0)).bit_length()
    joined = low.astype(np.int64)
    joined <<= digits
    joined |= high
    keys, order = sort_with_order(joined)
    starts = np.append(True, keys[1:] != keys[:-1])[: len(keys)]
    number = np.cumsum(starts, dtype=np.int32)
    number -= 1
    edge = np.empty_like(number)
    edge[order] = number
    begin = np.flatnonzero(starts)
    edges = np.empty((len(begin), 2), dtype=np.int32)
    edges[:, 0], edges[:, 1] = keys[begin] >> digits, keys[begin] & ((1 << digits) - 1)
    return HalfEdges(
        faces=quads.view(),
        edge=edge,
        edges=edges,
        count=np.diff(begin, append=len(tail)).astype(np.int32),
    )


@once_per_faces
def half_edges_of(surface: Surface) -> HalfEdges:
    """Return the half-edges of a surface's faces, computed once per array of faces."""
    return read_only(half_edges(surface.faces))


def opposite_half_edges(he: HalfEdges) -> NDArray[np.int64]:
    """Return #H, the opposite half-edge of each; -1 on the border and at edges with more than two faces."""
    here = np.arange(len(he.edge))
    both = np.bincount(he.edge, here).astype(np.int64)
    return np.where(he.count[he.edge] == 2, both[he.edge] - here, -1)


def sides_of(quads: IntArray) -> tuple[IntArray, IntArray]:
    """Return the tail and the head (#H each) of every side of faces (#F by 4)."""
    is_quad = quads[:, 3] >= 0
    for sides, only in ((4, is_quad.all()), (3, not is_quad.any())):
        if only:
            corner = quads[:, :sides]
            after = np.empty_like(corner, order="C")
            after[:, :-1], after[:, -1] = corner[:, 1:], corner[:, 0]
            return corner.ravel(), after.ravel()
    there = quads >= 0
    after = quads[:, [1, 2, 3, 0]]
    after[~is_quad, 2] = quads[~is_quad, 0]
    return quads[there], after[there]


def mesh_edges(faces: ArrayLike | HalfEdges) -> IntArray:
    """Return #E by 2, the unique edges as (lower, higher) vertex, sorted by the first, then the second; no diagonals."""
    return half_edges(faces).edges


def border_edges(faces: ArrayLike) -> IntArray:
    """Return #B by 2, the edges with one face, as (from, to) in the direction in which that face runs through them."""
    he = half_edges(faces)
    alone = he.count[he.edge] == 1
    return np.column_stack([he.tail[alone], he.head[alone]])


def paired_half_edges(he: HalfEdges) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return pairs of half-edges that share an edge; n - 1 pairs around an edge with n faces."""
    if he.count.max(initial=0) <= 2:
        twin = opposite_half_edges(he)
        first = np.flatnonzero(twin > np.arange(len(twin)))
        return first, twin[first]
    order = stable_argsort(he.edge)
    same = he.edge[order[1:]] == he.edge[order[:-1]]
    return order[:-1][same], order[1:][same]


def four_columns(faces: ArrayLike) -> IntArray:
    """Return faces as #F by 4 vertex indices, with -1 in the last column of a triangle.

    Raises:
        InputError: if the array has another shape than #F by 3 or 4.
    """
    array = np.asarray(faces, dtype=np.int32)
    if array.size == 0:
        return np.empty((0, 4), dtype=np.int32)
    if array.ndim != 2 or array.shape[1] not in (3, 4):
        raise InputError(f"faces must be #F by 4 (or #F by 3), got an array of shape {array.shape}")
    if array.shape[1] == 3:
        return np.column_stack([array, np.full(len(array), -1, dtype=np.int32)])
    return array


def _side_counts(quads: IntArray) -> IntArray:
    """Return #F, the number of sides of each face."""
    return 3 + (quads[:, 3] >= 0).astype(np.int32)


def read_only_view(values: IntArray) -> IntArray:
    """Return a read-only view, as all who ask for kept arrays share them."""
    view = values.view()
    view.flags.writeable = False
    return view
