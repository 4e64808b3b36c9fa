"""How far the cloth around a crack or a hole overlaps itself."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.flat.surface.overlap import overlap_width


def test_a_hole_that_gapes_overlaps_nowhere():
    assert overlap_width(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])) == 0.0


def test_sides_that_cross_overlap_by_the_width_of_what_lies_beyond():
    """They gape up to where they cross, at (1, 0.5); beyond lies a triangle with sides of 0.5 and 0.559 m twice."""
    ring = np.array([[0.0, 0.0], [1.5, 0.75], [1.5, 0.25], [0.0, 1.0]])
    leg = np.hypot(0.5, 0.25)
    inscribed = 0.5 * 0.5 * 0.5 / (0.5 * (0.5 + 2.0 * leg))
    assert overlap_width(ring) == pytest.approx(2.0 * inscribed, rel=1e-2)
    assert overlap_width(ring + np.array([5.0, -3.0])) == pytest.approx(overlap_width(ring), rel=1e-6)
