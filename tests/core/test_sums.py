"""Sums on one core: those of NumPy. And the rounding noise of the suite."""

from __future__ import annotations

import numpy as np
import pytest
from rounding import NOISE, RoundingNoise
from scipy.sparse import eye_array
from scipy.sparse.linalg import splu

from warpflat.core.sums import dot, range_offsets


@pytest.mark.parametrize("count", [0, 1, 511, 5000])
def test_a_scalar_product_is_that_of_numpy(count: int) -> None:
    a, b = np.random.default_rng(count).normal(size=(2, count))
    assert dot(a, b) == pytest.approx(float(a @ b), abs=1e-11)


def test_ranges_begin_where_those_before_end() -> None:
    assert range_offsets([2, 0, 3]).tolist() == [0, 2, 2, 5]
    assert range_offsets([]).tolist() == [0]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rounding_noise_is_small_repeats_and_leaves_whole_numbers(dtype: type[np.floating]) -> None:
    values = np.random.default_rng(0).normal(size=(100, 20)).astype(dtype)
    once, again, other = (RoundingNoise(seed).of_array(values) for seed in (1, 1, 2))
    np.testing.assert_array_equal(once, again)
    assert once.dtype == dtype
    assert (once != other).any(axis=1).all()
    size = np.std((once / values - 1.0).astype(np.float64)) * np.finfo(np.float64).eps / np.finfo(dtype).eps
    assert size == pytest.approx(NOISE, rel=0.1)
    whole = np.array([-3.0, 0.0, 7.0, np.inf], dtype=dtype)
    np.testing.assert_array_equal(RoundingNoise(1).of_array(whole), whole)


def test_rounding_noise_comes_with_solves_and_reductions() -> None:
    noise, right = RoundingNoise(1), np.random.default_rng(0).normal(size=(50, 2))
    answers = {
        "factor": noise.after(splu)(eye_array(50, format="csc")).solve(right),
        "tuple": noise.after(np.linalg.lstsq)(np.eye(50), right, rcond=None)[0],
        "named": noise.after(np.linalg.svd)(right, full_matrices=False).U,
        "sum": np.array([noise.after(np.sum)(right)]),
        "out": noise.after(np.einsum)("ij,kj->ik", right, right, out=np.empty((50, 50))),
    }
    undisturbed = {
        "factor": right,
        "tuple": right,
        "named": np.linalg.svd(right, full_matrices=False)[0],
        "sum": right.sum(),
        "out": np.einsum("ij,kj->ik", right, right),
    }
    for name, answer in answers.items():
        assert (answer != undisturbed[name]).any(), name
        np.testing.assert_allclose(answer, undisturbed[name], rtol=1e-12, err_msg=name)
