"""Lengths, points and nearest points of polylines, on a unit square and on segments of no length."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.core.polyline import (
    arc_lengths,
    nearest_on_polyline,
    points_at_lengths,
    polyline_length,
    project_on_segments,
    resample,
    segment_lengths,
    turning_angles,
)

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def test_lengths_of_a_square_open_and_closed() -> None:
    assert segment_lengths(SQUARE).tolist() == [1.0, 1.0, 1.0]
    assert arc_lengths(SQUARE).tolist() == [0.0, 1.0, 2.0, 3.0]
    assert arc_lengths(SQUARE, closed=True).tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert polyline_length(SQUARE) == 3.0
    assert polyline_length(SQUARE, closed=True) == 4.0
    assert polyline_length(SQUARE[:1]) == 0.0


def test_points_at_lengths_stop_at_the_ends() -> None:
    assert points_at_lengths(SQUARE, 1.25).tolist() == [1.0, 0.25]
    assert points_at_lengths(SQUARE, [-1.0, 2.5, 9.0]).tolist() == [[0.0, 0.0], [0.5, 1.0], [0.0, 1.0]]


def test_shares_run_on_around_a_closed_polyline() -> None:
    assert resample(SQUARE, 0.5).tolist() == [1.0, 0.5]
    assert resample(SQUARE, [-0.1, 1.1]).tolist() == SQUARE[[0, -1]].tolist()
    assert resample(SQUARE, np.array([0.125, 0.875, 1.125]), closed=True) == pytest.approx(
        np.array([[0.5, 0.0], [0.0, 0.5], [0.5, 0.0]])
    )


def test_a_polyline_of_no_length_has_one_point_at_every_share() -> None:
    assert resample(np.zeros((3, 3)), np.array([0.0, 0.7])).tolist() == [[0.0] * 3] * 2
    assert resample(np.zeros((3, 2)), 0.7).tolist() == [0.0, 0.0]


def test_turns_to_the_left_are_positive() -> None:
    assert turning_angles(SQUARE) == pytest.approx(np.full(2, np.pi / 2))
    assert turning_angles(SQUARE[::-1]) == pytest.approx(np.full(2, -np.pi / 2))


def test_the_nearest_point_lies_inside_a_segment_or_at_an_end() -> None:
    share, distance = project_on_segments(np.array([0.25, 0.5]), SQUARE[:-1], SQUARE[1:])
    assert share == pytest.approx([0.25, 0.5, 0.75])
    assert distance == pytest.approx([0.5, 0.75, 0.5])
    assert nearest_on_polyline(np.array([2.0, -1.0]), SQUARE).tolist() == [1.0, 0.0]
    assert nearest_on_polyline(np.array([2.0, -1.0]), SQUARE[:1]).tolist() == [0.0, 0.0]


def test_a_segment_of_no_length_is_its_start() -> None:
    share, distance = project_on_segments(np.array([3.0, 4.0]), np.zeros((1, 2)), np.zeros((1, 2)))
    assert share.tolist() == [0.0]
    assert distance.tolist() == [5.0]
