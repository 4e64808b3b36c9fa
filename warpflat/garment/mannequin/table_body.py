"""The blueprint of a dress form, a body that is known by its measurements only."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from warpflat.core import AXES, FloatArray, InputError, arc_lengths, polyline_length, reflected, resample, unit
from warpflat.garment.mannequin.blueprint import NOTCH, Blueprint, Profile, QuarterCurves
from warpflat.garment.mannequin.layout import QUARTERS, RING_LEVELS
from warpflat.garment.mannequin.measurements import Measurements, size_tables
from warpflat.garment.mannequin.profiles import Section, section_curve
from warpflat.garment.mannequin.table_legs import legs_from_measurements

__all__ = ["PRINCESS", "blueprint_from_measurements", "replace_chest"]

#: Where the princess lines run: distance from the centre as a share of the bust points', by level, front and back.
PRINCESS = {
    "ankle": (0.62, 0.62), "knee": (0.80, 0.80), "thigh": (1.05, 1.05), "hip": (1.05, 1.08), "abdomen": (0.92, 0.90),
    "waist": (0.82, 0.80), "underbust": (0.94, 0.92), "bust": (1.00, 1.00),
}  # fmt: skip
_SHOULDER_SLOPE = {"women": np.radians(21.0), "men": np.radians(22.0), "children": np.radians(21.0)}
# Where the side line passes the bust: this share of the way back from where it passes the underbust to the widest points.
_SIDE_BACK = 0.25
_ARM_ANGLE = np.radians(40.0)
# How far [m] the biceps' row lies beyond the underarm: the shortest sleeve ends there, with a seam to sew. On a small child it is the
# first of these shares of the arm, under a deep armhole the second one of the way to the elbow.
_SHORTEST_SLEEVE, _SHORT_SHARE, _TO_ELBOW = 0.092, 0.2, 0.5


def blueprint_from_measurements(measurements: Measurements) -> Blueprint:
    """Make the blueprint of a symmetric dress form to a set of measurements.

    Source of the cross-sections: ``data/sizes.toml``, sections of average statistical bodies.
    """
    profile = _profiles(measurements)
    quarters = _quarters(measurements, profile)
    # The upper end of the neck, a shorter and flatter curve above the neck base.
    base = _neckline(measurements)
    middle = base.mean(axis=0)
    top = middle + (base - middle) * np.array([0.90, 0.55, 0.98])
    return Blueprint(
        profile=profile,
        heights={level: measurements.heights[level] for level in RING_LEVELS},
        quarters=quarters,
        arms=_arms(measurements, quarters),
        legs=legs_from_measurements(measurements, profile),
        neck=measurements.lengths["neck"],
        collar=top + np.array([0.0, 0.115, 0.035]) * (measurements.lengths["neck"] / 0.37) * 0.62,
    )


def replace_chest(blueprint: Blueprint, measurements: Measurements) -> Blueprint:
    """Return the blueprint with shoulders and arms to other widths across chest and back; trunk and legs are as they were."""
    quarters = _quarters(measurements, blueprint.profile)
    return replace(blueprint, quarters=quarters, arms=_arms(measurements, quarters))


def _profiles(m: Measurements) -> Callable[[float], Profile]:
    """Return a function that gives the horizontal profile at any height [m] up to the bust."""
    from scipy.interpolate import PchipInterpolator

    sections = size_tables()["bodies"][m.body]["sections"]
    h = [m.heights[level] for level in RING_LEVELS]
    girth = [m.lengths[level] for level in RING_LEVELS]
    # A row above the bust, so that every curve knows that the bust is its crest; it never becomes part of the body.
    above = m.heights["bust"] + 0.6 * (m.heights["bust"] - m.heights["underbust"])
    y = np.array([*h, above])
    size = m.lengths["bust"]

    def column(key: str, top: float, scale: float) -> FloatArray:
        values = [sections[level][key] * scale for level in RING_LEVELS]
        return np.array([*values, values[-1] * top])

    def lengths(key: str, top: float) -> FloatArray:
        return column(key, top, 1.0) * np.array([*girth, girth[-1]])

    # A side seam climbs nearly plumb to the armhole, and a bust's widest points stand far behind those of the ribs.
    line = column("shift", 0.0, size / 100.0)
    line[-2:] = line[-3] + _SIDE_BACK * (line[-2] - line[-3])
    hip, abdomen, waist = (RING_LEVELS.index(level) for level in ("hip", "abdomen", "waist"))
    line[abdomen] = np.interp(y[abdomen], y[[hip, waist]], line[[hip, waist]])

    # Monotone between levels: no girth, width or depth swells beyond those measured above and below.
    smooth = PchipInterpolator(
        y,
        np.column_stack([
            [*girth, girth[-1] * 0.985], lengths("width", 0.985), lengths("depth", 0.96 * 0.985),
            column("area", 0.99, 1.0), column("front", 0.95, 1.0), column("shift", 0.0, size / 100.0),
            line,
        ]),
    )  # fmt: skip
    local = PchipInterpolator(
        y, np.column_stack([column("front_bump", 0.55, size / 100.0), column("back_bump", 1.0, size / 100.0)])
    )
    points = 0.5 * m.lengths["bust_points"]
    places = PchipInterpolator(h, np.array([PRINCESS[level] for level in RING_LEVELS]) * points)

    def profile(height: float) -> Profile:
        g, width, depth, area, front, shift, side_z = smooth(height)
        front_bump, back_bump = local(height)
        front_x, back_x = places(height)
        section = Section(
            width=width, depth=depth, area=float(round(area, 9)), front=front, shift=shift,
            front_bump=front_bump, back_bump=back_bump, bump_x=1.08 * points, bump_width=0.043 * size,
        )  # fmt: skip
        curve = section_curve(section)
        s = arc_lengths(curve, closed=True)
        half = len(curve) // 2
        near = slice(half // 4, half - half // 4)
        # Read between samples, or the line would jitter.
        side = float(np.interp(-side_z, -curve[near, 1], s[:-1][near]))
        ahead = float(np.interp(front_x, curve[: half // 2, 0], s[: half // 2]) / side)
        behind = float(
            np.interp(back_x, curve[half : half // 2 : -1, 0], s[half] - s[half : half // 2 : -1]) / (s[half] - side)
        )
        return Profile(
            curve=curve, side_left=side, centre_back=float(s[half]), side_right=float(s[-1] - side),
            girth=float(g),
            princess={"front-left": ahead, "back-left": behind, "back-right": behind, "front-right": ahead},
        )  # fmt: skip

    # The same heights are asked for again and again.
    return functools.lru_cache(maxsize=1024)(profile)


def _quarters(m: Measurements, profile: Callable[[float], Profile]) -> dict[str, QuarterCurves]:
    """Return neckline, shoulder, armhole and across-chest row of each quarter, to the measured widths and lengths."""
    from scipy.interpolate import CubicSpline

    h, size = m.heights, m.lengths["bust"] / 0.88
    neckline = _neckline(m)
    half = len(neckline) // 2
    quarter = half // 2
    side_neck = neckline[quarter]
    slope = _SHOULDER_SLOPE[m.body]
    along = np.array([np.cos(slope), -np.sin(slope), -0.045])
    tip = side_neck + m.lengths["shoulder"] * unit(along)
    bust = profile(h["bust"])
    bust_centre_front = np.array([0.0, h["bust"], bust.curve[0, 1]])
    bust_centre_back = np.array([0.0, h["bust"], bust.curve[len(bust.curve) // 2, 1]])
    side = resample(bust.curve, bust.side_left / polyline_length(bust.curve, closed=True), closed=True)
    under = np.array([side[0] + 0.001, h["underarm"], side[1] - 0.002])
    widest = float(bust.curve[np.argmax(bust.curve[:, 0]), 1]) - 0.002
    level = h["underarm"] + NOTCH * (tip[1] - h["underarm"])
    reach = {"front": 0.050 * size, "back": -0.053 * size}
    rise = (level - h["bust"]) / (neckline[0, 1] - h["bust"])
    start_front = np.array([0.0, level, (1 - rise) * bust_centre_front[2] + rise * neckline[0, 2] + 0.016 * size])
    start_back = np.array([0.0, level, min(bust_centre_back[2], neckline[half, 2] - 0.030 * size) - 0.005 * size])
    chest = {
        "front": _chest_row(start_front, widest + reach["front"], 0.5 * m.lengths["chest_width"], 0.0),
        "back": _chest_row(start_back, widest + reach["back"], 0.5 * m.lengths["back_width"], -0.010 * size),
    }

    curves: dict[str, QuarterCurves] = {}
    for face, line, centre in (
        ("front", neckline[: quarter + 1], np.array([bust_centre_front, start_front, neckline[0]])),
        ("back", neckline[quarter : half + 1][::-1], np.array([bust_centre_back, start_back, neckline[half]])),
    ):
        hole, notch = _armhole(chest[face][-1], chest["back" if face == "front" else "front"][-1], under, tip)
        spline = CubicSpline(arc_lengths(centre), centre)
        left = QuarterCurves(
            neckline=line, shoulder=np.linspace(side_neck, tip, 50), armhole=hole, notch=notch,
            chest=chest[face], centre=spline(np.linspace(0.0, polyline_length(centre), 100)),
        )  # fmt: skip
        curves[f"{face}-left"] = left
        flipped: dict[str, Any] = {
            name: reflected(line, AXES["+x"]) for name, line in vars(left).items() if name != "notch"
        }
        curves[f"{face}-right"] = replace(left, **flipped)
    return {name: curves[name] for name in QUARTERS}


def _armhole(notch: FloatArray, other: FloatArray, under: FloatArray, tip: FloatArray) -> tuple[FloatArray, float]:
    """Return half of the left armhole, from the shoulder point to the underarm, and the share of its length down to the notch.

    Args:
        notch: the end of this half's across-chest row on the armhole [m].
        other: that of the other half's row.
        under: the underarm point.
        tip: the shoulder point.
    """
    from scipy.interpolate import CubicSpline

    middle = 0.5 * (abs(notch[2] - under[2]) + abs(other[2] - under[2]))

    def scoop(point: FloatArray) -> FloatArray:
        at = 0.62 * point + 0.38 * under
        # On a parabola about the underarm point, wherever it lies between the notches: level there.
        at[1] = under[1] + 0.24 * ((point[2] - under[2]) / middle) ** 2 * (point[1] - under[1])
        return at

    def brow(point: FloatArray) -> FloatArray:
        at = 0.60 * point + 0.40 * tip
        at[2] = under[2] + 1.06 * (point[2] - under[2])
        return at

    points = np.array([tip, brow(notch), notch, scoop(notch), under, scoop(other), other, brow(other), tip])
    t = arc_lengths(points)
    spline = CubicSpline(t, points, bc_type="periodic")
    half = spline(np.linspace(0.0, t[4], 400))
    return half, polyline_length(spline(np.linspace(0.0, t[2], 400))) / polyline_length(half)


def _chest_row(start: FloatArray, end_z: float, length: float, swell: float) -> FloatArray:
    """Return the level row from the centre to the notch, `length` [m] long; `swell` [m] is added at the blade."""
    from scipy.optimize import brentq

    t = np.linspace(0.0, 1.0, 200)

    def row(width: float) -> FloatArray:
        z = start[2] + (end_z - start[2]) * t**2.6 + swell * np.sin(np.pi * np.clip(t / 0.9, 0.0, 1.0)) ** 2
        return np.column_stack([width * t, np.full_like(t, start[1]), z])

    if polyline_length(row(0.3 * length)) > length:
        raise InputError(
            f"measurements: {200 * length:.1f} cm across chest or back is too little for so deep a bust: wider chest_width or back_width, "
            "or nearer bust_points, would do"
        )
    width = brentq(lambda w: polyline_length(row(w)) - length, 0.3 * length, 1.2 * length)
    return row(float(width))


def _neckline(m: Measurements) -> FloatArray:
    """Return the closed neck base, from centre front over the left; its length is the neck measurement."""
    from scipy.optimize import brentq

    h, neck = m.heights, m.lengths["neck"]
    depth, middle = 0.255 * neck, -0.010 * neck / 0.37
    t = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    front, side, back = h["front_neck"], h["side_neck"], h["nape"]
    c1, c2 = 0.5 * (front - back), 0.5 * (0.5 * (front + back) - side)
    y = side + c2 + c1 * np.cos(t) + c2 * np.cos(2.0 * t)

    def loop(width: float) -> FloatArray:
        return np.column_stack([0.5 * width * np.sin(t), y, middle + 0.5 * depth * np.cos(t)])

    width = brentq(lambda w: polyline_length(loop(w), closed=True) - neck, 0.15 * neck, 0.6 * neck)
    return loop(float(width))


def _arms(m: Measurements, quarters: Mapping[str, QuarterCurves]) -> dict[str, dict[float, FloatArray]]:
    """Return the curves around both arms, which hang a little away from the body."""
    front, back = quarters["front-left"].armhole, quarters["back-left"].armhole
    middle = np.vstack([front, back]).mean(axis=0)
    tip, under = front[0], front[-1]
    # The chest is narrower than the back, so that the armhole looks a little forward; the arm leaves square to it.
    across = quarters["front-left"].chest[-1] - quarters["back-left"].chest[-1]
    axis = unit(np.array([np.sin(_ARM_ANGLE), -np.cos(_ARM_ANGLE), -np.sin(_ARM_ANGLE) * across[0] / across[2]]))
    # Underarm and overarm line of the sleeve begin where those of the armhole are: the sleeve is not wrung.
    up = unit((tip - under) - axis * float((tip - under) @ axis))
    ahead = np.cross(axis, up)
    ahead *= np.sign(ahead[2])
    start = float((tip - middle) @ axis)
    length = m.lengths["arm_length"]
    t = np.linspace(0.0, 2.0 * np.pi, 240, endpoint=False)

    def ring(at: float, girth: float, flat: float, forward: float) -> FloatArray:
        # From the underarm (-up) forward; `flat` is the depth over the height of the section.
        shape = np.outer(-np.cos(t), up) + flat * np.outer(np.sin(t), ahead)
        scale = girth / polyline_length(shape, closed=True)
        return middle + at * axis + forward * ahead + scale * shape

    elbow_at, under_at = start + 0.575 * length, float((under - middle) @ axis)
    biceps_at = under_at + min(_SHORTEST_SLEEVE, _SHORT_SHARE * length, _TO_ELBOW * (elbow_at - under_at))
    left = {
        0.0: ring(biceps_at, m.lengths["upper_arm"], 1.06, 0.0) + 0.006 * up,
        1.0: ring(elbow_at, m.lengths["elbow"], 1.0, 0.004),
        2.0: ring(start + length, m.lengths["wrist"], 1.15, 0.030),
    }
    return {"left": left, "right": {place: reflected(curve, AXES["+x"]) for place, curve in left.items()}}
