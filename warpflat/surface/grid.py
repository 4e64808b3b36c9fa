"""Quads in rows and columns: rectangles, and any other piece that lies on a lattice, with concave corners, holes and cracks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpflat.kernels.lattice import number_faces
from warpflat.surface.mesh import Surface, once_per_faces, read_only
from warpflat.surface.row_by_row import row_by_row
from warpflat.surface.topology import half_edges_of, twins_of

__all__ = ["Lattice", "lattice_of", "rows_and_columns"]

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int32]

# A rectangle around a piece may have so many times its places to be counted one by one.
_DENSE = 8


@dataclass(frozen=True, kw_only=True)
class Lattice:
    """A quad mesh of which every inner vertex has four faces, on a lattice.

    Attributes:
        row, column: #V, from 0; the two sides of a crack lie at the same.
        face_row, face_column: #F, of the corner below and to the left.
        corner: #F by 4, vertices: below left, below right, above right, above left.
        bends: #V, where the border turns: at corners and at the tips of cracks.
    """

    row: IntArray
    column: IntArray
    face_row: IntArray
    face_column: IntArray
    corner: IntArray
    bends: BoolArray


@once_per_faces
def lattice_of(surface: Surface) -> Lattice | None:
    """Rows and columns of a mesh, None where it has none: triangles, inner vertices of three or five faces, tubes, or a piece that
    overlaps itself on the lattice."""
    faces, count = surface.faces, len(surface.vertices)
    if not surface.is_quad.all():
        return None
    he = half_edges_of(surface)
    twin = twins_of(he).astype(np.int32)
    place, queue = (
        wp.empty(len(faces), dtype=wp.vec3i, device="cpu"),
        wp.empty(len(faces), dtype=wp.int32, device="cpu"),
    )
    given = wp.array(twin, dtype=wp.int32, device="cpu", copy=False)
    wp.launch(number_faces, dim=1, inputs=[given], outputs=[place, queue], device="cpu")
    face_row, face_column, turn = (np.ascontiguousarray(values) for values in place.numpy().T)
    if turn.min() < 0:
        return None
    face_row -= face_row.min()
    face_column -= face_column.min()
    at = face_row * np.int64(face_column.max() + 1) + face_column
    often = np.bincount(at) if at.max() < _DENSE * len(at) else np.unique(at, return_counts=True)[1]
    if often.max() > 1:
        return None
    corner = faces[np.arange(len(faces))[:, None], (np.arange(4) - turn[:, None]) % 4]
    row, column = (np.empty(count, dtype=np.int32) for _ in range(2))
    for k, (up, right) in enumerate(((0, 0), (0, 1), (1, 1), (1, 0))):
        row[corner[:, k]], column[corner[:, k]] = face_row + up, face_column + right
    for k, (up, right) in enumerate(((0, 0), (0, 1), (1, 1), (1, 0))):
        if (row[corner[:, k]] != face_row + up).any() or (column[corner[:, k]] != face_column + right).any():
            return None
    around = np.bincount(faces.ravel(), minlength=count)
    on_border = np.zeros(count, dtype=bool)
    on_border[he.tail[twin < 0]] = True
    return read_only(
        Lattice(
            row=row,
            column=column,
            face_row=face_row,
            face_column=face_column,
            corner=corner,
            bends=on_border & (around != 2),
        )
    )


@once_per_faces
def rows_and_columns(surface: Surface) -> IntArray | None:
    """#rows by #columns vertices of a rectangular grid of quads, else None."""
    numbered = row_by_row(surface)
    if numbered is not None:
        return numbered.vertices
    lattice = lattice_of(surface)
    if lattice is None:
        return None
    shape = int(lattice.row.max()) + 1, int(lattice.column.max()) + 1
    count = len(surface.vertices)
    if shape[0] * shape[1] != count or (shape[0] - 1) * (shape[1] - 1) != len(surface.faces):
        return None
    grid = np.full(shape, -1, dtype=np.int32)
    grid[lattice.row, lattice.column] = np.arange(count, dtype=np.int32)
    return grid if grid.min() >= 0 else None
