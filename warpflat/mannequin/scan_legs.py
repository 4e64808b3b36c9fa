"""Legs of a scanned body, moved together until they hang plumb or touch, as trousers and a skirt's tape find them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.core.polyline import arc_lengths, resample
from warpflat.mannequin.blueprint import LegCurves, LegProfile, Profile
from warpflat.mannequin.closest import Closest
from warpflat.mannequin.layout import LEG_LEVELS
from warpflat.mannequin.rays import ray_radii
from warpflat.mannequin.scan_levels import TrunkSections
from warpflat.mannequin.slicer import Slicer
from warpflat.mannequin.table_legs import crotch_curve, profile_of_curve

__all__ = ["LegSections", "leg_curves", "plumb_legs", "slice_legs"]

# Legs within this slope of the plumb line stand together [m per m].
_TOGETHER = 0.01
# Room [m] between a leg that was moved inwards and the midplane.
_BETWEEN = 0.001
_COUNT, _HARMONICS, _UP_SIGMA = 240, 16, 1.5
# The outseam lies in the middle of what is within so much [m] of the outermost, smoothed along the leg [rows].
_OUTERMOST, _OUTSEAM_SIGMA = 0.004, 6.0
# Share of the crotch curve's length ahead of the crotch point.
_POINT = 0.40


@dataclass(frozen=True, kw_only=True, eq=False)
class LegSections:
    """Horizontal sections of both legs below the crotch, from low to high.

    Attributes:
        y: #S, heights [m].
        hulls: by side, for each section its hull as scanned, #P by 2 (x, z) [m].
        girths: by side #S, the hulls' girths [m].
        inwards: by side #S, how far each section is moved towards the midplane [m].
        crotch: height of the lowest point of the body in the midplane [m].
        hip: height of the hip [m].
        slope: how far the legs' middles run apart per metre down the leg.
        noise: how far noise moved the scan's vertices before it was smoothed [m]; 0 without noise.
    """

    y: FloatArray
    hulls: Mapping[str, tuple[FloatArray, ...]]
    girths: Mapping[str, FloatArray]
    inwards: Mapping[str, FloatArray]
    crotch: float
    hip: float
    slope: float
    noise: float = 0.0

    def moved(self, side: str, row: int) -> FloatArray:
        """Return a section's hull, moved inwards, #P by 2 (x, z) [m]."""
        sign = 1.0 if side == "left" else -1.0
        return self.hulls[side][row] - np.array([sign * self.inwards[side][row], 0.0])

    def move(self, points: FloatArray) -> FloatArray:
        """Return points of the scan, #P by 3 [m], those of the legs moved inwards with them.

        From the crotch up to the hip flesh follows less and less, and in proportion to its distance from the midplane.
        """
        out = points.copy()
        top = float(self.y[-1])
        rise = np.clip((points[:, 1] - top) / (self.hip - top), 0.0, 1.0)
        for side, sign in (("left", 1.0), ("right", -1.0)):
            rows = (rise < 1.0) & (sign * points[:, 0] > 0.0) & (np.abs(points[:, 0]) < 0.5 * top)
            inwards = np.interp(points[rows, 1], self.y, self.inwards[side]) * (1.0 - rise[rows])
            joint = 0.5 * float(np.ptp(self.hulls[side][-1][:, 0]))
            follows = np.where(rise[rows] > 0.0, np.clip(sign * points[rows, 0] / joint, 0.0, 1.0), 1.0)
            out[rows, 0] -= sign * inwards * follows
        return out


def slice_legs(slicer: Slicer, trunk: TrunkSections, hip: float) -> LegSections:
    """Slice the legs and find how far each is moved inwards: until its middle is plumb below the hip, or until it touches.

    Args:
        slicer: the upright scan.
        trunk: its sections.
        hip: height of the hip [m].

    Raises:
        InputError: if the legs are one part too far down.
    """
    from scipy.ndimage import gaussian_filter1d

    heights = trunk.y[trunk.y <= trunk.crotch]
    found, girths = _leg_hulls(trunk, heights)
    middles = {s: np.array([0.5 * (h[:, 0].min() + h[:, 0].max()) for h in hulls]) for s, hulls in found.items()}
    straight = heights >= 0.09 * trunk.stature
    apart = 0.5 * (middles["left"] - middles["right"])
    slope = max(0.0, -float(np.polyfit(heights[straight], apart[straight], 1)[0])) if straight.sum() > 3 else 0.0
    inwards: dict[str, FloatArray] = {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        room = np.array([float((sign * h[:, 0]).min()) for h in found[side]]) - _BETWEEN
        wished = slope * (hip - heights) if slope >= _TOGETHER else np.zeros_like(heights)
        # Smooth, so that the legs stay smooth; never farther than there is room.
        inwards[side] = np.minimum(gaussian_filter1d(np.minimum(wished, room), 4.0, mode="nearest"), room)
    ahead = np.concatenate([p.points for p in slicer.cut(np.array([1.0, 0.0, 0.0]), 1e-5)])[:, 1]
    near = ahead[np.abs(ahead - trunk.crotch) < 0.02 * trunk.stature]
    return LegSections(
        y=heights, hulls={s: tuple(h) for s, h in found.items()}, inwards=inwards,
        girths={s: np.array(g) for s, g in girths.items()},
        crotch=float(near.min()) if len(near) else trunk.crotch, hip=hip, slope=slope, noise=slicer.noise,
    )  # fmt: skip


def _leg_hulls(trunk: TrunkSections, heights: FloatArray) -> tuple[dict[str, list[FloatArray]], dict[str, list[float]]]:
    """Return the convex hull of each leg's section at each height, and its girth [m], by side.

    Raises:
        InputError: there are no two legs at a height.
    """
    from scipy.spatial import ConvexHull

    found: dict[str, list[FloatArray]] = {"left": [], "right": []}
    girths: dict[str, list[float]] = {"left": [], "right": []}
    for y, parts in zip(heights, trunk.parts, strict=False):
        flats = list(parts)
        if len(flats) == 1:
            # The thighs touch: the midplane parts them.
            flats = [flats[0][flats[0][:, 0] > 0.0], flats[0][flats[0][:, 0] < 0.0]]
        flats.sort(key=lambda p: -float(p[:, 0].mean()) if len(p) else 0.0)
        if len(flats) != 2 or min(len(p) for p in flats) < 8:
            raise InputError(f"scan: no two legs at {y:.2f} m above the floor; its mesh is broken there")
        for side, flat in zip(("left", "right"), flats, strict=True):
            hull = ConvexHull(flat)
            found[side].append(flat[hull.vertices])
            girths[side].append(float(hull.area))
    return found, girths


def plumb_legs(trunk: TrunkSections, legs: LegSections) -> tuple[TrunkSections, list[str]]:
    """Return the sections around both legs after these are moved together, and a note if they stood apart.

    A tape around both legs of a scan measures how far apart the feet stand. Sections above the crotch stay.
    """
    from scipy.spatial import ConvexHull

    if legs.slope < _TOGETHER:
        return trunk, []
    hulls = list(trunk.hulls)
    girth, area, left, right = (a.copy() for a in (trunk.girth, trunk.area, trunk.left, trunk.right))
    for i in range(len(legs.y)):
        points = np.concatenate([legs.moved("left", i), legs.moved("right", i)])
        hull = ConvexHull(points)
        hulls[i], girth[i], area[i] = points[hull.vertices], hull.area, hull.volume
        left[i], right[i] = points[:, 0].max(), -points[:, 0].min()
    note = (
        f"the legs stand {2.0 * np.degrees(np.arctan(legs.slope)):.0f} degrees apart; below the crotch they are moved together until "
        "they hang plumb or touch"
    )
    return replace(trunk, hulls=tuple(hulls), girth=girth, area=area, left=left, right=right), [note]


def leg_curves(slicer: Slicer, legs: LegSections, levels: Mapping[str, float], hip: Profile) -> LegCurves:
    """Return crotch curve and legs for the grid.

    Args:
        slicer: the upright scan.
        legs: the sections.
        levels: heights [m], the leg levels among them.
        hip: the trunk's profile at the hip.
    """
    from scipy.ndimage import gaussian_filter1d

    crotch = _crotch(slicer, legs, levels["hip"], hip)
    point = float(resample(crotch, _POINT)[2])
    thigh, knee = levels["leg_thigh"], levels["leg_knee"]
    curves: dict[str, FloatArray] = {}
    outseams: dict[str, FloatArray] = {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        hulls = [legs.moved(side, i) * np.array([sign, 1.0]) for i in range(len(legs.y))]
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
        attract=_seat_attractor(slicer, legs, thigh, levels["hip"], 0.5 * float(np.ptp(hip.curve[:, 0]))),
    )  # fmt: skip


def _seat_attractor(
    slicer: Slicer, legs: LegSections, low: float, high: float, half: float
) -> Callable[[FloatArray], FloatArray]:
    """Return the nearest place on seat and thighs for every point inside the body; points outside stay where they are.

    Cloth bridges cleft and crotch, so nothing is drawn inwards.

    Args:
        slicer: the upright scan.
        legs: sections of the legs, which are moved together.
        low, high: heights between which it is asked [m].
        half: of the width at the hip [m]: what lies farther out than hip and thighs is a hand.
    """
    points, triangles = legs.move(slicer.vertices), slicer.triangles
    middle = slicer.vertices[triangles].mean(axis=1)
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


def _crotch(slicer: Slicer, legs: LegSections, hip: float, profile: Profile) -> FloatArray:
    """Return the crotch curve: through air at the back, where cloth bridges the cleft, and nowhere inside the body."""
    from scipy.spatial import ConvexHull

    front, back = float(profile.curve[0, 1]), float(profile.curve[len(profile.curve) // 2, 1])
    curve = crotch_curve(hip, legs.crotch, front, back)
    cut = np.concatenate([p.points for p in slicer.cut(np.array([1.0, 0.0, 0.0]), 1e-5)])
    inside = (cut[:, 1] < hip) & (cut[:, 1] > legs.crotch - 1e-6) & (cut[:, 2] < front) & (cut[:, 2] > back)
    flat = np.concatenate([curve[:, [2, 1]], cut[inside][:, [2, 1]]])
    hull = flat[ConvexHull(flat).vertices]
    order = np.argsort(np.arctan2(hull[:, 1] - hip - 1e-4, hull[:, 0] - 0.5 * (front + back)))
    hull = hull[order][::-1]
    hull = np.roll(hull, -int(np.argmax(hull[:, 0])), axis=0)
    line = resample(hull, np.linspace(0.0, 1.0, 200))
    return np.column_stack([np.zeros(len(line)), line[:, 1], line[:, 0]])
