"""The rows and columns of a piece's quads: the lines of the line smoother (`warpflat.kernels.line_solve`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import IntArray
from warpflat.surface.connectivity import join_labels
from warpflat.surface.grid import find_lattice, rows_and_columns
from warpflat.surface.half_edges import half_edges_of
from warpflat.surface.mesh import Surface, once_per_faces, read_only

__all__ = ["LineArrays", "join_lines", "lines_of"]


@dataclass(frozen=True, kw_only=True)
class LineArrays:
    """Lines of vertices along rows and columns.

    Attributes:
        offset: #L+1, the place in `vertex` where each line begins.
        vertex: 2 #V, the vertices of the rows, then those of the columns.
        rows: number of lines that are rows.
    """

    offset: IntArray
    vertex: IntArray
    rows: int


@once_per_faces
def lines_of(surface: Surface) -> LineArrays | None:
    """Return the rows and columns of quads on a lattice, from border (or crack) to border; None for any other surface."""
    grid = rows_and_columns(surface)
    if grid is not None:
        height, width = grid.shape
        steps = np.concatenate([np.full(height, width), np.full(width, height)])
        return _listed(steps, [grid.ravel(), grid.T.ravel()], height)
    lattice = find_lattice(surface)
    if lattice is None:
        return None
    edges = half_edges_of(surface).edges
    families = [
        _chains(edges, line, place) for line, place in ((lattice.row, lattice.column), (lattice.column, lattice.row))
    ]
    return _listed(
        np.concatenate([counts for counts, _ in families]), [vertex for _, vertex in families], len(families[0][0])
    )


def _listed(counts: NDArray[np.integer], vertex: Sequence[IntArray], rows: int) -> LineArrays:
    offset = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    return read_only(LineArrays(offset=offset, vertex=np.concatenate(vertex), rows=rows))


def _chains(edges: IntArray, line: IntArray, place: IntArray) -> tuple[NDArray[np.integer], IntArray]:
    """Return the number of vertices in each chain of edges along lines of a lattice, and these vertices, chain by chain."""
    a, b = edges[line[edges[:, 0]] == line[edges[:, 1]]].T
    back = place[a] > place[b]
    ends = np.where(back, b, a), np.where(back, a, b)
    # At the tip of a crack along the line there are two ways on, or two that lead to it: one of them is the line's.
    for end in range(2):
        first = np.unique(ends[end], return_index=True)[1]
        ends = ends[0][first], ends[1][first]
    chain = join_labels(len(line), *ends)
    return np.bincount(chain), np.lexsort((place, chain)).astype(np.int32)


def join_lines(parts: Sequence[LineArrays | None], counts: Sequence[int]) -> LineArrays | None:
    """Join the lines of several pieces into one set.

    Each vertex of a piece without lines becomes a line of its own, along which nothing moves.

    Args:
        parts: the lines of each piece, or None.
        counts: number of vertices of each piece.

    Returns:
        The lines of all pieces; None if no piece has lines.
    """
    if all(part is None for part in parts):
        return None
    lengths: tuple[list[NDArray[np.integer]], list[NDArray[np.integer]]] = ([], [])
    vertices: tuple[list[IntArray], list[IntArray]] = ([], [])
    begin = 0
    for part, count in zip(parts, counts, strict=True):
        every = np.arange(count, dtype=np.int32)
        for family, (first, rest) in enumerate(((0, count), (count, 2 * count))):
            length, vertex = np.ones(count, dtype=np.int32), every
            if part is not None:
                length = np.diff(part.offset)[: part.rows] if family == 0 else np.diff(part.offset)[part.rows :]
                vertex = part.vertex[first:rest]
            lengths[family].append(length)
            vertices[family].append(vertex + np.int32(begin))
        begin += count
    return _listed(np.concatenate([*lengths[0], *lengths[1]]), [*vertices[0], *vertices[1]], sum(map(len, lengths[0])))
