"""Borders as curves: mirror images alike."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.pattern.curves import fit_curve


def bent(count: int = 24) -> np.ndarray:
    """#P by 2 [m], a side seam that bends one way below the arm and the other way above the waist, with turns of 50 degrees."""
    share = np.linspace(0.0, 1.0, count)
    return np.column_stack([0.03 * np.sin(2 * np.pi * share**1.3), -0.2 * share])


@pytest.mark.parametrize("tolerance", [1e-4, 1e-3])
def test_a_mirror_image_that_runs_the_other_way_has_the_same_curve(tolerance: float):
    line = bent()
    curve = fit_curve(line, tolerance)
    mirrored = fit_curve(line[::-1] * [-1, 1], tolerance).reversed()
    np.testing.assert_allclose(mirrored.bezier * [-1, 1], curve.bezier, atol=1e-9)
