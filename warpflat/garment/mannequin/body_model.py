"""A statistical body: shapes, joints and skin of persons of all ages and builds, from MakeHuman's CC0 data.

`data/make_body_model.py` makes the data. A person is a vector of shape coefficients (each of variance one), a rotation at every joint,
and a place in space. Vertices follow the joints by linear blend skinning.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from warpflat.core import FloatArray, unit
from warpflat.flat import half_edges

__all__ = ["BodyModel", "Person", "finer_body", "rotation", "rotation_vector"]

# Blended rotations shrink what they turn; where to this share, a point's distance from the model means nothing in another pose.
_FOLDED = 0.8


def rotation(vectors: FloatArray) -> FloatArray:
    """Return rotation matrices (#N by 3 by 3) of rotation vectors (#N by 3 [rad])."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vectors).as_matrix())


def rotation_vector(matrices: FloatArray) -> FloatArray:
    """Return the rotation vectors (#N by 3 [rad]) of rotation matrices (#N by 3 by 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(matrices).as_rotvec())


@dataclass(frozen=True, kw_only=True, eq=False)
class Person:
    """A body of the model.

    Attributes:
        shape: #S, coefficients of the shapes.
        bend: #J by 3 by 3, rotation at each joint; the identity in the standard pose.
        turn: 3 by 3. scale: of the model, whose mean is 1 m tall. place: 3 [m]. A point p comes to scale * turn p + place.
    """

    shape: FloatArray
    bend: FloatArray
    turn: FloatArray
    scale: float
    place: FloatArray

    def standing(self, most: float = 0.0) -> Person:
        """Return the person with arms and legs a little apart and no joint bent by more than `most` [rad]."""
        vectors = rotation_vector(self.bend)
        angles = np.linalg.norm(vectors, axis=1, keepdims=True)
        return replace(self, bend=rotation(vectors * np.minimum(1.0, most / np.maximum(angles, 1e-12))))


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyModel:
    """The mean body, its shapes and its skin; 1 m tall, Y up, facing +Z, the left side at x > 0.

    Attributes:
        mean: #V + #J by 3, the vertices and after them the joints.
        shapes: #S by #V + #J by 3, how they move by one standard deviation of each shape.
        triangles: #T by 3.
        weights: #V by #J + 1, share of each joint in a vertex; the last is the pelvis, which never bends.
        joints: their names. parents: #J, the joint from which each one hangs; -1 for the pelvis.
        mirror: #V, the vertex on the other side.
        detail: #V, vertices of head, hands and feet.
    """

    mean: FloatArray
    shapes: FloatArray
    triangles: NDArray[np.int64]
    weights: FloatArray
    joints: tuple[str, ...]
    parents: NDArray[np.int64]
    mirror: NDArray[np.int64]
    detail: NDArray[np.bool_]

    @classmethod
    @lru_cache(maxsize=1)
    def load(cls) -> BodyModel:
        """Return the model that comes with the package."""
        with (files("warpflat.garment.mannequin.data") / "body_model.npz").open("rb") as file, np.load(file) as data:
            weights = data["weights"].astype(np.float64)
            return cls(
                mean=data["mean"].astype(np.float64),
                shapes=data["shapes"] * data["scale"].astype(np.float64)[:, None, None],
                triangles=data["triangles"].astype(np.int64),
                weights=weights / weights.sum(axis=1, keepdims=True),
                joints=tuple(data["joints"].tolist()),
                parents=data["parents"].astype(np.int64),
                mirror=data["mirror"].astype(np.int64),
                detail=data["detail"].astype(bool),
            )

    @property
    def count(self) -> int:
        """The number of vertices."""
        return len(self.weights)

    @cached_property
    def below(self) -> FloatArray:
        """#J by #J + 1, 1 where the second joint hangs from the first one or is the same."""
        table = np.zeros((len(self.parents), len(self.parents) + 1))
        for joint in range(len(self.parents)):
            up = joint
            while up >= 0:
                table[up, joint] = 1.0
                up = int(self.parents[up])
        return table

    def shaped(self, shape: FloatArray) -> FloatArray:
        """Return vertices and joints (#V + #J by 3) of a shape in the standard pose, before scale and place."""
        return self.mean + np.tensordot(shape, self.shapes, 1)

    def share_of(self, *joints: str) -> FloatArray:
        """Return #V, the share that joints of these names, on both sides, have in each vertex."""
        return self.weights[:, [k for k, name in enumerate(self.joints) if name.split(".")[0] in joints]].sum(axis=1)

    def mean_person(self, arms: float, seat: tuple[float, float] = (0.0, 0.0)) -> Person:
        """Return the mean body, 1 m tall, with arms raised by an angle, and hips and knees bent about the axis to the left [rad]."""
        bend = np.zeros((len(self.joints), 3))
        for side, sign in (("L", 1.0), ("R", -1.0)):
            bend[self.joints.index(f"upperarm01.{side}"), 2] = sign * arms
            for joint, angle in zip(("upperleg01", "lowerleg01"), seat, strict=True):
                bend[self.joints.index(f"{joint}.{side}"), 0] = angle
        return Person(
            shape=np.zeros(len(self.shapes)), bend=rotation(bend), turn=np.eye(3), scale=1.0, place=np.zeros(3)
        )

    def frames(self, person: Person) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return how each joint moves what hangs from it, before scale, turn and place of the body.

        Returns:
            vertices and joints in the standard pose (#V + #J by 3); rotations (#J + 1 by 3 by 3) and shifts (#J + 1 by 3), the pelvis last.
        """
        rest, bend = self.shaped(person.shape), person.bend
        turn, shift = np.tile(np.eye(3), (len(bend) + 1, 1, 1)), np.zeros((len(bend) + 1, 3))
        for joint, parent in enumerate(self.parents):
            turn[joint] = turn[parent] @ bend[joint]
            shift[joint] = shift[parent] + (turn[parent] - turn[joint]) @ rest[self.count + joint]
        return rest, turn, shift

    def vertices(self, person: Person) -> FloatArray:
        """Return the vertices of a person, #V by 3 [m]."""
        rest, turn, shift = self.frames(person)
        posed = np.matmul(_blended(self.weights, turn), rest[: self.count, :, None])[:, :, 0] + self.weights @ shift
        return person.scale * posed @ person.turn.T + person.place

    def joints_of(self, person: Person) -> FloatArray:
        """Return the joints of a person, #J by 3 [m]."""
        return np.asarray(person.scale * self._joints(*self.frames(person)) @ person.turn.T + person.place)

    def _joints(self, rest: FloatArray, turn: FloatArray, shift: FloatArray) -> FloatArray:
        """Return the joints in a pose (#J by 3) of :meth:`frames`."""
        return np.einsum("jab,jb->ja", turn[self.parents], rest[self.count :]) + shift[self.parents]

    def rebend(self, person: Person, other: Person, finer: csr_array, points: FloatArray) -> FloatArray:
        """Return points laid on a person as they lie on the same person in another pose.

        What a point stands off the model turns with its joints. Where a joint is bent far between the poses, skinning is wrong by as
        much as the points stand off, and they are drawn to the model.

        Args:
            person: in the present pose.
            other: the same shape in the other pose.
            finer: #P by #V, the model's place of each point.
            points: #P by 3 [m].
        """
        before, after = (each.turn @ self.frames(each)[1] for each in (person, other))
        between = _blended(finer @ self.weights, after @ before.transpose(0, 2, 1))
        u, size, v = np.linalg.svd(between)
        off = points - finer @ self.vertices(person)
        follows = np.clip((size[:, -1] - _FOLDED) / (1.0 - _FOLDED), 0.0, 1.0)
        turned = np.matmul(u @ v, off[:, :, None])[:, :, 0]
        return np.asarray(finer @ self.vertices(other) + follows[:, None] * other.scale / person.scale * turned)

    def only(self, rows: NDArray[np.int64]) -> BodyModel:
        """Return the model with some vertices alone, without triangles; its joints move as before."""
        kept = np.concatenate([rows, self.count + np.arange(len(self.parents))])
        return replace(
            self, mean=self.mean[kept], shapes=np.ascontiguousarray(self.shapes[:, kept]), weights=self.weights[rows],
            triangles=np.zeros((0, 3), dtype=np.int64), mirror=np.zeros(0, dtype=np.int64), detail=self.detail[rows],
        )  # fmt: skip

    def turned(self, person: Person, normals: FloatArray) -> FloatArray:
        """Return directions at the vertices (#V by 3), given in the standard pose, as they turn with the joints and the body."""
        blended = _blended(self.weights, self.frames(person)[1])
        return unit(np.matmul(blended, normals[:, :, None])[:, :, 0] @ person.turn.T)

    @cached_property
    def _by_shape(self) -> FloatArray:
        return np.ascontiguousarray(self.shapes[:, : self.count].transpose(1, 2, 0))

    def jacobian(self, person: Person) -> tuple[FloatArray, FloatArray]:
        """Return the vertices of a person (#V by 3 [m]) and their derivatives (#V by 3 by #S + 3 #J + 7).

        Parameters are the shapes, a small rotation [rad] at each joint in the body's own axes, one of the whole body in the axes of
        space, its place [m], and the logarithm of its scale.
        """
        n, joints, shapes = self.count, len(self.parents), len(self.shapes)
        rest, turn, shift = self.frames(person)
        out = np.empty((n, 3, shapes + 3 * joints + 7))
        spin = person.scale * person.turn
        # Shapes move the vertices, and the joints about which they are bent.
        move = np.zeros((joints + 1, shapes, 3))
        for joint, parent in enumerate(self.parents):
            move[joint] = move[parent] + self.shapes[:, n + joint] @ (turn[parent] - turn[joint]).T
        spun = spin @ _blended(self.weights, turn)
        about = (self.weights @ (move @ spin.T).transpose(0, 2, 1).reshape(joints + 1, -1)).reshape(n, 3, shapes)
        out[:, :, :shapes] = np.matmul(spun, self._by_shape) + about
        # A joint turns all that hangs from it about its own place.
        each = (rest[:n] @ turn.transpose(0, 2, 1) + shift[:, None]) * self.weights.T[:, :, None]
        at = self._joints(rest, turn, shift)
        hung = (self.below @ each.reshape(joints + 1, -1)).reshape(joints, n, 3)
        hung -= (self.below @ self.weights.T)[:, :, None] * at[:, None]
        by_joint = np.matmul(spin, -_cross(hung.transpose(1, 0, 2).reshape(-1, 3)))
        out[:, :, shapes : shapes + 3 * joints] = (
            by_joint.reshape(n, joints, 3, 3).transpose(0, 2, 1, 3).reshape(n, 3, -1)
        )
        posed = each.sum(axis=0) @ spin.T
        out[:, :, -7:-4] = -_cross(posed)
        out[:, :, -4:-1] = np.eye(3)
        out[:, :, -1] = posed
        return posed + person.place, out

    def departures(self, person: Person) -> FloatArray:
        """Return how far a person departs from the mean: shapes, then bends in the frames of the joints' parents [rad]."""
        turn = self.frames(person)[1]
        bends = np.einsum("jab,jb->ja", turn[self.parents], rotation_vector(person.bend))
        return np.concatenate([person.shape, bends.ravel()])

    def moved(self, person: Person, step: FloatArray) -> Person:
        """Return a person after a step in the parameters of :meth:`jacobian`."""
        shapes, joints = len(self.shapes), len(self.parents)
        turn = self.frames(person)[1]
        small = rotation(step[shapes : shapes + 3 * joints].reshape(-1, 3))
        parent = turn[self.parents]
        return Person(
            shape=person.shape + step[:shapes],
            bend=parent.transpose(0, 2, 1) @ small @ parent @ person.bend,
            turn=rotation(step[None, -7:-4])[0] @ person.turn,
            place=person.place + step[-4:-1],
            scale=person.scale * float(np.exp(step[-1])),
        )


@lru_cache(maxsize=1)
def finer_body() -> tuple[csr_array, NDArray[np.int64]]:
    """Return the model subdivided once: a matrix from its vertices to the finer ones, and their triangles.

    Source: Loop, "Smooth subdivision surfaces based on triangles", 1987, with Warren's weights.
    """
    from scipy.sparse import coo_array

    model = BodyModel.load()
    n, faces = model.count, model.triangles
    he = half_edges(faces)
    edges, inverse, sides = he.edges.astype(np.int64), he.edge, he.count
    far = np.roll(faces, 1, axis=1).ravel()
    # An inner edge's vertex takes 3/8 of its ends and 1/8 of the corners across; a border's the mean of its ends.
    at_end = np.where(sides == 2, 0.375, 0.5)
    half = sides[inverse] == 2
    rows = [n + np.arange(len(edges)), n + np.arange(len(edges)), n + inverse[half]]
    columns = [edges[:, 0], edges[:, 1], far[half]]
    values = [at_end, at_end, np.full(int(half.sum()), 0.125)]
    degree = np.bincount(edges.ravel(), minlength=n)
    beta = np.where(degree == 3, 3.0 / 16.0, 3.0 / (8.0 * np.maximum(degree, 1)))
    both = np.concatenate([edges, edges[:, ::-1]])
    rows += [np.arange(n), both[:, 0]]
    columns += [np.arange(n), both[:, 1]]
    values += [1.0 - beta * degree, beta[both[:, 0]]]
    matrix = coo_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(n + len(edges), n)
    ).tocsr()
    a, b, c = faces.T
    ab, bc, ca = n + inverse.reshape(-1, 3).T
    finer = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    return matrix, np.concatenate([np.stack(each, axis=1) for each in finer])


def _blended(weights: FloatArray, turn: FloatArray) -> FloatArray:
    """Return the matrices (#N by 3 by 3) of points with shares in joints (#N by #J + 1) that turn (#J + 1 by 3 by 3)."""
    return np.asarray((weights @ turn.reshape(-1, 9)).reshape(-1, 3, 3))


def _cross(vectors: FloatArray) -> FloatArray:
    """Return the matrices (#N by 3 by 3) that multiply by vectors (#N by 3) from the left, as a cross product."""
    out = np.zeros((len(vectors), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -vectors[:, 2], vectors[:, 1], -vectors[:, 0]
    out[:, 1, 0], out[:, 2, 0], out[:, 2, 1] = vectors[:, 2], -vectors[:, 1], vectors[:, 0]
    return out
