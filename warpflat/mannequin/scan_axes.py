"""Which way a scan stands and looks, found from legs, trunk and feet."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.mannequin.slicer import Slicer
from warpflat.mannequin.summit import summit

__all__ = ["across_trunk", "find_facing", "find_legs"]

# The trunk looks at most so far away from where the legs do [half degrees].
_TURNED = 80

# The lower legs of a body that sits lie so far before its trunk, as shares of its height.
_BEFORE = 0.05, 0.5

#: A part of a section: area and centroid of its convex hull in the section's plane, in the scan's unit.
_Part: TypeAlias = tuple[float, FloatArray]


def _hull_area_and_middle(points: FloatArray) -> tuple[float, FloatArray]:
    """Return the area and the centroid of the convex hull of plane points, which do not depend on the plane's axes."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:
        return 0.0, points.mean(axis=0)
    ring = points[hull.vertices]
    after = np.roll(ring, -1, axis=0)
    wedge = ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]
    if hull.volume <= 0.0:
        return 0.0, points.mean(axis=0)
    return float(hull.volume), np.asarray((ring + after).T @ wedge / (6.0 * hull.volume))


def _plane_axes(up: FloatArray) -> FloatArray:
    """Return two unit vectors at right angles to `up` and to each other, 2 by 3."""
    first = np.eye(3)[int(np.argmin(np.abs(up)))]
    first = first - up * (first @ up)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(up, first)])


def find_legs(slicer: Slicer, up: FloatArray, *, sits: bool = False) -> tuple[float, FloatArray | None]:
    """Rate how much the mesh is like a standing body if `up` is up; or like one that sits, its legs before its trunk.

    Returns:
        A score from 0 to 1, and the direction from leg to leg; None without legs. That of a body that sits is the one across the way
        from its trunk to its legs, towards its left.
    """
    points = slicer.vertices
    low, high = float((points @ up).min()), float((points @ up).max())
    across = _plane_axes(up)

    def parts(share: float) -> list[_Part]:
        """Return the parts of a horizontal section, largest first, of at least 15 % of the largest one's area."""
        cut = slicer.cut(up, low + share * (high - low))
        found = sorted((_hull_area_and_middle(part.points @ across.T) for part in cut), key=lambda part: -part[0])
        return [part for part in found if part[0] > 0.15 * found[0][0]]

    # Whoever sits shows lower legs alone.
    levels = np.linspace(0.07, 0.25 if sits else 0.40, 12)
    pairs = [legs for share in levels if _is_pair(legs := parts(float(share)))]
    if not pairs:
        return 0.0, None
    apart = [legs[0][1] - legs[1][1] for legs in pairs]
    direction = np.mean([a * np.sign(a @ apart[0]) for a in apart], axis=0)
    if np.linalg.norm(direction) == 0.0:
        return 0.0, None
    middle = np.mean([0.5 * (legs[0][1] + legs[1][1]) for legs in pairs], axis=0)
    sideways, trunk, score = direction @ across, parts(0.62), len(pairs) / len(levels)
    if sits and trunk:
        ahead = middle - trunk[0][1]
        away, middle = float(np.linalg.norm(ahead)), trunk[0][1]
        if not _BEFORE[0] * (high - low) < away < _BEFORE[1] * (high - low):
            return 0.0, None
        sideways = np.cross(up, ahead @ across)
    return score if _is_body(middle, trunk, parts(0.93), high - low) else 0.0, sideways


def _is_pair(legs: list[_Part]) -> bool:
    """Return whether parts of a section are two of similar size, as those of two legs are."""
    return len(legs) == 2 and legs[0][0] < 2.0 * legs[1][0]


def _is_body(middle: FloatArray, trunk: list[_Part], head: list[_Part], height: float) -> bool:
    """Return whether one trunk stands over the legs' middle and one head over the trunk; a child's head may be the broader."""
    reach = 0.12 * height
    if not trunk or np.linalg.norm(trunk[0][1] - middle) >= reach:
        return False
    # A bowed head lets chin and nose fall into parts of their own.
    if not head or _is_pair(head) or np.linalg.norm(head[0][1] - middle) >= 1.5 * reach:
        return False
    return head[0][0] < 1.5 * trunk[0][0] and trunk[0][0] < (0.42 * height) ** 2


def across_trunk(slicer: Slicer, up: FloatArray, sideways: FloatArray) -> FloatArray:
    """Return the unit direction across the trunk, at right angles to the plane in which it mirrors itself best.

    One foot ahead of the other turns the line from leg to leg, `sideways`, but not the trunk.
    """
    points = slicer.vertices
    low, high = float((points @ up).min()), float((points @ up).max())
    first = sideways - up * (sideways @ up)
    first /= np.linalg.norm(first)
    axes = np.array([first, np.cross(up, first)])
    turns = np.radians(np.arange(0.0, 360.0, 0.5))
    way = np.array([np.cos(turns), np.sin(turns)])
    steps = np.arange(-_TURNED, _TURNED + 1.0)
    misses = np.zeros(len(steps))
    for share in np.linspace(0.52, 0.68, 9):
        parts = [part.points @ axes.T for part in slicer.cut(up, low + share * (high - low))]
        if not parts:
            continue
        rated = [(*_hull_area_and_middle(part), i) for i, part in enumerate(parts)]
        area, middle, trunk = max(rated, key=lambda part: part[0])
        reach = ((parts[trunk] - middle) @ way).max(axis=0)
        mirrored = np.array([np.roll(reach[::-1], 361 + 2 * step) for step in range(-_TURNED, _TURNED + 1)])
        misses += np.square(reach - mirrored).sum(axis=1) / max(area, 1e-12)
    best = int(np.clip(np.argmin(misses), 1, len(steps) - 2))
    # A mirror image is shifted by twice the turn of its plane.
    turn = np.radians(0.5) * summit(steps, misses, best)
    return np.cos(turn) * axes[0] + np.sin(turn) * axes[1]


def find_facing(slicer: Slicer, up: FloatArray, ahead: FloatArray) -> float:
    """Return +1 if the body looks along `ahead`, -1 if the other way.

    Feet reach forward from the ankles; the seat stands out behind the waist more than anything stands out in front.
    """
    points = slicer.vertices
    low, high = float((points @ up).min()), float((points @ up).max())
    size = high - low

    def band(a: float, b: float) -> FloatArray:
        share = (points @ up - low) / size
        return points[(share >= a) & (share <= b)] @ ahead

    votes = 0.0
    feet, ankles = band(0.0, 0.035), band(0.05, 0.08)
    if len(feet) > 20 and len(ankles) > 20:
        middle = 0.5 * (ankles.min() + ankles.max())
        votes += float(np.clip(((feet.max() - middle) - (middle - feet.min())) / (0.04 * size), -1.0, 1.0)) * 1.5

    def spans(a: float, b: float) -> tuple[float, float]:
        cuts = [slicer.cut(up, low + s * size) for s in np.linspace(a, b, 8)]
        trunks = [
            max(c, key=lambda p: _hull_area_and_middle(p.points @ _plane_axes(up).T)[0]).points @ ahead
            for c in cuts
            if c
        ]
        return float(min(t.min() for t in trunks)), float(max(t.max() for t in trunks))

    waist_cuts = [slicer.cut(up, low + s * size) for s in np.linspace(0.60, 0.64, 5)]
    waist = np.concatenate([c[0].points @ ahead for c in waist_cuts if c])
    seat = spans(0.49, 0.55)
    votes += float(np.clip(((waist.min() - seat[0]) - (seat[1] - waist.max())) / (0.02 * size), -1.0, 1.0))
    if abs(votes) < 0.25:
        raise InputError("scan: front and back cannot be told apart by feet or seat; give facing, as facing = '+z'")
    return float(np.sign(votes))
