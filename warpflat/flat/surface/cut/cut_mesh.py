"""Cutting a mesh along paths of edges: the vertices on the path are doubled, nothing else changes.

A cut is found in three steps. The edges of the path are marked. Around each vertex on the path the faces are gathered
into fans: faces that are still connected across unmarked edges. The first fan keeps the vertex, every further fan gets
a copy of it. This treats a dart, a slit, a piece that falls in two, a closed cut and any branching of cuts alike.

Everything here is a pure function: arrays in, new arrays and maps to the uncut mesh out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core.arrays import BoolArray, IndexArray, IntArray
from warpflat.core.errors import InputError
from warpflat.flat.surface.connectivity import components_of, fan_labels, join_labels, part_fans
from warpflat.flat.surface.cut.crack import Crack
from warpflat.flat.surface.half_edges import HalfEdges, half_edges, paired_half_edges
from warpflat.flat.surface.mesh import Surface

__all__ = ["Cut", "CutKind", "cut_along", "faces_at"]

CutKind = Literal["dart", "slit", "split", "hole", "opening", "network"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Cut:
    """A mesh after a cut, with the maps back to the mesh before it.

    Attributes:
        faces: #F by 4, the faces in their old order and winding, in the new numbering.
        vertex_origin: #W, for each new vertex the old one; the first #V are 0, 1, 2, ..., the copies follow.
        kind: "dart" (from the border inwards), "slit" (both ends inside: a fish-eye dart), "split" (into more pieces),
            "hole" (a closed path that takes out an inner piece), "opening" (from border to border, or closed, and still
            one piece: a tube cut open), "network" (several paths at once).
        seams: the stretches of the paths, broken where another cut or the border interrupts one of the sides.
        tips: old vertices at which a cut ends inside the mesh, and which therefore stay whole.
        face_component: #F, which connected piece of the cut mesh a face belongs to, numbered by their first faces.
        component_count: pieces after the cut.
        components_before: pieces before it.
        of_faces: kept results of these faces, for a surface that has them (see `warpflat.flat.surface.mesh.once_per_faces`).
    """

    faces: IntArray
    vertex_origin: IntArray
    kind: CutKind
    seams: tuple[Crack, ...]
    tips: IntArray
    face_component: IntArray
    component_count: int
    components_before: int
    of_faces: dict[str, Any] = field(default_factory=dict, repr=False)


def cut_along(faces: IntArray, paths: Sequence[ArrayLike], *, vertex_count: int) -> Cut:
    """Cut a mesh along paths of edges; they may meet, branch and cross in vertices, but share no edge.

    Paths that end on one another need be given in no special order: a path of one edge is fine as long as one of its ends lies on the
    border or on another path.

    Args:
        faces: #F by 4, consistently wound, manifold; -1 in the last column of a triangle.
        paths: each #P vertices, each joined to the next by an edge; a closed path repeats its first vertex.
        vertex_count: #V.

    Returns:
        The cut. It conserves faces, their order and winding, and hence every area and length.

    Raises:
        InputError: if a path leaves the mesh, visits a vertex twice, runs along the border, is shorter than one edge,
            or separates nothing (one edge with both ends inside). The message names the vertices.
    """
    chains = [_checked_path(path, vertex_count) for path in paths]
    if not chains:
        raise InputError("no path to cut along: give at least one")
    on_path = np.unique(np.concatenate(chains))
    near = faces_at(faces, on_path)
    he = half_edges(faces[near])
    stride = np.int64(vertex_count)
    forward = he.tail.astype(np.int64) * stride + he.head
    order = np.argsort(forward, kind="stable")
    sides = [_sides(chain, he, forward, order, stride) for chain in chains]
    marked = np.zeros(len(he.edges), dtype=bool)
    for chain, (left, _) in zip(chains, sides, strict=True):
        edge = he.edge[left]
        again = np.flatnonzero(marked[edge])
        if len(again):
            raise InputError(f"edge {_edge(chain, int(again[0]))} is cut by two paths; leave it out of one of them")
        marked[edge] = True

    # Each fan of faces around a vertex on a path gets a vertex of its own; the one to the left of the path keeps the old one.
    a, b = paired_half_edges(he)
    whole = ~marked[he.edge[a]]
    torn = np.zeros(vertex_count, dtype=bool)
    torn[on_path] = True
    along = np.concatenate([left for left, _ in sides])
    keeping = np.stack([along, he.next[along]], axis=1).ravel()
    parted, origin = part_fans(he, fan_labels(he, a[whole], b[whole]), torn, keeping=keeping)
    new_faces = faces.copy()
    new_faces[near] = parted
    vertex, fans = parted[he.face, he.slot], np.bincount(origin)
    seams = [
        seam
        for chain, (left, right) in zip(chains, sides, strict=True)
        for seam in _seams(
            chain,
            # Rows: the edges of the path; columns: where each starts and ends in the new numbering.
            np.column_stack([vertex[left], vertex[he.next[left]]]),
            np.column_stack([vertex[he.next[right]], vertex[right]]),
        )
    ]

    cut_mesh = Surface(vertices=np.empty((0, 3)), faces=new_faces, name="")
    labels = components_of(cut_mesh)
    after = int(labels.max(initial=-1)) + 1
    # Joined again across the cut, its components are those before it.
    beside = (labels[near[he.face[np.concatenate(half)]]] for half in zip(*sides, strict=True))
    before = int(join_labels(after, *beside).max(initial=-1)) + 1 if after > 1 else after
    return Cut(
        faces=new_faces,
        vertex_origin=origin,
        kind=_kind(chains, new_faces, labels, np.unique(labels[near]), after > before, fans),
        seams=tuple(seams),
        tips=on_path[fans[on_path] == 1].astype(np.int32),
        face_component=labels,
        component_count=after,
        components_before=before,
        of_faces=cut_mesh.of_faces,
    )


def faces_at(faces: IntArray, vertices: IntArray) -> NDArray[np.int64]:
    """Return the faces (of #F by 4) that have one of these vertices, rising."""
    # With room for the -1 of triangles at its end.
    there = np.zeros(max(int(faces.max(initial=0)), int(vertices.max(initial=0))) + 2, dtype=bool)
    there[vertices] = True
    # Column by column: along four values NumPy's `any` takes several times as long.
    first, second, third, fourth = there[faces].T
    return np.flatnonzero(first | second | third | fourth)


def _edge(chain: IntArray, index: int) -> str:
    return f"{int(chain[index])}-{int(chain[index + 1])}"


def _checked_path(path: ArrayLike, vertex_count: int) -> IntArray:
    """Return the path as integers, once it is known to be one: long enough, in range, no vertex visited twice."""
    chain = np.asarray(path)
    if chain.ndim != 1 or (chain.size and chain.dtype.kind not in "iu"):
        raise InputError(f"a cut path is a row of vertex indices, got shape {chain.shape} of {chain.dtype}")
    if len(chain) < 2:
        where = f" (only vertex {int(chain[0])})" if len(chain) else ""
        raise InputError(f"a cut path needs at least two vertices, got {len(chain)}{where}")
    outside = np.flatnonzero((chain < 0) | (chain >= vertex_count))
    if len(outside):
        raise InputError(f"cut path: vertex {int(chain[outside[0]])} does not exist; valid: 0 to {vertex_count - 1}")
    chain = chain.astype(np.int32)
    closed = len(chain) > 3 and chain[0] == chain[-1]
    body = chain[:-1] if closed else chain
    seen: dict[int, int] = {}
    for position, vertex in enumerate(body.tolist()):
        if vertex in seen:
            raise InputError(
                f"cut path: vertex {vertex} occurs twice, at positions {seen[vertex]} and {position}; a path may only "
                "return to its first vertex, at its end"
            )
        seen[vertex] = position
    return chain


def _sides(
    chain: IntArray,
    he: HalfEdges,
    forward: NDArray[np.int64],
    order: IndexArray,
    stride: np.int64,
) -> tuple[IndexArray, IndexArray]:
    """Return, for each edge of the path, the half-edge on its left (along it) and the one on its right (against it)."""
    a, b = chain[:-1].astype(np.int64), chain[1:].astype(np.int64)
    if len(order) == 0:
        raise InputError(f"cut path: vertex {int(a[0])} belongs to no face")

    def find(key: NDArray[np.int64]) -> tuple[IndexArray, BoolArray]:
        at = order[np.minimum(np.searchsorted(forward, key, sorter=order), len(order) - 1)]
        return at, forward[at] == key

    left, has_left = find(a * stride + b)
    right, has_right = find(b * stride + a)
    missing = np.flatnonzero(~has_left & ~has_right)
    if len(missing):
        i = int(missing[0])
        raise InputError(
            f"cut path leaves the mesh between vertices {int(a[i])} and {int(b[i])} (positions {i} and {i + 1}): they "
            "share no edge"
        )
    single = np.flatnonzero(~has_left | ~has_right)
    if len(single):
        i = int(single[0])
        if he.count[he.edge[left[i] if has_left[i] else right[i]]] > 1:
            raise InputError(f"the faces at edge {_edge(chain, i)} are wound inconsistently; orient the mesh first")
        raise InputError(
            f"cut path runs along the border between vertices {int(a[i])} and {int(b[i])}: there is cloth on one side "
            "only and nothing to separate; start the path where it leaves the border"
        )
    return left, right


def _seams(chain: IntArray, left: IntArray, right: IntArray) -> list[Crack]:
    """Return the stretches of a path (#P) along which both sides run on without a break, by the ends of its edges there (#P - 1 by 2)."""
    whole = np.flatnonzero((left == right).all(axis=1))
    if len(whole):
        raise InputError(
            f"cutting edge {_edge(chain, int(whole[0]))} separates nothing, since both its ends lie inside and "
            "stay whole; start at the border, end on another cut, or take at least two edges"
        )
    joined = (left[:-1, 1] == left[1:, 0]) & (right[:-1, 1] == right[1:, 0])
    runs = np.split(np.arange(len(left)), np.flatnonzero(~joined) + 1)
    closes = chain[0] == chain[-1] and left[-1, 1] == left[0, 0] and right[-1, 1] == right[0, 0]
    if closes and len(runs) > 1:
        runs[0] = np.concatenate([runs.pop(), runs[0]])
    return [
        Crack(
            path=np.append(chain[run], chain[run[-1] + 1]),
            left=np.append(left[run, 0], left[run[-1], 1]),
            right=np.append(right[run, 0], right[run[-1], 1]),
        )
        for run in runs
    ]


def _kind(
    chains: Sequence[IntArray],
    faces: IntArray,
    labels: IntArray,
    touched: IntArray,
    parted: bool,
    fans: NDArray[np.integer],
) -> CutKind:
    """Return the kind of a cut (see :class:`Cut`).

    Args:
        chains: the paths.
        faces: #F by 4, after the cut.
        labels: #F, the component of each face after the cut.
        touched: the components beside the cut.
        parted: true if the cut has made one component two.
        fans: #V, the number of fans at each vertex.
    """
    if len(chains) > 1:
        return "network"
    chain = chains[0]
    if chain[0] == chain[-1]:
        if not parted:
            return "opening"
        # The inner piece of a hole has no border but the cut; a tube cut across has another border on both sides.
        he = half_edges(faces)
        alone = he.count[he.edge] == 1
        border_count = np.bincount(labels[he.face[alone]], minlength=int(labels.max()) + 1)[touched]
        return "hole" if int((border_count == len(chain) - 1).sum()) == 1 else "split"
    if parted:
        return "split"
    inner = fans[chain[1:-1]]
    ends = int((fans[chain[[0, -1]]] > 1).sum())
    # Inside the mesh a vertex with d cut edges has d fans, on the border d + 1.
    if ends == 0 and not (inner > 2).any():
        return "slit"
    return "opening" if ends == 2 else "dart"
