"""Sheets of cloth out of what is more than a sheet: fins and pockets that meet it at an edge, and cloth drawn with its thickness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.text import area_words
from warpflat.core.vectors import unit
from warpflat.flat.surface.connectivity import components, fan_labels, join_labels, part_fans
from warpflat.flat.surface.half_edges import HalfEdges, border_edges, paired_half_edges
from warpflat.flat.surface.normals import area_vectors
from warpflat.flat.surface.triangles import corner_means

__all__ = ["THICKEST", "OuterSheet", "inner_sheets", "outer_sheet", "part_sheets"]

#: Cloth is no thicker than this [m], nor than this share of its size, the square root of the area of one side.
THICKEST, _THICK_SHARE = 0.015, 0.03
# Sheets of one cloth are at their usual distance within this share, over this share of the area.
_EVEN, _MOSTLY = 0.6, 0.85
# A part of less than this share of all cloth has no inner sheet looked for.
_CRUMB = 1e-3
# Sheets whose flux about their common middle agrees within this share are flat.
_FLAT = 1e-6
# Two open sheets whose flux about their own middle is less than this share of their area times their size curve to neither side.
_CURVED = 0.02
# The nearest face that looks the other way: a difference in direction of 1 counts like this share of the size.
_TURN = 0.05


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
    into = corner_means(vertices, he.faces[he.face[at]]) - vertices[he.tail[at]]
    into -= along * ((into * along).sum(axis=1) / np.maximum(length**2, np.finfo(float).tiny))[:, None]
    into = unit(into)
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
    torn = np.zeros(len(vertices), dtype=bool)
    torn[he.edges[crowded]] = True
    return part_fans(he, fan_labels(he, a, b), torn)


def _facing(middle: FloatArray, vector: FloatArray, reach: FloatArray) -> tuple[IntArray, BoolArray, float] | None:
    """Pair each face with the nearest one that looks the other way; return None if they lie apart further than sheets of one cloth.

    Args:
        middle: #F by 3, middles of faces [m].
        vector: #F by 3, their vector areas [m2], away from the cloth between the sheets.
        reach: #F, their longest edges [m].

    Returns:
        #F, the partners; #F, whether both lie at the usual distance; and that distance, the thickness [m].
    """
    from scipy.spatial import cKDTree

    area = np.linalg.norm(vector, axis=1)
    size = float(np.sqrt(0.5 * area.sum()))
    normal = unit(vector)
    tree = cKDTree(np.hstack([middle, _TURN * size * normal]))

    def mates(rows: NDArray[np.integer], shift: float) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return for some faces the partner, how deep it lies below them and how far aside, sought at a depth."""
        places = middle[rows] - shift * normal[rows]
        found = tree.query(np.hstack([places, -_TURN * size * normal[rows]]))[1]
        gap = middle[found] - middle[rows]
        # At right angles to the larger of both, whose middle may lie far aside.
        across = np.where((reach[found] > reach[rows])[:, None], -normal[found], normal[rows])
        below = -(gap * across).sum(axis=1)
        return found, below, np.linalg.norm(gap + below[:, None] * across, axis=1)

    mate, depth, aside = mates(np.arange(len(area)), 0.0)
    order = np.argsort(depth)
    thickness = float(depth[order[np.searchsorted(np.cumsum(area[order]), 0.5 * area.sum())]])
    if not 0.0 < thickness <= min(THICKEST, _THICK_SHARE * size):
        return None
    # Another layer on top, as a pocket, is nearer.
    above = np.flatnonzero(depth <= 0.0)
    mate[above], depth[above], aside[above] = mates(above, thickness)
    near = aside <= np.maximum(np.maximum(reach, reach[mate]), thickness)
    paired = near & (np.abs(depth - thickness) <= _EVEN * thickness)
    paired &= (normal * normal[mate]).sum(axis=1) < -0.5
    return mate, paired, thickness


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

    def describe(self) -> str:
        """Return what was taken, as a note."""
        return (
            f"cloth drawn {1e3 * self.thickness:.2g} mm thick: its outer sheet was taken, the inner one and the rim "
            f"({area_words(self.left_out)}) left out"
        )


def outer_sheet(vertices: FloatArray, he: HalfEdges) -> OuterSheet | None:
    """Return the outer sheet of a closed surface that is cloth with thickness; None for any other.

    Each face is paired with the nearest one that looks the other way. Where nearly all of them lie at one small distance, with the cloth
    between them, there are two sheets. They are parted where faces have no such partner, or where the surface turns sharply.

    Args:
        vertices: #V by 3, positions [m].
        he: half-edges of faces that are wound alike, two at each edge.
    """
    faces = he.faces
    vector = area_vectors(vertices, faces)
    area = np.linalg.norm(vector, axis=1)
    middle = corner_means(vertices, faces)
    if float((vector * (middle - middle.mean(axis=0))).sum()) < 0.0:
        vector = -vector
    normal = unit(vector)
    found = _facing(middle, vector, _longest_sides(vertices, faces))
    if found is None:
        return None
    mate, paired, thickness = found
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
    flux = (vector * (middle - np.average(middle, axis=0, weights=area))).sum(axis=1)
    one_side, other_side = float(flux[outer > 0.0].sum()), float(flux[outer < 0.0].sum())
    way = vector[outer > 0.0].sum(axis=0)
    # Of flat cloth the side that looks along an axis, so that panels beside each other keep the same one.
    flat = abs(one_side - other_side) <= _FLAT * (one_side + other_side)
    if way[np.abs(way).argmax()] < 0.0 if flat else one_side < other_side:
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


def inner_sheets(layers: Sequence[tuple[FloatArray, IntArray]]) -> dict[int, tuple[int, float]]:
    """Return the layers that are the inner sheet or the rim of cloth with thickness, each with its outer sheet and the thickness [m].

    Two sheets without a rim, or with one that shares no vertex with them, are parts of their own: they lie at one small distance over
    nearly all of their area and look away from each other. A lining looks the same way as its outer layer.

    Args:
        layers: connected parts: #V by 3 [m], and faces (#F by 4) that are wound alike.
    """
    from scipy.spatial import cKDTree

    low, high = (np.array([bound(points, axis=0) for points, _ in layers]) for bound in (np.min, np.max))
    vectors = [area_vectors(points, faces) for points, faces in layers]
    middles = [corner_means(points, faces) for points, faces in layers]
    areas = np.array([np.linalg.norm(vector, axis=1).sum() for vector in vectors])
    if not areas.sum() > 0.0:
        return {}
    whole = np.average(np.concatenate(middles), axis=0, weights=np.linalg.norm(np.concatenate(vectors), axis=1))
    found = dict[int, tuple[int, float]]()
    taken = set[int]()
    for one in np.argsort(-areas, kind="stable").tolist():
        if areas[one] < _CRUMB * areas.sum():
            break
        within = (low >= low[one] - THICKEST).all(axis=1) & (high <= high[one] + THICKEST).all(axis=1)
        others = [k for k in np.flatnonzero(within).tolist() if k != one and k not in taken]
        if one in taken or not others:
            continue
        group = [one, *others]
        own = np.repeat(np.arange(len(group)), [len(vectors[k]) for k in group])
        middle, vector = (np.concatenate([rows[k] for k in group]) for rows in (middles, vectors))
        reach = np.concatenate([_longest_sides(*layers[k]) for k in group])
        area = np.linalg.norm(vector, axis=1)
        sign, pairs = next(
            ((sign, pairs) for sign in (1.0, -1.0) if (pairs := _facing(middle, sign * vector, reach)) is not None),
            (0.0, None),
        )
        if pairs is None:
            continue
        mate, paired, thickness = pairs
        across = paired & ((own == 0) != (own[mate] == 0))
        share = np.bincount(own, area * across, minlength=len(group)) / areas[group]
        partners = [k for k in range(1, len(group)) if share[k] >= _MOSTLY]
        if share[0] < _MOSTLY or not partners:
            continue
        # The sheet that is farther out about their middle; two that curve to neither side, about that of the whole garment.
        sheets = np.isin(own, [0, *partners])
        side = np.where(own == 0, 1.0, -1.0) * sign
        for centre in (np.average(middle[sheets], axis=0, weights=area[sheets]), whole):
            flux = float((side * (vector * (middle - centre)).sum(axis=1))[sheets].sum())
            if abs(flux) > _CURVED * areas[one] ** 1.5:
                break
        # Flat ones: the first.
        first = flux >= -1e-9 * areas[one] ** 1.5
        inner, outer = ([group[k] for k in partners], one) if first else ([one], group[partners[0]])
        taken.update([one, *(group[k] for k in partners)])
        found.update(dict.fromkeys(inner, (outer, thickness)))
        # A rim is a strip along both, as wide as they lie apart.
        around = cKDTree(np.concatenate([layers[k][0] for k in (one, *(group[k] for k in partners))]))
        for k in others:
            points, faces = layers[k]
            border = points[border_edges(faces)]
            length = float(np.linalg.norm(border[:, 1] - border[:, 0], axis=1).sum())
            narrow = k not in taken and areas[k] <= 0.75 * thickness * length
            if narrow and around.query(layers[k][0])[0].max() <= thickness:
                taken.add(k)
                found[k] = outer, thickness
    return found


def _longest_sides(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return #F, the longest side of each face (#F by 4) [m]."""
    places = vertices[np.where(faces >= 0, faces, faces[:, :1])]
    return np.asarray(np.linalg.norm(places - np.roll(places, -1, axis=1), axis=2).max(axis=1))
