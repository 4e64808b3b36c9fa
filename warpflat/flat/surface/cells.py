"""The cells of a surface: its triangles and the four corner triangles of its quads, each laid flat."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.launch import launch_each
from warpflat.flat.surface.connectivity import border_of
from warpflat.flat.surface.mesh import Surface, once_per_surface, read_only, store_results
from warpflat.flat.surface.triangles import corner_triangles
from warpflat.flat.surface.unfold import VertexLists, corners_of, lay_cells, quad_creases
from warpflat.kernels.cells import find_least_shares
from warpflat.kernels.unfold import add_areas

__all__ = ["LEAST_AREA", "CellArrays", "face_creases", "first_of_faces", "inherit_cells", "make_cells"]

#: A cell of less than this share of its area on the body counts as mirrored: it would slow the whole relaxation down.
LEAST_AREA = 0.01


@dataclass(frozen=True, kw_only=True)
class CellArrays:
    """The cells, face by face (see `kernels.cells`): the cloth in the plane is compared with them.

    Attributes:
        faces: #F by 4, -1 in the last column of a triangle.
        first: #F, the first of each face's cells.
        laid: #C by 3, the cells laid flat [m].
        around: the faces' corners around each vertex, 4 times the face plus the corner.
    """

    faces: IntArray
    first: IntArray
    laid: FloatArray
    around: VertexLists

    # The arrays below are seldom used and not kept: they take as much memory as those a relaxation needs.

    @property
    def of_face(self) -> IntArray:
        """#F+1, where the cells of each face begin."""
        return np.append(self.first, np.int32(len(self.laid)))

    @property
    def _corners(self) -> tuple[IntArray, IntArray, FloatArray]:
        return corner_triangles(self.faces)

    @property
    def corner(self) -> IntArray:
        """#C by 3, the cells' vertices."""
        return self._corners[0]

    @property
    def face(self) -> IntArray:
        """#C, the face of each cell."""
        return self._corners[1]

    @property
    def weight(self) -> FloatArray:
        """#C, 1 for a triangle, 1/2 for each of a quad's four corner triangles."""
        return self._corners[2]

    @property
    def edges(self) -> FloatArray:
        """#C by 2 by 2, the edges of the laid cells from corner 0 to corners 1 and 2, as columns [m]."""
        edges = np.zeros((len(self.laid), 2, 2))
        edges[:, 0, 0], edges[:, 0, 1], edges[:, 1, 1] = self.laid.T
        return edges

    @property
    def area(self) -> FloatArray:
        """#C, weighted areas on the body [m2]."""
        return np.asarray(0.5 * self.weight * self.laid[:, 0] * self.laid[:, 2])

    @property
    def vertex_areas(self) -> FloatArray:
        """#V, the area of each vertex [m2]: a third of the weighted area of each cell at it."""
        around, total = self.around, np.empty(len(self.around.offset) - 1)
        given = [self.faces, self.first, self.laid, around.offset, around.entry]
        launch_each(add_areas, len(total), given, [total])
        return total

    def least_shares(self, positions: FloatArray) -> FloatArray:
        """Return #F, the signed area in a layout (#V by 2 [m]) over that on the body, the least of each face's cells."""
        share = np.empty(len(self.faces))
        given = [np.ascontiguousarray(positions, dtype=np.float64), self.faces, self.first, self.laid]
        launch_each(find_least_shares, len(share), given, [share])
        return share


@once_per_surface
def face_creases(surface: Surface) -> NDArray[np.int8]:
    """Return #F, the diagonal along which each quad is creased (see `quad_creases`), computed once per surface."""
    if not surface.is_quad.any():
        return quad_creases(surface.vertices, surface.faces)
    around = corners_of(surface)
    return quad_creases(
        surface.vertices, surface.faces, border=border_of(surface), around=(around.offset, around.entry)
    )


@once_per_surface
def make_cells(surface: Surface) -> CellArrays:
    """Return the cells of a surface, computed once. The four cells of a creased quad come from the quad that it unfolds into."""
    faces, first = surface.faces, first_of_faces(surface, 4, 1)
    laid = lay_cells(surface.vertices, faces, face_creases(surface), first)
    return read_only(CellArrays(faces=faces, first=first, laid=laid, around=corners_of(surface)))


def inherit_cells(surface: Surface, whole: Surface) -> None:
    """Store the creases and cells of a surface for the one that a cut has made of it: the cut moves no face and keeps their order."""
    cells = replace(make_cells(whole), faces=surface.faces, around=corners_of(surface))
    store_results(surface, {face_creases: face_creases(whole), make_cells: read_only(cells)})


def first_of_faces(surface: Surface, of_quad: int, of_triangle: int) -> IntArray:
    """Return #F, the number of each face's first item, where a quad has `of_quad` items and a triangle `of_triangle`."""
    is_quad = surface.is_quad
    if is_quad.all():
        return np.arange(0, of_quad * len(is_quad), of_quad, dtype=np.int32)
    counts = np.where(is_quad, np.int32(of_quad), np.int32(of_triangle))
    return np.cumsum(counts, dtype=np.int32) - counts
