"""Polygons as files have them, made into faces of three or four distinct, convex corners."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core.arrays import BoolArray, FloatArray, IndexArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.vectors import unit
from warpflat.flat.surface.half_edges import HalfEdges
from warpflat.flat.surface.vectors import cross, dot, points_at

__all__ = [
    "distinct_corners",
    "find_crossed_quads",
    "pad_corners",
    "pad_polygons",
    "split_polygons",
    "split_quads",
]

# As `split_quads` takes it: below it a corner is straight.
_STRAIGHT = 1e-3
# Entries of the table of faces, faces times the largest count of corners: a gigabyte.
_MOST_CORNERS = 2**27


def pad_polygons(polygons: ArrayLike | Sequence[Sequence[int]]) -> NDArray[np.int64]:
    """Return #F by the largest corner count, vertex indices, filled up with -1 on the right.

    Raises:
        InputError: if there are no polygons or one has fewer than three corners.
    """
    if isinstance(polygons, np.ndarray) and polygons.ndim == 2 and polygons.shape[1] >= 3:
        if len(polygons) == 0:
            raise InputError("there are no faces")
        if not np.issubdtype(polygons.dtype, np.integer):
            raise InputError(f"faces must be integers (vertex indices), got {polygons.dtype}")
        return polygons.astype(np.int64)
    try:
        rows: list[Any] = list(polygons)  # type: ignore[arg-type]
        count = np.fromiter((len(row) for row in rows), dtype=np.int64, count=len(rows))
        corners = [np.asarray(row).ravel() for row in rows]
        flat = np.concatenate([np.empty(0, dtype=np.int64), *(row.astype(np.int64) for row in corners)])
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError("faces must be lists of vertex indices, one list per face") from error
    if not rows:
        raise InputError("there are no faces")
    wrong = next((n for n, row in enumerate(corners) if len(row) and not np.issubdtype(row.dtype, np.integer)), None)
    if wrong is not None:
        raise InputError(
            f"face {wrong} (counted from 0) is {rows[wrong]!r}; its corners must be integers (vertex indices)"
        )
    short = np.flatnonzero(count < 3)
    if len(short):
        raise InputError(f"face {short[0]} has {count[short[0]]} corners; a face needs at least 3")
    return pad_corners(flat, count)


def pad_corners(flat: NDArray[np.int64], count: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return #F by the largest corner count, at least 4: corners one face after the other, filled up with -1 on the right.

    Raises:
        InputError: if one face has so many corners that the table of all faces would not fit into memory.
    """
    width = max(int(count.max()), 4)
    if len(count) * width > _MOST_CORNERS:
        raise InputError(
            f"face {int(count.argmax())} (counted from 0) has {width:,} corners, too many beside {len(count):,} faces; cut it into "
            "triangles before"
        )
    out = np.full((len(count), width), -1, dtype=np.int64)
    out[np.arange(width) < count[:, None]] = flat
    return out


def distinct_corners(polygons: NDArray[np.int64]) -> tuple[NDArray[np.int64], BoolArray, BoolArray]:
    """Return polygons without corners that repeat the one before.

    A quad with two equal neighbouring corners is a triangle; a polygon with fewer than three corners left, or with
    one vertex at two places, is no face.

    Returns:
        #F by k polygons; #F, which of them are faces; #F, which of those lost a corner.
    """
    ordered = np.sort(polygons, axis=1)
    suspect = np.flatnonzero(((ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] >= 0)).any(axis=1))
    out = polygons.copy()
    keep = np.ones(len(polygons), dtype=bool)
    lost = np.zeros(len(polygons), dtype=bool)
    for row in suspect.tolist():
        corners = [c for c in polygons[row].tolist() if c >= 0]
        kept = [c for i, c in enumerate(corners) if c != corners[i - 1]]
        keep[row] = len(kept) >= 3 and len(set(kept)) == len(kept)
        lost[row] = keep[row]
        out[row] = kept + [-1] * (polygons.shape[1] - len(kept))
    return out, keep, lost


def split_polygons(vertices: FloatArray, polygons: NDArray[np.int64]) -> tuple[IntArray, IntArray]:
    """Return #F by 4 faces with -1 in the last column of a triangle, and #F, the polygon of each.

    Polygons of more than four corners are cut into triangles in their mean plane, as fat ones as their corners allow.

    Raises:
        InputError: naming the polygon, if its outline crosses itself.
    """
    if polygons.shape[1] <= 4:
        faces = np.full((len(polygons), 4), -1, dtype=np.int32)
        faces[:, : polygons.shape[1]] = polygons
        return faces, np.arange(len(polygons), dtype=np.int32)
    import shapely

    large = polygons[:, 4] >= 0
    parts = [polygons[~large, :4].astype(np.int32)]
    origin = [np.flatnonzero(~large).astype(np.int32)]
    for row in np.flatnonzero(large).tolist():
        corners = polygons[row][polygons[row] >= 0]
        centred = vertices[corners] - vertices[corners].mean(axis=0)
        # The polygon's plane, by two vectors that make a right-handed orthogonal frame with its normal.
        normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
        axis = np.eye(3)[int(np.argmin(np.abs(normal)))]
        first = np.cross(axis, normal)
        second = np.cross(normal, first)
        flat = centred @ unit(np.array([first, second])).T
        outline = shapely.Polygon(flat)
        number = {corner: n for n, corner in enumerate(map(tuple, flat.tolist()))}
        if not outline.is_valid or len(number) < len(flat):
            raise InputError(
                f"face {row} (counted from 0) crosses itself or touches itself: it cannot be cut into triangles"
            )
        rings = shapely.get_coordinates(shapely.constrained_delaunay_triangles(outline)).reshape(-1, 4, 2)[:, :3]
        triangles = np.array([number[corner] for corner in map(tuple, rings.reshape(-1, 2).tolist())]).reshape(-1, 3)
        # They are wound as the polygon is.
        a, b, c = flat[triangles].transpose(1, 0, 2)
        clockwise = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) < (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        triangles[clockwise] = triangles[clockwise, ::-1]
        block = np.full((len(triangles), 4), -1, dtype=np.int32)
        block[:, :3] = corners[triangles]
        parts.append(block)
        origin.append(np.full(len(triangles), row, dtype=np.int32))
    index = np.concatenate(origin)
    order = np.argsort(index, kind="stable")
    return np.concatenate(parts)[order], index[order]


def split_quads(
    vertices: FloatArray, he: HalfEdges, origin: IntArray, tolerance: float
) -> tuple[IntArray, IntArray, dict[str, IntArray]]:
    """Cut quads into two triangles that cannot lie flat as they are.

    - At a straight or inward corner the corner triangle has no area, or a negative one, and could not be distinguished from a flipped
      one: the quad is cut from that corner.
    - A quad whose sides cross, or whose halves meet at less than a right angle, is cut along the diagonal at which they lie flatter.
    - Two quads that alone surround a vertex (a doublet) cannot both be convex in the plane, and cut across it they would share their
      diagonal: both are cut from that vertex.

    Args:
        vertices: #V by 3, positions [m].
        he: half-edges of the faces.
        origin: #F, the input face of each.
        tolerance: a corner counts as straight if its height over the diagonal before it is below this share of the
            quad's mean edge.

    Returns:
        Faces, origins, and the input faces that were cut, by what they were.
    """
    faces = he.faces
    quads = np.flatnonzero(faces[:, 3] >= 0)
    height, inward, thin, crossed = _quad_corners(vertices[faces[quads]], tolerance)
    in_two = np.bincount(faces.ravel() + 1)[1:] == 2
    in_two[he.edges[he.count != 2].ravel()] = False
    lonely = in_two[faces[quads]]
    doublet = lonely.any(axis=1) & ~crossed & ~(inward.any(axis=1) & ~thin)
    cut = (inward.any(axis=1) & ~thin) | crossed | doublet
    if not cut.any():
        return faces, origin, {}
    rows, corner = quads[cut], np.argmin(height[cut], axis=1)
    folded, paired = crossed[cut], doublet[cut]
    # A folded quad is cut along the diagonal (0 for corners 0-2, 1 for 1-3) at which its halves lie flatter, or along
    # the shorter of two alike.
    p = vertices[faces[rows[folded]]]
    side = np.roll(p, -1, axis=1) - p
    # The normal of each corner triangle; corners 1 and 3 are the halves along 0-2.
    normal = np.cross(np.roll(side, 1, axis=1), side)
    size, facing = np.linalg.norm(normal, axis=2), unit(normal)
    bent = np.stack([np.einsum("qi,qi->q", facing[:, k], facing[:, k + 2]) for k in (1, 0)], axis=1)
    thin = np.stack([np.minimum(size[:, k], size[:, k + 2]) for k in (1, 0)], axis=1)
    mean = np.linalg.norm(side, axis=2).mean(axis=1, keepdims=True)
    flatness = np.where(thin > tolerance * mean**2, bent.round(6), -2.0)
    first, second = (np.linalg.norm(p[:, k + 2] - p[:, k], axis=1) for k in (0, 1))
    better, equal = flatness[:, 1] > flatness[:, 0], flatness[:, 1] == flatness[:, 0]
    corner[folded] = (better | (equal & (second < first))).astype(np.intp)
    corner[paired] = np.argmax(lonely[doublet], axis=1)
    turned = faces[rows][np.arange(len(rows))[:, None], (corner[:, None] + np.arange(4)) % 4]
    none = np.full(len(rows), -1, dtype=np.int32)
    out = faces.copy()
    out[rows] = np.column_stack([turned[:, :3], none])
    second = np.column_stack([turned[:, 0], turned[:, 2], turned[:, 3], none])
    # Each second half directly behind its first keeps the order of the input faces.
    faces, of = np.insert(out, rows + 1, second, axis=0), np.insert(origin, rows + 1, origin[rows])
    kinds = {
        "with a straight or inward corner": ~folded & ~paired,
        "folded over, or with crossing sides,": folded,
        "that meet another at a vertex of no other face": paired,
    }
    return faces, of, {what: origin[rows[which]] for what, which in kinds.items() if which.any()}


def find_crossed_quads(vertices: FloatArray, faces: IntArray) -> IndexArray:
    """Return the faces (of #F by 4) that are quads whose sides cross, or that are folded by more than 90 degrees."""
    quads = np.flatnonzero(faces[:, 3] >= 0)
    # All that cross are among the quads that have a corner that turns the other way, or next to no area.
    p = points_at(vertices, faces[quads].T)
    side, diagonal = np.roll(p, -1, axis=1) - p, p[:, 2:] - p[:, :2]
    normal = cross(diagonal[:, 0], diagonal[:, 1])
    turning = dot(cross(np.roll(side, 1, axis=1), side), normal[:, None])
    longest = dot(side, side).max(axis=0) * dot(diagonal, diagonal).max(axis=0)
    doubtful = quads[np.asarray((turning.min(axis=0) < 0.0) | (dot(normal, normal) <= _STRAIGHT**2 * longest))]
    return doubtful[_quad_corners(vertices[faces[doubtful]], _STRAIGHT)[3]]


def _quad_corners(p: FloatArray, tolerance: float) -> tuple[NDArray[Any], ...]:
    """Measure the corners of quads.

    Args:
        p: #Q by 4 by 3, their corners [m].
        tolerance: see :func:`split_quads`.

    Returns:
        #Q by 4, the height of each corner over the diagonal before it [m]; #Q by 4, true where it is straight or inward; #Q, true for
        slivers; #Q, true for quads whose sides cross.
    """
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    before, after = np.roll(p, 1, axis=1), np.roll(p, -1, axis=1)
    chord = np.linalg.norm(after - before, axis=2)
    mean = np.linalg.norm(after - p, axis=2).mean(axis=1)
    twice = np.einsum("fci,fi->fc", np.cross(p - before, after - p), unit(normal))
    height = twice / np.maximum(chord, np.finfo(float).tiny)
    inward = height <= tolerance * mean[:, None]
    # Where no corner spans an area there is no inside: that is a sliver, not a matter of convexity.
    spread = np.linalg.norm(np.cross(p - before, after - p), axis=2).max(axis=1)
    thin = spread <= tolerance * mean * np.maximum(chord, np.linalg.norm(after - p, axis=2)).max(axis=1)
    folded = (inward.sum(axis=1) > 1) & (height.min(axis=1) < -tolerance * mean)
    void = np.linalg.norm(normal, axis=1) <= tolerance * mean * chord.max(axis=1)
    return height, inward, thin, (folded | void) & ~thin
