"""A layout of a coarser grid carried up to the finer one, by cubics along rows and columns.

A relaxed layout is smooth, so that what cubics leave of its energy falls sixteenfold with each level; straight lines between the
coarse vertices would leave kinks, several per cent of the energy, for the finer level's steps to smooth.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

__all__ = ["GridCarry", "cubics_between"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

# Columns along which the distances of rows are measured, and the other way round.
_LINES = 16


def cubics_between(place: FloatArray, keep: IntArray) -> csr_array:
    """#N by #keep: values at all places from those at the kept ones, by the cubic through the four nearest.

    Args:
        place: #N, rising.
        keep: which of them are kept, rising, the first and the last among them; with fewer than four, the polynomial through all.
    """
    count, points = len(place), min(4, len(keep))
    before = np.searchsorted(keep, np.arange(count), side="right") - 1
    begin = np.clip(before - (points // 2 - 1), 0, len(keep) - points)
    column = begin[:, None] + np.arange(points)
    node = place[keep[column]]
    weight = np.ones((count, points))
    for k in range(points):
        for other in range(points):
            if other != k:
                weight[:, k] *= (place - node[:, other]) / (node[:, k] - node[:, other])
    offset = points * np.arange(count + 1)
    matrix = csr_array((weight.ravel(), column.ravel(), offset), shape=(count, len(keep)))
    matrix.eliminate_zeros()
    return matrix


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
        self._grid = grid
        self._shape = (len(rows), len(columns))
        space = vertices[grid]
        self._rows = cubics_between(_places(space), rows)
        self._columns = cubics_between(_places(space.transpose(1, 0, 2)), columns)

    def __call__(self, layout: FloatArray) -> FloatArray:
        """#V by 2, the finer layout of a coarser one (#C by 2) [m]."""
        height, width = self._grid.shape
        along = self._rows @ layout.reshape(self._shape[0], -1)
        across = along.reshape(height, self._shape[1], 2).transpose(1, 0, 2).reshape(self._shape[1], -1)
        finer = (self._columns @ across).reshape(width, height, 2)
        result = np.empty((height * width, 2))
        result[self._grid.T.ravel()] = finer.reshape(-1, 2)
        return result
