"""The body model fitted to a scan: shape, pose and place by Gauss-Newton steps on closest points, in both directions.

Each vertex of the body is drawn to the nearest place on the scan, along the scan's normal there, and each sample of the scan draws the
nearest place of the body to itself. A place counts less the farther it is away (Geman and McClure), and not at all where the two surfaces
face different ways: so holes, hair, clothes, floors and missing hands do little. Small shapes and small bends are preferred.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.core.compile import launch_quietly
from warpflat.kernels.closest import find_closest
from warpflat.mannequin.body_model import BodyModel, Person, rotation, rotation_vector

__all__ = ["FittedBody", "Mesh", "fit_body"]

# Points on the scan that draw the body to themselves.
_SAMPLES = 2_500
# Vertices of the body that are drawn while starts are compared.
_FEW = 900
# Surfaces face the same way where their normals' product is larger than this.
_ALIKE = 0.35
# How much the scan's samples count against the body's vertices.
_FROM_SCAN = 0.7
# A step bends no joint by more than this [rad].
_MOST_BEND = 0.35
# Stages of a fit: steps, weight of the preferences, distance [m] at which a place counts a quarter, whether shapes may change.
_FIRST = ((2, 0.6, 0.12, False), (3, 0.6, 0.12, True), (5, 0.15, 0.06, True))
_LAST = ((12, 0.04, 0.03, True),)
# Bends of the arms [rad] from which the fit starts, about the axis to the front: as the model stands, raised, hanging, overhead.
_ARMS = (0.0, 0.5, -0.5, 0.9)


class Mesh:
    """A triangle mesh that answers for the nearest places on it.

    Args:
        vertices: #V by 3 [m].
        triangles: #T by 3.
    """

    def __init__(self, vertices: FloatArray, triangles: NDArray[np.int64]) -> None:
        self.vertices, self.triangles = vertices, triangles
        a, b, c = vertices[triangles].transpose(1, 0, 2)
        cross = np.cross(b - a, c - a)
        self.area = 0.5 * np.linalg.norm(cross, axis=1)
        self.normals = cross / np.maximum(2.0 * self.area, 1e-300)[:, None]
        self._mesh = wp.Mesh(
            points=wp.array(vertices, dtype=wp.vec3, device="cpu"),
            indices=wp.array(triangles.ravel(), dtype=wp.int32, device="cpu"),
        )

    def closest(self, points: FloatArray, reach: float = 1e6) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
        """Return the nearest triangle of each point (#P; -1 where none is within reach [m]), weights (#P by 3), and place (#P by 3 [m])."""
        face = wp.empty(len(points), dtype=wp.int32, device="cpu")
        weight = wp.empty(len(points), dtype=wp.vec3, device="cpu")
        given = [self._mesh.id, wp.array(points, dtype=wp.vec3, device="cpu"), float(reach)]
        launch_quietly(find_closest, dim=len(points), inputs=given, outputs=[face, weight], device="cpu")
        found, share = face.numpy().astype(np.int64), weight.numpy().astype(np.float64)
        return found, share, np.einsum("pk,pka->pa", share, self.vertices[self.triangles[found]])


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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Scan:
    mesh: Mesh
    points: FloatArray
    normals: FloatArray


def vertex_normals(vertices: FloatArray, triangles: NDArray[np.int64]) -> FloatArray:
    """Return unit normals at vertices, #V by 3, faces weighted by their areas."""
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    cross = np.cross(b - a, c - a)
    normals = np.stack(
        [np.bincount(triangles.ravel(), np.repeat(cross[:, k], 3), minlength=len(vertices)) for k in range(3)], axis=1
    )
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None])


def fit_body(vertices: FloatArray, triangles: NDArray[np.int64]) -> FittedBody:
    """Fit the body model to a scan that stands upright, facing +Z.

    Args:
        vertices: #V by 3 [m], Y up.
        triangles: #T by 3, their normals outward.
    """
    model, mesh = BodyModel.load(), Mesh(vertices, triangles)
    rng = np.random.default_rng(0)
    face = rng.choice(len(triangles), _SAMPLES, p=mesh.area / mesh.area.sum())
    share = rng.dirichlet([1.0, 1.0, 1.0], _SAMPLES)
    scan = _Scan(
        mesh=mesh, points=np.einsum("pk,pka->pa", share, vertices[triangles[face]]), normals=mesh.normals[face]
    )
    plain = np.flatnonzero(~model.detail)
    few = plain[:: max(1, len(plain) // _FEW)]
    best: tuple[Person, float] | None = None
    for arms in _ARMS:
        person, cost = _start(model, vertices, arms), np.inf
        for steps, preference, reach, shapes in _FIRST:
            for _ in range(steps):
                person, cost = _step(model, scan, person, few, preference, reach, shapes=shapes)
        if best is None or cost < best[1]:
            best = person, cost
    assert best is not None
    person, cost = best
    for steps, preference, reach, shapes in _LAST:
        for _ in range(steps):
            person, cost = _step(model, scan, person, plain, preference, reach, shapes=shapes)
    posed = model.vertices(person)
    found, _, place = mesh.closest(posed)
    alike = np.einsum("va,va->v", vertex_normals(posed, model.triangles), mesh.normals[found]) > _ALIKE
    distance = np.where(alike, np.linalg.norm(posed - place, axis=1), np.inf)
    return FittedBody(person=person, distance=distance, cost=cost)


def _start(model: BodyModel, vertices: FloatArray, arms: float) -> Person:
    """Return the mean body, as tall as the scan and in its place, with its arms bent."""
    bend = np.zeros((len(model.joints), 3))
    for side, sign in (("L", 1.0), ("R", -1.0)):
        bend[model.joints.index(f"upperarm01.{side}"), 2] = sign * arms
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    height = high[1] - low[1]
    person = Person(
        shape=np.zeros(len(model.shapes)), bend=rotation(bend), turn=np.eye(3), scale=float(height), place=np.zeros(3)
    )
    posed = model.vertices(person)
    place = np.array([
        0.5 * (low[0] + high[0]) - 0.5 * (posed[:, 0].min() + posed[:, 0].max()),
        low[1] - posed[:, 1].min(),
        np.median(vertices[:, 2]) - np.median(posed[:, 2]),
    ])  # fmt: skip
    return Person(shape=person.shape, bend=person.bend, turn=person.turn, scale=person.scale, place=place)


def _step(
    model: BodyModel,
    scan: _Scan,
    person: Person,
    rows: NDArray[np.int64],
    preference: float,
    reach: float,
    *,
    shapes: bool,
) -> tuple[Person, float]:
    """Take one Gauss-Newton step; return the person after it and the cost before it."""
    from scipy.spatial import cKDTree

    posed, jacobian = model.jacobian(person, rows)
    normals = vertex_normals(model.vertices(person), model.triangles)[rows]

    def system(at: FloatArray, places: FloatArray, directions: FloatArray, own: FloatArray, hit: NDArray[np.int64]):
        away = at - places
        alike = np.einsum("pa,pa->p", own, directions) > _ALIKE
        squared = np.einsum("pa,pa->p", away, away) / reach**2
        weight = np.where(alike, 1.0 / (1.0 + squared) ** 2, 0.0)
        residual = np.einsum("pa,pa->p", away, directions)
        along = np.einsum("pak,pa->pk", jacobian[hit], directions)
        return weight, residual, along, alike

    found, _, place = scan.mesh.closest(posed)
    all_rows = np.arange(len(rows))
    w1, r1, j1, alike = system(posed, place, scan.mesh.normals[found], normals, all_rows)
    w1 = w1 * (2600.0 / len(rows))
    _, near = cKDTree(posed).query(scan.points)
    w2, r2, j2, _ = system(posed[near], scan.points, scan.normals, normals[near], near)
    w2 = w2 * _FROM_SCAN
    matrix = (j1 * w1[:, None]).T @ j1 + (j2 * w2[:, None]).T @ j2
    gradient = j1.T @ (w1 * r1) + j2.T @ (w2 * r2)
    count, joints = len(model.shapes), len(model.joints)
    stiffness = np.zeros(len(gradient))
    stiffness[:count] = 0.05 * preference
    bends = np.full((joints, 3), 0.3 * preference + 0.02)
    for joint, name in enumerate(model.joints):
        bends[joint] += 1.0 if name == "spine03" else 0.5 if name.startswith(("clavicle", "lowerleg")) else 0.0
    stiffness[count : count + 3 * joints] = bends.ravel()
    value = np.zeros(len(gradient))
    value[:count] = person.shape
    # Bends are preferred small in the frame of the joint's parent.
    turn, _ = model.frames(model.shaped(person.shape)[model.count :], person.bend)
    value[count : count + 3 * joints] = np.einsum(
        "jab,jb->ja", turn[model.parents], rotation_vector(person.bend)
    ).ravel()
    matrix[np.diag_indices_from(matrix)] += stiffness + 1e-6
    gradient += stiffness * value
    free = np.arange(len(gradient)) >= (0 if shapes else count)
    step = np.zeros(len(gradient))
    step[free] = np.linalg.solve(matrix[np.ix_(free, free)], -gradient[free])
    bent = np.abs(step[count : count + 3 * joints]).max()
    step *= min(1.0, _MOST_BEND / max(bent, 1e-9))
    cost = float(np.sqrt((w1 * r1**2).sum() / max(w1.sum(), 1e-9))) + 0.02 * float(1.0 - alike.mean())
    return model.moved(person, step), cost
