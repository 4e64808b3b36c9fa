"""Paths on a surface that need not follow its edges: geodesics and polylines of geodesics.

A path is a row of points, each at a vertex, on an edge or inside a triangle, two neighbours always in one triangle.
Quads are taken as two triangles (:func:`path_triangles`). :func:`warpflat.flat.surface.cut.split_faces.split_faces_along` turns a path
into mesh edges, so that a cut along it is straight on the surface and not a staircase.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length, project_on_segments
from warpflat.core.sorting import counting_sort
from warpflat.flat.surface.closest import nearest_on_triangles
from warpflat.flat.surface.connectivity import join_labels
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.triangles import triangulate

__all__ = [
    "Place",
    "SurfacePath",
    "VertexStar",
    "describe_place",
    "geodesic_path",
    "locate",
    "make_path",
    "path_triangles",
    "polyline_path",
    "simplify_places",
]

Place: TypeAlias = dict[int, float]
"""A point of a surface: its weights by vertex, one vertex, the two of an edge or the three of a triangle; sum 1."""

_AT_CORNER = 1e-7
"""Barycentric coordinate below which a point counts as lying on the edge or vertex itself: rounding, not snapping."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfacePath:
    """A polyline on a surface.

    Attributes:
        support: #N by 3, the vertices a point lies between: one at a vertex, two on an edge, three inside a triangle;
            the rest is -1.
        weights: #N by 3, their weights, positive, summing to 1; 0 where `support` is -1.
        points: #N by 3, positions [m].
        closed: true where the last point is joined to the first; the first is not repeated.
    """

    support: IntArray
    weights: FloatArray
    points: FloatArray
    closed: bool = False

    @property
    def length(self) -> float:
        """Length [m]."""
        return polyline_length(self.points, closed=self.closed)

    def place(self, index: int) -> Place:
        """Return the place of a point, as its weights by vertex."""
        support, weights = self.support[index].tolist(), self.weights[index].tolist()
        return {v: w for v, w in zip(support, weights, strict=True) if v >= 0 and w > 0}


def path_triangles(surface: Surface) -> tuple[IntArray, IntArray]:
    """Return the triangles that paths run over: #T by 3 vertices, and #T, the face of each.

    A quad is split along its corners 0-2, or along 1-3 where only that diagonal lies inside it, or no other edge has its ends.
    """
    corner = surface.vertices[surface.faces]

    def folds(a: int, b: int, c: int, d: int) -> BoolArray:
        one = np.cross(corner[:, b] - corner[:, a], corner[:, c] - corner[:, a])
        two = np.cross(corner[:, c] - corner[:, a], corner[:, d] - corner[:, a])
        return np.einsum("ij,ij->i", one, two) < 0

    inside = folds(0, 1, 2, 3) & ~folds(1, 2, 3, 0)
    return triangulate(surface.faces, other_diagonal=inside, distinct=True)


def make_path(surface: Surface, places: Sequence[Place], *, closed: bool = False) -> SurfacePath:
    """Make a path from its places, in order, of which each two neighbours lie in one triangle."""
    support = np.full((len(places), 3), -1, dtype=np.int32)
    weights = np.zeros((len(places), 3))
    for row, place in enumerate(places):
        support[row, : len(place)] = list(place)
        weights[row, : len(place)] = list(place.values())
    points = np.einsum("nk,nkd->nd", weights, surface.vertices[support])
    return SurfacePath(support=support, weights=weights, points=points, closed=closed)


def _tidy(corners: Sequence[int], weights: ArrayLike) -> Place:
    """Make a place from weights without their rounding noise, so that a point at a vertex is exactly there."""
    w = np.clip(np.asarray(weights, dtype=float), 0.0, None)
    w[w < _AT_CORNER * w.sum()] = 0.0
    w /= w.sum()
    return {int(v): float(x) for v, x in zip(corners, w, strict=True) if x > 0}


def locate(surface: Surface, point: ArrayLike | int) -> Place:
    """Return the place on the surface nearest to a point.

    Args:
        surface: the surface.
        point: a position [m], or a vertex index, which stands for itself.

    Raises:
        InputError: for a vertex that does not exist, or a point that is not three finite numbers.
    """
    if isinstance(point, (int, np.integer)):
        if not 0 <= point < len(surface.vertices):
            raise InputError(f"vertex {int(point)} does not exist; valid: 0 to {len(surface.vertices) - 1}")
        return {int(point): 1.0}
    target = np.asarray(point, dtype=float)
    if target.shape != (3,) or not np.isfinite(target).all():
        raise InputError(f"a point on the surface is a vertex index or three finite numbers [m], got {point!r}")
    triangles, _ = path_triangles(surface)
    corners = surface.vertices[triangles]
    # Only triangles whose bounding box comes as near as the nearest vertex can hold the nearest point.
    reach = np.linalg.norm(surface.vertices[np.unique(triangles)] - target, axis=1).min()
    outside = np.maximum(np.maximum(corners.min(axis=1) - target, target - corners.max(axis=1)), 0.0)
    near = np.flatnonzero(np.linalg.norm(outside, axis=1) <= reach * (1 + 1e-9))
    shares = nearest_on_triangles(corners[near], np.broadcast_to(target, (len(near), 3)))
    nearest = np.einsum("tk,tkj->tj", shares, corners[near])
    distance = np.linalg.norm(nearest - target, axis=1)
    # Several triangles share a point on an edge: the largest gives the best-conditioned coordinates.
    normal = np.cross(corners[near, 1] - corners[near, 0], corners[near, 2] - corners[near, 0])
    twice_area = np.linalg.norm(normal, axis=1)
    tie = distance <= distance.min() + 1e-12 * (1 + reach)
    best = int(np.argmax(np.where(tie, twice_area, -1.0)))
    a, b, c = corners[near[best]]
    x = nearest[best]
    if twice_area[best] <= 0:
        closest_corner = int(np.argmin(np.linalg.norm(corners[near[best]] - x, axis=1)))
        return {int(triangles[near[best], closest_corner]): 1.0}
    n = normal[best]
    weights = [np.dot(np.cross(c - b, x - b), n), np.dot(np.cross(a - c, x - c), n), np.dot(np.cross(b - a, x - a), n)]
    return _tidy(triangles[near[best]].tolist(), weights)


def geodesic_path(surface: Surface, a: ArrayLike | int, b: ArrayLike | int) -> SurfacePath:
    """Return the straightest path on the surface between two points.

    The shortest path along edges is shortened by edge flips until it is straight (Sharp and Crane 2020, "You can find
    geodesic paths in triangle meshes by just flipping edges"). It is a geodesic, and the shortest one unless a bump as
    large as the path itself lies beside it.

    Args:
        surface: the surface.
        a, b: vertex indices, or positions [m] of which the nearest points on the surface are taken.

    Raises:
        InputError: if both ends are one point, or lie on parts of the surface that are not connected.
    """
    import potpourri3d

    ends = [locate(surface, a), locate(surface, b)]
    if ends[0] == ends[1]:
        raise InputError(f"a path needs two different end points; both are at {describe_place(ends[0])}")
    triangles, _ = path_triangles(surface)
    if VertexStar(triangles).sharing([*ends[0], *ends[1]]):
        return make_path(surface, ends)
    size = len(surface.vertices)
    row, column = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    part = join_labels(size, row, column)
    if part[next(iter(ends[0]))] != part[next(iter(ends[1]))]:
        raise InputError(
            f"no path from {describe_place(ends[0])} to {describe_place(ends[1])}: they lie on separate parts of the "
            "surface"
        )

    # The solver goes from vertex to vertex: points inside a face or edge become vertices of a working copy first.
    inserted: dict[int, Place] = {}
    stops = []
    for end in ends:
        stop = next(iter(end))
        if len(end) > 1:
            stop = size + len(inserted)
            inserted[stop] = end
            # A vertex inside a triangle or on an edge divides the triangles at its place.
            hit = np.isin(triangles, list(end)).sum(axis=1) == len(end)
            parts = []
            for corner in range(3):
                # A part for each corner that the point has a share in: that corner gives way to the new vertex.
                shares = hit & np.isin(triangles[:, corner], list(end))
                piece = triangles[shares]
                piece[:, corner] = stop
                parts.append(piece)
            triangles = np.concatenate([triangles[~hit], *parts])
        stops.append(stop)
    extra = [sum(w * surface.vertices[v] for v, w in place.items()) for place in inserted.values()]
    positions = np.concatenate([surface.vertices, np.reshape(extra, (-1, 3))])
    part = np.concatenate([part, [part[next(iter(place))] for place in inserted.values()]]).astype(np.int64)
    keep = part == part[stops[0]]
    number = np.cumsum(keep) - 1
    try:
        solver = potpourri3d.EdgeFlipGeodesicSolver(positions[keep], number[triangles[keep[triangles[:, 0]]]])
        drawn = solver.find_geodesic_path(int(number[stops[0]]), int(number[stops[1]]))
    except RuntimeError:  # of the library: the triangles are no manifold
        raise InputError(
            f"no straight path can be drawn from {describe_place(ends[0])} to {describe_place(ends[1])}: faces of the part meet in more "
            "than an edge; give triangles there"
        ) from None
    # The vertex or edge on which each point of the path lies is found from triangle to triangle.
    star = VertexStar(triangles)
    walked: list[Place] = [{stops[0]: 1.0}]
    for target in np.asarray(drawn)[1:-1]:
        around = star.triangles[star.sharing(list(walked[-1]))]
        edges = np.concatenate([around[:, [0, 1]], around[:, [1, 2]], around[:, [2, 0]]])
        tails, heads = positions[edges[:, 0]], positions[edges[:, 1]]
        share, distance = project_on_segments(target, tails, heads)
        best = int(np.argmin(distance))
        if distance[best] > 1e-6 * float(np.linalg.norm(heads - tails, axis=1).max()):
            raise InputError(f"no straight path found near {describe_place(walked[-1])}: repair the triangles there")
        walked.append(_tidy(edges[best].tolist(), [1.0 - share[best], share[best]]))
    if not star.sharing([*walked[-1], stops[1]]):
        raise InputError(
            f"the path ends at {describe_place(walked[-1])}, short of its goal: repair the triangles there"
        )
    walked.append({stops[1]: 1.0})
    places = []
    for place in walked:
        # Inserted vertices are places between old ones.
        old: Place = {}
        for vertex, weight in place.items():
            for v, w in inserted.get(vertex, {vertex: 1.0}).items():
                old[v] = old.get(v, 0.0) + weight * w
        places.append(_tidy(list(old), list(old.values())))
    return make_path(surface, simplify_places(places))


def polyline_path(surface: Surface, points: Sequence[ArrayLike | int], *, closed: bool = False) -> SurfacePath:
    """Join geodesics from each point to the next to one path.

    Args:
        surface: the surface.
        points: at least two vertex indices or positions [m].
        closed: whether to return from the last point to the first (then at least three points).

    Raises:
        InputError: as :func:`geodesic_path`, or for too few points.
    """
    need = 3 if closed else 2
    if len(points) < need:
        raise InputError(f"a {'closed ' if closed else ''}polyline needs at least {need} points, got {len(points)}")
    stops = [*points, points[0]] if closed else list(points)
    legs = [geodesic_path(surface, a, b) for a, b in pairwise(stops)]
    # The end of a leg is the start of the next; the last one's stays unless it closes the path.
    ends = [len(leg.points) - 1 for leg in legs]
    ends[-1] += not closed
    return SurfacePath(
        support=np.concatenate([leg.support[:end] for leg, end in zip(legs, ends, strict=True)]),
        weights=np.concatenate([leg.weights[:end] for leg, end in zip(legs, ends, strict=True)]),
        points=np.concatenate([leg.points[:end] for leg, end in zip(legs, ends, strict=True)]),
        closed=closed,
    )


def simplify_places(places: Sequence[Place]) -> list[Place]:
    """Drop places that a straight path does not need: repetitions, points inside a triangle, points between two of one edge.

    The ends stay.
    """
    kept: list[Place] = []
    for index, place in enumerate(places):
        inner = 0 < index < len(places) - 1
        before = kept[-1] if kept else {}
        same = before.keys() == place.keys() and all(abs(before[v] - place[v]) < _AT_CORNER for v in place)
        if (inner and len(place) == 3) or same:
            continue
        if len(kept) > 1 and len(kept[-2].keys() | kept[-1].keys() | place.keys()) <= 2:
            kept.pop()
        kept.append(place)
    return kept


class VertexStar:
    """The triangles around each vertex, for walking from one to the next."""

    def __init__(self, triangles: IntArray) -> None:
        self.triangles = triangles
        order, self._start = counting_sort(triangles.ravel(), int(triangles.max(initial=-1)) + 1)
        self._order = order // 3

    def around(self, vertex: int) -> IntArray:
        """Return the triangles at a vertex, sorted; none for a vertex in no triangle."""
        if vertex + 1 >= len(self._start):
            return np.empty(0, dtype=np.int32)
        return self._order[self._start[vertex] : self._start[vertex + 1]]

    def sharing(self, vertices: Sequence[int]) -> list[int]:
        """Return the triangles that have all these vertices."""
        first, *rest = dict.fromkeys(vertices)
        found = self.around(first)
        for vertex in rest:
            found = found[(self.triangles[found] == vertex).any(axis=1)]
        return [int(t) for t in found]


def describe_place(place: Place) -> str:
    """Describe a place in words for messages."""
    named = ", ".join(str(v) for v in sorted(place))
    return f"vertex {named}" if len(place) == 1 else f"a point between vertices {named}"
