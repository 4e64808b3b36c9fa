"""Feature profiles: smooth closed curves around a body, and the tape that measures them."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from warpflat.core import FloatArray, InputError, resample
from warpflat.garment.mannequin.sampled import smoothstep

__all__ = ["Section", "convex_girth", "scale_to_girth", "section_curve", "superellipse_exponent", "upper_hull"]


@dataclass(frozen=True, kw_only=True)
class Section:
    """The shape of one horizontal cross-section.

    Attributes:
        width: left to right [m].
        depth: back to front [m].
        area: area over width times depth; pi / 4 is an ellipse, 1 a rectangle.
        front: share of the depth ahead of the widest points.
        shift: where the widest points stand, forward positive [m].
        front_bump: how far the two bust points stand out of the smooth front [m].
        back_bump: how far blades or seat stand out of the smooth back [m].
        bump_x: distance of the bumps from the centre line [m].
        bump_width: standard deviation of the bumps across the body [m].
    """

    width: float
    depth: float
    area: float
    front: float
    shift: float
    front_bump: float = 0.0
    back_bump: float = 0.0
    bump_x: float = 0.09
    bump_width: float = 0.05


def section_curve(section: Section, samples: int = 720) -> FloatArray:
    """Return the closed curve of a section.

    Returns:
        #samples by 2, (x, z) [m], from centre front over the body's left to the back, not repeated at the end; evenly
        spaced along the curve. `samples` is a multiple of four.
    """
    exponent = superellipse_exponent(section.area)
    t = np.linspace(0.0, 2.0 * np.pi, 8 * samples, endpoint=False)
    # Superellipse in polar form: even where powers of sine and cosine would crowd the points at the corners.
    s, c = np.sin(t), np.cos(t)
    radius = (np.abs(s) ** exponent + np.abs(c) ** exponent) ** (-1.0 / exponent)
    ahead = section.front * section.depth
    behind = (1.0 - section.front) * section.depth
    x = 0.5 * section.width * radius * s
    z = radius * c * np.where(c > 0.0, ahead, behind)
    bump = sum(np.exp(-0.5 * ((x - at) / section.bump_width) ** 2) for at in (-section.bump_x, section.bump_x))
    # The bumps fade where the curve turns to the side, so that the side stays smooth and the width is kept.
    facing = np.clip(np.abs(radius * c), 0.0, 1.0)
    fade = smoothstep(facing)
    z = z + bump * fade * np.where(c > 0.0, section.front_bump, -section.back_bump) + section.shift
    return resample(np.column_stack([x, z]), np.arange(samples) / samples, closed=True)


@functools.lru_cache(maxsize=4096)
def superellipse_exponent(area: float) -> float:
    """Return the exponent whose superellipse fills the share `area` of its bounding box.

    Raises:
        InputError: if `area` is not between 0.6 and 0.97.
    """
    from scipy.optimize import brentq
    from scipy.special import gammaln

    if not 0.6 <= area <= 0.97:
        raise InputError(f"cross-section area share {area:g}: valid range 0.6 to 0.97")

    def miss(n: float) -> float:
        return float(np.exp(2.0 * gammaln(1.0 + 1.0 / n) - gammaln(1.0 + 2.0 / n))) - area

    return float(brentq(miss, 1.1, 12.0))


def convex_girth(points: FloatArray) -> float:
    """Return length [m] of a tape around points: the perimeter of their convex hull.

    Args:
        points: #P by 2, or #P by 3 in a level plane, of which x and z count.

    Raises:
        InputError: if the points span no area.
    """
    from scipy.spatial import ConvexHull, QhullError

    flat = points[:, [0, 2]] if points.shape[1] == 3 else points
    try:
        return float(ConvexHull(flat).area)
    except QhullError as error:
        raise InputError("profile: its points lie on one line, a girth needs a closed curve") from error


def scale_to_girth(points: FloatArray, girth: float) -> FloatArray:
    """Return points of a level profile blown up or shrunk about their middle until a tape around them reads `girth` [m].

    Args:
        points: #P by 3, one height.
        girth: wished convex girth [m].
    """
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    factor = girth / convex_girth(points)
    return middle + (points - middle) * np.array([factor, 1.0, factor])


def upper_hull(points: FloatArray) -> list[int]:
    """Return which of plane points (#P by 2), in their order from left to right, lie on the upper side of their convex hull.

    Source: Andrew's monotone chain.
    """
    touch: list[int] = []
    for row, point in enumerate(points):
        while len(touch) > 1:
            (x0, y0), (x1, y1) = point - points[touch[-2]], points[touch[-1]] - points[touch[-2]]
            if x1 * y0 < x0 * y1:
                break
            touch.pop()
        touch.append(row)
    return touch
