"""Figures of a run as all show them who do: console, page and tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["count_pieces", "seam_figures"]


def count_pieces(metrics: Mapping[str, Any]) -> int:
    """Return of how many pieces the pattern is, as its pages number them; without a pattern, how many were flattened.

    A pair is one piece that is cut twice. What was drafted beside the flattened pieces counts, such as collars and bands.
    """
    cut = {piece["piece"] for cloth in metrics.get("cloths", ()) for piece in cloth["pieces"]}
    return len(cut or metrics["pieces"])


def seam_figures(seam: Mapping[str, Any]) -> tuple[str, str, str, str]:
    """Return the lengths of both sides of a seam, its ease and the difference that is left, in words; no ease without any."""
    first, second = (f"{length:.1f} mm" for length in seam["length_mm"])
    ease = f"{100 * seam['ease']:+.3g} %" if seam["ease"] else ""
    # Without the sign of a negative zero.
    return first, second, ease, f"{round(seam['difference_mm'], 2) + 0.0:+.2f} mm"
