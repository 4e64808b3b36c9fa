"""Coarsening of quads on a lattice to fewer rows and columns, as far as it follows from their faces alone.

A rectangular grid keeps every second row and column (all rows where these lie much farther apart than its columns). Any
other lattice also keeps those in which its border turns, at corners and at the tips of cracks; then between two kept
rows and two kept columns there is cloth everywhere or nowhere. Surfaces that differ only in the places of their
vertices, such as the sizes of a pattern, share these results.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.solver.multigrid.cubic_interpolation import GridProlongation, LatticeProlongation, row_places
from warpflat.surface.grid import Lattice, find_lattice, rows_and_columns
from warpflat.surface.mesh import Surface, face_results, once_per_faces, once_per_surface, read_only
from warpflat.surface.unfold import corners_of

__all__ = [
    "CoarsenedGrid",
    "Transfer",
    "can_be_coarsened",
    "coarsened_grid",
]


# A grid of fewer rows or columns has no coarser one.
_LEAST_LINES = 5
# Quads left across a strip between two lines in which the border turns: a single one bends several times as stiffly as
# its cloth.
_LEAST_QUADS = 2
# Rows this many times as far apart as columns all stay, and likewise columns.
_MOST_ASPECT = 2.5
# A level of a lattice with more than this share of the finer one's vertices is not worth having.
_MOST_LEFT = 0.7


class Transfer:
    """The linear transfer between a level and a coarser one, made at its first use."""

    def __init__(self, make_prolongation: Callable[[], csr_array]) -> None:
        """Keep the function that makes the prolongation."""
        self._make_prolongation = make_prolongation

    @cached_property
    def prolongation(self) -> csr_array:
        """The weights of interpolation, #V by #C; rows add up to 1."""
        prolongation = self._make_prolongation()
        # The function holds what it makes the weights from.
        del self._make_prolongation
        return prolongation

    @cached_property
    def transpose(self) -> csr_array:
        """The transpose of the prolongation, #C by #V; its values are the numbers of the prolongation's entries."""
        weights = self.prolongation
        entry = np.arange(weights.nnz, dtype=np.int32)
        numbered = csr_array((entry, weights.indices, weights.indptr), shape=weights.shape)
        return csr_array(numbered.T.tocsr())


@dataclass(frozen=True, kw_only=True)
class CoarsenedGrid:
    """The next coarser level of a lattice.

    Attributes:
        kept: #C, the finer level's vertices that it keeps.
        faces: #G by 4, between these.
        face_of: #G, for each of them one of the finer level's faces in it.
        transfer: linear by index.
        make_interpolation: returns the cubic interpolation of layouts on a surface with the finer level's faces.
        of_faces: results that depend on the faces alone (`warpflat.surface.mesh.once_per_faces`), shared by all
            surfaces that have them.
    """

    kept: IntArray
    faces: IntArray
    face_of: IntArray
    transfer: Transfer
    make_interpolation: Callable[[Surface], GridProlongation | LatticeProlongation]
    of_faces: dict[str, Any]


def _faces_of(rows: int, columns: int) -> IntArray:
    """Return the faces of a grid whose vertices are numbered row by row, #F by 4."""
    number = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    return np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)


def can_be_coarsened(grid: IntArray) -> bool:
    """Return whether a grid (#rows by #columns vertices) has a coarser one."""
    return min(grid.shape) >= _LEAST_LINES


def coarsened_grid(surface: Surface) -> CoarsenedGrid | None:
    """Return the next coarser level of quads on a lattice; None without a lattice, or if too few vertices would go.

    A grid whose rows lie much farther apart than its columns keeps all rows, and likewise for columns: quads should
    become squarer, since steps smooth along their short sides only.
    """
    grid = rows_and_columns(surface)
    if grid is None:
        return _coarsened_lattice(surface)
    if not can_be_coarsened(grid):
        return None
    wide = _wider_lines(surface)
    if wide == "rows":
        return _coarsened_columns(surface)
    return _coarsened_rows(surface) if wide == "columns" else _coarsened_rows_and_columns(surface)


def _wider_lines(surface: Surface) -> Literal["rows", "columns", ""]:
    """Return which of a grid's lines lie much farther apart than the others, if any do."""
    rows, columns = (place[-1] / (len(place) - 1) for place in _line_places(surface))
    if rows > _MOST_ASPECT * columns:
        return "rows"
    return "columns" if columns > _MOST_ASPECT * rows else ""


@once_per_surface
def _line_places(surface: Surface) -> tuple[FloatArray, FloatArray]:
    """Return the distances of a grid's rows from the first one, and those of its columns [m]."""
    grid = rows_and_columns(surface)
    assert grid is not None
    return row_places(surface.vertices, grid), row_places(surface.vertices, grid.T)


@once_per_faces
def _coarsened_lattice(surface: Surface) -> CoarsenedGrid | None:
    lattice = find_lattice(surface)
    return None if lattice is None else _coarsen_lattice(lattice)


@once_per_faces
def _coarsened_rows_and_columns(surface: Surface) -> CoarsenedGrid:
    return _keep_lines(surface, rows=_second, columns=_second)


@once_per_faces
def _coarsened_columns(surface: Surface) -> CoarsenedGrid:
    return _keep_lines(surface, rows=_every, columns=_second)


@once_per_faces
def _coarsened_rows(surface: Surface) -> CoarsenedGrid:
    return _keep_lines(surface, rows=_second, columns=_every)


def _keep_lines(
    surface: Surface, *, rows: Callable[[int], IntArray], columns: Callable[[int], IntArray]
) -> CoarsenedGrid:
    """Return the coarser grid of the rows and columns that the functions keep of a given number of them."""
    grid = rows_and_columns(surface)
    assert grid is not None
    keep = rows(grid.shape[0]), columns(grid.shape[1])
    kept = grid[np.ix_(*keep)]
    faces = _faces_of(*kept.shape)
    return CoarsenedGrid(
        kept=kept.ravel(),
        faces=faces,
        face_of=_any_face(surface, kept[:-1, :-1].ravel()),
        transfer=Transfer(lambda: _bilinear(grid, keep)),
        make_interpolation=lambda surface: GridProlongation(grid, _line_places(surface), keep),
        of_faces=face_results(faces),
    )


def _bilinear(grid: IntArray, keep: tuple[IntArray, ...]) -> csr_array:
    """Return the weights of bilinear interpolation by index, #V by #C, between the rows and columns kept."""
    (row, row_share), (column, column_share) = (_linear_weights(*each) for each in zip(grid.shape, keep, strict=True))
    height, width = map(len, keep)
    parents, weights = np.empty((grid.size, 4), dtype=np.int32), np.empty((grid.size, 4))
    for k, (i, j) in enumerate(np.ndindex(2, 2)):
        parents[grid, k] = np.add.outer(row[:, i] * width, column[:, j])
        weights[grid, k] = np.multiply.outer(row_share[:, i], column_share[:, j])
    offset = np.arange(0, 4 * grid.size + 1, 4, dtype=np.int32)
    prolongation = csr_array((weights.ravel(), parents.ravel(), offset), shape=(grid.size, height * width))
    prolongation.eliminate_zeros()
    # A copy has no memory for the zeros.
    return prolongation.copy()


def _every(count: int) -> IntArray:
    return np.arange(count, dtype=np.int32)


def _second(count: int) -> IntArray:
    """Return every second of `count` lines, and the last.

    For an even number the last step is over three: a narrower row of quads would be stiffer along it than its cloth.
    """
    return np.append(np.arange(0, count - 3 + count % 2, 2), count - 1).astype(np.int32)


def _linear_weights(count: int, keep: IntArray) -> tuple[IntArray, FloatArray]:
    """Return each index's two neighbours in `keep` and their weights, linear by index; #count by 2 each."""
    index = np.arange(count, dtype=np.int32)
    place = np.minimum(np.searchsorted(keep, index, side="right") - 1, len(keep) - 2)
    share = (index - keep[place]) / (keep[place + 1] - keep[place])
    return np.column_stack([place, place + 1]), np.column_stack([1.0 - share, share])


def _any_face(surface: Surface, vertices: IntArray) -> IntArray:
    """Return a face of each of these vertices of a grid, the last one around it."""
    around = corners_of(surface)
    return around.entry[around.offset[vertices + 1] - 1] // 4


def _coarsen_lattice(lattice: Lattice) -> CoarsenedGrid | None:
    """Return the lattice with every second row and column between those in which the border turns, which all stay.

    Returns:
        None where too few vertices would go.
    """
    keep = _kept_lines(lattice.row, lattice.bends), _kept_lines(lattice.column, lattice.bends)
    places = lattice.face_row, lattice.face_column
    block_row, block_column = (
        np.searchsorted(lines, place, side="right") - 1 for lines, place in zip(keep, places, strict=True)
    )
    # The faces at the corners of each block between kept lines.
    width = len(keep[1])
    block = block_row * width + block_column
    first = [place == lines[at] for place, lines, at in zip(places, keep, (block_row, block_column), strict=True)]
    last = [
        place == lines[at + 1] - 1 for place, lines, at in zip(places, keep, (block_row, block_column), strict=True)
    ]
    at_corner = np.full((4, len(keep[0]) * width), -1, dtype=np.int32)
    for k, (up, right) in enumerate(((first, first), (first, last), (last, last), (last, first))):
        here = np.flatnonzero(up[0] & right[1])
        at_corner[k, block[here]] = here
    blocks = np.flatnonzero(at_corner[0] >= 0)
    at_corner = at_corner[:, blocks]
    corners = np.stack([lattice.corner[at_corner[k], k] for k in range(4)], axis=1)
    kept = np.flatnonzero(np.bincount(corners.ravel(), minlength=len(lattice.row))).astype(np.int32)
    count = len(lattice.row)
    if len(kept) > _MOST_LEFT * count:
        return None
    number = np.full(count, -1, dtype=np.int32)
    number[kept] = np.arange(len(kept), dtype=np.int32)
    faces = number[corners]
    row, column = (
        np.searchsorted(lines, line[kept]).astype(np.int32)
        for lines, line in zip(keep, (lattice.row, lattice.column), strict=True)
    )
    coarse = Lattice(row=row, column=column, corner=faces, bends=lattice.bends[kept])
    return CoarsenedGrid(
        kept=kept,
        faces=faces,
        face_of=at_corner[0].copy(),
        transfer=Transfer(lambda: _bilinear_in_blocks(lattice, keep, block, blocks, faces)),
        make_interpolation=lambda surface: LatticeProlongation(surface.vertices, lattice, keep),
        of_faces=face_results(faces, {find_lattice: read_only(coarse)}),
    )


def _kept_lines(line: IntArray, bends: BoolArray) -> IntArray:
    """Return the lines that stay: all in which the border turns, and every second one between them if not too few.

    Args:
        line: #V, the row or the column of each vertex.
        bends: #V, whether the border turns there.
    """
    strips = []
    for begin, end in pairwise(np.unique(line[bends]).tolist()):
        lines = _second(end - begin + 1)
        strips.append(begin + (lines if len(lines) > _LEAST_QUADS else np.arange(end - begin + 1, dtype=np.int32)))
    return np.unique(np.concatenate(strips)).astype(np.int32)


def _bilinear_in_blocks(
    lattice: Lattice, keep: tuple[IntArray, IntArray], block: IntArray, blocks: NDArray[np.integer], corners: IntArray
) -> csr_array:
    """Return the weights of bilinear interpolation by index, #V by #C, between the corners of each vertex's block."""
    count = len(lattice.row)
    face = np.empty(count, dtype=np.int32)
    face[lattice.corner] = np.arange(len(block), dtype=np.int32)[:, None]
    number = np.empty(int(blocks.max()) + 1, dtype=np.int32)
    number[blocks] = np.arange(len(blocks), dtype=np.int32)
    shares = []
    for line, lines, at in zip((lattice.row, lattice.column), keep, np.divmod(block[face], len(keep[1])), strict=True):
        share = (line - lines[at]) / (lines[at + 1] - lines[at])
        shares.append((1.0 - share, share))
    weights = np.stack([shares[0][up] * shares[1][right] for up, right in ((0, 0), (0, 1), (1, 1), (1, 0))], axis=1)
    offset = np.arange(0, 4 * count + 1, 4, dtype=np.int32)
    size = int(corners.max()) + 1
    prolongation = csr_array((weights.ravel(), corners[number[block[face]]].ravel(), offset), shape=(count, size))
    prolongation.eliminate_zeros()
    # A copy has no memory for the zeros.
    return prolongation.copy()
