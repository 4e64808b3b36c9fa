"""Figures of a run as all show them who do: console, page and tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

from warpflat.core import energy_words, format_count

__all__ = ["count_pieces", "relaxation_words", "seam_figures"]


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


def relaxation_words(pieces: Iterable[Sequence[Mapping[str, Any]]]) -> str:
    """Return how many of the paper's steps and how many iterations of L-BFGS relaxed pieces first, and what energy each released.

    Args:
        pieces: for each the entries of its history, as `Stage.as_dict` has them.

    Returns:
        Such as "36 steps released 2.3 J, 301 iterations 120 mJ"; empty where nothing was relaxed.
    """
    counts: dict[str, int] = {}
    released: dict[str, float] = {}
    for stages in pieces:
        for before, stage in pairwise(stages):
            if before["name"] not in ("develop", "steps") or stage["name"] not in ("steps", "relax"):
                break
            # A step is a unit of work, an iteration several.
            unit = "step" if stage["work_units"] <= stage["steps"] else "iteration"
            counts[unit] = counts.get(unit, 0) + stage["steps"]
            # The energy of crushed faces is beyond all numbers.
            if None not in (before["model_energy_j"], stage["model_energy_j"]):
                released[unit] = released.get(unit, 0.0) + before["model_energy_j"] - stage["model_energy_j"]
    return ", ".join(
        f"{format_count(counts[unit], unit)} released {energy_words(released.get(unit, 0.0))}"
        for unit in ("step", "iteration")
        if counts.get(unit)
    )


def aligned(head: Sequence[str], rows: Sequence[Sequence[str]], *, left: Sequence[int] = (0,)) -> str:
    """Return rows in columns under their heads, aligned to the right but for the columns listed in `left`."""
    table = [head, *rows]
    widths = [max(len(row[column]) for row in table) for column in range(len(head))]
    return "\n".join(
        "  ".join(
            cell.ljust(width) if column in left else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in table
    )
