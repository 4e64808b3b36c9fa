"""Cubics along rows, against NumPy's polynomials; and the numbering of quads by rows and columns."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from devices import DEVICE
from warpflat.kernels.cubic_interpolation import interpolate_along, interpolate_along_rows, weigh_cubics
from warpflat.kernels.grid_lists import number_faces

from warpflat.core.launch import launch_each


def weights_of(place: np.ndarray, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    count = len(place)
    vertices = np.column_stack([place, np.zeros((count, 2))])
    before = np.arange(-1, count - 1, dtype=np.int32)
    after = np.append(np.arange(1, count), -1).astype(np.int32)
    column, weight = np.empty((count, 4), dtype=np.int32), np.empty((count, 4))
    launch_each(weigh_cubics, count, [vertices, before, after, kept.astype(np.int32)], [column, weight])
    return column, weight


@pytest.mark.parametrize("nodes", [[0, 9], [0, 4, 9], [0, 3, 5, 9], [0, 2, 4, 6, 9]])
def test_weights_are_those_of_the_polynomial_through_the_nearest(nodes: list[int]) -> None:
    place = np.cumsum(np.random.default_rng(len(nodes)).uniform(0.5, 2.0, 10))
    kept = np.isin(np.arange(10), nodes)
    column, weight = weights_of(place, kept)
    for v in range(10):
        if kept[v]:
            np.testing.assert_array_equal(column[v], v)
            np.testing.assert_array_equal(weight[v], [1.0, 0.0, 0.0, 0.0])
            continue
        behind = [n for n in nodes if n < v]
        begin = min(max(len(behind) - 2, 0), max(len(nodes) - 4, 0))
        near = nodes[begin : begin + 4]
        assert set(column[v][: len(near)]) == set(near)
        powers = np.vander(place[near] - place[v], increasing=True)
        expected = dict(zip(near, np.linalg.inv(powers)[0], strict=True))
        for c, w in zip(column[v][: len(near)].tolist(), weight[v], strict=False):
            assert w == pytest.approx(expected[c], abs=1e-12)
        np.testing.assert_array_equal(weight[v][len(near) :], 0.0)


def test_weights_of_vertices_at_one_place_are_numbers() -> None:
    place = np.array([0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 3.0, 4.0])
    _, weight = weights_of(place, np.isin(np.arange(8), [0, 2, 4, 7]))
    assert np.isfinite(weight).all()
    np.testing.assert_allclose(weight.sum(axis=1), 1.0, atol=1e-6)


def test_values_are_summed_by_weight() -> None:
    rng = np.random.default_rng(0)
    column, weight, values = (
        rng.integers(50, size=(50, 4)).astype(np.int32),
        rng.normal(size=(50, 4)),
        rng.normal(size=(50, 2)),
    )
    result = np.empty((50, 2))
    launch_each(interpolate_along, 50, [column, weight, values], [result])
    np.testing.assert_allclose(result, np.einsum("ik,ikj->ij", weight, values[column]), atol=1e-14)


def test_faces_are_numbered_from_side_to_side() -> None:
    """Two quads beside one another, the second turned by a quarter, and a third that no way leads to."""
    twin = np.full(12, -1, dtype=np.int32)
    # The right side of the first is side 2 of the second.
    twin[1], twin[6] = 6, 1
    place, queue = wp.empty(3, dtype=wp.vec3i, device=DEVICE), wp.empty(3, dtype=wp.int32, device=DEVICE)
    wp.launch(number_faces, dim=1, inputs=[wp.array(twin, device=DEVICE)], outputs=[place, queue], device=DEVICE)
    # Side 2 of the second lies to the left, side 3 in the first one's sense: turned by one.
    np.testing.assert_array_equal(place.numpy()[:2], [[0, 0, 0], [0, 1, 1]])
    assert place.numpy()[2, 2] == -1


def test_values_along_the_rows_of_a_grid_are_summed_by_weight() -> None:
    rng = np.random.default_rng(3)
    grid = rng.permutation(5 * 7).reshape(5, 7).astype(np.int32)
    values, column = rng.normal(size=(5, 4, 2)), rng.integers(4, size=(7, 3)).astype(np.int32)
    weight, result = rng.normal(size=(7, 3)), np.empty((35, 2))
    launch_each(interpolate_along_rows, 35, [values, grid, column, weight], [result])
    expected = np.einsum("jk,ijkd->ijd", weight, values[:, column])
    np.testing.assert_allclose(result[grid], expected, rtol=1e-13)
