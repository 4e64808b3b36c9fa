"""Tapes around head, arms, hands, legs and feet of a body mesh with trimesh and SciPy alone."""

from __future__ import annotations

import numpy as np
import trimesh
from body_tapes import plane_parts, section_parts
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import ConvexHull


def _parts(mesh: trimesh.Trimesh, at: np.ndarray, normal: np.ndarray) -> list[np.ndarray]:
    """Return the connected parts of a plane section that are more than slivers, each #P by 3."""
    return [p for p in plane_parts(mesh, at, normal) if len(p) > 5]


def _girth(points: np.ndarray, normal: np.ndarray) -> float:
    axes = np.linalg.svd(normal[None])[2][1:]
    return float(ConvexHull(points @ axes.T).area)


def _near(parts: list[np.ndarray], at: np.ndarray) -> np.ndarray:
    """Return the largest part with its middle within 30 mm of a point, or else the nearest: noise leaves slivers."""
    away = [float(np.linalg.norm(0.5 * (p.min(axis=0) + p.max(axis=0)) - at)) for p in parts]
    near = [p for p, d in zip(parts, away, strict=True) if d < max(0.03, min(away) + 1e-9)]
    return max(near, key=lambda p: np.linalg.norm(np.ptp(p, axis=0)))


def tape_across(mesh: trimesh.Trimesh, at: np.ndarray, normal: np.ndarray) -> tuple[float, float]:
    """Return height and girth [m] of a tape across `normal` around the largest part of the section with its middle near."""
    part = _near(_parts(mesh, at, normal), at)
    return float(0.5 * (part[:, 1].min() + part[:, 1].max())), _girth(part, normal)


def leg_tapes(mesh: trimesh.Trimesh, crotch: float, left: bool, knee_height: float) -> dict[str, tuple[float, float]]:
    """Return level tapes around one leg of a body on the floor y = 0: thigh, knee at its known height [m], calf, ankle.

    Calf fullest, ankle narrowest, thigh 0.03 of the stature below the crotch.
    """
    stature = mesh.vertices[:, 1].max()
    y = np.arange(0.04 * stature, crotch, 0.002)
    sides = [max(section_parts(mesh, at)[:2], key=lambda p: p[:, 0].mean() * (1.0 if left else -1.0)) for at in y]
    girth = gaussian_filter1d([ConvexHull(s).area for s in sides], 3.0)
    share = y / crotch
    calf = int(np.argmax(np.where((share > 0.3) & (y < 0.85 * knee_height), girth, 0.0)))
    ankle = int(np.argmin(np.where(share < 0.3, girth, np.inf)))
    thigh = int(np.argmin(np.abs(y - crotch + 0.03 * stature)))
    places = {"thigh": thigh, "calf": calf, "ankle": ankle}
    knee = max(section_parts(mesh, knee_height)[:2], key=lambda p: p[:, 0].mean() * (1.0 if left else -1.0))
    return {
        "knee": (knee_height, float(ConvexHull(knee).area)),
        **{name: (float(y[i]), float(ConvexHull(sides[i]).area)) for name, i in places.items()},
    }


def foot_tape(mesh: trimesh.Trimesh, left: bool) -> tuple[float, float]:
    """Return the tape around a foot where it is broadest across its length, which runs where it is narrowest."""
    side = 1.0 if left else -1.0
    low = mesh.vertices[(mesh.vertices[:, 1] < 0.025 * mesh.vertices[:, 1].max()) & (side * mesh.vertices[:, 0] > 0)]
    angles = np.radians(np.arange(-40.0, 40.0, 0.5))
    narrow = angles[int(np.argmin([np.ptp(low @ [np.cos(a), 0.0, -np.sin(a)]) for a in angles]))]
    axis = np.array([np.sin(narrow), 0.0, np.cos(narrow)])
    along = low @ axis
    best = (0.0, 0.0, 0.0)
    for at in along.min() + np.arange(0.6, 0.8, 0.01) * np.ptp(along):
        flat = np.concatenate(
            [p for p in _parts(mesh, at * axis, axis) if p[:, 1].max() < 0.16 and side * p[:, 0].mean() > 0]
        )
        best = max(
            best, (float(np.ptp(flat @ np.cross(axis, [0, 1, 0]))), float(flat[:, 1].max() / 2), _girth(flat, axis))
        )
    return best[1:]


def head_tape(mesh: trimesh.Trimesh) -> tuple[float, float]:
    """Return the fullest level tape around the head above the ears, where its width leaps."""
    y = np.arange(0.985, 0.90, -0.001) * mesh.vertices[:, 1].max()
    parts = [section_parts(mesh, at)[0] for at in y]
    width = np.array([np.ptp(p[:, 0]) for p in parts])
    ears = next((i for i in range(30, len(y) - 4) if width[i + 4] > 1.08 * width[i]), len(y))
    girth = [ConvexHull(p).area for p in parts[:ears]]
    return float(y[int(np.argmax(girth))]), float(max(girth))


def arm_tapes(
    mesh: trimesh.Trimesh, armpit: float, tip: int, bones: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> dict[str, tuple[float, float]]:
    """Return tapes around an arm: biceps and wrist across their bones, elbow across both, hand across its palm.

    Biceps: fullest from 0.02 of the stature beyond the armpit. Wrist: narrowest. Hand: halfway from where the thumb parts
    from the palm to where the fingers part.

    Args:
        mesh: the body, its floor at y = 0.
        armpit: its height [m].
        tip: the vertex at the fingertip.
        bones: the middles of wrist and elbow [m] and the unit direction of the upper arm from there.
    """
    side = float(np.sign(mesh.vertices[tip, 0]))
    v, stature = mesh.vertices, mesh.vertices[:, 1].max()
    at_wrist, elbow, upper = bones
    forearm_length = float(np.linalg.norm(elbow - at_wrist))
    lower = (elbow - at_wrist) / forearm_length
    found = {"elbow": tape_across(mesh, elbow, (lower + upper) / np.linalg.norm(lower + upper))}
    trunk = max((p for p in _parts(mesh, np.array([0, armpit - 0.002, 0]), np.array([0, 1.0, 0]))
                 if p[:, 0].min() < 0 < p[:, 0].max()), key=lambda p: np.ptp(p[:, 0]))  # fmt: skip
    pit = trunk[int(np.argmax(side * trunk[:, 0]))]
    reach = float((pit - elbow) @ upper) - 0.02 * stature
    found["biceps"] = max(
        (tape_across(mesh, elbow + s * upper, upper) for s in np.arange(0.02, reach, 0.002)), key=lambda t: t[1]
    )
    forearm = [elbow - s * lower for s in np.arange(0.5, 1.08, 0.005) * forearm_length]
    girths = [tape_across(mesh, at, lower)[1] for at in forearm]
    wrist = forearm[int(np.argmin(girths))]
    found["wrist"] = tape_across(mesh, wrist, lower)
    palm = v[tip] - wrist
    length = np.linalg.norm(palm)
    axis = palm / length
    palms: list[tuple[int, float, float]] = []
    for s in np.arange(0.3, 0.64, 0.01) * length:
        parts = [
            p for p in _parts(mesh, wrist + s * axis, axis) if np.linalg.norm(p.mean(axis=0) - wrist - s * axis) < 0.1
        ]
        if parts:
            palm = max(parts, key=lambda p: _girth(p, axis))
            palms.append((len(parts), float(0.5 * (palm[:, 1].min() + palm[:, 1].max())), _girth(palm, axis)))
    thumb = next((i for i, of in enumerate(palms) if of[0] > 1), None)
    if thumb is not None:
        # Where the fingers part, the girth of the largest part falls.
        ends = (i for i in range(thumb + 1, len(palms)) if palms[i][2] < 0.92 * palms[i - 1][2])
        found["hand"] = palms[(thumb + next(ends, len(palms)) - 1) // 2][1:]
    return found
