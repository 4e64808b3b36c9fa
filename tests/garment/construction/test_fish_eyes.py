"""Fish-eye darts whose tips end short of their crack's."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.garment.construction.darts import pull_back_eye


def sides():
    """Both sides of an eye 0.25 m long, the left one first."""
    share = np.linspace(0, 1, 41)
    bulge = 0.1 * share * (1 - share)
    return np.column_stack([-bulge, 0.25 * share]), np.column_stack([bulge, 0.25 * share])


@pytest.mark.parametrize("tip_back", [-0.01, 0.3, np.nan])
def test_a_tip_stays_within_its_half(tip_back: float):
    with pytest.raises(InputError, match=r"less than the shorter half, 125\.0 mm"):
        pull_back_eye(*sides(), 20, tip_back)


def test_a_fish_eye_keeps_its_width_and_its_sides_their_symmetry():
    left, right = sides()
    new_left, new_right = pull_back_eye(left, right, 20, 0.03)
    np.testing.assert_allclose(new_left[[0, -1]], [(0, 0.03), (0, 0.22)], atol=1e-12)
    np.testing.assert_allclose(new_left[20], left[20], atol=1e-12)
    np.testing.assert_allclose(new_left, new_right * [-1, 1], atol=1e-12)
