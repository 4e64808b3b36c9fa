"""The nearest place of a triangle to a point."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray

__all__ = ["nearest_on_triangles"]


def nearest_on_triangles(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Return barycentric coordinates of the nearest place of each triangle to its point, #T by 3 (Ericson 2005, 5.1.5).

    Args:
        corners: #T by 3 by 2 or 3 [m].
        points: #T by 2 or 3 [m].
    """
    a, b, c = corners.transpose(1, 0, 2)
    ab, ac = b - a, c - a

    def along(way: FloatArray, origin: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("ij,ij->i", way, points - origin))

    d1, d2, d3, d4, d5, d6 = along(ab, a), along(ac, a), along(ab, b), along(ac, b), along(ab, c), along(ac, c)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    whole = va + vb + vc

    def share(part: FloatArray, of: FloatArray) -> FloatArray:
        return np.asarray(part / np.where(of == 0.0, 1.0, of))

    zero, one = np.zeros(len(points)), np.ones(len(points))
    on_ab, on_ac, on_bc = share(d1, d1 - d3), share(d2, d2 - d6), share(d4 - d3, (d4 - d3) + (d5 - d6))
    # Corners first, then edges; what is beside none of them is within.
    places = [
        ((d1 <= 0) & (d2 <= 0), zero, zero),
        ((d3 >= 0) & (d4 <= d3), one, zero),
        ((d6 >= 0) & (d5 <= d6), zero, one),
        ((vc <= 0) & (d1 >= 0) & (d3 <= 0), on_ab, zero),
        ((vb <= 0) & (d2 >= 0) & (d6 <= 0), zero, on_ac),
        ((va <= 0) & (d4 >= d3) & (d5 >= d6), 1.0 - on_bc, on_bc),
    ]
    there = [place[0] for place in places]
    v = np.select(there, [place[1] for place in places], share(vb, whole))
    w = np.select(there, [place[2] for place in places], share(vc, whole))
    return np.stack([1.0 - v - w, v, w], axis=1)
