"""A scan's body as it stands: the model laid on the scan, and its pose undone.

The fitted model, subdivided once, moves along its normals onto the scan; where the scan shows nothing, the move of its neighbours is
carried on smoothly. So each scan becomes one closed mesh whose vertices are the same places on every body.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.core.sparse import factor_symmetric
from warpflat.mannequin.body_model import BodyModel
from warpflat.mannequin.fit_body import FittedBody, Mesh, fit_body, vertex_normals
from warpflat.mannequin.slicer import Slicer

__all__ = ["StandingBody", "finer_body", "lay_on_scan", "stand_body"]

# Moves onto the scan: how stiff the move is, and how far a place may lie [m].
_STAGES = ((0.5, 0.03), (0.1, 0.025), (0.02, 0.02), (0.004, 0.02), (0.004, 0.02))
# How much the model counts where the scan shows nothing.
_HOME = 0.02
# Where arms join the trunk a place may lie so much less far, as a share.
_WEB = 0.7
# Head, hands and feet have few vertices, which follow the scan's lips, fingers and toes not so closely: so much stiffer.
_DETAIL = 30.0
# A standing body's joints are bent by no more than this [rad].
_BENT = np.radians(8.0)
# A fit is no good beyond a mean distance [m]; if less than a share of the scan lies beside it [m]; or if the scan shows less than a
# share of a limb, or of a band [m] of the trunk with more than a few vertices.
_FAR, _BESIDE, _FLOOR, _SHARED, _SEEN, _BAND, _FEW = 0.012, 0.08, 0.05, 0.7, 0.5, 0.02, 12
_PARTS = {
    "spine03": "the chest", "pelvis": "the pelvis", "neck01": "a head", "clavicle": "two shoulders", "upperarm01": "two upper arms",
    "upperleg01": "two thighs", "lowerleg01": "two calves",
}  # fmt: skip
# Surfaces face the same way where their normals' product is larger than this.
_ALIKE = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class StandingBody:
    """A scan's body in nearly the standard pose, facing +Z, the pelvis in the midplane, its lowest point at y = 0.

    Attributes:
        vertices: #V by 3 [m]. triangles: #T by 3.
        posed: #V by 3 [m], the same vertices on the scan.
        weights: #V by #J + 1, share of each joint in a vertex.
        seen: #V, whether the scan shows the body there.
        fit: of the model.
        unsure: why the scan is no such body; None if it is.
        turned: whether the scan faces -Z.
    """

    vertices: FloatArray
    triangles: NDArray[np.int64]
    posed: FloatArray
    weights: FloatArray
    seen: BoolArray
    fit: FittedBody
    unsure: str | None
    turned: bool = False

    def slicer(self) -> Slicer:
        """Return the plane sections of the standing body; what the scan does not show counts as patches over holes."""
        shown = self.seen[self.triangles].any(axis=1)
        order = np.argsort(~shown, kind="stable")
        return Slicer(self.vertices, self.triangles[order], scanned=int(shown.sum()))


@lru_cache(maxsize=1)
def finer_body() -> tuple[csr_array, NDArray[np.int64]]:
    """Return the model subdivided once: a matrix from its vertices to the finer ones, and their triangles.

    Source: Loop, "Smooth subdivision surfaces based on triangles", 1987, with Warren's weights.
    """
    from scipy.sparse import coo_array

    model = BodyModel.load()
    n, faces = model.count, model.triangles
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    edges, inverse = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    inverse = np.ravel(inverse)
    far = np.roll(faces, 1, axis=1).ravel()
    sides = np.bincount(inverse, minlength=len(edges))
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


@lru_cache(maxsize=1)
def _bending() -> csr_array:
    """Return the matrix of the squared second differences over the finer body's edges."""
    from scipy.sparse import coo_array, diags_array

    matrix, triangles = finer_body()
    n = matrix.shape[0]
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    both = np.unique(np.concatenate([ends, ends[:, ::-1]]), axis=0)
    near = coo_array((np.ones(len(both)), both.T), shape=(n, n)).tocsr()
    even = diags_array(np.ones(n)) - diags_array(1.0 / np.maximum(near.sum(axis=1), 1.0)) @ near
    stiff = np.where(matrix @ BodyModel.load().detail > 0.5, _DETAIL, 1.0)
    return (even.T @ diags_array(stiff) @ even).tocsr()


def lay_on_scan(start: FloatArray, mesh: Mesh, patched: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Return the finer body's vertices moved from `start` onto a scan (#V by 3 [m]), and which of them the scan shows.

    Args:
        start: #V by 3 [m].
        mesh: the scan.
        patched: by triangle of the scan, whether it closes a hole.
    """
    from scipy.sparse import diags_array

    finer, triangles = finer_body()
    bending, points, seen = _bending(), start, np.zeros(len(start), dtype=bool)
    model = BodyModel.load()
    weights = finer @ model.weights
    arms, near = (
        weights[:, [i for i, name in enumerate(model.joints) if name.split(".")[0] in names]].sum(axis=1)
        for names in (("upperarm01",), ("spine03", "clavicle"))
    )
    # Scanners and cloth span webs between arms and trunk.
    nearer = 1.0 - _WEB * np.minimum(1.0, 4.0 * arms * near)
    for stiffness, far_at_most in _STAGES:
        reach = far_at_most * nearer
        normals = vertex_normals(points, triangles)
        found, _, place = mesh.closest(points)
        away = place - points
        far = np.linalg.norm(away, axis=1)
        along = np.einsum("va,va->v", away, normals)
        alike = np.einsum("va,va->v", normals, mesh.normals[found]) > _ALIKE
        # Beside the border of a hole the nearest place does not lie along the normal.
        seen = alike & (far < reach) & (np.abs(along) > 0.8 * far - 0.002) & ~patched[found]
        # What the scan does not show goes back to the model.
        along = np.where(seen, along, np.einsum("va,va->v", start - points, normals))
        weight = np.where(seen, 1.0 / (1.0 + (far / reach) ** 2) ** 2, _HOME)
        system = diags_array(weight) + stiffness * bending
        points = points + factor_symmetric(system)(weight * along)[:, None] * normals
    return points, seen


def stand_body(
    vertices: FloatArray, triangles: NDArray[np.int64], scanned: int | None = None, *, faces_ahead: bool = False
) -> StandingBody:
    """Fit the model to an upright scan, lay it on the scan, and undo its pose.

    Args:
        vertices: #V by 3 [m].
        triangles: #T by 3, their normals all outward or all inward.
        scanned: triangles from this one on close holes; None for none.
        faces_ahead: whether the scan faces +Z for sure; else one that is no body so is tried facing -Z.
    """
    corners = vertices[triangles]
    if np.einsum("ta,ta->", np.cross(corners[:, 0], corners[:, 1]), corners[:, 2]) < 0.0:
        triangles = triangles[:, ::-1]
    found = _stand(fit_body(vertices, triangles), vertices, triangles, scanned)
    if found.unsure is not None and not faces_ahead:
        vertices = vertices * [-1.0, 1.0, -1.0]
        fit = fit_body(vertices, triangles)
        if fit.cost < found.fit.cost:
            turned = _stand(fit, vertices, triangles, scanned)
            if turned.unsure is None:
                return replace(turned, turned=True)
    return found


def _stand(fit: FittedBody, vertices: FloatArray, triangles: NDArray[np.int64], scanned: int | None) -> StandingBody:
    model, (finer, faces) = BodyModel.load(), finer_body()
    weights = finer @ model.weights
    patched = np.arange(len(triangles)) >= (len(triangles) if scanned is None else scanned)
    mesh = Mesh(vertices, triangles)
    posed, seen = lay_on_scan(finer @ model.vertices(fit.person), mesh, patched)
    other = fit.person.standing(_BENT)
    standing = model.rebend(fit.person, other, finer, posed)
    standing -= [float(fit.person.place[0]), standing[:, 1].min(), 0.0]
    unsure = _unsure(fit, mesh, model.vertices(fit.person), standing, weights, seen)
    return StandingBody(
        vertices=standing, triangles=faces, posed=posed, weights=weights, seen=seen, fit=fit, unsure=unsure
    )


def _unsure(
    fit: FittedBody, scan: Mesh, model: FloatArray, standing: FloatArray, weights: FloatArray, seen: BoolArray
) -> str | None:
    """Return why a fit is no good: it lies far from the scan, or one of the two has parts that the other has not."""
    mean = float(fit.distance[np.isfinite(fit.distance)].mean())
    if mean > _FAR:
        return f"the body model lies {1000.0 * mean:.0f} mm off the scan in the mean"
    near = (
        np.linalg.norm(Mesh(model, BodyModel.load().triangles).closest(scan.vertices)[2] - scan.vertices, axis=1)
        < _BESIDE
    )
    # A floor is no part of the body, either.
    area = scan.area * (scan.vertices[scan.triangles, 1].max(axis=1) > scan.vertices[:, 1].min() + _FLOOR)
    shared = float(area @ near[scan.triangles].mean(axis=1) / area.sum())
    if shared < _SHARED:
        return f"{100.0 * (1.0 - shared):.0f} % of the scan is no part of a standing body"
    names = (*BodyModel.load().joints, "pelvis")
    part = np.argmax(weights, axis=1)
    triangles = finer_body()[1]
    size = np.bincount(triangles.ravel(), np.repeat(Mesh(standing, triangles).area, 3), len(standing))
    plain = finer_body()[0] @ BodyModel.load().detail < 0.5
    for number, name in enumerate(names):
        which = (part == number) & (plain | (name == "neck01"))
        shown = _PARTS.get(name.split(".")[0])
        if shown and float(size[which] @ seen[which]) < _SEEN * float(size[which].sum()):
            return f"the scan does not show {shown}"
    trunk = np.isin(part, [names.index("spine03"), names.index("pelvis")])
    bands = np.floor(standing[trunk, 1] / _BAND).astype(int)
    count = np.bincount(bands)
    share = np.where(count < _FEW, 1.0, np.bincount(bands, seen[trunk]) / np.maximum(count, 1))
    if share.min() < _SEEN:
        return f"the scan does not show the trunk at {_BAND * float(np.argmin(share)):.2f} m"
    return None
