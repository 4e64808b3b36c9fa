"""A scan brought upright: its unit, up axis and facing are found from the body's shape."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpflat.core import AXES, FloatArray, InputError, nearest, unit
from warpflat.flat import METRES_PER_UNIT, join_labels, stray_vertex, stray_words
from warpflat.garment.mannequin.layout import TRUNK_RINGS
from warpflat.garment.mannequin.sampled import summit
from warpflat.garment.mannequin.scan_repair import find_holes, smooth_noise, turned_outward
from warpflat.garment.mannequin.slicer import UP, Slicer, plane_axes

__all__ = ["LANDMARKS", "LEVELS_UP", "ScanOptions", "across_trunk", "find_facing", "find_legs", "turn_scan_upright"]

_UNITS = {name: METRES_PER_UNIT[name] for name in ("m", "dm", "cm", "mm", "in")}
_STATURE = (0.9, 2.3)
#: Landmarks of legs and trunk, from the floor up.
LEVELS_UP = ("ankle", "calf", "knee", "thigh", "crotch", *TRUNK_RINGS, "armpit", "front_neck", "side_neck")
#: Landmarks whose heights a user may give.
LANDMARKS = (*LEVELS_UP, "wrist", "elbow")
# Pieces of so small a share of the faces are left out, if they are no more than so many together.
_LOOSE, _LOOSE_TOGETHER = 0.01, 0.05
# The trunk looks at most so far away from where the legs do [half degrees].
_TURNED = 80
# The lower legs of a body that sits lie so far before its trunk, as shares of its height.
_BEFORE = 0.05, 0.5
#: A part of a section: area and centroid of its convex hull in the section's plane, in the scan's unit.
_Part: TypeAlias = tuple[float, FloatArray]


@dataclass(frozen=True, kw_only=True)
class ScanOptions:
    """Known properties of a scan; values left at None are found from the body's shape.

    Attributes:
        unit: ``m``, ``dm``, ``cm``, ``mm`` or ``in``.
        up: axis that points to the head, as ``+y``.
        facing: axis towards which the body looks, as ``+z``.
        landmarks: known heights above the floor [m]: bust, waist, hip, armpit, elbow, ...; the body model's fit follows them.
        keep_pose: whether the mannequin keeps the scan's pose of arms and legs; else it stands as a tape asks.
        symmetric: whether the mannequin is the average of left and right; else each side is kept.
    """

    unit: str | None = None
    up: str | None = None
    facing: str | None = None
    landmarks: Mapping[str, float] = field(default_factory=dict)
    keep_pose: bool = False
    symmetric: bool = True

    def check(self) -> None:
        """Check the values.

        Raises:
            InputError: an unknown unit, axis or landmark.
        """
        if self.unit is not None and self.unit not in _UNITS:
            raise InputError(f"scan unit {self.unit!r} is unknown: {nearest(self.unit, _UNITS)}")
        for name in ("up", "facing"):
            axis = getattr(self, name)
            if axis is not None and axis not in AXES:
                raise InputError(f"scan {name} {axis!r} is no axis: {nearest(axis, AXES)}")
        if self.up and self.facing and self.up[1] == self.facing[1]:
            raise InputError(f"scan: up {self.up} and facing {self.facing} lie on one axis; give two different ones")
        for name, height in self.landmarks.items():
            if name not in LANDMARKS:
                raise InputError(f"scan landmark {name!r} is unknown: {nearest(name, LANDMARKS)}")
            if not 0.0 < height < _STATURE[1]:
                raise InputError(f"scan landmark {name} = {height:g} m: a height above the floor, 0 to {_STATURE[1]} m")


def turn_scan_upright(vertices: FloatArray, faces: NDArray[np.int64], options: ScanOptions) -> tuple[Slicer, list[str]]:
    """Bring a scan to metres, Y up, facing +Z, feet on y = 0, the midplane at x = 0.

    Args:
        vertices: #V by 3, any unit.
        faces: #F by 3 or 4, -1 in the last column for a triangle.
        options: what the user knows about the scan.

    Returns:
        The scan's slicer (vertices welded [m]), and notes of what was found, one sentence each.

    Raises:
        InputError: if the mesh is no body that stands on two legs, or its facing cannot be found.
    """
    options.check()
    welded, scanned, loose = _welded(vertices, faces)
    if not len(scanned):
        raise InputError(
            "scan: no face is left where vertices that lie at one place are joined; its places need more digits, or it lies too far from "
            "the origin"
        )
    triangles, turned = turned_outward(welded, scanned)
    holes = find_holes(welded, triangles)
    points, noise = smooth_noise(welded, triangles)
    notes = [f"loose pieces of less than 1 % of the scan's faces were left out: {loose}"] if loose else []
    if turned:
        notes.append(f"faces of the scan that were wound inward were turned: {turned} of {len(scanned)}")
    candidates = [options.up] if options.up else list(AXES)
    slicer = Slicer(points, triangles)
    rated = [(find_legs(slicer, AXES[a]), a) for a in candidates]
    (score, sideways), up_name = max(rated, key=lambda r: r[0][0])
    sits = options.keep_pose and score < 0.6
    if sits:
        rated = [(find_legs(slicer, AXES[a], sits=True), a) for a in candidates]
        (score, sideways), up_name = max(rated, key=lambda r: r[0][0])
    if score < 0.6 or sideways is None:
        seen = "with the given up axis " if options.up else "in any direction "
        raise InputError(
            f"scan: {seen}no two separate legs under one trunk and head; a standing body with feet apart is needed"
        )
    up = AXES[up_name]
    height = float(np.ptp(points @ up))
    could_be = (name for name, factor in _UNITS.items() if _STATURE[0] <= height * factor <= _STATURE[1])
    unit_name = options.unit or next(could_be, None)
    if unit_name is None:
        raise InputError(
            f"scan: {height:.4g} tall in its own unit, which is a body's height in none of {', '.join(_UNITS)}; scale it"
        )
    size = height * _UNITS[unit_name]
    if not _STATURE[0] <= size <= _STATURE[1]:
        raise InputError(
            f"scan: {size:.3g} m tall if its unit is {unit_name}: a body is {_STATURE[0]} to {_STATURE[1]} m tall"
        )
    if options.unit is None and unit_name != "m":
        notes.append(f"the scan's unit was found from its height of {height:.4g}: {unit_name}")
    if up_name != "+y":
        notes.append(f"the scan's head was found towards {up_name}")
    left = unit(sideways) if sits else across_trunk(slicer, up, sideways)
    ahead = np.cross(left, up)
    if options.facing:
        wished = AXES[options.facing] - up * (AXES[options.facing] @ up)
        if abs(ahead @ wished) < 0.7:
            raise InputError(f"scan: it does not face {options.facing}: its legs stand side by side along that axis")
        turn = float(np.sign(ahead @ wished))
    else:
        turn = 1.0 if sits else find_facing(slicer, up, ahead)
    frame = np.array([left * turn, up, ahead * turn])
    if options.facing is None and frame[2, 2] < 0.9:
        notes.append(f"the scan was found to face ({frame[2, 0]:+.2f}, {frame[2, 1]:+.2f}, {frame[2, 2]:+.2f})")
    new = points @ frame.T * _UNITS[unit_name]
    new[:, 1] -= new[:, 1].min()
    trunk = Slicer(new, triangles).cut(UP, 0.55 * size)
    new[:, 0] -= 0.5 * (trunk[0].points[:, 0].min() + trunk[0].points[:, 0].max())
    if noise:
        notes.append(f"the scan is noisy by {1000.0 * noise * _UNITS[unit_name]:.1f} mm; it was smoothed")
    if holes:
        length, place = max(holes, key=lambda hole: hole[0])
        x, y, z = place @ frame.T * _UNITS[unit_name] + (new[0] - points[0] @ frame.T * _UNITS[unit_name])
        notes.append(
            f"holes, over which the body model's skin is taken: {len(holes)}, the longest {length * _UNITS[unit_name]:.2f} m around "
            f"at ({x:.2f}, {y:.2f}, {z:.2f}) m"
        )
    if sits:
        notes.append(
            "the scan sits; its mannequin stands, and warpflat fit --keep-pose carries a garment to it as it sits"
        )
    upright = Slicer(new, triangles, noise * _UNITS[unit_name])
    upright.sits = sits
    upright.placed = frame.T * _UNITS[unit_name], new[0] - points[0] @ frame.T * _UNITS[unit_name]
    return upright, notes


def _welded(vertices: FloatArray, faces: NDArray[np.int64]) -> tuple[FloatArray, NDArray[np.int64], int]:
    """Return the triangles of a mesh without its small pieces, as floor plates and slivers, their vertices, and how many these were.

    Vertices that lie at one place are joined. A scan that is torn into small pieces keeps them.

    Raises:
        InputError: the mesh is broken, or no scan.
    """
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] not in (3, 4):
        raise InputError(
            f"scan: vertices {vertices.shape} and faces {faces.shape}; #V by 3 and #F by 3 or 4 are needed"
        )
    if len(faces) < 100:
        raise InputError(f"scan: {len(faces)} faces; a body scan has thousands")
    if faces.min(initial=0) < -1 or faces.max(initial=0) >= len(vertices):
        raise InputError(f"scan: a face names vertex {int(faces.max())}, but there are {len(vertices)} vertices")
    used = np.unique(faces[faces >= 0])
    if not np.isfinite(vertices[used]).all():
        raise InputError(f"scan: vertex {int(used[~np.isfinite(vertices[used]).all(axis=1)][0])} is not finite")
    triangles = faces[:, :3]
    if faces.shape[1] == 4:
        triangles = np.concatenate([triangles, faces[faces[:, 3] >= 0][:, [0, 2, 3]]])
    span = float(np.ptp(vertices[used], axis=0).max())
    if span <= 0.0:
        raise InputError("scan: all its vertices lie at one point")
    if (stray := stray_vertex(vertices[used])) is not None:
        raise InputError(f"scan: {stray_words(int(used[stray]), vertices[used[stray]])}")
    grid = np.round((vertices[used] - vertices[used].min(axis=0)) / (1e-6 * span)).astype(np.int64)
    _, first, inverse = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    triangles = np.ravel(inverse)[np.searchsorted(used, triangles)]
    solid = (
        (triangles[:, 0] != triangles[:, 1])
        & (triangles[:, 1] != triangles[:, 2])
        & (triangles[:, 2] != triangles[:, 0])
    )
    triangles = triangles[solid]
    kept, local = np.unique(triangles, return_inverse=True)
    points, triangles = vertices[used[first[kept]]].astype(float), np.ravel(local).reshape(-1, 3).astype(np.int64)
    label = join_labels(len(points), triangles[:, :2].ravel(), triangles[:, 1:].ravel())[triangles[:, 0]]
    _, piece, count = np.unique(label, return_inverse=True, return_counts=True)
    small = count < _LOOSE * len(triangles)
    if not small.any() or count[small].sum() > _LOOSE_TOGETHER * len(triangles):
        return points, triangles, 0
    kept, local = np.unique(triangles[~small[piece.ravel()]], return_inverse=True)
    return points[kept], local.reshape(-1, 3), int(small.sum())


# --- which way it stands and looks, found from legs, trunk and feet


def _hull_area_and_middle(points: FloatArray) -> tuple[float, FloatArray]:
    """Return the area and the centroid of the convex hull of plane points, which do not depend on the plane's axes."""
    import shapely

    hull = shapely.convex_hull(shapely.MultiPoint(points))
    return float(hull.area), shapely.get_coordinates(hull.centroid)[0]


def find_legs(slicer: Slicer, up: FloatArray, *, sits: bool = False) -> tuple[float, FloatArray | None]:
    """Rate how much the mesh is like a standing body if `up` is up; or like one that sits, its legs before its trunk.

    Returns:
        A score from 0 to 1, and the direction from leg to leg; None without legs. That of a body that sits is the one across the way
        from its trunk to its legs, towards its left.
    """
    points = slicer.vertices
    low, high = float((points @ up).min()), float((points @ up).max())
    across = plane_axes(up)

    def parts(share: float) -> list[_Part]:
        """Return the parts of a horizontal section, largest first, of at least 15 % of the largest one's area."""
        cut = slicer.cut(up, low + share * (high - low))
        found = sorted((_hull_area_and_middle(part.points @ across.T) for part in cut), key=lambda part: -part[0])
        return [part for part in found if part[0] > 0.15 * found[0][0]]

    # Whoever sits shows lower legs alone.
    levels = np.linspace(0.07, 0.25 if sits else 0.40, 12)
    pairs = [legs for share in levels if _is_pair(legs := parts(float(share)))]
    if not pairs:
        return 0.0, None
    apart = [legs[0][1] - legs[1][1] for legs in pairs]
    direction = np.mean([a * np.sign(a @ apart[0]) for a in apart], axis=0)
    if np.linalg.norm(direction) == 0.0:
        return 0.0, None
    middle = np.mean([0.5 * (legs[0][1] + legs[1][1]) for legs in pairs], axis=0)
    sideways, trunk, score = direction @ across, parts(0.62), len(pairs) / len(levels)
    if sits and trunk:
        ahead = middle - trunk[0][1]
        away, middle = float(np.linalg.norm(ahead)), trunk[0][1]
        if not _BEFORE[0] * (high - low) < away < _BEFORE[1] * (high - low):
            return 0.0, None
        sideways = np.cross(up, ahead @ across)
    head, reach = parts(0.93), 0.12 * (high - low)
    # One trunk stands over the legs' middle and one head over the trunk; a child's head may be the broader. A bowed head lets chin and nose
    # fall into parts of their own.
    stands = (
        len(trunk) > 0
        and np.linalg.norm(trunk[0][1] - middle) < reach
        and len(head) > 0
        and not _is_pair(head)
        and np.linalg.norm(head[0][1] - middle) < 1.5 * reach
        and head[0][0] < 1.5 * trunk[0][0]
        and trunk[0][0] < (0.42 * (high - low)) ** 2
    )
    return score if stands else 0.0, sideways


def _is_pair(legs: list[_Part]) -> bool:
    """Return whether parts of a section are two of similar size, as those of two legs are."""
    return len(legs) == 2 and legs[0][0] < 2.0 * legs[1][0]


def across_trunk(slicer: Slicer, up: FloatArray, sideways: FloatArray) -> FloatArray:
    """Return the unit direction across the trunk, at right angles to the plane in which it mirrors itself best.

    One foot ahead of the other turns the line from leg to leg, `sideways`, but not the trunk.
    """
    points = slicer.vertices
    low, high = float((points @ up).min()), float((points @ up).max())
    first = unit(sideways - up * (sideways @ up))
    axes = np.array([first, np.cross(up, first)])
    turns = np.radians(np.arange(0.0, 360.0, 0.5))
    way = np.array([np.cos(turns), np.sin(turns)])
    steps = np.arange(-_TURNED, _TURNED + 1.0)
    misses = np.zeros(len(steps))
    for share in np.linspace(0.52, 0.68, 9):
        parts = [part.points @ axes.T for part in slicer.cut(up, low + share * (high - low))]
        if not parts:
            continue
        rated = [(*_hull_area_and_middle(part), i) for i, part in enumerate(parts)]
        area, middle, trunk = max(rated, key=lambda part: part[0])
        reach = ((parts[trunk] - middle) @ way).max(axis=0)
        mirrored = np.array([np.roll(reach[::-1], 361 + 2 * step) for step in range(-_TURNED, _TURNED + 1)])
        misses += np.square(reach - mirrored).sum(axis=1) / max(area, 1e-12)
    best = int(np.clip(np.argmin(misses), 1, len(steps) - 2))
    # A mirror image is shifted by twice the turn of its plane.
    turn = np.radians(0.5) * summit(steps, misses, best)
    return np.cos(turn) * axes[0] + np.sin(turn) * axes[1]


def find_facing(slicer: Slicer, up: FloatArray, ahead: FloatArray) -> float:
    """Return +1 if the body looks along `ahead`, -1 if the other way.

    Feet reach forward from the ankles; the seat stands out behind the waist more than anything stands out in front.
    """
    points = slicer.vertices
    low, high = float((points @ up).min()), float((points @ up).max())
    size = high - low

    def band(a: float, b: float) -> FloatArray:
        share = (points @ up - low) / size
        return points[(share >= a) & (share <= b)] @ ahead

    votes = 0.0
    feet, ankles = band(0.0, 0.035), band(0.05, 0.08)
    if len(feet) > 20 and len(ankles) > 20:
        middle = 0.5 * (ankles.min() + ankles.max())
        votes += float(np.clip(((feet.max() - middle) - (middle - feet.min())) / (0.04 * size), -1.0, 1.0)) * 1.5

    def spans(a: float, b: float) -> tuple[float, float]:
        cuts = [slicer.cut(up, low + s * size) for s in np.linspace(a, b, 8)]
        trunks = [
            max(c, key=lambda p: _hull_area_and_middle(p.points @ plane_axes(up).T)[0]).points @ ahead
            for c in cuts
            if c
        ]
        return float(min(t.min() for t in trunks)), float(max(t.max() for t in trunks))

    waist_cuts = [slicer.cut(up, low + s * size) for s in np.linspace(0.60, 0.64, 5)]
    waist = np.concatenate([c[0].points @ ahead for c in waist_cuts if c])
    seat = spans(0.49, 0.55)
    votes += float(np.clip(((waist.min() - seat[0]) - (seat[1] - waist.max())) / (0.02 * size), -1.0, 1.0))
    if abs(votes) < 0.25:
        raise InputError("scan: front and back cannot be told apart by feet or seat; give facing, as facing = '+z'")
    return float(np.sign(votes))
