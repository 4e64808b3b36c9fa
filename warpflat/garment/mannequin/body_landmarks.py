"""Landmarks of the body model, named on its mean body by ISO 8559-1, and where they lie on a body that is laid on a scan.

A level is a height of the mean body with the vertices around it, a place of an arm is a distance along its bones. On another body of the
same vertices it lies where these vertices lie.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from warpflat.core import BoolArray, FloatArray, unit
from warpflat.flat import join_labels
from warpflat.garment.mannequin.body_model import BodyModel, finer_body

__all__ = [
    "ARM_PLACES",
    "LEVELS",
    "PLACES",
    "Places",
    "crotch_vertex",
    "height_of",
    "height_weights",
    "meeting",
    "model_places",
    "near_level",
    "near_place",
    "value_at",
]

#: Heights on the mean body, which is 1 m tall, and the strip of vertices that shows each: around the trunk, in front, behind, or one leg.
LEVELS = {
    "bust": (0.7250, "front"), "underbust": (0.6974, "front"), "waist": (0.6290, "trunk"), "hip": (0.5137, "back"),
    "front_neck": (0.8225, "front"), "side_neck": (0.8465, "neck"), "head": (0.9300, "head"),
    "knee": (0.3005, "leg"), "calf": (0.2196, "leg"), "ankle": (0.0755, "leg"), "foot": (0.0150, "leg"),
}  # fmt: skip
#: Distances from the elbow towards the hand on the mean body [m].
ARM_PLACES = {"biceps": -0.0960, "elbow": -0.0024, "wrist": 0.1391, "hand": 0.1882}
#: Every landmark that is a place of the model.
PLACES = (*LEVELS, *ARM_PLACES, "armpit", "crotch")
# Vertices so near to a landmark show it, on the mean body [m].
_NEAR = 0.012
# An arm's own sections are looked for among faces whose vertices follow it by more than this share.
_OF_ARM = 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class Places:
    """The vertices of the finer body model by what they are.

    Attributes:
        mean: #V by 3, on the mean body, 1 m tall.
        strips: #V each: "trunk", "front", "back", "neck", "head", "leg left", "leg right", "arm left", "arm right", "arms".
        plain: #V, neither of head, hands nor feet.
        along: #V, of arms, the distance from the elbow towards the hand along the bones of the mean body.
        halves: by side, whether a triangle is of trunk, leg or head, #T.
        arms: by side, whether a triangle is of an arm or of what joins it, #T.
        middle: vertices in the midplane.
    """

    mean: FloatArray
    strips: Mapping[str, BoolArray]
    plain: BoolArray
    along: FloatArray
    halves: Mapping[str, BoolArray]
    arms: Mapping[str, BoolArray]
    middle: NDArray[np.int64]


@lru_cache(maxsize=1)
def model_places() -> Places:
    """Return the vertices of the finer body model by what they are."""
    model, (finer, triangles) = BodyModel.load(), finer_body()
    mean, weights = finer @ model.mean[: model.count], finer @ model.weights
    names = [name.split(".")[0] for name in (*model.joints, "pelvis")]
    kind = np.array(names)[np.argmax(weights, axis=1)]
    x, y, z = mean.T
    trunk = np.isin(kind, ["spine03", "pelvis", "clavicle", "upperleg01"]) & (y > 0.45)
    strips = {
        "trunk": trunk, "front": trunk & (np.abs(x) < 0.07) & (z > 0.0), "back": trunk & (np.abs(x) < 0.07) & (z < 0.0),
        "neck": (np.abs(x) > 0.02) & (np.abs(x) < 0.07) & (np.abs(z) < 0.03), "head": kind == "neck01",
    }  # fmt: skip
    on_arm = finer @ model.share_of("upperarm01", "lowerarm01")
    along = np.zeros(len(mean))
    halves, arms = {}, {}
    for side, letter, sign in (("left", "L", 1.0), ("right", "R", -1.0)):
        own = sign * x > 0.0
        strips[f"leg {side}"] = np.isin(kind, ["upperleg01", "lowerleg01", "foot"]) & own
        strips[f"arm {side}"] = np.isin(kind, ["upperarm01", "lowerarm01"]) & own
        shoulder, elbow = (
            model.mean[model.count + model.joints.index(f"{j}.{letter}")] for j in ("upperarm01", "lowerarm01")
        )
        tip = mean[strips[f"arm {side}"]][np.argmax(sign * x[strips[f"arm {side}"]])]
        upper, lower = unit(elbow - shoulder), unit(tip - elbow)
        before = (mean - elbow) @ (upper + lower) < 0.0
        along = np.where(own, np.where(before, (mean - elbow) @ upper, (mean - elbow) @ lower), along)
        on_side = (sign * x[triangles] > -1e-6).all(axis=1)
        # Below the armpit an arm is what hangs together with the hand.
        below = triangles[(y[triangles] < y[meeting(mean, mean, sign)]).all(axis=1)]
        hangs = join_labels(len(mean), below[:, :2].ravel(), below[:, 1:].ravel())
        arm = (hangs == hangs[np.argmax(sign * x)])[triangles].any(axis=1)
        halves[side] = on_side & ~arm & (on_arm[triangles] < 0.5).any(axis=1)
        arms[side] = on_side & (on_arm[triangles] > _OF_ARM).any(axis=1)
    strips["arms"] = strips["arm left"] | strips["arm right"]
    return Places(
        mean=mean, strips=strips, plain=finer @ model.detail.astype(float) < 0.5, along=along, halves=halves, arms=arms,
        middle=np.flatnonzero(np.abs(x) < 1e-6),
    )  # fmt: skip


def meeting(vertices: FloatArray, mean: FloatArray, sign: float) -> int:
    """Return the vertex of a standing body (#V by 3) at which an arm and the trunk, followed up from hand and pelvis, meet.

    Args:
        vertices: of the body [m].
        mean: the same of the mean body.
        sign: +1 for the left arm, -1 for the right one.
    """
    triangles = finer_body()[1]
    hand, trunk = int(np.argmax(sign * mean[:, 0])), int(np.argmin(np.abs(mean - [0.0, 0.55, 0.1]).sum(axis=1)))
    y = vertices[:, 1]
    rows = np.flatnonzero((sign * mean[:, 0] > 0.03) & (mean[:, 1] > 0.62) & (mean[:, 1] < 0.85))
    rows = rows[np.argsort(y[rows])]
    low, high = 0, len(rows) - 1
    while low < high:
        middle = (low + high) // 2
        below = triangles[(y[triangles] <= y[rows[middle]]).all(axis=1)]
        label = join_labels(len(y), below[:, :2].ravel(), below[:, 1:].ravel())
        low, high = (low, middle) if label[hand] == label[trunk] else (middle + 1, high)
    return int(rows[low])


def near_level(name: str, side: str = "left") -> tuple[NDArray[np.int64], FloatArray]:
    """Return the vertices that show a level of LEVELS, and how far each lies above it on the mean body [m]."""
    share, strip = LEVELS[name]
    places = model_places()
    above = places.mean[:, 1] - share
    rows = np.flatnonzero(places.strips[f"leg {side}" if strip == "leg" else strip] & (np.abs(above) < _NEAR))
    return rows, above[rows]


def near_place(at: float, side: str) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the vertices around an arm at a distance from the elbow, and how far each lies beyond it, on the mean body [m]."""
    places = model_places()
    beyond = places.along - at
    rows = np.flatnonzero(places.strips[f"arm {side}"] & (np.abs(beyond) < _NEAR))
    return rows, beyond[rows]


@lru_cache(maxsize=32)
def height_weights(name: str) -> FloatArray:
    """Return how much each vertex of the body model counts in the height of a landmark, #V; left and right count alike.

    Args:
        name: one of PLACES.
    """
    finer, places = finer_body()[0], model_places()
    out = np.zeros(len(places.mean))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        if name == "armpit":
            out[meeting(places.mean, places.mean, sign)] += 0.5
        elif name == "crotch":
            out[crotch_vertex(places.mean)] = 1.0
        else:
            rows, off = near_level(name, side) if name in LEVELS else near_place(ARM_PLACES[name], side)
            out[rows] += 0.5 * np.linalg.pinv(np.column_stack([np.ones_like(off), off]))[0]
    return np.asarray(out @ finer)


def crotch_vertex(vertices: FloatArray) -> int:
    """Return the lowest vertex between the legs, in the midplane, of a body (#V by 3 [m])."""
    places = model_places()
    between = places.middle[(places.mean[places.middle, 1] > 0.40) & (places.mean[places.middle, 1] < 0.52)]
    return int(between[np.argmin(vertices[between, 1])])


def value_at(near: tuple[NDArray[np.int64], FloatArray], values: FloatArray) -> FloatArray:
    """Return what `values` (#V or #V by 3) of all vertices are at the landmark amid its vertices, by a straight line through them."""
    rows, off = near
    line = np.linalg.lstsq(np.column_stack([np.ones_like(off), off]), values[rows], rcond=None)[0]
    return np.asarray(line[0])


def height_of(name: str, vertices: FloatArray, side: str = "left") -> float:
    """Return how high a level of LEVELS lies on a body of these vertices (#V by 3 [m]) [m]."""
    return float(value_at(near_level(name, side), vertices[:, 1]))
