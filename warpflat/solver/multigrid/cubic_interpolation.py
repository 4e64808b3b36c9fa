"""Cubic interpolation of layouts, along rows and columns, from a coarser grid or lattice to the finer one.

A relaxed layout is smooth, so that the excess energy after cubic interpolation falls sixteenfold with each level.
Linear interpolation would leave kinks, several per cent of the energy, for the finer level's steps to smooth.
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
from warpflat.kernels.cubic_interpolation import interpolate_along, interpolate_along_rows, weigh_cubics
from warpflat.surface.grid import Lattice
from warpflat.surface.vectors import norm, points_at

__all__ = ["GridProlongation", "LatticeProlongation", "cubic_interpolation_between", "row_places"]

Number = TypeVar("Number", np.float64, np.complex128)

# Columns along which the distances of rows are measured, and rows for those of columns.
_LINES = 16


@dataclass(frozen=True, kw_only=True)
class CubicInterpolation:
    """Weights of interpolation: `column`, #N by 4 or fewer, the nodes of each place, and their `weight`."""

    column: IntArray
    weight: FloatArray

    def __call__(self, values: NDArray[Number]) -> NDArray[Number]:
        """Return the values at the places, #N or #N by #M, from those at the nodes, #K or #K by #M."""
        over = (slice(None), *(None,) * (values.ndim - 1))
        result = self.weight[:, 0][over] * values[self.column[:, 0]]
        for k in range(1, self.column.shape[1]):
            result += self.weight[:, k][over] * values[self.column[:, k]]
        return result


def cubic_interpolation_between(nodes: FloatArray, place: FloatArray) -> CubicInterpolation:
    """Return the weights of interpolation at places by the cubic through the four nearest nodes.

    Args:
        nodes: #K, rising; with fewer than four, the polynomial through all is taken.
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


def row_places(vertices: FloatArray, grid: IntArray) -> FloatArray:
    """Return the distance of each row of a grid from the first one along the surface, #N [m], a mean over columns.

    Where two rows lie at one place, the numbers of the rows are returned instead.

    Args:
        vertices: #V by 3 [m].
        grid: #N by #M, vertices by row and column.
    """
    some = points_at(vertices, grid[:, np.unique(np.linspace(0, grid.shape[1] - 1, _LINES).astype(int))])
    steps = norm(some[:, 1:] - some[:, :-1]).mean(axis=1)
    return np.append(0.0, np.cumsum(steps if steps.min() > 0.0 else np.ones_like(steps)))


class GridProlongation:
    """Cubic interpolation of layouts from a coarser grid to the finer one, and sampling the other way."""

    def __init__(self, grid: IntArray, places: Sequence[FloatArray], lines: tuple[IntArray | FloatArray, ...]) -> None:
        """Prepare interpolation on a grid.

        Args:
            grid: #rows by #columns, numbers of the finer grid's vertices.
            places: distances of its rows from the first, and of its columns [m] (`row_places`).
            lines: the coarser grid's rows and columns, counted in those of the finer one, the first and the last among
                them; its vertices are numbered row by row.
        """
        self._grid, self._lines = grid, lines
        # For rows and for columns: the places of the coarser grid's, and of the finer one's.
        self._places = [
            (np.interp(at, np.arange(len(place)), place), place) for at, place in zip(lines, places, strict=True)
        ]

    @cached_property
    def _cubics(self) -> list[CubicInterpolation]:
        return [cubic_interpolation_between(coarse, fine) for coarse, fine in self._places]

    def __call__(self, layout: FloatArray) -> FloatArray:
        """Return the finer layout, #V by 2 [m], of a coarser one (#C by 2)."""
        by_rows, by_columns = self._cubics
        # x + iy, so that a vertex is one number.
        coarse = np.ascontiguousarray(layout).view(np.complex128).reshape(*map(len, self._lines))
        on_rows, result = (
            by_rows(coarse).view(np.float64).reshape(len(self._grid), -1, 2),
            np.empty((self._grid.size, 2)),
        )
        given = [on_rows, self._grid, by_columns.column, by_columns.weight]
        launch_each(interpolate_along_rows, self._grid.size, given, [result])
        return result


class LatticeProlongation:
    """Cubic interpolation of layouts from a coarser lattice of quads to the finer one.

    It goes along each row and column as far as it runs without a break, and so not across a crack.
    """

    def __init__(self, vertices: FloatArray, lattice: Lattice, keep: tuple[IntArray, IntArray]) -> None:
        """Prepare interpolation on a lattice.

        Args:
            vertices: #V by 3, of the finer lattice, in space [m].
            lattice: the finer one.
            keep: rows and columns that the coarser one keeps, with all in which the border turns; its vertices are
                numbered in the finer one's order.
        """
        self._vertices, self._lattice = vertices, lattice
        self._on_row, self._on_column = (
            np.isin(line, lines) for line, lines in zip((lattice.row, lattice.column), keep, strict=True)
        )

    def __call__(self, layout: FloatArray) -> FloatArray:
        """Return the finer layout, #V by 2 [m], of a coarser one (#C by 2)."""
        on_row, on_column = self._on_row, self._on_column
        values = np.zeros((len(self._vertices), 2))
        values[on_row & on_column] = layout
        below_left, below_right, above_right, above_left = self._lattice.corner.T
        # First along the kept rows alone, then along all columns.
        along_row = self._interpolate(values, (below_left, below_right), (above_left, above_right), on_column | ~on_row)
        return self._interpolate(along_row, (below_left, above_left), (below_right, above_right), on_row)

    def _interpolate(
        self,
        values: FloatArray,
        edges: tuple[IntArray, IntArray],
        others: tuple[IntArray, IntArray],
        kept: BoolArray,
    ) -> FloatArray:
        """Return the values with those between kept vertices interpolated along rows or columns, #V by 2.

        The weights are not kept: they take half as much memory as all springs, and are seldom needed twice.

        Args:
            values: #V by 2.
            edges, others: as `_neighbors` has them.
            kept: #V, whether a vertex keeps its value.
        """
        count = len(values)
        column, weight, result = np.empty((count, 4), dtype=np.int32), np.empty((count, 4)), np.empty_like(values)
        given = [self._vertices, *_neighbors(count, edges, others), kept.astype(np.int32)]
        launch_each(weigh_cubics, count, given, [column, weight])
        launch_each(interpolate_along, count, [column, weight, values], [result])
        return result


def _neighbors(
    count: int, edges: tuple[IntArray, IntArray], others: tuple[IntArray, IntArray]
) -> tuple[IntArray, IntArray]:
    """Return the vertices before and after each vertex along its row (or column), #V each; -1 where the row ends.

    A row ends on the border, and at the tip of a crack, where it becomes two.

    Args:
        count: number of vertices.
        edges: tails and heads of the edges below (to the left of) the faces.
        others: tails and heads of those above (to the right).
    """
    found = np.full((2, 2, count), -1, dtype=np.int32)
    for side, (tail, head) in enumerate((edges, others)):
        found[0, side, head], found[1, side, tail] = tail, head
    fork = ((found.min(axis=1) >= 0) & (found[:, 0] != found[:, 1])).any(axis=0)
    before, after = np.where(fork, -1, found.max(axis=1))
    return before, after
