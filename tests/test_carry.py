"""Layouts carried up from a coarser grid: cubics are kept, whatever the numbers of rows and columns."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.carry import GridCarry, cubics_between


def every_second(count: int) -> np.ndarray:
    keep = np.arange(0, count, 2)
    return (keep if keep[-1] == count - 1 else np.append(keep, count - 1)).astype(np.int32)


@pytest.mark.parametrize("count", [5, 6, 7, 8, 12, 33])
def test_cubics_are_kept(count: int) -> None:
    keep = every_second(count)
    degree = min(3, len(keep) - 1)
    at = np.arange(count) / count
    values = np.polynomial.polynomial.polyval(at, [0.3, -1.0, 2.0, 1.5][: degree + 1])
    carried = cubics_between(count, keep) @ values[keep]
    np.testing.assert_allclose(carried, values, atol=1e-13)


def test_kept_values_stay_what_they_are() -> None:
    keep = every_second(12)
    values = np.random.default_rng(1).normal(size=len(keep))
    assert np.array_equal((cubics_between(12, keep) @ values)[keep], values)


def test_a_smooth_layout_comes_back_sixteen_times_as_well_from_twice_as_many() -> None:
    errors = []
    for count in (17, 33, 65):
        u, v = np.meshgrid(np.linspace(0.0, 1.0, count), np.linspace(0.0, 2.0, count + 4))
        layout = np.stack([u + 0.1 * np.sin(3.0 * v), v + 0.1 * np.cos(2.0 * u + v)], axis=-1)
        grid = np.arange(layout[..., 0].size, dtype=np.int32).reshape(layout.shape[:2])
        rows, columns = every_second(count + 4), every_second(count)
        carried = GridCarry(grid, rows, columns)(layout[np.ix_(rows, columns)].reshape(-1, 2))
        errors.append(np.abs(carried - layout.reshape(-1, 2)).max())
    assert errors[0] / errors[1] > 11
    assert errors[1] / errors[2] > 11


def test_any_numbering_of_the_grid() -> None:
    rng = np.random.default_rng(2)
    grid = rng.permutation(9 * 12).reshape(9, 12).astype(np.int32)
    rows, columns = every_second(9), every_second(12)
    layout = np.empty((grid.size, 2))
    place = np.stack(np.meshgrid(np.arange(9.0), np.arange(12.0), indexing="ij"), axis=-1)
    layout[grid] = place
    carried = GridCarry(grid, rows, columns)(layout[grid[np.ix_(rows, columns)]].reshape(-1, 2))
    np.testing.assert_allclose(carried, layout, atol=1e-12)
