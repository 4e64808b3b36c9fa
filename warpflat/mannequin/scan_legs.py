"""Legs of a scanned body, for the grid."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.polyline import arc_lengths, resample
from warpflat.mannequin.blueprint import LegCurves, LegProfile, Profile
from warpflat.mannequin.closest import Closest
from warpflat.mannequin.layout import LEG_LEVELS
from warpflat.mannequin.rays import ray_radii
from warpflat.mannequin.scan_sections import BodySections
from warpflat.mannequin.table_legs import crotch_curve, profile_of_curve

__all__ = ["leg_curves"]

_COUNT, _HARMONICS, _UP_SIGMA = 240, 16, 1.5
# The outseam lies in the middle of what is within so much [m] of the outermost, smoothed along the leg [rows].
_OUTERMOST, _OUTSEAM_SIGMA = 0.004, 6.0
# Share of the crotch curve's length ahead of the crotch point.
_POINT = 0.40


def leg_curves(body: BodySections, levels: Mapping[str, float], hip: Profile) -> LegCurves:
    """Return crotch curve and legs for the grid.

    Args:
        body: its sections.
        levels: heights [m], the leg levels among them.
        hip: the trunk's profile at the hip.
    """
    from scipy.ndimage import gaussian_filter1d

    legs = body.legs
    crotch = _crotch(body, levels["hip"], hip)
    point = float(resample(crotch, _POINT)[2])
    thigh, knee = levels["leg_thigh"], levels["leg_knee"]
    curves: dict[str, FloatArray] = {}
    outseams: dict[str, FloatArray] = {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        hulls = [hull * np.array([sign, 1.0]) for hull in legs.hulls[side]]
        middle = gaussian_filter1d(np.array([0.5 * (h.min(axis=0) + h.max(axis=0)) for h in hulls]), 2.0, axis=0)
        # Rays turn from the inside over the front: as those of a trunk that looks to the inside.
        turned = [(h - m)[:, ::-1] * np.array([1.0, -1.0]) for h, m in zip(hulls, middle, strict=True)]
        radii = np.stack([
            ray_radii(h, np.zeros(2), _COUNT, float(y)) for h, y in zip(turned, legs.y, strict=True)
        ])  # fmt: skip
        radii = gaussian_filter1d(radii, _UP_SIGMA, axis=0, mode="nearest")
        spectrum = np.fft.rfft(radii, axis=1)
        spectrum[:, _HARMONICS:] = 0.0
        radii = np.fft.irfft(spectrum, _COUNT, axis=1)
        rays = np.arange(_COUNT) * 2.0 * np.pi / _COUNT
        outward = np.column_stack([-np.cos(rays), np.sin(rays)])
        curves[side] = (radii[..., None] * outward + middle[:, None]) * np.array([sign, 1.0])
        # The outer side is flat: the middle of what is outermost, smooth along the leg.
        reach = sign * curves[side][..., 0]
        outermost = np.maximum(reach - reach.max(axis=1, keepdims=True) + _OUTERMOST, 0.0)
        places = (outermost * curves[side][..., 1]).sum(axis=1) / outermost.sum(axis=1)
        foot = legs.y < levels["leg_ankle"]
        places[foot] = places[~foot][0]
        outseams[side] = gaussian_filter1d(places, _OUTSEAM_SIGMA, mode="nearest")

    def profile(side: str, height: float) -> LegProfile:
        at = float(np.clip(np.interp(height, legs.y, np.arange(len(legs.y))), 0.0, len(legs.y) - 1.001))
        i, f = int(at), at - int(at)
        curve = (1.0 - f) * curves[side][i] + f * curves[side][i + 1]
        near = max(0.0, 1.0 - (thigh - height) / (thigh - knee))
        # At the thigh the inseam stands below the crotch point, from the knee down on the leg's inside.
        s = arc_lengths(curve, closed=True)
        inside = np.arange(-_COUNT // 5, _COUNT // 5)
        ahead = float(
            np.interp(point, np.maximum.accumulate(curve[inside, 1]), s[inside % _COUNT] - s[-1] * (inside < 0))
        )
        share = near * float(np.clip(ahead / s[-1], -0.1, 0.1))
        curve = resample(curve, share + np.arange(_COUNT) / _COUNT, closed=True)
        girth = (1.0 - f) * legs.girths[side][i] + f * legs.girths[side][i + 1]
        return profile_of_curve(
            curve, float(girth), near, float((1.0 - f) * outseams[side][i] + f * outseams[side][i + 1])
        )

    heights = {level: levels[level] for level in LEG_LEVELS[1:]}
    return LegCurves(
        heights=heights, profile=profile, crotch=crotch, point=_POINT,
        attract=_seat_attractor(body, thigh, levels["hip"], 0.5 * float(np.ptp(hip.curve[:, 0]))),
    )  # fmt: skip


def _seat_attractor(body: BodySections, low: float, high: float, half: float) -> Callable[[FloatArray], FloatArray]:
    """Return the nearest place on seat and thighs for every point inside the body; points outside stay where they are.

    Cloth bridges cleft and crotch, so nothing is drawn inwards.

    Args:
        body: its sections.
        low, high: heights between which it is asked [m].
        half: of the width at the hip [m]: what lies farther out than hip and thighs is a hand.
    """
    points, triangles, legs = body.vertices, body.slicer.triangles, body.legs
    middle = points[triangles].mean(axis=1)
    room = 0.06
    # The thighs may be broader than the hip.
    thighs = [hull for hulls in legs.hulls.values() for hull, y in zip(hulls, legs.y, strict=True) if y > low - room]
    half = max(half, *(float(np.abs(hull[:, 0]).max()) for hull in thighs))
    near = (middle[:, 1] > low - room) & (middle[:, 1] < high + room) & (np.abs(middle[:, 0]) < half + 0.01)
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # A mesh whose faces turn inwards has a negative volume.
    turn = np.sign(np.einsum("td,td->", normals, corners.mean(axis=1) - points.mean(axis=0)))
    normals = turn * normals[near]
    closest = Closest(points, triangles[near])

    def attract(where: FloatArray) -> FloatArray:
        triangle, weights, _ = closest(where)
        way = np.einsum("nk,nkd->nd", weights, closest.corners[triangle]) - where
        return where + np.where(np.einsum("nd,nd->n", way, normals[triangle])[:, None] > 0.0, way, 0.0)

    return attract


def _crotch(body: BodySections, hip: float, profile: Profile) -> FloatArray:
    """Return the crotch curve: through air at the back, where cloth bridges the cleft, and nowhere inside the body."""
    from scipy.spatial import ConvexHull

    front, back = float(profile.curve[0, 1]), float(profile.curve[len(profile.curve) // 2, 1])
    curve = crotch_curve(hip, body.lowest, front, back)
    cut = np.concatenate([p.points for p in body.slicer.cut(np.array([1.0, 0.0, 0.0]), 1e-5)])
    inside = (cut[:, 1] < hip) & (cut[:, 1] > body.lowest - 1e-6) & (cut[:, 2] < front) & (cut[:, 2] > back)
    flat = np.concatenate([curve[:, [2, 1]], cut[inside][:, [2, 1]]])
    hull = flat[ConvexHull(flat).vertices]
    order = np.argsort(np.arctan2(hull[:, 1] - hip - 1e-4, hull[:, 0] - 0.5 * (front + back)))
    hull = hull[order][::-1]
    hull = np.roll(hull, -int(np.argmax(hull[:, 0])), axis=0)
    line = resample(hull, np.linspace(0.0, 1.0, 200))
    return np.column_stack([np.zeros(len(line)), line[:, 1], line[:, 0]])
