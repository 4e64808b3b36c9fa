"""How the faces of a mesh hang together: pure functions, arrays in, new arrays out.

Faces are #F by 4 vertex indices with -1 in the last column of a triangle (#F by 3 is taken for triangles only).
No function changes its arguments. Unless a docstring says otherwise the mesh may be wound inconsistently and an edge
may have any number of faces, so the same functions serve to check a mesh at the door and to query it afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.launch import launch_each
from warpflat.core.polyline import polyline_length
from warpflat.kernels.unfold import unfold_diagonals
from warpflat.surface.mesh import Surface, once_per_faces, read_only
from warpflat.surface.row_by_row import row_by_row

Number = TypeVar("Number", bound=np.generic)

__all__ = [
    "HalfEdges",
    "border_edges",
    "border_loops",
    "border_of",
    "components",
    "components_of",
    "corner_fans",
    "corner_triangles",
    "edge_faces",
    "euler_characteristic",
    "half_edges",
    "half_edges_of",
    "join_labels",
    "mesh_edges",
    "non_manifold_edges",
    "non_manifold_vertices",
    "order_by",
    "orient",
    "places_of",
    "sides_of",
    "stable_order",
    "triangulate",
    "twins_of",
    "unfold_quad_diagonals",
]


# Corners of a quad's four corner triangles: before, corner, after.
_CORNER_TRIANGLES = np.array([[3, 0, 1], [0, 1, 2], [1, 2, 3], [2, 3, 0]])


@dataclass(frozen=True, kw_only=True)
class HalfEdges:
    """Every side of every face, in the order of the faces: half-edge h runs from corner h to the next of its face.

    Attributes:
        faces: #F by 4.
        tail, head: #H, the vertices it runs from and to.
        face: #H, the face it bounds.
        slot: #H, the column of `tail` in that face.
        next: #H, the half-edge that follows in the face.
        edge: #H, its row in `edges`.
        edges: #E by 2, unique edges as (lower, higher) vertex, sorted.
        count: #E, how many faces lie at each edge.
    """

    faces: IntArray
    edge: IntArray
    edges: IntArray
    count: IntArray

    # What follows from the faces is made when it is first asked for: together it takes twice the memory of the rest.

    @cached_property
    def tail(self) -> IntArray:
        """#H."""
        return _fixed(sides_of(self.faces)[0])

    @cached_property
    def head(self) -> IntArray:
        """#H."""
        return _fixed(sides_of(self.faces)[1])

    @cached_property
    def face(self) -> IntArray:
        """#H."""
        return _fixed(np.repeat(np.arange(len(self.faces), dtype=np.int32), _side_counts(self.faces)))

    @cached_property
    def slot(self) -> IntArray:
        """#H."""
        slots = np.broadcast_to(np.arange(4, dtype=np.int32), self.faces.shape)
        return _fixed(slots[self.faces >= 0])

    @cached_property
    def next(self) -> IntArray:
        """#H."""
        sides = _side_counts(self.faces)
        follow = np.arange(1, len(self.edge) + 1, dtype=np.int32)
        follow[np.cumsum(sides) - 1] -= sides
        return _fixed(follow)


def _fixed(values: IntArray) -> IntArray:
    """A view that is not to be written to: what is asked for twice is the same."""
    view = values.view()
    view.flags.writeable = False
    return view


def _four_columns(faces: ArrayLike) -> IntArray:
    array = np.asarray(faces, dtype=np.int32)
    if array.size == 0:
        return np.empty((0, 4), dtype=np.int32)
    if array.ndim != 2 or array.shape[1] not in (3, 4):
        raise InputError(f"faces must be #F by 4 (or #F by 3), got an array of shape {array.shape}")
    if array.shape[1] == 3:
        return np.column_stack([array, np.full(len(array), -1, dtype=np.int32)])
    return array


def half_edges(faces: ArrayLike) -> HalfEdges:
    """The sides of all faces with their unique edges: what the other functions here are built on."""
    quads = _four_columns(faces)
    tail, head = sides_of(quads)
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    digits = int(high.max(initial=0)).bit_length()
    joined = low.astype(np.int64)
    joined <<= digits
    joined |= high
    keys, order = _sorted_with_order(joined)
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
    """The sides of the surface's faces, worked out once."""
    numbered = row_by_row(surface)
    if numbered is None:
        return read_only(half_edges(surface.faces))
    edge, edges, count = numbered.edges()
    return read_only(HalfEdges(faces=surface.faces.view(), edge=edge, edges=edges, count=count))


def twins_of(he: HalfEdges) -> NDArray[np.int64]:
    """#H, the half-edge on the other side of each, -1 on the border and where more than two faces meet."""
    here = np.arange(len(he.edge))
    both = np.bincount(he.edge, here).astype(np.int64)
    return np.where(he.count[he.edge] == 2, both[he.edge] - here, -1)


def _side_counts(quads: IntArray) -> IntArray:
    """#F, how many sides each face has."""
    return 3 + (quads[:, 3] >= 0).astype(np.int32)


def sides_of(quads: IntArray) -> tuple[IntArray, IntArray]:
    """#H each, tail and head of every side."""
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


def rows_of(array: NDArray[Number], chosen: BoolArray) -> NDArray[Number]:
    """The chosen rows; the array itself, if these are all."""
    return array if chosen.all() else array[chosen]


def order_by(keys: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """The order that sorts numbers below `count`, equal ones in their own, and #count+1, where each number's begin.

    A counting sort: the transpose of a sparse matrix with one entry a row.
    """
    from scipy.sparse import csr_array

    rows = np.arange(len(keys) + 1, dtype=np.int32)
    by_key = csr_array((np.empty(len(keys), dtype=np.int8), keys, rows), shape=(len(keys), count)).tocsc()
    return by_key.indices, by_key.indptr


def stable_order(keys: NDArray[np.integer]) -> NDArray[np.int64]:
    """The order that sorts whole numbers from 0 on, equal ones in their own: what a stable argsort gives, several times as fast."""
    return _sorted_with_order(keys)[1]


def _sorted_with_order(keys: NDArray[np.integer]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Whole numbers from 0 on sorted, and the order that sorts them, equal ones in their own.

    Sorting numbers is several times as fast as finding the order of numbers, so each is given its index as last digits.
    """
    digits = len(keys).bit_length()
    if int(keys.max(initial=0)).bit_length() + digits > 63:
        order = np.argsort(keys, kind="stable")
        return keys[order].astype(np.int64), order
    with_index = keys.astype(np.int64)
    with_index <<= digits
    with_index |= np.arange(len(keys))
    with_index.sort()
    order = with_index & ((1 << digits) - 1)
    with_index >>= digits
    return with_index, order


def mesh_edges(faces: ArrayLike) -> IntArray:
    """#E by 2, the unique edges as (lower, higher) vertex, sorted by the first, then the second. No diagonals."""
    return half_edges(faces).edges


def edge_faces(faces: ArrayLike) -> tuple[IntArray, IntArray]:
    """The edges (as :func:`mesh_edges`) and, #E by 2, the faces beside each: lower index first, -1 on the border.

    Of an edge with more than two faces the two lowest are given; :func:`non_manifold_edges` finds those edges.
    """
    he = half_edges(faces)
    beside = np.full((len(he.edges), 2), -1, dtype=np.int32)
    order = stable_order(he.edge)
    start = np.cumsum(he.count) - he.count
    beside[:, 0] = he.face[order[start]]
    second = he.count > 1
    beside[second, 1] = he.face[order[start[second] + 1]]
    return he.edges, beside


def non_manifold_edges(faces: ArrayLike) -> IntArray:
    """#N by 2, the edges with more than two faces, as (lower, higher) vertex."""
    he = half_edges(faces)
    return he.edges[he.count > 2]


def border_edges(faces: ArrayLike) -> IntArray:
    """#B by 2, the edges with one face, as (from, to) in the direction in which that face runs through them."""
    he = half_edges(faces)
    alone = he.count[he.edge] == 1
    return np.column_stack([he.tail[alone], he.head[alone]])


def _paired(he: HalfEdges) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Half-edges that share an edge, as pairs; around an edge with n faces, n - 1 pairs."""
    if he.count.max(initial=0) <= 2:
        twin = twins_of(he)
        first = np.flatnonzero(twin > np.arange(len(twin)))
        return first, twin[first]
    order = stable_order(he.edge)
    same = he.edge[order[1:]] == he.edge[order[:-1]]
    return order[:-1][same], order[1:][same]


def join_labels(size: int, a: NDArray[np.integer], b: NDArray[np.integer]) -> IntArray:
    """Connected components of `size` nodes joined by the pairs a-b, numbered from 0 by each component's first node."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(size, size))
    labels: IntArray = connected_components(graph, directed=False)[1].astype(np.int32, copy=False)
    if size == 0 or (labels[0] == 0 and (labels[1:] <= np.maximum.accumulate(labels)[:-1] + 1).all()):
        return labels
    # SciPy numbers them so, but does not promise to.
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse.reshape(-1)].astype(np.int32)


def components(faces: ArrayLike, *, barrier: IntArray | None = None) -> IntArray:
    """#F, the connected component of each face, numbered from 0 by each component's first face.

    Faces are connected across shared edges; two faces that touch in a single vertex are not.

    Args:
        faces: #F by 4.
        barrier: #B by 2, edges that do not connect, such as those of a line that may part the surface.
    """
    return _components(half_edges(faces), len(_four_columns(faces)), barrier)


@once_per_faces
def components_of(surface: Surface) -> IntArray:
    """`components` of the surface's faces, worked out once."""
    return _fixed(_components(half_edges_of(surface), len(surface.faces), None))


def _components(he: HalfEdges, size: int, barrier: IntArray | None) -> IntArray:
    if size == 0:
        return np.empty(0, dtype=np.int32)
    # Each face joined to the last one at each of its edges.
    last = np.empty(len(he.edges), dtype=np.int32)
    last[he.edge] = he.face
    a, b = he.face, last[he.edge]
    if barrier is not None and len(barrier):
        stride = np.int64(max(he.edges.max(), barrier.max())) + 1
        blocked = barrier.min(axis=1).astype(np.int64) * stride + barrier.max(axis=1)
        open_edge = ~np.isin(he.edges[:, 0].astype(np.int64) * stride + he.edges[:, 1], blocked)
        passable = open_edge[he.edge]
        a, b = a[passable], b[passable]
    return join_labels(size, a, b)


def corner_fans(faces: ArrayLike) -> IntArray:
    """#H, for each corner (the tails of :func:`half_edges`) the fan of faces around its vertex that it belongs to.

    Corners at one vertex are of one fan where their faces share an edge at that vertex. A vertex of a manifold has one
    fan; a vertex with more is where parts of the surface touch in a point only.
    """
    return _corner_fans(half_edges(faces))


def _corner_fans(he: HalfEdges) -> IntArray:
    a, b = _paired(he)
    opposite = he.tail[a] == he.head[b]
    at_tail = np.where(opposite, he.next[b], b)
    at_head = np.where(opposite, b, he.next[b])
    return join_labels(len(he.tail), np.concatenate([a, he.next[a]]), np.concatenate([at_tail, at_head]))


def non_manifold_vertices(faces: ArrayLike) -> IntArray:
    """#N, the vertices at which several fans of faces touch in the point only (bow ties), sorted."""
    he = half_edges(faces)
    if len(he.tail) == 0:
        return np.empty(0, dtype=np.int32)
    _, first = np.unique(_corner_fans(he), return_index=True)
    vertex, count = np.unique(he.tail[first], return_counts=True)
    return vertex[count > 1].astype(np.int32)


def border_loops(faces: ArrayLike, vertices: FloatArray | None = None) -> list[IntArray]:
    """The closed loops of border edges, each a vertex array that does *not* repeat its first vertex.

    Args:
        faces: consistently wound (see :func:`orient`), no non-manifold edge.
        vertices: #V by 3 positions [m]; when given, "longest" means metres, else the number of edges.

    Returns:
        Loops in the direction in which the faces run through them (the surface lies to the left, seen from outside),
        each from its lowest vertex, the longest loop first. Where two loops touch in a vertex each stays with its own
        fan of faces.

    Raises:
        InputError: if the winding is inconsistent, so that border edges do not follow each other.
    """
    he = half_edges(faces)
    alone = np.flatnonzero(he.count[he.edge] == 1)
    start, end = alone, he.next[alone]
    node = he.tail
    if len(np.unique(he.tail[start])) < len(start):
        node = _corner_fans(he)
    follow = dict(zip(node[start].tolist(), node[end].tolist(), strict=True))
    if len(follow) < len(start) or set(follow) != set(follow.values()):
        raise InputError("the border does not close into loops: the faces are wound inconsistently; orient them first")
    vertex = dict(zip(node[start].tolist(), he.tail[start].tolist(), strict=True))
    loops = []
    for seed in sorted(follow, key=vertex.__getitem__):
        if seed not in follow:
            continue
        loop = []
        here = seed
        while here in follow:
            loop.append(vertex[here])
            here = follow.pop(here)
        loops.append(np.array(loop, dtype=np.int32))

    def length(loop: IntArray) -> float:
        if vertices is None:
            return float(len(loop))
        return polyline_length(vertices[loop], closed=True)

    return sorted(loops, key=length, reverse=True)


def border_of(surface: Surface) -> IntArray:
    """The vertices on the border, in the order of their numbers."""
    numbered = row_by_row(surface)
    return _on_border(half_edges_of(surface)) if numbered is None else numbered.border


def _on_border(he: HalfEdges) -> IntArray:
    return np.unique(he.edges[he.count == 1])


def places_of(vertices: FloatArray, faces: ArrayLike, *, border: IntArray | None = None) -> NDArray[np.int64]:
    """#V, for each vertex the lowest one at the very same place, of which only border vertices have any: sides of a crack.

    Args:
        vertices: #V by 3, positions [m].
        faces: #F by 4.
        border: the vertices on it, in the order of their numbers, if they are known.
    """
    place = np.arange(len(vertices))
    border = _on_border(half_edges(faces)) if border is None else border
    order = np.lexsort(vertices[border].T)
    sorted_places = vertices[border[order]]
    begins = np.append(True, (sorted_places[1:] != sorted_places[:-1]).any(axis=1))[: len(order)]
    if not begins.all():
        place[border[order]] = border[order[begins]][np.cumsum(begins) - 1]
    return place


def euler_characteristic(faces: ArrayLike) -> int:
    """Vertices in use - edges + faces: 2 - 2 (handles) - (border loops) for one connected, orientable surface."""
    he = half_edges(faces)
    return len(np.unique(he.tail)) - len(he.edges) + len(_four_columns(faces))


def orient(faces: ArrayLike) -> tuple[IntArray, int]:
    """Faces wound consistently, and how many of them had to be turned over.

    In each component the winding of the majority is kept. Edges with more than two faces are not crossed.

    Raises:
        InputError: if a component is one-sided, like a Möbius strip.
    """
    quads = _four_columns(faces)
    he = half_edges(quads)
    a, b = _paired(he)
    plain = he.count[he.edge[a]] == 2
    a, b = a[plain], b[plain]
    agree = he.tail[a] == he.head[b]
    size = len(quads)
    fa, fb = he.face[a].astype(np.int64), he.face[b].astype(np.int64)
    # Two copies of each face, one per side: neighbours that agree join like sides, others unlike ones. A component
    # of the surface is two-sided exactly if its two copies stay apart (the orientation double cover).
    other = np.where(agree, fb, fb + size)
    mirror = np.where(agree, fb + size, fb)
    labels = join_labels(2 * size, np.concatenate([fa, fa + size]), np.concatenate([other, mirror]))
    front, back = labels[:size], labels[size:]
    one_sided = np.flatnonzero(front == back)
    if len(one_sided):
        raise InputError(
            f"the surface is one-sided (like a Möbius strip) around face {int(one_sided[0])}: its faces cannot be "
            "wound consistently; cut it open there"
        )
    votes = np.bincount(front, minlength=2 * size)
    lowest = np.minimum(front, back)
    flip = (votes[front] < votes[back]) | ((votes[front] == votes[back]) & (front != lowest))
    turned = quads.copy()
    triangle = quads[:, 3] < 0
    turned[flip & triangle] = quads[flip & triangle][:, [0, 2, 1, 3]]
    turned[flip & ~triangle] = quads[flip & ~triangle][:, [0, 3, 2, 1]]
    return turned, int(flip.sum())


def triangulate(faces: ArrayLike, *, other_diagonal: bool | BoolArray = False) -> tuple[IntArray, IntArray]:
    """#T by 3 triangles, in the order of the faces, and #T, the face of each. Winding is kept.

    Args:
        faces: #F by 4.
        other_diagonal: where true (one value or #F) a quad is split along its corners 1-3 instead of 0-2.
    """
    quads = _four_columns(faces)
    is_quad = quads[:, 3] >= 0
    turn = np.broadcast_to(np.asarray(other_diagonal, dtype=bool), is_quad.shape) & is_quad
    rolled = np.where(turn[:, None], np.roll(quads, -1, axis=1), quads)
    both = np.stack([rolled[:, [0, 1, 2]], rolled[:, [0, 2, 3]]], axis=1)
    keep = np.column_stack([np.ones(len(quads), dtype=bool), is_quad])
    face = np.repeat(np.arange(len(quads), dtype=np.int32), 2).reshape(-1, 2)
    return np.ascontiguousarray(both[keep]), face[keep]


def corner_triangles(faces: ArrayLike) -> tuple[IntArray, IntArray, FloatArray]:
    """Triangles that measure both splits of a quad at once.

    A triangle gives itself with weight 1; a quad gives its four corner triangles (before, corner, after) with weight
    1/2: their weighted areas sum to the mean of both ways of splitting it.

    Returns:
        #C by 3 vertices in the order of the faces, wound as they are; #C, the face of each; #C, the weight.
    """
    quads = _four_columns(faces)
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
    """Both diagonals of each quad, measured on the surface.

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
    bent = np.full(len(index), -1, dtype=np.int8) if crease is None else rows_of(crease, is_quad)
    launch_each(unfold_diagonals, len(index), [vertices, rows_of(faces, is_quad), bent], [lengths])
    return lengths, index
