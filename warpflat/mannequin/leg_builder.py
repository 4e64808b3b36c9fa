"""Laying the grid on the lower body: the crotch curve and the legs."""

from __future__ import annotations

import itertools

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.polyline import resample
from warpflat.mannequin.blueprint import LegCurves, LegProfile
from warpflat.mannequin.layout import LEG_LEVELS, Layout
from warpflat.mannequin.profiles import scale_to_girth
from warpflat.mannequin.sheet import fill_fork

__all__ = ["leg_ring", "set_legs"]


def set_legs(vertices: FloatArray, layout: Layout, legs: LegCurves) -> None:
    """Set the vertices of crotch curve and legs; those of the rings are there.

    Args:
        vertices: layout.vertex_count by 3 [m], changed in place.
        layout: the grid.
        legs: the curves.
    """
    point, cells = layout.crotch_point, len(layout.crotch) - 1
    shares = [np.linspace(0.0, legs.point, point + 1), np.linspace(legs.point, 1.0, cells - point + 1)[1:]]
    curve = resample(legs.crotch, np.concatenate(shares))
    # The curve was drawn to a profile; its ends follow the finished row.
    ends = vertices[layout.crotch[[0, -1]]] - curve[[0, -1]]
    along = np.linspace(0.0, 1.0, len(curve))[:, None]
    vertices[layout.crotch[1:-1]] = (curve + (1.0 - along) * ends[0] + along * ends[1])[1:-1]
    for side, grid in layout.legs.items():
        rows = layout.leg_row
        for high, low in itertools.pairwise(LEG_LEVELS[1:]):
            for row in range(rows[high], rows[low] + 1):
                share = (row - rows[high]) / (rows[low] - rows[high])
                height = (1.0 - share) * legs.heights[high] + share * legs.heights[low]
                vertices[grid[row]] = leg_ring(layout, legs.profile(side, height), height)
    fill_fork(vertices, layout, legs.attract)


def leg_ring(layout: Layout, profile: LegProfile, height: float) -> FloatArray:
    """Return one closed row of a leg, #columns by 3 [m]; a tape around it reads exactly the profile's girth."""
    inner, outer = layout.to_outseam - layout.quarter + layout.to_princess, layout.quarter - layout.to_princess
    back = len(layout.crotch) - 1 - layout.crotch_point + layout.to_princess
    a, b, c = profile.crease_front, profile.outseam, profile.crease_back
    # Next to the inseam the columns keep the wider spacing that they have on the crotch curve.
    near, far = _widened(inner, profile.spread), 1.0 - _widened(back, profile.spread)[::-1]
    shares = [
        a * near[:-1],
        np.linspace(a, b, outer, endpoint=False),
        np.linspace(b, c, outer, endpoint=False),
        c + (1.0 - c) * far[:-1],
    ]
    flat = resample(profile.curve, np.concatenate(shares), closed=True)
    return scale_to_girth(np.column_stack([flat[:, 0], np.full(len(flat), height), flat[:, 1]]), profile.girth)


def _widened(cells: int, spread: float) -> FloatArray:
    """Return `cells` + 1 shares from 0 to 1, the first steps 1 + `spread` times the mean one and the last 1 - `spread` times."""
    u = np.linspace(0.0, 1.0, cells + 1)
    return (1.0 + spread) * u - spread * u * u
