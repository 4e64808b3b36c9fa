"""The map from a pattern to a surface."""

from __future__ import annotations

import numpy as np

from warpflat.garment.draping.lift import moved_lift, surface_lift


def test_a_place_of_the_pattern_is_the_same_share_of_its_triangle_and_goes_with_a_surface_that_is_moved() -> None:
    flat = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    lift = surface_lift(np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [0.0, 2.0, 3.0]]), flat, np.array([[0, 1, 2]]))
    np.testing.assert_allclose(lift(np.array([[0.25, 0.5]])), [[0.5, 1.0, 2.0]], atol=1e-12)
    quarter = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    moved = moved_lift(lift, quarter, np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(moved(np.array([[0.25, 0.5]])), [[0.0, 2.5, 5.0]], atol=1e-12)
