"""A triangle mesh and what follows from it; smooth fields on it, harmonic and of heat; and the mirror image of a field."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, diags_array
from scipy.spatial import cKDTree

from warpflat.core import BoolArray, FloatArray, factor_symmetric, reflected, unit
from warpflat.flat import (
    HalfEdges,
    Surface,
    area_vectors,
    border_loops,
    euler_characteristic,
    flat_areas,
    half_edges,
    join_labels,
    mean_normals,
    nearest_on_triangles,
)

__all__ = ["MirrorMap", "TriangleMesh", "mirror_map"]

Ids = NDArray[np.int64]

# Cotangents of needles are bounded: they would drown all others.
_MOST_COTANGENT = 20.0
# A weight is at least this: with none below zero a harmonic field has no maximum inside.
_LEAST_WEIGHT = 1e-3
# Triangles that are tried as the nearest to a point, by their middles.
_TRIED = 12


@dataclass(frozen=True, kw_only=True, eq=False)
class TriangleMesh:
    """A triangle mesh, and what follows from it, each made when it is first asked for.

    Attributes:
        vertices: #V by 3 [m].
        faces: #F by 3.
    """

    vertices: FloatArray
    faces: Ids

    @cached_property
    def half_edges(self) -> HalfEdges:
        """The half-edges of the faces."""
        return half_edges(self.faces.astype(np.int32))

    @cached_property
    def border_edges(self) -> Ids:
        """#E by 2, the edges with a face on one side alone."""
        return self.half_edges.edges[self.half_edges.count == 1].astype(np.int64)

    @cached_property
    def loops(self) -> list[Ids]:
        """The border loops, the longest first."""
        return [loop.astype(np.int64) for loop in border_loops(self.half_edges, self.vertices)]

    @cached_property
    def shape(self) -> tuple[int, int]:
        """The number of border loops, and the Euler characteristic: (1, 1) of a disk, (2, 0) of a tube or a ring."""
        return len(self.loops), euler_characteristic(self.half_edges)

    @property
    def is_disk(self) -> bool:
        """Whether it is one disk."""
        return self.shape == (1, 1)

    @cached_property
    def area_vectors(self) -> FloatArray:
        """#F by 3, normals as long as the areas [m2]."""
        return area_vectors(self.vertices, self.faces)

    @cached_property
    def face_areas(self) -> FloatArray:
        """#F [m2]."""
        return flat_areas(self.vertices, self.faces)

    @cached_property
    def face_normals(self) -> FloatArray:
        """#F by 3, of length 1, or 0 for a face without area."""
        return unit(self.area_vectors)

    @cached_property
    def size(self) -> float:
        """The square root of the area [m], of which most lengths are shares."""
        return float(np.sqrt(self.face_areas.sum()))

    @cached_property
    def vertex_normals(self) -> FloatArray:
        """#V by 3, of length 1."""
        return mean_normals(self.area_vectors, self.faces, len(self.vertices))

    @cached_property
    def curvature(self) -> FloatArray:
        """#V, by how much the angles of the faces around a vertex fall short of 2 pi [rad]."""
        return np.array(trimesh.Trimesh(self.vertices, self.faces, process=False).vertex_defects)

    @cached_property
    def graph(self) -> csr_array:
        """#V by #V, the lengths of the edges [m], each from its lower vertex to the higher one."""
        a, b = self.half_edges.edges.T.astype(np.int64)
        # A length of nothing would be read as "no edge".
        long = np.maximum(np.linalg.norm(self.vertices[a] - self.vertices[b], axis=1), 1e-12)
        return csr_array(coo_array((long, (a, b)), shape=(len(self.vertices),) * 2))

    def as_surface(self, name: str = "garment") -> Surface:
        """Return the mesh as a surface of a name."""
        return Surface(
            vertices=self.vertices,
            faces=np.column_stack([self.faces, np.full(len(self.faces), -1)]).astype(np.int32),
            name=name,
        )

    def connected(self, joined: Callable[[Ids, Ids], BoolArray]) -> Ids:
        """Return #V, a number for each set of vertices that edges hold together of which `joined` (#E) is true for both ends."""
        a, b = self.half_edges.edges.T.astype(np.int64)
        kept = joined(a, b)
        return join_labels(len(self.vertices), a[kept], b[kept]).astype(np.int64)

    def reached(self, allowed: BoolArray, seeds: Ids) -> BoolArray:
        """Return #V, the vertices that are reached from seeds along edges between allowed ones (#V)."""
        label = self.connected(lambda a, b: allowed[a] & allowed[b])
        return np.asarray(np.isin(label, label[seeds[allowed[seeds]]]) & allowed)

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
        third = np.repeat(self.face_areas / 3.0, 3)
        return np.maximum(np.bincount(self.faces.ravel(), third, minlength=len(self.vertices)), 1e-300)

    def smooth(self, values: FloatArray, length: float) -> FloatArray:
        """Return values (#V or #V by N) smoothed over a length [m]: one implicit step of the heat equation."""
        matrix = csc_array(length**2 * self.laplacian + diags_array(self.mass))
        right = self.mass * values if values.ndim == 1 else self.mass[:, None] * values
        return factor_symmetric(matrix)(right)

    def solve(
        self,
        fixed: Ids,
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
        weight: #V, 1 where the surface has a mirror image, falling to 0 where it has none.
    """

    matrix: csr_array
    weight: FloatArray

    def symmetrised(self, values: FloatArray, sign: float = 1.0) -> FloatArray:
        """Return a field averaged with its mirror image, or, for sign -1, with the negative of that."""
        return values + 0.5 * self.weight * (sign * (self.matrix @ values) - values)


def mirror_map(mesh: TriangleMesh, normal: FloatArray, offset: float, *, reach: float) -> MirrorMap:
    """Find where a mesh's vertices lie when they are mirrored in the plane normal . x = offset.

    Args:
        mesh: the mesh.
        normal: of length 1, offset: [m].
        reach: a vertex whose image is so far from the surface has no mirror image [m].
    """
    vertices, faces = mesh.vertices, mesh.faces
    corners = vertices[faces]
    image = reflected(vertices, normal, offset)
    facing = reflected(mesh.vertex_normals, normal)
    tried = min(_TRIED, len(faces))
    nearest = np.asarray(cKDTree(corners.mean(axis=1)).query(image, k=tried)[1]).reshape(len(image), tried)
    best, shares, chosen = np.full(len(image), np.inf), np.zeros((len(image), 3)), np.zeros(len(image), dtype=np.int64)
    for column in nearest.T:
        share = nearest_on_triangles(corners[column], image)
        away = np.linalg.norm(np.einsum("vk,vkj->vj", share, corners[column]) - image, axis=1)
        # Another layer that faces the other way is not the mirror image.
        cost = away + np.where(np.einsum("ij,ij->i", mesh.face_normals[column], facing) < 0.0, reach, 0.0)
        better = cost < best
        best, chosen = np.where(better, cost, best), np.where(better, column, chosen)
        shares[better] = share[better]
    rows = np.repeat(np.arange(len(vertices)), 3)
    matrix = coo_array((shares.ravel(), (rows, faces[chosen].ravel())), shape=(len(vertices), len(vertices))).tocsr()
    return MirrorMap(matrix=csr_array(matrix), weight=np.clip(2.0 - 2.0 * best / reach, 0.0, 1.0))
