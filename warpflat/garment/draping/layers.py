"""Layers of one cloth: each vertex stays on its side of the cloth that lies beside it.

Another layer is one plane before and one behind each vertex, as the body is, but it goes with the triangle it belongs to, so that both
layers feel the force. A vertex takes its side when cloth comes near, at the latest a few edges off, and keeps it while it passes along
that cloth. Only what lies deep on the other side, as where the sewing left cloth pierced, changes sides.
"""

from __future__ import annotations

import numpy as np
import warp as wp
from scipy.sparse import coo_array, csr_array

from warpflat.core import FloatArray, launch_each, unit
from warpflat.flat import area_vectors, triangulate, vertex_normals
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.sewn_cloth import SewnCloth
from warpflat.kernels.drape_layers import find_layers

__all__ = ["APART", "Layers"]

#: Layers are kept so far apart, and deeper than this a vertex has changed sides [m].
APART = 0.002
# Stiffness between layers per area [N/m3]: a layer's weight presses by .2 mm. Ten times as stiff, hoods do not come to rest.
_SKIN = 1e4
# Another layer is looked for so far [m], and looked for again when a vertex has gone by this share of an edge. Where it is looked for
# more often, the layers in a fold of few edges take turns, and the cloth moves to and fro between them.
_REACH, _HOLDS = 0.03, 0.5
# Places of pieces lie so far apart where they are compared [m].
_BETWEEN_PIECES = 100.0


class Layers:
    """What lies before and behind each vertex of a cloth.

    Attributes:
        corner: 2 #V by 3, the corners of the triangles there, or the vertex itself.
        beside: on the device `corner`; 2 #V by 3, the weights of the corners at the vertex's foot; 2 #V by 3, the triangles' unit
            normals to the vertex's side, zero where no layer is near; #V, the stiffness between layers [N/m].
    """

    def __init__(self, cloth: SewnCloth, device: wp.Device) -> None:
        """Build the search tree of a cloth; no layer is near before `renew`."""
        self._surface, count = Body(cloth.designed, cloth.faces, device=device), len(cloth.designed)
        self._holds = _HOLDS * cloth.mean_edge
        near = cloth.laplacian()[0]
        self._near = [wp.array(each, dtype=wp.int32, device=device) for each in (near.indptr, near.indices)]
        piece = np.zeros(len(cloth.faces))
        for number, rows in enumerate(cloth.piece_faces.values()):
            piece[rows] = _BETWEEN_PIECES * number
        triangles, face = triangulate(cloth.flat_faces)
        self._flat = np.column_stack([cloth.flat[triangles].mean(axis=1), piece[face]])
        self._vertex = np.repeat(np.arange(count), 2)
        self.corner = np.repeat(self._vertex, 3).reshape(-1, 3)
        self._share, self._normal, self._skin = (
            np.zeros((2 * count, 3)),
            np.zeros((2 * count, 3)),
            _SKIN * cloth.vertex_areas(),
        )
        kinds = {wp.vec3i: self.corner, wp.vec3d: self._share}
        self.beside = [wp.array(rows, dtype=kind, device=device) for kind, rows in kinds.items()]
        self.beside += [wp.zeros(2 * count, wp.vec3d, device), wp.array(self._skin, dtype=wp.float64, device=device)]
        self._found, self._side, self._at = np.full(2 * count, -1), np.zeros(2 * count), np.full((count, 3), np.inf)

    def renew(self, positions: FloatArray) -> bool:
        """Look for the layers beside #V by 3 places [m], and return whether they were looked for: not where all is about as before."""
        count = len(positions)
        if np.abs(positions - self._at).max() < self._holds:
            return False
        surface, device = self._surface, self._surface.device
        surface.move(positions)
        outwards = vertex_normals(positions, surface.triangles)
        given = [wp.array(rows, dtype=wp.vec3d, device=device) for rows in (positions, outwards)]
        found, share = wp.zeros(2 * count, wp.int32, device), wp.zeros(2 * count, wp.vec3d, device)
        inputs = [wp.uint64(surface.mesh.id), *self._near, *given, _REACH]
        launch_each(find_layers, count, inputs, [found, share], device=device, least=64)
        face, self._share = found.numpy().copy(), share.numpy().copy()
        self.corner = np.where(face[:, None] < 0, self._vertex[:, None], surface.triangles[face])
        normal = unit(area_vectors(positions, surface.triangles))[face]
        height = np.einsum("ki,ki->k", self._off(positions), normal)
        side = np.where(height < 0.0, -1.0, 1.0)
        # What lay before a vertex may now lie behind it.
        for swapped in (1, 0):
            slot = np.arange(2 * count) ^ swapped
            old, kept = self._found[slot], self._side[slot]
            same = (kept != 0.0) & (np.linalg.norm(self._flat[old] - self._flat[face], axis=1) < _REACH)
            side = np.where(same & (kept * height > -APART), kept, side)
        side[face < 0] = 0.0
        self._normal, self._found, self._side, self._at = side[:, None] * normal, face, side, positions.copy()
        for array, rows in zip(self.beside, (self.corner, self._share, self._normal), strict=False):
            array.assign(rows)
        return True

    def _off(self, positions: FloatArray) -> FloatArray:
        """Return 2 #V by 3, the way of each vertex from its foot on the other layer [m]."""
        return np.asarray(positions[self._vertex] - np.einsum("kc,kci->ki", self._share, positions[self.corner]))

    def stiffness(self, positions: FloatArray) -> csr_array:
        """Return the stiffness between layers that touch at #V by 3 places [m], 3 #V by 3 #V [N/m]."""
        height = np.einsum("ki,ki->k", self._off(positions), self._normal)
        at = np.flatnonzero((height < APART) & (self._side != 0.0))
        vertex = np.column_stack([self._vertex[at], self.corner[at]])
        values = np.column_stack([np.ones(len(at)), -self._share[at]])[:, :, None] * self._normal[at, None]
        columns = 3 * vertex[:, :, None] + np.arange(3)
        places = (np.repeat(np.arange(len(at)), 12), columns.ravel())
        gap = coo_array((values.ravel(), places), shape=(len(at), positions.size)).tocsr()
        return csr_array(gap.T @ gap.multiply(self._skin[self._vertex[at], None]))
