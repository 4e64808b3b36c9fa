"""Shortest ways over triangles, against the best of many places on every side; on the CPU, where the search is done."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from warpflat.kernels.geodesic import CROWD, carry_along, find_ways, go_around, see_sides

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

# Two rows of triangles, some of them obtuse, bent along the middle; vertices are numbered about as far as they are from 0 and 1.
VERTICES = np.array(
    [
        [0, 0, 0],
        [1, 0, 0],
        [0.1, 1, 0],
        [1.3, 0.9, 0],
        [2.4, 0.3, 0],
        [-0.2, 1.8, 0.5],
        [1.1, 1.7, 0.6],
        [2.6, 1.6, 0.4],
    ],
    dtype=np.float64,
)
TRIANGLES = np.array([[0, 1, 2], [1, 3, 2], [1, 4, 3], [2, 3, 6], [2, 6, 5], [3, 4, 7], [3, 7, 6]], dtype=np.int32)


def corners() -> tuple[IntArray, IntArray]:
    """Offset and slot: each vertex's corners."""
    slot = np.argsort(TRIANGLES.ravel(), kind="stable").astype(np.int32)
    return np.append(0, np.cumsum(np.bincount(TRIANGLES.ravel()))).astype(np.int32), slot


def sides() -> tuple[IntArray, FloatArray]:
    _, slot = corners()
    ends, seen = np.zeros((len(slot), 2), dtype=np.int32), np.zeros((len(slot), 3))
    for first, last in ((0, 10), (10, len(slot))):
        wp.launch(
            see_sides, dim=last - first, inputs=[VERTICES, TRIANGLES, slot, first], outputs=[ends, seen], device="cpu"
        )
    return ends, seen


def ways_from(
    start: FloatArray, ends_at: list[int], *, reach: int = 100, at_once: int = 10**6
) -> tuple[FloatArray, list[NDArray], int]:
    """Distances, ways (first, second, share, leg) and the number of launches that it took."""
    offset, _ = corners()
    count = len(VERTICES)
    distance, waiting = start.copy(), np.ones(count, dtype=np.int32)
    waiting[ends_at] = 2
    crowd = np.array([np.count_nonzero(waiting[at : at + CROWD] == 1) for at in range(0, count, CROWD)], dtype=np.int32)
    index = np.arange(count, dtype=np.int32)
    ways = [index.copy(), index.copy(), np.zeros(count), np.zeros(count)]
    shortened, launches = np.ones(1, dtype=np.int32), 0
    while shortened[0]:
        shortened[0] = 0
        launches += 1
        wp.launch(
            find_ways,
            dim=1,
            inputs=[offset, *sides(), reach, at_once, 1e-14],
            outputs=[distance, waiting, crowd, *ways, shortened],
            device="cpu",
        )
    return distance, ways, launches


def upper_bounds() -> FloatArray:
    """Far too long, but finite."""
    start = np.full(len(VERTICES), 50.0)
    start[:2] = 0.0
    return start


def test_corners_see_the_opposite_side():
    ends, seen = sides()
    _, slot = corners()
    for (a, b), (length, foot, height), s in zip(ends, seen, slot, strict=True):
        triangle = np.roll(TRIANGLES[s // 3], -(s % 3))
        assert [a, b] == triangle[1:].tolist()
        side = (VERTICES[b] - VERTICES[a]) / np.linalg.norm(VERTICES[b] - VERTICES[a])
        away = VERTICES[triangle[0]] - VERTICES[a]
        assert length == pytest.approx(np.linalg.norm(VERTICES[b] - VERTICES[a]), rel=1e-12)
        assert foot == pytest.approx(away @ side, abs=1e-12)
        assert height == pytest.approx(np.linalg.norm(away - (away @ side) * side), rel=1e-12)


@pytest.mark.parametrize(("reach", "at_once"), [(0, 10**6), (100, 10**6), (100, 3)])
def test_every_way_is_the_best_over_all_sides_around(reach: int, at_once: int):
    distance, (first, second, share, leg), _ = ways_from(upper_bounds(), [0, 1], reach=reach, at_once=at_once)
    assert distance[:2].tolist() == [0.0, 0.0]
    places = np.linspace(0.0, 1.0, 20001)[:, None]
    for v in range(2, len(VERTICES)):
        best = np.inf
        for triangle in TRIANGLES[np.isin(TRIANGLES, v).any(axis=1)]:
            a, b = triangle[triangle != v]
            points = VERTICES[a] + places * (VERTICES[b] - VERTICES[a])
            there = distance[a] + places[:, 0] * (distance[b] - distance[a])
            best = min(best, float((there + np.linalg.norm(points - VERTICES[v], axis=1)).min()))
        assert distance[v] == pytest.approx(best, abs=1e-8)
        a, b = first[v], second[v]
        assert distance[v] == pytest.approx(distance[a] + share[v] * (distance[b] - distance[a]) + leg[v], abs=1e-12)
        place = VERTICES[a] + share[v] * (VERTICES[b] - VERTICES[a])
        assert leg[v] == pytest.approx(np.linalg.norm(place - VERTICES[v]), abs=1e-12)


def test_who_looks_again_at_once_needs_fewer_launches():
    """From the far end of the numbering every vertex is reached after those that come later."""
    start = np.full(len(VERTICES), 50.0)
    start[-1] = 0.0
    at_once, later = (ways_from(start, [len(VERTICES) - 1], reach=reach) for reach in (100, 0))
    np.testing.assert_allclose(at_once[0], later[0], rtol=1e-12)
    assert at_once[2] == 2
    assert later[2] > 2


def test_what_cannot_be_reached_has_no_way():
    start = np.full(len(VERTICES), np.inf)
    distance, (first, *_), _ = ways_from(start, [])
    assert np.isinf(distance).all()
    assert first.tolist() == list(range(len(VERTICES)))


def test_values_are_carried_along_the_ways():
    distance, ways, _ = ways_from(upper_bounds(), [0, 1])
    order = np.arange(len(VERTICES), dtype=np.int32)
    fixed = np.zeros(len(VERTICES), dtype=np.int32)
    fixed[:2] = 1

    def carried(value: FloatArray, grows: float) -> FloatArray:
        for _ in range(20):
            change = np.zeros(value.shape[1])
            wp.launch(carry_along, dim=1, inputs=[*ways, order, fixed, grows], outputs=[value, change], device="cpu")
            if not change.any():
                return value
        raise AssertionError("still changing")

    np.testing.assert_allclose(carried(np.zeros((8, 1)), 1.0)[:, 0], distance, rtol=1e-12)
    start = np.zeros((8, 2))
    start[:2] = [[3.0, 1.0], [5.0, 1.0]]
    both = carried(start, 0.0)
    np.testing.assert_allclose(both[:, 1], 1.0, rtol=1e-12)
    assert both[:2, 0].tolist() == [3.0, 5.0]
    first, second, share, _ = ways
    np.testing.assert_allclose(both[2:, 0], ((1 - share) * both[first, 0] + share * both[second, 0])[2:], rtol=1e-12)
    assert 3.5 < both[6, 0] < 4.9


def around_the_middle(turns: list[float], *, closed: bool) -> list[tuple[int, int, float, float, float]]:
    """What is visited around vertex 0 on the line 5, 0, 2, and from which place of the line: vertices 1 to 6 lie around it
    anticlockwise, with these angles between them, k m away, the last angle from 6 to 1 only if it is closed."""
    count = 6 if closed else 5
    sides = np.array([[k + 1, (k + 1) % 6 + 1] for k in range(count)], dtype=np.int32)
    path, offset = np.array([5, 0, 2], dtype=np.int32), np.array([0, 0, count, count], dtype=np.int32)
    on_path = np.isin(np.arange(7), path).astype(np.int8)
    visited, at, lies = np.zeros(24, dtype=np.int32), np.zeros(24, dtype=np.int32), np.zeros((24, 3))
    number = np.zeros(1, dtype=np.int32)
    wp.launch(
        go_around,
        dim=1,
        inputs=[path, on_path, offset, sides, np.array(turns[:count]), sides.astype(np.float64)],
        outputs=[visited, at, lies, number],
        device="cpu",
    )
    count = number[0]
    return [(v, a, *row) for v, a, row in zip(*(each[:count].tolist() for each in (visited, at, lies)), strict=True)]


def test_vertices_beside_a_line_are_right_or_left_of_it_by_the_angles_between() -> None:
    turns = [0.5, 0.25, 1.0, 0.75, 0.5, 1.0]
    full = 2 * np.pi / sum(turns)
    expected = [
        # From 5 on, anticlockwise until 2, which is on the line, and clockwise.
        *[(6, 1, 1.0, 0.5 * full, 6.0), (1, 1, 1.0, 1.5 * full, 1.0)],
        *[(4, 1, -1.0, 0.75 * full, 4.0), (3, 1, -1.0, 1.75 * full, 3.0)],
        # From 2 on.
        *[(3, 1, -1.0, 0.25 * full, 3.0), (4, 1, -1.0, 1.25 * full, 4.0)],
        *[(1, 1, 1.0, 0.5 * full, 1.0), (6, 1, 1.0, 1.5 * full, 6.0)],
    ]
    np.testing.assert_allclose(around_the_middle(turns, closed=True), expected, rtol=1e-12)


def test_what_lies_beyond_a_border_or_half_a_turn_is_not_beside_a_line() -> None:
    seen = around_the_middle([0.5, 2.0, 2.0, 0.75, 0.5, 0.0], closed=False)
    assert seen == [
        # On the left 4 is more than half a turn away from 2; on the right both are the last before the border.
        (6, 1, 1.0, 0.5, 6.0),
        (4, 1, -1.0, 0.75, 4.0),
        (3, 1, -1.0, 2.75, 3.0),
        (3, 1, -1.0, 2.0, 3.0),
        (1, 1, 1.0, 0.5, 1.0),
    ]
