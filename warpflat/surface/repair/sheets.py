"""Sheets of cloth out of what is more than a sheet: fins and pockets that meet it at an edge, and cloth drawn with its thickness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.surface.connectivity import components, join_labels
from warpflat.surface.half_edges import HalfEdges, paired_half_edges

__all__ = ["OuterSheet", "face_vectors", "outer_sheet", "part_sheets"]

# Cloth is no thicker than this [m], nor than this share of its size, the square root of the area of one side.
_THICKEST, _THICK_SHARE = 0.015, 0.03
# Sheets of one cloth are at their usual distance within this share, over this share of the area.
_EVEN, _MOSTLY = 0.6, 0.85
# The nearest face that looks the other way: a difference in direction of 1 counts like this share of the size.
_TURN = 0.05


def face_vectors(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return #F by 3, the vector area of each face (#F by 4): along its normal, as long as its area [m2]."""
    last = np.where(faces[:, 3] >= 0, faces[:, 3], faces[:, 0])
    a, b, c, d = (vertices[corner] for corner in (*faces[:, :3].T, last))
    return np.asarray(0.5 * np.cross(c - a, d - b))


def part_sheets(vertices: FloatArray, he: HalfEdges) -> tuple[IntArray, IntArray]:
    """Part faces where more than two meet at an edge: the two patches that go on the straightest stay joined there.

    Patches are what such edges leave; two of them are judged along all edges at which they meet, so that a fin comes off whole.

    Args:
        vertices: #V by 3, positions [m].
        he: half-edges of the faces.

    Returns:
        #F by 4, faces in new vertices; #W, for each of these the vertex that it was (the first #V are those that were).
    """
    crowded = np.flatnonzero(he.count > 2)
    patch = components(he, barrier=he.edges[crowded])
    at = np.flatnonzero(he.count[he.edge] > 2)
    at = at[np.argsort(he.edge[at], kind="stable")]
    # Into each face, at right angles to the edge.
    along = vertices[he.edges[he.edge[at], 1]] - vertices[he.edges[he.edge[at], 0]]
    length = np.linalg.norm(along, axis=1)
    faces = he.faces[he.face[at]]
    real = faces >= 0
    middle = (vertices[np.maximum(faces, 0)] * real[..., None]).sum(axis=1) / real.sum(axis=1)[:, None]
    into = middle - vertices[he.tail[at]]
    into -= along * ((into * along).sum(axis=1) / np.maximum(length**2, np.finfo(float).tiny))[:, None]
    into /= np.maximum(np.linalg.norm(into, axis=1, keepdims=True), np.finfo(float).tiny)
    starts = np.flatnonzero(np.append(True, np.diff(he.edge[at]) != 0))
    pairs = [
        (first + i, first + j)
        for first, end in zip(starts.tolist(), [*starts[1:].tolist(), len(at)], strict=True)
        for i in range(end - first)
        for j in range(i + 1, end - first)
    ]
    one, other = np.array(pairs).T
    straight = -(into[one] * into[other]).sum(axis=1)
    key = np.sort(np.stack([patch[he.face[at[one]]], patch[he.face[at[other]]]], axis=1), axis=1)
    of = np.unique(key, axis=0, return_inverse=True)[1].ravel()
    weight = np.bincount(of, length[one])
    score = np.bincount(of, length[one] * straight) / np.maximum(weight, np.finfo(float).tiny)
    taken = np.zeros(len(at), dtype=bool)
    joined = list[tuple[int, int]]()
    for k in np.lexsort((-straight, of, -score[of])).tolist():
        if not (taken[one[k]] or taken[other[k]]):
            taken[[one[k], other[k]]] = True
            joined.append((int(at[one[k]]), int(at[other[k]])))
    plain = np.stack(paired_half_edges(he), axis=1)
    a, b = np.concatenate([plain[he.count[he.edge[plain[:, 0]]] == 2], np.array(joined, dtype=np.int64)]).T
    opposite = he.tail[a] == he.head[b]
    fan = join_labels(
        len(he.tail),
        np.concatenate([a, he.next[a]]),
        np.concatenate([np.where(opposite, he.next[b], b), np.where(opposite, b, he.next[b])]),
    )
    # Of the fans at a vertex of such an edge the first keeps it; elsewhere all do.
    torn = np.zeros(len(vertices), dtype=bool)
    torn[he.edges[crowded]] = True
    first = np.unique(fan, return_index=True)[1]
    vertex = he.tail[first].astype(np.int64)
    order = np.lexsort((first, vertex))
    again = np.zeros(len(first), dtype=bool)
    again[order[1:]] = vertex[order[1:]] == vertex[order[:-1]]
    extra = np.flatnonzero(again & torn[vertex])
    new = vertex.copy()
    new[extra] = len(vertices) + np.arange(len(extra))
    out = he.faces.copy()
    out[he.face, he.slot] = new[fan]
    origin = np.concatenate([np.arange(len(vertices)), vertex[extra]])
    return out.astype(np.int32), origin.astype(np.int32)


@dataclass(frozen=True, kw_only=True, eq=False)
class OuterSheet:
    """The outer sheet of cloth that is drawn with its thickness.

    Attributes:
        faces: #F, true for its faces.
        thickness: between both sheets [m].
        left_out: area of the inner sheet and of the rim between both [m2].
    """

    faces: BoolArray
    thickness: float
    left_out: float


def outer_sheet(vertices: FloatArray, he: HalfEdges) -> OuterSheet | None:
    """Return the outer sheet of a closed surface that is cloth with thickness; None for any other.

    Each face is paired with the nearest one that looks the other way. Where nearly all of them lie at one small distance, with the cloth
    between them, there are two sheets. They are parted where faces have no such partner, or where the surface turns sharply.

    Args:
        vertices: #V by 3, positions [m].
        he: half-edges of faces that are wound alike, two at each edge.
    """
    from scipy.spatial import cKDTree

    faces = he.faces
    vector = face_vectors(vertices, faces)
    area = np.linalg.norm(vector, axis=1)
    size = float(np.sqrt(0.5 * area.sum()))
    normal = vector / np.maximum(area, np.finfo(float).tiny)[:, None]
    real = faces >= 0
    middle = (vertices[np.maximum(faces, 0)] * real[..., None]).sum(axis=1) / real.sum(axis=1)[:, None]
    if float((vector * (middle - middle.mean(axis=0))).sum()) < 0.0:
        normal = -normal
    _, mate = cKDTree(np.hstack([middle, _TURN * size * normal])).query(np.hstack([middle, -_TURN * size * normal]))
    gap = middle[mate] - middle
    depth = -(gap * normal).sum(axis=1)
    aside = np.linalg.norm(gap + depth[:, None] * normal, axis=1)
    order = np.argsort(depth)
    thickness = float(depth[order[np.searchsorted(np.cumsum(area[order]), 0.5 * area.sum())]])
    if not 0.0 < thickness <= min(_THICKEST, _THICK_SHARE * size):
        return None
    edge = np.linalg.norm(vertices[he.edges[:, 1]] - vertices[he.edges[:, 0]], axis=1)
    reach = np.zeros(len(faces))
    np.maximum.at(reach, he.face, edge[he.edge])
    paired = (np.abs(depth - thickness) <= _EVEN * thickness) & (aside <= np.maximum(reach, thickness))
    paired &= (normal * normal[mate]).sum(axis=1) < -0.5
    if area[paired].sum() < _MOSTLY * area.sum():
        return None
    a, b = paired_half_edges(he)
    one, other = he.face[a], he.face[b]
    level = (normal[one] * normal[other]).sum(axis=1) > 0.0
    inside = paired[one] & paired[other] & level
    part = join_labels(len(faces), one[inside], other[inside])
    # Parts are on one side or the other, from the largest on: each opposite to where the partners of its faces are.
    size_of = np.bincount(part, area * paired)
    side = np.zeros(len(size_of))
    side[int(size_of.argmax())] = 1.0
    for _ in range(len(size_of)):
        vote = np.bincount(part[paired], -area[paired] * side[part[mate[paired]]], minlength=len(side))
        fresh = (side == 0.0) & (vote != 0.0)
        if not fresh.any():
            break
        side[fresh] = np.sign(vote[fresh])
    outer = np.where(paired, side[part], 0.0)
    flux = (vector * (middle - np.average(middle, axis=0, weights=area))).sum(axis=1) * np.sign(
        (vector * normal).sum(axis=1)
    )
    if float(flux[outer > 0.0].sum()) < float(flux[outer < 0.0].sum()):
        outer = -outer
    # Faces without a partner that lie wholly within the outer sheet are of it.
    loose = outer == 0.0
    inner = loose[one] & loose[other] & level
    patch = join_labels(len(faces), one[inner], other[inner])
    touches = np.zeros(len(faces))
    for here, there in ((one, other), (other, one)):
        bad = loose[here] & ~loose[there] & ((outer[there] < 0.0) | ~level)
        np.add.at(touches, patch[here[bad]], 1.0)
    good = loose & (touches[patch] == 0.0)
    kept: NDArray[np.bool_] = (outer > 0.0) | good
    joined = kept[one] & kept[other]
    whole = join_labels(len(faces), one[joined], other[joined])
    total = np.bincount(whole, area * kept)
    kept &= whole == int(total.argmax())
    if not 0.3 * area.sum() < area[kept].sum() < 0.7 * area.sum():
        return None
    return OuterSheet(faces=kept, thickness=thickness, left_out=float(area[~kept].sum()))
