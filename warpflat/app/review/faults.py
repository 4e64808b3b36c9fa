"""What is wrong with a run: a line for each fault, by which the command ends with 1 and the page says that it is not done."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from warpflat.core import energy_words, format_count, list_some

__all__ = ["faults_of", "is_done"]

# A seam or constraint that fails by more than this gets a warning [mm].
_WARNED_MISS = 0.2
# Cloth that is so far from its designed surface has fallen off the body [m].
_FALLEN = 0.3
# No cloth is worn stretched by more than this share.
_TORN = 0.5


def is_done(metrics: Mapping[str, Any]) -> bool:
    """Return whether a run is without faults, and nothing that its pattern needs was left out: the command ends with 0."""
    return not faults_of(metrics) and not metrics.get("left_out")


def faults_of(metrics: Mapping[str, Any]) -> list[str]:
    """Return a line for each fault of a piece, of every size: not converged, flipped faces, overlap; and for seams whose sides differ."""
    lines, sewing = list[str](), metrics.get("sewing", {})
    for name, piece in metrics["pieces"].items():
        if not piece["stages"][-1]["converged"]:
            last = piece["stages"][-1]
            asked = sewing.get("contradictory", False) and last["name"] == "sew"
            remedy = "its seams and constraints ask for more than it can give" if asked else "raise max_steps"
            # The work that `max_steps` limits: steps of the piece's mesh, or work units where coarser levels add to them.
            steps, units = last["steps"], last["work_units"]
            work = f"{steps:,} steps" if units <= steps else f"{units:,.0f} work units"
            # Crushed faces make forces infinite; then the strain energy says how far from rest it has ended.
            if last["residual"] is None or not math.isfinite(last["residual"]):
                remainder = f"strain energy {energy_words(last['strain_energy_j'])}"
            else:
                remainder = f"residual {last['residual']:.1e}"
            lines.append(f"{name} did not converge within {work} ({remainder}); the pattern is not final: {remedy}")
        if piece["flipped_faces"]:
            lines.append(f"{name} has {piece['flipped_faces']:,} flipped faces; the pattern cannot be cut as it is")
        if piece.get("overlap_m2"):
            area = 1e6 * piece["overlap_m2"]
            lines.append(f"{name} lies over itself by {area:.3g} mm2; the pattern cannot be cut as it is")
    if not sewing.get("converged", True):
        amiss = [(seam["name"], abs(seam["difference_mm"])) for seam in metrics["seams"]]
        amiss += [(held["name"], held["amiss_mm"]) for held in metrics["constraints"]]
        lines += [
            f"{name} is amiss by {by:.2f} mm: more is asked than the pieces can keep together"
            for name, by in amiss
            if by > _WARNED_MISS
        ]
    drape = metrics.get("drape", {"converged": True})
    if not drape["converged"]:
        left = f"{100 * drape['residual']:.2g} % of a vertex's weight"
        fallen = drape["distance_m"]["mean"] > _FALLEN
        still = (
            "its forces no longer fall: a finer spacing_mm or another cloth may help"
            if drape["stalled"]
            else "raise max_steps"
        )
        remedy = "it has slipped off its body: hold = [...] keeps lines in place" if fallen else still
        lines.append(f"the drape is not at rest after {drape['steps']:,} steps ({left} is left): {remedy} in [drape]")
    longest = max(
        (drape[f"strain_{thread}"]["max"] for thread in ("warp", "weft") if f"strain_{thread}" in drape), default=0.0
    )
    if longest > _TORN:
        lines.append(
            f"the worn cloth is stretched by up to {100 * longest:.0f} %, which no cloth is: it is tangled, or far too small for this body"
        )
    pattern = metrics.get("pattern", {})
    if differing := pattern.get("seams_that_differ"):
        near = pattern["seam_difference_per_50mm_mm"]
        over = "" if near is None else f" as a whole, and {near:.2f} mm over 50 mm"
        lines.insert(
            0,
            f"the drawn sides of {format_count(len(differing), 'seam')} differ by up to {pattern['seam_difference_mm']:.2f} mm{over}: "
            f"{list_some(differing, 3)}; one side must be eased to the other there",
        )
    if refused := metrics.get("garment", {}).get("no_pattern"):
        lines.insert(0, refused)
    for size, other in metrics.get("sizes", {}).items():
        lines += [f"size {size}: {line}" for line in faults_of(other)]
    return lines
