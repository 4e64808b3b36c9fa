"""Tapes of a scan, laid at its levels and landmarks (ISO 8559-1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core import FloatArray, InputError, unit
from warpflat.garment.mannequin.body_landmarks import ARM_PLACES, model_places, near_level, near_place
from warpflat.garment.mannequin.body_model import finer_body
from warpflat.garment.mannequin.measurements import size_tables
from warpflat.garment.mannequin.profiles import convex_girth
from warpflat.garment.mannequin.read_body import ReadBody
from warpflat.garment.mannequin.sampled import rows_around, smooth, summit
from warpflat.garment.mannequin.scan_levels import (
    ALIKE,
    ISO_HEIGHT,
    NOISE,
    TRUNK,
    ScanLevel,
    unsure_of,
)
from warpflat.garment.mannequin.scan_sections import BodySections, tape_around
from warpflat.garment.mannequin.slicer import UP, Slicer, largest
from warpflat.garment.mannequin.stand_body import StandingBody

__all__ = ["ScanMeasure", "body_measures", "guess_note", "missing_note"]

# How far from its landmark a wrist may be narrowest, on the mean body [m].
_WRIST = 0.013
# The fullest upper arm is sought from so far beyond the armpit, as a share of the stature: nearer sections hold a part of the shoulder.
_BEYOND_ARMPIT = 0.02
# So far up and down from the body's vertex an armpit's fold is sought, where the trunk's section grows by more, as shares of the stature.
_FOLD_OF_ARM, _LEAP_OF_ARM = 0.012, 0.02
# The palm's tape falls to this share where the fingers part.
_FINGERS_PART = 0.92
# A belly of the upper arm is one if it is so full, as a share of the fullest tape.
_BELLY = 0.98
# Vertices so near to a tape show whether the scan does, as a share of the stature.
_NEAR_TAPE = 0.012
# An arm above the level of its shoulder [rad] draws the shoulder's flesh into the tapes around it.
_OVERHEAD = np.radians(90.0)
# What the flesh of a body that sits does not show.
_SAT_ON = ("hip", "thigh", "knee")
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


def body_measures(read: ReadBody, neck: float, given: Mapping[str, float]) -> dict[str, ScanMeasure]:
    """Return the tapes that a scan has room for, by name, from the head down.

    Trunk, arms and legs are measured on the sections of the body; head, hands and feet on the scan itself.

    Args:
        read: the scan.
        neck: length of the neck base [m].
        given: landmarks [m] that are taken as they are.

    Raises:
        InputError: for a girth that no body has, with its place.
    """
    scan, body, laid, levels = read.scan, read.body, read.laid, read.found
    size, noise = body.stature, scan.noise
    found: dict[str, ScanMeasure] = {}
    head = _head(scan, size)
    if head is not None:
        found["head"] = head
    found["neck"] = ScanMeasure(
        height=0.5 * (levels["front_neck"].height + levels["side_neck"].height), girth=neck,
        guess=laid.unsure_near(near_level("side_neck")[0]),
    )  # fmt: skip
    # Raised arms lift the chest, and a bent trunk has folds: where a pose is undone, the trunk is that of the body standing.
    standing, t = (read.levels, read.stands.trunk) if laid.undone else (levels, body.trunk)
    armpit = standing["armpit"].height
    chest = np.flatnonzero((t.y > standing["underbust"].height) & (t.y <= armpit))
    row = int(chest[np.argmax(t.girth[chest])])
    guess = f"the chest grows fuller up to the armpits at {armpit:.3f} m" if row == chest[-1] else None
    found["chest, fullest"] = ScanMeasure(
        height=float(t.y[row]), girth=float(t.girth[row]), guess=guess or (_HOLED if t.holed[row] else None)
    )
    for name in TRUNK:
        at = standing[name].height
        holed = t.holed[int(np.argmin(np.abs(t.y - at)))]
        found[name] = ScanMeasure(
            height=levels[name].height, girth=float(np.interp(at, t.y, t.girth)),
            guess=levels[name].guess or (_HOLED if holed else None),
        )  # fmt: skip
    for side, arm in body.arms.items():
        places = {"elbow": arm.elbow, "wrist": arm.wrist}
        if "wrist" not in given:
            # It is narrowest near its landmark.
            ahead = np.arange(arm.wrist - _WRIST * size, arm.wrist + _WRIST * size, 0.0015 * size)
            places["wrist"] = float(ahead[np.argmin([arm.tape(s)[1] for s in ahead])])
        found[f"biceps {side}"] = _biceps(body, laid, side, noise)
        for name, s in places.items():
            height, girth = arm.tape(s)
            guess = laid.unsure_near(near_place(ARM_PLACES[name], side)[0]) or unsure_of(noise)
            found[f"{name} {side}"] = ScanMeasure(height=height, girth=girth, guess=guess)
        hand = _hand(scan, body, laid, side)
        if hand is not None and _is_possible("hand", hand.girth, size):
            found[f"hand {side}"] = hand
    for side in ("left", "right"):
        for name in ("thigh", "knee", "calf", "ankle"):
            level = levels[f"leg_{name}"]
            rows = np.flatnonzero(
                model_places().strips[f"leg {side}"] & (np.abs(body.vertices[:, 1] - level.height) < _NEAR_TAPE * size)
            )
            found[f"{name} {side}"] = ScanMeasure(
                height=level.height, girth=float(np.interp(level.height, body.legs.y, body.legs.girths[side])),
                guess=level.guess or laid.unsure_near(rows),
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
        if {top, bottom} <= set(TRUNK) and not low <= found[top].girth / found[bottom].girth <= high:
            raise InputError(
                f"scan: {top} {found[top].girth:.2f} m at {found[top].height:.2f} m above the floor does not go with {bottom} "
                f"{found[bottom].girth:.2f} m at {found[bottom].height:.2f} m: {low * found[bottom].girth:.2f} to "
                f"{high * found[bottom].girth:.2f} m is possible; repair the mesh or give landmarks"
            )
    if laid.together is not None:
        at = read.levels["hip"].height
        more = _around(laid.together, at) - _around(laid.vertices, at)
        found["hip, legs together"] = replace(found["hip"], girth=found["hip"].girth + more)
    for name, measure in found.items():
        if laid.raised > _OVERHEAD and name.startswith(("biceps", "elbow")) and measure.guess is None:
            found[name] = replace(measure, guess="the arms are raised above the shoulders")
        if scan.sits and name.startswith(_SAT_ON):
            found[name] = replace(measure, guess="the scan sits")
    return found


def _around(vertices: FloatArray, height: float) -> float:
    """Return the girth [m] of the finer body model's trunk at a height [m]."""
    return convex_girth(largest(Slicer(vertices, finer_body()[1]).cut(UP, height)).points)


def _is_possible(name: str, girth: float, stature: float) -> bool:
    low, high = _POSSIBLE.get(name.split(" ")[0], (0.0, np.inf))
    return low * stature <= girth <= high * stature


def guess_note(measures: Mapping[str, ScanMeasure], levels: Mapping[str, ScanLevel]) -> list[str]:
    """Return one note for each level of the trunk that is a guess, and one that names all other tapes that are; none without any."""
    notes = [
        f"{n} = {levels[n].height:.3f} m is a guess: {levels[n].guess}" for n in reversed(TRUNK) if levels[n].guess
    ]
    guesses = {n: m.guess for n, m in measures.items() if m.guess and not (n in TRUNK and levels[n].guess)}
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
        parts = [p for p in slicer.cut(UP, float(y)) if abs(p.points[:, 0].mean()) < 0.06 * stature]
        if not parts:
            return None
        part = largest(parts)
        widths.append(float(np.ptp(part.points[:, 0])))
        # Ears stand out of the head: below them its width leaps.
        if len(widths) > 12 and widths[-1] > 1.06 * max(widths[-5:-1]):
            break
        girths.append(convex_girth(part.points))
        holed.append(part.is_holed)
    values = smooth(np.array(girths), 1.0)
    row = int(np.argmax(values))
    if 0 < row < len(values) - 1:
        guess = _HOLED if holed[row] else None
        return ScanMeasure(height=summit(heights, values, row), girth=girths[row], guess=guess)
    return ScanMeasure(
        height=float(heights[row]), girth=girths[row], guess="the head grows fuller down to the ears or the hair"
    )


def _biceps(body: BodySections, laid: StandingBody, side: str, noise: float) -> ScanMeasure:
    """Return the fullest tape across the upper arm's bone, from beyond the armpit to the elbow.

    The muscle's belly counts before the shoulder's flesh at the upper end, which a lowered arm presses out.
    """
    arm, armpit, size = body.arms[side], body.armpits[side], body.stature
    # An arm joins the trunk below the first level section whose trunk leaps into the arm. Where none does near the body's vertex, as under
    # a web, it is that vertex.
    sign = float(np.sign(armpit[0]))
    before: FloatArray | None = None
    for y in np.arange(armpit[1] - _FOLD_OF_ARM * size, armpit[1] + _FOLD_OF_ARM * size, 0.001):
        parts = [p.points for p in body.scan.cut(UP, float(y))]
        trunk = [p for p in parts if p[:, 0].min() < 0.0 < p[:, 0].max()]
        if not trunk:
            break
        widest = max(trunk, key=lambda p: float(np.ptp(p[:, 0])))
        edge = widest[np.argmax(sign * widest[:, 0])]
        if before is not None and sign * (edge - before)[0] > _LEAP_OF_ARM * size:
            armpit = before
            break
        before = edge
    rows = (arm.s > 0.35 * arm.elbow) & (arm.s < arm.elbow - 0.02 * size)
    way = unit(arm.way[rows].mean(axis=0))
    middle = arm.line[rows].mean(axis=0)
    end = float((arm.frame(arm.elbow)[0] - middle) @ way) - 0.02
    along = np.arange(float((armpit - middle) @ way) + _BEYOND_ARMPIT * size, end, 0.002)
    tapes = [tape_around(arm.cut(middle + at * way, way), way) for at in along]
    if len(tapes) < 3:
        raise InputError(f"scan: no upper arm between the armpit at {armpit[1]:.2f} m and the elbow; give landmarks")
    girths = smooth(np.array([girth for _, girth in tapes]), 1.0)
    bellies = 1 + np.flatnonzero((girths[1:-1] >= girths[:-2]) & (girths[1:-1] > girths[2:]))
    bellies = bellies[girths[bellies] > _BELLY * girths.max()]
    row = int(bellies[np.argmax(girths[bellies])]) if len(bellies) else int(np.argmax(girths))
    heights = np.array([height for height, _ in tapes])
    alike = heights[rows_around(girths > girths[row] - max(ALIKE, NOISE * noise), row)]
    guess = (
        "the arm is as full a way up and down from there" if np.abs(alike - heights[row]).max() > ISO_HEIGHT else None
    )
    near = np.abs((body.vertices - middle) @ way - along[row]) < _NEAR_TAPE * size
    unsure = laid.unsure_near(np.flatnonzero(model_places().strips[f"arm {side}"] & near))
    return ScanMeasure(height=tapes[row][0], girth=tapes[row][1], guess=unsure or guess)


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
            fullest = max(((tape_around(p.points, axis), p.is_holed) for p in parts), key=lambda each: each[0][1])
            tapes.append((len(parts), *fullest))
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
    edges = unit(np.roll(corners, -1, axis=0) - corners)
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
    guess = _HOLED if holed else unsure_of(slicer.noise)
    return ScanMeasure(height=height, girth=girth, guess=guess)
