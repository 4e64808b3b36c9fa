"""Smooth fields on a garment: harmonic and heat fields, and the mirror image of a field."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, diags_array

from warpflat.core import FloatArray, factor_symmetric, reflected
from warpflat.flat import face_normals, flat_areas, nearest_on_triangles, vertex_normals

__all__ = ["MirrorMap", "Operators", "mirror_map"]

# Cotangents of needles are bounded: they would drown all others.
_MOST_COTANGENT = 20.0
# A weight is at least this: with none below zero a harmonic field has no maximum inside.
_LEAST_WEIGHT = 1e-3
# Triangles that are tried as the nearest to a point, by their middles.
_TRIED = 12


@dataclass(frozen=True, kw_only=True, eq=False)
class Operators:
    """Laplacian and mass of a triangle mesh.

    Attributes:
        vertices: #V by 3 [m].
        faces: #F by 3.
    """

    vertices: FloatArray
    faces: NDArray[np.int64]

    @cached_property
    def laplacian(self) -> csr_array:
        """#V by #V, the cotangent Laplacian, positive semidefinite, with no weight below zero."""
        count = len(self.vertices)
        rows, columns, weights = [], [], []
        for k in range(3):
            i, j, o = (self.faces[:, (k + n) % 3] for n in range(3))
            u, v = self.vertices[i] - self.vertices[o], self.vertices[j] - self.vertices[o]
            double = np.linalg.norm(np.cross(u, v), axis=1)
            cotangent = np.einsum("ij,ij->i", u, v) / np.maximum(double, 1e-300)
            rows.append(i)
            columns.append(j)
            weights.append(0.5 * np.clip(cotangent, -_MOST_COTANGENT, _MOST_COTANGENT))
        a, b, w = np.concatenate(rows), np.concatenate(columns), np.concatenate(weights)
        sides = coo_array(
            (np.concatenate([w, w]), (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(count, count)
        )
        matrix = sides.tocsr()
        matrix.data = np.maximum(matrix.data, _LEAST_WEIGHT)
        return csr_array(diags_array(np.asarray(matrix.sum(axis=1)).ravel()) - matrix)

    @cached_property
    def mass(self) -> FloatArray:
        """#V, the area of each vertex [m2]."""
        area = flat_areas(self.vertices, self.faces) / 3.0
        return np.maximum(np.bincount(self.faces.ravel(), np.repeat(area, 3), minlength=len(self.vertices)), 1e-300)

    @cached_property
    def vertex_normals(self) -> FloatArray:
        """#V by 3, of length 1."""
        return vertex_normals(self.vertices, self.faces)

    def to_vertices(self, of_faces: FloatArray) -> FloatArray:
        """Return the sum over the faces (#F by N) at each vertex (#V by N)."""
        return np.stack(
            [
                np.bincount(self.faces.ravel(), np.repeat(column, 3), minlength=len(self.vertices))
                for column in of_faces.T
            ],
            axis=1,
        )

    def smooth(self, values: FloatArray, length: float) -> FloatArray:
        """Return values (#V or #V by N) smoothed over a length [m]: one implicit step of the heat equation."""
        matrix = csc_array(length**2 * self.laplacian + diags_array(self.mass))
        right = self.mass * values if values.ndim == 1 else self.mass[:, None] * values
        return factor_symmetric(matrix)(right)

    def solve(
        self,
        fixed: NDArray[np.int64],
        given: FloatArray,
        *,
        data: FloatArray | None = None,
        length: float = np.inf,
    ) -> FloatArray:
        """Return the smoothest field that has given values at fixed vertices: harmonic, or screened where data pull.

        The minimum of the integral of |grad f|^2 + (f - data)^2 / length^2; at free borders its level lines end square.

        Args:
            fixed: vertices, given: their values.
            data: #V, what the field keeps near to, length: over how far it may be smoothed away [m].
        """
        pull = np.zeros(len(self.vertices)) if data is None else self.mass / length**2
        matrix = csr_array(self.laplacian + diags_array(pull))
        right = np.zeros(len(self.vertices)) if data is None else pull * data
        found = np.zeros(len(self.vertices))
        found[fixed] = given
        free = np.ones(len(self.vertices), dtype=bool)
        free[fixed] = False
        inner = np.flatnonzero(free)
        if len(inner):
            rows = matrix[inner]
            core = csc_array(rows[:, inner])
            # Parts without a fixed vertex are held by next to nothing, at zero.
            core = core + diags_array(np.full(len(inner), 1e-9 * float(core.diagonal().mean())))
            found[inner] = factor_symmetric(csc_array(core))(right[inner] - rows[:, np.asarray(fixed)] @ given)
        return found


@dataclass(frozen=True, kw_only=True, eq=False)
class MirrorMap:
    """For each vertex the place on the surface that mirrors it.

    Attributes:
        matrix: #V by #V; times a field it gives the field's value at each vertex's mirror image.
        distance: #V, from the mirror image of a vertex to the surface [m].
        weight: #V, 1 where the surface has a mirror image, falling to 0 where it has none.
    """

    matrix: csr_array
    distance: FloatArray
    weight: FloatArray

    def symmetrised(self, values: FloatArray, sign: float = 1.0) -> FloatArray:
        """Return a field averaged with its mirror image, or, for sign -1, with the negative of that."""
        return values + 0.5 * self.weight * (sign * (self.matrix @ values) - values)


def mirror_map(
    vertices: FloatArray, faces: NDArray[np.int64], normal: FloatArray, offset: float, *, reach: float
) -> MirrorMap:
    """Find where a mesh's vertices lie when they are mirrored in the plane normal . x = offset.

    Args:
        vertices: #V by 3 [m], faces: #F by 3.
        normal: of length 1, offset: [m].
        reach: a vertex whose image is so far from the surface has no mirror image [m].
    """
    from scipy.spatial import cKDTree

    corners = vertices[faces]
    image = reflected(vertices, normal, offset)
    turned = face_normals(vertices, faces)
    facing = reflected(Operators(vertices=vertices, faces=faces).vertex_normals, normal)
    tried = min(_TRIED, len(faces))
    nearest = np.asarray(cKDTree(corners.mean(axis=1)).query(image, k=tried)[1]).reshape(len(image), tried)
    best, shares, chosen = np.full(len(image), np.inf), np.zeros((len(image), 3)), np.zeros(len(image), dtype=np.int64)
    for column in nearest.T:
        share = nearest_on_triangles(corners[column], image)
        away = np.linalg.norm(np.einsum("vk,vkj->vj", share, corners[column]) - image, axis=1)
        # Another layer that faces the other way is not the mirror image.
        cost = away + np.where(np.einsum("ij,ij->i", turned[column], facing) < 0.0, reach, 0.0)
        better = cost < best
        best, chosen = np.where(better, cost, best), np.where(better, column, chosen)
        shares[better] = share[better]
    rows = np.repeat(np.arange(len(vertices)), 3)
    matrix = coo_array((shares.ravel(), (rows, faces[chosen].ravel())), shape=(len(vertices), len(vertices))).tocsr()
    return MirrorMap(matrix=csr_array(matrix), distance=best, weight=np.clip(2.0 - 2.0 * best / reach, 0.0, 1.0))
