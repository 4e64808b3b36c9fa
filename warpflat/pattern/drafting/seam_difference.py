"""The difference in length between the two sides of a seam, as a whole and piece by piece."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from warpflat.core import FloatArray

__all__ = ["LOCAL_TOLERANCE", "SEAM_TOLERANCE", "STRETCH", "eased_length", "lengths_along_side", "worst_difference"]


#: Sides of a seam may differ by this [m], and by this over any stretch of `STRETCH` [m].
SEAM_TOLERANCE, LOCAL_TOLERANCE = 5e-4, 2e-4
STRETCH = 0.050


def eased_length(length: Any, whole: float, ease: float, eased: tuple[float, float] = (0.0, 1.0)) -> Any:
    """Return the lengths [m] along the second side of a seam opposite to those along the first.

    Args:
        length: along the first side [m], a number or an array.
        whole: length of the first side [m].
        ease: by how much the second side is longer, as a share.
        eased: shares of the first side between which it is longer.
    """
    first, last = eased
    return length + ease * whole * np.clip((length / whole - first) / (last - first), 0.0, 1.0)


def worst_difference(
    first: FloatArray,
    second: FloatArray,
    ease: float,
    eased: tuple[float, float] = (0.0, 1.0),
    *,
    laid: tuple[FloatArray, FloatArray] | None = None,
) -> float | None:
    """Return the largest difference [m] of two sides of a seam over any `STRETCH`; None if they share no vertices.

    Args:
        first, second: #P, the lengths [m] at which both sides have their common vertices.
        ease: by how much the second side is meant to be longer, as a share.
        eased: shares of the first side between which it is longer.
        laid: the lengths [m] of both sides in the layout, of a seam whose sides differ from place to place as they do there.
    """
    if len(first) != len(second):
        return None
    if laid is not None:
        # What the layout eases in is no difference.
        second, ease = second - (laid[1] - laid[0]), 0.0
    starts = np.unique(np.concatenate([first, first - STRETCH]))
    starts = starts[(starts >= 0) & (starts <= first[-1] - STRETCH)]
    starts = starts if len(starts) else first[:1]
    ends = np.minimum(starts + STRETCH, first[-1])
    stretch = np.interp(ends, first, second) - np.interp(starts, first, second)
    meant = eased_length(ends, first[-1], ease, eased) - eased_length(starts, first[-1], ease, eased)
    return float(np.abs(stretch - meant).max())


def lengths_along_side(edges: Iterable[tuple[FloatArray, bool]]) -> FloatArray:
    """Return lengths [m] along the edges of a seam's side as lengths along the side, joints once.

    Args:
        edges: the lengths along each, from 0 to all of it, and whether the seam runs against it.
    """
    rows = [np.zeros(1)]
    for along, is_reversed in edges:
        rows.append(rows[-1][-1] + (along[-1] - along[::-1] if is_reversed else along)[1:])
    return np.concatenate(rows)
