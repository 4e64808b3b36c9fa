"""What is still to be relaxed: bounded for a geometric tail, and left aside where tolerances are stricter than by default."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.stop import Remainder, RemainderEstimate, relative_change


@pytest.mark.parametrize("ratio", [0.7, 0.9, 0.98])
def test_a_geometric_descent_is_bounded_at_any_pace_and_ends_soon_after_little_is_left(ratio: float):
    """Looked back upon over a few iterations, the slow one would seem to be at its end long before it is."""
    estimate, options = RemainderEstimate(np.arange(3)), RelaxOptions()
    corner = np.array([[1.0, 0.0], [0.0, 0.0], [-1.0, 0.0], [5.0, 5.0]])
    left, number, way = Remainder(), 0, np.inf
    while not left.is_small(options):
        way = 0.02 * ratio**number
        # A shift as a whole is no way that is left.
        left = estimate.add(1.0 + 100.0 * way**2, corner * [1.0 + way, 1.0] + [0.0, number], 1.0)
        assert np.isfinite(left.outline_mm) == (number >= 4)
        number += 1
    assert 1e3 * way <= left.outline_mm <= 0.2
    assert 100.0 * way**2 <= left.energy_share
    within = np.log(0.2 / 20.0) / np.log(ratio)
    assert number <= 1.3 * within + 4.0


@pytest.mark.parametrize(("fraction", "known"), [(0.01, False), (0.3, True)])
def test_steps_that_are_cut_short_tell_nothing_until_they_amount_to_a_whole_one(fraction: float, known: bool):
    estimate, corner = RemainderEstimate(np.arange(3)), np.array([[1.0, 0.0], [0.0, 0.0], [-1.0, 0.0]])
    left = [estimate.add(1.0, corner, fraction) for _ in range(8)]
    assert np.isfinite(left[-1].outline_mm) == known


def test_stricter_tolerances_are_met_whatever_is_estimated():
    little = Remainder(energy_share=5e-4, outline_mm=0.1)
    assert little.is_small(RelaxOptions())
    assert not little.is_small(RelaxOptions(outline_left_mm=0.05))
    assert not little.is_small(RelaxOptions(energy_left=0.0))
    assert not little.is_small(RelaxOptions(residual_tolerance=1e-4))
    assert not little.is_small(RelaxOptions(energy_tolerance=1e-9))


def test_equation_11_is_the_relative_change_of_the_energy_per_step():
    """|U(t+h) - U(t)| / U(t) of each of several steps, whatever the sign; infinite before the first energy."""
    energies = np.array([1.66, 1.32, 1.16, 1.18])
    by_hand = np.abs(np.diff(energies)) / energies[1:]
    per_step = [relative_change(before, after) for before, after in pairwise(energies)]
    np.testing.assert_allclose(per_step, by_hand, rtol=1e-12)
    assert relative_change(1.66, 1.16, steps=2) == pytest.approx(0.5 * (1.66 - 1.16) / 1.16, rel=1e-12)
    assert relative_change(np.inf, 1.0) == np.inf
