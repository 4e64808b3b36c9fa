"""Layouts carried up from a coarser grid: cubics are kept, wherever the rows and columns lie."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.solver.multigrid.cubic_interpolation import GridProlongation, cubic_interpolation_between, row_places


def every_second(count: int) -> np.ndarray:
    return np.append(np.arange(0, count - 3 + count % 2, 2), count - 1).astype(np.int32)


def in_space(across: np.ndarray, up: np.ndarray) -> np.ndarray:
    """A flat grid with its columns and rows at these places, row by row."""
    u, v = np.meshgrid(across, up)
    return np.stack([u, v, np.zeros_like(u)], axis=-1)


def grid_carry(vertices: np.ndarray, grid: np.ndarray, lines: tuple[np.ndarray, np.ndarray]) -> GridProlongation:
    return GridProlongation(grid, [row_places(vertices, of) for of in (grid, grid.T)], lines)


@pytest.mark.parametrize("even", [True, False], ids=["even", "uneven"])
@pytest.mark.parametrize("count", [5, 6, 7, 8, 12, 33])
def test_cubics_are_kept(count: int, even: bool) -> None:
    keep = every_second(count)
    degree = min(3, len(keep) - 1)
    steps = np.ones(count - 1) if even else np.random.default_rng(count).uniform(0.5, 2.0, count - 1)
    place = np.append(0.0, np.cumsum(steps)) / count
    values = np.polynomial.polynomial.polyval(place, [0.3, -1.0, 2.0, 1.5][: degree + 1])
    carried = cubic_interpolation_between(place[keep], place)(values[keep])
    np.testing.assert_allclose(carried, values, atol=1e-12)


def test_kept_values_stay_what_they_are() -> None:
    keep = every_second(12)
    values = np.random.default_rng(1).normal(size=len(keep))
    assert np.array_equal(cubic_interpolation_between(1.0 * keep, np.arange(12.0))(values)[keep], values)


@pytest.mark.parametrize("count", [(17, 33, 65), (16, 32, 64)])
def test_a_smooth_layout_comes_back_sixteen_times_as_well_from_twice_as_many(count: tuple[int, int, int]) -> None:
    errors = []
    for side in count:
        space = in_space(np.linspace(0.0, 1.0, side), np.linspace(0.0, 2.0, side + 4))
        u, v = space[..., 0], space[..., 1]
        layout = np.stack([u + 0.1 * np.sin(3.0 * v), v + 0.1 * np.cos(2.0 * u + v)], axis=-1)
        grid = np.arange(layout[..., 0].size, dtype=np.int32).reshape(layout.shape[:2])
        rows, columns = every_second(side + 4), every_second(side)
        carry = grid_carry(space.reshape(-1, 3), grid, (rows, columns))
        carried = carry(layout[np.ix_(rows, columns)].reshape(-1, 2))
        errors.append(np.abs(carried - layout.reshape(-1, 2)).max())
    assert errors[0] / errors[1] > 10
    assert errors[1] / errors[2] > 10


def test_any_numbering_of_the_grid_and_rows_of_any_width() -> None:
    rng = np.random.default_rng(2)
    grid = rng.permutation(9 * 12).reshape(9, 12).astype(np.int32)
    rows, columns = every_second(9), every_second(12)
    space = in_space(np.cumsum(rng.uniform(0.5, 2.0, 12)), np.cumsum(rng.uniform(0.5, 2.0, 9)))
    vertices, layout = np.empty((grid.size, 3)), np.empty((grid.size, 2))
    vertices[grid], layout[grid] = space, space[..., :2]
    carried = grid_carry(vertices, grid, (rows, columns))(layout[grid[np.ix_(rows, columns)]].reshape(-1, 2))
    np.testing.assert_allclose(carried, layout, atol=1e-12)


def test_rows_at_one_place_are_told_apart_by_number() -> None:
    space = in_space(np.linspace(0.0, 1.0, 7), np.array([0.0, 0.5, 0.5, 1.0, 1.5, 2.0, 2.5]))
    grid = np.arange(49, dtype=np.int32).reshape(7, 7)
    keep = every_second(7)
    carried = grid_carry(space.reshape(-1, 3), grid, (keep, keep))(np.ones((16, 2)))
    np.testing.assert_allclose(carried, 1.0, rtol=1e-12)
