"""The limbs of a body as lines: cloth starts around them, and the openings of a sewn garment must be linked with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.garment.mannequin.mannequin import Mannequin

__all__ = ["around_legs", "inside_arms", "limb_lines", "links", "on_arm"]

# A limb goes on by so much [m] beyond its end, the face is so far above the neck, and an arm is nowhere thicker than this [m].
_BEYOND, _FACE, _ARM = 3.0, 0.15, 0.09
# Cloth of the trunk starts so far inside the line of an arm, and beside the middle, at least [m].
_INSIDE, _LEAST = 0.04, 0.1
# Steps down from the crotch to where two legs part, way from there to where a leg's line counts fully, and distance of cloth from the
# middle at least [m].
_STEP, _RAMP, _OFF = 0.02, 0.10, 0.005


def limb_lines(body: Mannequin) -> dict[str, FloatArray]:
    """Return by "head", "left arm", "right arm", "left leg" and "right leg" the points from the chest out and beyond (#P by 3 [m]).

    That of the head leaves through the face, as it does in a hood.
    """
    chest, neck = body.line("bust").mean(axis=0), body.line("collar").mean(axis=0)
    ways, face = dict[str, tuple[str, str]](), neck + np.array([0.0, _FACE, 0.0])
    for side in ("left", "right"):
        ways |= {f"{side} arm": (f"armhole {side}", f"wrist {side}"), f"{side} leg": (f"thigh {side}", f"ankle {side}")}
    found = {"head": np.array([chest, neck, face, face + np.array([0.0, 0.0, _BEYOND])])}
    for limb, ends in ways.items():
        near, end = (body.line(line).mean(axis=0) for line in ends)
        found[limb] = np.array([chest, near, end, end + _BEYOND * (end - near) / np.linalg.norm(end - near)])
    return found


def links(loop: FloatArray, lines: Mapping[str, FloatArray]) -> dict[str, int]:
    """Return how often a closed loop (#L by 3 [m]) goes around each limb, less how often around the head.

    A limb and the head are one line from afar to afar. The number is that of its crossings with a fan that spans the loop, by direction:
    a winding number, whatever the fan.
    """
    middle, ahead = loop.mean(axis=0), np.roll(loop, -1, axis=0)
    normal = np.cross(loop - middle, ahead - middle)
    through = {}
    for limb, line in lines.items():
        total = 0.0
        for a, b in pairwise(line):
            # Where the segment meets the plane of each triangle, in its coordinates (Möller and Trumbore 1997).
            way = b - a
            det = normal @ way
            det = np.where(np.abs(det) > 1e-15, det, np.inf)
            t = normal @ (middle - a) / det
            place = a + t[:, None] * way - middle
            size = np.maximum(np.einsum("ij,ij->i", normal, normal), 1e-30)
            u = np.einsum("ij,ij->i", np.cross(place, ahead - middle), normal) / size
            v = np.einsum("ij,ij->i", np.cross(loop - middle, place), normal) / size
            hit = (t >= 0.0) & (t < 1.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & np.isfinite(det)
            total += float(np.sign(det[hit]).sum())
        through[limb] = round(total)
    return {limb: count - through["head"] for limb, count in through.items() if limb != "head"}


def on_arm(points: FloatArray, lines: Mapping[str, FloatArray]) -> BoolArray:
    """Return #P, which points of a body (#P by 3 [m]) lie on an arm, beyond its armhole."""
    found = np.zeros(len(points), dtype=bool)
    for limb in ("left arm", "right arm"):
        _, armhole, wrist, _ = lines[limb]
        way = (wrist - armhole) / np.linalg.norm(wrist - armhole)
        along = (points - armhole) @ way
        found |= (along > 0.0) & (np.linalg.norm(points - armhole - along[:, None] * way, axis=1) < _ARM)
    return found


def inside_arms(points: FloatArray, lines: Mapping[str, FloatArray]) -> FloatArray:
    """Return cloth of the trunk (#P by 3 [m]) moved sideways, so that what is below the armholes is inside both arms."""
    x, y, z = points.T
    for limb in ("left arm", "right arm"):
        _, armhole, wrist, _ = lines[limb]
        side, along = np.sign(armhole[0]), (armhole[1] - y) / (armhole[1] - wrist[1])
        most = np.maximum(side * (armhole[0] + along * (wrist[0] - armhole[0])) - _INSIDE, _LEAST)
        x = np.where((along > 0.0) & (side * x > most), side * most, x)
    return np.column_stack([x, y, z])


def around_legs(
    points: FloatArray, faces: IntArray, hems: Sequence[IntArray], lines: Mapping[str, FloatArray]
) -> FloatArray:
    """Return sewn cloth (#V by 3 [m]) with its two legs moved sideways around the legs of a body, from the crotch down.

    Cloth of a leg is what hangs together with its hem below the height from which on both hang together. It is narrowed where it reaches
    over the middle.

    Args:
        points: #V by 3 [m].
        faces: #F by 4, of the sewn cloth.
        hems: the vertices of the openings of both legs.
        lines: the body's limbs.
    """
    top = min(lines["left leg"][1, 1], lines["right leg"][1, 1])
    i, j = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).T
    high = np.maximum(points[i, 1], points[j, 1])
    for cut in np.arange(top, points[np.concatenate(list(hems)), 1].max(), -_STEP):
        below = high < cut
        graph = coo_array((np.ones(below.sum()), (i[below], j[below])), shape=(len(points),) * 2)
        part = connected_components(graph, directed=False)[1]
        if part[hems[0][0]] != part[hems[1][0]]:
            break
    else:
        return points
    x, y = points[:, 0].copy(), points[:, 1]
    for hem in hems:
        side = "left" if x[hem].mean() > 0.0 else "right"
        rows = np.flatnonzero((part == part[hem[0]]) & (y < cut))
        line = lines[f"{side} leg"][:0:-1]
        axis, middle = np.interp(y[rows], line[:, 1], line[:, 0]), 0.5 * (x[hem].min() + x[hem].max())
        narrowed = np.minimum(1.0, (abs(axis) - _OFF) / max(0.5 * float(np.ptp(x[hem])), 1e-6))
        goes = axis + (x[rows] - middle) * narrowed
        x[rows] += (goes - x[rows]) * np.clip((cut - y[rows]) / _RAMP, 0.0, 1.0)
    return np.column_stack([x, points[:, 1:]])
