"""Offsets of equations that hold together grow until their sums are zero."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.core.arrays import FloatArray
from warpflat.garment.construction.constraint_equations import Correction, join_equations, seam_equations


@pytest.mark.parametrize("seed", range(4))
def test_eased_seams_that_push_each_other_settle_in_a_few_rounds(seed: int) -> None:
    random, count = np.random.default_rng(seed), 12
    # Residuals of a quadratic energy: each seam's offset moves the others', by up to some two thirds of what it moves its own.
    factor = random.normal(size=(count, count))
    response = np.eye(count) + 0.6 * factor @ factor.T / count
    response *= 0.95 / np.linalg.eigvalsh(response)[-1]
    unsewn = 1e-3 * random.normal(size=count)
    equations = join_equations([seam_equations(np.arange(3), np.arange(3) + 5, eased=True) for _ in range(count)])
    correction, offset, rounds = Correction(equations), np.zeros(len(equations)), 0

    def respond(growth: FloatArray) -> FloatArray:
        return np.repeat(-0.8 * response @ growth[::2], 2, axis=0)

    while True:
        residuals = np.repeat(unsewn - response @ offset[::2], 2)
        if equations.violation(residuals) <= 1.0:
            break
        rounds += 1
        # The stiffness that is factored is a quarter too large.
        assert rounds < 6
        offset = offset + correction(residuals, respond)
