"""What a run comes to as a whole, for all who show it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["count_pieces"]


def count_pieces(metrics: Mapping[str, Any]) -> int:
    """Return of how many pieces the pattern is, as its pages number them; without a pattern, how many were flattened.

    A pair is one piece that is cut twice. What was drafted beside the flattened pieces counts, such as collars and bands.
    """
    cut = {piece["piece"] for cloth in metrics.get("cloths", ()) for piece in cloth["pieces"]}
    return len(cut or metrics["pieces"])
