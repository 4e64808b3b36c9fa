"""Curvature of a surface at its vertices."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warpflat.surface.mesh import Surface
from warpflat.surface.topology import corner_triangles

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

__all__ = ["curvature_tensors"]

_ROUNDS = 3
# Vertices at a time, so that memory does not grow with the mesh.
_BLOCK = 32_768


def curvature_tensors(surface: Surface) -> NDArray[np.float64]:
    """Second fundamental form at each vertex, as a tensor in space: d . II . d is the curvature along a unit tangent d.

    Positive where the surface bulges to the outside. Around each vertex, normal and curvature are fitted to two rings of
    neighbours: a point at d from the vertex lies 1/2 |d|^2 k(direction) below the tangent plane. On a circle that is
    exact for any chord, so spheres and cylinders come out exact, at the border too. A vertex with fewer than five
    neighbours within two rings counts as flat.

    Args:
        surface: of any faces; its border is fitted from one side.

    Returns:
        #V by 3 by 3 [1/m], symmetric.
    """
    count = len(surface.vertices)
    ring, normal = _ring(surface), _vertex_normals(surface)
    tensors = np.zeros((count, 3, 3))
    for first in range(0, count, _BLOCK):
        last = min(first + _BLOCK, count)
        pairs = (ring[first:last] @ ring).tocoo()
        tensors[first:last] = _fitted(
            surface.vertices[first:last], surface.vertices[pairs.col], pairs.row.astype(np.int64), normal[first:last]
        )
    return tensors


def _fitted(
    places: NDArray[np.float64],
    neighbors: NDArray[np.float64],
    here: NDArray[np.int64],
    normal: NDArray[np.float64],
) -> NDArray[np.float64]:
    """#N by 3 by 3 for `places` (#N by 3); `neighbors` (#P by 3) belong to the places `here` (#P)."""
    count = len(places)
    d = neighbors - places[here]
    squared = np.einsum("ij,ij->i", d, d)
    keep = squared > 0.0
    here, d, squared = here[keep], d[keep], squared[keep]
    enough = np.bincount(here, minlength=count) >= 5
    for _ in range(_ROUNDS):
        u, v = _tangents(normal)
        x, y = np.einsum("ij,ij->i", d, u[here]), np.einsum("ij,ij->i", d, v[here])
        drop = -np.einsum("ij,ij->i", d, normal[here])
        flat = np.maximum(x * x + y * y, 1e-300)
        size = 0.5 * squared / flat
        # Per length, so that the near neighbours count as much as the far ones.
        rows = np.stack([size * x * x, 2.0 * size * x * y, size * y * y, x, y], axis=1) / squared[:, None]
        fitted = _solve(here, rows, drop / squared, count)
        fitted[~enough] = 0.0
        curved, slope = fitted[:, :3], fitted[:, 3:]
        normal = normal + slope[:, :1] * u + slope[:, 1:] * v
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    uu, vv = u[:, :, None] * u[:, None, :], v[:, :, None] * v[:, None, :]
    uv = u[:, :, None] * v[:, None, :]
    a, b, c = (curved[:, k, None, None] for k in range(3))
    return np.asarray(a * uu + b * (uv + np.swapaxes(uv, 1, 2)) + c * vv)


def _ring(surface: Surface) -> csr_matrix:
    """#V by #V, 1 where two vertices share a face."""
    from scipy.sparse import coo_matrix

    faces, count = surface.faces, len(surface.vertices)
    used = faces >= 0
    face = np.broadcast_to(np.arange(len(faces))[:, None], faces.shape)[used]
    incidence = coo_matrix((np.ones(len(face), dtype=np.int32), (face, faces[used])), shape=(len(faces), count)).tocsr()
    return (incidence.T @ incidence).astype(bool).astype(np.int32).tocsr()


def _vertex_normals(surface: Surface) -> NDArray[np.float64]:
    corner, _, weight = corner_triangles(surface.faces)
    p = surface.vertices[corner]
    vector = weight[:, None] * np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    total = np.stack(
        [np.bincount(corner.ravel(), np.repeat(vector[:, k], 3), minlength=len(surface.vertices)) for k in range(3)],
        axis=1,
    )
    length = np.linalg.norm(total, axis=1)
    total[length == 0.0] = (0.0, 0.0, 1.0)
    return np.asarray(total / np.where(length > 0.0, length, 1.0)[:, None])


def _tangents(normal: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    least = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    u = np.cross(normal, least)
    u /= np.linalg.norm(u, axis=1)[:, None]
    return u, np.cross(normal, u)


def _solve(
    here: NDArray[np.int64], rows: NDArray[np.float64], right: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Least squares per vertex: #V by #unknowns. Unknowns are scaled first, so that metres do not matter."""
    unknowns = rows.shape[1]
    scale = np.stack([np.bincount(here, rows[:, k] ** 2, minlength=count) for k in range(unknowns)], axis=1)
    scale = np.sqrt(np.maximum(scale, 1e-300))
    scaled = rows / scale[here]
    matrix = np.empty((count, unknowns, unknowns))
    vector = np.empty((count, unknowns))
    for i in range(unknowns):
        vector[:, i] = np.bincount(here, scaled[:, i] * right, minlength=count)
        for j in range(i + 1):
            matrix[:, i, j] = matrix[:, j, i] = np.bincount(here, scaled[:, i] * scaled[:, j], minlength=count)
    # Neighbours in one row leave a direction undetermined; this much counts it as flat.
    matrix += 1e-9 * np.eye(unknowns)
    return np.asarray(np.linalg.solve(matrix, vector[..., None])[..., 0] / scale)
