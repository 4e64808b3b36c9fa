"""Overlap of the cloth around a crack or a hole of a layout."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray

__all__ = ["OVERLAP", "overlap_width", "overlapping", "parted"]

#: Sides that lie over each other by no more than this [m] are drawn and sewn as if they met.
OVERLAP = 5e-4


def overlap_width(ring: FloatArray) -> float:
    """Return the width [m] of the widest place in which the cloth around a hole overlaps itself; 0 if it does not.

    Args:
        ring: #P by 2 [m], the border of the hole, closed, the first point not repeated, counter-clockwise.
    """
    import shapely

    twice = []
    for cell in shapely.get_parts(shapely.polygonize([shapely.node(shapely.LinearRing(ring))])):
        # The ring runs the other way around a cell that is covered twice: its winding number, counter-clockwise, is negative.
        spoke = ring - np.asarray(cell.representative_point().coords[0])
        ahead = np.roll(spoke, -1, axis=0)
        cross = spoke[:, 0] * ahead[:, 1] - spoke[:, 1] * ahead[:, 0]
        if round(float(np.arctan2(cross, np.einsum("ij,ij->i", spoke, ahead)).sum()) / (2 * np.pi)) < 0:
            twice.append(cell)
    return max((2.0 * float(shapely.maximum_inscribed_circle(cell).length) for cell in twice), default=0.0)


def parted(ring: FloatArray) -> FloatArray:
    """Return an outline that touches itself, or lies over itself by rounding, with these places moved apart; any other one as it is.

    Around a hole that meets the border at a point, and where two borders run along each other, points move into the cloth, by a share of
    `OVERLAP`.

    Args:
        ring: #P by 2 [m], closed, the first point not repeated, counter-clockwise.
    """
    import shapely

    if len(ring) < 4 or shapely.Polygon(ring).is_valid:
        return ring
    ahead = np.roll(ring, -1, axis=0)
    sides = shapely.linestrings(np.stack([ring, ahead], axis=1))
    point, side = shapely.STRtree(sides).query(shapely.points(ring), predicate="dwithin", distance=OVERLAP)
    # What lies near along the outline is no other part of it.
    lengths = np.linalg.norm(ahead - ring, axis=1)
    at, around = np.cumsum(lengths) - lengths, float(lengths.sum())
    between = np.minimum(np.abs(at[point] - at[side]), np.abs(at[point] - at[side] - lengths[side]))
    touching = np.unique(point[np.minimum(between, around - between - lengths[side]) > 4.0 * OVERLAP])
    way = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
    inward = np.column_stack([-way[:, 1], way[:, 0]]) / np.maximum(np.linalg.norm(way, axis=1), 1e-300)[:, None]
    for share in (0.05, 0.1, 0.2, 0.4):
        moved = ring.copy()
        moved[touching] += share * OVERLAP * inward[touching]
        if shapely.Polygon(moved).is_valid:
            return moved
    return ring


def overlapping(width: float) -> str:
    """Return the message about a cut whose sides overlap by a width [m]."""
    return (
        f"overlaps by {width * 1e3:.1f} mm instead of gaping: there is no dart to sew; it needs more cloth there, "
        "not less"
    )
