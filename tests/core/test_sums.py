"""Sums on one core: those of NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.core.sums import dot, products, weighted_rows


@pytest.mark.parametrize("count", [0, 1, 511, 512, 513, 5000])
def test_sums_are_those_of_matrix_products(count: int) -> None:
    rng = np.random.default_rng(count)
    a, b, weight = rng.normal(size=(9, count)), rng.normal(size=(4, count)), rng.normal(size=9)
    np.testing.assert_allclose(products(a, b), a @ b.T, atol=1e-11)
    total = np.full(count, np.nan)
    weighted_rows(weight, a, total)
    np.testing.assert_allclose(total, weight @ a, atol=1e-13)
    assert dot(a[0], b[0]) == pytest.approx(float(a[0] @ b[0]), abs=1e-11)
    # Rows that are not in one piece, as of vectors seen as complex numbers.
    np.testing.assert_allclose(products(a[:, ::2], b[:, ::2]), a[:, ::2] @ b[:, ::2].T, atol=1e-11)
