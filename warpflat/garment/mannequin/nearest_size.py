"""Comparison of a body with the size tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from warpflat.garment.mannequin.layout import LEG_LINES, RING_LEVELS
from warpflat.garment.mannequin.measurements import TAKEN_ALONG, Measurements, measurements_from_size, size_tables

__all__ = ["SizeDifference", "difference_to_size", "nearest_size"]

_SIZED_BY = ("bust", "waist", "hip")
# The measurement that a line of the mannequin, or a tape, is; of a pair that on the left.
_MEASUREMENT = {line: name for name, line in TAKEN_ALONG.items()} | {"hip, legs together": "hip"}
# The height of a size that a line lies at.
_HEIGHT = {
    **{level: level for level in RING_LEVELS},
    "hip, legs together": "hip",
    **{f"{line} {side}": level for level, line in LEG_LINES.items() for side in ("left", "right")},
}


@dataclass(frozen=True, kw_only=True)
class SizeDifference:
    """Differences of a body to one size, positive where the body is higher or wider.

    Attributes:
        size: the size's name.
        heights: by level [m]; the levels of trunk and legs.
        girths: by level [m]; of shoulders and chest their lengths.
    """

    size: str
    heights: Mapping[str, float]
    girths: Mapping[str, float]


def nearest_size(heights: Mapping[str, float], girths: Mapping[str, float]) -> SizeDifference:
    """Return the differences to the size whose bust, waist and hip have the least sum of squared differences.

    Args:
        heights: of the body's levels [m].
        girths: of the body's levels [m], bust, waist and hip among them.
    """

    def miss(size: Measurements) -> float:
        return sum((girths[level] - size.lengths[level]) ** 2 for level in _SIZED_BY)

    names = [f"{table['label']} {size}" for table in size_tables()["tables"].values() for size in table["sizes"]]
    sizes = {name: measurements_from_size(name) for name in names}
    return difference_to_size(min(sizes, key=lambda name: miss(sizes[name])), heights, girths)


def difference_to_size(name: str, heights: Mapping[str, float], girths: Mapping[str, float]) -> SizeDifference:
    """Return the differences to a size, for all names that it has a measurement or a height for.

    Args:
        name: the size's.
        heights: of the body's levels or tapes [m].
        girths: the same [m].
    """
    size = measurements_from_size(name)
    measured = {line: _MEASUREMENT.get(line.replace(" right", " left")) for line in girths}
    return SizeDifference(
        size=name,
        heights={k: heights[k] - size.heights[_HEIGHT[k]] for k in girths if k in _HEIGHT},
        girths={k: girths[k] - size.lengths[m] for k, m in measured.items() if m is not None},
    )
