"""Curvature of a surface at its vertices."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.launch import launch_each
from warpflat.flat.surface.mesh import Surface, once_per_surface
from warpflat.flat.surface.unfold import vertex_normals
from warpflat.kernels.curvature import fit_curvature

__all__ = ["curvature_tensors"]

# Vertices at a time, so that memory does not grow with the mesh.
_BLOCK = 32_768


@once_per_surface
def curvature_tensors(surface: Surface) -> FloatArray:
    """Return the second fundamental form at each vertex, a tensor in space: d . II . d is the curvature along a unit tangent d.

    Positive where the surface bulges to the outside. Around each vertex, normal and curvature are fitted to two rings of
    neighbours: a point at d from the vertex lies 1/2 |d|^2 k(direction) below the tangent plane. This is exact for any chord
    of a circle, so spheres and cylinders come out exact, at the border too. A vertex with fewer than five
    neighbours within two rings counts as flat.

    Args:
        surface: of any faces; its border is fitted from one side.

    Returns:
        #V by 3 by 3 [1/m], symmetric.
    """
    from scipy.sparse import coo_matrix

    count, normal = len(surface.vertices), vertex_normals(surface)
    normal[~normal.any(axis=1)] = (0.0, 0.0, 1.0)
    faces = surface.faces
    used = faces >= 0
    face = np.broadcast_to(np.arange(len(faces))[:, None], faces.shape)[used]
    incidence = coo_matrix((np.ones(len(face), dtype=np.int32), (face, faces[used])), shape=(len(faces), count)).tocsr()
    # #V by #V, 1 where two vertices share a face.
    ring = (incidence.T @ incidence).astype(bool).astype(np.int32).tocsr()
    tensors = np.zeros((count, 3, 3))
    for first in range(0, count, _BLOCK):
        pairs = ring[first : first + _BLOCK] @ ring
        given = [surface.vertices, pairs.indptr.astype(np.int32), pairs.indices.astype(np.int32), normal, first]
        launch_each(fit_curvature, pairs.shape[0], given, [tensors])
    tensors.flags.writeable = False
    return tensors
