"""The body model fitted to a scan: shape, pose and place by Gauss-Newton steps on closest points, in both directions.

Each vertex of the body is drawn to the nearest place on the scan, along the scan's normal there, and each sample of the scan draws the
nearest place of the body to itself. A landmark whose height is known is drawn there. A place counts less the farther it is away (Geman and
McClure), and not at all where the two surfaces face different ways: so holes, hair, clothes, floors and missing hands do little. Small
shapes and small bends are preferred.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray
from warpflat.flat import vertex_normals
from warpflat.garment.mannequin.body_landmarks import PLACES, height_weights
from warpflat.garment.mannequin.body_model import BodyModel, Person
from warpflat.garment.mannequin.closest import Mesh

__all__ = ["FEW", "SAMPLES", "FittedBody", "fit_body", "step_within"]

#: Points on a scan or cloth that draw the body to themselves.
SAMPLES = 2_500
#: Vertices of the body that are drawn while starts are compared.
FEW = 900
# Surfaces face the same way where their normals' product is larger than this.
_ALIKE = 0.35
# How much the scan's samples count against the body's vertices.
_FROM_SCAN = 0.7
# A step bends no joint by more than this [rad].
_MOST_BEND = 0.35
# One in so many vertices of head, hands and feet counts.
_THIN = 4
# How much the body's vertices count together, however many they are.
_VERTICES = 2_600.0
# How much a landmark of a known height counts against them: so much that the scan's surface, along which it slides, gives way.
_LANDMARK = 3000.0
# Stages of the starts: steps, weight of the preferences, distance [m] at which a place counts a quarter, whether shapes may
# change, how many starts go on; and of the best one.
_FIRST = ((2, 0.6, 0.12, False, 3), (3, 0.6, 0.12, True, 2), (3, 0.15, 0.06, True, 1))
_LAST = ((8, 0.04, 0.03),)
# Bends of the arms [rad] from which the fit starts, about the axis to the front: as the model stands, raised, hanging, overhead.
_ARMS = (0.0, 0.5, -0.5, 0.9)
# Bends [rad] about the axis to the left of hips and knees of a body that sits: on a chair, on a saddle.
_SEATS = ((-1.5, 1.4), (-1.0, 1.2))


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedBody:
    """The end of a fit.

    Attributes:
        person: the body.
        distance: #V, from each vertex of the body to the scan [m]; infinite where the scan has nothing that faces the same way.
        cost: mean robust distance both ways [m], by which starts are compared.
    """

    person: Person
    distance: FloatArray
    cost: float

    @property
    def far(self) -> float:
        """The mean distance of the body from what the scan shows of it [m]."""
        return float(self.distance[np.isfinite(self.distance)].mean())


@dataclass(frozen=True, kw_only=True, eq=False)
class _Scan:
    mesh: Mesh
    points: FloatArray
    normals: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class _Known:
    """Landmarks of known heights: the vertices that show them, #L by #V how much each counts, and the heights [m], #L."""

    model: BodyModel
    weights: FloatArray
    heights: FloatArray


def fit_body(
    vertices: FloatArray,
    triangles: NDArray[np.int64],
    landmarks: Mapping[str, float] | None = None,
    *,
    sits: bool = False,
) -> FittedBody:
    """Fit the body model to a scan that stands upright, or sits, facing +Z.

    Args:
        vertices: #V by 3 [m], Y up.
        triangles: #T by 3, their normals outward.
        landmarks: known heights [m] of landmarks by name; one that is no place of the model says nothing.
        sits: whether it sits.
    """
    model, mesh = BodyModel.load(), Mesh(vertices, triangles)
    points, facing = mesh.sample(SAMPLES)
    scan = _Scan(mesh=mesh, points=points, normals=facing)
    # Head, hands and feet count less: hair, shoes and fingers differ from the model's.
    plain = np.concatenate([np.flatnonzero(~model.detail), np.flatnonzero(model.detail)[::_THIN]])
    normals = vertex_normals(model.mean[: model.count], model.triangles)
    few = plain[:: max(1, len(plain) // FEW)]
    coarse, fine = model.only(few), model.only(plain)
    heights = {name: height for name, height in (landmarks or {}).items() if name in PLACES}
    given = np.array([height_weights(name) for name in heights]).reshape(-1, model.count)
    used = np.flatnonzero(given.any(axis=0))
    known = _Known(model=model.only(used), weights=given[:, used], heights=np.array([*heights.values()]))
    # It starts from mean bodies, as tall as the scan and in its place, with their arms, and their hips and knees, bent.
    low, high, started = vertices.min(axis=0), vertices.max(axis=0), list[tuple[Person, float]]()
    for seat in _SEATS if sits else ((0.0, 0.0),):
        for arms in _ARMS:
            person = model.mean_person(arms, seat)
            person = replace(person, scale=float((high[1] - low[1]) / np.ptp(model.vertices(person)[:, 1])))
            posed = model.vertices(person)
            place = np.array([
                0.5 * (low[0] + high[0]) - 0.5 * (posed[:, 0].min() + posed[:, 0].max()),
                low[1] - posed[:, 1].min(),
                # Arms and feet may reach anywhere, but the knees of a body that sits are before its trunk.
                np.median(vertices[:, 2]) - np.median(posed[:, 2])
                if seat == (0.0, 0.0)
                else 0.5 * (low[2] + high[2]) - 0.5 * (posed[:, 2].min() + posed[:, 2].max()),
            ])  # fmt: skip
            started.append((replace(person, place=place), np.inf))
    for steps, preference, reach, shapes, keep in _FIRST:
        for i, (person, cost) in enumerate(started):
            for _ in range(steps):
                person, cost = _step(
                    coarse, normals[few], scan, known, person, preference, reach, shapes=shapes, sits=sits
                )
            started[i] = person, cost
        started = sorted(started, key=lambda each: each[1])[:keep]
    person, cost = started[0]
    for steps, preference, reach in _LAST:
        for _ in range(steps):
            person, cost = _step(fine, normals[plain], scan, known, person, preference, reach, shapes=True, sits=sits)
    posed = model.vertices(person)
    found, weights, place = mesh.closest(posed)
    alike = np.einsum("va,va->v", vertex_normals(posed, model.triangles), mesh.normals_at(found, weights)) > _ALIKE
    distance = np.where(alike, np.linalg.norm(posed - place, axis=1), np.inf)
    return FittedBody(person=person, distance=distance, cost=cost)


def _step(
    model: BodyModel,
    normals: FloatArray,
    scan: _Scan,
    known: _Known,
    person: Person,
    preference: float,
    reach: float,
    *,
    shapes: bool,
    sits: bool,
) -> tuple[Person, float]:
    """Take one Gauss-Newton step; return the person after it and the cost before it.

    Both directions pull at vertices of the body along normals of the scan: they add up to a 3 by 3 matrix at each vertex.
    """
    from scipy.spatial import cKDTree

    posed, jacobian = model.jacobian(person)
    turned = model.turned(person, normals)
    found, _, place = scan.mesh.closest(posed)
    _, near = cKDTree(posed).query(scan.points)
    hit = np.concatenate([np.arange(model.count), near])
    directions = np.concatenate([scan.mesh.normals[found], scan.normals])
    away = posed[hit] - np.concatenate([place, scan.points])
    alike = np.einsum("pa,pa->p", turned[hit], directions) > _ALIKE
    squared = np.einsum("pa,pa->p", away, away) / reach**2
    weight = np.where(alike, 1.0 / (1.0 + squared) ** 2, 0.0)
    weight *= np.repeat([_VERTICES / model.count, _FROM_SCAN], [model.count, len(near)])
    residual = np.einsum("pa,pa->p", away, directions)
    pulls = weight[:, None, None] * directions[:, :, None] * directions[:, None, :]
    pull = np.stack([np.bincount(hit, each, model.count) for each in pulls.reshape(-1, 9).T], axis=1).reshape(-1, 3, 3)
    push = np.stack([np.bincount(hit, (weight * residual) * each, model.count) for each in directions.T], axis=1)
    flat = jacobian.reshape(3 * model.count, -1)
    matrix = flat.T @ np.matmul(pull, jacobian).reshape(flat.shape)
    gradient = flat.T @ push.ravel()
    if len(known.heights):
        at, moved = known.model.jacobian(person)
        rows = known.weights @ moved[:, 1]
        matrix += _LANDMARK * rows.T @ rows
        gradient += _LANDMARK * rows.T @ (known.weights @ at[:, 1] - known.heights)
    count, joints = len(model.shapes), len(model.joints)
    stiffness = np.zeros(len(gradient))
    stiffness[:count] = 0.05 * preference
    bends = np.full((joints, 3), 0.3 * preference + 0.02)
    for joint, name in enumerate(model.joints):
        bends[joint] += 1.0 if name == "spine03" else 0.5 if name.startswith(("clavicle", "lowerleg")) else 0.0
        if sits and name.startswith(("upperleg", "lowerleg")):
            bends[joint] = 0.0
    stiffness[count : count + 3 * joints] = bends.ravel()
    step = step_within(model, person, matrix, gradient, stiffness, shapes=shapes, most_bend=_MOST_BEND)
    body = slice(0, model.count)
    mean = float(np.sqrt((weight[body] * residual[body] ** 2).sum() / max(weight[body].sum(), 1e-9)))
    return model.moved(person, step), mean + 0.02 * float(1.0 - alike[body].mean())


def step_within(
    model: BodyModel,
    person: Person,
    matrix: FloatArray,
    gradient: FloatArray,
    stiffness: FloatArray,
    *,
    shapes: bool,
    most_bend: float,
) -> FloatArray:
    """Return the Gauss-Newton step of a person's parameters that draws departures from the mean back, and bends no joint too far.

    Args:
        model: of the body.
        person: before the step.
        matrix, gradient: of the sum of squares.
        stiffness: how much each parameter is drawn back, by how far it departs.
        shapes: whether shapes may change.
        most_bend: of any joint [rad].
    """
    count, bends = len(model.shapes), slice(len(model.shapes), len(model.shapes) + 3 * len(model.parents))
    departures = np.zeros(len(gradient))
    departures[: bends.stop] = model.departures(person)
    whole = matrix + np.diag(stiffness + 1e-6)
    free = slice(0 if shapes else count, None)
    step = np.zeros(len(gradient))
    step[free] = np.linalg.solve(whole[free, free], -(gradient + stiffness * departures)[free])
    return np.asarray(step * min(1.0, most_bend / max(float(np.abs(step[bends]).max()), 1e-9)))
