"""Row-major grids: rectangular grids of quads whose vertices and faces are numbered row by row.

Most grids are numbered so. Their edges and lists around vertices follow from the numbers without sorting; they are, entry by entry,
those that `half_edges`, `unfold` and `model.springs` make from the faces of any mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import warp as wp

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.launch import launch_each
from warpflat.kernels.grid_lists import (
    is_row_by_row,
    list_corners,
    list_lengths,
    list_neighbors,
    list_stiffness,
    list_values,
)
from warpflat.surface.mesh import Surface, once_per_faces

__all__ = ["RowMajorGrid", "row_major_grid"]


@dataclass(frozen=True, kw_only=True)
class RowMajorGrid:
    """A grid of C columns, whose vertex in row i and column j has the number i C + j, and the face above and to the right i (C - 1) + j.

    Attributes:
        rows, columns: their number, in vertices; at least two of each.
        place: the place of each of a face's four corners: 0 below left, 1 below right, 2 above left, 3 above right.
    """

    rows: int
    columns: int
    place: tuple[int, int, int, int]

    @cached_property
    def vertices(self) -> IntArray:
        """#rows by #columns, the numbers of the vertices."""
        return np.arange(self.rows * self.columns, dtype=np.int32).reshape(self.rows, self.columns)

    def edges(self) -> tuple[IntArray, IntArray, IntArray]:
        """Return the edges.

        Returns:
            #H, the edge of every side of every face; #E by 2, the edges, lower vertex first, sorted; #E, the number of faces at each.
        """
        of_row, vertex = 2 * self.columns - 1, self.vertices
        i, j = (np.arange(count, dtype=np.int32) for count in vertex.shape)
        # Edges from each vertex to the next of its row, and to the one above, which the last row does not have.
        across = of_row * i[:, None] + np.where(i < self.rows - 1, 2, 1).astype(np.int32)[:, None] * j[:-1]
        up = of_row * i[:-1, None] + np.minimum(2 * j + 1, of_row - 1)
        of_side = {(0, 1): across[:-1], (2, 3): across[1:], (0, 2): up[:, :-1], (1, 3): up[:, 1:]}
        edge = np.empty((self.rows - 1, self.columns - 1, 4), dtype=np.int32)
        for k in range(4):
            edge[:, :, k] = of_side[min(self._side(k)), max(self._side(k))]
        ends, count = np.empty((across.size + up.size, 2), dtype=np.int32), np.full(across.size + up.size, 2, np.int32)
        ends[across, 0], ends[across, 1] = vertex[:, :-1], vertex[:, 1:]
        ends[up, 0], ends[up, 1] = vertex[:-1], vertex[1:]
        count[across[[0, -1]]] = 1
        count[up[:, [0, -1]]] = 1
        return edge.ravel(), ends, count

    def _side(self, k: int) -> tuple[int, int]:
        return self.place[k], self.place[(k + 1) % 4]

    def corners_around(self) -> tuple[IntArray, IntArray]:
        """Return the faces' corners around each vertex (see `unfold.corners_around`)."""
        slot_of = wp.vec4i(*(self.place.index(corner) for corner in range(4)))
        offset, corner = self._lists(2, 0)
        launch_each(list_corners, self.rows * self.columns, [self.rows, self.columns, slot_of], [offset, corner])
        return offset, corner

    def neighbors_around(self) -> tuple[IntArray, IntArray]:
        """List the springs around each vertex: the edges and both diagonals of each face.

        Returns:
            #V+1, the place where each vertex's springs begin; and the vertices at their far ends, by which they are sorted.
        """
        offset, neighbor = self._lists(3, 1)
        launch_each(list_neighbors, self.rows * self.columns, [self.rows, self.columns], [offset, neighbor])
        return offset, neighbor

    def _lists(self, most: int, less: int) -> tuple[IntArray, IntArray]:
        """Make arrays for the place where each vertex's entries begin, and for the entries.

        An inner vertex has most^2 - less entries, a vertex of the border fewer.
        """
        count = self.rows * self.columns
        entries = (most * self.rows - 2) * (most * self.columns - 2) - less * count
        offset = np.empty(count + 1, dtype=np.int32)
        offset[-1] = entries
        return offset, np.empty(entries, dtype=np.int32)

    def springs_around(self, offset: IntArray) -> IntArray:
        """Return the numbers of the springs around each vertex: edges first, then the faces' diagonals 0-2, then 1-3.

        Args:
            offset: #V+1, the place where each vertex's springs begin.
        """
        return self.listed(offset, np.arange(offset[-1] // 2)).astype(np.int32)

    def listed(self, offset: IntArray, values: FloatArray) -> FloatArray:
        """Return values of the springs (#S) in the order of `springs_around`."""
        listed = np.empty(offset[-1])
        given = [self.rows, self.columns, self._rising, offset, np.ascontiguousarray(values, dtype=np.float64)]
        launch_each(list_values, self.rows * self.columns, given, [listed])
        return listed

    def listed_lengths(self, offset: IntArray, vertices: FloatArray, diagonal: FloatArray) -> FloatArray:
        """Return the springs' lengths [m] in the order of `springs_around`, with the diagonals as given (#F by 2)."""
        listed = np.empty(offset[-1])
        given = [self.rows, self.columns, self._rising, offset, vertices, diagonal]
        launch_each(list_lengths, self.rows * self.columns, given, [listed])
        return listed

    def listed_stiffness(self, offset: IntArray, side: FloatArray, diagonal: FloatArray) -> FloatArray:
        """Return the springs' stiffnesses [N/m] in the order of `springs_around`.

        Args:
            offset: #V+1, the place where each vertex's springs begin.
            side: 4 #F, the stiffness that each face adds to its sides.
            diagonal: #F, the stiffness of both diagonals of each face.
        """
        listed, of_side = np.empty(offset[-1]), [set(self._side(k)) for k in range(4)]
        sides = wp.vec4i(*(of_side.index(corners) for corners in ({0, 1}, {0, 2}, {1, 3}, {2, 3})))
        given = [self.rows, self.columns, self._rising, sides, offset, side.reshape(-1, 4), diagonal]
        launch_each(list_stiffness, self.rows * self.columns, given, [listed])
        return listed

    @property
    def edge_count(self) -> int:
        """#E, the number of edges."""
        return self.rows * (self.columns - 1) + (self.rows - 1) * self.columns

    def are_joined(self, a: IntArray, b: IntArray) -> BoolArray:
        """Return #N, true where an edge joins `a` and `b` (#N each)."""
        (i, j), (k, m) = (np.divmod(vertex, self.columns) for vertex in (a, b))
        return np.abs(i - k) + np.abs(j - m) == 1

    @cached_property
    def border(self) -> IntArray:
        """The vertices on the border, sorted."""
        inner = np.zeros((self.rows, self.columns), dtype=bool)
        inner[1:-1, 1:-1] = True
        return self.vertices[~inner]

    @property
    def _rising(self) -> int:
        """The diagonal that runs from below left to above right: 0 for corners 0-2, 1 for 1-3."""
        return self.place.index(0) % 2


@once_per_faces
def row_major_grid(surface: Surface) -> RowMajorGrid | None:
    """Return the row-major grid that a surface is; None for any other mesh and for grids numbered otherwise."""
    faces, count = surface.faces, len(surface.vertices)
    if len(faces) == 0 or faces[0, 3] < 0:
        return None
    corner = faces[0].tolist()
    columns = max(corner) - 1
    if columns < 2 or count % columns or len(faces) != (count // columns - 1) * (columns - 1):
        return None
    places = {0: 0, 1: 1, columns: 2, columns + 1: 3}
    a, b, c, d = (places.get(at, -1) for at in corner)
    if sorted((a, b, c, d)) != [0, 1, 2, 3] or a + c != 3:
        return None
    as_expected = np.empty(len(faces), dtype=bool)
    launch_each(is_row_by_row, len(faces), [faces, columns, wp.vec4i(*corner)], [as_expected])
    if not as_expected.all():
        return None
    return RowMajorGrid(rows=count // columns, columns=columns, place=(a, b, c, d))
