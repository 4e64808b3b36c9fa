"""Rays from inside the convex hulls of sections: curves that are smooth around a body and along it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpflat.core import FloatArray, InputError
from warpflat.garment.mannequin.sampled import smooth

__all__ = ["ray_radii", "smooth_radii", "with_harmonics"]

# Sampled hulls are smoothed so far from row to row [rows].
_UP_SIGMA = 1.5


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


def with_harmonics(radii: FloatArray, harmonics: int) -> FloatArray:
    """Return radii (... by #R) around closed curves with so many of their lowest harmonics, the mean among them."""
    spectrum = np.fft.rfft(radii)
    spectrum[..., harmonics:] = 0.0
    return np.fft.irfft(spectrum, radii.shape[-1])


def smooth_radii(
    hulls: Sequence[FloatArray], middles: FloatArray, heights: FloatArray, count: int, harmonics: int
) -> FloatArray:
    """Return #S by `count`, the radii of sections' hulls from their middles [m], smooth around and from section to section.

    Args:
        hulls: #S, each #P by 2 (x, z) [m].
        middles: #S by 2 [m].
        heights: #S [m].
        count: of rays.
        harmonics: that are kept.
    """
    rows = zip(hulls, middles, heights.tolist(), strict=True)
    radii = np.stack([ray_radii(hull, middle, count, height) for hull, middle, height in rows])
    return with_harmonics(smooth(radii, _UP_SIGMA), harmonics)
