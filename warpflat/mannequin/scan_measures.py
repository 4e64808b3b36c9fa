"""Tape measures of a scan itself, at the places that ISO 8559-1 names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.core.errors import InputError
from warpflat.mannequin.profiles import convex_girth
from warpflat.mannequin.scan_arms import ScanArm, tape_around
from warpflat.mannequin.scan_legs import LegSections
from warpflat.mannequin.scan_levels import TrunkSections, leg_sections, smooth
from warpflat.mannequin.slicer import Slicer
from warpflat.mannequin.summit import summit

__all__ = ["ScanMeasure", "body_measures", "guess_note", "leg_levels", "missing_note"]

_TRUNK = ("bust", "underbust", "waist", "hip")
_UP = np.array([0.0, 1.0, 0.0])
# Height of the hip joints as a share of the stature (Drillis and Contini 1966).
_HIP_JOINT = 0.530
# The fullest upper arm is sought from so far beyond the armpit, the thigh's tape lies so far below the crotch, both as
# shares of the stature: nearer sections hold a part of the shoulder or of the seat.
_BEYOND_ARMPIT, _BELOW_CROTCH = 0.02, 0.03
# A belly of the upper arm is one if it is so full, as a share of the fullest tape.
_BELLY = 0.98
# The palm's tape falls to this share where the fingers part.
_FINGERS_PART = 0.92
# Shares of the crotch's height between which an ankle and a calf lie.
_ANKLE, _CALF = (0.10, 0.30), (0.32, 0.60)
# The knee lies so far above the leg's narrowest place over the calf; its crease is trusted so near to there, both as
# shares of the crotch's height. The fat of a knee moves the crease down by up to 0.05.
_OVER_NARROW, _KNEE_SURE = 0.075, 0.012
# On a noisy scan a cubic finds the calf over so much of the crotch's height up and down.
_WIDE = 0.12
# Girths [m] per metre of stature that bodies have, from infants to the heaviest.
_POSSIBLE = {
    "head": (0.25, 0.55), "biceps": (0.08, 0.40), "elbow": (0.07, 0.32), "wrist": (0.05, 0.20), "hand": (0.07, 0.22),
    "thigh": (0.17, 0.60), "knee": (0.13, 0.45), "calf": (0.12, 0.42), "ankle": (0.07, 0.28), "foot": (0.09, 0.24),
}  # fmt: skip


# Girths [m] that a tape does not tell apart, and how far ISO 20685 lets a scan's height and girth differ from a tape's [m].
_ALIKE = 0.001
_ISO_HEIGHT, _ISO_GIRTH = 0.004, 0.009

_HOLED = "it runs over a hole in the scan"


@dataclass(frozen=True, kw_only=True)
class ScanMeasure:
    """One tape around a scan.

    Attributes:
        height: of the tape's middle above the floor [m].
        girth: of the section's convex hull [m], as a tape bridges hollows.
        guess: why the place is a guess; None where the shape shows it.
    """

    height: float
    girth: float
    guess: str | None = None


def leg_levels(legs: LegSections) -> tuple[dict[str, float], dict[str, str]]:
    """Return heights [m] of knee, calf and ankle, the mean of both legs, and why some are guesses.

    Ankle: narrowest above the foot. Calf: fullest below the knee. Knee: over the kneecap and at the crease behind it,
    where the back of the leg is furthest inside the line from calf to thigh.

    Args:
        legs: their sections as scanned.
    """
    found = [_places_of_leg(legs, side) for side in ("left", "right")]
    guesses = {name: why for _, of_leg in found for name, why in of_leg.items()}
    return {name: 0.5 * (found[0][0][name] + found[1][0][name]) for name in found[0][0]}, guesses


def _places_of_leg(legs: LegSections, side: str) -> tuple[dict[str, float], dict[str, str]]:
    y, guesses = legs.y, {}
    # Smoothed little, or the calf, which is rounder above than below, would be moved.
    girth = smooth(legs.girths[side], 3.0 if legs.noise else 1.0)
    back = smooth(np.array([h[:, 1].min() for h in legs.hulls[side]]), 3.0)

    def extreme(name: str, values: FloatArray, between: tuple[float, float], share: float) -> float:
        low, high = between
        rows = np.flatnonzero((y > low) & (y < high))
        row = int(rows[np.argmin(values[rows])]) if len(rows) > 2 else -1
        if len(rows) > 2 and rows[0] < row < rows[-1]:
            return summit(y, values, row)
        guesses[name] = f"the legs do not show it; it is {share:g} of the crotch's height"
        return share * legs.crotch

    calf = extreme("calf", -girth, (_CALF[0] * legs.crotch, _CALF[1] * legs.crotch), 0.44)
    if legs.noise and "calf" not in guesses:
        calf = _fullest(y, legs.girths[side], calf, _WIDE * legs.crotch)
    ankle = extreme("ankle", girth, (_ANKLE[0] * legs.crotch, _ANKLE[1] * legs.crotch), 0.16)
    low, high = calf, 0.86 * legs.crotch
    line = np.interp(y, [low, high], np.interp([low, high], y, back))
    knee = extreme("knee", line - back, (low + 0.25 * (high - low), high - 0.25 * (high - low)), 0.63)
    below = np.flatnonzero((y > low + 0.1 * (high - low)) & (y < high))
    narrow = float(y[below[np.argmin(girth[below])]]) if len(below) else 0.0
    if abs(narrow + _OVER_NARROW * legs.crotch - knee) > _KNEE_SURE * legs.crotch:
        guesses.setdefault("knee", "the crease behind it and the narrowest place below it do not agree")
    return {"knee": knee, "calf": calf, "ankle": ankle}, guesses


def _fullest(y: FloatArray, girth: FloatArray, near: float, reach: float) -> float:
    """Return the height where the cubic that fits the girths within `reach` [m] is fullest, started from `near`.

    Noise moves the fullest of girths that differ by little; a cubic over more of the leg averages it.
    """
    for _ in range(4):
        rows = np.abs(y - near) < reach
        cubic = np.polynomial.Polynomial.fit(y[rows], girth[rows], 3)
        fine = np.linspace(y[rows][0], y[rows][-1], 200)
        near = 0.5 * (near + float(fine[int(np.argmax(cubic(fine)))]))
    return near


def body_measures(
    slicer: Slicer, trunk: TrunkSections, levels: Mapping[str, float], legs: LegSections, arms: Mapping[str, ScanArm],
    neck: float, notes: Sequence[str], *, fitted: bool = False,
) -> dict[str, ScanMeasure]:  # fmt: skip
    """Return the tapes that the scan has room for, by name, from the head down.

    Args:
        slicer: the upright scan.
        trunk: its sections as scanned.
        levels: heights [m] of the levels.
        legs: sections of the legs.
        arms: the sliced arms, by side.
        neck: length of the neck base [m].
        notes: what was found so far, guesses of the trunk's levels among it.
        fitted: whether the body is a model laid on the scan: its fingers and toes may not be the scan's.

    Raises:
        InputError: for a girth that no body has, with its place.
    """
    guessed = {note.split(" = ")[0]: note.partition(" is a guess: ")[2] for note in notes if " is a guess: " in note}
    found: dict[str, ScanMeasure] = {}
    head = _head(slicer, trunk.stature)
    if head is not None:
        found["head"] = head
    found["neck"] = ScanMeasure(height=0.5 * (levels["front_neck"] + levels["side_neck"]), girth=neck)
    for level in _TRUNK:
        height = _bust(trunk, levels) if level == "bust" and "bust" in guessed else levels[level]
        holed = trunk.holed[int(np.argmin(np.abs(trunk.y - height)))]
        found[level] = ScanMeasure(
            height=height, girth=float(np.interp(height, trunk.y, trunk.girth)),
            guess=guessed.get(level, _HOLED if holed else None),
        )  # fmt: skip
    together = _hip_legs_together(slicer, trunk, legs, levels["hip"])
    if together is not None:
        found["hip, legs together"] = ScanMeasure(height=levels["hip"], girth=together)
    for side, arm in arms.items():
        found |= {f"{name} {side}": measure for name, measure in _arm(arm, trunk, side).items()}
        hand = _hand(slicer, arm)
        # A stump of a hand, cut off by a hole, is none.
        if hand is not None and hand.girth > _POSSIBLE["hand"][0] * trunk.stature:
            found[f"hand {side}"] = hand
    crotch = _crotch(slicer, trunk)
    for side in ("left", "right"):
        found |= {
            f"{name} {side}": measure
            for name, measure in _leg(legs, side, crotch - _BELOW_CROTCH * trunk.stature).items()
        }
        foot = _foot(slicer, trunk.stature, side)
        if foot is not None:
            found[f"foot {side}"] = foot
    if fitted:
        ends = [name for name in found if name.startswith(("hand", "foot"))]
        found = {n: m for n, m in found.items() if n not in ends or _is_possible(n, m, trunk.stature)}
    _check(found, trunk.stature)
    return found


def guess_note(measures: Mapping[str, ScanMeasure], notes: Sequence[str]) -> list[str]:
    """Return one note that names the tapes whose places are guesses and that have no note of their own; none without any."""
    guesses = {n: m.guess for n, m in measures.items() if m.guess and not any(k.startswith(f"{n} = ") for k in notes)}
    if not guesses:
        return []
    names = {why: [n for n, w in guesses.items() if w == why] for why in guesses.values()}
    return ["guessed: " + "; ".join(f"{' and '.join(names[why])} ({why})" for why in names)]


def missing_note(measures: Mapping[str, ScanMeasure]) -> list[str]:
    """Return one note that names head, hands and feet that the scan does not show; none if all are there."""
    ends = ["head", *(f"{end} {side}" for end in ("hand", "foot") for side in ("left", "right"))]
    missing = [end for end in ends if end not in measures]
    if not missing:
        return []
    floor = "; heights count from its lowest point" if {"foot left", "foot right"} <= set(missing) else ""
    return [f"the scan shows no {' and no '.join(missing)}{floor}"]


def _is_possible(name: str, measure: ScanMeasure, stature: float) -> bool:
    low, high = _POSSIBLE.get(name.split(" ")[0], (0.0, np.inf))
    return low * stature <= measure.girth <= high * stature


def _check(found: Mapping[str, ScanMeasure], stature: float) -> None:
    for name, measure in found.items():
        low, high = _POSSIBLE.get(name.split(" ")[0], (0.0, np.inf))
        if not _is_possible(name, measure, stature):
            raise InputError(
                f"scan: {name} {measure.girth:.3f} m at {measure.height:.2f} m above the floor, of a body {stature:.2f} m tall: "
                f"{low * stature:.2f} to {high * stature:.2f} m is possible; repair the mesh there"
            )


def _bust(trunk: TrunkSections, levels: Mapping[str, float]) -> float:
    """Return the height where a chest that grows fuller up to the armpits is fullest; a belly is no chest."""
    middle = 0.5 * (levels["waist"] + levels["armpit"])
    rows = np.flatnonzero((trunk.y > middle) & (trunk.y <= levels["armpit"]))
    return float(trunk.y[rows[np.argmax(trunk.girth[rows])]])


def _head(slicer: Slicer, stature: float) -> ScanMeasure | None:
    """Return the fullest level tape around the head above the ears; None without a head."""
    heights = np.arange(0.985, 0.90, -0.0025) * stature
    girths: list[float] = []
    widths: list[float] = []
    holed: list[bool] = []
    for y in heights:
        parts = [p for p in slicer.cut(_UP, float(y)) if abs(p.points[:, 0].mean()) < 0.06 * stature]
        if not parts:
            return None
        largest = max(parts, key=lambda p: float(np.ptp(p.points[:, 0]) * np.ptp(p.points[:, 2])))
        part = largest.points[:, [0, 2]]
        widths.append(float(np.ptp(part[:, 0])))
        # Ears stand out of the head: below them its width leaps.
        if len(widths) > 12 and widths[-1] > 1.06 * max(widths[-5:-1]):
            break
        girths.append(convex_girth(part))
        holed.append(largest.is_holed)
    values = smooth(np.array(girths), 1.0)
    row = int(np.argmax(values))
    if row < len(values) - 1 and row > 0:
        guess = _HOLED if holed[row] else None
        return ScanMeasure(height=summit(heights, values, row), girth=girths[row], guess=guess)
    return ScanMeasure(
        height=float(heights[row]), girth=girths[row], guess="the head grows fuller down to the ears or the hair"
    )


def _hip_legs_together(slicer: Slicer, trunk: TrunkSections, legs: LegSections, hip: float) -> float | None:
    """Return the hip's girth [m] after the legs are turned plumb about the hip joints; None where they stand together.

    Flesh moves inwards by the legs' slope times its depth below the joints, in proportion to its distance from the
    midplane as far as the joints.
    """
    if legs.slope <= 0.01:
        return None
    parts = [p.points for p in slicer.cut(_UP, hip) if p.points[:, 0].min() < 0.0 < p.points[:, 0].max()]
    flat = max(parts, key=lambda p: float(np.ptp(p[:, 0])))[:, [0, 2]].copy()
    top = len(legs.y) - 1
    joint = 0.25 * float(sum(np.ptp(legs.hulls[side][top][:, 0]) for side in ("left", "right")))
    depth = max(0.0, _HIP_JOINT * trunk.stature - hip)
    flat[:, 0] -= legs.slope * depth * np.clip(flat[:, 0] / joint, -1.0, 1.0)
    return convex_girth(flat)


def _arm(arm: ScanArm, trunk: TrunkSections, side: str) -> dict[str, ScanMeasure]:
    armpit, x, z = trunk.armpits[side]
    elbow, wrist = arm.tape(arm.elbow), arm.tape(arm.wrist)
    wide = arm.tape(arm.wide)
    guess = "the arm is straight; it is a share of its length" if not arm.bent else None
    if guess is None and (abs(wide[0] - elbow[0]) > _ISO_HEIGHT or abs(wide[1] - elbow[1]) > _ISO_GIRTH):
        guess = "the arm bends in a bow, not at one place"
    return {
        "biceps": _biceps(arm, np.array([x, armpit, z]), _BEYOND_ARMPIT * trunk.stature),
        "elbow": ScanMeasure(height=elbow[0], girth=elbow[1], guess=guess),
        "wrist": ScanMeasure(height=wrist[0], girth=wrist[1]),
    }


def _biceps(arm: ScanArm, armpit: FloatArray, beyond: float) -> ScanMeasure:
    """Return the fullest tape across the upper arm's bone, from `beyond` [m] off the armpit to the elbow.

    The muscle's belly counts before the shoulder's flesh at the upper end, which a lowered arm presses out.
    """
    rows = (arm.shares > 0.2) & (arm.shares < arm.elbow - 0.04)
    if not rows.any():
        raise InputError(f"scan: no upper arm between the armpit at {armpit[1]:.2f} m and the elbow; give landmarks")
    way = arm.way[rows].mean(axis=0)
    way /= np.linalg.norm(way)
    middle = arm.line[rows].mean(axis=0)
    end = float((arm.frame(arm.elbow)[0] - middle) @ way) - 0.02
    tapes = []
    for at in np.arange(float((armpit - middle) @ way) + beyond, end, 0.002):
        tapes.append(tape_around(arm.cut(middle + at * way, way), way))
    girths = smooth(np.array([girth for _, girth in tapes]), 1.0)
    bellies = 1 + np.flatnonzero((girths[1:-1] >= girths[:-2]) & (girths[1:-1] > girths[2:]))
    bellies = bellies[girths[bellies] > _BELLY * girths.max()]
    row = int(bellies[np.argmax(girths[bellies])]) if len(bellies) else int(np.argmax(girths))
    heights = np.array([height for height, _ in tapes])
    alike = heights[_stretch(girths > girths[row] - _ALIKE, row)]
    guess = (
        "the arm is as full a way up and down from there" if np.abs(alike - heights[row]).max() > _ISO_HEIGHT else None
    )
    return ScanMeasure(height=tapes[row][0], girth=tapes[row][1], guess=guess)


def _stretch(rows: BoolArray, row: int) -> slice:
    """Return the stretch of true rows around `row`, which is true."""
    off = np.flatnonzero(~rows)
    before, after = off[off < row], off[off > row]
    return slice(int(before[-1]) + 1 if len(before) else 0, int(after[0]) if len(after) else len(rows))


def _hand(slicer: Slicer, arm: ScanArm) -> ScanMeasure | None:
    """Return the tape around the palm halfway from where the thumb parts from it to where the fingers part; None without a hand."""
    wrist, way = arm.frame(arm.wrist)
    beyond = arm.limb[(arm.limb - wrist) @ way > 0.0]
    if not len(beyond):
        return None
    reach = np.linalg.norm(beyond - wrist, axis=1)
    length = float(reach.max())
    if length < 0.18 * arm.reach:
        return None
    axis = (beyond[int(np.argmax(reach))] - wrist) / length
    counts: list[int] = []
    tapes: list[tuple[float, float]] = []
    holed = False
    for share in np.arange(0.30, 0.64, 0.01):
        at = wrist + share * length * axis
        parts = [p for p in slicer.cut(axis, float(at @ axis))
                 if np.linalg.norm(p.points.mean(axis=0) - at) < 0.6 * length and len(p.points) > 5]  # fmt: skip
        if parts:
            counts.append(len(parts))
            holed |= any(p.is_holed for p in parts)
            tapes.append(max((tape_around(p.points, axis) for p in parts), key=lambda t: t[1]))
    if not tapes:
        return None
    girths = np.array([girth for _, girth in tapes])
    thumb = next((i for i, count in enumerate(counts) if count > 1), None)
    first = thumb or 0
    # Where the fingers part, the girth of the largest part falls.
    falls = first + np.flatnonzero(girths[first + 1 :] < _FINGERS_PART * girths[first:-1])
    height, girth = tapes[(first + int(falls[0] if len(falls) else len(tapes) - 1)) // 2]
    guess = _HOLED if holed else "no thumb stands off the palm" if thumb is None else None
    return ScanMeasure(height=height, girth=girth, guess=guess)


def _crotch(slicer: Slicer, trunk: TrunkSections) -> float:
    """Return the height where the legs part [m], between two of the trunk's sections."""
    low, high = trunk.crotch, trunk.crotch + float(trunk.y[1] - trunk.y[0])
    for _ in range(5):
        middle = 0.5 * (low + high)
        apart = len(leg_sections(slicer, middle, trunk.stature)) == 2
        low, high = (middle, high) if apart else (low, middle)
    return low


def _leg(legs: LegSections, side: str, thigh: float) -> dict[str, ScanMeasure]:
    # Noise moves the places on each leg by itself: their mean moves less.
    places, guesses = leg_levels(legs) if legs.noise else _places_of_leg(legs, side)
    places = {"thigh": thigh, **places}
    return {
        name: ScanMeasure(height=y, girth=float(np.interp(y, legs.y, legs.girths[side])), guess=guesses.get(name))
        for name, y in places.items()
    }


def _foot(slicer: Slicer, stature: float, side: str) -> ScanMeasure | None:
    """Return the tape around the ball of a foot, where it is broadest across its length; None without a foot."""
    from scipy.spatial import ConvexHull, QhullError

    sign = 1.0 if side == "left" else -1.0
    low = slicer.vertices[(slicer.vertices[:, 1] < 0.03 * stature) & (sign * slicer.vertices[:, 0] > 0.0)][:, [0, 2]]
    try:
        corners = low[ConvexHull(low).vertices]
    except (QhullError, ValueError):
        return None
    axis = _long_way(corners)
    length = float(np.ptp(low @ axis[[0, 2]]))
    if length < 0.10 * stature:
        return None
    across = np.array([axis[2], 0.0, -axis[0]])
    start = float((low @ axis[[0, 2]]).min())
    best: tuple[float, FloatArray] | None = None
    holed = False
    for share in np.arange(0.60, 0.82, 0.01):
        parts = [p for p in slicer.cut(axis, start + share * length)
                 if p.points[:, 1].max() < 0.09 * stature and sign * p.points[:, 0].mean() > 0.0]  # fmt: skip
        if parts:
            holed |= any(p.is_holed for p in parts)
            points = np.concatenate([p.points for p in parts])
            breadth = float(np.ptp(points @ across))
            if best is None or breadth > best[0]:
                best = breadth, points
    if best is None:
        return None
    # The foot stands on the floor, also where a scan has no sole.
    guess = _HOLED if holed else None
    return ScanMeasure(height=0.5 * float(best[1][:, 1].max()), girth=tape_around(best[1], axis)[1], guess=guess)


def _long_way(corners: FloatArray) -> FloatArray:
    """Return the level unit direction, forward, along which the box around a hull's corners (x, z) is narrowest."""
    edges = np.roll(corners, -1, axis=0) - corners
    edges /= np.linalg.norm(edges, axis=1, keepdims=True)
    edges *= np.where(edges[:, 1:] < 0.0, -1.0, 1.0)
    breadth = np.ptp(corners @ np.array([edges[:, 1], -edges[:, 0]]), axis=0)
    along = edges[int(np.argmin(breadth))]
    return np.array([along[0], 0.0, along[1]])
