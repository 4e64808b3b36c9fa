"""The nearest place on a triangle mesh, exact, and without Warp: a form is built while Warp is still being loaded."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray
from warpflat.flat import nearest_on_triangles

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
        weights = nearest_on_triangles(self.corners[triangles], points[owner])
        place = np.einsum("nk,nkd->nd", weights, self.corners[triangles])
        distance = np.linalg.norm(place - points[owner], axis=1)
        order = np.lexsort((triangles, distance, owner))
        _, first = np.unique(owner[order], return_index=True)
        chosen = order[first]
        return triangles[chosen], weights[chosen], distance[chosen]
