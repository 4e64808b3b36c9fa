"""A triangle mesh that answers for its nearest places."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpflat.core import FloatArray, launch_quietly, unit
from warpflat.flat import area_vectors, vertex_normals
from warpflat.kernels.closest import find_closest

__all__ = ["Mesh"]


class Mesh:
    """A triangle mesh that answers, in single precision, for the nearest places on it.

    Args:
        vertices: #V by 3 [m].
        triangles: #T by 3.
    """

    def __init__(self, vertices: FloatArray, triangles: NDArray[np.int64]) -> None:
        self.vertices, self.triangles = vertices, triangles
        vectors = area_vectors(vertices, triangles)
        #: #T [m2], and #T by 3, of the triangles.
        self.area, self.normals = np.linalg.norm(vectors, axis=1), unit(vectors)

    @cached_property
    def _tree(self) -> wp.Mesh:
        return wp.Mesh(
            points=wp.array(self.vertices, dtype=wp.vec3, device="cpu"),
            indices=wp.array(self.triangles.ravel(), dtype=wp.int32, device="cpu"),
        )

    @cached_property
    def _outwards(self) -> FloatArray:
        return vertex_normals(self.vertices, self.triangles)

    def closest(self, points: FloatArray) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
        """Return the nearest triangle of each point (#P), weights of the nearest place on it (#P by 3), and that place (#P by 3 [m])."""
        face = wp.empty(len(points), dtype=wp.int32, device="cpu")
        weight = wp.empty(len(points), dtype=wp.vec3, device="cpu")
        given = [self._tree.id, wp.array(points, dtype=wp.vec3, device="cpu")]
        launch_quietly(find_closest, dim=len(points), inputs=given, outputs=[face, weight], device="cpu")
        found, share = face.numpy().astype(np.int64), weight.numpy().astype(np.float64)
        return found, share, np.einsum("pk,pka->pa", share, self.vertices[self.triangles[found]])

    def sample(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Return places spread evenly over the mesh, the same each time, and the normals of their triangles (#P by 3 each)."""
        random = np.random.default_rng(0)
        face = random.choice(len(self.triangles), count, p=self.area / self.area.sum())
        share = random.dirichlet([1.0, 1.0, 1.0], count)
        return np.einsum("pk,pka->pa", share, self.vertices[self.triangles[face]]), self.normals[face]

    def normals_at(self, face: NDArray[np.int64], weights: FloatArray) -> FloatArray:
        """Return the unit normals at places on triangles (#P, with weights #P by 3), #P by 3, that change smoothly over the mesh.

        The nearest place is often on an edge, where rounding decides to which of its two triangles it belongs.
        """
        return unit(np.einsum("pk,pka->pa", weights, self._outwards[self.triangles[face]]))
