"""Areas of triangles and quads with their normals, and normals of the vertices between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.vectors import unit

__all__ = ["area_vectors", "flat_areas", "mean_normals", "vertex_normals"]

# Faces around a vertex cancel below this share of their area.
_CANCEL = 1e-9


def area_vectors(positions: FloatArray, faces: NDArray[np.integer]) -> FloatArray:
    """Return the normals of faces over `positions` (#V by 2 or 3), as long as their areas [m2].

    Faces are triangles (#F by 3), or quads and triangles (#F by 4, -1 last in a triangle).
    """
    space = positions if positions.shape[1] == 3 else np.column_stack([positions, np.zeros(len(positions))])
    # The sides of a triangle, or the diagonals of a quad. By columns, twice as fast as np.cross on the rows: it matters at a million faces.
    ends = ((0, 1), (0, 2)) if faces.shape[1] == 3 else ((0, 2), (1, 3))
    if faces.min(initial=0) < 0:
        faces = np.where(faces >= 0, faces, faces[:, :1])
    (ux, uy, uz), (vx, vy, vz) = ((space[faces[:, end]] - space[faces[:, start]]).T for start, end in ends)
    return 0.5 * np.column_stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx])


def flat_areas(positions: FloatArray, faces: NDArray[np.integer]) -> FloatArray:
    """Return #F, the areas of faces [m2], as `area_vectors` takes them; of a quad that is bent, of its shadow along its normal."""
    return np.asarray(np.linalg.norm(area_vectors(positions, faces), axis=1))


def vertex_normals(positions: FloatArray, faces: NDArray[np.integer]) -> FloatArray:
    """Return unit normals of vertices, #V by 3: the mean of the faces around each by area; zero without any, or where they cancel."""
    return mean_normals(area_vectors(positions, faces), faces, len(positions))


def mean_normals(vectors: FloatArray, faces: NDArray[np.integer], count: int) -> FloatArray:
    """Return the unit normals of `count` vertices, as `vertex_normals` does, by area vectors (#F by 3)."""
    corners, each = faces.T.ravel(), faces.shape[1]
    total: FloatArray = np.column_stack([np.bincount(corners, np.tile(axis, each), count) for axis in vectors.T])
    areas = np.bincount(corners, np.tile(np.linalg.norm(vectors, axis=1), each), count)
    # Faces that lie on each other, as a mouth's lining, cancel but for rounding.
    total[np.linalg.norm(total, axis=1) < _CANCEL * areas] = 0.0
    return unit(total)
