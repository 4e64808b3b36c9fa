"""Rows of a grid laid out at their arc lengths, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from warpflat.kernels.grid_lists import lay_profiles

from warpflat.core.launch import launch_each


@pytest.mark.parametrize("column", [0, 3, 6])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_rows_are_laid_out_at_their_arc_lengths_from_a_column(column: int, side: float) -> None:
    random = np.random.default_rng(column)
    rows, columns = 5, 7
    vertices, station = random.normal(size=(rows * columns, 3)), random.normal(size=rows)
    grid = random.permutation(rows * columns).astype(np.int32).reshape(rows, columns)
    position = np.full((rows * columns, 2), np.nan)
    launch_each(lay_profiles, rows, [vertices, grid, column, side, station], [position], least=1)
    steps = np.linalg.norm(np.diff(vertices[grid], axis=1), axis=2)
    arc = np.concatenate([np.zeros((rows, 1)), np.cumsum(steps, axis=1)], axis=1)
    np.testing.assert_allclose(position[grid, 0], side * (arc - arc[:, [column]]), atol=1e-12)
    np.testing.assert_array_equal(position[grid, 1], np.broadcast_to(station[:, None], (rows, columns)))
