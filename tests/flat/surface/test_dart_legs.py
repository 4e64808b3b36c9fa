"""Legs of darts that end short of their crack."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.flat.surface.cut.dart_legs import are_curved, pull_back


def arc(start, end, bulge, count=41):
    share = np.linspace(0, 1, count)[:, None]
    start, end = np.array(start, dtype=float), np.array(end, dtype=float)
    across = np.array([start[1] - end[1], end[0] - start[0]])
    return start + share * (end - start) + 4 * bulge * share * (1 - share) * across


def length(line):
    return np.linalg.norm(np.diff(line, axis=0), axis=1).sum()


@pytest.mark.parametrize(("right_end", "bulge"), [((0.05, 0.0), 0.0), ((0.05, 0.0), 0.08), ((0.06, 0.02), 0.1)])
@pytest.mark.parametrize("tip_back", [0.0, 0.02, 0.1])
def test_legs_end_short_of_the_tip_and_keep_their_ends_their_shape_and_the_ratio_of_their_lengths(
    right_end, bulge, tip_back
):
    tip = (0.01, 0.25)
    left, right = arc((-0.05, 0.0), tip, bulge), arc(right_end, tip, -bulge)
    new_left, new_right = pull_back(left, right, tip_back)
    assert np.array_equal(new_left[-1], new_right[-1])
    assert np.linalg.norm(new_left[-1] - tip) == pytest.approx(tip_back, abs=1e-12)
    assert new_left[-1][1] <= tip[1], "towards the border"
    for new, old in ((new_left, left), (new_right, right)):
        assert np.array_equal(new[0], old[0])
    shares = length(new_left) / length(left), length(new_right) / length(right)
    assert shares[0] == pytest.approx(shares[1], rel=1e-12)
    assert are_curved(new_left, new_right) == are_curved(left, right) == (bulge > 0)


def test_a_tip_may_move_as_far_as_the_shorter_leg_reaches_along_the_middle():
    tip = np.array([0.01, 0.25])
    left, right = arc((-0.05, 0.0), tip, 0.0), arc((0.16, 0.12), tip, 0.0)
    ways = [(leg[0] - tip) / np.linalg.norm(leg[0] - tip) for leg in (left, right)]
    middle = sum(ways) / np.linalg.norm(sum(ways))
    most = min(np.linalg.norm(leg[0] - tip) for leg in (left, right)) * (ways[0] @ middle)
    pull_back(left, right, 0.999 * most)
    with pytest.raises(InputError, match="less than the dart's length"):
        pull_back(left, right, 1.001 * most)


@pytest.mark.parametrize("tip_back", [-0.01, 0.3, np.nan])
def test_a_tip_stays_within_its_dart(tip_back):
    left, right = arc((-0.05, 0.0), (0.0, 0.25), 0.0), arc((0.05, 0.0), (0.0, 0.25), 0.0)
    with pytest.raises(InputError, match=r"less than the dart's length, 250\.0 mm"):
        pull_back(left, right, tip_back)
