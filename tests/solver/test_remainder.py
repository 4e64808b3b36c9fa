"""What is still to be relaxed: bounded for a geometric tail, and left aside where tolerances are stricter than by default."""

from __future__ import annotations

import numpy as np

from warpflat.solver.options import RelaxOptions
from warpflat.solver.remainder import Remainder, RemainderEstimate


def test_the_tail_of_a_geometric_descent_is_bounded_and_a_shift_as_a_whole_is_none():
    estimate, ratio = RemainderEstimate(np.arange(3)), 0.9
    corner = np.array([[1.0, 0.0], [0.0, 0.0], [-1.0, 0.0], [5.0, 5.0]])
    left = Remainder()
    for number in range(20):
        way = 1e-3 * ratio**number
        left = estimate.add(1.0 + way**2, corner * [1.0 + way, 1.0] + [0.0, number])
        assert np.isfinite(left.outline_mm) == (number >= 6)
    assert 1e3 * way <= left.outline_mm <= 10.0 * 1e3 * way
    assert left.energy_share >= way**2
    assert left.energy_share == 1e-4


def test_stricter_tolerances_are_met_whatever_is_estimated():
    little = Remainder(energy_share=5e-4, outline_mm=0.1)
    assert little.is_small(RelaxOptions())
    assert not little.is_small(RelaxOptions(outline_left_mm=0.05))
    assert not little.is_small(RelaxOptions(energy_left=0.0))
    assert not little.is_small(RelaxOptions(residual_tolerance=1e-4))
    assert not little.is_small(RelaxOptions(energy_tolerance=1e-9))
