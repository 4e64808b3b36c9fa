"""Levels of a scan: at the landmarks of the body laid on it, moved to what stands out most or is narrowest near them (ISO 8559-1)."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpflat.core import FloatArray, InputError
from warpflat.garment.mannequin.body_landmarks import height_of, near_level
from warpflat.garment.mannequin.measurements import BELOW_CROTCH
from warpflat.garment.mannequin.sampled import rows_around, smooth, summit
from warpflat.garment.mannequin.scan_pose import LEVELS_UP
from warpflat.garment.mannequin.scan_sections import OUTLINES, BodySections
from warpflat.garment.mannequin.slicer import UP
from warpflat.garment.mannequin.stand_body import StandingBody

__all__ = ["ALIKE", "BUST_POINTS", "ISO_HEIGHT", "NOISE", "TRUNK", "ScanLevel", "find_levels", "unsure_of"]

#: Levels of the trunk around which a tape is laid, from the top down.
TRUNK = ("bust", "underbust", "waist", "hip")
# More noise than this [m] moves a landmark by more than ISO 20685 allows.
_NOISE_SURE = 0.0012
#: Girths [m] that a tape does not tell apart, and what noise of one metre adds to that; ISO 20685 lets a height differ by so much [m].
ALIKE, NOISE, ISO_HEIGHT = 0.001, 0.5, 0.004
_NO_FOLD = "no fold shows under the bust"
# So far up and down from its landmark the extreme of a level lies, as a share of the stature.
_REACH = {"bust": 0.020, "waist": 0.036, "hip": 0.030, "calf": 0.016, "ankle": 0.013}
#: Bust points lie so far off the midplane, as shares of the bust's girth.
BUST_POINTS = 0.085, 0.125
# A fold under the bust is followed at this one.
_BUST_POINT = 0.1
# A fold bends the outline by so much over a way of one stature, and by so much under a bust that stands out. It lies so far below its
# landmark at most, and so far above it, as shares of the stature.
_FOLD, _SURE_FOLD, _FOLD_BELOW, _FOLD_ABOVE = 14.0, 45.0, 0.05, 0.01
# Nearer than this landmark and shape tell the same place, as a share of the stature.
_NEAR = 0.007
# Under a bust that hangs the tape lies where the girth leaps by more than this share from one section to the next.
_LEAP = 0.06
# So far up and down the corner between neck and shoulder lies from its landmark, as a share of the stature.
_NECK = 0.014
# The crease behind the knee is sought so far from the knee, which is sure if the crease lies so near, as shares of the stature.
_CREASE, _KNEE_SURE = 0.03, 0.004
# The waist lies so far below the underbust at least, as a share of the stature: a third as far as on the mean body.
_BELOW_UNDERBUST = 0.023
# How far below the armpits the bust may lie at most, as a share of the stature: the rows above it need this room.
_BELOW_ARMPIT = 0.006


@dataclass(frozen=True, kw_only=True)
class ScanLevel:
    """A height above the floor [m], and why it is a guess; None where the shape shows it."""

    height: float
    guess: str | None = None


def find_levels(
    body: BodySections, laid: StandingBody, noise: float, given: Mapping[str, float]
) -> dict[str, ScanLevel]:
    """Return the levels of trunk and legs, from low to high the closed ones, and of ``armpit``, ``front_neck``, ``side_neck``.

    Near their landmarks, waist: narrowest, hip: where the seat stands out most. Bust, underbust and knee: halfway between their landmarks
    and the bust's most prominent place, the fold under it and the crease behind the knee, if near. Calf: fullest, ankle: narrowest, the
    mean of both legs.

    Args:
        body: the sections as scanned.
        laid: the body on the scan.
        noise: how far noise moved the scan's vertices before it was smoothed [m].
        given: landmarks [m] that are taken as they are.

    Raises:
        InputError: if the levels do not come in a body's order.
    """
    size, found = body.stature, _trunk_levels(body, noise, given)
    for name in ("knee", "calf", "ankle"):
        sides, y = list[ScanLevel](), body.legs.y
        for side in ("left", "right"):
            if name != "knee":
                # Smoothed little, or the calf, which is rounder above than below, would be moved.
                girth = smooth(body.legs.girths[side], 3.0 if noise else 1.0)
                girth = -girth if name == "calf" else girth
                sides.append(_least(body, name, y, girth, noise, "the legs do not show it", side=side))
                continue
            # Fat moves the skin over a knee: its crease behind, furthest inside the line from calf to thigh, then lies elsewhere.
            back = smooth(np.array([hull[:, 1].min() for hull in body.legs.hulls[side]]), 3.0)
            ends = [height_of("calf", body.vertices, side), 0.86 * body.crotch]
            at = height_of("knee", body.vertices, side)
            inside = back - np.interp(y, ends, np.interp(ends, y, back))
            near = np.where(np.abs(y - at) < _CREASE * size, inside, -np.inf)
            crease = summit(y, inside, int(np.argmax(near)))
            if abs(crease - at) > _KNEE_SURE * size:
                sides.append(ScanLevel(height=at, guess="the crease behind it lies elsewhere"))
            else:
                # Each is a few millimetres off the joint by itself.
                sides.append(ScanLevel(height=0.5 * (at + crease), guess=unsure_of(noise)))
        guess = next((each.guess for each in sides if each.guess), None)
        found[name] = found[f"leg_{name}"] = ScanLevel(height=0.5 * (sides[0].height + sides[1].height), guess=guess)
    found["leg_thigh"] = ScanLevel(height=body.crotch - BELOW_CROTCH * size)
    hip = given.get("hip", found["hip"].height)
    found["thigh"] = ScanLevel(height=min(0.44 * size, body.crotch - 0.01 * size, hip - 0.05 * size))
    for name, height in given.items():
        # The thigh's level is that of a skirt, around both legs; a tape around one lies below the crotch.
        for level in (name, f"leg_{name}" if name != "thigh" else name):
            if level in found:
                found[level] = ScanLevel(height=height)
    for under, over in itertools.pairwise(name for name in LEVELS_UP if name in found):
        if found[over].height - found[under].height < 0.004 * size:
            raise InputError(
                f"scan: {over} ({found[over].height:.3f} m) does not lie above {under} ({found[under].height:.3f} m); "
                "give landmarks"
            )
    # A level is no surer than the body is there.
    for name in TRUNK:
        if found[name].guess is None and name not in given:
            found[name] = ScanLevel(height=found[name].height, guess=laid.unsure_near(near_level(name)[0]))
    return found


def _least(
    body: BodySections,
    name: str,
    y: FloatArray,
    values: FloatArray,
    noise: float,
    lacking: str,
    *,
    side: str = "left",
    below: float = np.inf,
) -> ScanLevel:
    """Return where values at some heights are least near a landmark, and below a height; the landmark if they are so nowhere within."""
    at = height_of(name, body.vertices, side)
    rows = np.flatnonzero((np.abs(y - at) < _REACH[name] * body.stature) & (y < below))
    row = int(rows[np.argmin(values[rows])]) if len(rows) else 0
    if len(rows) < 3 or not rows[0] < row < rows[-1]:
        return ScanLevel(height=min(at, below), guess=f"{lacking}; it is where the body model has it")
    alike = y[rows_around(values < values[row] + NOISE * noise, row)]
    moved = noise > 0.0 and float(np.abs(alike - y[row]).max()) > ISO_HEIGHT
    return ScanLevel(height=summit(y, values, row), guess=_noisy(noise) if moved else None)


def _halfway(body: BodySections, at: float, shown: float) -> float:
    """Return the height of what a landmark and the shape both tell: each is a few millimetres off by itself."""
    return 0.5 * (at + shown) if abs(shown - at) < _NEAR * body.stature else shown


def _trunk_levels(body: BodySections, noise: float, given: Mapping[str, float]) -> dict[str, ScanLevel]:
    """Return the levels from the hip up."""
    t, size, sigma = body.trunk, body.stature, 1.5 if noise else 0.75
    found = {"armpit": ScanLevel(height=min(float(place[1]) for place in body.armpits.values()))}
    armpit = given.get("armpit", found["armpit"].height)
    found["hip"] = _least(body, "hip", t.y, t.back, noise, "the seat does not stand out")
    # Below a full bust the outline over the bust points bends forward in a fold.
    bust, under = height_of("bust", body.vertices), min(height_of("underbust", body.vertices), armpit - 0.02 * size)
    apart = _BUST_POINT * float(np.interp(bust, t.y, t.girth)) / size
    outline = smooth(np.array([np.interp(apart, OUTLINES, row) for row in t.outlines]), 2.0)
    bend = np.gradient(np.gradient(outline, t.y), t.y) * size
    ribs = np.flatnonzero((t.y > under - _FOLD_BELOW * size) & (t.y < under))
    leap = np.diff(t.girth[ribs]) / t.girth[ribs[:-1]]
    # The first fold from just above the landmark down: the next one lies between belly and waist.
    near = np.flatnonzero((t.y > under - _FOLD_BELOW * size) & (t.y < under + _FOLD_ABOVE * size))
    folds = near[(bend[near] > _FOLD) & (bend[near] >= bend[near - 1]) & (bend[near] > bend[near + 1])]
    is_sure = leap.max() > _LEAP or (len(folds) and bend[folds[-1]] > _SURE_FOLD)
    if leap.max() > _LEAP:
        under = float(t.y[ribs[np.argmax(leap)]])
    elif len(folds):
        under = _halfway(body, under, summit(t.y, bend, int(folds[-1])))
    found["underbust"] = ScanLevel(height=under, guess=unsure_of(noise) if is_sure else _NO_FOLD)
    # Over a belly, or under a bust that hangs, the narrowest place may be the underbust itself.
    below = given.get("underbust", found["underbust"].height) - _BELOW_UNDERBUST * size
    lacking = "the trunk has no narrowest section below the underbust"
    found["waist"] = _least(body, "waist", t.y, smooth(t.girth, sigma), noise, lacking, below=below)
    # Bust points are the bust's most prominent places.
    points = np.linspace(*BUST_POINTS, 9) * float(np.interp(bust, t.y, t.girth)) / size
    ahead = smooth(np.array([np.interp(points, OUTLINES, row).max() for row in t.outlines]), sigma)
    shown = _least(body, "bust", t.y, -ahead, noise, "no bust stands out", below=armpit - _BELOW_ARMPIT * size)
    if found["underbust"].guess != _NO_FOLD:
        found["bust"] = ScanLevel(height=_halfway(body, bust, shown.height), guess=shown.guess)
    else:
        # A chest without a fold hardly stands out: its place is flat, and the model tells more.
        why = "no fold shows under it, and it stands out most elsewhere than the body model's"
        found["bust"] = ScanLevel(height=bust, guess=why if abs(shown.height - bust) > ISO_HEIGHT else shown.guess)
    waist, hip = (given.get(name, found[name].height) for name in ("waist", "hip"))
    between = (t.y > hip + 0.38 * (waist - hip)) & (t.y < hip + 0.62 * (waist - hip))
    belly = float(t.y[between][np.argmax(smooth(t.front, 3)[between])]) if between.any() else 0.5 * (waist + hip)
    found["abdomen"] = ScanLevel(height=belly)
    # The outline turns from the shoulder into the neck where it lies furthest inside the line between the two.
    low, beside = (height_of(name, body.vertices) for name in ("front_neck", "side_neck"))
    upper = np.flatnonzero((t.y > 0.80 * size) & (t.y < 0.91 * size))
    narrow = float(t.y[upper[np.argmin(t.girth[upper])]])
    y = t.y[(t.y >= armpit + 0.55 * (narrow - armpit)) & (t.y <= narrow)]
    half = smooth(np.array([0.5 * float(np.ptp(body.scan.points(UP, float(each))[:, 0])) for each in y]), 1.0)
    inside = np.interp(y, [y[0], y[-1]], [half[0], half[-1]]) - half
    row = int(np.argmax(np.where(np.abs(y - beside) < _NECK * size, inside, -np.inf)))
    beside = summit(y, inside, row) if 0 < row < len(y) - 1 else beside
    beside = float(np.clip(beside, low + 0.008 * size, low + 0.035 * size))
    found["front_neck"], found["side_neck"] = ScanLevel(height=low), ScanLevel(height=beside)
    return found


def _noisy(noise: float) -> str:
    return f"the scan's noise of {1000.0 * noise:.1f} mm moves it"


def unsure_of(noise: float) -> str | None:
    """Return why noise [m] makes a landmark a guess; None if it does not."""
    return _noisy(noise) if noise > _NOISE_SURE else None
