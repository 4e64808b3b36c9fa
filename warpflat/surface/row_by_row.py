"""Rectangular grids of quads that are numbered row by row: their sides and lists follow from the numbers, without sorting.

Most grids come so. What is worked out here is, entry by entry, what `topology` and `springs` sort out of the faces of any mesh.
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

__all__ = ["RowByRow", "row_by_row"]


@dataclass(frozen=True, kw_only=True)
class RowByRow:
    """A grid whose vertex in row i and column j is number i C + j, and whose face above and to the right of that i (C - 1) + j.

    Attributes:
        rows, columns: of vertices; at least two of each.
        place: of each face's four corners which one it is: 0 below left, 1 below right, 2 above left, 3 above right.
    """

    rows: int
    columns: int
    place: tuple[int, int, int, int]

    @cached_property
    def vertices(self) -> IntArray:
        """#rows by #columns, their numbers."""
        return np.arange(self.rows * self.columns, dtype=np.int32).reshape(self.rows, self.columns)

    def edges(self) -> tuple[IntArray, IntArray, IntArray]:
        """#H, the edge of every side of every face; #E by 2, the edges, lower vertex first, sorted; #E, how many faces each has."""
        of_row, vertex = 2 * self.columns - 1, self.vertices
        i, j = (np.arange(count, dtype=np.int32) for count in vertex.shape)
        # From each vertex to the next of its row, and to the one above; the last row has none of these.
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
        """The faces' corners around each vertex, as `unfold.corners_around` has them."""
        slot_of = wp.vec4i(*(self.place.index(corner) for corner in range(4)))
        offset, corner = self._lists(2, 0)
        launch_each(list_corners, self.rows * self.columns, [self.rows, self.columns, slot_of], [offset, corner])
        return offset, corner

    def neighbors_around(self) -> tuple[IntArray, IntArray]:
        """#V+1, where each vertex's springs begin, edges and both diagonals of each face; and the vertices at their far ends, by which they
        are sorted."""
        offset, neighbor = self._lists(3, 1)
        launch_each(list_neighbors, self.rows * self.columns, [self.rows, self.columns], [offset, neighbor])
        return offset, neighbor

    def _lists(self, most: int, less: int) -> tuple[IntArray, IntArray]:
        """Room for where each vertex's entries begin, and for these: so many squared, fewer on the border, and so many less."""
        count = self.rows * self.columns
        entries = (most * self.rows - 2) * (most * self.columns - 2) - less * count
        offset = np.empty(count + 1, dtype=np.int32)
        offset[-1] = entries
        return offset, np.empty(entries, dtype=np.int32)

    def springs_around(self, offset: IntArray) -> IntArray:
        """Those springs' numbers: edges first, then the faces' diagonals 0-2, then 1-3. offset: #V+1, where each vertex's begin."""
        return self.listed(offset, np.arange(offset[-1] // 2)).astype(np.int32)

    def listed(self, offset: IntArray, values: FloatArray) -> FloatArray:
        """The springs' values (#S) in the order of these numbers."""
        listed = np.empty(offset[-1])
        given = [self.rows, self.columns, self._rising, offset, np.ascontiguousarray(values, dtype=np.float64)]
        launch_each(list_values, self.rows * self.columns, given, [listed])
        return listed

    def listed_lengths(self, offset: IntArray, vertices: FloatArray, diagonal: FloatArray) -> FloatArray:
        """The springs' lengths [m] in the same order: on the body (#V by 3 [m]), and of the diagonals as given (#F by 2)."""
        listed = np.empty(offset[-1])
        given = [self.rows, self.columns, self._rising, offset, vertices, diagonal]
        launch_each(list_lengths, self.rows * self.columns, given, [listed])
        return listed

    def listed_stiffness(self, offset: IntArray, side: FloatArray, diagonal: FloatArray) -> FloatArray:
        """Their stiffnesses [N/m]: of what faces give to their sides (4 #F) the sum, of what they give to both diagonals (#F) that."""
        listed, of_side = np.empty(offset[-1]), [set(self._side(k)) for k in range(4)]
        sides = wp.vec4i(*(of_side.index(corners) for corners in ({0, 1}, {0, 2}, {1, 3}, {2, 3})))
        given = [self.rows, self.columns, self._rising, sides, offset, side.reshape(-1, 4), diagonal]
        launch_each(list_stiffness, self.rows * self.columns, given, [listed])
        return listed

    @property
    def edge_count(self) -> int:
        """#E."""
        return self.rows * (self.columns - 1) + (self.rows - 1) * self.columns

    def are_joined(self, a: IntArray, b: IntArray) -> BoolArray:
        """#N, whether there are edges from `a` to `b` (#N each)."""
        (i, j), (k, m) = (np.divmod(vertex, self.columns) for vertex in (a, b))
        return np.abs(i - k) + np.abs(j - m) == 1

    @cached_property
    def border(self) -> IntArray:
        """The vertices on the border, in the order of their numbers."""
        inner = np.zeros((self.rows, self.columns), dtype=bool)
        inner[1:-1, 1:-1] = True
        return self.vertices[~inner]

    @property
    def _rising(self) -> int:
        """Which of a face's two diagonals runs from below left to above right."""
        return self.place.index(0) % 2


@once_per_faces
def row_by_row(surface: Surface) -> RowByRow | None:
    """How a surface's grid is numbered; None of any other mesh, and of grids that are numbered otherwise."""
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
    return RowByRow(rows=count // columns, columns=columns, place=(a, b, c, d))
