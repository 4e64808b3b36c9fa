"""A layout of a coarser grid carried up to the finer one, by cubics along rows and columns.

A relaxed layout is smooth, so that what cubics leave of its energy falls sixteenfold with each level; straight lines between the
coarse vertices would leave kinks, several per cent of the energy, for the finer level's steps to smooth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from warpflat.surface.grid import Lattice

__all__ = ["GridCarry", "LatticeCarry", "cubics_between"]

FloatArray = NDArray[np.float64]
Number = TypeVar("Number", np.float64, np.complex128)
IntArray = NDArray[np.int32]
BoolArray = NDArray[np.bool_]

# Columns along which the distances of rows are measured, and the other way round.
_LINES = 16


@dataclass(frozen=True, kw_only=True)
class Cubics:
    """Values at places from those at the kept ones: `column` #N by 4 or fewer, which of the kept, and their `weight`."""

    column: IntArray
    weight: FloatArray

    def __call__(self, values: NDArray[Number]) -> NDArray[Number]:
        """#N or #N by #M, from #keep or #keep by #M."""
        over = (slice(None), *(None,) * (values.ndim - 1))
        result = self.weight[:, 0][over] * values[self.column[:, 0]]
        for k in range(1, self.column.shape[1]):
            result += self.weight[:, k][over] * values[self.column[:, k]]
        return result

    def along_rows(self, values: NDArray[Number]) -> NDArray[Number]:
        """#M by #N, from #M by #keep."""
        result = self.weight[:, 0] * values[:, self.column[:, 0]]
        for k in range(1, self.column.shape[1]):
            result += self.weight[:, k] * values[:, self.column[:, k]]
        return result


def cubics_between(place: FloatArray, keep: IntArray) -> Cubics:
    """Values at all places from those at the kept ones, by the cubic through the four nearest.

    Args:
        place: #N, rising.
        keep: which of them are kept, rising, the first and the last among them; with fewer than four, the polynomial through all.
    """
    count, points = len(place), min(4, len(keep))
    before = np.searchsorted(keep, np.arange(count), side="right") - 1
    begin = np.clip(before - (points // 2 - 1), 0, len(keep) - points)
    column = begin[:, None] + np.arange(points)
    return Cubics(column=column.astype(np.int32), weight=_lagrange(place, place[keep[column]]))


def _lagrange(place: FloatArray, node: FloatArray, there: BoolArray | None = None) -> FloatArray:
    """#N by #P, weights of the values at some nodes (#N by #P) in the polynomial through them at a place; of those that are `there`, if
    given."""
    weight = np.ones(node.shape)
    for k in range(node.shape[1]):
        for other in range(node.shape[1]):
            if other == k:
                continue
            if there is None:
                weight[:, k] *= (place - node[:, other]) / (node[:, k] - node[:, other])
            else:
                both = there[:, k] & there[:, other]
                away = np.where(both, node[:, k] - node[:, other], 1.0)
                weight[:, k] *= np.where(both, (place - node[:, other]) / away, 1.0)
    return weight if there is None else np.where(there, weight, 0.0)


def _places(lines: FloatArray) -> FloatArray:
    """#N, how far each row of a grid (#N by #M by 3 [m]) lies from the first one, along the surface: the mean over some columns. By number
    where two of them lie at one place."""
    some = lines[:, np.unique(np.linspace(0, lines.shape[1] - 1, _LINES).astype(int))]
    steps = np.linalg.norm(np.diff(some, axis=0), axis=2).mean(axis=1)
    return np.append(0.0, np.cumsum(steps if steps.min() > 0.0 else np.ones_like(steps)))


class GridCarry:
    """From the layout of a coarser grid to that of the finer one."""

    def __init__(self, vertices: FloatArray, grid: IntArray, rows: IntArray, columns: IntArray) -> None:
        """Of a grid.

        Args:
            vertices: #V by 3, the finer grid's, in space [m].
            grid: #rows by #columns, their numbers.
            rows, columns: those that the coarser one keeps; its vertices are numbered row by row.
        """
        self._vertices, self._grid, self._keep = vertices, grid, (rows, columns)

    @cached_property
    def _cubics(self) -> tuple[Cubics, Cubics]:
        (rows, columns), space = self._keep, self._vertices[self._grid]
        return cubics_between(_places(space), rows), cubics_between(_places(space.transpose(1, 0, 2)), columns)

    def __call__(self, layout: FloatArray) -> FloatArray:
        """#V by 2, the finer layout of a coarser one (#C by 2) [m]."""
        by_rows, by_columns = self._cubics
        # x + iy, so that a vertex is one number.
        coarse = np.ascontiguousarray(layout).view(np.complex128).reshape(*map(len, self._keep))
        result = np.empty(self._grid.size, dtype=np.complex128)
        result[self._grid] = by_columns.along_rows(by_rows(coarse))
        return result.view(np.float64).reshape(-1, 2)


class LatticeCarry:
    """The same of quads on any lattice: along each row and column as far as it runs without a break, so not across a crack."""

    def __init__(self, vertices: FloatArray, lattice: Lattice, keep: tuple[IntArray, IntArray]) -> None:
        """Of a lattice.

        Args:
            vertices: #V by 3, the finer one's, in space [m].
            lattice: the finer one.
            keep: rows and columns that the coarser one keeps, all in which the border turns among them; its vertices are numbered in
                the finer one's order.
        """
        self._vertices, self._lattice, self._keep = vertices, lattice, keep

    @cached_property
    def _passes(self) -> tuple[BoolArray, Sequence[tuple[IntArray, Cubics]]]:
        lattice = self._lattice
        on_row, on_column = (
            np.isin(line, lines) for line, lines in zip((lattice.row, lattice.column), self._keep, strict=True)
        )
        below_left, below_right, above_right, above_left = lattice.corner.T
        along_rows = _chains((below_left, below_right), (above_left, above_right), lattice.column, on_row)
        along_columns = _chains((below_left, above_left), (below_right, above_right), lattice.row, None)
        return on_row & on_column, (
            self._cubics(along_rows, on_column),
            self._cubics(along_columns, on_row),
        )

    def _cubics(self, chains: tuple[IntArray, IntArray], kept: BoolArray) -> tuple[IntArray, Cubics]:
        """The vertices along chains, one after the other, and their values from those at kept vertices, numbered as vertices."""
        vertex, chain = chains
        place = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(self._vertices[vertex], axis=0), axis=1)))
        is_node = kept[vertex]
        node = np.flatnonzero(is_node)
        ends = np.cumsum(np.bincount(chain[node]))
        first, end = np.append(0, ends[:-1])[chain], ends[chain]
        begin = np.clip(np.cumsum(is_node) - 2, first, np.maximum(end - 4, first))
        column = begin[:, None] + np.arange(4)
        there = column < end[:, None]
        at = node[np.where(there, column, first[:, None])]
        return vertex, Cubics(column=vertex[at], weight=_lagrange(place, place[at], there))

    def __call__(self, layout: FloatArray) -> FloatArray:
        """#V by 2, the finer layout of a coarser one (#C by 2) [m]."""
        kept, passes = self._passes
        result = np.zeros(len(kept), dtype=np.complex128)
        result[kept] = np.ascontiguousarray(layout).view(np.complex128)[:, 0]
        for vertex, cubics in passes:
            result[vertex] = cubics(result)
        return result.view(np.float64).reshape(-1, 2)


def _chains(
    edges: tuple[IntArray, IntArray], others: tuple[IntArray, IntArray], place: IntArray, along: BoolArray | None
) -> tuple[IntArray, IntArray]:
    """Runs of vertices along rows (or columns), one after the other, and of each vertex in them the number of its run. A run ends
    where the border turns and at the tip of a crack, where one of a row becomes two.

    Args:
        edges: tails and heads of the edges below (to the left of) the faces.
        others: of those above (to the right).
        place: #V, how far along.
        along: #V, the vertices in question; all, if not given.
    """
    count = len(place)
    ahead = np.full(count, -1, dtype=np.int32)
    ahead[edges[0]] = edges[1]
    new = ahead[others[0]] != others[1]
    tail, head = (np.concatenate([a, b[new]]) for a, b in zip(edges, others, strict=True))
    if along is not None:
        tail, head = tail[along[tail]], head[along[tail]]
    into, out = np.bincount(head, minlength=count), np.bincount(tail, minlength=count)
    through = (into == 1) & (out == 1)
    edge = np.arange(len(tail), dtype=np.int32)
    arriving = np.full(count, -1, dtype=np.int32)
    arriving[head] = edge
    # Of each edge the first of its run: the one before it, and the one before that, ...
    first = np.where(through[tail], arriving[tail], edge)
    while True:
        further = first[first]
        if np.array_equal(further, first):
            break
        first = further
    order = np.argsort(first.astype(np.int64) * (int(place.max()) + 1) + place[tail])
    first = first[order]
    begins = np.append(True, first[1:] != first[:-1])
    run = np.cumsum(begins) - 1
    vertex, number = (
        np.empty(len(order) + run[-1] + 1, dtype=np.int32),
        np.empty(len(order) + run[-1] + 1, dtype=np.int32),
    )
    # The heads first: but for the last of a run they are the tails of what follows.
    at = np.arange(len(order)) + run
    vertex[at + 1], vertex[at] = head[order], tail[order]
    number[at + 1], number[at] = run, run
    return vertex, number
