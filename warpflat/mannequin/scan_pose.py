"""A scan brought upright: its unit, up axis and facing are found from the body's shape."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError, nearest
from warpflat.mannequin.scan_axes import across_trunk, find_facing, find_legs
from warpflat.mannequin.scan_holes import close_holes
from warpflat.mannequin.scan_noise import smooth_noise
from warpflat.mannequin.slicer import Slicer
from warpflat.surface.connectivity import join_labels
from warpflat.surface.repair.stray_vertex import stray_vertex, stray_words

__all__ = ["LANDMARKS", "LEVELS_UP", "ScanOptions", "turn_scan_upright"]

_UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "in": 0.0254}
_AXES = {s + a: sign * np.eye(3)["xyz".index(a)] for s, sign in (("+", 1.0), ("-", -1.0)) for a in "xyz"}
_STATURE = (0.9, 2.3)
#: Levels of trunk and legs, from the floor up.
LEVELS_UP = (
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
)
#: Landmarks whose heights a user may give.
LANDMARKS = (*LEVELS_UP, "calf", "crotch", "wrist", "elbow")
# Pieces of so small a share of the faces are left out, if they are no more than so many together.
_LOOSE, _LOOSE_TOGETHER = 0.01, 0.05


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
            if axis is not None and axis not in _AXES:
                raise InputError(f"scan {name} {axis!r} is no axis: {nearest(axis, _AXES)}")
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
    welded, scanned, loose = _without_loose_pieces(*_welded(vertices, faces))
    points, triangles, holes = close_holes(welded, scanned)
    points, noise = smooth_noise(points, triangles)
    notes = [f"loose pieces of less than 1 % of the scan's faces were left out: {loose}"] if loose else []
    candidates = [options.up] if options.up else list(_AXES)
    slicer = Slicer(points, triangles)
    rated = [(find_legs(slicer, _AXES[a]), a) for a in candidates]
    (score, sideways), up_name = max(rated, key=lambda r: r[0][0])
    sits = options.keep_pose and score < 0.6
    if sits:
        rated = [(find_legs(slicer, _AXES[a], sits=True), a) for a in candidates]
        (score, sideways), up_name = max(rated, key=lambda r: r[0][0])
    if score < 0.6 or sideways is None:
        seen = "with the given up axis " if options.up else "in any direction "
        raise InputError(
            f"scan: {seen}no two separate legs under one trunk and head; a standing body with feet apart is needed"
        )
    up = _AXES[up_name]
    height = float(np.ptp(points @ up))
    unit = options.unit or _unit_of(height)
    size = height * _UNITS[unit]
    if not _STATURE[0] <= size <= _STATURE[1]:
        raise InputError(
            f"scan: {size:.3g} m tall if its unit is {unit}: a body is {_STATURE[0]} to {_STATURE[1]} m tall"
        )
    if options.unit is None and unit != "m":
        notes.append(f"the scan's unit was found from its height of {height:.4g}: {unit}")
    if up_name != "+y":
        notes.append(f"the scan's head was found towards {up_name}")
    left = sideways / np.linalg.norm(sideways) if sits else across_trunk(slicer, up, sideways)
    ahead = np.cross(left, up)
    if options.facing:
        wished = _AXES[options.facing] - up * (_AXES[options.facing] @ up)
        if abs(ahead @ wished) < 0.7:
            raise InputError(f"scan: it does not face {options.facing}: its legs stand side by side along that axis")
        turn = float(np.sign(ahead @ wished))
    else:
        turn = 1.0 if sits else find_facing(slicer, up, ahead)
    frame = np.array([left * turn, up, ahead * turn])
    if options.facing is None and frame[2, 2] < 0.9:
        notes.append(f"the scan was found to face ({frame[2, 0]:+.2f}, {frame[2, 1]:+.2f}, {frame[2, 2]:+.2f})")
    new = points @ frame.T * _UNITS[unit]
    new[:, 1] -= new[:, 1].min()
    trunk = Slicer(new, triangles).cut(np.array([0.0, 1.0, 0.0]), 0.55 * size)
    new[:, 0] -= 0.5 * (trunk[0].points[:, 0].min() + trunk[0].points[:, 0].max())
    if noise:
        notes.append(f"the scan is noisy by {1000.0 * noise * _UNITS[unit]:.1f} mm; it was smoothed")
    if holes:
        length, place = max(holes, key=lambda hole: hole[0])
        x, y, z = place @ frame.T * _UNITS[unit] + (new[0] - points[0] @ frame.T * _UNITS[unit])
        notes.append(
            f"holes closed by smooth patches: {len(holes)}, the longest {length * _UNITS[unit]:.2f} m around "
            f"at ({x:.2f}, {y:.2f}, {z:.2f}) m"
        )
    if sits:
        notes.append(
            "the scan sits; its mannequin stands, and warpflat fit --keep-pose carries a garment to it as it sits"
        )
    upright = Slicer(new, triangles, noise * _UNITS[unit], len(scanned))
    upright.sits = sits
    upright.placed = frame.T * _UNITS[unit], new[0] - points[0] @ frame.T * _UNITS[unit]
    return upright, notes


def _welded(vertices: FloatArray, faces: NDArray[np.int64]) -> tuple[FloatArray, NDArray[np.int64]]:
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
    _, first, inverse = np.unique(
        np.round(vertices / (1e-6 * span)).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    triangles = np.ravel(inverse)[triangles]
    solid = (
        (triangles[:, 0] != triangles[:, 1])
        & (triangles[:, 1] != triangles[:, 2])
        & (triangles[:, 2] != triangles[:, 0])
    )
    triangles = triangles[solid]
    used, local = np.unique(triangles, return_inverse=True)
    return vertices[first[used]].astype(float), np.ravel(local).reshape(-1, 3).astype(np.int64)


def _without_loose_pieces(
    points: FloatArray, triangles: NDArray[np.int64]
) -> tuple[FloatArray, NDArray[np.int64], int]:
    """Return a mesh without its small pieces, as floor plates and slivers, and how many these were.

    A scan that is torn into small pieces keeps them.
    """
    label = join_labels(len(points), triangles[:, :2].ravel(), triangles[:, 1:].ravel())[triangles[:, 0]]
    _, piece, count = np.unique(label, return_inverse=True, return_counts=True)
    small = count < _LOOSE * len(triangles)
    if not small.any() or count[small].sum() > _LOOSE_TOGETHER * len(triangles):
        return points, triangles, 0
    used, kept = np.unique(triangles[~small[piece.ravel()]], return_inverse=True)
    return points[used], kept.reshape(-1, 3), int(small.sum())


def _unit_of(height: float) -> str:
    for unit, factor in _UNITS.items():
        if _STATURE[0] <= height * factor <= _STATURE[1]:
            return unit
    raise InputError(
        f"scan: {height:.4g} tall in its own unit, which is a body's height in none of {', '.join(_UNITS)}; scale it"
    )
