"""Cuts that have been made: darts, fish-eye darts or the edges of two pieces, and their measures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.flat.surface.connectivity import border_loops
from warpflat.flat.surface.cut.crack import Crack
from warpflat.flat.surface.cut.dart import dart_measure, fish_eye_measure, mouth_first, shape_dart, shape_fish_eye
from warpflat.flat.surface.cut.dart_legs import are_curved, pull_back
from warpflat.flat.surface.mesh import Surface

__all__ = ["AppliedCut", "cut_sides", "measure_crack", "measure_cut", "seam_kind"]


@dataclass(frozen=True, kw_only=True, eq=False)
class AppliedCut:
    """A cut that has been made.

    Attributes:
        name: name of the cut.
        paths: vertices of the uncut surface along which it was made.
        seams: its two sides: `path` in the numbering of the uncut surface, `left` and `right` in that of the pattern.
        length: length of the cut on the surface [m].
        tip_back: how far the tips of its darts are drawn back [m].
    """

    name: str
    paths: tuple[IntArray, ...]
    seams: tuple[Crack, ...]
    length: float
    tip_back: float = 0.0


def cut_sides(cuts: Sequence[AppliedCut]) -> IntArray:
    """Return the vertices of the pattern on the sides of cuts."""
    sides = [side for cut in cuts for seam in cut.seams for side in (seam.left, seam.right)]
    return np.unique(np.concatenate(sides)) if sides else np.empty(0, dtype=np.int32)


def seam_kind(seam: Crack) -> str:
    """Return the kind of a seam: "dart" (one tip), "fish-eye" (two), or "parting" (none, from border to border or closed)."""
    return _kind(seam.left, seam.right)


def _kind(left: IntArray, right: IntArray) -> str:
    tips = int(left[0] == right[0]) + int(left[-1] == right[-1])
    return ("parting", "dart", "fish-eye")[tips]


def measure_crack(positions: FloatArray, left: IntArray, right: IntArray) -> dict[str, Any]:
    """Measure how a crack opens: its kind, its widths [m], and of one with tips its angle [degrees], negative where its sides overlap.

    Args:
        positions: #P by 2, the pattern [m].
        left, right: vertices along its two sides.
    """
    kind = _kind(left, right)
    if kind == "dart":
        dart = dart_measure(positions, left, right)
        measures = {
            "opening_m": dart.opening,
            "angle_deg": math.degrees(dart.angle),
            "intake_m": dart.intake,
            "legs_m": [dart.left_leg, dart.right_leg],
        }
    elif kind == "fish-eye":
        eye = fish_eye_measure(positions, left, right)
        measures = {
            "opening_m": abs(eye.intake),
            "angle_deg": math.degrees(min(eye.first_angle, eye.last_angle)),
            "intake_m": eye.intake,
            "tip_to_tip_m": eye.length,
        }
    else:
        gap = np.linalg.norm(positions[left] - positions[right], axis=1)
        measures = {"opening_m": float(gap[[0, -1]].max()), "widest_m": float(gap.max())}
    return {"kind": kind, **measures}


def measure_cut(surface: Surface, positions: FloatArray, cut: AppliedCut) -> dict[str, Any]:
    """Build a cut's entry in `metrics.json`: lengths [m], angles [degrees], a dart or gap per seam.

    Args:
        surface: the cut surface.
        positions: #P by 2, the pattern [m].
        cut: a cut of that surface.
    """
    loops, seams = border_loops(surface.faces), []
    for seam in cut.seams:
        found = measure_crack(positions, seam.left, seam.right)
        kind = found["kind"]
        for side, line in (("left", seam.left), ("right", seam.right)):
            found[f"{side}_seam_m"] = polyline_length(positions[line])
        if kind != "parting":
            found["drawn"] = _drawn(positions, seam, kind, cut.tip_back, loops)
        seams.append(found)
    return {"name": cut.name, "length_m": cut.length, "seams": seams}


def _drawn(positions: FloatArray, seam: Crack, kind: str, tip_back: float, loops: list[IntArray]) -> dict[str, Any]:
    """Measure the dart as it is drawn: its tip moved back, straight legs made equal, curved ones as they run."""
    try:
        if kind == "fish-eye":
            eye = shape_fish_eye(positions, seam.left, seam.right, tip_back=tip_back)
            return {
                "tip_back_m": tip_back,
                "legs_m": [eye.first_leg, eye.last_leg],
                "intake_m": eye.intake,
                "points_m": [p.tolist() for p in (eye.first_tip, eye.left_point, eye.last_tip, eye.right_point)],
            }
        left, right = mouth_first(seam.left, seam.right)
        outline = next(loop for loop in loops if left[0] in loop)
        dart = shape_dart(positions, seam.left, seam.right, outline, tip_back=tip_back)
        legs = pull_back(positions[left], positions[right], tip_back)
    except InputError as reason:
        return {"not_drawn": str(reason)}
    if are_curved(*legs):
        # Along its curved legs, both from the border to the tip.
        left_end, right_end, tip = legs[0][0], legs[1][0], legs[0][-1]
        to_left, to_right = left_end - tip, right_end - tip
        return {
            "tip_back_m": tip_back,
            "curved": True,
            "leg_m": sum(polyline_length(leg) for leg in legs) / 2,
            "angle_deg": math.degrees(np.arctan2(abs(np.linalg.det([to_left, to_right])), to_left @ to_right)),
            "intake_m": float(np.linalg.norm(to_left - to_right)),
            "points_m": [p.tolist() for p in (left_end, tip, right_end)],
        }
    return {
        "tip_back_m": tip_back,
        "curved": False,
        "leg_m": dart.leg_length,
        "angle_deg": math.degrees(dart.angle),
        "intake_m": dart.intake,
        "points_m": [p.tolist() for p in (dart.left_end, dart.tip, dart.right_end, dart.fold_point)],
    }
