"""Polygons in the plane: Boolean operations snapped to a grid, mirror images, and the vectors that they need."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray

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
    "parallelogram",
    "polygons_only",
    "reflect",
    "rotate",
    "union",
    "unit_vector",
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
    from shapely.affinity import affine_transform

    x, y = float(direction[0]), float(direction[1])
    matrix = np.array([[2 * x * x - 1, 2 * x * y], [2 * x * y, 2 * y * y - 1]])
    shift = point - matrix @ point
    return shapely.set_precision(affine_transform(area, [*matrix.reshape(-1).tolist(), *shift.tolist()]), GRID)


def half_plane(start: FloatArray, end: FloatArray, body: Polygon) -> Polygon:
    """Return the side of a fold on which the piece lies, large enough for the piece and its allowances."""
    import shapely

    direction = unit_vector(end - start)
    inwards = np.array([-direction[1], direction[0]])
    x0, y0, x1, y1 = body.bounds
    size = 2 * (x1 - x0 + y1 - y0) + 2.0
    a, b = start - size * direction, start + size * direction
    return shapely.Polygon([a, b, b + size * inwards, a + size * inwards])


def angle_between(a: FloatArray, b: FloatArray) -> float:
    """Return the angle [rad] between two unit vectors."""
    return float(np.arccos(np.clip(a @ b, -1.0, 1.0)))


def rotate(vector: FloatArray, angle: float) -> FloatArray:
    """Rotate a vector counter-clockwise by `angle` [rad]."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([cosine * vector[0] - sine * vector[1], sine * vector[0] + cosine * vector[1]])


def unit_vector(vector: FloatArray) -> FloatArray:
    """Return the vector at length 1; (1, 0) stands for one without length."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-12 else np.array([1.0, 0.0])
