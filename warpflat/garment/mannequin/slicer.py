"""Plane sections of a triangle mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray, unit
from warpflat.flat import half_edges

__all__ = ["HOLED", "UP", "Slice", "Slicer", "largest", "plane_axes"]

#: A section runs over a hole if more than this share of it lies on what the scan does not show.
HOLED = 0.1
#: Across level planes.
UP = np.array([0.0, 1.0, 0.0])


def largest(parts: Sequence[Slice]) -> Slice:
    """Return the part of a level section with the largest box around it: the trunk's, the head's or both legs'."""
    return max(parts, key=lambda part: float(np.ptp(part.points[:, [0, 2]], axis=0).prod()))


def plane_axes(normal: FloatArray) -> FloatArray:
    """Return two unit vectors at right angles to a unit vector and to each other, 2 by 3."""
    first = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = unit(first - normal * (first @ normal))
    return np.array([first, np.cross(normal, first)])


@dataclass(frozen=True, kw_only=True, eq=False)
class Slice:
    """One connected part of a plane section.

    Attributes:
        points: #P by 3, where the plane meets mesh edges [m], in no order.
        length: summed length of the section's segments [m].
        closed: false where a hole in the mesh leaves a gap.
        patched: length of the segments on patches that close holes [m].
    """

    points: FloatArray
    length: float
    closed: bool = True
    patched: float = 0.0

    @property
    def is_holed(self) -> bool:
        """Return whether a hole leaves a gap, or more than a tenth of the section runs over patches."""
        return not self.closed or self.patched > HOLED * self.length


class Slicer:
    """Plane sections of a triangle mesh, connected parts apart; holes in the mesh only leave gaps."""

    def __init__(
        self, vertices: FloatArray, triangles: NDArray[np.int64], noise: float = 0.0, scanned: int | None = None
    ) -> None:
        #: How the mesh came here from its file: a matrix, 3 by 3, that multiplies points from the right, and a shift [m].
        self.placed: tuple[FloatArray, FloatArray] = np.eye(3), np.zeros(3)
        #: Whether it is a body that sits.
        self.sits = False
        #: How far noise moved the vertices before it was smoothed [m].
        self.noise = noise
        #: Triangles from this one on close holes.
        self.scanned = len(triangles) if scanned is None else scanned
        he = half_edges(triangles)
        self.edges, self.face_edges = he.edges, he.edge.reshape(-1, 3)
        self.vertices = vertices
        self.triangles = triangles
        self._corners = np.ascontiguousarray(triangles.T)
        self._place = np.zeros(len(self.edges), dtype=np.int64)
        self._along: tuple[bytes, FloatArray, FloatArray, FloatArray] | None = None

    def cut(self, normal: FloatArray, offset: float) -> list[Slice]:
        """Return the connected parts of the section where normal . x = offset, longest first."""
        # Bodies are sliced many times across one direction.
        if self._along is None or self._along[0] != normal.tobytes():
            along = self.vertices @ normal
            corners = along[self._corners]
            self._along = normal.tobytes(), along, corners.min(axis=0), corners.max(axis=0)
        _, along, low, high = self._along
        faces = np.flatnonzero((low <= offset) & (high > offset))
        if not len(faces):
            return []
        first, second, third = (along[corners[faces], None] > offset for corners in self._corners)
        # Two of a cut triangle's edges cross the plane: which two, by the one that does not.
        edges = self.face_edges[faces]
        pairs = np.where(
            first == second, edges[:, [1, 2]], np.where(second == third, edges[:, [0, 2]], edges[:, [0, 1]])
        )
        # A table of all edges numbers the few that are cut sooner than sorting them does.
        is_cut = np.zeros(len(self.edges), dtype=bool)
        is_cut[pairs] = True
        used = np.flatnonzero(is_cut)
        self._place[used] = np.arange(len(used))
        local = self._place[pairs]
        a, b = self.edges[used].T
        t = ((along[a] - offset) / (along[a] - along[b]))[:, None]
        points = (1 - t) * self.vertices[a] + t * self.vertices[b]
        # The part of each point, by its root: quicker than a sparse graph for a section's few points.
        root, count = list(range(len(used))), 0
        for i, k in local.tolist():
            while root[i] != i:
                root[i] = i = root[root[i]]
            while root[k] != k:
                root[k] = k = root[root[k]]
            if i < k:
                root[k] = i
            else:
                root[i] = k
        for i, above in enumerate(root):
            # A root stands before all that it leads.
            root[i], count = (count, count + 1) if above == i else (root[above], count)
        label = np.asarray(root)
        segments = np.linalg.norm(points[local[:, 0]] - points[local[:, 1]], axis=1)
        length = np.bincount(label[local[:, 0]], segments)
        patched = np.bincount(label[local[:, 0]], segments * (faces >= self.scanned))
        loose = np.bincount(label, np.bincount(local.ravel(), minlength=len(used)) == 1)
        parts = [
            Slice(points=points[label == i], length=float(length[i]), closed=not loose[i], patched=float(patched[i]))
            for i in np.argsort(-length)
        ]
        return [p for p in parts if len(p.points) > 3]

    def points(self, normal: FloatArray, offset: float) -> FloatArray:
        """Return the points of all parts of a section, #P by 3 [m]."""
        return np.concatenate([np.empty((0, 3)), *(part.points for part in self.cut(normal, offset))])
