"""Garments on a mannequin, and surfaces with their cuts, as patterns: edges, kinds, seams, notches, grain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from bodies import body_of_size

from warpflat.core.errors import InputError
from warpflat.flat.cutting.cut_piece import cut
from warpflat.flat.cutting.cut_plan import CutPlan
from warpflat.flat.cutting.separate_pieces import separate
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.form_plan import plan_form
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.to_pattern import pattern_of_garment, pattern_of_surface
from warpflat.garment.mannequin.forms import form_from_mapping
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.edge_rules import EdgeRules

FORMS = ("basic_block", "tshirt", "dress", "princess_dress", "a_line_skirt")
SIZES = ("EU 36", "EU 38", "EU 40", "EU 44")


@pytest.fixture(scope="module")
def mannequins() -> dict[str, Mannequin]:
    return {size: body_of_size(35.0, size) for size in SIZES}


@pytest.fixture(scope="module")
def shirt() -> Garment:
    # Edges of 35 mm are too coarse for what sides of a seam may differ by where an armhole bends: .21 mm of .2.
    body = body_of_size(20.0)
    return flatten_form(body, body.form("tshirt"), fabric="interlock")


# --- what edges are


def kinds(plan, piece):
    return {edge.name: edge.kind for edge in plan.edges[piece]}


def test_seams_hems_and_finished_edges_follow_from_the_form(mannequins):
    body = mannequins["EU 38"]
    block = plan_form(body.form("basic_block"))
    assert set(kinds(block, "front_bodice").values()) == {"seam"}
    assert kinds(block, "front_skirt")["knee"] == "hem"
    skirt = kinds(plan_form(body.form("a_line_skirt")), "back")
    assert skirt == {"knee": "hem", "side right": "seam", "waist": "seam", "side left": "seam"}
    shirt = plan_form(body.form("tshirt"))
    assert kinds(shirt, "front")["hip"] == "hem"
    assert kinds(shirt, "front")["neck"] == "seam"
    assert kinds(shirt, "sleeve_left")["biceps left"] == "hem"


def test_a_half_has_its_centre_on_the_fold_and_its_sleeves_in_pairs(mannequins):
    plan = plan_form(mannequins["EU 38"].form("tshirt", half=True))
    assert kinds(plan, "front")["centre front"] == "fold"
    assert dict(plan.quantities) == {"front": 1, "back": 1, "sleeve_left": 2}
    whole = plan_form(mannequins["EU 38"].form("tshirt"))
    assert set(whole.quantities.values()) == {1}


def test_an_edge_sewn_to_several_whole_edges_stays_one(mannequins):
    plan = plan_form(mannequins["EU 38"].form("tshirt"))
    seam = next(seam for seam in plan.seams if seam.name == "armhole left")
    chain, cap = seam.sides
    assert {str(side) for side in chain} == {"front.armhole left", "back.armhole left"}
    assert [str(side) for side in cap] == ["sleeve_left.armhole left"]
    assert len({side.reversed for side in chain}) == 1, "front and back lie on the same side of the cap"


def test_a_line_that_leaves_the_border_is_drawn_inside_and_carries_the_grain(mannequins):
    """An asymmetric front: its centre is the border from the neck to the chest, and inside the piece from there to the hip."""
    bricks = ["shoulder-hip/front-right-*", "chest-hip/front-left-centre"]
    form = form_from_mapping("over", {"pieces": {"front": {"bricks": bricks, "datum": "centre front"}}})
    body = mannequins["EU 38"]
    garment = flatten_form(body, body.form(form), fabric="woven")
    flat, piece = garment.pieces["front"], garment.form.pieces["front"]
    pattern, _ = pattern_of_garment({"": garment}, name="over")
    drawn = pattern.pieces[""][0].internal_lines["centre front"]
    # From hip to chest, as the edge of its name begins there.
    edge = flat.positions[piece.edges["centre front"]]
    assert np.ptp(drawn[:, 1]) > 2 * np.ptp(edge[:, 1])
    # To a micrometre, as layouts are drafted.
    assert np.abs(edge - drawn[-1]).sum(axis=1).min() < 2e-6
    # The whole line's chord is upright, not that of its short edge.
    whole = flat.positions[flat.datum]
    assert abs(whole[-1, 0] - whole[0, 0]) < 1e-6
    assert len(whole) == len(drawn) + len(edge) - 1


def test_an_edge_that_is_sewn_in_part_is_split_there(mannequins):
    """A skirt's front between the side seams, its sides longer than those of a back that ends at the thigh."""
    form = form_from_mapping(
        "odd",
        {
            "pieces": {
                "front": {"bricks": ["waist-knee/front-*"], "datum": "centre front"},
                "back": {"bricks": ["waist-thigh/back-*"], "datum": "centre back"},
            }
        },
    )
    result = mannequins["EU 38"].form(form)
    plan = plan_form(result)
    sides = [edge for edge in plan.edges["front"] if edge.source == "side left"]
    assert {edge.name for edge in sides} == {"side left", "side left 2"}
    assert sorted(edge.first for edge in sides) == [0, min(edge.last for edge in sides)]
    seam = next(seam for seam in plan.seams if seam.name == "side left")
    assert {str(side) for side in seam.stretches} == {"front.side left", "back.side left"}
    sewn = next(edge for edge in sides if edge.name == "side left")
    assert sewn.last - sewn.first == len(result.pieces["back"].edges["side left"]) - 1
    assert kinds(plan, "back")["thigh"] == "hem"


def test_rules_change_kinds_and_allowances_and_are_checked(mannequins):
    form = mannequins["EU 38"].form("tshirt")
    rules = EdgeRules(seam=0.007, hem=0.02, kinds={"neck": "cut", "front.hip": "seam"}, allowances={"back.hip": 0.04})
    plan = plan_form(form, rules)
    assert kinds(plan, "front")["neck"] == kinds(plan, "back")["neck"] == "cut"
    assert kinds(plan, "front")["hip"] == "seam"
    assert rules.allowance("back", "hip", "hem") == 0.04
    assert rules.allowance("front", "hip", "seam") == 0.007
    with pytest.raises(InputError, match=r"no piece has an edge 'nek'.*neck"):
        plan_form(form, EdgeRules(kinds={"nek": "hem"}))
    with pytest.raises(InputError, match="unknown kind 'hemm'"):
        plan_form(form, EdgeRules(kinds={"neck": "hemm"}))
    with pytest.raises(InputError, match="there is no seam 'armhol left'"):
        plan_form(form, EdgeRules(ease={"armhol left": 0.03}))


# --- flat garments


def test_the_pattern_lies_on_the_flat_mesh(shirt: Garment):
    pattern, notes = pattern_of_garment({"EU 38": shirt}, name="shirt")
    assert notes == ("sleeve_left: cut twice, once mirrored, it serves for sleeve_right too",)
    even = shirt.evened()
    for piece in pattern.pieces["EU 38"]:
        flat, form = even[piece.name], shirt.form.pieces[piece.name]
        np.testing.assert_allclose(flat, shirt.pieces[piece.name].positions, atol=5e-5)
        assert [edge.name for edge in piece.edges] == list(form.edges)
        for edge in piece.edges:
            np.testing.assert_array_equal(edge.points, np.round(flat[form.edges[edge.name]], 6))
        assert piece.fabric == "interlock"
        assert not set(piece.internal_lines) & set(form.edges)
    front = pattern.piece("front", "EU 38")
    assert {"bust", "waist", "princess front left", "centre front"} <= set(front.internal_lines)
    centre = shirt.pieces["front"].positions[shirt.pieces["front"].datum]
    assert front.grain is not None
    assert front.grain[0, 0] == pytest.approx(front.grain[1, 0], abs=1e-9)
    assert front.grain[0, 0] == pytest.approx(centre[:, 0].mean(), abs=1e-6), "on the centre line"


def test_of_a_pair_one_is_drawn_and_sewn_at_the_seams_of_both(shirt: Garment):
    pattern, _ = pattern_of_garment({"EU 38": shirt}, name="shirt")
    assert {piece.name: piece.quantity for piece in pattern} == {"front": 1, "back": 1, "sleeve_left": 2}
    drafted = draft_garment(pattern)
    front, back, sleeve = drafted.pieces["EU 38"]
    assert "Cut 2, 1 mirrored - interlock" in [text for text, _ in sleeve.label.lines]
    reports = {report.name: report for report in drafted.seams}
    assert set(reports) == {
        f"{seam} {side}" for seam in ("armhole", "side", "shoulder", "underarm") for side in ("left", "right")
    }
    assert all(report.matches for report in reports.values())
    assert reports["armhole right"].sides[1] == "sleeve_left.armhole left (mirrored)"
    # Each half of the body has the notches at which the cap, turned over for the right one, has its own.
    cap = sorted(notch.length for notch in sleeve.notches if notch.edge == "armhole left")
    for side in ("left", "right"):
        marks = [n.length for piece in (back, front) for n in piece.notches if n.edge == f"armhole {side}"]
        assert len(cap) == len(marks) + 1, "and one for the shoulder"
        assert all(min(abs(mark - own) for own in cap) < 5e-4 for mark in marks)
    assert {notch.seam for notch in sleeve.notches} <= {"armhole left", "underarm left"}


def test_pairs_that_are_ruled_differently_are_both_drawn(shirt: Garment):
    rules = EdgeRules(allowances={"sleeve_right.biceps right": 0.05})
    pattern, notes = pattern_of_garment({"EU 38": shirt}, name="shirt", rules=rules)
    assert notes == ()
    assert {piece.name: piece.quantity for piece in pattern} == dict.fromkeys(shirt.pieces, 1)


def test_the_grain_turns_with_the_bias(shirt: Garment):
    tilted = replace(shirt, pieces={n: replace(p, grain_angle=45.0) for n, p in shirt.pieces.items()})
    pattern, _ = pattern_of_garment({"": tilted}, name="shirt")
    for piece in pattern:
        assert piece.grain is not None
        along = piece.grain[1] - piece.grain[0]
        assert np.degrees(np.arctan2(along[1], along[0])) == pytest.approx(135.0)


@pytest.fixture(scope="module")
def half_skirt(mannequins: dict[str, Mannequin]) -> Garment:
    body = mannequins["EU 38"]
    return flatten_form(body, body.form("a_line_skirt", half=True), fabric="denim")


def turned(garment: Garment, angle: float) -> Garment:
    return replace(garment, pieces={n: replace(p, grain_angle=angle) for n, p in garment.pieces.items()})


@pytest.mark.parametrize("angle", [30.0, 45.0, -0.5, 135.0])
def test_a_half_on_the_fold_has_no_oblique_grain(half_skirt: Garment, angle: float):
    tilted = turned(half_skirt, angle)
    with pytest.raises(InputError, match=r"front, back on the fold, with the grain at .*half = false.* = \"seam\""):
        pattern_of_garment({"EU 38": tilted}, name="skirt")
    # Sewn there, one half is cut twice, the second mirrored: that is the cloth that is flattened.
    rules = EdgeRules(kinds={"centre front": "seam", "centre back": "seam"})
    pattern, _ = pattern_of_garment({"EU 38": tilted}, name="skirt", rules=rules)
    assert {(piece.name, piece.quantity, piece.on_fold) for piece in pattern} == {
        ("front", 2, False), ("back", 2, False)
    }  # fmt: skip


@pytest.mark.parametrize("angle", [0.0, 90.0, -90.0, 180.0, 270.0, -360.0])
def test_a_half_on_the_fold_has_its_grain_along_or_across_it(half_skirt: Garment, angle: float):
    pattern, _ = pattern_of_garment({"EU 38": turned(half_skirt, angle)}, name="skirt")
    assert all(piece.on_fold and piece.quantity == 1 for piece in pattern)


@pytest.mark.parametrize(
    ("form", "half"), [*((form, True) for form in FORMS), *((form, False) for form in ("tshirt", "princess_dress"))]
)  # fmt: skip
def test_every_form_can_be_cut_and_sewn(form: str, half: bool, mannequins: dict[str, Mannequin]):
    """Allowances valid and around the sewing line, the same notches on both sides of every seam, at both ends of the
    range of sizes."""
    sizes = ("EU 44",) if half else ("EU 36",)
    bodies = {size: mannequins[size] for size in sizes}
    if form == "tshirt":
        # Edges of 35 mm leave two cells to the scoop of an armhole that ends below the armpit. It turns by 42 degrees at
        # the vertex between them on EU 36, and a curve as long as its chords runs 1.8 mm inside: .204 mm of .2.
        bodies = {size: body_of_size(25.0, size) for size in sizes}
    garments = {size: flatten_form(body, body.form(form, half=half), fabric="woven") for size, body in bodies.items()}
    pattern, notes = pattern_of_garment(garments, name=form)
    assert all("cut twice, once mirrored" in note for note in notes)
    drafted = draft_garment(pattern)
    for size, pieces in drafted.pieces.items():
        for piece in pieces:
            assert piece.notes == ()
            # How far an arc as long as the mesh's chords runs inside them: by the square of the mesh's width.
            assert max(edge.fit_error for edge in piece.edges) < 0.0025
            cut_line, sew_line = shapely.Polygon(piece.cut_line), shapely.Polygon(piece.sew_line)
            assert cut_line.is_valid, (size, piece.name)
            assert sew_line.is_valid, (size, piece.name)
            assert cut_line.buffer(1e-6).contains(sew_line), (size, piece.name)
            assert piece.piece.on_fold == (half and any(edge.kind == "fold" for edge in piece.edges))
            for edge in piece.edges:
                if edge.kind == "fold":
                    assert piece.piece.quantity == 1
        for seam in pattern.seams:
            marks = [
                sorted(
                    notch.length
                    for piece in pieces
                    for notch in piece.notches
                    if notch.seam == seam.name and (piece.name, notch.edge) in {s.place for s in side}
                )
                for side in seam.sides
            ]
            if any(s.mirrored for side in seam.sides for s in side):
                assert not any(row for row, side in zip(marks, seam.sides, strict=True) if side[0].mirrored)
                report = next(r for r in drafted.seams if r.name == seam.name and r.size == size)
                assert report.matches, (size, seam.name)
                continue
            report = next(r for r in drafted.seams if r.name == seam.name and r.size == size)
            shares = [[m * 1000 / length for m in row] for row, length in zip(marks, report.length_mm, strict=True)]
            joints = len(seam.sides[0]) - 1
            assert len(shares[1]) == len(shares[0]) + joints, (size, seam.name)
            if not joints:
                np.testing.assert_allclose(*shares, atol=1e-9)
            assert abs(report.difference_mm) < 0.5, (size, seam.name)
            assert report.local_mm is not None
            assert report.local_mm < 0.2, (size, seam.name)
            assert report.matches
            if min(report.length_mm) > 100:
                assert marks[0], (size, seam.name)


def test_a_centre_that_is_not_straight_is_sewn(half_skirt: Garment):
    flat, form = half_skirt.pieces["front"], half_skirt.form.pieces["front"]
    bent = flat.positions.copy()
    row = form.edges["centre front"]
    along = np.linspace(0, np.pi, len(row))
    bent[row, 0] += np.sign(flat.positions[:, 0].mean() - flat.positions[row[0], 0]) * 0.006 * np.sin(along)
    garment = replace(half_skirt, pieces={**half_skirt.pieces, "front": replace(flat, positions=bent)})
    pattern, notes = pattern_of_garment({"": garment}, name="skirt")
    assert [note for note in notes if note.startswith("front: centre front bends by 6.0 mm")] == list(notes)
    front = pattern.piece("front", "")
    assert front.edge("centre front").kind == "seam"
    assert front.quantity == 2
    assert pattern.piece("back", "").quantity == 1
    drafted = draft_garment(pattern)
    marks = [n for n in drafted.pieces[""][0].notches if n.seam == "centre front"]
    assert len(marks) == len({round(n.length, 6) for n in marks}) > 0, "once each: both sides are one edge"


# --- surfaces


def test_a_parted_surface_is_sewn_together_again():
    surface = make_shape("cylinder", resolution=12)
    whole = flatten(surface)
    line = next(name for name in ("centre", "middle", *surface.lines) if name in surface.lines)
    parted = separate(cut(whole, CutPlan(name="princess", paths=(surface.lines[line],))))
    assert len(parted) == 2
    pattern, _ = pattern_of_surface(parted, name="tube")
    assert len(pattern.seams) == 1
    (seam,) = pattern.seams
    assert {side[0].piece for side in seam.sides} == {piece.surface.name for piece in parted}
    drafted = draft_garment(pattern)
    assert abs(drafted.seams[0].difference_mm) < 0.5
    assert all(any(n.seam == seam.name for n in piece.notches) for piece in drafted.pieces[""])


def test_of_layouts_that_differ_by_rounding_errors_one_pattern_is_drawn():
    flat = flatten(make_shape("bodice", resolution=13), datum="centre", fabric="woven")
    known = np.round(flat.positions, 6)
    near = known + 1e-10 * np.random.default_rng(0).normal(size=known.shape)
    assert (near != known).all()
    first, second = (pattern_of_surface([replace(flat, positions=at)], name="p")[0] for at in (known, near))
    lines, others = ([edge.points for edge in pattern.pieces[""][0].edges] for pattern in (first, second))
    for line, other in zip(lines, others, strict=True):
        np.testing.assert_array_equal(line, other)


def test_an_edge_is_sewn_to_a_row_of_edges_that_corners_part():
    # Beside a straight border the one piece is flat; the other is folded twice at its middle, and has a corner there in the plane.
    border = np.array([[0.0, -0.2, 0.0], [0.0, 0.0, 0.0], [0.0, 0.2, 0.0]])
    flat_side = np.vstack([border, [[-0.3, -0.2, 0.0], [-0.3, 0.0, 0.0], [-0.3, 0.2, 0.0]]])
    folds = np.array([[0.2, -0.3, 1.0], [1.0, 0.3, -0.8]])
    folded = np.vstack([border, 0.3 * folds / np.linalg.norm(folds, axis=1)[:, None]])
    surfaces = [
        make_surface(flat_side, np.array([[1, 0, 3, 4], [2, 1, 4, 5]]), name="plain"),
        make_surface(folded, np.array([[0, 1, 3, -1], [3, 1, 4, -1], [4, 1, 2, -1]]), name="bent"),
    ]
    pieces = [flatten(each) for each in surfaces]
    pattern, _ = pattern_of_surface(pieces, name="two")
    (seam,) = pattern.seams
    plain, bent = sorted(seam.sides, key=len)
    assert [side.piece for side in (*plain, *bent)] == ["plain", "bent", "bent"]
    # The row runs the other way round its piece, beginning with the edge of its last vertices.
    assert {side.reversed for side in bent} == {not plain[0].reversed}
    drafted = draft_garment(pattern)
    assert abs(drafted.seams[0].difference_mm) < 1.0
    edges = {edge.name: edge.vertices for edge in pattern.pieces[""][1].edges}
    row = [edges[side.edge] for side in bent]
    assert row[0][0 if bent[0].reversed else -1] == row[1][-1 if bent[0].reversed else 0] == 1
