"""Curves, seams, notches, darts, labels of whole garments."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath
from polygons import corners_of, drafted_piece, polygon, sides
from polygons import drafted as drafted_alone
from sample_dress import sample_dress

from warpflat.core.errors import InputError
from warpflat.core.polyline import arc_lengths, turning_angles
from warpflat.pattern.drafting import draft
from warpflat.pattern.drafting.curves import fit_curve
from warpflat.pattern.drafting.draft import draft_garment, nest_label
from warpflat.pattern.drafting.drawing import OnPaper, draw_nest, draw_piece
from warpflat.pattern.drafting.fitting import uncrossed
from warpflat.pattern.drafting.layout import lay_out, nests
from warpflat.pattern.drafting.measures import length_words
from warpflat.pattern.drafting.piece_parts import Dart, Edge, Hole
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamSide
from warpflat.pattern.files.left_out import LeftOut, listening_to_left_out

SIZES = ("36", "38", "40", "42", "44")
# A square of 300 mm with a dart from its lower side, and the kinds of its edges.
DARTED = [(0, 0), (0.1, 0), (0.15, 0.1), (0.2, 0), (0.3, 0), (0.3, 0.3), (0, 0.3)]
KINDS = ("seam", "dart", "dart", "seam", "seam", "seam", "seam")


@pytest.fixture(scope="module")
def dress():
    return draft_garment(sample_dress(SIZES))


def square(name="square", size="", **options):
    edges = sides(corners_of(0.2, 0.3), names=("bottom", "right", "top", "left"))
    return Piece(name=name, size=size, edges=options.pop("edges", edges), **options)


def inside(points):
    """How far [m] an arc as long as the chords of a border runs from its points, where the border bends most."""
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    turn = np.abs(turning_angles(points)) * np.maximum(step[:-1], step[1:])
    return float(turn.max()) / 24 if len(turn) else 0.0


def test_all_pieces_of_all_sizes_are_simple_and_contain_their_sewing_line(dress):
    for pieces in dress.pieces.values():
        for piece in pieces:
            cut, sew = shapely.Polygon(piece.cut_line), shapely.Polygon(piece.sew_line)
            assert cut.is_valid, (piece.name, piece.size)
            assert sew.is_valid
            assert sew.difference(cut.buffer(1e-6)).area < 1e-9
            assert piece.notes == ()


def test_seam_sides_agree_within_half_a_millimetre(dress):
    assert {report.size for report in dress.seams} == set(SIZES)
    for report in dress.seams:
        assert abs(report.difference_mm) < 0.5, report
        assert report.matches


def test_a_seam_that_does_not_match_is_reported():
    a, b = square("a"), square("b", edges=square().edges)
    taller = [Edge(name=e.name, points=e.points * [1, 1.01]) for e in b.edges]
    garment = Pattern(
        name="two",
        pieces={"": [a, square("b", edges=taller)]},
        seams=[
            Seam(
                name="s",
                sides=((SeamSide(piece="a", edge="right"),), (SeamSide(piece="b", edge="left", reversed=True),)),
            )
        ],
    )
    (report,) = draft_garment(garment).seams
    assert report.difference_mm == pytest.approx(3.0, abs=1e-6)
    assert not report.matches


def test_notches_stand_at_the_same_length_on_both_sides_of_every_seam(dress):
    for size, pieces in dress.pieces.items():
        for seam, report in zip(dress.pattern.seams, (r for r in dress.seams if r.size == size), strict=True):
            sides = []
            for side, total in zip(seam.sides, report.length_mm, strict=True):
                on_side = {s.place for s in side}
                marks = [n for p in pieces for n in p.notches if n.seam == seam.name and (p.name, n.edge) in on_side]
                sides.append(sorted((n.length * 1000 / total, n.double) for n in marks))
            first, second = sides
            joints = len(seam.sides[0]) - 1 + len(seam.sides[1]) - 1
            assert abs(len(first) - len(second)) <= joints
            shared = [f for f, _ in first if any(abs(f - g) < 1e-9 for g, _ in second)]
            assert len(shared) == min(len(first), len(second)) >= 1
            # As lengths: where there is no ease, the same millimetre.
            for fraction in shared:
                a, b = fraction * report.length_mm[0], fraction * report.length_mm[1]
                assert abs(b - a * (1 + seam.ease)) < 0.5


@pytest.mark.parametrize("longer_is", ["one edge", "two edges"])
def test_a_joint_is_notched_opposite_to_itself_where_only_a_part_of_a_seam_is_eased(longer_is):
    """Like a shoulder seam at a sleeve's cap: 80 mm of ease between a tenth and a half of the shorter side."""
    whole, ease, eased, joint = 0.5, 0.16, (0.1, 0.5), 0.2

    def block(name, height):
        return polygon(name, corners_of(0.3, height))

    def along(share):
        return share + ease * np.clip((share - eased[0]) / (eased[1] - eased[0]), 0.0, 1.0)

    if longer_is == "one edge":
        cut, opposite = (joint, whole - joint), whole * along(joint / whole)
        cap = whole * (1.0 + ease)
    else:
        cut, opposite, cap = (whole * along(joint / whole), whole * (1.0 + ease - along(joint / whole))), joint, whole
    chain = tuple(SeamSide(piece=name, edge="e1") for name in ("lower", "upper"))
    single = (SeamSide(piece="cap", edge="e1"),)
    seam = Seam(
        name="s",
        sides=(chain, single) if longer_is == "one edge" else (single, chain),
        ease=ease,
        eased=eased,
        notches=(),
    )
    pieces = [block("lower", cut[0]), block("upper", cut[1]), block("cap", cap)]
    drafted = draft_garment(Pattern(name="three", pieces={"": pieces}, seams=[seam]))
    (notch,) = (notch for piece in drafted.pieces[""] for notch in piece.notches if piece.name == "cap")
    assert notch.length == pytest.approx(opposite, abs=5e-4)
    assert abs(notch.length / cap - (cut[0] / sum(cut))) * cap > 0.01, "not at the same share of both sides"


def test_notches_lie_on_the_cut_line_and_point_inwards(dress):
    for piece in dress.pieces["38"]:
        cut = shapely.Polygon(piece.cut_line)
        for notch in piece.notches:
            for base in notch.base:
                assert cut.exterior.distance(shapely.Point(base)) < 1e-6
                assert cut.contains(shapely.Point(base + notch.depth * notch.direction))
                assert np.linalg.norm(base + notch.depth * notch.direction - base) < 0.0061


def test_the_back_is_double_the_front_is_single(dress):
    pieces = {piece.name: piece for piece in dress.pieces["38"]}
    armhole = {name: [n.double for n in piece.notches if n.seam == "armhole"] for name, piece in pieces.items()}
    assert armhole["front bodice"] == [False]
    assert armhole["back bodice"] == [True]
    assert sorted(armhole["sleeve"]) == [False, False, True], "front, shoulder joint, back"
    assert not any(n.double for n in pieces["back bodice"].notches if n.seam == "side")


@pytest.mark.parametrize("lean", [-0.04, 0.0, 0.04])
def test_words_on_a_fold_are_read_upwards_as_all_words_along_steep_lines(lean: float) -> None:
    corners = [(0.0, 0.0), (0.2, 0.0), (0.2, 0.4), (lean, 0.4)]
    half = polygon("half", corners, kinds=("seam", "seam", "seam", "fold"), grain=np.array([(0.1, 0.1), (0.1, 0.3)]))
    (said,) = [words for words in draw_piece(drafted_piece(half)).words if words.text == "PLACE ON FOLD"]
    assert np.degrees(said.angle) == pytest.approx(90.0, abs=6.0)


@pytest.mark.parametrize("at", ["back", ""])
def test_a_back_is_told_by_where_it_is_worn_as_by_its_name(at: str) -> None:
    """A panel of GarmentCode says where it hangs: its name need not."""
    corners = [(0.0, 0.0), (0.2, 0.0), (0.2, 0.3), (0.0, 0.3)]
    panels = [polygon("right_btorso", corners, at=at), polygon("left_btorso", corners, at=at)]
    seam = Seam(
        name="s",
        sides=(
            (SeamSide(piece="right_btorso", edge="e1"),),
            (SeamSide(piece="left_btorso", edge="e3", reversed=True),),
        ),
    )
    made = draft_garment(Pattern(name="g", pieces={"": panels}, seams=[seam]))
    assert {notch.double for piece in made.pieces[""] for notch in piece.notches} == {at == "back"}


def test_curves_keep_corners_and_stay_within_a_tenth_of_a_millimetre(dress):
    for piece in draft_garment(dress.pattern, sizes=("38",), true=False).pieces["38"]:
        for edge in piece.edges:
            points = edge.edge.points @ piece.frame[:, :2].T + piece.frame[:, 2]
            assert np.abs(edge.line[[0, -1]] - points[[0, -1]]).max() < 1e-12
            stray = shapely.distance(shapely.LineString(edge.line), shapely.points(points)).max()
            assert stray == edge.fit_error
            assert stray <= 1.2e-4 + inside(points)
            assert edge.length == pytest.approx(arc_lengths(points)[-1], abs=1e-4), "as long as its chords"
            assert len(edge.curve.bezier) <= max(1, len(points) // 2)


def test_an_arc_needs_few_segments_and_a_straight_line_one():
    t = np.linspace(0, np.pi / 2, 60)
    arc = 0.2 * np.column_stack([np.cos(t), np.sin(t)])
    curve = fit_curve(arc)
    assert len(curve.bezier) <= 3
    assert np.abs(np.linalg.norm(curve.sample(), axis=1) - 0.2).max() < 1.2e-4
    assert curve.length == pytest.approx(0.1 * np.pi, abs=1e-4)
    assert fit_curve(np.linspace([0, 0], [0.3, 0.1], 50)).straight.tolist() == [True]


def test_a_curve_keeps_near_its_points_or_keeps_their_length():
    """A tight curve, as at the foot of an armhole, through chords of 10 mm."""
    t = np.linspace(0, np.pi / 2, 5)
    arc = 0.025 * np.column_stack([np.cos(t), np.sin(t)])
    chords = arc_lengths(arc)[-1]
    kept, near = fit_curve(arc), fit_curve(arc, near=True)
    strays = [shapely.distance(shapely.LineString(c.sample()), shapely.points(arc)).max() for c in (kept, near)]
    assert strays[1] <= 1e-4 < strays[0]
    assert kept.length == pytest.approx(chords, abs=6e-5)
    assert chords < near.length < 0.025 * np.pi / 2 + 1e-4, "no longer than the arc"


def test_curves_leave_their_points_only_where_the_seam_demands_it():
    """A round edge sewn to a straight one: through chords of 5 mm it keeps near its points, through 30 mm it cannot."""
    for step, near in ((0.005, True), (0.03, False)):
        count = round(0.12 / step) + 1
        angle = np.linspace(-0.5, 0.5, count) * 2 * np.arcsin(step / 0.12) * (count - 1)
        round_edge = 0.06 * np.column_stack([np.sin(angle), 1 - np.cos(angle)])
        straight = np.column_stack([np.arange(count) * step, np.zeros(count)])
        ids = np.arange(count, dtype=np.int32)
        pieces = []
        for name, points in (("round", round_edge), ("straight", straight)):
            top = points[[-1, 0]] + [[0.0, 0.2], [0.0, 0.2]]
            corners = [points[-1], top[0], top[1], points[0]]
            others = sides(corners, closed=False)
            pieces.append(Piece(name=name, edges=[Edge(name="sewn", points=points, vertices=ids), *others]))
        both = ((SeamSide(piece="round", edge="sewn"),), (SeamSide(piece="straight", edge="sewn"),))
        drafted = drafted_alone(*pieces, seams=[Seam(name="s", sides=both)])
        assert drafted.seams[0].matches, step
        assert (drafted.pieces[""][0].edge("sewn").fit_error <= 1e-4) == near, step


def test_a_corner_inside_an_edge_stays_sharp():
    points = np.concatenate([np.linspace([0, 0], [0.1, 0], 20), np.linspace([0.1, 0], [0.1, 0.1], 20)[1:]])
    curve = fit_curve(points)
    assert len(curve.bezier) == 2
    assert np.abs(curve.nodes[1] - [0.1, 0]).max() < 1e-12


@settings(max_examples=40, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10_000), count=st.integers(2, 40))
def test_any_border_is_fitted_or_kept(seed, count):
    random = np.random.default_rng(seed)
    points = np.cumsum(random.normal(size=(count, 2)) * 0.01 + [0.01, 0], axis=0)
    curve = fit_curve(points)
    assert np.abs(curve.bezier - points[0]).max() <= 2 * np.abs(points - points[0]).max() + 1e-9, "nothing runs wild"
    assert np.array_equal(curve.bezier[1:, 0], curve.bezier[:-1, 3])
    assert shapely.distance(shapely.LineString(curve.sample()), shapely.points(points)).max() <= 1.2e-4 + 4 * inside(
        points
    )


@settings(max_examples=30, deadline=None, derandomize=True)
@given(radius=st.floats(0.05, 0.5), turn=st.floats(0.3, 2.5), bend=st.floats(-3.0, 3.0), count=st.integers(6, 30))
def test_two_borders_of_equal_chords_are_equal_curves(radius, turn, bend, count):
    """The sides of a seam bend differently and share only the lengths of their chords, on any mesh."""
    step = radius * turn / count * np.array([0.8, 1.2])[np.arange(count) % 2]
    share = (np.arange(count) + 0.5) / count
    sides = []
    for heading in (turn * share, bend * share**2 / 2):
        ahead = np.column_stack([np.cos(heading), np.sin(heading)])
        sides.append(np.concatenate([np.zeros((1, 2)), np.cumsum(step[:, None] * ahead, axis=0)]))
    lines = [fit_curve(side).sample() for side in sides]
    first, second = (
        shapely.line_locate_point(shapely.LineString(line), shapely.points(side))
        for line, side in zip(lines, sides, strict=True)
    )
    assert first[-1] == pytest.approx(second[-1], abs=1.5e-4)
    stretch = np.interp(first[first < first[-1] - 0.05] + 0.05, first, second) - second[first < first[-1] - 0.05]
    assert np.abs(stretch - 0.05).max(initial=0.0) < 2e-4


def test_samples_stay_within_their_chord_tolerance():
    t = np.linspace(0, np.pi, 80)
    curve = fit_curve(0.1 * np.column_stack([np.cos(t), np.sin(t)]))
    coarse, fine = shapely.LineString(curve.sample(1e-4)), curve.sample(1e-7)
    assert shapely.distance(coarse, shapely.points(fine)).max() <= 1.0e-4
    assert len(curve.sample(1e-4)) < len(curve.sample(1e-5)) < len(fine)


def test_a_piece_on_the_fold_ends_on_it_exactly(dress):
    for name in ("front bodice", "skirt front"):
        (piece,) = (p for p in dress.pieces["38"] if p.name == name)
        assert piece.cut_line[:, 0].min() == pytest.approx(0, abs=1e-9)
        assert piece.label.lines[2][0].startswith("Cut 1 on fold")
        assert all(abs(n.base[0][0]) > 0.01 for n in piece.notches)


def test_darts_get_a_drill_hole_at_the_tip_and_a_notch_at_each_leg(dress):
    (front,) = (p for p in dress.pieces["38"] if p.name == "front bodice")
    assert [hole.name for hole in front.drill_holes] == ["waist_dart", "bust_dart"]
    assert front.drill_holes[0].at == pytest.approx([0.095, 0.165])
    for dart in ("waist_dart", "bust_dart"):
        assert sum(n.seam == dart for n in front.notches) == 2
    assert {d.dart.name: d.fold_to for d in front.darts} == {"waist_dart": "left", "bust_dart": "left"}
    assert front.darts[1].fold_to == "left", "downwards: the left leg is the lower one"


def test_notches_of_a_dart_through_a_straight_hem_stand_as_its_legs_do_above_it():
    corners = [(0, 0), (0.15, 0), (0.18, 0.2), (0.21, 0), (0.36, 0), (0.36, 0.3), (0, 0.3)]
    kinds = ("hem", "dart", "dart", "hem", "seam", "seam", "seam")
    darts = [Dart(name="d", left="e1", right="e2")]
    piece = drafted_piece(polygon("p", corners, kinds=kinds, widths=7 * [0.04], darts=darts))
    left, right = (next(n.base[0] for n in piece.notches if n.edge == leg) for leg in ("e1", "e2"))
    assert left[1] == pytest.approx(-0.04, abs=1e-6)
    # 60 mm at the hem, 48 mm 40 mm above it, and as much where that much is turned up.
    assert right[0] - left[0] == pytest.approx(0.048, abs=1e-5)


def test_a_wide_dart_is_cut_out_with_allowances_on_its_legs():
    edges = sides(DARTED, names=("a", "l", "r", "b", "right", "top", "left"), kinds=KINDS)
    piece = drafted_piece(Piece(name="p", edges=edges, darts=[Dart(name="d", left="l", right="r", cut=True)]))
    assert piece.edge("l").width == 0.010
    assert "Includes seam 1 cm" in [text for text, _ in piece.label.lines]
    shift = piece.frame[:, 2]
    cut = shapely.Polygon(piece.cut_line - shift)
    assert cut.is_valid
    assert not cut.contains(shapely.Point(0.15, 0.0)), "the wedge is cut away"
    assert piece.darts[0].fold is None
    folded = drafted_piece(Piece(name="p", edges=edges, darts=[Dart(name="d", left="l", right="r")]))
    assert shapely.Polygon(folded.cut_line - folded.frame[:, 2]).contains(shapely.Point(0.15, 0.0))


def curved_dart(mouth, bends=(0.08, 0.08), length=0.1):
    """A block with a dart that is to be cut away; its left and right leg leave their chords by these shares of their length."""
    tip = np.array([0.15, length])
    share = np.linspace(0.0, 1.0, 25)[:, None]
    ends = [np.array([0.15 - mouth / 2, 0.0]), np.array([0.15 + mouth / 2, 0.0])]
    left, right = (
        end + share * (tip - end) + 4 * b * length * share * (1 - share) * [-1, 0]
        for end, b in zip(ends, bends, strict=True)
    )
    corners = np.array([ends[1], (0.3, 0), (0.3, 0.3), (0, 0.3), (0, 0), ends[0]])
    edges = [Edge(name="l", points=left, kind="dart"), Edge(name="r", points=right[::-1], kind="dart")]
    piece = Piece(
        name="p", edges=edges + sides(corners, closed=False), darts=[Dart(name="d", left="l", right="r", cut=True)]
    )
    return drafted_alone(piece).pieces[""][0]


@pytest.mark.parametrize("bends", [(0.08, -0.08), (0.08, 0.08), (-0.05, -0.05), (0.06, 0.05)])
@pytest.mark.parametrize("mouth", [0.006, 0.012, 0.021, 0.0249])
def test_a_dart_without_room_for_its_allowances_is_folded_along_its_middle(mouth, bends):
    piece = curved_dart(mouth, bends)
    (dart,) = piece.darts
    assert any(
        f"dart d is folded, not cut away: its mouth of {length_words(mouth)} has" in note for note in piece.notes
    )
    assert {(n.edge, n.seam) for n in piece.notches} == {("l", "d"), ("r", "d")}
    wedge = shapely.Polygon(np.concatenate([piece.edge("l").line, piece.edge("r").line[1:]]))
    cut = shapely.Polygon(piece.cut_line)
    assert cut.is_valid
    assert cut.buffer(1e-6).contains(wedge)
    fold = shapely.LineString(dart.fold)
    above = fold.intersection(shapely.box(-1, piece.edge("l").line[0, 1], 1, 1))
    assert wedge.buffer(1e-5).contains(above), "between the legs, from the tip to the mouth"
    assert shapely.Point(dart.fold[-1]).distance(cut.exterior) < 1e-6


def test_a_dart_with_room_is_cut_away_and_notched_where_its_allowances_are_apart():
    piece = curved_dart(0.03, length=0.15)
    assert piece.darts[0].fold is None
    assert piece.edge("l").width == 0.010
    first, second = (n for n in piece.notches if n.seam == "p.d")
    assert first.length == pytest.approx(second.length, abs=5e-4)
    for notch in (first, second):
        assert np.linalg.norm(notch.base[0] - notch.at) < 0.0101
        assert shapely.LinearRing(piece.cut_line).distance(shapely.Point(notch.base[0])) < 1e-5


@pytest.mark.parametrize(("cut", "said"), [(True, "seam 0.6/1 cm"), (False, "seam 0.6 cm")])
def test_the_label_tells_the_allowances_of_a_dart_that_is_cut_away(cut, said):
    widths = (0.006, None, 0.01, 0.006, 0.006, 0.006, 0.006)
    darts = [Dart(name="d", left="e1", right="e2", cut=cut)]
    piece = drafted_piece(polygon("p", DARTED, kinds=KINDS, widths=widths, darts=darts))
    assert f"Includes {said}" in [text for text, _ in piece.label.lines]


def test_legs_of_different_length_are_noted():
    corners = [(0, 0), (0.1, 0), (0.12, 0.15), (0.14, 0.004), (0.3, 0), (0.3, 0.3), (0, 0.3)]
    piece = drafted_piece(polygon("p", corners, kinds=KINDS, darts=[Dart(name="d", left="e1", right="e2")]))
    assert any("legs differ by 0.39 cm" in note or "legs differ by 0.4 cm" in note for note in piece.notes)


@pytest.mark.parametrize(
    ("units", "said"),
    [("cm", "fold 10 cm, sew 8 cm"), ("mm", "fold 100 mm, sew 80 mm"), ("in", "fold 3 15/16 in, sew 3 1/8 in")],
)
def test_notes_that_are_printed_are_in_the_units_of_the_pattern(units, said):
    pleat = Dart(name="d", left="e1", right="e2", pleat=0.08)
    piece = drafted_piece(replace(polygon("p", DARTED, kinds=KINDS, darts=[pleat]), units=units))
    assert piece.notes == (f"pleat d: {said} down from the edge",)


def test_a_fisheye_dart_is_marked_not_cut():
    eye = Hole(name="waist", kind="dart", points=np.array([(0.1, 0.05), (0.11, 0.15), (0.1, 0.25), (0.09, 0.15)]))
    out = Hole(name="pocket", points=np.array([(0.02, 0.02), (0.04, 0.02), (0.04, 0.04)]))
    piece = drafted_piece(square(holes=[eye, out]))
    assert set(piece.fisheyes) == {"waist"}
    assert set(piece.cutouts) == {"pocket"}
    tips = np.array([hole.at - piece.frame[:, 2] for hole in piece.drill_holes])
    np.testing.assert_allclose(tips[np.argsort(tips[:, 1])], [(0.1, 0.05), (0.1, 0.25)], atol=1e-12)


def test_a_hole_gets_its_allowance_inwards_or_a_note():
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    holes = [
        Hole(name="vent", points=0.05 + 0.05 * corners),
        Hole(name="eyelet", points=[0.15, 0.15] + 0.015 * corners),
        Hole(name="raw", points=[0.15, 0.05] + 0.015 * corners, allowance=0.0),
    ]
    piece = drafted_piece(square(holes=holes))
    vent, eyelet, raw = (piece.cutouts[name] for name in ("vent", "eyelet", "raw"))
    assert vent.width == 0.010
    assert shapely.Polygon(vent.sew_line).area == pytest.approx(0.05**2)
    assert shapely.Polygon(vent.cut_line).area == pytest.approx(0.03**2)
    assert shapely.Polygon(vent.sew_line).contains(shapely.Polygon(vent.cut_line))
    for hole in (eyelet, raw):
        assert hole.width == 0
        assert np.array_equal(hole.cut_line, hole.sew_line)
    assert piece.notes == ("eyelet is too small for an allowance of 1 cm: it is cut on its sewing line",)
    roles = {stroke.name: stroke.role for stroke in draw_piece(piece).strokes}
    assert (roles["vent"], roles["vent.sew"]) == ("cutout", "sew")
    assert "eyelet.sew" not in roles
    with pytest.raises(InputError, match="between 0 and"):
        Hole(name="vent", points=corners, allowance=-0.01)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([(0.09, 0.15), (0.1, 0.25), (0.11, 0.15), (0.1, 0.05)], "dart 'waist' overlaps by 1"),
        (
            [(0.1, 0.05), (0.105, 0.08), (0.095, 0.15), (0.1, 0.25), (0.105, 0.15), (0.095, 0.08)],
            "dart 'waist' overlaps",
        ),
    ],
)
def test_a_fisheye_dart_that_overlaps_is_no_dart(points, message):
    with pytest.raises(InputError, match=message):
        square(holes=[Hole(name="waist", kind="dart", points=np.array(points))])
    with pytest.raises(InputError, match="around hole 'pocket' lies on itself"):
        square(holes=[Hole(name="pocket", points=np.array(points))])


def test_sides_of_a_fisheye_dart_may_touch():
    points = [(0.1, 0.05), (0.1002, 0.08), (0.102, 0.15), (0.1, 0.25), (0.098, 0.15), (0.1003, 0.08)]
    piece = drafted_piece(square(holes=[Hole(name="waist", kind="dart", points=np.array(points))]))
    assert set(piece.fisheyes) == {"waist"}


def test_the_grain_points_up_and_nothing_is_scaled():
    grain = np.array([(0.05, 0.05), (0.15, 0.15)])
    piece = drafted_piece(square(grain=grain))
    assert piece.grain[1, 0] == pytest.approx(piece.grain[0, 0])
    assert piece.grain[1, 1] > piece.grain[0, 1]
    assert piece.frame[:, :2] @ piece.frame[:, :2].T == pytest.approx(np.eye(2))
    assert np.linalg.det(piece.frame[:, :2]) == pytest.approx(1.0)
    assert shapely.Polygon(piece.sew_line).area == pytest.approx(0.06)


def test_labels_lie_inside_and_off_the_grain_line(dress):
    for piece in dress.pieces["38"]:
        low = piece.label.at - [0.01, piece.label.height / 2]
        block = shapely.box(*low, *(2 * piece.label.at - low))
        assert shapely.Polygon(piece.sew_line).contains(block), piece.name
        assert not block.intersects(shapely.LineString(piece.grain)), piece.name


def frame(rim, name="frame", size="", **options):
    """A square of .2 by .3 m with a hole that leaves `rim` [m] around it."""
    hole = np.array([(rim, rim), (0.2 - rim, rim), (0.2 - rim, 0.3 - rim), (rim, 0.3 - rim)])
    piece = square(name, size, holes=[Hole(name="hole", points=hole)], **options)
    return piece, shapely.Polygon(piece.outline, [hole])


@pytest.mark.parametrize("rim", [0.08, 0.06, 0.03, 0.02, 0.012])
def test_labels_stand_on_the_cloth_not_in_a_hole(rim):
    piece, cloth = frame(rim)
    drafted = drafted_piece(piece, name="a rather long name of a garment")
    moved = shapely.transform(cloth, lambda points: points @ drafted.frame[:, :2].T + drafted.frame[:, 2])
    assert drafted.label.leader is None
    assert moved.covers(shapely.Polygon(drafted.label.box))
    assert moved.covers(shapely.LineString(drafted.grain)), "nor does the grain line"
    assert not shapely.Polygon(drafted.label.box).intersects(shapely.LineString(drafted.grain))


def test_a_label_without_room_stands_beside_the_piece_with_a_leader_to_it():
    piece, cloth = frame(0.004)
    drafted = drafted_piece(piece, name="tiny")
    moved = shapely.transform(cloth, lambda points: points @ drafted.frame[:, :2].T + drafted.frame[:, 2])
    label, cut = drafted.label, shapely.Polygon(drafted.cut_line)
    assert not cut.intersects(shapely.Polygon(label.box))
    assert moved.buffer(0.01).covers(shapely.Point(label.leader[1]))
    assert cut.covers(shapely.Point(label.leader[1]))
    assert not cut.covers(shapely.Point(label.leader[0]))
    assert [stroke.role for stroke in draw_piece(drafted).strokes].count("leader") == 1


def test_a_label_beside_a_piece_has_its_room_on_the_sheet_and_stands_beside_all_sizes():
    small = frame(0.004, size="38")[0]
    edges = [Edge(name=e.name, points=e.points * [1.1, 1]) for e in small.edges]
    wide = square("frame", "40", edges=edges, holes=small.holes)
    drafted = draft_garment(Pattern(name="frames", pieces={"40": [wide], "38": [small]}, seams=[]))
    sheet = lay_out(nests(drafted), width=1.0)
    (placed,) = sheet.placed
    label = nest_label(placed.pieces)
    assert all(not shapely.Polygon(p.cut_line).intersects(shapely.Polygon(label.box)) for p in placed.pieces)
    assert shapely.box(0.0, 0.0, *sheet.size).buffer(1e-9).covers(shapely.Polygon(label.box + placed.offset))


@pytest.mark.parametrize(
    ("name", "width", "height"),
    [
        ("crown_gore_lining_left", 0.07, 0.3),
        ("Front_side_panel_lower_left_lining", 0.15, 0.2),
        ("a_name_of_a_piece_that_is_so_long_that_it_ran_out_of_it_by_far_before", 0.2, 0.2),
        ("onewordthatcannotbebrokenanywhereatallhoweverlongitis", 0.1, 0.1),
        ("strap", 0.02, 0.5),
        ("MWWMWWMWWM", 0.03, 0.03),
    ],
)
def test_no_letter_leaves_the_piece_or_crosses_its_grain(name, width, height):
    edges = [Edge(name=e.name, points=e.points * [width / 0.2, height / 0.3]) for e in square().edges]
    drafted = drafted_piece(square(name, edges=edges), name="style")
    sewn, grain = shapely.Polygon(drafted.sew_line), shapely.LineString(drafted.grain)
    lines = [words for words in draw_piece(drafted).words if words.text not in {e.name for e in drafted.edges}]
    assert " ".join(words.text for words in lines).startswith(name.replace("_", " ").upper())
    for words in draw_piece(drafted).words:
        # The letters themselves, as matplotlib draws them.
        font = FontProperties(family="DejaVu Sans", weight="bold" if words.bold else "normal")
        path = TextPath((0, 0), words.text, size=words.height / 0.729, prop=font)
        low, high = np.array(path.get_extents().p0), np.array(path.get_extents().p1)
        turn = np.array([[np.cos(words.angle), -np.sin(words.angle)], [np.sin(words.angle), np.cos(words.angle)]])
        low[0], high[0] = np.array([-0.5, 0.5]) * (high[0] - low[0])
        corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])]) - [0, words.height / 2]
        box = shapely.Polygon(words.at + corners @ turn.T)
        assert sewn.covers(box), words.text
        assert not box.intersects(grain), words.text


def test_drafting_twice_gives_the_same_to_the_bit():
    once, again = (draft_garment(sample_dress(("38",))) for _ in range(2))
    for a, b in zip(once.pieces["38"], again.pieces["38"], strict=True):
        assert np.array_equal(a.cut_line, b.cut_line)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Edge(name="e", points=np.zeros((2, 2))), "no length"),
        (lambda: Edge(name="e", points=np.zeros((2, 3))), "#P by 2"),
        (lambda: Edge(name="e", points=np.array([[0, 0], [np.nan, 1]])), "not finite"),
        (lambda: Edge(name="e", points=np.eye(2), kind="sem"), "did you mean 'seam'"),
        (lambda: Edge(name="e", points=np.eye(2), allowance=10.0), "between 0 and 0.5"),
        (lambda: Edge(name="e", points=np.eye(2), kind="fold", allowance=0.01), "must be 0"),
        (lambda: square(edges=square().edges[:3]), "ends"),
        (lambda: square(edges=[Edge(name=e.name, points=e.points[::-1]) for e in square().edges[::-1]]), "clockwise"),
        (lambda: square(quantity=0), "at least 1"),
        (lambda: square(also={"fusible": 0}), "quantity is 0"),
        (lambda: square(marks={"button": (0.1, np.nan)}), "mark 'button': point 0 is not finite"),
        (lambda: square(grain=np.zeros((2, 2))), "two different points"),
        (lambda: square(darts=[Dart(name="d", left="top", right="left")]), "not 'dart'"),
        (
            lambda: square(edges=[*square().edges[:3], Edge(name="top", points=square().edges[3].points)]),
            "occurs twice",
        ),
        (lambda: Seam(name="s", sides=((), ())), "at least one edge"),
        (lambda: Pattern(name="g", pieces={}), "no pieces"),
        (lambda: Pattern(name="g", pieces={"38": [square()]}), "listed under"),
        (lambda: sample_dress(("39",)), "even numbers"),
    ],
)
def test_bad_input_is_one_line_that_says_what_is_right(make, message):
    with pytest.raises(InputError, match=message) as error:
        make()
    assert "\n" not in str(error.value)


def test_a_seam_that_names_a_wrong_edge_says_the_nearest():
    side = (SeamSide(piece="square", edge="botom"),)
    with pytest.raises(InputError, match="did you mean 'bottom'"):
        Pattern(name="g", pieces={"": [square()]}, seams=[Seam(name="s", sides=(side, side))])


@pytest.mark.parametrize("across", [0.1, 0.097, 0.05])
def test_the_grain_lies_beside_a_line_along_it_and_not_upon_it(across: float):
    line = np.array([[across, 0.0], [across, 0.3]])
    grain = np.array([[0.1, 0.05], [0.1, 0.25]])
    piece = drafted_piece(square(internal_lines={"fold line": line}, grain=grain))
    (drawn,) = piece.internal_lines.values()
    assert abs(drawn[0, 0] - piece.grain[0, 0]) > 0.003
    np.testing.assert_allclose(np.diff(piece.grain, axis=0), [[0.0, 0.2]], atol=1e-12)
    # A line across it moves nothing.
    crossed = drafted_piece(square(internal_lines={"level": np.array([[0.0, 0.1], [0.2, 0.1]])}, grain=grain))
    plain = drafted_piece(square(grain=grain))
    np.testing.assert_array_equal(crossed.grain, plain.grain)


def test_a_nest_on_paper_has_one_fold():
    def half(size: str, grown: float) -> Piece:
        corners = np.array([(0, 0), (0.2, 0), (0.2, 0.3), (0, 0.3), (0, 0)]) * [1.0, grown]
        edges = [
            Edge(name=name, points=corners[i : i + 2], kind="fold" if name == "left" else "seam")
            for i, name in enumerate(("bottom", "right", "top", "left"))
        ]
        return Piece(name="front", size=size, edges=edges)

    pieces = {size: [half(size, grown)] for size, grown in (("36", 1.0), ("38", 1.1), ("40", 1.05))}
    drafted = draft_garment(Pattern(name="skirt", pieces=pieces))
    drawings = draw_nest(tuple(row[0] for row in drafted.pieces.values()), OnPaper())
    seen = [
        drawing.piece.size
        for drawing in drawings
        for stroke in drawing.strokes
        if stroke.role == "fold" and not stroke.hidden
    ]
    assert seen == ["38"]


def test_a_size_stands_on_its_own_line_alone_and_whole_on_a_sheet():
    """Sizes 6 mm apart along their sides, of which the widest ends 3 mm beside a joint of two sheets."""
    sizes = {f"US {6 + 2 * k}": [replace(polygon("front", corners_of(0.2 + 0.006 * k, 0.5)), size=f"US {6 + 2 * k}")]
             for k in range(3)}  # fmt: skip
    drafted = draft_garment(Pattern(name="skirt", pieces=sizes))
    pieces = tuple(row[0] for row in drafted.pieces.values())
    joint = np.array([(0.225, -0.1), (0.225, 0.6)])
    drawings = draw_nest(pieces, OnPaper(joints=[joint]))
    tags = [(drawing.piece, words) for drawing in drawings for words in drawing.words if words.tag]
    assert len(tags) == 6
    for piece, words in tags:
        box = shapely.Polygon(words.box())
        assert box.disjoint(shapely.LineString(joint))
        assert [each.size for each in pieces if box.intersects(shapely.LinearRing(each.cut_line))] == [piece.size]
        assert not any(box.intersects(shapely.Polygon(each.box())) for _, each in tags if each is not words)


def test_a_piece_that_cannot_be_drawn_costs_itself_and_its_seams(monkeypatch: pytest.MonkeyPatch):
    """Of three squares sewn in a row, the middle one's label finds no place in a polygon that GEOS refuses."""

    def placed(piece: Piece, *rest: object) -> object:
        if piece.name == "middle":
            raise shapely.errors.GEOSException(
                "TopologyException: side location conflict at 0 0. This can occur if invalid."
            )
        return label(piece, *rest)

    label = draft.place_label
    monkeypatch.setattr(draft, "place_label", placed)
    names = ["left", "middle", "right", "other"]
    seams = [
        Seam(
            name=f"{a} to {b}",
            sides=((SeamSide(piece=a, edge="right"),), (SeamSide(piece=b, edge="left", reversed=True),)),
        )
        for a, b in pairwise(names)
    ]
    heard: list[LeftOut] = []
    with listening_to_left_out(heard.append):
        drafted = draft_garment(Pattern(name="row", pieces={"": [square(name) for name in names]}, seams=seams))
    assert drafted.piece_names == ("left", "right", "other")
    assert [seam.name for seam in drafted.pattern.seams] == ["right to other"]
    (note,) = (each.note for each in heard)
    assert note.startswith("middle was left out of the pattern: its lines lie over each other as they are drawn")
    assert "This can" not in note
    with pytest.raises(InputError, match="none of the pieces"):
        drafted.pattern.without(["left", "right", "other"])


def test_edges_that_cross_once_they_are_drawn_keep_to_their_layout():
    """Both long sides of a sliver, whose curves bulge across each other: each is drawn as its chords."""
    x = np.linspace(0.0, 0.2, 21)
    low, high = (np.column_stack([x, level * np.sin(np.pi * x / 0.2)]) for level in (0.01, 0.0102))
    edges = [Edge(name="low", points=low), Edge(name="high", points=high[::-1])]
    piece = Piece(name="sliver", edges=edges)
    lines = {("sliver", edge.name): edge.points for edge in edges}
    curves = {key: fit_curve(line) for key, line in lines.items()}
    assert uncrossed([piece], lines, curves) == curves
    wavy = np.column_stack([x, low[:, 1] + 0.002 * np.sin(np.pi * x / 0.1)])
    swollen = curves | {("sliver", "low"): fit_curve(wavy)}
    clean = uncrossed([piece], lines, swollen)
    for key, line in lines.items():
        np.testing.assert_allclose(clean[key].sample(), line, atol=1e-9)
