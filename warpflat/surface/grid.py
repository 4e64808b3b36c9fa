"""Quad meshes on a lattice of rows and columns: rectangles, and pieces with concave corners, holes and cracks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from warpflat.core.arrays import BoolArray, IntArray
from warpflat.core.compile import launch_quietly
from warpflat.kernels.grid_lists import number_faces
from warpflat.surface.connectivity import border_of
from warpflat.surface.half_edges import half_edges_of, opposite_half_edges
from warpflat.surface.mesh import Surface, once_per_faces, read_only

__all__ = ["Lattice", "cut_lattice", "find_lattice", "rows_and_columns"]


# Lattice places, per face, up to which the faces at each place are counted in an array.
_DENSE = 8


@dataclass(frozen=True, kw_only=True)
class Lattice:
    """The rows and columns of a quad mesh whose inner vertices all have four faces.

    Attributes:
        row, column: #V, from 0; both sides of a crack have the same.
        corner: #F by 4, vertices: below left, below right, above right, above left.
        bends: #V, true where the border turns: at corners and at the tips of cracks.
    """

    row: IntArray
    column: IntArray
    corner: IntArray
    bends: BoolArray

    @property
    def face_row(self) -> IntArray:
        """#F, the row of each face's corner below and to the left."""
        return self.row[self.corner[:, 0]]

    @property
    def face_column(self) -> IntArray:
        """#F, the column of each face's corner below and to the left."""
        return self.column[self.corner[:, 0]]


@once_per_faces
def find_lattice(surface: Surface) -> Lattice | None:
    """Return the rows and columns of a mesh, computed once per array of faces.

    Columns count up along the first side of the first face, rows along its second side.

    Returns:
        None for a mesh that has none: one with triangles or inner vertices of three or five faces, a tube, or a piece that
        overlaps itself on the lattice.
    """
    faces, count = surface.faces, len(surface.vertices)
    if not surface.is_quad.all():
        return None
    he = half_edges_of(surface)
    twin = opposite_half_edges(he).astype(np.int32)
    place, queue = (
        wp.empty(len(faces), dtype=wp.vec3i, device="cpu"),
        wp.empty(len(faces), dtype=wp.int32, device="cpu"),
    )
    given = wp.array(twin, dtype=wp.int32, device="cpu", copy=False)
    launch_quietly(number_faces, dim=1, inputs=[given], outputs=[place, queue], device="cpu")
    face_row, face_column, turn = (np.ascontiguousarray(values) for values in place.numpy().T)
    if turn.min() < 0:
        return None
    face_row -= face_row.min()
    face_column -= face_column.min()
    at = face_row * np.int64(face_column.max() + 1) + face_column
    often = np.bincount(at) if at.max() < _DENSE * len(at) else np.unique(at, return_counts=True)[1]
    if often.max() > 1:
        return None
    corner = faces[np.arange(len(faces))[:, None], (np.arange(4) - turn[:, None]) % 4] if turn.any() else faces
    row, column = (np.empty(count, dtype=np.int32) for _ in range(2))
    for k, (up, right) in enumerate(((0, 0), (0, 1), (1, 1), (1, 0))):
        row[corner[:, k]], column[corner[:, k]] = face_row + up, face_column + right
    for k, (up, right) in enumerate(((0, 0), (0, 1), (1, 1), (1, 0))):
        if (row[corner[:, k]] != face_row + up).any() or (column[corner[:, k]] != face_column + right).any():
            return None
    return read_only(Lattice(row=row, column=column, corner=corner, bends=_bends(surface)))


def cut_lattice(surface: Surface, whole: Surface, origin: IntArray) -> Lattice | None:
    """Return the lattice of a surface that a cut has made of another and left in one piece.

    It follows from the lattice before the cut, as no vertex or face has moved.

    Args:
        surface: with the faces of `whole`, in their order.
        whole: uncut.
        origin: #V, the vertex of `whole` at the place of each.
    """
    lattice = find_lattice(whole)
    if lattice is None:
        return None
    corner = surface.faces
    # In a row-major grid they are in this order already.
    if lattice.corner is not whole.faces:
        slot = np.argmax(whole.faces == lattice.corner[:, :1], axis=1)
        corner = np.take_along_axis(corner, (slot[:, None] + np.arange(4)) % 4, axis=1)
    row, column = lattice.row[origin], lattice.column[origin]
    return read_only(replace(lattice, row=row, column=column, corner=corner, bends=_bends(surface)))


def _bends(surface: Surface) -> BoolArray:
    """Return #V, true where the border turns."""
    count = len(surface.vertices)
    on_border = np.zeros(count, dtype=bool)
    on_border[border_of(surface)] = True
    return on_border & (np.bincount(surface.faces.ravel(), minlength=count) != 2)


@once_per_faces
def rows_and_columns(surface: Surface) -> IntArray | None:
    """Return the vertices of a rectangular grid of quads, #rows by #columns; None for any other mesh."""
    lattice = find_lattice(surface)
    if lattice is None:
        return None
    shape = int(lattice.row.max()) + 1, int(lattice.column.max()) + 1
    count = len(surface.vertices)
    if shape[0] * shape[1] != count or (shape[0] - 1) * (shape[1] - 1) != len(surface.faces):
        return None
    grid = np.full(shape, -1, dtype=np.int32)
    grid[lattice.row, lattice.column] = np.arange(count, dtype=np.int32)
    return grid if grid.min() >= 0 else None
