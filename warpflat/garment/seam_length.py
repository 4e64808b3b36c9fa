"""Lengths of the two sides of a seam in the pattern, their difference, and the energy that the seam costs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

__all__ = ["SeamLengths"]


@dataclass(frozen=True, kw_only=True)
class SeamLengths:
    """A seam, measured.

    Attributes:
        name: after the feature line, or the cut.
        sides: "piece.edge" twice.
        length_3d: length of the curve in space that both sides come from [m].
        lengths: of its two sides in the pattern [m].
        ease: by how much the second side is meant to be longer, as a share of the first; as in `pattern.json`.
        cost: half the work of the seam's forces [J], the energy that matching its sides costs; None if they were not
            matched.
    """

    name: str
    sides: tuple[str, str]
    length_3d: float
    lengths: tuple[float, float]
    ease: float = 0.0
    cost: float | None = None

    @property
    def difference(self) -> float:
        """Excess length of the second side over that of the first and its ease [m]."""
        return self.lengths[1] - self.lengths[0] * (1.0 + self.ease)

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of `metrics.json`."""
        return {
            "name": self.name,
            "sides": list(self.sides),
            "length_mm": [1e3 * length for length in self.lengths],
            "length_3d_mm": 1e3 * self.length_3d,
            "difference_mm": 1e3 * self.difference,
            "ease": self.ease,
            "price_j": self.cost,
        }
