"""The nearest place on a triangle mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray

__all__ = ["Closest"]


class Closest:
    """Nearest places on a triangle mesh, in two or three dimensions.

    Args:
        vertices: #V by 2 or 3.
        triangles: #T by 3.
    """

    def __init__(self, vertices: FloatArray, triangles: NDArray[np.int64]) -> None:
        from scipy.spatial import cKDTree

        self.corners = vertices[triangles]
        self.middles = self.corners.mean(axis=1)
        self.radius = np.linalg.norm(self.corners - self.middles[:, None], axis=2).max(axis=1)
        self.tree = cKDTree(self.middles)

    def __call__(self, points: FloatArray) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
        """Return the nearest triangle of every point.

        Args:
            points: #P by 2 or 3.

        Returns:
            triangle (#P), barycentric weights (#P by 3), distance (#P).
        """
        count = min(12, len(self.middles))
        _, first = self.tree.query(points, k=count)
        first = np.reshape(first, (len(points), count))
        owner = np.repeat(np.arange(len(points)), count)
        triangle, weights, distance = self._best(points, owner, first.ravel())
        # Any triangle whose middle lies within the best distance plus the largest triangle's radius may be nearer.
        near = self.tree.query_ball_point(points, distance + self.radius.max() * (1.0 + 1e-9))
        sizes = np.array([len(n) for n in near])
        if (sizes > count).any():
            owner = np.repeat(np.arange(len(points)), sizes)
            flat = np.concatenate([np.asarray(n, np.int64) for n in near if n])
            keep = (
                np.linalg.norm(points[owner] - self.middles[flat], axis=1)
                <= distance[owner] + self.radius[flat] + 1e-12
            )
            again = np.unique(owner[keep])
            better = self._best(points, owner[keep], flat[keep])
            triangle[again], weights[again], distance[again] = better
        return triangle, weights, distance

    def _best(
        self, points: FloatArray, owner: NDArray[np.int64], triangles: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
        """Return the nearest triangle of each point, among pairs of a point and a triangle that are sorted by point."""
        weights = _barycentric(self.corners[triangles], points[owner])
        place = np.einsum("nk,nkd->nd", weights, self.corners[triangles])
        distance = np.linalg.norm(place - points[owner], axis=1)
        order = np.lexsort((triangles, distance, owner))
        _, first = np.unique(owner[order], return_index=True)
        chosen = order[first]
        return triangles[chosen], weights[chosen], distance[chosen]


def _barycentric(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Return weights of the nearest point of each triangle, #N by 3.

    Source: Ericson, Real-Time Collision Detection, 5.1.5, by regions of the triangle's plane.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac, ap, bp, cp = b - a, c - a, points - a, points - b, points - c

    def dot(u: FloatArray, v: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("ij,ij->i", u, v))

    d1, d2, d3, d4, d5, d6 = dot(ab, ap), dot(ac, ap), dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp)
    vc, vb, va = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4

    def ratio(top: FloatArray, bottom: FloatArray) -> FloatArray:
        return np.clip(
            np.where(np.abs(bottom) > 1e-300, top / np.where(np.abs(bottom) > 1e-300, bottom, 1.0), 0.0), 0.0, 1.0
        )

    zero, one = np.zeros(len(a)), np.ones(len(a))
    t_ab, t_ac, t_bc = ratio(d1, d1 - d3), ratio(d2, d2 - d6), ratio(d4 - d3, (d4 - d3) + (d5 - d6))
    total = va + vb + vc
    inside_v, inside_w = ratio(vb, total), ratio(vc, total)
    regions = [
        ((d1 <= 0) & (d2 <= 0), (one, zero, zero)),
        ((d3 >= 0) & (d4 <= d3), (zero, one, zero)),
        ((vc <= 0) & (d1 >= 0) & (d3 <= 0), (1 - t_ab, t_ab, zero)),
        ((d6 >= 0) & (d5 <= d6), (zero, zero, one)),
        ((vb <= 0) & (d2 >= 0) & (d6 <= 0), (1 - t_ac, zero, t_ac)),
        ((va <= 0) & (d4 >= d3) & (d5 >= d6), (zero, 1 - t_bc, t_bc)),
    ]
    conditions = [r[0] for r in regions]
    inside = (1 - inside_v - inside_w, inside_v, inside_w)
    return np.column_stack([np.select(conditions, [r[1][k] for r in regions], inside[k]) for k in range(3)])
