"""Polygons in the plane: Boolean operations snapped to a grid, mirror images and half planes, and the vectors that they need."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, reflected, unit

if TYPE_CHECKING:
    from shapely import Geometry, Polygon

__all__ = [
    "GRID",
    "LOST",
    "angle_between",
    "close_slits",
    "cut_off",
    "difference",
    "half_plane",
    "intersection",
    "mapped",
    "mirror_image",
    "normal_towards",
    "outer_ring",
    "parallelogram",
    "polygons_only",
    "reflect",
    "rotation",
    "signed_area",
    "union",
    "upright",
]


#: Precision [m] to which polygons are snapped, far below what any cutter resolves.
GRID = 1e-7
#: Slits and spikes narrower than twice this [m] come from rounding.
CLOSE = 2e-6
#: Closing them changes the area by less than this [m2].
LOST = 1e-5


def union(parts: Sequence[Geometry]) -> Geometry:
    """Return the union of polygons on the grid, which closes slivers of rounding between touching parts."""
    import shapely

    return polygons_only(shapely.union_all(shapely.set_precision(np.array(parts, dtype=object), GRID), grid_size=GRID))


def difference(area: Geometry, other: Geometry) -> Geometry:
    """Return `area` without `other`."""
    return polygons_only(area.difference(other, grid_size=GRID))


def intersection(area: Geometry, other: Geometry) -> Geometry:
    """Return what `area` and `other` have in common."""
    return polygons_only(area.intersection(other, grid_size=GRID))


def polygons_only(geometry: Geometry) -> Geometry:
    """Drop the points and lines in which polygons may touch."""
    import shapely

    if geometry.geom_type in ("Polygon", "MultiPolygon"):
        return geometry
    return shapely.MultiPolygon([p for p in shapely.get_parts(geometry) if p.geom_type == "Polygon"])


def close_slits(area: Geometry) -> Geometry:
    """Close the slits and spikes that rounding leaves where parts meet along a slanted line."""
    # With long mitres GEOS sometimes loses a whole polygon: a result counts only if its area is the same.
    for limit in (200.0, 20.0, 5.0):
        closed = area
        for distance in (CLOSE, -2 * CLOSE, CLOSE):
            closed = closed.buffer(distance, join_style="mitre", mitre_limit=limit)
        if abs(closed.area - area.area) < LOST:
            return closed
    return area


def cut_off(area: Geometry, point: FloatArray, direction: FloatArray, side: FloatArray, radius: float) -> Geometry:
    """Cut off what lies on one side of a line.

    Args:
        area: what is cut.
        point, direction: the line, by a point and a unit vector.
        side: unit vector to the side that is cut off.
        radius: distance [m] from `point` beyond which nothing is cut off.
    """
    return difference(area, parallelogram(point, direction, (-radius, radius), side, (0, radius)))


def parallelogram(
    point: FloatArray, along: FloatArray, reach: tuple[float, float], side: FloatArray, depth: tuple[float, float]
) -> Polygon:
    """Return a parallelogram from `point`, over `reach` [m] along one unit vector and `depth` [m] along another."""
    import shapely

    corners = [(reach[0], depth[0]), (reach[1], depth[0]), (reach[1], depth[1]), (reach[0], depth[1])]
    return shapely.Polygon([point + a * along + d * side for a, d in corners])


def reflect(area: Geometry, point: FloatArray, direction: FloatArray) -> Geometry:
    """Mirror an area on the line through `point` along the unit vector `direction`."""
    import shapely

    line = np.stack([point, point + direction])
    return shapely.set_precision(shapely.transform(area, lambda points: mirror_image(points, line)), GRID)


def mirror_image(points: FloatArray, line: FloatArray) -> FloatArray:
    """Return points (#P by 2 [m]) mirrored at the straight line from the first to the last point of a line (#L by 2 [m])."""
    x, y = unit(line[-1] - line[0])
    normal = np.array([-y, x])
    return reflected(points, normal, float(normal @ line[0]))


def mapped(points: FloatArray, matrix: FloatArray) -> FloatArray:
    """Return points (... by 2) under a 2 by 3 matrix: turned by its first two columns and shifted by the last."""
    return np.asarray(points @ matrix[:, :2].T + matrix[:, 2])


def half_plane(start: FloatArray, end: FloatArray, reach: float) -> Polygon:
    """Return the half of the plane to the left of the line from one point to another, as far as `reach` [m]."""
    direction = unit(end - start)
    left = np.array([-direction[1], direction[0]])
    return parallelogram(start, direction, (-reach, reach), left, (0.0, reach))


def outer_ring(area: Geometry) -> FloatArray:
    """Return the outer ring of the largest part of an area, counter-clockwise, #P by 2 [m]; the first point is not repeated."""
    import shapely

    largest = max(shapely.get_parts(area), key=lambda part: part.area)
    return np.asarray(shapely.orient_polygons(shapely.Polygon(largest.exterior)).exterior.coords)[:-1]


def signed_area(ring: FloatArray) -> float:
    """Return the area [m2] of a closed line (#P by 2 [m], the first point not repeated), negative where it runs clockwise."""
    x, y = ring.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def normal_towards(direction: FloatArray, other: FloatArray) -> FloatArray:
    """Return the normal of a vector, as long as it, on the side to which another one points."""
    left = np.array([-direction[1], direction[0]])
    return left if left @ other > 0 else -left


def angle_between(a: FloatArray, b: FloatArray) -> float:
    """Return the angle [rad] between two unit vectors."""
    return float(np.arccos(np.clip(a @ b, -1.0, 1.0)))


def rotation(angle: float) -> FloatArray:
    """Return the 2 by 2 matrix of a turn by an angle [rad], counter-clockwise."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine], [sine, cosine]])


def upright(direction: FloatArray) -> FloatArray:
    """Return the 2 by 2 matrix that turns a direction upwards."""
    x, y = unit(direction)
    return np.array([[y, -x], [x, y]])
