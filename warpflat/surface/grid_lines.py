"""The rows and columns of a piece's quads, along which steps go in a soft cloth (`warpflat.kernels.line_solve`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import IntArray
from warpflat.surface.grid import lattice_of, rows_and_columns
from warpflat.surface.mesh import Surface, once_per_faces, read_only
from warpflat.surface.topology import half_edges_of, join_labels

__all__ = ["LineArrays", "join_lines", "lines_of"]


@dataclass(frozen=True, kw_only=True)
class LineArrays:
    """As `kernels.line_solve.ThreadLines` has them: `offset` #L+1, `vertex` 2 #V, and how many of the lines are `rows`."""

    offset: IntArray
    vertex: IntArray
    rows: int


@once_per_faces
def lines_of(surface: Surface) -> LineArrays | None:
    """The rows and columns of quads on a lattice, ended where the border or a crack ends them; None of any other surface."""
    grid = rows_and_columns(surface)
    if grid is not None:
        height, width = grid.shape
        steps = np.concatenate([np.full(height, width), np.full(width, height)])
        return _listed(steps, [grid.ravel(), grid.T.ravel()], height)
    lattice = lattice_of(surface)
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
    """Lengths of the chains of edges along lines of a lattice, and their vertices one after the other."""
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
    """The lines of several pieces of so many vertices side by side; None where none has any. Each vertex of a piece without lines is a
    line of its own: along that a step leads nowhere."""
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
