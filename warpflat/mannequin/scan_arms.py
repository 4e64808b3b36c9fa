"""The arms of a scanned body, sliced across their own centre lines, which a bent elbow turns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.mannequin.profiles import convex_girth
from warpflat.mannequin.slicer import Slicer
from warpflat.mannequin.summit import summit
from warpflat.surface.connectivity import join_labels

__all__ = ["ScanArm", "slice_arm", "tape_around"]

# The elbow where an arm does not show it: this share of the way from the shoulder point to the wrist.
_ELBOW = 0.575
# An arm shows its elbow where the centre line bends by this much [radians].
_BENT = np.radians(8.0)
# The bones' lines are fitted so far up and down the arm, as a share of the stature.
_NEAR_ELBOW = 0.09
#: How far the plane that parts the arm from the trunk leans outward from the armpit up.
_LEAN = np.radians(9.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanArm:
    """One arm, by shares of the way from the middle of its armhole to the fingertips.

    Attributes:
        cut: the arm's section through a point across a unit direction, #P by 3 [m].
        shares: #S, where the arm was sliced.
        line: #S by 3, middles of the sections [m].
        way: #S by 3, unit directions of the line towards the hand.
        reach: from the middle of the armhole to the fingertips [m].
        under, tip: shares of the armhole's lowest and highest point.
        elbow, wrist: shares.
        bent: true if the elbow was found from the bend of the line.
        wide: the elbow's share from half as long again a stretch of the line; bones and muscles disagree where it is another.
        limb: #L by 3, vertices of the arm [m].
    """

    cut: Callable[[FloatArray, FloatArray], FloatArray]
    shares: FloatArray
    line: FloatArray
    way: FloatArray
    reach: float
    under: float
    tip: float
    elbow: float
    wrist: float
    bent: bool
    wide: float
    limb: FloatArray

    def frame(self, share: float) -> tuple[FloatArray, FloatArray]:
        """Return the line's point [m] and unit direction at a share."""
        return _at(self.shares, self.line, share), _unit(_at(self.shares, self.way, share))

    def tape(self, share: float) -> tuple[float, float]:
        """Return height and girth [m] of a tape across the arm at a share.

        Raises:
            InputError: if the arm has no section there.
        """
        at, across = self.frame(share)
        return tape_around(self.cut(at, across), across)


def tape_around(points: FloatArray, across: FloatArray) -> tuple[float, float]:
    """Return the middle's height and the convex girth [m] of a section's points, #P by 3, in the plane across a direction."""
    first = np.eye(3)[int(np.argmin(np.abs(across)))]
    first = _unit(first - across * (first @ across))
    axes = np.array([first, np.cross(across, first)])
    return float(0.5 * (points[:, 1].min() + points[:, 1].max())), convex_girth(points @ axes.T)


def slice_arm(slicer: Slicer, hole: FloatArray, sign: float, side: str) -> ScanArm:
    """Return an arm's centre line, elbow and wrist.

    Args:
        slicer: the upright scan.
        hole: #P by 3, the closed armhole from its lowest point [m].
        sign: +1 for the left arm, -1 for the right one.
        side: ``left`` or ``right``, for messages.

    Raises:
        InputError: if the arm is missing or broken.
    """
    points, triangles = slicer.vertices, slicer.triangles
    middle = hole.mean(axis=0)
    normal = np.array([sign * np.cos(_LEAN), -np.sin(_LEAN), 0.0])
    limb = _beyond(points, triangles, normal, float(middle @ normal) + 0.004, middle)
    away = np.linalg.norm(limb - middle, axis=1)
    hand, reach = limb[int(np.argmax(away))], float(away.max())
    if reach < 0.2 * points[:, 1].max():
        raise InputError(f"scan: the {side} arm is only {reach:.2f} m long; its mesh is broken")
    axis = (hand - middle) / reach

    def cut(at: FloatArray, across: FloatArray) -> FloatArray:
        # The arm may be bent, so its section lies anywhere near; the trunk's and the legs' lie further off.
        near = [p for p in slicer.cut(across, float(at @ across))
                if len(p.points) > 6 and np.linalg.norm(p.points.mean(axis=0) - at) < 0.30 * reach
                and sign * p.points[:, 0].mean() > sign * middle[0]]  # fmt: skip
        if not near:
            raise InputError(f"scan: the {side} arm has no section at {at[1]:.2f} m; its mesh is broken there")
        return max(near, key=lambda p: p.length).points

    shares = np.linspace(0.14, 0.86, 37)
    line, way = _centre_line(cut, middle, reach * axis, shares)
    low = np.linspace(0.60, 0.84, 49)
    girths = []
    for share in low:
        across = _unit(_at(shares, way, float(share)))
        girths.append(tape_around(cut(_at(shares, line, float(share)), across), across)[1])
    # Where the scan's hand is missing, the arm's torn end gives sections of half its girth and less.
    whole = np.flatnonzero(girths > 0.6 * np.median(girths[:17]))
    wrist = float(low[whole[int(np.argmin(np.array(girths)[whole]))]])
    under, tip = (float((p - middle) @ axis) / reach for p in (hole[0], hole[int(np.argmax(hole[:, 1]))]))
    near = _NEAR_ELBOW * float(np.ptp(points[:, 1])) / reach
    elbow, bent = _elbow(shares, line, tip, wrist, near)
    wide, _ = _elbow(shares, line, tip, wrist, 1.5 * near)
    return ScanArm(
        cut=cut, shares=shares, line=line, way=way, reach=reach, under=under, tip=tip, elbow=elbow, wrist=wrist,
        bent=bent, wide=wide, limb=limb,
    )  # fmt: skip


def _elbow(shares: FloatArray, line: FloatArray, tip: float, wrist: float, near: float) -> tuple[float, bool]:
    """Return the share at which two straight bones that fit the centre line best meet, and whether they meet at an angle.

    Only `near` the elbow, as a share: farther off, muscles bend the line, not bones.
    """
    guess = tip + _ELBOW * (wrist - tip)
    joints = np.linspace(guess - 0.12, guess + 0.12, 49)
    best, angle = guess, 0.0
    for _ in range(2):
        rows = (np.abs(shares - best) < near) & (shares < wrist)
        s, p = shares[rows], line[rows]
        misses, angles = np.empty(len(joints)), np.empty(len(joints))
        for i, joint in enumerate(joints):
            bones = np.column_stack([np.ones_like(s), s - joint, np.maximum(s - joint, 0.0)])
            fit, *_ = np.linalg.lstsq(bones, p, rcond=None)
            misses[i] = np.linalg.norm(bones @ fit - p)
            cosine = float(_unit(fit[1]) @ _unit(fit[1] + fit[2]))
            angles[i] = np.arccos(np.clip(cosine, -1.0, 1.0))
        row = int(np.clip(np.argmin(misses), 1, len(joints) - 2))
        best, angle = summit(joints, misses, row), float(angles[row])
    return (best, True) if angle > _BENT and abs(best - guess) < 0.115 else (guess, False)


def _at(shares: FloatArray, values: FloatArray, share: float) -> FloatArray:
    return np.array([np.interp(share, shares, values[:, k]) for k in range(3)])


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector))


def _centre_line(
    section: Callable[[FloatArray, FloatArray], FloatArray], start: FloatArray, to_hand: FloatArray, shares: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the middles of an arm's sections at `shares` of the way to the hand and the unit directions of their line."""
    from scipy.ndimage import gaussian_filter1d

    line = start + shares[:, None] * to_hand
    way = np.broadcast_to(to_hand / np.linalg.norm(to_hand), line.shape)
    # First across the way to the hand, then across the line that was found.
    for _ in range(2):
        for i, (at, across) in enumerate(zip(line.copy(), way, strict=True)):
            try:
                cut = section(at, across)
            except InputError:
                continue
            line[i] = 0.5 * (cut.min(axis=0) + cut.max(axis=0))
        way = np.gradient(gaussian_filter1d(line, 2.0, axis=0, mode="nearest"), axis=0)
        # Next to the armhole sections still hold a part of the shoulder.
        way[:4] = way[4]
        way /= np.linalg.norm(way, axis=1, keepdims=True)
    return line, way


def _beyond(
    points: FloatArray, triangles: NDArray[np.int64], normal: FloatArray, offset: float, near: FloatArray
) -> FloatArray:
    """Return the vertices of the one connected part of the mesh beyond a plane that starts nearest to `near`."""
    outside = points @ normal > offset
    kept = triangles[outside[triangles].all(axis=1)]
    ends = np.concatenate([kept[:, :2], kept[:, 1:]])
    label = join_labels(len(points), ends[:, 0], ends[:, 1])
    used = np.unique(kept)
    if not len(used):
        raise InputError("scan: nothing lies beyond the armhole; arms are missing")
    close = used[int(np.argmin(np.linalg.norm(points[used] - near, axis=1)))]
    return points[used[label[used] == label[close]]]
