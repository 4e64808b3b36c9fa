"""How far out a section reaches within a window, and rows between rows."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.garment.mannequin.sampled import row_at
from warpflat.garment.mannequin.scan_limbs import _outermost


def test_a_point_at_the_windows_end_counts_as_much_inside_as_outside() -> None:
    out, end = np.array([0.100, 0.104, 0.090]), 0.006
    values = [_outermost(out, np.array([0.0, at, -0.001]), end, 0.0) for at in (end - 1e-9, end + 1e-9)]
    assert values[0] == pytest.approx(0.104)
    assert values[1] == pytest.approx(values[0], abs=1e-7)
    # One far outside does not count, and an empty window gives what is said.
    assert _outermost(out, np.array([0.0, 0.02, -0.001]), end, 0.0) == pytest.approx(0.100)
    assert _outermost(out, np.array([0.02, 0.02, 0.02]), end, 0.05) == 0.05


def test_between_two_heights_rows_are_mixed() -> None:
    rows, heights = np.array([[0.0, 2.0], [1.0, 4.0], [5.0, 4.0]]), np.array([0.0, 0.1, 0.3])
    np.testing.assert_allclose(row_at(rows, heights, 0.05), [0.5, 3.0])
    np.testing.assert_allclose(row_at(rows, heights, 0.25), [4.0, 4.0])
    np.testing.assert_allclose(row_at(rows, heights, -1.0), rows[0])
