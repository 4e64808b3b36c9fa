"""What a mannequin of a scanned body is made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core import AXES, FloatArray, arc_lengths, reflected
from warpflat.flat import vertex_normals
from warpflat.garment.mannequin.blueprint import Blueprint, Profile
from warpflat.garment.mannequin.builder import build_vertices
from warpflat.garment.mannequin.closest import Mesh
from warpflat.garment.mannequin.layout import RING_LEVELS, Layout
from warpflat.garment.mannequin.profiles import convex_girth, scale_to_girth, upper_hull
from warpflat.garment.mannequin.rays import smooth_radii
from warpflat.garment.mannequin.read_body import read_body, whole_sections
from warpflat.garment.mannequin.sampled import row_at, smooth, smoothstep
from warpflat.garment.mannequin.scan_levels import BUST_POINTS
from warpflat.garment.mannequin.scan_limbs import leg_curves, underarm_point, upper_curves
from warpflat.garment.mannequin.scan_measures import body_measures, guess_note, missing_note
from warpflat.garment.mannequin.scan_pose import ScanOptions
from warpflat.garment.mannequin.scan_sections import BodySections
from warpflat.garment.mannequin.slicer import UP
from warpflat.garment.mannequin.table_body import PRINCESS

__all__ = ["attributes_on_scan", "average_sides", "sides_note"]

# Harmonics of the sampled hulls that are kept around the body.
_HARMONICS = 28
# Left and right may differ by so much [m] before a note says so.
_TOLD = 0.010
# Beyond planes that lean so far outward from the armpits up, the scan is arm.
_ARM_LEAN = np.radians(11.0)
# How far a side seam follows the waves of front and back at the waist.
_OFF_PLUMB = 0.5


def attributes_on_scan(
    vertices: FloatArray, faces: NDArray[np.int64], options: ScanOptions, layout: Layout
) -> dict[str, Any]:
    """Return a mannequin's attributes: the body model is fitted to a scan and laid on it, and the grid on its curves.

    Args:
        vertices: #V by 3, any unit.
        faces: #F by 3 or 4 (-1 in the last column for a triangle).
        options: what the user knows about the scan.
        layout: the grid.

    Raises:
        InputError: if the mesh is not a body that stands on two legs, or has a measure that no body has.
    """
    read = read_body(vertices, faces, options)
    stands, t = read.stands, read.stands.trunk
    levels = {name: level.height for name, level in read.levels.items()}
    with whole_sections():
        underarms = {side: underarm_point(stands, side, levels["underbust"]) for side in ("left", "right")}
        profile = _profiles(stands, levels, underarms)
        quarters, arms, collar, neck = upper_curves(stands, levels, profile, underarms)
        blueprint = Blueprint(
            profile=profile, heights={level: levels[level] for level in RING_LEVELS}, quarters=quarters, arms=arms,
            legs=leg_curves(stands, levels, profile(levels["hip"])), neck=neck, collar=collar,
            attract=_attractor(stands, levels),
        )  # fmt: skip
        measures = body_measures(read, neck, options.landmarks)
    made = build_vertices(layout, blueprint)
    told = [f"{name} was given: {height:.3f} m" for name, height in options.landmarks.items()]
    sides = sides_note(made, layout, averaged=options.symmetric)
    return {
        "layout": layout,
        "vertices": average_sides(made, layout) if options.symmetric else made,
        "source": f"scan of a body {read.body.stature:.3f} m tall; the body model lies {1e3 * read.laid.fit.far:.1f} mm off it in the mean",
        "notes": (*read.notes, *told, *guess_note(measures, read.found), *missing_note(measures), *sides),
        "sections": {level: float(np.interp(levels[level], t.y, t.length)) for level in RING_LEVELS},
        "measures": measures,
        "scan": (stands.scan.vertices, read.scan.triangles),
        "placed": read.placed,
    }


def _profiles(
    body: BodySections, levels: Mapping[str, float], underarms: Mapping[str, FloatArray]
) -> Callable[[float], Profile]:
    t = body.trunk
    rows = np.flatnonzero(t.y < levels["armpit"] - 0.002)
    count = 720
    middle_z = 0.5 * (t.front + t.back)[rows]
    # A row's rays start from a point that climbs smoothly, or the rows would be twisted against each other.
    start = smooth(middle_z, 3.0)
    y, girth = t.y[rows], t.girth[rows]
    middles = np.column_stack([np.zeros_like(start), start])
    radii = smooth_radii([t.hulls[i] for i in rows], middles, y, count, _HARMONICS)
    # A side seam hangs nearly plumb: halfway between the middle of front and back and the straight line from hip to underarm,
    # and on that line from the bust up, so that it meets the armhole squarely.
    side_z = smooth(middle_z, 14.0)
    _, under_y, under_z = 0.5 * (underarms["left"] + underarms["right"])
    hip, waist, bust = levels["hip"], levels["waist"], levels["bust"]
    straight = np.interp(y, [hip, under_y], [np.interp(hip, y, side_z), under_z])
    off = np.clip((bust - y) / (bust - waist), 0.0, 1.0)
    side_z += (1.0 - _OFF_PLUMB * smoothstep(off)) * (y > hip) * (straight - side_z)
    rays = np.arange(count) * 2.0 * np.pi / count
    outward = np.column_stack([np.sin(rays), np.cos(rays)])
    bust_girth = float(np.interp(levels["bust"], y, girth))
    least, most = BUST_POINTS
    apex = float(np.clip(np.interp(levels["bust"], t.y, t.apex), least * bust_girth, most * bust_girth))
    known = [levels[level] for level in RING_LEVELS]
    widths = np.array([PRINCESS[level] for level in RING_LEVELS]) * apex

    def profile(height: float) -> Profile:
        curve = row_at(radii, y, height)[:, None] * outward + row_at(middles, y, height)
        s = arc_lengths(curve, closed=True)
        half = count // 2
        z = float(row_at(side_z, y, height))
        left = int(np.argmin(np.abs(curve[60 : half - 60, 1] - z))) + 60
        right = int(np.argmin(np.abs(curve[half + 60 : count - 60, 1] - z))) + half + 60
        around = np.vstack([curve, curve[:1]])
        front_x, back_x = (float(np.interp(height, known, widths[:, k])) for k in (0, 1))
        return Profile(
            curve=curve, side_left=_where(curve[:, 1], s, left, z), centre_back=float(s[half]),
            side_right=_where(curve[:, 1], s, right, z), girth=float(row_at(girth, y, height)),
            princess={
                "front-left": _share(curve[: left + 1], front_x),
                "back-left": _share(curve[half : left - 1 : -1], back_x),
                "back-right": _share(curve[half : right + 1], back_x),
                "front-right": _share(around[: right - 1 : -1], front_x),
            },
        )  # fmt: skip

    return profile


def _where(values: FloatArray, s: FloatArray, i: int, wished: float) -> float:
    """Return arc length near sample `i` at which `values` pass `wished`."""
    a, b = values[i - 1], values[i + 1]
    if abs(b - a) < 1e-9:
        return float(s[i])
    f = float(np.clip((wished - a) / (b - a), 0.0, 1.0))
    return float((1.0 - f) * s[i - 1] + f * s[i + 1])


def _share(quarter: FloatArray, wished: float) -> float:
    """Return share of a quarter's length, from its centre line to its side, at which it is `wished` [m] off the midplane."""
    s = arc_lengths(quarter)
    rising = np.maximum.accumulate(np.abs(quarter[:, 0]))
    return float(np.clip(np.interp(wished, rising, s) / s[-1], 0.2, 0.7))


def _attractor(body: BodySections, levels: Mapping[str, float]) -> Callable[[FloatArray], FloatArray]:
    """Return the nearest place on the scan for every point, hollows between bust points and along the spine bridged.

    As tape and cloth bridge them: all the way at the bust, less and less up to the pit of the neck.
    """
    from scipy.interpolate import RegularGridInterpolator

    slicer, points, triangles = body.slicer, body.vertices, body.slicer.triangles
    upper = points[triangles][:, :, 1].mean(axis=1) > 0.6 * points[:, 1].max()
    # The arms are no part of chest and shoulders: what lies beyond planes that lean outward from the armpits.
    middle = points[triangles].mean(axis=1)
    height, half = min((y, abs(x)) for x, y, _ in body.armpits.values())
    inside = np.abs(middle[:, 0]) < half + np.tan(_ARM_LEAN) * np.maximum(middle[:, 1] - height, 0.0) + 0.004
    surface = Mesh(points, triangles[upper & inside])
    reach = 0.95 * min(abs(a[0]) for a in body.armpits.values())
    x = np.linspace(-reach, reach, 61)
    y = np.linspace(levels["bust"] - 0.02, levels["front_neck"], 24)
    fronts, backs = np.zeros((len(y), len(x))), np.zeros((len(y), len(x)))
    for i, height in enumerate(y):
        flat = slicer.points(UP, float(height))[:, [0, 2]]
        flat = flat[np.abs(flat[:, 0]) <= 1.02 * reach]
        middle = 0.5 * (flat[:, 1].min() + flat[:, 1].max())
        fronts[i] = _upper_side(flat[flat[:, 1] > middle], x)
        backs[i] = -_upper_side(flat[flat[:, 1] <= middle] * np.array([1.0, -1.0]), x)
    front = RegularGridInterpolator((y, x), fronts, bounds_error=False, fill_value=None)
    back = RegularGridInterpolator((y, x), backs, bounds_error=False, fill_value=None)

    def attract(where: FloatArray) -> FloatArray:
        _, _, place = surface.closest(where)
        at = place[:, [1, 0]]
        share = np.clip((levels["front_neck"] - place[:, 1]) / (levels["front_neck"] - levels["bust"]), 0.0, 1.0)
        # Towards the armholes the bridge fades out.
        share = smoothstep(share) * np.clip((1.0 - np.abs(place[:, 0]) / reach) / 0.1, 0.0, 1.0)
        ahead, behind = front(at), back(at)
        is_front = place[:, 2] > 0.5 * (ahead + behind)
        bridge = np.where(is_front, np.maximum(ahead - place[:, 2], 0.0), np.minimum(behind - place[:, 2], 0.0))
        # What lies deeper than any hollow of chest or back is a shoulder or an arm, not a hollow.
        place[:, 2] += np.where(np.abs(bridge) < 0.04, share * bridge, 0.0)
        return place

    return attract


def _upper_side(points: FloatArray, x: FloatArray) -> FloatArray:
    """Return the upper side of the convex hull of points (x, z), at `x`."""
    if not len(points):
        return np.full(len(x), -np.inf)
    points = points[np.lexsort(points.T[::-1])]
    return np.asarray(np.interp(x, *points[upper_hull(points)].T))


def average_sides(vertices: FloatArray, layout: Layout) -> FloatArray:
    """Return the average of a body and its mirror image, girths kept (layout.vertex_count by 3 [m])."""
    out = 0.5 * (vertices + _mirror_image(vertices, layout))
    for ring in layout.rings[: layout.level_row["bust"] + 1]:
        out[ring] = scale_to_girth(out[ring], convex_girth(vertices[ring]))
    for grid in layout.legs.values():
        for row in grid[layout.leg_row["leg_thigh"] :]:
            girth = 0.5 * (convex_girth(vertices[row]) + convex_girth(vertices[layout.mirror[row]]))
            out[row] = scale_to_girth(out[row], girth)
    return out


def sides_note(vertices: FloatArray, layout: Layout, *, averaged: bool) -> tuple[str, ...]:
    """Return one sentence if left and right of a body differ by more than 10 mm across its surface, else nothing.

    Args:
        vertices: layout.vertex_count by 3 [m], before they are averaged.
        layout: the grid.
        averaged: whether they will be.
    """
    normals = vertex_normals(vertices, layout.faces)
    apart = np.abs(np.einsum("vk,vk->v", vertices - _mirror_image(vertices, layout), normals))
    limbs = {"arms": list(layout.arms.values()), "legs": list(layout.legs.values())}
    parts = {name: np.unique(np.concatenate([grid.ravel() for grid in grids])) for name, grids in limbs.items()}
    parts = {"trunk": np.setdiff1d(np.arange(layout.vertex_count), np.concatenate([*parts.values()])), **parts}
    unlike = []
    for name, of_part in parts.items():
        worst = of_part[np.argmax(apart[of_part])]
        if apart[worst] > _TOLD:
            unlike.append(f"{name} by up to {1000.0 * apart[worst]:.0f} mm at a height of {vertices[worst, 1]:.2f} m")
    if not unlike:
        return ()
    done = "their average is taken; symmetric = false keeps them" if averaged else "they are kept"
    return (f"left and right differ: {', '.join(unlike)}; {done}",)


def _mirror_image(vertices: FloatArray, layout: Layout) -> FloatArray:
    return reflected(vertices[layout.mirror], AXES["+x"])
