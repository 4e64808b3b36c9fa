"""Overlap of the cloth around a crack or a hole of a layout."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray

__all__ = ["OVERLAP", "overlap_width", "overlapping"]

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


def overlapping(width: float) -> str:
    """Return the message about a cut whose sides overlap by a width [m]."""
    return (
        f"overlaps by {width * 1e3:.1f} mm instead of gaping: there is no dart to sew; it needs more cloth there, "
        "not less"
    )
