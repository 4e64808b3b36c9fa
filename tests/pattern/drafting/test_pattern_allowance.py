"""The cut line: never self-crossing, as wide as asked, mitred or square, flat when darts and hems are folded."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely.affinity import affine_transform

from warpflat.core.errors import InputError
from warpflat.pattern.drafting.allowance import cut_hole, cut_outline
from warpflat.pattern.drafting.sides import MITRE_REACH, Side, Wedge

WIDTHS = st.sampled_from([0.0, 0.005, 0.010, 0.015, 0.030, 0.050])


def polygon_sides(corners, widths, kinds=None):
    corners = np.asarray(corners, dtype=float)
    following = np.roll(corners, -1, axis=0)
    kinds = kinds or ["seam"] * len(corners)
    return [
        Side(name=f"e{i}", points=np.stack([a, b]), width=w, kind=k)
        for i, (a, b, w, k) in enumerate(zip(corners, following, widths, kinds, strict=True))
    ]


def reflected(area, point, direction):
    x, y = direction / np.linalg.norm(direction)
    turn = np.array([[2 * x * x - 1, 2 * x * y], [2 * x * y, 2 * y * y - 1]])
    return affine_transform(area, [*turn.reshape(-1), *(point - turn @ point)])


@st.composite
def star(draw):
    """Corners of any angle, down to a few degrees, convex and concave."""
    count = draw(st.integers(3, 9))
    radii = draw(st.lists(st.floats(0.02, 0.5), min_size=count, max_size=count))
    gaps = draw(st.lists(st.floats(0.15, 1.0), min_size=count, max_size=count))
    angles = np.cumsum(gaps) / np.sum(gaps) * 2 * np.pi
    return np.column_stack([np.cos(angles), np.sin(angles)]) * np.array(radii)[:, None]


@settings(max_examples=120, deadline=None, derandomize=True)
@given(corners=star(), data=st.data())
def test_any_corners_and_widths_give_a_simple_line(corners, data):
    body = shapely.Polygon(corners)
    assume(body.is_valid and body.exterior.is_ccw and body.area > 1e-4)
    widths = [data.draw(WIDTHS) for _ in corners]
    kinds = [data.draw(st.sampled_from(["seam", "hem", "cut"])) for _ in corners]
    cut = shapely.Polygon(cut_outline(polygon_sides(corners, widths, kinds)).points)
    assert cut.is_valid
    assert cut.exterior.is_ccw
    assert body.difference(cut.buffer(1e-6)).area < 1e-9
    # No corner reaches farther than the longest mitre that is allowed.
    reach = shapely.distance(body, shapely.points(shapely.get_coordinates(cut))).max()
    farthest = 3.0 if "hem" in kinds else np.hypot(1, MITRE_REACH)
    assert reach <= farthest * max(widths) + 1e-4
    for a, b, width in zip(corners, np.roll(corners, -1, axis=0), widths, strict=True):
        along = (b - a) / np.linalg.norm(b - a)
        out = np.array([along[1], -along[0]])
        middle = (a + b) / 2
        if all(k != "hem" for k in kinds):
            assert cut.buffer(1e-6).contains(shapely.Point(middle + (width - 1e-6) * out))


def test_square_with_one_width_is_the_mitred_offset():
    square = [(0, 0), (0.2, 0), (0.2, 0.3), (0, 0.3)]
    cut = shapely.Polygon(cut_outline(polygon_sides(square, [0.01] * 4)).points)
    assert cut.equals_exact(shapely.box(-0.01, -0.01, 0.21, 0.31), 1e-6, normalize=True)
    assert len(cut.exterior.coords) == 5


def test_each_edge_gets_its_own_width():
    square = [(0, 0), (0.2, 0), (0.2, 0.3), (0, 0.3)]
    cut = shapely.Polygon(cut_outline(polygon_sides(square, [0.03, 0.01, 0.005, 0.0])).points)
    assert cut.bounds == pytest.approx((0.0, -0.03, 0.21, 0.305), abs=1e-6)
    assert cut.area == pytest.approx(0.21 * 0.335, abs=1e-6)


def test_a_wide_edge_that_meets_a_narrow_one_almost_straight_ends_square():
    corners = [(0, 0), (0.2, 0), (0.4, 0.005), (0.4, 0.2), (0, 0.2)]
    cut = shapely.Polygon(cut_outline(polygon_sides(corners, [0.03, 0.01, 0.01, 0.01, 0.01])).points)
    assert cut.contains(shapely.Point(0.1995, -0.0295)), "the wide allowance keeps its whole width up to its end"
    assert not cut.contains(shapely.Point(0.21, -0.015)), "and does not run on beside the narrow one"


def test_a_spike_is_squared_off_not_mitred_to_infinity():
    corners = [(0, 0), (0.5, 0.005), (0, 0.01)]
    cut = shapely.Polygon(cut_outline(polygon_sides(corners, [0.01] * 3)).points)
    assert cut.is_valid
    assert cut.bounds[2] <= 0.5 + 0.01 * MITRE_REACH + 1e-4


def test_a_concave_corner_is_cut_where_the_offset_lines_meet():
    corners = [(0, 0), (0.2, 0), (0.2, 0.1), (0.1, 0.1), (0.1, 0.2), (0, 0.2)]
    points = cut_outline(polygon_sides(corners, [0.01] * 6)).points
    assert np.linalg.norm(points - [0.11, 0.11], axis=1).min() < 1e-6


def test_a_strip_wider_than_the_piece_does_not_come_out_on_its_other_side():
    # A tongue 5 mm wide beside a concave edge with 30 mm allowance that points at it.
    corners = [(0, 0), (0.3, 0), (0.3, 0.2), (0.295, 0.2), (0.295, 0.02), (0, 0.02)]
    cut = shapely.Polygon(cut_outline(polygon_sides(corners, [0, 0, 0, 0, 0.03, 0])).points)
    assert not cut.contains(shapely.Point(0.301, 0.1))


def test_a_closed_gap_is_reported():
    # A keyhole: the neck is narrower than the two allowances, the room behind it is not.
    corners = [(0, 0), (0.3, 0), (0.3, 0.3), (0.153, 0.3), (0.153, 0.25), (0.22, 0.25), (0.22, 0.1)]
    corners += [(0.08, 0.1), (0.08, 0.25), (0.147, 0.25), (0.147, 0.3), (0, 0.3)]
    outline = cut_outline(polygon_sides(corners, [0.01] * 12))
    assert shapely.Polygon(outline.points).is_valid
    assert any("narrow gap" in note for note in outline.notes)


def test_the_fold_gets_nothing_and_its_neighbours_end_on_it():
    corners = [(0, 0), (0.2, 0.03), (0.2, 0.3), (0, 0.27)]
    cut = cut_outline(polygon_sides(corners, [0.01, 0.01, 0.01, 0], ["seam", "seam", "seam", "fold"])).points
    assert cut[:, 0].min() == pytest.approx(0.0, abs=1e-9)
    on_fold = cut[np.abs(cut[:, 0]) < 1e-7]
    slope = np.hypot(0.2, 0.03) / 0.2
    assert on_fold[:, 1].min() == pytest.approx(-0.01 * slope, abs=1e-6)
    assert on_fold[:, 1].max() == pytest.approx(0.27 + 0.01 * slope, abs=1e-6)


def test_a_half_piece_that_crosses_its_fold_is_refused():
    corners = [(0, 0), (0.2, 0), (0.2, 0.3), (-0.05, 0.3), (0, 0.2)]
    kinds = ["seam", "seam", "seam", "seam", "fold"]
    with pytest.raises(InputError, match="beyond it"):
        cut_outline(polygon_sides(corners, [0.01, 0.01, 0.01, 0.01, 0], kinds))


def test_what_lies_by_less_beyond_the_fold_than_a_fold_may_bend_is_cut_off():
    corners = [(0, 0), (0.2, 0), (0.2, 0.3), (-0.0004, 0.3), (0, 0.25)]
    kinds = ["seam", "seam", "seam", "seam", "fold"]
    cut = cut_outline(polygon_sides(corners, [0.01, 0.01, 0.01, 0.01, 0], kinds)).points
    assert cut[:, 0].min() == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("slant", [-0.04, 0.0, 0.05])
def test_a_hem_turned_up_covers_its_side_seams_exactly(slant):
    corners = np.array([(0, 0), (0.3, 0), (0.3 + slant, 0.4), (-slant, 0.4)])
    sides = polygon_sides(corners, [0.03, 0.01, 0.01, 0.01], ["hem", "seam", "seam", "seam"])
    cut = shapely.Polygon(cut_outline(sides).points)
    hem = cut.intersection(shapely.box(-1, -1, 1, 0))
    above = cut.intersection(shapely.box(-1, 0, 1, 0.03))
    turned = reflected(hem, np.zeros(2), np.array([1.0, 0.0]))
    assert turned.symmetric_difference(above).area < 1e-7


def dart_sides(depth, opening, lean, slope_left, slope_right, fold_to="left", width=0.01, kind="seam"):
    """A block whose lower border has a dart; `lean` tilts the dart, the slopes tilt the border beside it."""
    tip = np.array([0.2, depth])
    left = tip + depth * np.array([np.sin(lean - opening / 2), -np.cos(lean - opening / 2)])
    right = tip + depth * np.array([np.sin(lean + opening / 2), -np.cos(lean + opening / 2)])
    start = left + 0.15 * np.array([-np.cos(slope_left), np.sin(slope_left)])
    end = right + 0.15 * np.array([np.cos(slope_right), np.sin(slope_right)])
    top = max(start[1], end[1], depth) + 0.2
    wedge = Wedge(name="dart", left=np.stack([left, tip]), right=np.stack([tip, right]), fold_to=fold_to)
    chain = [end, np.array([end[0], top]), np.array([start[0], top]), start]
    sides = [Side(name="a", points=np.stack([start, left]), width=width, kind=kind), wedge]
    sides.append(Side(name="b", points=np.stack([right, end]), width=width, kind=kind))
    for i, (a, b) in enumerate(pairwise(chain)):
        sides.append(Side(name=f"c{i}", points=np.stack([a, b]), width=width, kind="seam"))
    body = shapely.Polygon([start, left, tip, right, *chain[:-1]])
    return sides, wedge, body


@settings(max_examples=80, deadline=None, derandomize=True)
@given(
    depth=st.floats(0.04, 0.2),
    opening=st.floats(0.02, np.radians(80)),
    lean=st.floats(-0.5, 0.5),
    slope_left=st.floats(-0.6, 0.6),
    slope_right=st.floats(-0.6, 0.6),
    fold_to=st.sampled_from(["left", "right"]),
)
def test_any_dart_folds_flat_under_the_cloth_beside_it(depth, opening, lean, slope_left, slope_right, fold_to):
    sides, wedge, body = dart_sides(depth, opening, lean, slope_left, slope_right, fold_to)
    assume(body.is_valid)
    cut = shapely.Polygon(cut_outline(sides).points)
    assert cut.is_valid
    near = wedge.left[0] if fold_to == "left" else wedge.right[-1]
    leg = (near - wedge.tip) / np.linalg.norm(near - wedge.tip)
    reach = depth + 0.1
    flap = cut.intersection(shapely.Polygon([wedge.tip, wedge.tip + reach * leg, wedge.tip + reach * wedge.middle]))
    folded = reflected(flap, near, leg)
    assert folded.difference(cut.buffer(1e-5)).area < 1e-8
    if max(abs(lean - opening / 2 + slope_left), abs(lean + opening / 2 - slope_right)) > np.radians(50):
        return  # a border almost along the leg has its allowance where the other half of the wedge is looked for
    other = wedge.right[-1] if fold_to == "left" else wedge.left[0]
    far = (other - wedge.tip) / np.linalg.norm(other - wedge.tip)
    second = cut.intersection(shapely.Polygon([wedge.tip, wedge.tip + reach * far, wedge.tip + reach * wedge.middle]))
    mirrored = reflected(second, wedge.tip, wedge.middle)
    assert mirrored.difference(flap.buffer(1e-5)).area < 1e-8
    assert flap.difference(mirrored.buffer(1e-5)).area < 1e-8


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    opening=st.floats(0.15, np.radians(60)),
    bow=st.floats(-0.06, 0.06),
    twist=st.floats(-0.04, 0.04),
    slope=st.floats(-0.4, 0.4),
    fold_to=st.sampled_from(["left", "right"]),
)
def test_a_dart_with_curved_legs_keeps_its_wedge(opening, bow, twist, slope, fold_to):
    """Legs as the cut of a mesh leaves them, bowed or like an S by some per cent of their length, in mirror image."""
    assume(abs(bow) + 2 * abs(twist) < 0.08)
    sides, wedge, _ = dart_sides(0.14, opening, 0.0, slope, slope, fold_to)
    share = np.linspace(0, 1, 21)[:, None]
    aside = 0.14 * (4 * bow * share * (1 - share) + 8 * twist * share * (1 - share) * (1 - 2 * share))

    def bent(leg, side):
        along = (leg[1] - leg[0]) / np.linalg.norm(leg[1] - leg[0])
        return leg[0] + share * (leg[1] - leg[0]) + side * aside * np.array([-along[1], along[0]])

    left, right = bent(wedge.left, 1.0), bent(wedge.right[::-1], -1.0)[::-1]
    sides[1] = Wedge(name="dart", left=left, right=right, fold_to=fold_to)
    chain = np.concatenate(
        [s.points[:-1] if isinstance(s, Side) else np.concatenate([left[:-1], right[:-1]]) for s in sides]
    )
    body = shapely.Polygon(chain)
    assume(body.is_valid)
    cut = shapely.Polygon(cut_outline(sides).points)
    assert cut.is_valid
    assert body.difference(cut.buffer(1e-6)).area < 1e-9
    ray = shapely.LineString([wedge.tip + 1e-4 * wedge.middle, wedge.tip + (0.14 * np.cos(opening / 2)) * wedge.middle])
    assert cut.buffer(1e-6).contains(ray), "the wedge stays in the cloth up to its mouth"


def test_a_plain_dart_gets_a_roof_of_known_height():
    # Legs at 100 mm and 20 degrees open, border square to the left leg's mouth chord: mirrored by hand.
    sides, wedge, _ = dart_sides(0.1, np.radians(20), 0.0, 0.0, 0.0)
    cut = shapely.Polygon(cut_outline(sides).points)
    fold = shapely.LineString([wedge.tip, wedge.tip + 0.3 * wedge.middle]).intersection(cut)
    half = np.radians(10)
    # The border's normal stands `half` off the leg; its mirror image stands `half` beyond, 2 * half off the fold.
    distance = 0.1 * np.cos(half) + 0.01
    along_leg = distance / np.cos(half)
    assert fold.length == pytest.approx(along_leg * np.cos(half) / np.cos(2 * half), rel=1e-5)


def test_a_slanted_dart_is_caught_in_the_seam():
    # As a French dart: 23 degrees open, its leg 32 degrees off the border; what lay 40 mm past the mouth was cut off.
    opening, angle, leg = np.radians(23), np.radians(32), 0.14
    sides, wedge, _ = dart_sides(leg, opening, 0.0, opening / 2 + angle - np.pi / 2, np.radians(70))
    outline = cut_outline(sides)
    fold = shapely.LineString([wedge.tip, wedge.tip + wedge.middle]).intersection(shapely.Polygon(outline.points))
    # The border, mirrored on the leg, meets the fold in a triangle whose angles are known; 10 mm past that it is cut.
    beyond = (leg * np.sin(angle) + 0.01) / np.sin(angle - opening / 2)
    assert fold.length == pytest.approx(beyond, abs=1e-5)
    assert outline.notes == ()


def test_a_dart_almost_along_the_border_is_not_prolonged_for_ever():
    opening, angle, leg = np.radians(23), np.radians(14), 0.06
    sides, wedge, _ = dart_sides(leg, opening, 0.0, opening / 2 + angle - np.pi / 2, np.radians(70))
    outline = cut_outline(sides)
    fold = shapely.LineString([wedge.tip, wedge.tip + wedge.middle]).intersection(shapely.Polygon(outline.points))
    assert fold.length < leg + 0.05
    assert any(note.startswith("dart meets the border") and "not caught in the seam" in note for note in outline.notes)


@pytest.mark.parametrize("fold_to", ["left", "right"])
@pytest.mark.parametrize(
    ("lean", "slope_left", "slope_right"), [(0, 0, 0), (0.2, 0, 0), (0, 0.2, 0.2), (-0.3, 0.1, -0.2), (0, -0.15, -0.1)]
)
def test_a_hem_with_a_dart_turns_up_flat(lean, slope_left, slope_right, fold_to):
    """Around the mouth the cloth that is turned up has the angles of the cloth that it is turned up on."""
    sides, wedge, body = dart_sides(0.25, 0.2, lean, slope_left, slope_right, fold_to, width=0.04, kind="hem")
    outline = cut_outline(sides)
    cut = shapely.Polygon(outline.points)
    assert cut.is_valid
    assert body.difference(cut.buffer(1e-6)).area < 1e-9
    mouths = wedge.left[0], wedge.right[-1]
    hems = sides[0].points[0] - mouths[0], sides[2].points[1] - mouths[1]
    above = [wedge.tip - mouth for mouth in mouths]
    assert angle_sum(hems, outline.prolonged["dart"]) == pytest.approx(angle_sum(hems, above), abs=1e-6)
    # Folded on its middle the wedge lies with both bent legs on each other, and under the hem beside it.
    (on_left, on_right), middle = outline.prolonged["dart"], wedge.middle
    assert 2 * (on_left @ middle) * middle - on_left == pytest.approx(on_right, abs=1e-9)
    mouth, on = (mouths[0], on_left) if fold_to == "left" else (mouths[1], on_right)
    half = shapely.Polygon([mouth, mouth + 0.07 * on, wedge.tip + 0.34 * middle, wedge.tip + 0.26 * middle])
    folded = reflected(cut.intersection(half), mouth, on)
    assert folded.difference(cut.buffer(1e-5)).area < 1e-8


def angle_sum(hems, legs):
    pairs = [(a / np.linalg.norm(a), b / np.linalg.norm(b)) for a, b in zip(hems, legs, strict=True)]
    return sum(float(np.arccos(a @ b)) for a, b in pairs)


def test_two_darts_that_share_a_mouth_are_refused():
    sides, wedge, _ = dart_sides(0.1, 0.3, 0.0, 0.0, 0.0)
    with pytest.raises(InputError, match="leave an edge between"):
        cut_outline([sides[0], wedge, wedge, *sides[2:]])


@pytest.mark.parametrize("taper", [-0.05, 0.0, 0.05, 0.2])
@pytest.mark.parametrize("hem", [0.045, 0.05, 0.06, 0.08])
def test_a_hem_deeper_than_its_edge_is_long_has_no_slits(hem, taper):
    corners = np.array([(0, 0), (0.051, 0), (0.051 + 0.4 * taper, 0.4), (-0.4 * taper, 0.4)])
    sides = polygon_sides(corners, [hem, 0.01, 0.01, 0.01], ["hem", "seam", "seam", "seam"])
    cut = shapely.Polygon(cut_outline(sides).points)
    turned = reflected(cut.intersection(shapely.box(-1, -1, 1, 0)), np.zeros(2), np.array([1.0, 0.0]))
    assert turned.symmetric_difference(cut.intersection(shapely.box(-1, 0, 1, hem))).area < 1e-7


@pytest.mark.parametrize("arm", [0.02 - 1e-9, 0.02, 0.02 + 1e-9, 0.0209])
def test_a_hole_s_narrow_bays_leave_no_slits_in_its_cut_line(arm):
    """A plus whose arms are as wide as its two allowances."""
    plus = shapely.box(-arm / 2, -0.06, arm / 2, 0.06).union(shapely.box(-0.05, -0.045, 0.05, 0.045))
    line = cut_hole(np.asarray(shapely.orient_polygons(plus).exterior.coords)[:-1], 0.01)
    assert shapely.Polygon(line).equals_exact(shapely.box(-0.04, -0.035, 0.04, 0.035), 2e-6, normalize=True)


@pytest.mark.parametrize("corners", [3, 4, 7, 60])
def test_a_hole_keeps_its_corners(corners):
    angles = 2 * np.pi * np.arange(corners) / corners
    ring = 0.05 * np.column_stack([np.cos(angles), np.sin(angles)])
    line = cut_hole(ring, 0.01)
    shrunk = (0.05 - 0.01 / np.cos(np.pi / corners)) / 0.05
    assert shapely.Polygon(line).equals_exact(shapely.Polygon(shrunk * ring), 3e-6, normalize=True)
