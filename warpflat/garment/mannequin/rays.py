"""Rays from inside a convex hull."""

from __future__ import annotations

import numpy as np

from warpflat.core import FloatArray, InputError

__all__ = ["ray_radii"]


def ray_radii(hull: FloatArray, middle: FloatArray, count: int, height: float) -> FloatArray:
    """Return distance [m] from `middle` to a convex hull along `count` even directions, from +z over +x.

    Raises:
        InputError: if `middle` does not lie inside the hull; names its `height` [m].
    """
    corners = hull - middle
    angle = np.arctan2(corners[:, 0], corners[:, 1]) % (2.0 * np.pi)
    order = np.argsort(angle)
    corners, angle = corners[order], angle[order]
    if np.diff(angle, append=angle[0] + 2.0 * np.pi).max() >= np.pi:
        raise InputError(
            f"scan: the body at {height:.2f} m above the floor does not surround the midplane; its mesh is broken there"
        )
    rays = np.arange(count) * 2.0 * np.pi / count
    after = np.searchsorted(angle, rays, side="right") % len(corners)
    a, b = corners[after - 1], corners[after]
    d = np.column_stack([np.sin(rays), np.cos(rays)])
    along = b - a
    bottom = d[:, 0] * along[:, 1] - d[:, 1] * along[:, 0]
    top = a[:, 0] * along[:, 1] - a[:, 1] * along[:, 0]
    safe = np.abs(bottom) > 1e-12
    return np.where(safe, top / np.where(safe, bottom, 1.0), np.linalg.norm(a, axis=1))
