"""Borders as curves: mirror images alike, long bends kept, teeth smoothed or told of."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from polygons import corners_of, drafted_piece, polygon, sides

from warpflat.core.polyline import arc_lengths, polyline_length
from warpflat.pattern.drafting.curves import chords, fit_curve
from warpflat.pattern.drafting.fitting import as_in_layout, drawn_length, is_wavy, smooth_line
from warpflat.pattern.drafting.piece_parts import Dart, Edge
from warpflat.pattern.drafting.pieces import Piece, Seam, SeamSide
from warpflat.pattern.drafting.seam_difference import SEAM_TOLERANCE


def bent(count: int = 24) -> np.ndarray:
    """#P by 2 [m], a side seam that bends one way below the arm and the other way above the waist, with turns of 50 degrees."""
    share = np.linspace(0.0, 1.0, count)
    return np.column_stack([0.03 * np.sin(2 * np.pi * share**1.3), -0.2 * share])


def teeth(count: int, depth: float) -> np.ndarray:
    """#P by 2 [m], a line of 20 cm with teeth."""
    away = np.where(np.arange(count) % 2 == 1, -depth, 0.0)
    away[-1] = 0.0
    return np.column_stack([away, np.linspace(0.0, -0.2, count)])


def dart_with(left: np.ndarray, right: np.ndarray) -> Piece:
    """A piece with a dart from its lower border, cut away, with these legs from its tip (#P by 2 [m])."""
    tip = np.array([0.2, 0.3])
    left, right = (left + tip)[::-1], right + tip
    corners = np.array([right[-1], (0.5, right[-1, 1]), (0.5, 0.5), (-0.1, 0.5), (-0.1, left[0, 1]), left[0]])
    edges = [Edge(name="l", points=left, kind="dart"), Edge(name="r", points=right, kind="dart")]
    edges += sides(corners, closed=False)
    return Piece(name="p", edges=edges, darts=[Dart(name="d", left="l", right="r", cut=True)])


@pytest.mark.parametrize("tolerance", [1e-4, 1e-3])
def test_a_mirror_image_that_runs_the_other_way_has_the_same_curve(tolerance: float):
    line = bent()
    curve = fit_curve(line, tolerance)
    mirrored = fit_curve(line[::-1] * [-1, 1], tolerance).reversed()
    np.testing.assert_allclose(mirrored.bezier * [-1, 1], curve.bezier, atol=1e-9)


def test_long_bends_one_way_and_the_other_are_shape():
    line = bent()
    piece = Piece(
        name="p",
        edges=[
            Edge(name="s", points=line),
            Edge(name="b", points=np.array([line[-1], (0.4, -0.2), (0.4, 0), line[0]])),
        ],
    )
    edge = drafted_piece(piece).edge("s")
    assert edge.tolerance == 1e-4
    assert edge.fit_error < 1.1e-4
    assert not is_wavy(edge.curve)
    assert is_wavy(fit_curve(teeth(25, 0.002)))


def test_teeth_that_no_smooth_line_can_be_as_long_as_are_told_of():
    legs = teeth(41, 0.005), np.linspace(0.0, 1.0, 41)[:, None] * [0.1, -np.sqrt(0.08 - 0.01)]
    piece = drafted_piece(dart_with(*legs))
    assert piece.edge("l").length == pytest.approx(piece.edge("r").length, abs=5e-4)
    assert [note for note in piece.notes if "stays ragged at l:" in note]


@pytest.mark.parametrize("edge", [0.002, 0.005, 0.012])
def test_a_line_inside_loses_the_teeth_of_the_mesh_and_keeps_its_ends_and_its_way(edge: float):
    """Along the vertices on either side of a plane: by turns up to half an edge above and below it."""
    count = round(0.4 / edge)
    x = np.linspace(0.0, 0.4, count)
    way = np.column_stack([x, 0.03 * np.sin(7 * x)])
    jagged = way + np.random.default_rng(5).uniform(-0.5, 0.5, (count, 1)) * [0.0, edge]
    jagged[[0, -1]] = way[[0, -1]]
    assert is_wavy(chords(jagged))
    smooth = smooth_line(jagged)
    np.testing.assert_array_equal(smooth[[0, -1]], way[[0, -1]])
    assert not is_wavy(chords(smooth))
    drawn = shapely.LineString(smooth)
    assert shapely.distance(drawn, shapely.points(jagged)).max() < edge
    assert shapely.distance(drawn, shapely.points(way)).max() < edge / 2


@pytest.mark.parametrize("line", [bent(), np.array([(0.0, 0.0), (0.0, 0.1), (0.1, 0.1), (0.1, 0.0)])])
def test_a_clean_line_inside_stays_as_it_is(line: np.ndarray):
    assert smooth_line(line) is line


def test_lines_are_smoothed_on_the_pattern_only_and_not_where_a_tolerance_is_asked_for():
    line = teeth(41, 0.005) + np.array([0.2, 0.3])
    piece = polygon("p", corners_of(0.4, 0.4), internal_lines={"level": line})
    drafted = drafted_piece(piece)
    assert is_wavy(chords(piece.internal_lines["level"]))
    assert not is_wavy(chords(drafted.internal_lines["level"]))
    as_asked = drafted_piece(piece, tolerance=1e-4).internal_lines["level"]
    np.testing.assert_allclose(as_asked - as_asked[0], line - line[0], atol=1e-12)


def test_a_sliver_narrower_than_its_tolerance_keeps_the_points_of_its_border():
    along = np.linspace(0.0, 0.2, 12)
    low = np.column_stack([along, -4e-4 * np.sin(np.pi * along / 0.2)])
    edges = [Edge(name="one", points=low), Edge(name="other", points=low[::-1] * [1, -1])]
    drafted = drafted_piece(Piece(name="p", edges=edges), tolerance=1e-3)
    assert min(np.ptp(drafted.sew_line, axis=0)) == pytest.approx(8e-4, rel=0.1)


def test_a_line_whose_curve_would_cross_itself_is_as_long_as_its_chords():
    """A back's neckline with corners: a curve that rounds them off turns a loop, so that chords are drawn."""
    half = np.array([
        (87.0, 589.0), (70.1, 566.8), (70.7, 566.6), (58.2, 570.3), (48.1, 570.7), (34.5, 571.7), (23.0, 571.0), (9.7, 571.0),
    ])  # fmt: skip
    neck = 1e-3 * np.concatenate([half, [(0.0, 571.5)], half[::-1] * [-1.0, 1.0]])
    assert drawn_length(neck) == pytest.approx(polyline_length(neck), abs=1e-9)
    drafted = drafted_piece(
        Piece(
            name="back",
            edges=[
                Edge(name="neck", points=neck),
                Edge(name="rest", points=np.array([neck[-1], (-0.1, 0.4), (0.1, 0.4), neck[0]])),
            ],
        )
    )
    assert drafted.edge("neck").length == pytest.approx(drawn_length(neck), abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_borders_that_differ_by_rounding_get_the_same_curve(seed: int):
    """A back's waist, its own mirror image, whose halves need knots alike, and an armhole, of which finer splines are equally good."""
    # fmt: off
    half = np.array([
        (-180.142, -10.589), (-171.685, -9.179), (-163.378, -7.801), (-155.156, -6.453), (-146.97, -5.144), (-138.788, -3.894),
        (-130.593, -2.717), (-122.372, -1.624), (-114.117, -0.623), (-105.822, 0.273), (-97.486, 1.065), (-89.111, 1.754),
        (-80.695, 2.34), (-71.262, 2.878), (-61.783, 3.308), (-52.265, 3.641), (-42.713, 3.892), (-33.132, 4.072),
        (-23.53, 4.191), (-13.913, 4.258),
    ])
    armhole = 1e-3 * np.array([
        (-183.678, 397.038), (-180.272, 387.461), (-177.625, 377.559), (-175.269, 367.492), (-173.008, 357.324), (-170.581, 346.3),
        (-168.119, 335.234), (-165.6, 324.143), (-163.025, 313.024), (-160.427, 301.853), (-157.931, 290.547), (-156.19, 278.833),
        (-156.586, 266.434), (-159.806, 253.17), (-165.129, 239.551), (-171.159, 229.088), (-177.651, 218.5), (-185.149, 208.824),
        (-194.418, 201.625), (-204.564, 197.459), (-214.488, 195.525),
    ])
    # fmt: on
    waist = 1.3e-3 * np.concatenate([half, [(0.0, 4.279)], half[::-1] * [-1.0, 1.0]])
    moved = np.random.default_rng(seed).normal(scale=3e-7, size=(41, 2))
    for line in (waist, waist[::-1], armhole, armhole[::-1]):
        curves = [fit_curve(each, near=True) for each in (line, line + moved[: len(line)])]
        one, other = (curve.sample() for curve in curves)
        assert len(curves[0].bezier) == len(curves[1].bezier)
        assert shapely.hausdorff_distance(shapely.LineString(one), shapely.LineString(other)) < 5e-6


@pytest.mark.parametrize(("as_laid", "longer"), [(False, 1.0), (True, 1.0), (True, 1.1)])
def test_sides_of_a_seam_that_curves_would_part_are_drawn_by_their_chords(as_laid: bool, longer: float):
    """A zigzag and a straight line of its length: what smooths the one away shortens it."""
    rough = teeth(41, 0.004)
    lengths = arc_lengths(rough)
    straight = np.column_stack([np.zeros(41), longer * lengths])
    lines = {("a", "edge"): rough, ("b", "edge"): straight}
    side = [(SeamSide(piece=name, edge="edge"),) for name in "ab"]
    seam = Seam(name="seam", sides=(side[0], side[1]), ease=longer - 1.0, as_laid=as_laid)
    smooth = {("a", "edge"): chords(rough[[0, -1]]), ("b", "edge"): chords(straight)}
    assert abs(smooth["a", "edge"].length - lengths[-1]) > 2 * SEAM_TOLERANCE
    kept = as_in_layout(lines, [seam], smooth)
    assert kept["a", "edge"].length == pytest.approx(lengths[-1], abs=1e-9)
    # What agrees stays as it is.
    assert as_in_layout(lines, [seam], kept)["a", "edge"] is kept["a", "edge"]
