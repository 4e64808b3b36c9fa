"""Legs of a scanned body, turned until they hang plumb, as a skirt's tape finds them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.mannequin.scan_levels import TrunkSections, leg_sections
from warpflat.mannequin.scan_pose import Slicer

__all__ = ["plumb_legs"]

# Legs within this slope of the plumb line stand together [m per m].
_TOGETHER = 0.01


def plumb_legs(slicer: Slicer, trunk: TrunkSections, hip: float) -> tuple[TrunkSections, list[str]]:
    """Turn legs that stand apart about the hips until they hang plumb.

    A tape around both legs of a scan measures how far apart the feet stand. Each point below the hip moves towards the
    midplane by its distance below the hip times the slope of the legs' middles. Sections from the hip up stay.

    Args:
        slicer: the upright scan.
        trunk: its sections.
        hip: height of the hip [m].

    Returns:
        the sections with plumb legs, and a note if the legs stood apart.
    """
    from scipy.spatial import ConvexHull

    slope = _slope(slicer, trunk)
    if slope < _TOGETHER:
        return trunk, []
    hulls = list(trunk.hulls)
    girth, area, left, right = (a.copy() for a in (trunk.girth, trunk.area, trunk.left, trunk.right))
    for i in np.flatnonzero(trunk.y < hip):
        points = hulls[i].copy()
        inwards = slope * (hip - trunk.y[i])
        points[:, 0] = np.sign(points[:, 0]) * np.maximum(np.abs(points[:, 0]) - inwards, 0.0)
        hull = ConvexHull(points)
        hulls[i], girth[i], area[i] = points[hull.vertices], hull.area, hull.volume
        left[i], right[i] = points[:, 0].max(), -points[:, 0].min()
    note = (
        f"the legs stand {2.0 * np.degrees(np.arctan(slope)):.0f} degrees apart; thigh, knee and ankle are measured with each leg "
        f"turned plumb about the hip at {hip:.3f} m"
    )
    plumb = replace(trunk, hulls=tuple(hulls), girth=girth, area=area, left=left, right=right)
    return plumb, [note]


def _slope(slicer: Slicer, trunk: TrunkSections) -> float:
    """Return how far the legs' middles run apart per metre down the leg, ankle to crotch."""
    heights, apart = [], []
    for y in np.linspace(0.09 * trunk.stature, trunk.crotch - 0.02 * trunk.stature, 40):
        legs = leg_sections(slicer, float(y), trunk.stature)
        if len(legs) == 2:
            middles: FloatArray = np.array([0.5 * (p.points.min(axis=0) + p.points.max(axis=0)) for p in legs])
            heights.append(y)
            apart.append(0.5 * abs(middles[0, 0] - middles[1, 0]))
    return max(0.0, -float(np.polyfit(heights, apart, 1)[0])) if len(heights) > 3 else 0.0
