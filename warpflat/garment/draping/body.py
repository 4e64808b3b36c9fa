"""The body under the cloth: a triangle mesh that is asked for its nearest places."""

from __future__ import annotations

import numpy as np
import warp as wp

from warpflat.core import FloatArray, IntArray, launch_each
from warpflat.flat import triangulate, vertex_normals
from warpflat.kernels.drape_contact import find_planes

__all__ = ["Body"]

_FAR = 1e3  # [m]
# It is drawn this much smaller [m], so that cloth that lies on it is seen.
_SHRUNK = 0.003


class Body:
    """A surface that cloth lies on, with its search tree on a device.

    Attributes:
        vertices: #V by 3 [m].
        triangles: #T by 3.
        shrunk: #V by 3 [m], as it is drawn: a little smaller, so that cloth on it is seen.
        mesh: Warp's mesh.
        normals: #V, unit normals on the device.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray, *, device: wp.Device) -> None:
        """Build the search tree of a surface (#V by 3 [m], #F by 4 or 3), wound counter-clockwise from outside."""
        self.vertices, self.device = vertices, device
        self.triangles, _ = triangulate(faces)
        normals = vertex_normals(vertices, self.triangles)
        self.shrunk = vertices - _SHRUNK * normals
        self.normals = wp.array(normals.astype(np.float32), dtype=wp.vec3, device=device)
        self.mesh = wp.Mesh(
            points=wp.array(vertices.astype(np.float32), dtype=wp.vec3, device=device),
            indices=wp.array(self.triangles.ravel(), dtype=wp.int32, device=device),
        )

    def move(self, vertices: FloatArray) -> None:
        """Move the surface that is searched to #V by 3 places [m]; `vertices` and normals stay what they were.

        A body that is drawn in far folds in places, where its own normals would look inwards.
        """
        self.mesh.points.assign(vertices.astype(np.float32))
        self.mesh.refit()

    def nearest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the nearest place of the surface (#P by 3 [m]) and its interpolated unit normal there, for #P by 3 points [m]."""
        given = wp.array(points, dtype=wp.vec3d, device=self.device)
        centre, normal = (wp.zeros(len(points), dtype=wp.vec3d, device=self.device) for _ in range(2))
        inputs = [wp.uint64(self.mesh.id), self.normals, given, _FAR, 0.0]
        ball = wp.zeros(len(points), dtype=wp.float64, device=self.device)
        launch_each(find_planes, len(points), inputs, [centre, normal, ball], device=self.device, least=256)
        return centre.numpy().copy(), normal.numpy().copy()

    def gaps(self, points: FloatArray) -> FloatArray:
        """Return #P, the distance of points (#P by 3) from the surface, negative inside [m]."""
        centre, normal = self.nearest(points)
        away = points - centre
        distance = np.linalg.norm(away, axis=1)
        return np.where(np.einsum("ij,ij->i", away, normal) < 0.0, -distance, distance)
