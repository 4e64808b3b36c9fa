"""Sums over blocks, against NumPy."""

from __future__ import annotations

import numpy as np
import warp as wp
from devices import DEVICE
from warpflat.kernels.reduce import subtract, sum_blocks

from warpflat.core.launch import launch_each

BEGIN = np.array([0, 3, 4, 10], dtype=np.int32)


def double(values: np.ndarray) -> wp.array:
    return wp.array(values, dtype=wp.float64, device=DEVICE)


def vec2(values: np.ndarray) -> wp.array:
    return wp.array(values, dtype=wp.vec2d, device=DEVICE)


def test_blocks():
    rng = np.random.default_rng(1)
    values = rng.normal(size=10)
    begin, got = wp.array(BEGIN, dtype=wp.int32, device=DEVICE), double(np.full(3, np.nan))
    launch_each(sum_blocks, 3, [double(values), begin], [got], device=DEVICE)
    np.testing.assert_allclose(got.numpy(), np.add.reduceat(values, BEGIN[:-1]), rtol=1e-12)


def test_differences():
    a, b = np.random.default_rng(2).normal(size=(2, 10, 2))
    got = vec2(np.full((10, 2), np.nan))
    launch_each(subtract, 10, [vec2(a), vec2(b)], [got], device=DEVICE)
    np.testing.assert_array_equal(got.numpy(), a - b)
