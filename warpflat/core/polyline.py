"""Polylines: their lengths, points along them, angles, and the points on them nearest to others.

A polyline is an array of points, #P by 2 or 3. A closed one runs on from its last point to its first, which is not repeated.
Lengths are in the unit of the points: metres everywhere but on a picture's page.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import FloatArray

__all__ = [
    "arc_lengths",
    "nearest_on_polyline",
    "off_line",
    "part_between",
    "points_at_lengths",
    "polyline_length",
    "project_on_segments",
    "resample",
    "segment_lengths",
    "turning_angles",
]


def segment_lengths(points: FloatArray, *, closed: bool = False) -> FloatArray:
    """#P - 1 (#P if closed), the length of each segment of a polyline."""
    around = _around(points, closed)
    step = around[1:] - around[:-1]
    # Thousands of short lines: `np.linalg.norm` and `np.diff` take longer to check their arguments than to do this.
    return np.asarray(np.sqrt((step * step).sum(axis=1)))


def polyline_length(points: FloatArray, *, closed: bool = False) -> float:
    """Return the length of a polyline, the last of its arc lengths bit for bit."""
    return float(arc_lengths(points, closed=closed)[-1])


def arc_lengths(points: FloatArray, *, closed: bool = False) -> FloatArray:
    """#P, the length along a polyline from its first point to each of its points; the whole length at the end if closed."""
    segments = segment_lengths(points, closed=closed)
    arc = np.zeros(len(segments) + 1)
    segments.cumsum(out=arc[1:])
    return arc


def points_at_lengths(points: FloatArray, lengths: ArrayLike) -> FloatArray:
    """The points of an open polyline at lengths along it.

    Args:
        points: #P by 2 or 3.
        lengths: #L, or one length; those beyond an end count as that end.

    Returns:
        #L by 2 or 3, or one point.
    """
    arc, at = arc_lengths(points), np.asarray(lengths, dtype=np.float64)
    return np.stack([np.interp(at, arc, column) for column in points.T], axis=-1)


def part_between(points: FloatArray, begin: float, end: float) -> FloatArray:
    """The part of an open polyline (#P by 2 or 3) between two lengths along it; its ends lie on the polyline's where they are those."""
    arc = arc_lengths(points)
    ends = points_at_lengths(points, [max(begin, 0.0), min(end, float(arc[-1]))])
    # Points beside an end would make segments without a direction.
    return np.vstack([ends[:1], points[(arc > begin + 1e-6) & (arc < end - 1e-6)], ends[1:]])


def resample(points: FloatArray, shares: ArrayLike, *, closed: bool = False) -> FloatArray:
    """The points of a polyline at shares of its length.

    Args:
        points: #P by 2 or 3.
        shares: #S, or one share: 0 is the first point and 1 the last (the first again if closed). Shares beyond them count
            as the nearer end, or run on around a closed polyline.
        closed: whether the last point runs on to the first.

    Returns:
        #S by 2 or 3, or one point.
    """
    around, share = _around(points, closed), np.asarray(shares, dtype=np.float64)
    length = arc_lengths(around)[-1]
    if length <= 0.0:
        return np.broadcast_to(points[0], (*share.shape, points.shape[1])).copy()
    return points_at_lengths(around, (share % 1.0 if closed else np.clip(share, 0.0, 1.0)) * length)


def turning_angles(points: FloatArray) -> FloatArray:
    """#P - 2, the signed angle [rad] by which an open polyline (#P by 2) turns at each inner point, to the left positive."""
    step = np.diff(points, axis=0)
    cross = step[:-1, 0] * step[1:, 1] - step[:-1, 1] * step[1:, 0]
    return np.arctan2(cross, np.einsum("ij,ij->i", step[:-1], step[1:]))


def project_on_segments(targets: FloatArray, starts: FloatArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The points of straight segments that are nearest to targets.

    Args:
        targets, starts, ends: ... by 2 or 3, of shapes that broadcast to each other.

    Returns:
        Shares of each segment from 0 to 1 at which its nearest point lies, and the distance from there to the target. A segment
        of no length has the share 0.
    """
    along = ends - starts
    squared = np.einsum("...j,...j->...", along, along)
    share = np.einsum("...j,...j->...", targets - starts, along) / np.where(squared > 0.0, squared, 1.0)
    share = np.clip(share, 0.0, 1.0)
    return share, np.linalg.norm(starts + share[..., None] * along - targets, axis=-1)


def nearest_on_polyline(target: FloatArray, points: FloatArray) -> FloatArray:
    """The point of an open polyline that is nearest to a target (2 or 3 coordinates)."""
    if len(points) == 1:
        return points[0]
    share, distance = project_on_segments(target, points[:-1], points[1:])
    nearest = int(np.argmin(distance))
    return np.asarray(points[nearest] + share[nearest] * (points[nearest + 1] - points[nearest]))


def off_line(points: FloatArray, line: FloatArray) -> FloatArray:
    """Return #P, the distances of points (#P by 2) from a straight line (2 by 2) that goes on both ways."""
    (x, y), away = line[1] - line[0], points - line[0]
    return np.asarray(np.abs(away[:, 0] * y - away[:, 1] * x) / np.hypot(x, y))


def _around(points: FloatArray, closed: bool) -> FloatArray:
    return np.concatenate([points, points[:1]]) if closed else points
