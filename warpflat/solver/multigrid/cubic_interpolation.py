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

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.launch import launch_each
from warpflat.kernels.cubic_interpolation import carry_along, carry_along_rows, sample_grid, weigh_cubics
from warpflat.surface.grid import Lattice
from warpflat.surface.vectors import norm, points_at

__all__ = ["GridProlongation", "LatticeProlongation", "cubic_interpolation_between", "places_of_rows"]

Number = TypeVar("Number", np.float64, np.complex128)

# Columns along which the distances of rows are measured, and the other way round.
_LINES = 16
# Places whose values are worth a thread of their own: each is a sum of sixteen.
_PLACES = 512


@dataclass(frozen=True, kw_only=True)
class CubicInterpolation:
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


def cubic_interpolation_between(nodes: FloatArray, place: FloatArray) -> CubicInterpolation:
    """Values at places from those at nodes, by the cubic through the four nearest.

    Args:
        nodes: #K, rising; of fewer than four, the polynomial through all.
        place: #N, from the first node to the last.
    """
    points = min(4, len(nodes))
    before = np.searchsorted(nodes, place, side="right") - 1
    begin = np.clip(before - (points // 2 - 1), 0, len(nodes) - points)
    column = begin[:, None] + np.arange(points)
    node, itself = nodes[column], np.arange(points)
    apart = node[:, :, None] - node[:, None, :]
    apart[:, itself, itself] = 1.0
    share = (place[:, None] - node)[:, None, :] / apart
    share[:, itself, itself] = 1.0
    return CubicInterpolation(column=column.astype(np.int32), weight=share.prod(axis=2))


def places_of_rows(vertices: FloatArray, grid: IntArray) -> FloatArray:
    """#N, how far each row of a grid (#N by #M, of vertices #V by 3 [m]) lies from the first one, along the surface: the mean over some
    columns. By number where two of them lie at one place."""
    some = points_at(vertices, grid[:, np.unique(np.linspace(0, grid.shape[1] - 1, _LINES).astype(int))])
    steps = norm(some[:, 1:] - some[:, :-1]).mean(axis=1)
    return np.append(0.0, np.cumsum(steps if steps.min() > 0.0 else np.ones_like(steps)))


class GridProlongation:
    """From the layout of a coarser grid to that of the finer one, and the other way."""

    def __init__(self, grid: IntArray, places: Sequence[FloatArray], lines: tuple[IntArray | FloatArray, ...]) -> None:
        """Of a grid.

        Args:
            grid: #rows by #columns, numbers of the finer grid's vertices.
            places: how far its rows lie from the first, and its columns [m] (`places_of_rows`).
            lines: where the coarser one's rows and columns lie, counted in those of the finer one, the first and the last among them;
                its vertices are numbered row by row.
        """
        self._grid, self._lines = grid, lines
        # Of rows and of columns: where the coarser grid's lie, and the finer one's.
        self._places = [
            (np.interp(at, np.arange(len(place)), place), place) for at, place in zip(lines, places, strict=True)
        ]

    @cached_property
    def _cubics(self) -> list[CubicInterpolation]:
        return [cubic_interpolation_between(coarse, fine) for coarse, fine in self._places]

    def sample(self, values: FloatArray) -> FloatArray:
        """#C by #K, values of the coarser grid from those of the finer one (#V by #K, three or fewer)."""
        by_rows, by_columns = (cubic_interpolation_between(fine, coarse) for coarse, fine in self._places)
        sampled = np.empty((len(by_rows.column), len(by_columns.column), values.shape[1]))
        of_rows, of_columns = ((cubics.column, cubics.weight) for cubics in (by_rows, by_columns))
        given = [np.ascontiguousarray(values), self._grid, *of_rows, *of_columns]
        places = len(by_rows.column) * len(by_columns.column)
        launch_each(sample_grid, places, given, [sampled], least=_PLACES)
        return sampled.reshape(-1, values.shape[1])

    def __call__(self, layout: FloatArray) -> FloatArray:
        """#V by 2, the finer layout of a coarser one (#C by 2) [m]."""
        by_rows, by_columns = self._cubics
        # x + iy, so that a vertex is one number.
        coarse = np.ascontiguousarray(layout).view(np.complex128).reshape(*map(len, self._lines))
        on_rows, result = (
            by_rows(coarse).view(np.float64).reshape(len(self._grid), -1, 2),
            np.empty((self._grid.size, 2)),
        )
        given = [on_rows, self._grid, by_columns.column, by_columns.weight]
        launch_each(carry_along_rows, self._grid.size, given, [result])
        return result


class LatticeProlongation:
    """The same of quads on any lattice: along each row and column as far as it runs without a break, so not across a crack."""

    def __init__(self, vertices: FloatArray, lattice: Lattice, keep: tuple[IntArray, IntArray]) -> None:
        """Of a lattice.

        Args:
            vertices: #V by 3, the finer one's, in space [m].
            lattice: the finer one.
            keep: rows and columns that the coarser one keeps, all in which the border turns among them; its vertices are numbered in
                the finer one's order.
        """
        self._vertices, self._lattice = vertices, lattice
        self._on_row, self._on_column = (
            np.isin(line, lines) for line, lines in zip((lattice.row, lattice.column), keep, strict=True)
        )

    def __call__(self, layout: FloatArray) -> FloatArray:
        """#V by 2, the finer layout of a coarser one (#C by 2) [m]."""
        on_row, on_column = self._on_row, self._on_column
        values = np.zeros((len(self._vertices), 2))
        values[on_row & on_column] = layout
        below_left, below_right, above_right, above_left = self._lattice.corner.T
        # What lies between the rows that are kept is left alone on the first way.
        along_row = self._carry(values, (below_left, below_right), (above_left, above_right), on_column | ~on_row)
        return self._carry(along_row, (below_left, above_left), (below_right, above_right), on_row)

    def _carry(
        self,
        values: FloatArray,
        edges: tuple[IntArray, IntArray],
        others: tuple[IntArray, IntArray],
        kept: BoolArray,
    ) -> FloatArray:
        """The values (#V by 2) between those kept (#V), along rows or columns; the edges as `_neighbors` has them. Weights take half as
        much memory as all springs, and are seldom needed twice: they are not remembered."""
        count = len(values)
        column, weight, carried = np.empty((count, 4), dtype=np.int32), np.empty((count, 4)), np.empty_like(values)
        given = [self._vertices, *_neighbors(count, edges, others), kept.astype(np.int32)]
        launch_each(weigh_cubics, count, given, [column, weight])
        launch_each(carry_along, count, [column, weight, values], [carried])
        return carried


def _neighbors(
    count: int, edges: tuple[IntArray, IntArray], others: tuple[IntArray, IntArray]
) -> tuple[IntArray, IntArray]:
    """Of each vertex the one before it and the one after it along its row (or column), -1 where the row ends: on the border, and at
    the tip of a crack, where one of a row becomes two.

    Args:
        count: of vertices.
        edges: tails and heads of the edges below (to the left of) the faces.
        others: of those above (to the right).
    """
    ways = np.full((2, 2, count), -1, dtype=np.int32)
    for side, (tail, head) in enumerate((edges, others)):
        ways[0, side, head], ways[1, side, tail] = tail, head
    fork = ((ways.min(axis=1) >= 0) & (ways[:, 0] != ways[:, 1])).any(axis=0)
    before, after = np.where(fork, -1, ways.max(axis=1))
    return before, after
