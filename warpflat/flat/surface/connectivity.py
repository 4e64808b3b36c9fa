"""Connected components of a mesh, fans around vertices, border loops and orientation.

Faces are #F by 4 vertex indices with -1 in the last column of a triangle; #F by 3 stands for triangles only. Half-edges that have been
made before do instead of faces. No function changes its arguments. Unless a docstring says otherwise, the mesh may be wound inconsistently
and an edge may have any number of faces: the same functions check a mesh that comes in and query it afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.flat.surface.half_edges import (
    HalfEdges,
    half_edges,
    half_edges_of,
    paired_half_edges,
    read_only_view,
)
from warpflat.flat.surface.mesh import Surface, once_per_faces

__all__ = [
    "border_loops",
    "border_of",
    "chain_lines",
    "coincident_vertices",
    "components",
    "components_of",
    "corner_fans",
    "euler_characteristic",
    "fan_labels",
    "join_labels",
    "non_manifold_vertices",
    "orient",
    "part_fans",
]


def join_labels(size: int, a: NDArray[np.integer], b: NDArray[np.integer]) -> IntArray:
    """Label the connected components of `size` nodes that the pairs a-b join, from 0 by each component's first node."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(size, size))
    labels: IntArray = connected_components(graph, directed=False)[1].astype(np.int32, copy=False)
    if size == 0 or (labels[0] == 0 and (labels[1:] <= np.maximum.accumulate(labels)[:-1] + 1).all()):
        return labels
    # SciPy numbers components in this order, but does not promise to.
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse.reshape(-1)].astype(np.int32)


def components(faces: ArrayLike | HalfEdges, *, barrier: IntArray | None = None) -> IntArray:
    """Return #F, the connected component of each face, numbered from 0 by each component's first face.

    Faces are connected across shared edges; two faces that touch in a single vertex are not.

    Args:
        faces: #F by 4.
        barrier: #B by 2, edges that do not connect, such as those of a line that may part the surface.
    """
    he = half_edges(faces)
    return _components(he, len(he.faces), barrier)


@once_per_faces
def components_of(surface: Surface) -> IntArray:
    """Return #F, the connected component of each face of a surface, computed once per array of faces."""
    return read_only_view(_components(half_edges_of(surface), len(surface.faces), None))


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


def fan_labels(he: HalfEdges, a: NDArray[np.integer], b: NDArray[np.integer]) -> IntArray:
    """Return #H, the fan of faces around its vertex to which each corner (tail of a half-edge) belongs, numbered by their first corners.

    Corners at one vertex belong to one fan where their faces are joined at an edge of that vertex: by the pairs a-b (#P each) of half-edges
    that share it.
    """
    opposite = he.tail[a] == he.head[b]
    at_tail = np.where(opposite, he.next[b], b)
    at_head = np.where(opposite, b, he.next[b])
    return join_labels(len(he.tail), np.concatenate([a, he.next[a]]), np.concatenate([at_tail, at_head]))


def corner_fans(he: HalfEdges) -> IntArray:
    """Return `fan_labels` of faces that are joined at all their edges.

    A vertex of a manifold has one fan; a vertex with more is where parts of the surface touch in a point only.
    """
    return fan_labels(he, *paired_half_edges(he))


def part_fans(
    he: HalfEdges, fan: IntArray, torn: BoolArray, *, keeping: NDArray[np.integer] | None = None
) -> tuple[IntArray, IntArray]:
    """Give each fan of faces a vertex of its own.

    Args:
        he: half-edges of the faces.
        fan: #H, of :func:`fan_labels`.
        torn: #V, true at the vertices whose fans are parted.
        keeping: corners whose fans keep their vertex, the first one at each vertex; elsewhere it is the fan with the first corner of all.

    Returns:
        #F by 4, the faces; #W, for each vertex the one that it was: the first #V are 0, 1, 2, ..., the copies follow.
    """
    first = np.flatnonzero(np.diff(np.maximum.accumulate(fan), prepend=-1))
    vertex, count = he.tail[first], len(torn)
    keeper = np.empty(count, dtype=np.int64)
    # Of several values that are given to one vertex the last is kept.
    for corners in (first,) if keeping is None else (first, keeping):
        keeper[he.tail[corners[::-1]]] = fan[corners[::-1]]
    copies = np.flatnonzero((keeper[vertex] != np.arange(len(first))) & torn[vertex])
    number = vertex.astype(np.int32)
    number[copies] = count + np.arange(len(copies))
    faces = he.faces.copy()
    faces[he.face, he.slot] = number[fan]
    return faces, np.concatenate([np.arange(count, dtype=np.int32), vertex[copies]])


def non_manifold_vertices(faces: ArrayLike) -> IntArray:
    """Return #N, the vertices at which several fans of faces touch in a point only (bow ties), sorted."""
    he = half_edges(faces)
    if len(he.tail) == 0:
        return np.empty(0, dtype=np.int32)
    _, first = np.unique(corner_fans(he), return_index=True)
    vertex, count = np.unique(he.tail[first], return_counts=True)
    return vertex[count > 1].astype(np.int32)


def border_loops(faces: ArrayLike | HalfEdges, vertices: FloatArray | None = None) -> list[IntArray]:
    """Return the closed loops of border edges, each a row of vertices that does *not* repeat its first.

    Args:
        faces: consistently wound (see :func:`orient`), no non-manifold edge.
        vertices: #V by 3 positions [m], by which loops are ordered; without them the number of edges counts.

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
        node = corner_fans(he)
    follow = dict(zip(node[start].tolist(), node[end].tolist(), strict=True))
    if len(follow) < len(start) or set(follow) != set(follow.values()):
        raise InputError("the border does not close into loops: the faces are wound inconsistently; orient them first")
    vertex = dict(zip(node[start].tolist(), he.tail[start].tolist(), strict=True))
    loops = []
    for seed in sorted(follow, key=vertex.__getitem__):
        loop = []
        here = seed
        while here in follow:
            loop.append(vertex[here])
            here = follow.pop(here)
        if loop:
            loops.append(np.array(loop, dtype=np.int32))

    def length(loop: IntArray) -> float:
        return float(len(loop)) if vertices is None else polyline_length(vertices[loop], closed=True)

    return sorted(loops, key=length, reverse=True)


def chain_lines(parts: Sequence[Sequence[int]]) -> list[list[int]]:
    """Return rows of vertices, such as edges, joined end to end where exactly two ends meet; a closed one repeats its first vertex."""
    ends: dict[int, list[int]] = {}
    for number, part in enumerate(parts):
        for vertex in {part[0], part[-1]}:
            ends.setdefault(vertex, []).append(number)
    left = dict(enumerate(parts))
    chains = []
    for number in range(len(parts)):
        if number not in left:
            continue
        joined = list(left.pop(number))
        for _ in range(2):
            while joined[0] != joined[-1]:
                meeting = ends.get(joined[-1], [])
                follow = [n for n in meeting if n in left]
                if len(meeting) != 2 or not follow:
                    break
                part = left.pop(follow[0])
                joined += (part if part[0] == joined[-1] else part[::-1])[1:]
            joined.reverse()
        chains.append(joined)
    return chains


def border_of(surface: Surface) -> IntArray:
    """Return the vertices on a surface's border, sorted."""
    return _on_border(half_edges_of(surface))


def _on_border(he: HalfEdges) -> IntArray:
    return np.unique(he.edges[he.count == 1])


def coincident_vertices(vertices: FloatArray, faces: ArrayLike, *, border: IntArray | None = None) -> NDArray[np.int64]:
    """Return #V, the lowest vertex at exactly the same place as each one.

    Only border vertices have others at their place: those on the two sides of a crack.

    Args:
        vertices: #V by 3, positions [m].
        faces: #F by 4.
        border: the sorted vertices on the border, if they are known.
    """
    place = np.arange(len(vertices))
    border = _on_border(half_edges(faces)) if border is None else border
    order = np.lexsort(vertices[border].T)
    positions = vertices[border[order]]
    is_first = np.append(True, (positions[1:] != positions[:-1]).any(axis=1))[: len(order)]
    if not is_first.all():
        place[border[order]] = border[order[is_first]][np.cumsum(is_first) - 1]
    return place


def euler_characteristic(faces: ArrayLike | HalfEdges) -> int:
    """Return vertices in use - edges + faces.

    It is 2 - 2 (handles) - (border loops) for one connected, orientable surface."""
    he = half_edges(faces)
    return int(np.count_nonzero(np.bincount(he.tail))) - len(he.edges) + len(he.faces)


def orient(faces: ArrayLike | HalfEdges) -> tuple[IntArray, int]:
    """Return faces wound consistently, and how many of them had to be turned over.

    In each component the winding of the majority is kept. Edges with more than two faces are not crossed.

    Raises:
        InputError: if a component is one-sided, like a Möbius strip.
    """
    he = half_edges(faces)
    quads = he.faces
    a, b = paired_half_edges(he)
    plain = he.count[he.edge[a]] == 2
    a, b = a[plain], b[plain]
    agree = he.tail[a] == he.head[b]
    if agree.all():
        return quads, 0
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
