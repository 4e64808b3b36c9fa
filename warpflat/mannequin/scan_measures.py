"""Levels and tapes of a scan: at the landmarks of the body laid on it, moved to what is fullest or narrowest near them (ISO 8559-1)."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.mannequin.body_landmarks import ARM_PLACES, model_places, near_level, near_place, value_at
from warpflat.mannequin.measurements import size_tables
from warpflat.mannequin.profiles import convex_girth
from warpflat.mannequin.scan_pose import LEVELS_UP
from warpflat.mannequin.scan_sections import OUTLINES, BodySections, smooth, tape_around
from warpflat.mannequin.slicer import Slicer
from warpflat.mannequin.stand_body import StandingBody
from warpflat.mannequin.summit import summit

__all__ = ["ScanLevel", "ScanMeasure", "body_measures", "find_levels", "guess_note", "missing_note"]

_UP = np.array([0.0, 1.0, 0.0])
_TRUNK = ("bust", "underbust", "waist", "hip")
# So far up and down from its landmark the extreme of a level lies, as a share of the stature.
_REACH = {"waist": 0.036, "hip": 0.030, "calf": 0.016, "ankle": 0.013}
# Bust points lie a fifth of the bust apart. A fold bends the outline by so much over a way of one stature. It lies so far below the
# landmark at most, and so far above it; nearer than this both tell the same place, as shares of the stature.
_BUST_POINT, _FOLD, _FOLD_BELOW, _FOLD_ABOVE, _FOLD_OFF = 0.1, 14.0, 0.05, 0.01, 0.007
# Under a bust that hangs the tape lies where the girth leaps by more than this share from one section to the next.
_LEAP = 0.06
# More noise than this [m] moves a landmark by more than ISO 20685 allows.
_NOISE_SURE = 0.0012
# So far up and down the corner between neck and shoulder lies from its landmark, as a share of the stature.
_NECK = 0.014
# The crease behind the knee is sought so far from the knee, which is sure if the crease lies so near, as shares of the stature.
_CREASE, _KNEE_SURE = 0.03, 0.004
# How far from its landmark a wrist may be narrowest, on the mean body [m].
_WRIST = 0.013
# The waist lies so far below the underbust at least, as a share of the stature: a third as far as on the mean body.
_BELOW_UNDERBUST = 0.023
# How far below the armpits the bust may lie at most, as a share of the stature: the rows above it need this room.
_BELOW_ARMPIT = 0.006
# The fullest upper arm is sought from so far beyond the armpit, the thigh's tape lies so far below the crotch, both as
# shares of the stature: nearer sections hold a part of the shoulder or of the seat.
_BEYOND_ARMPIT, _BELOW_CROTCH = 0.02, 0.03
# So far up and down from the body's vertex an armpit's fold is sought, where the trunk's section grows by more, as shares of the stature.
_FOLD_OF_ARM, _LEAP_OF_ARM = 0.012, 0.02
# The palm's tape falls to this share where the fingers part.
_FINGERS_PART = 0.92
# A belly of the upper arm is one if it is so full, as a share of the fullest tape.
_BELLY = 0.98
# Girths [m] that a tape does not tell apart, and what noise of one metre adds to that; ISO 20685 lets a height differ by so much [m].
_ALIKE, _NOISE, _ISO_HEIGHT = 0.001, 0.5, 0.004
# A tape is a guess where the body model lies farther off the scan [m] in the mean, or the scan shows less than a share of it.
_FAR, _SHOWN = 0.015, 0.75
_HOLED = "it runs over a hole in the scan"
# Girths [m] per metre of stature that bodies have, from infants to the heaviest.
_POSSIBLE = {
    "head": (0.25, 0.55), "biceps": (0.08, 0.40), "elbow": (0.07, 0.32), "wrist": (0.05, 0.20), "hand": (0.07, 0.22),
    "thigh": (0.17, 0.60), "knee": (0.13, 0.45), "calf": (0.12, 0.42), "ankle": (0.07, 0.28), "foot": (0.09, 0.24),
}  # fmt: skip


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


@dataclass(frozen=True, kw_only=True)
class ScanLevel:
    """A height above the floor [m], and why it is a guess; None where the shape shows it."""

    height: float
    guess: str | None = None


def find_levels(
    body: BodySections, laid: StandingBody, noise: float, given: Mapping[str, float]
) -> dict[str, ScanLevel]:
    """Return the levels of trunk and legs, from low to high the closed ones, and of ``armpit``, ``front_neck``, ``side_neck``.

    Waist: narrowest near its landmark. Bust: fullest between the underbust and the armpits. Hip: where the seat stands out most near its
    landmark. Underbust and knee lie halfway between their landmarks and the fold or crease there, if that is near. Calf: fullest, ankle:
    narrowest, the mean of both legs.

    Args:
        body: the sections as scanned.
        laid: the body on the scan.
        noise: how far noise moved the scan's vertices before it was smoothed [m].
        given: landmarks [m] that are taken as they are.

    Raises:
        InputError: if the levels do not come in a body's order.
    """
    t, size = body.trunk, body.stature
    found: dict[str, ScanLevel] = {}

    def landmark(name: str, side: str = "left") -> float:
        return float(value_at(near_level(name, side), body.vertices[:, 1]))

    def least(
        name: str, y: FloatArray, values: FloatArray, around: float, lacking: str, below: float = np.inf
    ) -> ScanLevel:
        rows = np.flatnonzero((np.abs(y - around) < _REACH[name] * size) & (y < below))
        row = int(rows[np.argmin(values[rows])]) if len(rows) else 0
        if len(rows) < 3 or not rows[0] < row < rows[-1]:
            return ScanLevel(height=min(around, below), guess=f"{lacking}; it is where the body model has it")
        alike = y[_stretch(values < values[row] + _NOISE * noise, row)]
        moved = noise > 0.0 and float(np.abs(alike - y[row]).max()) > _ISO_HEIGHT
        return ScanLevel(height=summit(y, values, row), guess=_noisy(noise) if moved else None)

    found["armpit"] = ScanLevel(height=min(float(place[1]) for place in body.armpits.values()))
    armpit = given.get("armpit", found["armpit"].height)
    found["hip"] = least("hip", t.y, t.back, landmark("hip"), "the seat does not stand out")
    # Under a full bust the outline over the bust points bends forward in a fold, lower than on the mean body.
    at, bust = min(landmark("underbust"), armpit - 0.02 * size), landmark("bust")
    apart = _BUST_POINT * float(np.interp(bust, t.y, t.girth)) / size
    outline = smooth(np.array([np.interp(apart, OUTLINES, row) for row in t.outlines]), 2.0)
    bend = np.gradient(np.gradient(outline, t.y), t.y) * size
    below = np.flatnonzero((t.y > at - _FOLD_BELOW * size) & (t.y < at))
    leap = np.diff(t.girth[below]) / t.girth[below[:-1]]
    # The first fold from just above the landmark down: the next one lies between belly and waist.
    near = np.flatnonzero((t.y > at - _FOLD_BELOW * size) & (t.y < at + _FOLD_ABOVE * size))
    folds = near[(bend[near] > _FOLD) & (bend[near] >= bend[near - 1]) & (bend[near] > bend[near + 1])]
    if leap.max() > _LEAP:
        at = float(t.y[below[np.argmax(leap)]])
    elif len(folds):
        fold = summit(t.y, bend, int(folds[-1]))
        # Each is a few millimetres off the fold's middle by itself.
        at = 0.5 * (at + fold) if abs(fold - at) < _FOLD_OFF * size else fold
    found["underbust"] = ScanLevel(height=at, guess=_noisy(noise) if noise > _NOISE_SURE else None)
    # Over a belly, or under a bust that hangs, the narrowest place may be the underbust itself.
    around, chest = smooth(t.girth, 1.5 if noise else 0.75), given.get("underbust", at)
    lacking = "the trunk has no narrowest section below the underbust"
    found["waist"] = least("waist", t.y, around, landmark("waist"), lacking, chest - _BELOW_UNDERBUST * size)
    low, high = chest + 0.01 * size, armpit - _BELOW_ARMPIT * size
    rows = np.flatnonzero((t.y > low) & (t.y < high))
    row = int(rows[np.argmax(t.girth[rows])]) if len(rows) else 0
    above = (t.y > t.y[row]) & (t.y <= armpit - 0.003 * size)
    if not len(rows) or row == rows[-1]:
        found["bust"] = ScanLevel(height=high, guess=f"the chest grows fuller up to the armpits at {armpit:.3f} m")
    elif row == rows[0]:
        found["bust"] = ScanLevel(
            height=landmark("bust"), guess="the chest is nowhere fullest; it is where the body model has it"
        )
    elif t.girth[above].max(initial=0.0) > t.girth[row]:
        why = f"the chest is as full again at the armpits at {armpit:.3f} m"
        found["bust"] = ScanLevel(height=summit(t.y, t.girth, row), guess=why)
    else:
        full = (t.girth > t.girth[row] - _ALIKE) & (t.y > low) & (t.y <= armpit)
        own = _stretch(full, row)
        twice = full.sum() > own.stop - own.start
        found["bust"] = ScanLevel(
            height=summit(t.y, t.girth, row), guess="the chest is as full at another height" if twice else None
        )
    waist, hip = (given.get(name, found[name].height) for name in ("waist", "hip"))
    between = (t.y > hip + 0.38 * (waist - hip)) & (t.y < hip + 0.62 * (waist - hip))
    belly = float(t.y[between][np.argmax(smooth(t.front, 3)[between])]) if between.any() else 0.5 * (waist + hip)
    found["abdomen"] = ScanLevel(height=belly)
    # The outline turns from the shoulder into the neck where it is furthest inside the line between the two.
    low, at = landmark("front_neck"), landmark("side_neck")
    upper = np.flatnonzero((t.y > 0.80 * size) & (t.y < 0.91 * size))
    narrow = float(t.y[upper[np.argmin(t.girth[upper])]])
    y = t.y[(t.y >= armpit + 0.55 * (narrow - armpit)) & (t.y <= narrow)]
    wide = [np.concatenate([p.points[:, 0] for p in body.scan.cut(_UP, float(each))]) for each in y]
    half = smooth(np.array([0.5 * float(np.ptp(x)) for x in wide]), 1.0)
    inside = np.interp(y, [y[0], y[-1]], [half[0], half[-1]]) - half
    row = int(np.argmax(np.where(np.abs(y - at) < _NECK * size, inside, -np.inf)))
    beside = summit(y, inside, row) if 0 < row < len(y) - 1 else at
    found["front_neck"] = ScanLevel(height=low)
    found["side_neck"] = ScanLevel(height=float(np.clip(beside, low + 0.008 * size, low + 0.035 * size)))
    for name, fullest in (("knee", None), ("calf", True), ("ankle", False)):
        sides = []
        for side in ("left", "right"):
            if fullest is None:
                # Fat moves the skin over a knee: its crease behind, furthest inside the line from calf to thigh, then lies elsewhere.
                y, back = body.legs.y, smooth(np.array([hull[:, 1].min() for hull in body.legs.hulls[side]]), 3.0)
                calf, at = landmark("calf", side), landmark(name, side)
                ends = [calf, 0.86 * body.crotch]
                inside = back - np.interp(y, ends, np.interp(ends, y, back))
                row = int(np.argmax(np.where(np.abs(y - at) < _CREASE * size, inside, -np.inf)))
                crease = summit(y, inside, row)
                if abs(crease - at) > _KNEE_SURE * size:
                    sides.append(ScanLevel(height=at, guess="the crease behind it lies elsewhere"))
                else:
                    # Each is a few millimetres off the joint by itself.
                    guess = _noisy(noise) if noise > _NOISE_SURE else None
                    sides.append(ScanLevel(height=0.5 * (at + crease), guess=guess))
            else:
                # Smoothed little, or the calf, which is rounder above than below, would be moved.
                girth = smooth(body.legs.girths[side], 3.0 if noise else 1.0)
                values = -girth if fullest else girth
                sides.append(least(name, body.legs.y, values, landmark(name, side), "the legs do not show it"))
        guess = next((each.guess for each in sides if each.guess), None)
        found[f"leg_{name}"] = ScanLevel(height=0.5 * (sides[0].height + sides[1].height), guess=guess)
        if name != "calf":
            found[name] = found[f"leg_{name}"]
    found["leg_thigh"] = ScanLevel(height=body.crotch - _BELOW_CROTCH * size)
    found["thigh"] = ScanLevel(height=min(0.44 * size, body.crotch - 0.01 * size, hip - 0.05 * size))
    for name, height in given.items():
        # The thigh's level is that of a skirt, around both legs; a tape around one lies below the crotch.
        for level in (name, f"leg_{name}" if name != "thigh" else name):
            if level in found:
                found[level] = ScanLevel(height=height)
    for under, over in itertools.pairwise(LEVELS_UP):
        if found[over].height - found[under].height < 0.004 * size:
            raise InputError(
                f"scan: {over} ({found[over].height:.3f} m) does not lie above {under} ({found[under].height:.3f} m); "
                "give landmarks"
            )
    # A level is no surer than the body is there.
    for name in _TRUNK:
        if found[name].guess is None and name not in given:
            found[name] = ScanLevel(
                height=found[name].height, guess=laid.unsure_near(near_level(name)[0], _FAR, _SHOWN)
            )
    return found


def _noisy(noise: float) -> str:
    return f"the scan's noise of {1000.0 * noise:.1f} mm moves it"


def _stretch(rows: np.ndarray, row: int) -> slice:
    """Return the stretch of true rows around `row`, which is true."""
    off = np.flatnonzero(~rows)
    before, after = off[off < row], off[off > row]
    return slice(int(before[-1]) + 1 if len(before) else 0, int(after[0]) if len(after) else len(rows))


def body_measures(
    scan: Slicer,
    body: BodySections,
    laid: StandingBody,
    levels: Mapping[str, ScanLevel],
    neck: float,
    given: Mapping[str, float],
) -> dict[str, ScanMeasure]:
    """Return the tapes that the scan has room for, by name, from the head down.

    Args:
        scan: the upright scan, around which the tapes of head, hands and feet are laid.
        body: the sections of the body on it.
        laid: that body.
        levels: of trunk and legs.
        neck: length of the neck base [m].
        given: landmarks [m] that are taken as they are.

    Raises:
        InputError: for a girth that no body has, with its place.
    """
    t, size, noise = body.trunk, body.stature, scan.noise
    found: dict[str, ScanMeasure] = {}
    head = _head(scan, size)
    if head is not None:
        found["head"] = head
    found["neck"] = ScanMeasure(
        height=0.5 * (levels["front_neck"].height + levels["side_neck"].height), girth=neck,
        guess=laid.unsure_near(near_level("side_neck")[0], _FAR, _SHOWN),
    )  # fmt: skip
    for name in _TRUNK:
        level = levels[name]
        height = level.height
        if name == "bust" and level.guess:
            # A chest that grows fuller up to the armpits is fullest there.
            chest = np.flatnonzero((t.y > levels["underbust"].height) & (t.y <= levels["armpit"].height))
            height = float(t.y[chest[np.argmax(t.girth[chest])]])
        holed = t.holed[int(np.argmin(np.abs(t.y - height)))]
        found[name] = ScanMeasure(
            height=height, girth=float(np.interp(height, t.y, t.girth)),
            guess=level.guess or (_HOLED if holed else None),
        )  # fmt: skip
    for side, arm in body.arms.items():
        places = {"elbow": arm.elbow, "wrist": arm.wrist}
        if "wrist" not in given:
            # It is narrowest near its landmark.
            ahead = np.arange(arm.wrist - _WRIST * size, arm.wrist + _WRIST * size, 0.0015 * size)
            places["wrist"] = float(ahead[np.argmin([arm.tape(s)[1] for s in ahead])])
        found[f"biceps {side}"] = _biceps(body, side, noise)
        for name, s in places.items():
            height, girth = arm.tape(s)
            guess = laid.unsure_near(near_place(ARM_PLACES[name], side)[0], _FAR, _SHOWN)
            guess = guess or (_noisy(noise) if noise > _NOISE_SURE else None)
            found[f"{name} {side}"] = ScanMeasure(height=height, girth=girth, guess=guess)
        hand = _hand(scan, body, laid, side)
        if hand is not None and _is_possible("hand", hand.girth, size):
            found[f"hand {side}"] = hand
    for side in ("left", "right"):
        for name in ("thigh", "knee", "calf", "ankle"):
            level = levels[f"leg_{name}"]
            rows = np.flatnonzero(
                model_places().strips[f"leg {side}"] & (np.abs(body.vertices[:, 1] - level.height) < 0.012 * size)
            )
            found[f"{name} {side}"] = ScanMeasure(
                height=level.height, girth=float(np.interp(level.height, body.legs.y, body.legs.girths[side])),
                guess=level.guess or laid.unsure_near(rows, _FAR, _SHOWN),
            )  # fmt: skip
        foot = _foot(scan, size, side) if laid.shows(near_level("foot", side)[0]) else None
        if foot is not None and not _is_possible("foot", foot.girth, size):
            # On a floor the model's foot tells more.
            foot = _foot(body.slicer, size, side)
            foot = None if foot is None else replace(foot, guess="it is the body model's: the scan has a floor")
        if foot is not None and _is_possible("foot", foot.girth, size):
            found[f"foot {side}"] = foot
    for name, measure in found.items():
        low, high = _POSSIBLE.get(name.split(" ")[0], (0.0, np.inf))
        if not _is_possible(name, measure.girth, size):
            raise InputError(
                f"scan: {name} {measure.girth:.3f} m at {measure.height:.2f} m above the floor, of a body {size:.2f} m tall: "
                f"{low * size:.2f} to {high * size:.2f} m is possible; repair the mesh there"
            )
    for top, bottom, low, high in size_tables()["valid"]["ratio"].values():
        if {top, bottom} <= set(_TRUNK) and not low <= found[top].girth / found[bottom].girth <= high:
            raise InputError(
                f"scan: {top} {found[top].girth:.2f} m at {found[top].height:.2f} m above the floor does not go with {bottom} "
                f"{found[bottom].girth:.2f} m at {found[bottom].height:.2f} m: {low * found[bottom].girth:.2f} to "
                f"{high * found[bottom].girth:.2f} m is possible; repair the mesh or give landmarks"
            )
    return found


def _is_possible(name: str, girth: float, stature: float) -> bool:
    low, high = _POSSIBLE.get(name.split(" ")[0], (0.0, np.inf))
    return low * stature <= girth <= high * stature


def guess_note(measures: Mapping[str, ScanMeasure], levels: Mapping[str, ScanLevel]) -> list[str]:
    """Return one note for each level of the trunk that is a guess, and one that names all other tapes that are; none without any."""
    notes = [
        f"{n} = {levels[n].height:.3f} m is a guess: {levels[n].guess}" for n in reversed(_TRUNK) if levels[n].guess
    ]
    guesses = {n: m.guess for n, m in measures.items() if m.guess and not (n in _TRUNK and levels[n].guess)}
    names = {why: [n for n, w in guesses.items() if w == why] for why in guesses.values()}
    if guesses:
        notes.append("guessed: " + "; ".join(f"{' and '.join(names[why])} ({why})" for why in names))
    return notes


def missing_note(measures: Mapping[str, ScanMeasure]) -> list[str]:
    """Return one note that names head, hands and feet without a tape, as they are missing or of no possible size; none if all are there."""
    ends = ["head", *(f"{end} {side}" for end in ("hand", "foot") for side in ("left", "right"))]
    missing = [end for end in ends if end not in measures]
    if not missing:
        return []
    floor = "; heights count from its lowest point" if {"foot left", "foot right"} <= set(missing) else ""
    return [f"{' and '.join(missing)} could not be measured on the scan{floor}"]


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
    if 0 < row < len(values) - 1:
        guess = _HOLED if holed[row] else None
        return ScanMeasure(height=summit(heights, values, row), girth=girths[row], guess=guess)
    return ScanMeasure(
        height=float(heights[row]), girth=girths[row], guess="the head grows fuller down to the ears or the hair"
    )


def _fold_of_arm(body: BodySections, side: str) -> FloatArray:
    """Return the place [m] on the trunk's skin at which an arm joins it: below the first level section whose trunk leaps into the arm.

    Where none does near the body's vertex, as under a web, that vertex.
    """
    armpit, size = body.armpits[side], body.stature
    sign = float(np.sign(armpit[0]))
    before: FloatArray | None = None
    for y in np.arange(armpit[1] - _FOLD_OF_ARM * size, armpit[1] + _FOLD_OF_ARM * size, 0.001):
        parts = [p.points for p in body.scan.cut(_UP, float(y))]
        trunk = [p for p in parts if p[:, 0].min() < 0.0 < p[:, 0].max()]
        if not trunk:
            break
        largest = max(trunk, key=lambda p: float(np.ptp(p[:, 0])))
        edge = largest[np.argmax(sign * largest[:, 0])]
        if before is not None and sign * (edge - before)[0] > _LEAP_OF_ARM * size:
            return before
        before = edge
    return armpit


def _biceps(body: BodySections, side: str, noise: float) -> ScanMeasure:
    """Return the fullest tape across the upper arm's bone, from beyond the armpit to the elbow.

    The muscle's belly counts before the shoulder's flesh at the upper end, which a lowered arm presses out.
    """
    arm, armpit = body.arms[side], _fold_of_arm(body, side)
    rows = (arm.s > 0.35 * arm.elbow) & (arm.s < arm.elbow - 0.02 * body.stature)
    way = arm.way[rows].mean(axis=0)
    way /= np.linalg.norm(way)
    middle = arm.line[rows].mean(axis=0)
    end = float((arm.frame(arm.elbow)[0] - middle) @ way) - 0.02
    tapes = [
        tape_around(arm.cut(middle + at * way, way), way)
        for at in np.arange(float((armpit - middle) @ way) + _BEYOND_ARMPIT * body.stature, end, 0.002)
    ]
    if len(tapes) < 3:
        raise InputError(f"scan: no upper arm between the armpit at {armpit[1]:.2f} m and the elbow; give landmarks")
    girths = smooth(np.array([girth for _, girth in tapes]), 1.0)
    bellies = 1 + np.flatnonzero((girths[1:-1] >= girths[:-2]) & (girths[1:-1] > girths[2:]))
    bellies = bellies[girths[bellies] > _BELLY * girths.max()]
    row = int(bellies[np.argmax(girths[bellies])]) if len(bellies) else int(np.argmax(girths))
    heights = np.array([height for height, _ in tapes])
    alike = heights[_stretch(girths > girths[row] - max(_ALIKE, _NOISE * noise), row)]
    guess = (
        "the arm is as full a way up and down from there" if np.abs(alike - heights[row]).max() > _ISO_HEIGHT else None
    )
    return ScanMeasure(height=tapes[row][0], girth=tapes[row][1], guess=guess)


def _hand(scan: Slicer, body: BodySections, laid: StandingBody, side: str) -> ScanMeasure | None:
    """Return the tape around the palm halfway from where the thumb parts from it to where the fingers part; None without a hand."""
    places, arm = model_places(), body.arms[side]
    if not laid.shows(near_place(ARM_PLACES["hand"], side)[0]):
        return None
    wrist = arm.frame(arm.wrist)[0]
    own = scan.vertices[np.unique(scan.triangles[(laid.shown >= 0) & places.arms[side][laid.shown]])]
    beyond = own[(own - wrist) @ arm.way[-1] > 0.0]
    if not len(beyond):
        return None
    reach = np.linalg.norm(beyond - wrist, axis=1)
    axis = (beyond[np.argmax(reach)] - wrist) / reach.max()
    tapes: list[tuple[int, tuple[float, float], bool]] = []
    for at in wrist + np.arange(0.30, 0.64, 0.01)[:, None] * reach.max() * axis:
        parts = [p for p in scan.cut(axis, float(at @ axis))
                 if np.linalg.norm(p.points.mean(axis=0) - at) < 0.6 * reach.max() and len(p.points) > 5]  # fmt: skip
        if parts:
            largest = max(((tape_around(p.points, axis), p.is_holed) for p in parts), key=lambda each: each[0][1])
            tapes.append((len(parts), *largest))
    if not tapes:
        return None
    girths = np.array([tape[1] for _, tape, _ in tapes])
    thumb = next((i for i, (count, *_) in enumerate(tapes) if count > 1), None)
    first = thumb or 0
    # Where the fingers part, the girth of the largest part falls.
    falls = first + np.flatnonzero(girths[first + 1 :] < _FINGERS_PART * girths[first:-1])
    _, (height, girth), _ = tapes[(first + int(falls[0] if len(falls) else len(tapes) - 1)) // 2]
    holed = any(holed for *_, holed in tapes)
    guess = _HOLED if holed else "no thumb stands off the palm" if thumb is None else None
    return ScanMeasure(height=height, girth=girth, guess=guess)


def _foot(slicer: Slicer, stature: float, side: str) -> ScanMeasure | None:
    """Return the tape around the ball of a foot, where it is broadest across its length; None without a foot."""
    from scipy.spatial import ConvexHull, QhullError

    sign = 1.0 if side == "left" else -1.0
    low = slicer.vertices[(slicer.vertices[:, 1] < 0.03 * stature) & (sign * slicer.vertices[:, 0] > 0.0)][:, [0, 2]]
    try:
        corners = low[ConvexHull(low).vertices]
    except (QhullError, ValueError):
        return None
    # The length runs along which the box around the foot is narrowest.
    edges = np.roll(corners, -1, axis=0) - corners
    edges /= np.linalg.norm(edges, axis=1, keepdims=True)
    edges *= np.where(edges[:, 1:] < 0.0, -1.0, 1.0)
    breadth = np.ptp(corners @ np.array([edges[:, 1], -edges[:, 0]]), axis=0)
    along = edges[int(np.argmin(breadth))]
    axis = np.array([along[0], 0.0, along[1]])
    length = float(np.ptp(low @ along))
    if length < 0.10 * stature:
        return None
    across = np.array([axis[2], 0.0, -axis[0]])
    start = float((low @ along).min())
    tapes: list[tuple[float, float, float]] = []
    holed = False
    for share in np.arange(0.60, 0.82, 0.01):
        parts = [p for p in slicer.cut(axis, start + share * length)
                 if p.points[:, 1].max() < 0.09 * stature and sign * p.points[:, 0].mean() > 0.0]  # fmt: skip
        if parts:
            holed |= any(p.is_holed for p in parts)
            points = np.concatenate([p.points for p in parts])
            girth = tape_around(points, axis)[1]
            tapes.append((float(np.ptp(points @ across)), girth, 0.5 * float(points[:, 1].max())))
    if not tapes:
        return None
    _, girth, height = max(tapes)
    # The foot stands on the floor, also where a scan has no sole.
    guess = _HOLED if holed else _noisy(slicer.noise) if slicer.noise > _NOISE_SURE else None
    return ScanMeasure(height=height, girth=girth, guess=guess)
