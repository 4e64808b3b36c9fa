"""The limbs of a body as lines: cloth starts around them, and the openings of a sewn garment must be linked with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.mannequin.mannequin import Mannequin

__all__ = ["around_legs", "inside_arms", "limb_lines", "links", "on_arm"]

# A limb goes on by so much [m] beyond its end, and an arm is nowhere thicker than this [m].
_BEYOND, _ARM = 3.0, 0.09
# Cloth of the trunk starts so far inside the line of an arm, and beside the middle, at least [m].
_INSIDE, _LEAST = 0.04, 0.1
# Height of a slice of a leg, way from the crotch to where its line counts fully, and a leg's distance from the middle at least [m].
_SLICE, _RAMP, _OFF = 0.02, 0.10, 0.005
# Slices over which a leg's line is averaged.
_AVERAGED = 5


def limb_lines(body: Mannequin) -> dict[str, FloatArray]:
    """Return by "head", "left arm", "right arm", "left leg" and "right leg" the points from the chest out and beyond (#P by 3 [m])."""
    ways = {"head": ("neck", "collar")}
    for side in ("left", "right"):
        ways |= {f"{side} arm": (f"armhole {side}", f"wrist {side}"), f"{side} leg": (f"thigh {side}", f"ankle {side}")}
    found = {}
    for limb, lines in ways.items():
        chest, near, end = (body.line(line).mean(axis=0) for line in ("bust", *lines))
        end = near + np.array([0.0, 0.1, 0.0]) if limb == "head" else end
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


def around_legs(points: FloatArray, faces: IntArray, hems: Sequence[IntArray], body: Mannequin) -> FloatArray:
    """Return sewn cloth (#V by 3 [m]) with its two legs moved sideways around the legs of a body, slice by slice, from the crotch down.

    Cloth of a leg is what hangs together with its hem below the height from which on both hang together. It is narrowed where it reaches
    over the middle.

    Args:
        points: #V by 3 [m].
        faces: #F by 4, of the sewn cloth.
        hems: the vertices of the openings of both legs.
        body: with its crotch.
    """
    crotch, skin = body.levels()["crotch front"].height, body.surface().vertices
    i, j = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).T
    high = np.maximum(points[i, 1], points[j, 1])
    for cut in np.arange(crotch, points[np.concatenate(list(hems)), 1].max(), -_SLICE):
        below = high < cut
        graph = coo_array((np.ones(below.sum()), (i[below], j[below])), shape=(len(points),) * 2)
        part = connected_components(graph, directed=False)[1]
        if part[hems[0][0]] != part[hems[1][0]]:
            break
    else:
        return points
    x = points[:, 0].copy()
    for hem in hems:
        side = np.sign(x[hem].mean())
        rows = np.flatnonzero((part == part[hem[0]]) & (points[:, 1] < cut))
        level = np.floor(points[rows, 1] / _SLICE).astype(int)
        leg = skin[(skin[:, 0] * side > 0) & (skin[:, 1] < crotch)]
        table = []
        for k in (levels := np.unique(level)):
            lowest = max(k * _SLICE, leg[:, 1].min() + _SLICE)
            mine, its = side * x[rows[level == k]], side * leg[np.abs(leg[:, 1] - lowest) < 2 * _SLICE, 0]
            axis, half = 0.5 * (its.min() + its.max()), 0.5 * float(np.ptp(mine))
            table.append((0.5 * (mine.min() + mine.max()), axis, min(1.0, (axis - _OFF) / max(half, 1e-6))))
        padded = np.pad(np.array(table), ((_AVERAGED // 2, _AVERAGED // 2), (0, 0)), mode="edge")
        smooth = [np.convolve(column, np.ones(_AVERAGED) / _AVERAGED, mode="valid") for column in padded.T]
        middle, axis, share = (np.interp(points[rows, 1], levels * _SLICE, column) for column in smooth)
        goes = side * (axis + (side * x[rows] - middle) * share)
        x[rows] += (goes - x[rows]) * np.clip((cut - points[rows, 1]) / _RAMP, 0.0, 1.0)
    return np.column_stack([x, points[:, 1:]])
