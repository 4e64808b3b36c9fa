"""The levels of a scanned body, found from its shape: trunk sections, armpits, neck, bust, waist, hip."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.core.errors import InputError
from warpflat.mannequin.slicer import Slice, Slicer
from warpflat.mannequin.summit import summit

__all__ = ["TrunkSections", "find_levels", "leg_sections", "smooth", "trunk_sections"]

_UP = np.array([0.0, 1.0, 0.0])
# Trunk, head and legs have their middles within this distance of the midplane, as a share of the stature; arms do not.
_REACH = 0.19
# No crotch lies higher, as a share of the stature.
_ABOVE_CROTCH = 0.58
# No neck of a body with a head is narrowest higher, as a share of the stature.
_NECK = 0.91
# How far below the armpits the bust may lie at most, as a share of the stature: the rows above it need this room.
_BELOW_ARMPIT = 0.006
# The girth leaps by more than this share from one section to the next.
_LEAP = 0.06
# Where outlines of the front run, as shares of the stature off the midplane; bust points lie a fifth of the bust apart.
_OUTLINES, _BUST_POINT = np.linspace(0.03, 0.08, 6), 0.1
# The outline is smoothed by so many rows. A fold bends it by so much over a way of one stature, a flat chest by half of it.
_FOLD_SIGMA, _FOLD = 2.0, 14.0
# Share of the way from waist to armpits where the fold lies on the mean of bodies that show one.
_UNDERBUST = 0.51


@dataclass(frozen=True, kw_only=True, eq=False)
class TrunkSections:
    """Horizontal sections of the trunk (of both legs together below the crotch), arms left out, from low to high.

    Attributes:
        stature: height of the scan [m].
        y: #S, heights [m].
        girth: #S, hull girth [m].
        length: #S, length of the section itself [m], hollows followed; of both legs below the crotch.
        area: #S, hull area [m2].
        left, right: #S, extent towards +x and -x [m].
        front, back: #S, extent forward and backward [m].
        front_centre, back_centre: #S, z of the surface near the midplane [m].
        apex: #S, distance of the foremost points from the midplane [m].
        outlines: #S by 6, z of the front at six distances from the midplane, the mean of left and right [m].
        hulls: for each section its hull, counter-clockwise seen from below, #P by 2 (x, z) [m].
        parts: for each section the points of the trunk, or those of both legs apart, each #P by 2 (x, z) [m].
        holed: #S, whether the section rests on closed or open holes.
        crotch: height below which the legs are apart [m].
        armpits: height at which the left and the right arm join the trunk [m], and the trunk's (x, z) there.
    """

    stature: float
    y: FloatArray
    girth: FloatArray
    length: FloatArray
    area: FloatArray
    left: FloatArray
    right: FloatArray
    front: FloatArray
    back: FloatArray
    front_centre: FloatArray
    back_centre: FloatArray
    apex: FloatArray
    outlines: FloatArray
    hulls: tuple[FloatArray, ...]
    parts: tuple[tuple[FloatArray, ...], ...]
    holed: BoolArray
    crotch: float
    armpits: Mapping[str, tuple[float, float, float]]


def trunk_sections(slicer: Slicer) -> TrunkSections:
    """Slice a scan that stands upright.

    Raises:
        InputError: if there is no trunk at some height.
    """
    from scipy.spatial import ConvexHull

    stature = float(slicer.vertices[:, 1].max())
    heights = np.arange(0.04, 0.93, 0.0025) * stature
    rows: list[list[float]] = []
    hulls: list[FloatArray] = []
    parts: list[tuple[FloatArray, ...]] = []
    holed: list[bool] = []
    crotch = 0.0
    for y in heights:
        chosen = leg_sections(slicer, float(y), stature)
        if not chosen:
            raise InputError(f"scan: nothing of the body at {y:.2f} m above the floor; its mesh is broken there")
        if len(chosen) == 2:
            crotch = float(y)
        parts.append(tuple(p.points[:, [0, 2]] for p in chosen))
        holed.append(any(p.is_holed for p in chosen))
        flat = np.concatenate(parts[-1])
        hull = ConvexHull(flat)
        centre = np.abs(flat[:, 0]) < 0.02 * stature
        z_front, z_back = float(flat[:, 1].max()), float(flat[:, 1].min())
        rows.append([
            hull.area, sum(p.length for p in chosen), hull.volume, flat[:, 0].max(), -flat[:, 0].min(), z_front, z_back,
            float(flat[centre, 1].max()) if centre.any() else z_front,
            float(flat[centre, 1].min()) if centre.any() else z_back,
            float(np.abs(flat[flat[:, 1] > z_front - 0.004 * stature][:, 0]).mean()),
            *_outlines(flat, _OUTLINES * stature),
        ])  # fmt: skip
        hulls.append(flat[hull.vertices])
    table = np.array(rows).T
    armpits = {
        "left": _armpit(slicer, heights, table[3], 1.0, stature),
        "right": _armpit(slicer, heights, table[4], -1.0, stature),
    }
    return TrunkSections(
        stature=stature, y=heights, girth=table[0], length=table[1], area=table[2], left=table[3], right=table[4],
        front=table[5], back=table[6], front_centre=table[7], back_centre=table[8], apex=table[9], outlines=table[10:].T,
        hulls=tuple(hulls), parts=tuple(parts), holed=np.array(holed), crotch=crotch, armpits=armpits,
    )  # fmt: skip


def _outlines(flat: FloatArray, x: FloatArray) -> FloatArray:
    """Return z [m] of the front of a section's points (x, z) at `x`, the mean of left and right."""
    front = flat[flat[:, 1] > 0.5 * (flat[:, 1].min() + flat[:, 1].max())]
    front = front[np.argsort(front[:, 0])]
    left, right = (np.interp(side * x, front[:, 0], front[:, 1]) for side in (1.0, -1.0))
    return np.asarray(0.5 * (left + right))


def leg_sections(slicer: Slicer, y: float, stature: float) -> list[Slice]:
    """Return the section of the trunk at a height `y` [m], or those of both legs; none where the mesh is broken.

    Two parts of similar size are the legs; what hangs between them at the crotch is smaller and belongs to neither.
    """
    parts = _whole([p for p in slicer.cut(_UP, y) if abs(_middle_x(p)) < _REACH * stature])
    near = [p for p in parts if len(p.points) > 8]
    near.sort(key=_box, reverse=True)
    legs = y < _ABOVE_CROTCH * stature and len(near) > 1 and _box(near[1]) > 0.5 * _box(near[0])
    return near[:2] if legs else near[:1]


def _whole(parts: list[Slice]) -> list[Slice]:
    """Return parts of a section, those on one side of the midplane joined that holes in the mesh have parted."""
    joined = [p for p in parts if p.closed]
    for side in (-1.0, 0.0, 1.0):
        torn = [p for p in parts if not p.closed and (0.0 if _straddles(p) else np.sign(_middle_x(p))) == side]
        if torn:
            points = np.concatenate([p.points for p in torn])
            patched = sum(p.patched for p in torn)
            joined.append(Slice(points=points, length=sum(p.length for p in torn), closed=False, patched=patched))
    return joined


def _middle_x(part: Slice) -> float:
    return 0.5 * float(part.points[:, 0].min() + part.points[:, 0].max())


def _box(part: Slice) -> float:
    """Return the area [m2] of the box around a horizontal section."""
    return float(np.ptp(part.points[:, 0]) * np.ptp(part.points[:, 2]))


def _straddles(part: Slice) -> bool:
    """Return whether a section lies on both sides of the midplane."""
    return bool(part.points[:, 0].min() < 0.0 < part.points[:, 0].max())


def _armpit(
    slicer: Slicer, y: FloatArray, reach: FloatArray, side: float, stature: float
) -> tuple[float, float, float]:
    """Return the place where an arm joins the trunk, (height, x, z) [m] just below it."""
    window = np.flatnonzero((y > 0.66 * stature) & (y < 0.84 * stature))
    jump = next((i for i in window if reach[i + 1] > 1.22 * reach[i]), None)
    where = "left" if side > 0 else "right"
    if jump is None:
        higher = [y[i] for i in range(window[-1] + 1, len(y) - 1) if reach[i + 1] > 1.22 * reach[i]]
        if higher:
            raise InputError(
                f"scan: its armpits lie at {higher[0] / stature:.3f} of its height, those of a body with a head at 0.66 to 0.84; "
                "the head is missing"
            )
        raise InputError(f"scan: no {where} armpit between 0.66 and 0.84 of the height; arms must stand off the body")
    low, high = float(y[jump]), float(y[jump + 1])
    point = np.zeros(3)
    for _ in range(8):
        middle = 0.5 * (low + high)
        trunk = max((p for p in slicer.cut(_UP, middle) if _straddles(p)), key=_box).points
        if float((side * trunk[:, 0]).max()) > 1.22 * reach[jump]:
            high = middle
        else:
            low = middle
            point = trunk[int(np.argmax(side * trunk[:, 0]))]
    if not point.any():
        trunk = max((p for p in slicer.cut(_UP, low) if _straddles(p)), key=_box).points
        point = trunk[int(np.argmax(side * trunk[:, 0]))]
    return low, float(point[0]), float(point[2])


def find_levels(t: TrunkSections, given: Mapping[str, float]) -> tuple[dict[str, float], list[str]]:
    """Return heights [m] of the closed levels and of ``armpit``, ``front_neck``, ``side_neck``.

    Waist: the narrowest girth between rib and hip bone; where a belly leaves none, the deepest hollow of the back.
    Bust: the fullest girth below the armpits. Underbust: the fold under it. Hip: where the seat stands out most. A level
    that the shape does not show is a guess, and a note says so.

    Args:
        t: the sections.
        given: landmarks that are taken as they are.

    Raises:
        InputError: if the levels do not come in a body's order.

    Source: ISO 8559-1, which names the places of the tapes.
    """
    h = t.stature
    _check_head(t)
    notes: list[str] = []
    levels: dict[str, float] = {}
    levels["armpit"] = min(t.armpits["left"][0], t.armpits["right"][0])
    levels["waist"] = given.get("waist") or _waist(t, levels["armpit"], notes)
    levels["bust"] = given.get("bust") or _bust(t, levels["waist"], levels["armpit"], notes)
    levels["hip"] = given.get("hip") or _hip(t, levels["waist"], notes)
    front = (t.y < levels["waist"] - 0.25 * (levels["waist"] - levels["hip"])) & (
        t.y > levels["waist"] - 0.75 * (levels["waist"] - levels["hip"])
    )
    belly = float(t.y[front][np.argmax(smooth(t.front, 3)[front])])
    levels["abdomen"] = float(np.clip(belly, levels["waist"] - 0.62 * (levels["waist"] - levels["hip"]),
                                      levels["waist"] - 0.38 * (levels["waist"] - levels["hip"])))  # fmt: skip
    levels["underbust"] = given.get("underbust") or _underbust(
        t, levels["waist"], levels["bust"], levels["armpit"], notes
    )
    levels["thigh"] = min(0.44 * h, t.crotch - 0.01 * h, levels["hip"] - 0.05 * h)
    levels["knee"], levels["ankle"] = 0.28 * h, 0.06 * h
    levels["leg_thigh"], levels["leg_knee"] = t.crotch - 0.03 * h, levels["knee"]
    levels["leg_calf"], levels["leg_ankle"] = 0.205 * h, levels["ankle"]
    levels["front_neck"], levels["side_neck"] = _neck(t, levels["armpit"])
    for name, height in given.items():
        levels[name] = height
        notes.append(f"{name} was given: {height:.3f} m")
    order = [
        "ankle",
        "knee",
        "thigh",
        "hip",
        "abdomen",
        "waist",
        "underbust",
        "bust",
        "armpit",
        "front_neck",
        "side_neck",
    ]
    for low, high in itertools.pairwise(order):
        if levels[high] - levels[low] < 0.004 * h:
            raise InputError(
                f"scan: {high} ({levels[high]:.3f} m) does not lie above {low} ({levels[low]:.3f} m); give landmarks"
            )
    return levels, notes


def smooth(values: FloatArray, sigma: float) -> FloatArray:
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(values, sigma, mode="nearest"))


def _waist(t: TrunkSections, armpit: float, notes: list[str]) -> float:
    """Return the height of the narrowest girth between rib and hip bone."""
    window = np.flatnonzero((t.y > 0.565 * t.stature) & (t.y < min(0.69 * t.stature, armpit - 0.06 * t.stature)))
    for values, words in (
        (smooth(t.girth, 1.5), ""),
        (-smooth(t.back_centre, 2.0), "the trunk has no narrowest section; it is where the back is hollow"),
    ):
        row = int(window[np.argmin(values[window])])
        if window[0] < row < window[-1]:
            waist = summit(t.y, values, row)
            if words:
                notes.append(f"waist = {waist:.3f} m is a guess: {words}")
            return waist
    guess = 0.62 * t.stature
    notes.append(f"waist = {guess:.3f} m is a guess: neither girth nor back shows one; it is 0.62 of the stature")
    return guess


def _bust(t: TrunkSections, waist: float, armpit: float, notes: list[str]) -> float:
    """Return the height where the chest is fullest below the armpits (ISO 8559-1)."""
    low, high = waist + 0.45 * (armpit - waist), armpit - _BELOW_ARMPIT * t.stature
    rows = np.flatnonzero((t.y > low) & (t.y < high))
    if len(rows) < 3:
        raise InputError(f"scan: no room for a bust between waist ({waist:.3f} m) and armpits ({armpit:.3f} m)")
    row = int(rows[np.argmax(t.girth[rows])])
    if row < rows[-1]:
        bust = summit(t.y, t.girth, row)
        above = (t.y > t.y[row]) & (t.y <= armpit)
        if t.girth[above].max(initial=0.0) > t.girth[row]:
            notes.append(f"bust = {bust:.3f} m is a guess: the chest is as full again at the armpits at {armpit:.3f} m")
        return bust
    notes.append(f"bust = {high:.3f} m is a guess: the chest grows fuller up to the armpits at {armpit:.3f} m")
    return high


def _underbust(t: TrunkSections, waist: float, bust: float, armpit: float, notes: list[str]) -> float:
    """Return the height of the fold under the bust: where the outline over the bust point bends forward most."""
    # Under a hanging bust the tape lies where the girth leaps.
    below = np.flatnonzero((t.y > waist) & (t.y < bust))
    leap = np.diff(t.girth[below]) / t.girth[below[:-1]] if len(below) > 1 else np.zeros(1)
    if leap.max() > _LEAP:
        return float(t.y[below[int(np.argmax(leap))]])
    apart = _BUST_POINT * float(np.interp(bust, t.y, t.girth)) / t.stature
    outline = smooth(np.array([np.interp(apart, _OUTLINES, row) for row in t.outlines]), _FOLD_SIGMA)
    bend = np.gradient(np.gradient(outline, t.y), t.y) * t.stature
    least, most = waist + 0.25 * (armpit - waist), min(bust - 0.01 * t.stature, armpit - 0.03 * t.stature)
    rows = np.flatnonzero((t.y > least) & (t.y < most))
    row = int(rows[np.argmax(bend[rows])]) if len(rows) else 0
    if not len(rows) or not rows[0] < row < rows[-1]:
        guess, why = (
            min(waist + _UNDERBUST * (armpit - waist), most),
            f"it is {_UNDERBUST:g} of the way from waist to armpits",
        )
    elif bend[row] > _FOLD:
        return summit(t.y, bend, row)
    else:
        guess, why = summit(t.y, bend, row), "it is where the front bends most"
    notes.append(f"underbust = {guess:.3f} m is a guess: no fold shows under the bust; {why}")
    return guess


def _hip(t: TrunkSections, waist: float, notes: list[str]) -> float:
    """Return the height where the seat stands out most (ISO 8559-1)."""
    low, high = t.crotch + 0.01 * t.stature, waist - 0.05 * t.stature
    rows = np.flatnonzero((t.y > low) & (t.y < high))
    if len(rows) < 9:
        raise InputError(
            f"scan: waist ({waist:.3f} m) does not lie above the crotch ({t.crotch:.3f} m); give landmarks"
        )
    # Not smoothed: the seat is rounder above than below, and smoothing would lower it.
    seat = int(rows[np.argmin(t.back[rows])])
    if rows[0] < seat < rows[-1] and t.back[rows].max() - t.back[seat] > 0.01 * t.stature:
        return summit(t.y, t.back, seat)
    guess = max(0.52 * t.stature, t.crotch + 0.03 * t.stature)
    notes.append(f"hip = {guess:.3f} m is a guess: the seat does not stand out between crotch and waist")
    return guess


def _check_head(t: TrunkSections) -> None:
    """See that a head stands over the neck: levels are sought at shares of the stature.

    Raises:
        InputError: the scan is narrowest too near to its top.
    """
    rows = np.flatnonzero(t.y > max(a[0] for a in t.armpits.values()))
    neck = float(t.y[rows[np.argmin(t.area[rows])]])
    if neck > _NECK * t.stature:
        raise InputError(
            f"scan: it is narrowest at {neck:.2f} m, {neck / t.stature:.2f} of its height; a neck lies at 0.80 to {_NECK:g}: "
            "the head is missing, or a part of it"
        )


def _neck(t: TrunkSections, armpit: float) -> tuple[float, float]:
    """Return heights of the front neck point (the pit over the breastbone) and the side neck point.

    Both are where an outline turns from the chest or the shoulder into the neck: the point furthest inside the chord.
    """
    window = (t.y > 0.80 * t.stature) & (t.y < 0.91 * t.stature)
    narrow = float(t.y[window][np.argmin(smooth(t.area, 1.0)[window])])

    def corner(values: FloatArray, low: float, high: float) -> float:
        rows = (t.y >= low) & (t.y <= high)
        y, v = t.y[rows], smooth(values, 1.0)[rows]
        chord = v[0] + (v[-1] - v[0]) * (y - y[0]) / (y[-1] - y[0])
        return float(y[int(np.argmax(chord - v))])

    shoulder = armpit + 0.55 * (narrow - armpit)
    front = corner(t.front_centre, armpit + 0.25 * (narrow - armpit), narrow)
    half = 0.5 * (t.left + t.right)
    side = corner(half, shoulder, narrow)
    front = min(front, narrow - 0.012 * t.stature)
    return front, float(np.clip(side, front + 0.008 * t.stature, front + 0.035 * t.stature))
