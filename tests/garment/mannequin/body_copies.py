"""Changed copies of a standing body mesh: turned, scaled, with noise, with holes, and bent by a skeleton of two bones a limb."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

#: Name, and how far arms and legs are lifted outwards [degrees].
_POSES = {"arms down": (-22.0, 0.0), "arms level": (45.0, 0.0), "arms up": (65.0, 0.0), "legs apart": (0.0, 6.0)}
COPIES = ("as it is", "turned 90", "turned 180", "in cm", "in mm", "noise", "holes", *_POSES)


def copy_of_body(
    points: np.ndarray, faces: np.ndarray, name: str, armpit: float, crotch: float, half: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return a copy of a body, vertices [m] and faces; turned and scaled by `as_given`.

    Args:
        points: #V by 3 [m], Y up, facing +Z, the midplane at x = 0, feet at y = 0.
        faces: #F by 4, -1 in the last column for a triangle.
        name: one of COPIES.
        armpit, crotch: heights [m].
        half: half the trunk's width at the armpits [m].
    """
    random = np.random.default_rng(7)
    if name == "noise":
        return points + random.normal(0.0, 0.002, points.shape), faces
    if name == "holes":
        # Forty round patches of 25 mm radius, as where a scanner did not see.
        centres = points[random.integers(len(points), size=40)]
        middle = points[faces[:, :3]].mean(axis=1)
        near = (np.linalg.norm(middle[:, None] - centres, axis=2) < 0.025).any(axis=1)
        return points, faces[~near]
    if name in _POSES:
        return _posed(points, faces, *np.radians(_POSES[name]), armpit, crotch, half), faces
    return points, faces


def as_given(points: np.ndarray, name: str) -> np.ndarray:
    """Return a copy's vertices as the package is given them."""
    factor = {"in cm": 100.0, "in mm": 1000.0}.get(name, 1.0)
    angle = {"turned 90": 0.5 * np.pi, "turned 180": np.pi}.get(name, 0.0)
    c, s = np.cos(angle), np.sin(angle)
    return factor * points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _smoothstep(t: np.ndarray) -> np.ndarray:
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _posed(
    points: np.ndarray, faces: np.ndarray, arm: float, leg: float, armpit: float, crotch: float, half: float
) -> np.ndarray:
    """Return vertices after arms turn about the shoulders and legs about the hip joints, outwards in the frontal plane.

    Weights grow from 0 to 1 with the distance beyond a joint: 60 mm along an arm, from hip joint to crotch on a leg.
    """
    out = points.copy()
    stature = np.ptp(points[:, 1])
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    for side in (1.0, -1.0):
        x = side * points[:, 0]
        beyond = x - half - np.tan(np.radians(9.0)) * np.maximum(points[:, 1] - armpit, 0.0)
        outer = ends[(beyond[ends] > 0.0).all(axis=1)]
        label = connected_components(coo_matrix((np.ones(len(outer)), outer.T), (len(points),) * 2), directed=False)[1]
        limb = label == label[int(np.argmax(x))]
        ring = points[limb & (beyond < 0.02) & (points[:, 1] > armpit)]
        out = _turned(out, _smoothstep(beyond / 0.06) * limb, 0.5 * (ring.min(axis=0) + ring.max(axis=0)), side * arm)
        joint = np.array([side * 0.055 * stature, 0.53 * stature, 0.0])
        weight = _smoothstep((joint[1] + 0.02 * stature - points[:, 1]) / (joint[1] + 0.04 * stature - crotch))
        out = _turned(out, weight * (x > 0.0) * ~limb, joint, side * leg)
    return out


def _turned(points: np.ndarray, weight: np.ndarray, about: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    turned = (points - about) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + about
    return points + weight[:, None] * (turned - points)
