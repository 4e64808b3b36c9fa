"""The body model fitted inside a garment: cloth lies on or off the skin, never within it.

Gauss-Newton steps on the gap between each sample of the cloth and the nearest place of the body, along the skin's normal: cloth inside the
body costs most, cloth that hangs far off little. Nothing but the garment says how tall its wearer is, so the usual stature is preferred.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray
from warpflat.flat import vertex_normals
from warpflat.garment.mannequin.body_model import BodyModel, Person
from warpflat.garment.mannequin.closest import Mesh
from warpflat.garment.mannequin.fit_body import FEW, SAMPLES, FittedBody, step_within

__all__ = ["fit_inside"]

# Samples of the cloth that are asked while starts are compared, and vertices of the body at the end.
_FEW_SAMPLES, _VERTICES = 600, 2_600
# The stature that is preferred, and the gap under plain cloth [m].
_STATURE, _GAP = 1.68, 0.006
# Cloth and skin face the same way where their normals' product is larger than this.
_ALIKE = 0.3
# What cloth counts within the skin, and far off it [m].
_WITHIN, _OFF, _FAR = 4.0, 0.25, 0.02
# Bends of the arms from which it starts [rad], and heights of the garment's top [share of the stature], step by step.
_ARMS, _TOPS, _TOP_STEP = (0.0, 0.45, -0.45, 0.8, -0.8), (0.45, 0.93), 0.055
# Stages: steps, weight of the preferences, distance at which a place counts a quarter [m], whether shapes may change.
_FIRST, _NEXT, _LAST = (3, 2.0, 0.15, False), ((4, 1.0, 0.1, False), (4, 0.3, 0.1, True)), (6, 0.2, 0.06, True)
_GO_ON = 4
# A step bends no joint by more [rad], and moves the body by no more [m].
_MOST_BEND, _MOST_MOVE = 0.3, 0.05
# How much the joints are held: all, and more of some.
_HELD = {"spine03": 2.0, "clavicle": 1.0, "lowerleg01": 1.0, "upperleg01": 1.0, "neck01": 1.0, "foot": 1.0}


def fit_inside(vertices: FloatArray, triangles: NDArray[np.int64]) -> FittedBody:
    """Fit the body model inside a garment that hangs upright, its front towards +Z.

    Args:
        vertices: #V by 3 [m], Y up.
        triangles: #T by 3, their normals outward.

    Returns:
        The body; its distances are those of the cloth's samples from it.
    """
    model, cloth = BodyModel.load(), Mesh(vertices, triangles)
    points, normals = cloth.sample(SAMPLES)
    few = slice(0, _FEW_SAMPLES)
    skin = np.flatnonzero(~model.detail)
    of_skin = vertex_normals(model.mean[: model.count], model.triangles)
    coarse_rows, fine_rows = (skin[:: max(1, len(skin) // count)] for count in (FEW, _VERTICES))
    coarse, fine = model.only(coarse_rows), model.only(fine_rows)
    height, top = float(np.ptp(vertices[:, 1])), float(vertices[:, 1].max())
    # It starts from mean bodies of the usual stature with their soles at several heights, amid the garment, their arms bent.
    mean = model.mean[: model.count]
    scale = _STATURE / float(np.ptp(mean[:, 1]))
    across = 0.5 * (vertices[:, 0].min() + vertices[:, 0].max())
    ahead = float(np.median(points[:, 2])) - scale * float(np.median(mean[:, 2]))
    started: list[tuple[Person, float]] = []
    for arms in _ARMS:
        for share_of in np.arange(max(_TOPS[0], min(height / _STATURE, _TOPS[1])), _TOPS[1] + 1e-9, _TOP_STEP):
            place = np.array([across, top - float(share_of) * _STATURE - scale * float(mean[:, 1].min()), ahead])
            person, cost = replace(model.mean_person(-arms), scale=scale, place=place), np.inf
            for _ in range(_FIRST[0]):
                person, cost = _step(coarse, of_skin[coarse_rows], points[few], normals[few], person, *_FIRST[1:])
            started.append((person, cost))
    started = sorted(started, key=lambda each: each[1])[:_GO_ON]
    for number, (person, cost) in enumerate(started):
        for steps, *stage in _NEXT:
            for _ in range(steps):
                person, cost = _step(coarse, of_skin[coarse_rows], points, normals, person, *stage)  # type: ignore[arg-type]
        started[number] = person, cost
    person, cost = min(started, key=lambda each: each[1])
    for _ in range(_LAST[0]):
        person, cost = _step(fine, of_skin[fine_rows], points, normals, person, *_LAST[1:])
    distance = np.linalg.norm(Mesh(model.vertices(person), model.triangles).closest(points)[2] - points, axis=1)
    return FittedBody(person=person, distance=distance, cost=cost)


def _step(
    model: BodyModel,
    of_skin: FloatArray,
    points: FloatArray,
    normals: FloatArray,
    person: Person,
    preference: float,
    reach: float,
    shapes: bool,
) -> tuple[Person, float]:
    """Take one Gauss-Newton step; return the person after it and the cost before it [m]."""
    from scipy.spatial import cKDTree

    posed, jacobian = model.jacobian(person)
    turned = model.turned(person, of_skin)
    far, near = cKDTree(posed).query(points)
    facing = turned[near]
    gap = np.einsum("pa,pa->p", points - posed[near], facing)
    residual = gap - _GAP
    weight = np.where(np.einsum("pa,pa->p", facing, normals) > _ALIKE, 1.0 / (1.0 + (far / reach) ** 2) ** 2, 0.0)
    weight *= np.where(residual > 0.0, np.where(residual > _FAR, _OFF, 1.0), _WITHIN)
    rows = -np.einsum("pak,pa->pk", jacobian[near], facing)
    matrix, gradient = (rows * weight[:, None]).T @ rows, rows.T @ (weight * residual)
    count, joints = len(model.shapes), len(model.parents)
    stiffness = np.zeros(len(gradient))
    stiffness[:count] = 0.2 * preference
    held = [0.3 * preference + 0.05 + _HELD.get(name.split(".")[0], 0.0) for name in model.joints]
    stiffness[count : count + 3 * joints] = np.repeat(held, 3)
    stiffness[-1] = 30.0 * preference
    gradient[-1] += stiffness[-1] * np.log(person.scale / _STATURE)
    step = step_within(model, person, matrix, gradient, stiffness, shapes=shapes, most_bend=_MOST_BEND)
    step *= min(1.0, _MOST_MOVE / max(float(np.abs(step[-4:-1]).max()), 1e-9))
    mean = float(np.sqrt((weight * residual**2).sum() / max(weight.sum(), 1e-9)))
    return model.moved(person, step), mean + 0.05 * float(1.0 - np.minimum(weight, 1.0).mean())
