"""Neck, shoulders, armholes, arms and legs of a scanned body, for the grid."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from warpflat.core import FloatArray, InputError, arc_lengths, polyline_length, resample, unit
from warpflat.garment.mannequin.blueprint import NOTCH, LegCurves, LegProfile, Profile, QuarterCurves
from warpflat.garment.mannequin.closest import Mesh
from warpflat.garment.mannequin.layout import LEG_LEVELS, QUARTERS
from warpflat.garment.mannequin.rays import ray_radii, smooth_radii, with_harmonics
from warpflat.garment.mannequin.sampled import row_at, smooth
from warpflat.garment.mannequin.scan_sections import BodySections
from warpflat.garment.mannequin.slicer import UP, Slicer
from warpflat.garment.mannequin.table_legs import AROUND_LEG, crotch_curve, profile_of_curve

__all__ = ["leg_curves", "underarm_point", "upper_curves"]

#: How far the armhole's plane leans outward from the armpit up.
_LEAN = np.radians(9.0)
# How far below the armpit the armhole ends, and how far outside the armpit it passes at the shoulder's height above it,
# as shares of the stature.
_DROP, _SHOULDER_HEIGHT = 0.016, 0.075
# Down to this far above the armpit the armhole is the body's own section.
_SCOOP = 0.012
# The biceps' row lies so far [m] beyond the underarm that the shortest sleeve has a seam to sew.
_SHORTEST_SLEEVE = 0.087
_HARMONICS = 5
# A point of a section outside a window counts by so much less for each metre that it lies outside.
_STEEP = 10.0
# Where an arm is sliced between biceps (0), elbow (1) and wrist (2): forearms swell below the elbow.
_ARM_PLACES = (0.0, 0.5, 1.0, 1.25, 1.5, 1.75, 2.0)
# Harmonics around a leg that are kept.
_LEG_HARMONICS = 16
# The outseam lies in the middle of what is within so much [m] of the outermost, smoothed along the leg [rows].
_OUTERMOST, _OUTSEAM_SIGMA = 0.004, 6.0
# Share of the crotch curve's length ahead of the crotch point.
_POINT = 0.40


def upper_curves(
    body: BodySections,
    levels: Mapping[str, float],
    profile: Callable[[float], Profile],
    underarms: Mapping[str, FloatArray],
) -> tuple[dict[str, QuarterCurves], dict[str, dict[float, FloatArray]], FloatArray, float]:
    """Return the curves of the quarters above the bust, those of the arms, the collar (#P by 3 [m]), and the neck base's length [m].

    Args:
        body: its sections.
        levels: heights [m] of the levels.
        profile: the trunk's profile at a height [m].
        underarms: the left and the right armhole's lowest point (see :func:`underarm_point`).

    Raises:
        InputError: if the neck or an arm cannot be sliced.
    """
    slicer = body.slicer
    neckline, collar = (np.roll(ring, -int(np.argmax(ring[:, 2])), axis=0) for ring in _neck(body, levels))
    holes = {side: _armhole(body, side, underarms[side]) for side in ("left", "right")}
    back = int(np.argmin(np.abs(neckline[:, 0]) + 10.0 * (neckline[:, 2] > neckline[:, 2].mean())))
    bust = profile(levels["bust"])
    quarters: dict[str, QuarterCurves] = {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        around = neckline if sign > 0 else np.vstack([neckline[:1], neckline[:0:-1]])
        end = back if sign > 0 else len(neckline) - back
        corner = int(np.argmax(sign * around[: end + 1, 0]))
        hole = holes[side]
        tip = int(np.argmax(hole[:, 1]))
        # The loop runs from the underarm forward: its first half is the front.
        halves = {"front": hole[tip::-1], "back": np.vstack([hole[tip:], hole[:1]])}
        seam = _shoulder(slicer, around[corner], hole[tip])
        for face, ahead, line in (("front", 1.0, around[: corner + 1]), ("back", -1.0, around[corner : end + 1][::-1])):
            curve = halves[face]
            rise = (curve[:, 1] - curve[-1, 1]) / max(curve[0, 1] - curve[-1, 1], 1e-9)
            s = arc_lengths(curve)
            notch = int(np.argmin(np.abs(rise - NOTCH)))
            # The across-chest row runs from the midplane to the armhole's notch.
            end_x, height, end_z = curve[notch]
            points, aside = slicer.points(UP, float(height)), np.sign(end_x)
            x = np.linspace(0.0, abs(end_x), 30)
            z = np.array([
                ahead * _outermost(ahead * points[:, 2], aside * points[:, 0] - at, x[1], ahead * end_z) for at in x
            ])  # fmt: skip
            fit = np.polynomial.Polynomial.fit(x / x[-1], z - end_z, 5)(x / x[-1])
            z = end_z + fit - fit[-1] * (x / x[-1]) ** 3
            row = np.column_stack([aside * x, np.full_like(x, height), z])
            # The centre line runs from the bust to the neckline.
            low, top = levels["bust"], line[0]
            y = np.linspace(low, top[1], 24)
            points = slicer.points(np.array([1.0, 0.0, 0.0]), 1e-4)
            first = bust.curve[0 if face == "front" else len(bust.curve) // 2]
            z = np.interp(y, [low, row[0, 1], top[1]], [first[1], row[0, 2], top[2]])
            for i in range(2, len(y) - 1):
                near = points[np.abs(points[:, 2] - z[i]) < 0.05]
                z[i] = ahead * _outermost(ahead * near[:, 2], near[:, 1] - y[i], 0.006, ahead * z[i])
            z[1:-1] = np.convolve(z, [0.25, 0.5, 0.25], mode="same")[1:-1]
            quarters[f"{face}-{side}"] = QuarterCurves(
                neckline=line, shoulder=seam, armhole=curve, notch=float(s[notch] / s[-1]), chest=row,
                centre=np.column_stack([np.zeros_like(y), y, z]),
            )  # fmt: skip
    # Of an arm from biceps to wrist; its curves turn with the arm and are not wrung against the armhole.
    arms: dict[str, dict[float, FloatArray]] = {}
    for side, arm in body.arms.items():
        hole = holes[side]
        under, top = hole[0], hole[int(np.argmax(hole[:, 1]))]
        axis = unit(arm.line[-1] - hole.mean(axis=0))
        beyond = max(float(point @ axis) for point in (under, top)) + _SHORTEST_SLEEVE
        biceps = float(np.clip(np.interp(beyond, arm.line @ axis, arm.s), arm.s[4], arm.elbow - 0.10 * arm.s[-1]))
        along = np.interp(_ARM_PLACES, [0.0, 1.0, 2.0], [biceps, arm.elbow, arm.wrist])
        # From the armhole's lowest to its highest point, carried along the arm without a twist.
        up, outwards, arms[side] = top - under, np.sign(under[0]), {}
        for place, at in zip(_ARM_PLACES, along, strict=True):
            middle, across = arm.frame(float(at))
            up = unit(up - across * float(across @ up))
            cut = arm.cut(middle, across)
            arms[side][place] = _loop(cut, cut.mean(axis=0), -up, outwards * np.cross(across, up), 4, 240)
    neck = polyline_length(neckline, closed=True)
    return {name: quarters[name] for name in QUARTERS}, arms, collar, neck


def _loop(
    points: FloatArray,
    origin: FloatArray,
    first: FloatArray,
    second: FloatArray,
    harmonics: int,
    count: int = 360,
    below: FloatArray | None = None,
) -> FloatArray:
    """Return a smooth closed curve around plane points: their hull, from direction `first` over `second`, #count by 3.

    The curve starts at the point `below` if that is given.
    """
    from scipy.spatial import ConvexHull

    axes = np.array([second, first])
    flat = (points - origin) @ axes.T
    hull = flat[ConvexHull(flat).vertices]
    middle = 0.5 * (hull.min(axis=0) + hull.max(axis=0))
    if below is not None:
        middle[0] = (below - origin) @ second
    radii = with_harmonics(ray_radii(hull, middle, count, float(origin[1])), harmonics + 1)
    rays = np.arange(count) * 2.0 * np.pi / count
    return np.asarray(origin + (middle + radii[:, None] * np.column_stack([np.sin(rays), np.cos(rays)])) @ axes)


def _neck(body: BodySections, levels: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
    """Return neck base and collar, from the front over the left."""

    def middle(height: float) -> FloatArray:
        """Return z [m] of the scan in the midplane at a height."""
        points = body.scan.points(UP, height)
        return np.asarray(points[np.abs(points[:, 0]) < 0.02 * body.stature, 2])

    front = np.array([0.0, levels["front_neck"], middle(levels["front_neck"]).max()])
    at_side = middle(levels["side_neck"])
    side_z = 0.5 * float(at_side.min() + at_side.max())
    slope = (levels["side_neck"] - front[1]) / max(front[2] - side_z, 0.02)
    slope = float(np.clip(slope, 0.15, 0.65))
    normal = np.array([0.0, 1.0, slope]) / np.hypot(1.0, slope)
    ahead = np.array([0.0, -slope, 1.0]) / np.hypot(1.0, slope)
    left = np.array([1.0, 0.0, 0.0])

    def ring(lift: float) -> FloatArray:
        parts = [p for p in body.scan.cut(normal, float(front @ normal) + lift)
                 if p.points[:, 0].min() < 0.0 < p.points[:, 0].max()]  # fmt: skip
        if not parts:
            raise InputError(
                f"scan: no neck at {front[1]:.2f} m above the floor; give front_neck and side_neck as landmarks"
            )
        part = max(parts, key=lambda p: p.length)
        return _loop(part.points, part.points.mean(axis=0), ahead, left, _HARMONICS)

    base = ring(0.004)
    top = ring(0.035)
    # A collar plane that meets the chin bulges: keep to a cylinder's growth.
    wide = polyline_length(top, closed=True) / polyline_length(base, closed=True)
    if wide > 1.02:
        top = top.mean(axis=0) + (top - top.mean(axis=0)) * (0.95 / wide)
    return base, top


def underarm_point(body: BodySections, side: str, underbust: float) -> FloatArray:
    """Return the lowest point of an armhole: on the trunk's side, 25 mm below the armpit on an adult.

    As deep as a woven block needs it, and at least halfway from the underbust up; midway between the armhole's front and back.

    Args:
        body: its sections.
        side: ``left`` or ``right``.
        underbust: height of the underbust [m].

    Raises:
        InputError: if there is no armhole.
    """
    t, (_, armpit, z) = body.trunk, body.armpits[side]
    sign = 1.0 if side == "left" else -1.0
    height = max(armpit - _DROP * body.stature, 0.5 * (underbust + armpit))
    ring = _hole_points(body, side, body.armpits[side], _LEAN, 0.004)
    # Between the middle of the armhole and where the side seam comes from below.
    middles = (
        ring[:, 2].min() + ring[:, 2].max(),
        np.interp(underbust, t.y, t.front) + np.interp(underbust, t.y, t.back),
    )
    z = 0.25 * float(sum(middles))
    points = body.slicer.points(UP, height)
    reach = float(np.interp(height, t.y, t.left if sign > 0 else t.right))
    out = sign * points[:, 0]
    trunk = (out > 0.0) & (out < reach + 0.002)
    return np.array([sign * _outermost(out[trunk], points[trunk, 2] - z, 0.006, reach), height, z])


def _outermost(out: FloatArray, off: FloatArray, width: float, otherwise: float) -> float:
    """Return how far out a section reaches within a window.

    A section is points where it crosses the mesh's edges. One just outside the window counts, too, by so much less: where the window's
    end meets a point, rounding would decide whether it counts.

    Args:
        out: of the section's points, how far out they lie [m].
        off: how far they lie from the window's middle, along the section [m].
        width: half of the window [m].
        otherwise: what is returned where no point lies in the window [m].
    """
    beyond = np.abs(off) - width
    return float((out - _STEEP * np.maximum(beyond, 0.0)).max()) if (beyond < 0.0).any() else otherwise


def _hole_points(body: BodySections, side: str, through: FloatArray, lean: float, outward: float) -> FloatArray:
    """Return the part of the scan's section above `through` in the plane through it that leans `lean` outward.

    Args:
        body: its sections.
        side: ``left`` or ``right``.
        through: a point of the plane [m].
        lean: of the plane, from plumb [radians].
        outward: how far the plane is moved towards the arm [m].

    Raises:
        InputError: if there is none.
    """
    sign = 1.0 if side == "left" else -1.0
    armpit = body.armpits[side][1]
    normal = np.array([sign * np.cos(lean), -np.sin(lean), 0.0])
    near = [
        p.points[p.points[:, 1] > through[1] - 0.002]
        for p in body.slicer.cut(normal, float(through @ normal) + outward)
    ]
    near = [
        p for p in near if len(p) > 8 and armpit + 0.03 * body.stature < p[:, 1].max() < 0.95 * body.stature
    ]  # fmt: skip
    if not near:
        raise InputError(f"scan: no {side} armhole above the armpit at {armpit:.2f} m; arms must stand off the body")
    return max(near, key=len)


def _armhole(body: BodySections, side: str, under: FloatArray) -> FloatArray:
    """Return the closed armhole in the plane through the underarm point and the shoulder, from the underarm forward."""
    sign = 1.0 if side == "left" else -1.0
    x, armpit, _ = body.armpits[side]
    # The plane passes the shoulder where one that leans `_LEAN` from the armpit would.
    rise = _SHOULDER_HEIGHT * body.stature
    lean = float(np.arctan2(sign * (x - under[0]) + rise * np.tan(_LEAN), rise + armpit - under[1]))
    normal = np.array([sign * np.cos(lean), -np.sin(lean), 0.0])
    up = np.array([sign * np.sin(lean), np.cos(lean), 0.0])
    ring = _hole_points(body, side, under, lean, 0.001)
    # From just above the armpit a quarter of an ellipse runs down to the underarm point, front and back.
    level = armpit + _SCOOP * body.stature
    points = [ring[ring[:, 1] > level]]
    turn = np.linspace(0.0, 0.5 * np.pi, 24)[:, None]
    for face in (-1.0, 1.0):
        end = face * _outermost(face * ring[:, 2], ring[:, 1] - level, 0.005 * body.stature, face * under[2])
        across, down = np.array([0.0, 0.0, end - under[2]]), (level - under[1]) / up[1] * up
        points.append(under + 0.001 * normal + np.sin(turn) * across + (1.0 - np.cos(turn)) * down)
    hole = _loop(np.concatenate(points), under, -up, np.array([0.0, 0.0, 1.0]), _HARMONICS, below=under)
    # Few harmonics round the curve off below the underarm point, and tilt it there where that lies off the middle.
    depth = ((hole[:, 1].max() - hole[:, 1]) / np.ptp(hole[:, 1]))[:, None] ** 2
    way = hole[1] - hole[-1]
    level = (hole[:, 2:] - hole[0, 2]) * (way @ up / way[2])
    return np.asarray(hole + depth * (under - hole[0] - level * up))


def _shoulder(slicer: Slicer, neck: FloatArray, tip: FloatArray) -> FloatArray:
    """Return the seam from the side neck point to the shoulder point, on the scan's upper side."""
    flat = tip - neck
    normal = unit(np.cross(flat, UP))
    t = np.linspace(0.0, 1.0, 40)
    straight = neck + t[:, None] * flat
    along = flat * np.array([1.0, 0.0, 1.0])
    reach = float(np.linalg.norm(along))
    along /= reach
    points = slicer.points(normal, float(neck @ normal))
    share = (points - neck) @ along / reach
    line_y = neck[1] + share * flat[1]
    keep = (share > 0.02) & (share < 0.98) & (np.abs(points[:, 1] - line_y) < 0.03)
    if keep.sum() < 4:
        return straight
    order = np.argsort(share[keep])
    lift = np.interp(t, share[keep][order], (points[:, 1] - line_y)[keep][order], left=0.0, right=0.0)
    # A smooth arch through the scan's outline that keeps both ends.
    fit = np.linalg.lstsq(np.column_stack([np.sin(np.pi * t), np.sin(2 * np.pi * t)]), lift, rcond=None)[0]
    straight[:, 1] += fit[0] * np.sin(np.pi * t) + fit[1] * np.sin(2 * np.pi * t)
    return straight


def leg_curves(body: BodySections, levels: Mapping[str, float], hip: Profile) -> LegCurves:
    """Return crotch curve and legs for the grid.

    Args:
        body: its sections.
        levels: heights [m], the leg levels among them.
        hip: the trunk's profile at the hip.
    """
    from scipy.ndimage import gaussian_filter1d
    from scipy.spatial import ConvexHull

    legs = body.legs
    # The crotch curve runs through air at the back, where cloth bridges the cleft, and nowhere inside the body.
    height, front, back = levels["hip"], float(hip.curve[0, 1]), float(hip.curve[len(hip.curve) // 2, 1])
    cut = body.slicer.points(np.array([1.0, 0.0, 0.0]), 1e-5)
    near = (cut[:, 1] < height) & (cut[:, 1] > body.lowest - 1e-6) & (cut[:, 2] < front) & (cut[:, 2] > back)
    flat = np.concatenate([crotch_curve(height, body.lowest, front, back)[:, [2, 1]], cut[near][:, [2, 1]]])
    hull = flat[ConvexHull(flat).vertices]
    order = np.argsort(np.arctan2(hull[:, 1] - height - 1e-4, hull[:, 0] - 0.5 * (front + back)))
    hull = hull[order][::-1]
    hull = np.roll(hull, -int(np.argmax(hull[:, 0])), axis=0)
    line = resample(hull, np.linspace(0.0, 1.0, 200))
    crotch = np.column_stack([np.zeros(len(line)), line[:, 1], line[:, 0]])
    point = float(resample(crotch, _POINT)[2])
    thigh, knee = levels["leg_thigh"], levels["leg_knee"]
    curves: dict[str, FloatArray] = {}
    outseams: dict[str, FloatArray] = {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        hulls = [hull * np.array([sign, 1.0]) for hull in legs.hulls[side]]
        middle = gaussian_filter1d(np.array([0.5 * (h.min(axis=0) + h.max(axis=0)) for h in hulls]), 2.0, axis=0)
        # Rays turn from the inside over the front: as those of a trunk that looks to the inside.
        turned = [(h - m)[:, ::-1] * np.array([1.0, -1.0]) for h, m in zip(hulls, middle, strict=True)]
        radii = smooth_radii(turned, np.zeros_like(middle), legs.y, AROUND_LEG, _LEG_HARMONICS)
        rays = np.arange(AROUND_LEG) * 2.0 * np.pi / AROUND_LEG
        outward = np.column_stack([-np.cos(rays), np.sin(rays)])
        curves[side] = (radii[..., None] * outward + middle[:, None]) * np.array([sign, 1.0])
        # The outer side is flat: the middle of what is outermost, smooth along the leg.
        reach = sign * curves[side][..., 0]
        outermost = np.maximum(reach - reach.max(axis=1, keepdims=True) + _OUTERMOST, 0.0)
        places = (outermost * curves[side][..., 1]).sum(axis=1) / outermost.sum(axis=1)
        foot = legs.y < levels["leg_ankle"]
        places[foot] = places[~foot][0]
        outseams[side] = smooth(places, _OUTSEAM_SIGMA)

    def profile(side: str, height: float) -> LegProfile:
        curve = row_at(curves[side], legs.y, height)
        near = max(0.0, 1.0 - (thigh - height) / (thigh - knee))
        # At the thigh the inseam stands below the crotch point, from the knee down on the leg's inside.
        s = arc_lengths(curve, closed=True)
        inside = np.arange(-AROUND_LEG // 5, AROUND_LEG // 5)
        ahead = float(
            np.interp(point, np.maximum.accumulate(curve[inside, 1]), s[inside % AROUND_LEG] - s[-1] * (inside < 0))
        )
        share = near * float(np.clip(ahead / s[-1], -0.1, 0.1))
        curve = resample(curve, share + np.arange(AROUND_LEG) / AROUND_LEG, closed=True)
        girth, outseam = (float(row_at(rows[side], legs.y, height)) for rows in (legs.girths, outseams))
        return profile_of_curve(curve, girth, near, outseam)

    points, triangles, room = body.vertices, body.slicer.triangles, 0.06
    middle = points[triangles].mean(axis=1)
    # What lies farther out than hip and thighs is a hand. The thighs may be broader than the hip.
    thighs = [hull for rows in legs.hulls.values() for hull, y in zip(rows, legs.y, strict=True) if y > thigh - room]
    half = max(0.5 * float(np.ptp(hip.curve[:, 0])), *(float(np.abs(hull[:, 0]).max()) for hull in thighs))
    of_seat = (middle[:, 1] > thigh - room) & (middle[:, 1] < height + room) & (np.abs(middle[:, 0]) < half + 0.01)
    surface = Mesh(points, triangles[of_seat])

    def attract(where: FloatArray) -> FloatArray:
        # Cloth bridges cleft and crotch, so nothing is drawn inwards: points outside seat and thighs stay where they are.
        triangle, weights, place = surface.closest(where)
        inside = np.einsum("nd,nd->n", place - where, surface.normals_at(triangle, weights)) > 0.0
        return np.where(inside[:, None], place, where)

    heights = {level: levels[level] for level in LEG_LEVELS[1:]}
    return LegCurves(heights=heights, profile=profile, crotch=crotch, point=_POINT, attract=attract)
