"""Factors of sparse symmetric matrices."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.core.sparse import factor_symmetric


@pytest.mark.parametrize("shape", [(40,), (40, 2), (40, 3)])
def test_a_factor_solves_and_its_solution_lies_row_by_row(shape: tuple[int, ...]):
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(60, 40)) * (rng.uniform(size=(60, 40)) < 0.1)
    matrix = rows.T @ rows + 0.1 * np.eye(40)
    right = rng.normal(size=shape)
    found = factor_symmetric(matrix)(np.asfortranarray(right))
    np.testing.assert_allclose(matrix @ found, right, atol=1e-11)
    assert found.flags.c_contiguous
