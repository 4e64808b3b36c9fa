"""Refusal of measures that no body has, with their places."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from warpflat.core.errors import InputError
from warpflat.mannequin.measurements import size_tables
from warpflat.mannequin.scan_levels import TrunkSections

__all__ = ["check_girths"]

_LEVELS = ("bust", "underbust", "waist", "hip")
# The girth changes less than this share from one section to the next, a quarter of a hundredth of the stature higher.
_STEP = 0.10


def check_girths(trunk: TrunkSections, levels: Mapping[str, float], *, leaps: bool = True) -> None:
    """Check the girths of the trunk against each other.

    Args:
        trunk: the sections.
        levels: heights [m].
        leaps: whether the girth may not leap; it does under a hanging bust.

    Raises:
        InputError: for two levels whose girths no body has together, or a girth that leaps between hip and bust.
    """
    rows = np.flatnonzero((trunk.y > levels["hip"]) & (trunk.y < levels["bust"]))
    change = np.abs(np.diff(trunk.girth[rows])) / trunk.girth[rows[:-1]]
    worst = int(np.argmax(change))
    if leaps and change[worst] > _STEP:
        a, b = rows[worst], rows[worst + 1]
        raise InputError(
            f"scan: the trunk's girth leaps from {trunk.girth[a]:.2f} to {trunk.girth[b]:.2f} m between {trunk.y[a]:.3f} and "
            f"{trunk.y[b]:.3f} m above the floor; repair the mesh there, such as arms grown to the trunk or a hole"
        )
    girths = {level: float(np.interp(levels[level], trunk.y, trunk.girth)) for level in _LEVELS}
    for top, bottom, low, high in size_tables()["valid"]["ratio"].values():
        if {top, bottom} <= set(girths) and not low <= girths[top] / girths[bottom] <= high:
            raise InputError(
                f"scan: {top} {girths[top]:.2f} m at {levels[top]:.2f} m above the floor does not go with {bottom} "
                f"{girths[bottom]:.2f} m at {levels[bottom]:.2f} m: {low * girths[bottom]:.2f} to {high * girths[bottom]:.2f} m is "
                "possible; repair the mesh or give landmarks"
            )
