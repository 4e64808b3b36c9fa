"""Sums over blocks, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from devices import DEVICE
from warpflat.core.device_sums import DeviceSums
from warpflat.kernels.reduce import add_share, dot_blocks, least_of_blocks, subtract, sum_blocks

from warpflat.core.launch import launch_each

BEGIN = np.array([0, 3, 4, 10], dtype=np.int32)


def double(values: np.ndarray) -> wp.array:
    return wp.array(values, dtype=wp.float64, device=DEVICE)


def vec2(values: np.ndarray) -> wp.array:
    return wp.array(values, dtype=wp.vec2d, device=DEVICE)


def test_blocks():
    rng = np.random.default_rng(1)
    values, a, b = rng.normal(size=10), rng.normal(size=(10, 2)), rng.normal(size=(10, 2))
    begin, got = wp.array(BEGIN, dtype=wp.int32, device=DEVICE), double(np.full(3, np.nan))
    for kernel, given, wished in (
        (sum_blocks, [double(values)], np.add.reduceat(values, BEGIN[:-1])),
        (least_of_blocks, [double(values)], np.minimum.reduceat(values, BEGIN[:-1])),
        (dot_blocks, [vec2(a), vec2(b)], np.add.reduceat((a * b).sum(axis=1), BEGIN[:-1])),
    ):
        launch_each(kernel, 3, [*given, begin], [got], device=DEVICE)
        np.testing.assert_allclose(got.numpy(), wished, rtol=1e-14)


def test_vectors():
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(2, 10, 2))
    got = vec2(np.full((10, 2), np.nan))
    launch_each(subtract, 10, [vec2(a), vec2(b)], [got], device=DEVICE)
    np.testing.assert_array_equal(got.numpy(), a - b)
    launch_each(add_share, 10, [0.25, vec2(b)], [got], device=DEVICE)
    np.testing.assert_allclose(got.numpy(), a - b + 0.25 * b, rtol=1e-14, atol=1e-16)


@pytest.mark.parametrize("counts", [[1], [64], [65, 1, 5_000], [300_000]])
def test_sums_of_ranges_of_any_length(counts: list[int]):
    rng = np.random.default_rng(3)
    begin = np.concatenate([[0], np.cumsum(counts)[:-1]])
    values, a, b = rng.normal(size=sum(counts)), *rng.normal(size=(2, sum(counts), 2))
    sums, far, one, other = DeviceSums(counts, wp.get_device(DEVICE)), double(values), vec2(a), vec2(b)
    dots = np.add.reduceat((a * b).sum(axis=1), begin)
    for _ in range(4):  # recorded, and later a graph
        np.testing.assert_allclose(sums.sums(far), np.add.reduceat(values, begin), rtol=1e-11)
        np.testing.assert_array_equal(sums.least(far), np.minimum.reduceat(values, begin))
        np.testing.assert_allclose(sums.dots(one, other), dots, rtol=1e-11)
