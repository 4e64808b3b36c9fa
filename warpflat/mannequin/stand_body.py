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
from warpflat.mannequin.body_model import BodyModel
from warpflat.mannequin.fit_body import FittedBody, Mesh, fit_body, vertex_normals

__all__ = ["StandingBody", "finer_body", "lay_on_scan", "stand_body"]

# Moves onto the scan: how stiff the move is, and how far a place may lie [m].
_STAGES = ((0.5, 0.05), (0.1, 0.04), (0.02, 0.03), (0.004, 0.03), (0.004, 0.03))
# Surfaces face the same way where their normals' product is larger than this.
_ALIKE = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class StandingBody:
    """A scan's body in the standard pose, facing +Z, the pelvis over the origin, its lowest point at y = 0.

    Attributes:
        vertices: #V by 3 [m]. triangles: #T by 3.
        posed: #V by 3 [m], the same vertices on the scan.
        weights: #V by #J + 1, share of each joint in a vertex.
        seen: #V, whether the scan shows the body there.
        fit: of the model.
    """

    vertices: FloatArray
    triangles: NDArray[np.int64]
    posed: FloatArray
    weights: FloatArray
    seen: BoolArray
    fit: FittedBody


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
    return (even.T @ even).tocsr()


def lay_on_scan(start: FloatArray, mesh: Mesh, patched: BoolArray) -> tuple[FloatArray, BoolArray]:
    """Return the finer body's vertices moved from `start` onto a scan (#V by 3 [m]), and which of them the scan shows.

    Args:
        start: #V by 3 [m].
        mesh: the scan.
        patched: by triangle of the scan, whether it closes a hole.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import splu

    _, triangles = finer_body()
    bending, points, seen = _bending(), start, np.zeros(len(start), dtype=bool)
    for stiffness, reach in _STAGES:
        normals = vertex_normals(points, triangles)
        found, _, place = mesh.closest(points)
        away = place - points
        far = np.linalg.norm(away, axis=1)
        along = np.einsum("va,va->v", away, normals)
        alike = np.einsum("va,va->v", normals, mesh.normals[found]) > _ALIKE
        # Beside the border of a hole the nearest place does not lie along the normal.
        seen = alike & (far < reach) & (np.abs(along) > 0.8 * far - 0.002) & ~patched[found]
        weight = np.where(seen, 1.0 / (1.0 + (far / reach) ** 2) ** 2, 0.0)
        system = diags_array(weight + 1e-6) + stiffness * bending
        points = points + splu(system.tocsc()).solve(weight * along)[:, None] * normals
    return points, seen


def stand_body(vertices: FloatArray, triangles: NDArray[np.int64], scanned: int | None = None) -> StandingBody:
    """Fit the model to an upright scan that faces +Z, lay it on the scan, and undo its pose.

    Args:
        vertices: #V by 3 [m].
        triangles: #T by 3, their normals outward.
        scanned: triangles from this one on close holes; None for none.
    """
    fit = fit_body(vertices, triangles)
    model, (finer, faces) = BodyModel.load(), finer_body()
    weights = finer @ model.weights
    patched = np.arange(len(triangles)) >= (len(triangles) if scanned is None else scanned)
    posed, seen = lay_on_scan(finer @ model.vertices(fit.person), Mesh(vertices, triangles), patched)
    standing = model.unbend(fit.person, posed, weights)
    upright = replace(fit.person, turn=np.eye(3), place=np.zeros(3))
    standing = (standing - fit.person.place) @ fit.person.turn @ upright.turn.T
    standing[:, 1] -= standing[:, 1].min()
    return StandingBody(vertices=standing, triangles=faces, posed=posed, weights=weights, seen=seen, fit=fit)
