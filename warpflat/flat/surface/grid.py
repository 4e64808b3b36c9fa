"""Rectangular grids of quads: their rows and columns, however vertices and faces are numbered."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import IntArray
from warpflat.flat.surface.half_edges import half_edges_of, opposite_half_edges
from warpflat.flat.surface.mesh import Surface, once_per_faces

__all__ = ["grid_quads", "rows_and_columns"]


def grid_quads(grid: IntArray) -> IntArray:
    """Return the quads between the vertices of a grid (#rows by #columns), row by row, each around from its lower left corner."""
    return np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)


@once_per_faces
def rows_and_columns(surface: Surface) -> IntArray | None:
    """Return the vertices of a rectangular grid of quads, #rows by #columns; None for any other mesh.

    It is computed once per array of faces. Columns count up along the first side of the first face, rows along its second side.
    """
    # A form is built of quads while a process beside it loads Warp.
    import warp as wp

    from warpflat.core.compile import launch_quietly
    from warpflat.kernels.grid_lists import number_faces

    faces = surface.faces
    if not surface.is_quad.all():
        return None
    twin = opposite_half_edges(half_edges_of(surface)).astype(np.int32)
    place, queue = (wp.empty(len(faces), dtype=of, device="cpu") for of in (wp.vec3i, wp.int32))
    given = wp.array(twin, dtype=wp.int32, device="cpu", copy=False)
    launch_quietly(number_faces, dim=1, inputs=[given], outputs=[place, queue], device="cpu")
    row, column, turn = place.numpy().T
    row, column = row - row.min(), column - column.min()
    rows, columns = int(row.max()) + 2, int(column.max()) + 2
    if turn.min() < 0 or rows * columns != len(surface.vertices) or (rows - 1) * (columns - 1) != len(faces):
        return None
    corner = faces[np.arange(len(faces))[:, None], (np.arange(4) - turn[:, None]) % 4]
    grid, at = np.full((rows, columns), -1, dtype=np.int32), ((0, 0), (0, 1), (1, 1), (1, 0))
    for k, (up, right) in enumerate(at):
        grid[row + up, column + right] = corner[:, k]
    agree = all((grid[row + up, column + right] == corner[:, k]).all() for k, (up, right) in enumerate(at))
    return grid if agree and grid.min() >= 0 else None
