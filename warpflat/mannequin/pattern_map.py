"""The map between a piece on the body and its pattern, for points and for polylines."""

from __future__ import annotations

import itertools

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.mannequin.closest import Closest

__all__ = ["PatternMap"]


class PatternMap:
    """Maps points between a piece on the body and its pattern; both have the same faces.

    Quads count as two triangles, split alike on both sides, so a point mapped there and back returns to its place.

    Args:
        positions: #V by 3, the piece on the body [m]. Where a cut doubled a pattern vertex, its place is given twice.
        pattern: #V by 2, the piece in the plane [m].
        faces: #F by 4 (-1 in the last column for a triangle), for both.

    Raises:
        InputError: if the arrays do not fit together.
    """

    def __init__(self, positions: FloatArray, pattern: FloatArray, faces: IntArray) -> None:
        positions, pattern, faces = np.asarray(positions, float), np.asarray(pattern, float), np.asarray(faces)
        if len(positions) != len(pattern) or positions.shape[1:] != (3,) or pattern.shape[1:] != (2,):
            raise InputError(
                f"pattern map: body {positions.shape} and pattern {pattern.shape}; #V by 3 and #V by 2 are needed"
            )
        if len(faces) == 0 or faces.shape[1:] != (4,) or faces.max() >= len(positions):
            raise InputError(
                f"pattern map: faces {faces.shape} do not fit {len(positions)} vertices; #F by 4 are needed"
            )
        quads = faces[:, 3] >= 0
        self._triangles = np.concatenate([faces[:, :3], faces[quads][:, [0, 2, 3]]]).astype(np.int64)
        self._positions, self._pattern = positions, pattern
        self._on_body, self._on_pattern = Closest(positions, self._triangles), Closest(pattern, self._triangles)
        edges = np.concatenate([self._triangles[:, [0, 1]], self._triangles[:, [1, 2]], self._triangles[:, [2, 0]]])
        self._edges = np.unique(np.sort(edges, axis=1), axis=0)
        self._step = 0.25 * float(np.linalg.norm(np.diff(positions[self._edges], axis=1), axis=2).mean())

    def to_body(self, points: FloatArray, *, tolerance: float = 0.001) -> FloatArray:
        """Map points of the pattern to the body.

        Args:
            points: #P by 2 [m].
            tolerance: how far [m] outside the pattern a point may lie; it is then taken at the border.

        Returns:
            #P by 3 [m].

        Raises:
            InputError: if a point lies further outside.
        """
        return self._mapped(self._on_pattern, self._positions, points, tolerance, "pattern")

    def to_pattern(self, points: FloatArray, *, tolerance: float = 0.005) -> FloatArray:
        """Map points on the body to the pattern.

        Args:
            points: #P by 3 [m].
            tolerance: how far [m] off the piece a point may lie; its nearest place on the piece is taken.

        Returns:
            #P by 2 [m].

        Raises:
            InputError: if a point lies further off.
        """
        return self._mapped(self._on_body, self._pattern, points, tolerance, "body")

    def polyline_to_body(self, points: FloatArray, *, tolerance: float = 0.001) -> FloatArray:
        """Map a polyline on the pattern to the body, bent wherever it crosses a mesh edge, so that it lies on the piece.

        Args:
            points: #P by 2 [m].
            tolerance: as in :meth:`to_body`.

        Returns:
            #Q by 3 [m]; the given points are among them, in order.

        Raises:
            InputError: if it leaves the pattern.
        """
        # A polyline in the pattern with a point added wherever it crosses an edge.
        points = _checked(points, 2)
        a, b = self._pattern[self._edges[:, 0]], self._pattern[self._edges[:, 1]]
        along = b - a
        parts: list[FloatArray] = []
        for p, q in itertools.pairwise(points):
            d = q - p
            bottom = d[0] * along[:, 1] - d[1] * along[:, 0]
            safe = np.abs(bottom) > 1e-15
            inverse = np.where(safe, 1.0 / np.where(safe, bottom, 1.0), 0.0)
            t = ((a[:, 0] - p[0]) * along[:, 1] - (a[:, 1] - p[1]) * along[:, 0]) * inverse
            u = ((a[:, 0] - p[0]) * d[1] - (a[:, 1] - p[1]) * d[0]) * inverse
            hit = safe & (t > 1e-9) & (t < 1 - 1e-9) & (u >= -1e-9) & (u <= 1 + 1e-9)
            at = np.unique(np.round(np.concatenate([[0.0], t[hit]]), 9))[:, None]
            parts.append(p + at * d)
        return self.to_body(np.concatenate([*parts, points[-1:]]), tolerance=tolerance)

    def polyline_to_pattern(self, points: FloatArray, *, tolerance: float = 0.005) -> FloatArray:
        """Map a polyline on the body to the pattern, in steps of a quarter of an edge.

        Args:
            points: #P by 3 [m].
            tolerance: as in :meth:`to_pattern`; what lies between two points may sink into a curved body as far as its
                chords do.

        Returns:
            #Q by 2 [m].

        Raises:
            InputError: if a given point is off the piece.
        """
        points = _checked(points, 3)
        self.to_pattern(points, tolerance=tolerance)
        parts = []
        for a, b in itertools.pairwise(points):
            count = max(1, int(np.ceil(np.linalg.norm(b - a) / max(self._step, 1e-9))))
            t = np.arange(count)[:, None] / count
            parts.append((1 - t) * a + t * b)
        return self.to_pattern(np.concatenate([*parts, points[-1:]]), tolerance=np.inf)

    def _mapped(
        self, source: Closest, target: FloatArray, points: FloatArray, tolerance: float, where: str
    ) -> FloatArray:
        points = _checked(points, source.corners.shape[2])
        triangle, weights, distance = source(points)
        far = np.flatnonzero(distance > tolerance)
        if len(far):
            at = ", ".join(f"{v:.3f}" for v in points[far[0]])
            raise InputError(
                f"pattern map: point {int(far[0])} ({at}) lies {distance[far[0]] * 1000:.1f} mm off the {where}; "
                f"at most {tolerance * 1000:g} mm is allowed"
            )
        return np.asarray(np.einsum("nk,nkd->nd", weights, target[self._triangles[triangle]]))


def _checked(points: FloatArray, width: int) -> FloatArray:
    points = np.asarray(points, float)
    if points.ndim != 2 or points.shape[1] != width or len(points) == 0 or not np.isfinite(points).all():
        raise InputError(f"pattern map: points {points.shape}; #P by {width} finite numbers are needed")
    return points
