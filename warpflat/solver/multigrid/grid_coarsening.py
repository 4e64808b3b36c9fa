"""Quads on a lattice with fewer rows and columns: all that their faces tell of a coarser level.

A rectangular grid keeps every second row and column (all rows where these lie much farther apart than its columns), any other lattice
those too in which its border turns, at corners and at the tips of cracks: then between two kept rows and two kept columns there is cloth
everywhere or nowhere. Surfaces that differ only in where their vertices lie, such as the sizes of a pattern, share what is worked out
here.

A large rectangular grid starts where a small one has come to rest that is spread evenly over it, its rows and columns between those of
the large one: of any number of them, it is as fine, and nowhere uneven.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.solver.multigrid.cubic_interpolation import GridProlongation, LatticeProlongation, places_of_rows
from warpflat.surface.grid import Lattice, lattice_of, rows_and_columns
from warpflat.surface.mesh import Surface, face_results, once_per_faces, once_per_surface, read_only
from warpflat.surface.unfold import corners_of

__all__ = [
    "CoarsenedGrid",
    "ResampledGrid",
    "ResamplingKind",
    "Transfer",
    "can_be_coarsened",
    "coarsened_grid",
    "resampled_grid",
    "thirds_of",
]


# Which small grid is spread over a large one: for stiff cloth, whose next level has every third row and column; for others, whose levels
# have every second one; and for cloth so soft that steps go along lines.
ResamplingKind = Literal["thirds", "halves", "fine"]

# A grid of fewer rows or columns has no coarser one, or none of every third of them.
_LEAST_LINES = 5
_LEAST_THIRDS = 13
# Quads that are left across a strip between two lines in which the border turns: a single one bends several times as stiffly as its cloth.
_LEAST_QUADS = 2
# Rows this many times as far apart as columns all stay, and columns as rows.
_MUCH = 2.5
# A level of a lattice with more than this share of the finer one's vertices is not worth having.
_MOST_LEFT = 0.7
# A small grid spread over a large one has so many quads along its sides, more along the longer one. What cubics leave of a layout is then
# .002 % of the energy on the dome, .03 % on the bodice, from grids of any size; of soft cloth, .09 % with the finer one. Multiples of eight
# can be halved thrice, of six have a third that can be halved.
_SIDES: dict[ResamplingKind, int] = {"thirds": 48, "halves": 48, "fine": 56}
_MULTIPLES: dict[ResamplingKind, int] = {"thirds": 6, "halves": 8, "fine": 8}


class Transfer:
    """Weights between a level and a coarser one, made when they are first asked for."""

    def __init__(self, weigh: Callable[[], csr_array]) -> None:
        """Of a function that makes the prolongation."""
        self._weigh = weigh

    def make(self) -> None:
        """Make them now."""
        _ = self.transpose

    @cached_property
    def prolongation(self) -> csr_array:
        """#V by #C, rows add up to 1."""
        prolongation = self._weigh()
        # With what it was made of.
        del self._weigh
        return prolongation

    @cached_property
    def transpose(self) -> csr_array:
        """#C by #V, the prolongation's transpose: its entries' numbers in that."""
        of = self.prolongation
        numbered = csr_array((np.arange(of.nnz, dtype=np.int32), of.indices, of.indptr), shape=of.shape)
        return csr_array(numbered.T.tocsr())


@dataclass(frozen=True, kw_only=True)
class CoarsenedGrid:
    """The next coarser level of a lattice.

    Attributes:
        kept: #C, the finer level's vertices that it has.
        faces: #G by 4, among these.
        face_of: #G, for each of them one of the finer level's that lies in it.
        transfer: linear by index.
        carry: of a surface with the finer level's faces, what carries layouts up to it by cubics.
        of_faces: what is worked out of the faces (`warpflat.surface.mesh.once_per_faces`), for all surfaces that have them.
    """

    kept: IntArray
    faces: IntArray
    face_of: IntArray
    transfer: Transfer
    carry: Callable[[Surface], GridProlongation | LatticeProlongation]
    of_faces: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class ResampledGrid:
    """A small grid spread over a large one.

    Attributes:
        of_faces: what is known of its faces (`warpflat.surface.mesh.once_per_faces`).
        face_of: #G, for each of them one of the large grid's that lies in it.
        carry: of a surface with the large grid's faces, what carries layouts up to it by cubics, and samples what is there.
    """

    of_faces: dict[str, Any]
    face_of: IntArray
    carry: Callable[[Surface], GridProlongation]

    @property
    def faces(self) -> IntArray:
        """#G by 4, of its vertices, which are numbered row by row."""
        faces: IntArray = self.of_faces["faces"]
        return faces


def resampled_grid(surface: Surface, kind: ResamplingKind) -> ResampledGrid | None:
    """The small grid that is spread over a large one; None of any other surface, and where there are too few rows or columns."""
    known = _spreads(surface)
    if kind not in known:
        known[kind] = _spread(surface, kind)
    return known[kind]


@once_per_faces
def _spreads(surface: Surface) -> dict[ResamplingKind, ResampledGrid | None]:
    return {}


def _spread(surface: Surface, kind: ResamplingKind) -> ResampledGrid | None:
    grid = rows_and_columns(surface)
    if grid is None or not can_be_coarsened(grid):
        return None
    quads = _quads(grid.shape, _SIDES[kind], _MULTIPLES[kind])
    lines = tuple(np.linspace(0.0, count - 1.0, of + 1) for count, of in zip(grid.shape, quads, strict=True))
    middle = [(0.5 * (at[:-1] + at[1:])).astype(np.int32) for at in lines]
    return ResampledGrid(
        of_faces=_known_of_grid(*map(len, lines)),
        face_of=_some_face(surface, grid[np.ix_(*middle)].ravel()),
        carry=lambda surface: GridProlongation(grid, _places_of_lines(surface), lines),
    )


def _quads(shape: tuple[int, ...], side: int, multiple: int) -> list[int]:
    """Of a small grid's columns and rows, about as long for their width as those of a grid of this shape; `side` of a square one. Multiples
    of this number, but where the large grid has fewer."""
    quads = [count - 1 for count in shape]
    short, long = np.argsort(quads).tolist()
    share = side / float(np.sqrt(np.prod(quads, dtype=float)))
    result = [0, 0]
    result[short] = min(quads[short], max(round(quads[short] * share / multiple), 1) * multiple)
    result[long] = min(quads[long], max(round(side**2 / result[short] / multiple), 1) * multiple)
    return result


@lru_cache(maxsize=16)
def _known_of_grid(rows: int, columns: int) -> dict[str, Any]:
    """What has been worked out of the faces of a small grid: pieces that are about as long for their width have the same."""
    return face_results(_faces_of(rows, columns))


def _faces_of(rows: int, columns: int) -> IntArray:
    """#F by 4, of a grid whose vertices are numbered row by row."""
    number = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    return np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)


def can_be_coarsened(grid: IntArray) -> bool:
    """Whether a grid (#rows by #columns vertices) has a coarser one."""
    return min(grid.shape) >= _LEAST_LINES


def coarsened_grid(surface: Surface) -> CoarsenedGrid | None:
    """The next coarser level of quads on a lattice; None if they lie on none, or where it would not be worth having.

    Of a grid whose rows lie much farther apart than its columns all rows stay, or the other way round: quads are to become squarer, since
    steps smooth along their short sides only.
    """
    grid = rows_and_columns(surface)
    if grid is None:
        return _of_lattice(surface)
    if not can_be_coarsened(grid):
        return None
    wide = _how_wide(surface)
    if wide == "rows":
        return _across_rows(surface)
    return _across_columns(surface) if wide == "columns" else _both_ways(surface)


def thirds_of(surface: Surface) -> CoarsenedGrid | None:
    """Every third row and column of a grid; None where they do not come out even, or where its quads are long."""
    grid = rows_and_columns(surface)
    if grid is None or any(count < _LEAST_THIRDS or count % 3 != 1 for count in grid.shape) or _how_wide(surface):
        return None
    return _thirds(surface)


def _how_wide(surface: Surface) -> Literal["rows", "columns", ""]:
    """Which of a grid's lines lie much farther apart than the others, if any do."""
    rows, columns = (place[-1] / (len(place) - 1) for place in _places_of_lines(surface))
    if rows > _MUCH * columns:
        return "rows"
    return "columns" if columns > _MUCH * rows else ""


@once_per_surface
def _places_of_lines(surface: Surface) -> tuple[FloatArray, FloatArray]:
    """How far a grid's rows lie from the first one, and its columns [m]."""
    grid = rows_and_columns(surface)
    assert grid is not None
    return places_of_rows(surface.vertices, grid), places_of_rows(surface.vertices, grid.T)


@once_per_faces
def _of_lattice(surface: Surface) -> CoarsenedGrid | None:
    lattice = lattice_of(surface)
    return None if lattice is None else _every_other(lattice)


@once_per_faces
def _both_ways(surface: Surface) -> CoarsenedGrid:
    return _thinner(surface, rows=_second, columns=_second)


@once_per_faces
def _across_rows(surface: Surface) -> CoarsenedGrid:
    return _thinner(surface, rows=_every, columns=_second)


@once_per_faces
def _across_columns(surface: Surface) -> CoarsenedGrid:
    return _thinner(surface, rows=_second, columns=_every)


@once_per_faces
def _thirds(surface: Surface) -> CoarsenedGrid:
    return _thinner(surface, rows=_third, columns=_third)


def _thinner(surface: Surface, *, rows: Callable[[int], IntArray], columns: Callable[[int], IntArray]) -> CoarsenedGrid:
    """Some rows and columns of a grid, which of so many these tell, and the last ones; between them linear by index."""
    grid = rows_and_columns(surface)
    assert grid is not None
    keep = rows(grid.shape[0]), columns(grid.shape[1])
    kept = grid[np.ix_(*keep)]
    faces = _faces_of(*kept.shape)
    return CoarsenedGrid(
        kept=kept.ravel(),
        faces=faces,
        face_of=_some_face(surface, kept[:-1, :-1].ravel()),
        transfer=Transfer(lambda: _bilinear(grid, keep)),
        carry=lambda surface: GridProlongation(grid, _places_of_lines(surface), keep),
        of_faces=face_results(faces),
    )


def _bilinear(grid: IntArray, keep: tuple[IntArray, ...]) -> csr_array:
    """#V by #kept, a grid's values from those at the rows and columns kept, by the four around each vertex."""
    (row, row_share), (column, column_share) = (_between(*of) for of in zip(grid.shape, keep, strict=True))
    height, width = map(len, keep)
    parents, weights = np.empty((grid.size, 4), dtype=np.int32), np.empty((grid.size, 4))
    for k, (i, j) in enumerate(np.ndindex(2, 2)):
        parents[grid, k] = np.add.outer(row[:, i] * width, column[:, j])
        weights[grid, k] = np.multiply.outer(row_share[:, i], column_share[:, j])
    offset = np.arange(0, 4 * grid.size + 1, 4, dtype=np.int32)
    prolongation = csr_array((weights.ravel(), parents.ravel(), offset), shape=(grid.size, height * width))
    prolongation.eliminate_zeros()
    # Without the room for what was zero.
    return prolongation.copy()


def _every(count: int) -> IntArray:
    return np.arange(count, dtype=np.int32)


def _third(count: int) -> IntArray:
    return np.arange(0, count, 3, dtype=np.int32)


def _second(count: int) -> IntArray:
    """Every second of so many, and the last; of an even number the last step goes over three, since a thin row of quads would be
    stiffer than its cloth along it."""
    return np.append(np.arange(0, count - 3 + count % 2, 2), count - 1).astype(np.int32)


def _between(count: int, keep: IntArray) -> tuple[IntArray, FloatArray]:
    """#count by 2, of each index the places in `keep` before and after, and their shares, linear by index."""
    index = np.arange(count, dtype=np.int32)
    place = np.minimum(np.searchsorted(keep, index, side="right") - 1, len(keep) - 2)
    share = (index - keep[place]) / (keep[place + 1] - keep[place])
    return np.column_stack([place, place + 1]), np.column_stack([1.0 - share, share])


def _some_face(surface: Surface, vertices: IntArray) -> IntArray:
    """For each of a grid's vertices a face that has it, the last one."""
    around = corners_of(surface)
    return around.entry[around.offset[vertices + 1] - 1] // 4


def _every_other(lattice: Lattice) -> CoarsenedGrid | None:
    """Every second row and column between those in which the border turns, which all stay; None where too little would go."""
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
        transfer=Transfer(lambda: _between_corners(lattice, keep, block, blocks, faces)),
        carry=lambda surface: LatticeProlongation(surface.vertices, lattice, keep),
        of_faces=face_results(faces, {lattice_of: read_only(coarse)}),
    )


def _kept_lines(line: IntArray, bends: BoolArray) -> IntArray:
    """Of rows or columns (#V, of each vertex) those that stay: all in which the border turns, and between them every second, but for
    strips that are as narrow as may be."""
    strips = []
    for begin, end in pairwise(np.unique(line[bends]).tolist()):
        lines = _second(end - begin + 1)
        strips.append(begin + (lines if len(lines) > _LEAST_QUADS else np.arange(end - begin + 1, dtype=np.int32)))
    return np.unique(np.concatenate(strips)).astype(np.int32)


def _between_corners(
    lattice: Lattice, keep: tuple[IntArray, IntArray], block: IntArray, blocks: NDArray[np.integer], corners: IntArray
) -> csr_array:
    """#V by #C, linear by index along rows and columns between the corners of the block that a vertex lies in."""
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
    # Without the room for what was zero.
    return prolongation.copy()
