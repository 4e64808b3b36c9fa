"""Outlines of patterns that come from files: their edges put in order, or found between corners."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from warpflat.core import FARTHEST, FloatArray, InputError, polyline_length, turn_between, unit
from warpflat.pattern.drafting.corners import find_corners
from warpflat.pattern.drafting.curves import CHORD
from warpflat.pattern.drafting.piece_parts import FOLD_STRAIGHT, MOST_ALLOWANCE, Dart, Edge
from warpflat.pattern.drafting.polygons import half_plane, mirror_image, signed_area

__all__ = ["boundary_edges", "inset", "named_outline", "split_outline", "with_drawn_allowances"]

# Ends that are closer than this are one corner [m].
_SAME = 5e-4
# An outline of more points is made simpler: what lies as near to its curve as a chord may is left out.
_MOST_POINTS = 5000


def named_outline(
    parts: Sequence[tuple[str, str, FloatArray]],
    tips: Mapping[str, FloatArray],
    legs: Sequence[FloatArray],
    cutting: Sequence[FloatArray],
    where: str,
) -> tuple[list[Edge], list[Dart]]:
    """Return the edges and darts of a piece whose file names its edges.

    Args:
        parts: name, kind and points (#P by 2 [m]) of each edge, in any order and direction; legs are of kind "dart".
        tips: by name of the dart [m].
        legs: other lines (#P by 2 [m]): of the legs of pleats as much as is sewn.
        cutting: lines (#P by 2 [m]) from which the allowances are measured.
        where: what messages begin with.

    Raises:
        InputError: the edges do not close, or a leg has no tip.
    """
    chain = [parts[0]]
    # The last end of each line stands before its first: of two that are as near, the line is turned.
    ends = np.array([points[[-1, 0]] for _, _, points in parts])
    ends[0] = np.inf
    while len(chain) < len(parts):
        distances = np.linalg.norm(ends - chain[-1][2][-1], axis=2)
        number, at = divmod(int(distances.argmin()), 2)
        ends[number] = np.inf
        name, kind, points = parts[number]
        if not distances[number, at] <= _SAME:
            raise InputError(
                f"{where}: edge {chain[-1][0]!r} ends {1e3 * distances[number, at]:.1f} mm from the next, {name!r}; "
                "edges must share their corners"
            )
        chain.append((name, kind, points if at == 1 else points[::-1]))
    gap = float(np.linalg.norm(chain[-1][2][-1] - chain[0][2][0]))
    if gap > _SAME:
        raise InputError(f"{where}: the outline is open by {1e3 * gap:.1f} mm; its edges must close")
    # The outline runs counter-clockwise.
    ring = np.concatenate([points[:-1] for _, _, points in chain])
    if signed_area(ring) < 0.0:
        chain = [(name, kind, points[::-1]) for name, kind, points in chain[::-1]]
    joined = [(name, kind, points.copy()) for name, kind, points in chain]
    for before, after in zip(joined, [*joined[1:], joined[0]], strict=True):
        after[2][0] = before[2][-1]
    edges = [Edge(name=name, kind=kind, points=points) for name, kind, points in joined]
    # Two legs that follow each other and meet at a tip are a dart.
    darts = list[Dart]()
    for left, right in zip(edges, [*edges[1:], *edges[:1]], strict=True):
        if left.kind == right.kind == "dart":
            names = [name for name, tip in tips.items() if np.linalg.norm(left.points[-1] - tip) < _SAME]
            if names:
                depth = _sewn_depth(left.points, legs)
                darts.append(Dart(name=names[0], left=left.name, right=right.name, pleat=depth))
    found = {leg for dart in darts for leg in (dart.left, dart.right)}
    for edge in edges:
        if edge.kind == "dart" and edge.name not in found:
            raise InputError(f"{where}: leg {edge.name!r} has no dart; its name must stand at the tip")
    return with_drawn_allowances(edges, cutting) if cutting else edges, darts


def split_outline(ring: FloatArray, corners: FloatArray | None = None, fold: FloatArray | None = None) -> list[Edge]:
    """Split a closed line at its corners into edges "edge_1", "edge_2" ..., counter-clockwise from its lowest corner on the left.

    Args:
        ring: #P by 2 [m], the first point not repeated.
        corners: #C by 2 [m], known ones; else where the line turns by more than 35 degrees.
        fold: 2 by 2 [m], a line of symmetry; where the outline runs along it, with all of it on one side, that edge is on the fold.

    Raises:
        InputError: the line has too many points that are not needed for its curves.
    """
    if np.linalg.norm(ring[0] - ring[-1]) < 1e-7:
        ring = ring[:-1]
    if len(ring) > _MOST_POINTS:
        import shapely

        ring = np.asarray(shapely.LineString(ring).simplify(CHORD, preserve_topology=False).coords)
        if len(ring) > _MOST_POINTS:
            raise InputError(
                f"an outline has {len(ring):,} points that do not lie in its curves, {_MOST_POINTS:,} are the most; smooth it"
            )
    if signed_area(ring) < 0.0:
        ring = ring[::-1]
    if corners is not None and len(corners) > 1:
        places = {int(np.linalg.norm(ring - corner, axis=1).argmin()) for corner in corners}
    else:
        places = find_corners(ring)
    along = None if fold is None else _along_fold(ring, fold)
    if along is not None:
        # What lies between the ends of the fold is no corner.
        inside = {(along[0] + k) % len(ring) for k in range(1, (along[1] - along[0]) % len(ring))}
        places = (places - inside) | set(along)
    if len(places) < 2:
        places |= {int(ring[:, 0].argmin()), int(ring[:, 0].argmax())}
    low = ring.min(axis=0)
    first = min(places, key=lambda k: float(np.abs(ring[k] - low).sum()))
    marks = sorted((k - first) % len(ring) for k in places)
    turned = np.roll(ring, -first, axis=0)
    around = np.concatenate([turned, turned[:1]])
    ends = [*marks[1:], len(ring)]
    on_fold = None if along is None else (along[0] - first) % len(ring)
    return [
        Edge(name=f"edge_{n}", points=around[[a, b]], kind="fold")
        if a == on_fold
        else Edge(name=f"edge_{n}", points=around[a : b + 1], as_drawn=True)
        for n, (a, b) in enumerate(zip(marks, ends, strict=True), 1)
    ]


def _along_fold(ring: FloatArray, fold: FloatArray) -> tuple[int, int] | None:
    """Return the first and the last place of the longest stretch of a closed line (#P by 2 [m]) along a line of symmetry.

    None where the closed line runs nowhere along it, or lies on both sides of it: then it is whole.
    """
    direction = unit(fold[1] - fold[0])
    away, along = (ring - fold[0]) @ np.array([direction[1], -direction[0]]), ring @ direction
    if min(away.max(), -away.min()) > FOLD_STRAIGHT:
        return None
    on = np.abs(away) <= FOLD_STRAIGHT
    starts = np.flatnonzero(on & ~np.roll(on, 1)).tolist()
    stretches = [(start, start + int(np.argmin(np.roll(on, -start))) - 1) for start in starts]
    stretches = [(a, b % len(ring)) for a, b in stretches if b > a]
    return max(stretches, key=lambda ends: abs(float(along[ends[1]] - along[ends[0]])), default=None)


def boundary_edges(
    ring: FloatArray,
    allowance: float | None,
    where: str,
    *,
    fold: FloatArray | None = None,
    corners: FloatArray | None = None,
) -> list[Edge]:
    """Return the edges of a piece of which a file has the cutting line alone: it stays where it is.

    Args:
        ring: the cutting line, #P by 2 [m].
        allowance: from it to the sewing line [m]; None where both are one.
        where: what messages begin with.
        fold, corners: as those of :func:`split_outline`; the corners are those of the cutting line.

    Raises:
        InputError: nothing is left within the allowance, or there are too many points.
    """
    sewing = inset(ring, allowance or 0.0, where, fold)
    return [
        edge if edge.kind == "fold" else replace(edge, allowance=allowance or 0.0)
        for edge in split_outline(sewing, None if allowance else corners, fold)
    ]


def _sewn_depth(leg: FloatArray, lines: Sequence[FloatArray]) -> float | None:
    """Return the length [m] of the line that lies on the beginning of a leg (#P by 2 [m] each); None if none does."""
    import shapely

    whole: Any = shapely.LineString(leg)
    for line in (*lines, *(each[::-1] for each in lines)):
        depth = polyline_length(line)
        if (
            np.linalg.norm(line[0] - leg[0]) < _SAME
            and whole.distance(shapely.Point(line[-1])) < _SAME < whole.length - depth
        ):
            return depth
    return None


def inset(ring: FloatArray, allowance: float, where: str, fold: FloatArray | None = None) -> FloatArray:
    """Return the sewing line of a cutting line (#P by 2 [m]) with one allowance [m] all around, but none along a fold (2 by 2 [m]).

    Raises:
        InputError: nothing is left within it.
    """
    import shapely

    if allowance <= 0.0:
        return ring
    whole: Any = shapely.Polygon(ring)
    stretch = None if fold is None else _along_fold(ring, fold)
    if stretch is not None and fold is not None:
        # The half and its mirror image are drawn in together; half of what is left is that of the piece.
        whole = whole.union(shapely.Polygon(mirror_image(ring, fold))).buffer(FOLD_STRAIGHT, join_style="mitre")
        whole = whole.buffer(-FOLD_STRAIGHT, join_style="mitre")
    inner = whole.buffer(-allowance, join_style="mitre", mitre_limit=5.0)
    if stretch is not None and fold is not None:
        ends = fold if turn_between(fold[1] - fold[0], ring.mean(axis=0) - fold[0]) > 0.0 else fold[::-1]
        inner = inner.intersection(half_plane(ends[0], ends[1], FARTHEST))
    if inner.is_empty or inner.geom_type != "Polygon":
        raise InputError(f"{where}: is too narrow for an allowance of {1e3 * allowance:g} mm")
    return np.asarray(inner.exterior.coords)[:-1]


def with_drawn_allowances(edges: Sequence[Edge], cutting: Sequence[FloatArray]) -> list[Edge]:
    """Return edges with the allowances that a file draws: the distances [m] of its cutting lines (#P by 2 [m] each), to .1 mm."""
    import shapely

    drawn = shapely.union_all([shapely.LineString(line) for line in cutting if len(line) > 1])
    found = []
    for edge in edges:
        points = shapely.line_interpolate_point(
            shapely.LineString(edge.points), np.linspace(0.05, 0.95, 19), normalized=True
        )
        wide = round(float(np.median(shapely.distance(points, drawn))), 4) if cutting else 0.0
        found.append(edge if edge.kind in ("fold", "dart") or wide > MOST_ALLOWANCE else replace(edge, allowance=wide))
    return found
