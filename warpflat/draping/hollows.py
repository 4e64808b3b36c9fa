"""Hollows of a surface: how far taut cloth over it stands off."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from warpflat.core.arrays import FloatArray, IntArray

__all__ = ["HOLLOW_REACH", "hollow_depths"]

#: Cloth bridges a hollow that has the surface on all sides within this distance [m].
HOLLOW_REACH = 0.12


def hollow_depths(points: FloatArray, normals: FloatArray, at: IntArray) -> FloatArray:
    """Measure how far the convex hull of a surface's neighbourhood lies above its vertices, along their normals.

    The neighbourhood is the surface within `HOLLOW_REACH` whose normal points to the same side. Cloth that is drawn taut
    over it lies within that hull, so that it may stand off by this much without being too large.

    Args:
        points: #V by 3, the surface's vertices [m].
        normals: #V by 3, unit normals.
        at: #A, the vertices to measure at.

    Returns:
        #A, depths [m]; 0 where the surface bulges.
    """
    depths, tree = np.zeros(len(at)), cKDTree(points)
    for number, (vertex, near) in enumerate(
        zip(at.tolist(), tree.query_ball_point(points[at], HOLLOW_REACH), strict=True)
    ):
        near = np.asarray(near)
        near = near[normals[near] @ normals[vertex] > 0.0]
        if len(near) <= 4:
            continue
        try:
            equations = ConvexHull(points[near] - points[vertex], qhull_options="QJ").equations
        except QhullError:  # all in one plane
            continue
        slope = equations[:, :3] @ normals[vertex]
        up = slope > 1e-9
        if up.any():
            depths[number] = max(float((-equations[up, 3] / slope[up]).min()), 0.0)
    return depths
