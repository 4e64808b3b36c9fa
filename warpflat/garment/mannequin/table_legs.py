"""Crotch curve and legs of a dress form, from its measurements."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from warpflat.core import FloatArray, arc_lengths, polyline_length, resample
from warpflat.garment.mannequin.blueprint import LegCurves, LegProfile, Profile
from warpflat.garment.mannequin.layout import LEG_LEVELS, LEG_LINES
from warpflat.garment.mannequin.measurements import Measurements
from warpflat.garment.mannequin.profiles import Section, convex_girth, section_curve

__all__ = ["AROUND_LEG", "crotch_curve", "legs_from_measurements", "profile_of_curve"]

# Width of a leg's section as a share of its girth, and its area as a share of width times depth, down the leg.
_WIDTH = {"leg_thigh": 0.300, "leg_knee": 0.305, "leg_calf": 0.310, "leg_ankle": 0.295}
_AREA = 0.80
#: Places around a leg.
AROUND_LEG = 240
# Room [m] between the legs' insides and the midplane, and between their outsides and the tube around both.
_BETWEEN, _INSIDE = 0.002, 0.001
# The crotch point divides the length of the crotch curve as front and back fork do.
_POINT = 0.38
# How far the inseam runs ahead of the leg's innermost points below the thigh, as a share of the girth.
_INSEAM_AHEAD = 0.02
# How much wider than the mean the columns next to the inseam are at the thigh.
_SPREAD = 0.6


def legs_from_measurements(m: Measurements, profile: Callable[[float], Profile]) -> LegCurves:
    """Return crotch curve and legs to the measured girths, within the tube around both legs.

    Args:
        m: the measurements.
        profile: the tube's profile at a height [m].
    """
    from scipy.interpolate import PchipInterpolator
    from scipy.optimize import brentq

    def miss(depth: float, width: float, girth: float) -> float:
        section = Section(width=width, depth=depth, area=_AREA, front=0.5, shift=0.0)
        return convex_girth(section_curve(section, AROUND_LEG)) - girth

    hip = profile(m.heights["hip"])
    front, back = float(hip.curve[0, 1]), float(hip.curve[len(hip.curve) // 2, 1])
    crotch = crotch_curve(m.heights["hip"], m.heights["crotch"], front, back)
    point = float(resample(crotch, _POINT)[2])
    heights = {level: m.heights[level] for level in LEG_LEVELS[1:]}
    order = LEG_LEVELS[:0:-1]
    y = np.array([heights[level] for level in order])
    rows = []
    for level in order:
        girth = m.lengths[f"{LEG_LINES[level]}_girth"]
        tube = profile(heights[level]).curve
        outside = 0.5 * float(np.ptp(tube[:, 0])) - _INSIDE
        width = min(_WIDTH[level] * girth, outside - _BETWEEN)
        z = 0.5 * float(tube[:, 1].max() + tube[:, 1].min())
        ahead = _INSEAM_AHEAD * girth if level != "leg_thigh" else float(np.clip(point - z, -0.1 * girth, 0.1 * girth))
        # A tape around the section of that width and depth reads the girth.
        depth = float(brentq(miss, 0.02 * girth, 0.6 * girth, args=(width, girth), xtol=1e-6))
        rows.append([girth, width, depth, outside - 0.5 * width, z, ahead])
    smooth = PchipInterpolator(y, np.array(rows))

    @functools.cache
    def left(height: float) -> LegProfile:
        girth, width, depth, x, z, ahead = smooth(height)
        curve = section_curve(Section(width=width, depth=depth, area=_AREA, front=0.5, shift=0.0), AROUND_LEG)
        # `section_curve` runs from the front over the body's left: the left leg's innermost point is three quarters around.
        inseam = 0.75 + ahead / polyline_length(curve, closed=True)
        curve = resample(curve, inseam + np.arange(AROUND_LEG) / AROUND_LEG, closed=True) + np.array([x, z])
        down = (heights["leg_thigh"] - height) / (heights["leg_thigh"] - heights["leg_knee"])
        return profile_of_curve(curve, float(girth), max(0.0, 1.0 - down), float(z))

    def leg(side: str, height: float) -> LegProfile:
        found = left(height)
        return found if side == "left" else replace(found, curve=found.curve * np.array([-1.0, 1.0]))

    return LegCurves(heights=heights, profile=leg, crotch=crotch, point=_POINT)


def profile_of_curve(curve: FloatArray, girth: float, spread: float, outseam_z: float) -> LegProfile:
    """Return the profile of a leg.

    Args:
        curve: #P by 2, (x, z) [m], from the inseam forward.
        girth: what a tape reads around it [m].
        spread: 1 at the thigh, where the columns of the crotch curve arrive, 0 from the knee down.
        outseam_z: z [m] of the outseam, on the outer side.
    """
    s = arc_lengths(curve, closed=True)
    outside = slice(int(np.argmax(curve[:, 1])), int(np.argmin(curve[:, 1])) + 1)
    outseam = float(np.interp(-outseam_z, -curve[outside, 1], s[:-1][outside]) / s[-1])
    return LegProfile(
        curve=curve, outseam=outseam, girth=girth, spread=_SPREAD * spread,
    )  # fmt: skip


def crotch_curve(hip: float, crotch: float, front: float, back: float) -> FloatArray:
    """Return the curve under the body from centre front to centre back, half an ellipse, #P by 3 [m].

    Args:
        hip, crotch: heights [m] of its ends and of its lowest point.
        front, back: z [m] of its ends.
    """
    t = np.linspace(0.0, np.pi, 200)
    z = 0.5 * (front + back) + 0.5 * (front - back) * np.cos(t)
    return np.column_stack([np.zeros_like(t), hip - (hip - crotch) * np.sin(t), z])
