"""Darts measured and drawn on layouts whose dart is known."""

from __future__ import annotations

import numpy as np
import pytest
from cut_meshes import flat, grid

from warpflat.core.errors import InputError
from warpflat.flat.surface.connectivity import border_loops
from warpflat.flat.surface.cut.cut_mesh import cut_along
from warpflat.flat.surface.cut.dart import dart_measure, fish_eye_measure, shape_dart, shape_fish_eye

N = 11
ANGLE = np.radians(20.0)
TIP = 5 + 6 * N


def dart_layout(*, angle: float = ANGLE, stretch: float = 1.0, upwards: bool = True):
    """A flat sheet of 1 m, cut from the middle of its lower edge 0.6 m upwards and opened by turning about the tip.

    Every point turns by half the angle at the height of the border and above it by less, so the legs stay straight.
    """
    path = [5 + N * row for row in range(7)]
    cut = cut_along(grid(N, N), [path if upwards else path[::-1]], vertex_count=N * N)
    (seam,) = cut.seams
    west, east = (seam.left, seam.right) if upwards else (seam.right, seam.left)
    flat_positions = flat(N, N)[:, :2][cut.vertex_origin]
    tip = flat_positions[TIP]
    side = np.sign(flat_positions[:, 0] - tip[0])
    side[west], side[east] = -1, 1
    side[TIP] = 0
    below = flat_positions[:, 1] < tip[1] - 1e-9
    turn = np.where(below, 0.5 * angle * side, 0.0)
    c, s = np.cos(turn), np.sin(turn)
    offset = flat_positions - tip
    positions = tip + np.column_stack([c * offset[:, 0] - s * offset[:, 1], s * offset[:, 0] + c * offset[:, 1]])
    positions[east[0 if upwards else -1]] = tip + stretch * (positions[east[0 if upwards else -1]] - tip)
    return positions, seam, border_loops(cut.faces)[0]


@pytest.mark.parametrize("upwards", [True, False])
def test_measure_of_a_known_dart(upwards):
    positions, crack, _ = dart_layout(upwards=upwards)
    measure = dart_measure(positions, crack.left, crack.right)
    assert measure.angle == pytest.approx(ANGLE)
    assert measure.left_leg == pytest.approx(0.6)
    assert measure.right_leg == pytest.approx(0.6)
    assert measure.opening == pytest.approx(2 * 0.6 * np.sin(ANGLE / 2))
    assert measure.intake == pytest.approx(measure.opening)


def test_an_overlap_is_negative_and_cannot_be_sewn():
    positions, crack, outline = dart_layout(angle=-0.1)
    measure = dart_measure(positions, crack.left, crack.right)
    assert measure.angle == pytest.approx(-0.1)
    assert measure.intake < 0 < measure.opening
    with pytest.raises(InputError, match=r"vertex 5 overlaps by 60\.0 mm"):
        shape_dart(positions, crack.left, crack.right, outline)


@pytest.mark.parametrize("stretch", [1.0, 1.05, 0.95])
@pytest.mark.parametrize("upwards", [True, False])
@pytest.mark.parametrize("tip_back", [0.0, 0.02, 0.1])
def test_drawn_dart_has_equal_legs_on_the_outline_and_its_tip_moved_back(stretch, upwards, tip_back):
    positions, crack, outline = dart_layout(stretch=stretch, upwards=upwards)
    dart = shape_dart(positions, crack.left, crack.right, outline, tip_back=tip_back)
    legs = [np.linalg.norm(end - dart.tip) for end in (dart.left_end, dart.right_end)]
    assert legs == pytest.approx([dart.leg_length] * 2, rel=1e-12)
    np.testing.assert_allclose(dart.tip, positions[TIP] - [0.0, tip_back], atol=1e-12)
    assert dart.left_end[0] < dart.right_end[0]
    measured = dart_measure(positions, crack.left, crack.right)
    assert dart.intake == pytest.approx(measured.opening, rel=0.02)
    assert dart.angle > measured.angle if tip_back > 0 else dart.angle == pytest.approx(measured.angle)


def test_equal_legs_move_half_the_difference_each():
    positions, crack, outline = dart_layout(stretch=1.05)
    dart = shape_dart(positions, crack.left, crack.right, outline)
    assert dart.leg_length == pytest.approx(0.6 * 1.025)
    for end, side in ((dart.left_end, crack.left), (dart.right_end, crack.right)):
        assert np.linalg.norm(end - positions[side[0]]) == pytest.approx(0.015)


def test_either_direction_of_the_outline_serves():
    positions, crack, outline = dart_layout(stretch=1.05)
    one = shape_dart(positions, crack.left, crack.right, outline, tip_back=0.03)
    two = shape_dart(positions, crack.left, crack.right, outline[::-1], tip_back=0.03)
    np.testing.assert_allclose(one.fold_point, two.fold_point)


@pytest.mark.parametrize("stretch", [1.0, 1.05])
def test_the_folded_dart_ends_at_the_seam(stretch):
    positions, crack, outline = dart_layout(stretch=stretch)
    dart = shape_dart(positions, crack.left, crack.right, outline, tip_back=0.05)
    # Folding mirrors the fold point in the left leg: it must land on the outline beside the dart, which follows the leg's end.
    along = (dart.left_end - dart.tip) / np.linalg.norm(dart.left_end - dart.tip)
    offset = dart.fold_point - dart.tip
    landed = dart.tip + 2 * (offset @ along) * along - offset
    # The vertices beside it are 0.1 m apart, and the outline follows over eight times the shift.
    shift = dart.left_end - positions[crack.left[0]]
    beside = np.array([dart.left_end, *positions[4:1:-1]])
    blend = 8 * float(np.linalg.norm(shift))
    beside[1] += (0.5 + 0.5 * np.cos(np.pi * 0.1 / blend) if blend > 0.1 else 0.0) * shift
    a, b = beside[:-1], beside[1:]
    share = np.clip(np.einsum("ij,ij->i", landed - a, b - a) / np.einsum("ij,ij->i", b - a, b - a), 0.0, 1.0)
    assert np.linalg.norm(a + share[:, None] * (b - a) - landed, axis=1).min() < 1e-9
    middle = 0.5 * (dart.left_end + dart.right_end) - dart.tip
    assert abs(offset[0] * middle[1] - offset[1] * middle[0]) < 1e-12


def fish_eye_layout(gap: float):
    path = [5 + N * row for row in range(2, 9)]
    cut = cut_along(grid(N, N), [path], vertex_count=N * N)
    positions = flat(N, N)[:, :2][cut.vertex_origin]
    half = 0.5 * gap * np.array([0, 0.5, 0.8, 1.0, 0.8, 0.5, 0])
    positions[cut.seams[0].left, 0] -= half
    positions[cut.seams[0].right, 0] += half
    return positions, cut.seams[0]


def test_a_fish_eye_that_gapes_in_the_middle_and_overlaps_at_its_tips_is_no_dart():
    positions, crack = fish_eye_layout(0.04)
    sides = crack.left[[1, -2]], crack.right[[1, -2]]
    positions[sides[0], 0], positions[sides[1], 0] = 0.51, 0.49
    measure = fish_eye_measure(positions, crack.left, crack.right)
    assert measure.intake == pytest.approx(0.04)
    assert 0.005 < measure.overlap < 0.02
    with pytest.raises(InputError, match="overlaps by"):
        shape_fish_eye(positions, crack.left, crack.right)


def test_fish_eye():
    positions, crack = fish_eye_layout(0.04)
    measure = fish_eye_measure(positions, crack.left, crack.right)
    assert measure.length == pytest.approx(0.6)
    assert measure.intake == pytest.approx(0.04)
    assert measure.station == 3
    assert measure.first_angle == pytest.approx(2 * np.arctan(0.02 / 0.3))
    assert measure.last_angle == pytest.approx(measure.first_angle)
    drawn = shape_fish_eye(positions, crack.left, crack.right, tip_back=0.05)
    np.testing.assert_allclose(drawn.first_tip, [0.5, 0.25])
    np.testing.assert_allclose(drawn.last_tip, [0.5, 0.75])
    np.testing.assert_allclose(drawn.left_point, [0.48, 0.5])
    np.testing.assert_allclose(drawn.right_point, [0.52, 0.5])
    assert drawn.first_leg == pytest.approx(np.hypot(0.25, 0.02))
    assert drawn.last_leg == pytest.approx(drawn.first_leg)
    assert measure.overlap == 0
    positions, crack = fish_eye_layout(-0.04)
    measure = fish_eye_measure(positions, crack.left, crack.right)
    assert measure.first_angle < 0
    assert measure.intake == pytest.approx(-0.04)
    assert measure.overlap == pytest.approx(0.04, rel=0.1)
    with pytest.raises(InputError, match="overlaps"):
        shape_fish_eye(positions, crack.left, crack.right)


def test_refusals():
    positions, crack, outline = dart_layout()
    left, right = crack.left, crack.right
    with pytest.raises(InputError, match="has no tip"):
        dart_measure(positions, left[:-1], right[:-1])
    slit = fish_eye_layout(0.04)
    with pytest.raises(InputError, match="two tips"):
        dart_measure(slit[0], slit[1].left, slit[1].right)
    with pytest.raises(InputError, match="no fish-eye dart"):
        fish_eye_measure(positions, left, right)
    for tip_back in (-0.01, 0.6, np.nan):
        with pytest.raises(InputError, match="tip_back"):
            shape_dart(positions, left, right, outline, tip_back=tip_back)
        with pytest.raises(InputError, match="tip_back"):
            shape_fish_eye(slit[0], slit[1].left, slit[1].right, tip_back=tip_back)
    with pytest.raises(InputError, match="vertex 5, where the cut meets the border, is not on the given outline"):
        shape_dart(positions, left, right, outline[outline != 5])
    collapsed = positions.copy()
    collapsed[left[0]] = collapsed[TIP]
    with pytest.raises(InputError, match="leg of no length"):
        dart_measure(collapsed, left, right)
