"""The limbs of a body as lines: cloth is laid around them, and the openings of a sewn garment must be linked with them."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from warpflat.core import BoolArray, FloatArray, unit
from warpflat.garment.mannequin.mannequin import Mannequin

__all__ = ["DRAWN_OUT", "armpit_heights", "crossings", "hangs_beyond", "limb_lines", "links", "on_arm"]

#: How far arms and legs are drawn out beyond wrist and ankle [m], so that hems there have something to go around.
DRAWN_OUT = {"arm": 0.18, "leg": 0.30}
# A limb goes on by so much [m] beyond its end, the face is so far above the neck, and an arm is nowhere thicker than this [m].
_BEYOND, _FACE, _ARM = 3.0, 0.15, 0.09


def limb_lines(body: Mannequin) -> dict[str, FloatArray]:
    """Return by "head", "left arm", "right arm", "left leg" and "right leg" the points from the chest out and beyond (#P by 3 [m]).

    That of the head leaves through the face, as it does in a hood. Those of the arms go by the neck's base, inside the shoulders.
    """
    chest, base, neck = (body.line(line).mean(axis=0) for line in ("bust", "neck", "collar"))
    face = neck + np.array([0.0, _FACE, 0.0])
    found = {"head": np.array([chest, neck, face, face + np.array([0.0, 0.0, _BEYOND])])}
    for limb, ends in {"arm": ("armhole", "wrist"), "leg": ("thigh", "ankle")}.items():
        for side in ("left", "right"):
            near, end = (body.line(f"{line} {side}").mean(axis=0) for line in ends)
            by = [chest, base] if limb == "arm" else [chest]
            found[f"{side} {limb}"] = np.array([*by, near, end, end + _BEYOND * unit(end - near)])
    return found


def armpit_heights(body: Mannequin) -> dict[str, float]:
    """Return by "left arm" and "right arm" the height of the lowest place of its armhole [m]."""
    return {f"{side} arm": float(body.line(f"armhole {side}")[:, 1].min()) for side in ("left", "right")}


def crossings(line: FloatArray, triangles: FloatArray) -> FloatArray:
    """Return how a polyline (#P by 3 [m]) goes through triangles (#T by 3 corners by 3 [m]); after Möller and Trumbore 1997.

    Returns:
        #P - 1 by #T: 1 where a segment leaves through the front, -1 through the back, 0 where it passes beside.
    """
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normal = np.cross(first, second)
    size = np.maximum(np.einsum("ij,ij->i", normal, normal), 1e-30)
    found = []
    for a, b in pairwise(line):
        # Where the segment meets the plane of each triangle, in its coordinates.
        det = normal @ (b - a)
        det = np.where(np.abs(det) > 1e-15, det, np.inf)
        t = np.einsum("ij,ij->i", normal, triangles[:, 0] - a) / det
        place = a + t[:, None] * (b - a) - triangles[:, 0]
        u = np.einsum("ij,ij->i", np.cross(place, second), normal) / size
        v = np.einsum("ij,ij->i", np.cross(first, place), normal) / size
        hit = (t >= 0.0) & (t < 1.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & np.isfinite(det)
        found.append(np.where(hit, np.sign(det), 0.0))
    return np.array(found)


def links(loop: FloatArray, lines: Mapping[str, FloatArray]) -> dict[str, int]:
    """Return how often a closed loop (#L by 3 [m]) goes around each limb, less how often around the head.

    A limb and the head are one line from afar to afar. The number is that of its crossings with a fan that spans the loop, by direction:
    a winding number, whatever the fan.
    """
    fan = np.stack([np.broadcast_to(loop.mean(axis=0), loop.shape), loop, np.roll(loop, -1, axis=0)], axis=1)
    through = {limb: round(float(crossings(line, fan).sum())) for limb, line in lines.items()}
    return {limb: count - through["head"] for limb, count in through.items() if limb != "head"}


def hangs_beyond(points: FloatArray, limb: str, lines: Mapping[str, FloatArray]) -> bool:
    """Return whether points (#P by 3 [m]) all lie beyond the end of a limb, as the hems of long sleeves and trousers on a child do."""
    end, far = lines[limb][-2:]
    return bool(((points - end) @ unit(far - end)).min() > DRAWN_OUT[limb.split(" ")[1]])


def on_arm(points: FloatArray, lines: Mapping[str, FloatArray]) -> BoolArray:
    """Return #P, which points of a body (#P by 3 [m]) lie on an arm, beyond its armhole."""
    found = np.zeros(len(points), dtype=bool)
    for limb in ("left arm", "right arm"):
        armhole, wrist = lines[limb][-3:-1]
        way = unit(wrist - armhole)
        along = (points - armhole) @ way
        found |= (along > 0.0) & (np.linalg.norm(points - armhole - along[:, None] * way, axis=1) < _ARM)
    return found
