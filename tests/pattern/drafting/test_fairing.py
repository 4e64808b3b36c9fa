"""Faired lines: without wobble, within their bound, straight where they are to be."""

from typing import Any

import numpy as np
import pytest

from warpflat.core.polyline import turning_angles
from warpflat.pattern.drafting.fairing import FairLine, bend_one_way, count_inflections, fair_lines, fairest_line

ALONG = np.linspace(0.0, 0.3, 61)


def fair_line(points: np.ndarray, wave: float, **options: Any) -> FairLine:
    """Return a line that is faired by one wave."""
    return next(fair_lines(points, [wave], **options))


def wobbly_hip() -> np.ndarray:
    """Return a side seam that is straight below and bent above, with a wobble of 0.6 mm."""
    bend = 1.2 * np.maximum(ALONG - 0.18, 0.0) ** 2
    return np.column_stack([bend + 6e-4 * np.sin(2 * np.pi * ALONG / 0.05), ALONG])


def test_inflections_are_bends_both_ways():
    wave = np.column_stack([ALONG, 0.004 * np.sin(2 * np.pi * ALONG / 0.1)])
    assert count_inflections(wave) == 5
    assert count_inflections(wave * [1.0, 0.001]) == 0
    circle = np.column_stack([np.cos(ALONG * 5), np.sin(ALONG * 5)])
    assert count_inflections(circle) == 0


def test_a_wobble_is_faired_away_within_the_bound():
    line = wobbly_hip()
    assert count_inflections(line) > 4
    faired = fairest_line(line, 0.003)
    assert faired is not None
    assert faired.inflections == 0
    assert faired.shift < 0.0015
    assert fairest_line(line, 1e-5) is None


def test_a_stretch_is_straight_and_a_circle_stays():
    line = wobbly_hip()
    straight = line[:, 1] < 0.15
    faired = fair_line(line, 0.05, straight=straight)
    assert np.abs(turning_angles(faired.points[straight])).max() < 1e-6
    angle = np.linspace(0.0, np.pi / 2, 40)
    circle = 0.1 * np.column_stack([np.cos(angle), np.sin(angle)])
    assert fair_line(circle, 0.08).shift < 2e-4


def test_a_line_goes_through_the_points_that_it_is_to_meet():
    # A bust: the line turns within a few centimetres, and girths are measured there and below.
    bust = np.column_stack([0.03 * np.exp(-(((ALONG - 0.15) / 0.03) ** 2)), ALONG])
    met = np.isin(np.arange(len(ALONG)), (10, 30, 38))
    # Places are within half a step of the line from where these points lie.
    faired, free = fair_line(bust, 0.15, met=met), fair_line(bust, 0.15)
    away = [np.linalg.norm(line.points[met] - bust[met], axis=1).max() for line in (faired, free)]
    assert away[0] < 1e-3
    assert away[1] > 3e-3
    assert fair_line(bust, 0.15, met=np.zeros(len(bust), dtype=bool)).points == pytest.approx(free.points)
    one_way = np.column_stack([0.3 * np.maximum(ALONG - 0.15, 0.0), ALONG])
    bent = [bend_one_way(one_way, 0.3, met=these) for these in (np.arange(len(ALONG)) == 30, None)]
    assert bent[0] is not None
    assert bent[1] is not None
    assert np.linalg.norm(bent[0].points[30] - one_way[30]) < 1e-3 < np.linalg.norm(bent[1].points[30] - one_way[30])


def test_a_line_meets_the_fold_squarely():
    across = np.linspace(0.0, 0.2, 40)
    neck = np.column_stack([across, 0.3 * across + 2.0 * across**2])
    first = np.diff(fair_line(neck, 0.2, mirrored=(True, False)).points[:2], axis=0)[0]
    assert abs(np.degrees(np.arctan2(first[1], first[0]))) < 0.35 * np.degrees(np.arctan2(0.3, 1.0))


def test_a_skirt_side_bends_one_way_within_the_bound():
    # Straight below, out to the hip above with a hollow of some 2 mm on the way, and a wobble.
    hollow = -0.09 * np.maximum(ALONG - 0.13, 0.0) - 0.002 * np.sin(
        2 * np.pi * np.clip((ALONG - 0.13) / 0.17, 0.0, 1.0)
    )
    side = np.column_stack([hollow, ALONG])
    straight = ALONG < 0.13
    bent = fairest_line(side, 0.003, straight=straight)
    assert bent is not None
    assert bent.inflections > 0
    drawn = fairest_line(side, 0.003, straight=straight, one_way=True)
    assert drawn is not None
    assert drawn.inflections == 0
    assert drawn.shift <= 0.003
    assert np.abs(turning_angles(drawn.points[straight])).max() < 1e-6


def test_a_gentle_line_turns_a_corner_in_a_curve_within_the_bound():
    # A hip corner: 18 degrees within 3 cm, as over the hip of a pear.
    side = np.column_stack([-0.315 * np.maximum(ALONG - 0.15, 0.0), ALONG])
    side[:, 0] = np.interp(ALONG, ALONG[::4], side[::4, 0])
    plain, gentle = fairest_line(side, 0.003), fairest_line(side, 0.003, gentle=True)
    assert plain is not None
    assert gentle is not None
    assert gentle.turn < 0.6 * plain.turn
    assert gentle.shift <= 0.003
    assert gentle.inflections == 0


def test_the_waist_of_a_dress_is_no_wobble():
    # In at the waist by 12 mm: a line that bends one way would lie 2.3 mm off.
    side = np.column_stack([-0.006 * np.cos(2 * np.pi * ALONG / 0.3) + 3e-4 * np.sin(2 * np.pi * ALONG / 0.03), ALONG])
    drawn = fairest_line(side, 0.003)
    assert drawn is not None
    assert drawn.inflections == 2
    assert drawn.shift < 0.001


def test_a_loop_is_no_graph():
    angle = np.linspace(0.0, 5.0, 60)
    assert bend_one_way(0.1 * np.column_stack([np.cos(angle), np.sin(angle)]), 0.05) is None
