"""Outlines of patterns that come from files: their edges put in order, or found between corners."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.pattern.corners import find_corners
from warpflat.pattern.from_mesh import CORNER
from warpflat.pattern.piece_parts import Dart, Edge

__all__ = ["chain_edges", "find_darts", "inset", "split_outline"]

# Ends that are closer than this are one corner [m].
_SAME = 5e-4
# An outline of more points is made simpler: what lies within this [m] of its curve is left out.
_MOST_POINTS, _FLAT = 5000, 2e-5


def chain_edges(parts: Sequence[tuple[str, str, FloatArray]], where: str) -> list[Edge]:
    """Return open lines as the edges of one closed outline, counter-clockwise.

    Args:
        parts: name, kind and points (#P by 2 [m]) of each, in any order and direction.
        where: what messages begin with.

    Raises:
        InputError: they do not close.
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
    ring = np.concatenate([points[:-1] for _, _, points in chain])
    if _area(ring) < 0.0:
        chain = [(name, kind, points[::-1]) for name, kind, points in chain[::-1]]
    joined = [(name, kind, points.copy()) for name, kind, points in chain]
    for before, after in zip(joined, [*joined[1:], joined[0]], strict=True):
        after[2][0] = before[2][-1]
    return [Edge(name=name, kind=kind, points=points) for name, kind, points in joined]


def split_outline(ring: FloatArray, corners: FloatArray | None = None) -> list[Edge]:
    """Split a closed line at its corners into edges "edge_1", "edge_2" ..., counter-clockwise from its lowest corner on the left.

    Args:
        ring: #P by 2 [m], the first point not repeated.
        corners: #C by 2 [m], known ones; else where the line turns by more than 35 degrees.

    Raises:
        InputError: the line has too many points that are not needed for its curves.
    """
    if np.linalg.norm(ring[0] - ring[-1]) < 1e-7:
        ring = ring[:-1]
    if len(ring) > _MOST_POINTS:
        import shapely

        ring = np.asarray(shapely.LineString(ring).simplify(_FLAT, preserve_topology=False).coords)
        if len(ring) > _MOST_POINTS:
            raise InputError(
                f"an outline has {len(ring):,} points that do not lie in its curves, {_MOST_POINTS:,} are the most; smooth it"
            )
    if _area(ring) < 0.0:
        ring = ring[::-1]
    if corners is not None and len(corners) > 1:
        places = {int(np.linalg.norm(ring - corner, axis=1).argmin()) for corner in corners}
    else:
        places = find_corners(ring, CORNER)
    if len(places) < 2:
        places |= {int(ring[:, 0].argmin()), int(ring[:, 0].argmax())}
    low = ring.min(axis=0)
    first = min(places, key=lambda k: float(np.abs(ring[k] - low).sum()))
    marks = sorted((k - first) % len(ring) for k in places)
    turned = np.roll(ring, -first, axis=0)
    around = np.concatenate([turned, turned[:1]])
    ends = [*marks[1:], len(ring)]
    return [
        Edge(name=f"edge_{n}", points=around[a : b + 1]) for n, (a, b) in enumerate(zip(marks, ends, strict=True), 1)
    ]


def find_darts(edges: Sequence[Edge], tips: Mapping[str, FloatArray], where: str) -> list[Dart]:
    """Return the darts whose tips are known: two legs that follow each other and meet there.

    Args:
        edges: of an outline; legs are of kind "dart".
        tips: by name of the dart [m].
        where: what messages begin with.

    Raises:
        InputError: legs without a tip.
    """
    darts = []
    for left, right in zip(edges, [*edges[1:], *edges[:1]], strict=True):
        if left.kind == right.kind == "dart":
            names = [name for name, tip in tips.items() if np.linalg.norm(left.points[-1] - tip) < _SAME]
            if names:
                darts.append(Dart(name=names[0], left=left.name, right=right.name))
    legs = {leg for dart in darts for leg in (dart.left, dart.right)}
    for edge in edges:
        if edge.kind == "dart" and edge.name not in legs:
            raise InputError(f"{where}: leg {edge.name!r} has no dart; its name must stand at the tip")
    return darts


def inset(ring: FloatArray, allowance: float, where: str) -> FloatArray:
    """Return the sewing line of a cutting line (#P by 2 [m]) with one allowance [m] all around.

    Raises:
        InputError: nothing is left within it.
    """
    import shapely

    if allowance <= 0.0:
        return ring
    inner = shapely.Polygon(ring).buffer(-allowance, join_style="mitre", mitre_limit=5.0)
    if inner.is_empty or inner.geom_type != "Polygon":
        raise InputError(f"{where}: is too narrow for an allowance of {1e3 * allowance:g} mm")
    return np.asarray(inner.exterior.coords)[:-1]


def _area(ring: FloatArray) -> float:
    x, y = ring.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
