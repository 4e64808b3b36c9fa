"""The difference in length between the two sides of a seam, as a whole and piece by piece."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray

__all__ = ["LOCAL_TOLERANCE", "SEAM_TOLERANCE", "STRETCH", "worst_difference"]


#: Sides of a seam may differ by this [m], and by this over any stretch of `STRETCH` [m].
SEAM_TOLERANCE, LOCAL_TOLERANCE = 5e-4, 2e-4
STRETCH = 0.050


def worst_difference(first: FloatArray, second: FloatArray, ease: float) -> float | None:
    """Return the largest difference [m] of two sides of a seam over any `STRETCH`; None if they share no vertices.

    Args:
        first, second: #P, the lengths [m] at which both sides have their common vertices.
        ease: by how much the second side is meant to be longer, as a share.
    """
    if len(first) != len(second):
        return None
    starts = np.unique(np.concatenate([first, first - STRETCH]))
    starts = starts[(starts >= 0) & (starts <= first[-1] - STRETCH)]
    starts = starts if len(starts) else first[:1]
    ends = np.minimum(starts + STRETCH, first[-1])
    stretch = np.interp(ends, first, second) - np.interp(starts, first, second)
    return float(np.abs(stretch - (ends - starts) * (1 + ease)).max())
