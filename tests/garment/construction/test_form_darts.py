"""Darts in the pieces of a form: placed, sewn and drawn."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import body_of_size

from warpflat.app.scene.load import make_scene
from warpflat.app.scene.plan import plan_form_scene
from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.flat.surface.overlap import OVERLAP
from warpflat.garment.construction.darts import closed_darts, open_length
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.to_pattern import pattern_of_garment
from warpflat.garment.mannequin.bricks import select_bricks
from warpflat.garment.mannequin.darts import FormDart
from warpflat.garment.mannequin.ease import ease_from
from warpflat.garment.mannequin.forms import form_from_mapping, shipped_form
from warpflat.garment.mannequin.part_pieces import part_pieces, princess_seams
from warpflat.garment.mannequin.shapes import shaped_form
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.half_pieces import halved


@pytest.fixture(scope="module")
def body():
    return body_of_size(20.0)


@pytest.fixture(scope="module")
def block(body):
    eased = replace(shipped_form("basic_block"), ease=ease_from("close", "test"))
    return shaped_form(body.layout, eased, "darts", body.vertices)


@pytest.fixture(scope="module")
def sewn(body, block):
    """The block with a front waist dart of 50 mm."""
    darts = [
        replace(dart, mouth_mm=50.0) if (dart.piece, dart.name) == ("front_bodice", "waist dart") else dart
        for dart in block.darts
    ]
    return flatten_form(body, body.form(replace(block, darts=tuple(darts))))


def test_names_of_seams_stay_with_darts(body, block):
    plain, darted = body.form("basic_block"), body.form(block)
    assert [(s.name, s.pieces, s.edges) for s in darted.seams] == [(s.name, s.pieces, s.edges) for s in plain.seams]
    for seam, without in zip(darted.seams, plain.seams, strict=True):
        for side, name in enumerate(seam.pieces):
            rows = [darted.pieces[name].grid_vertices[run.vertices[side]] for run in seam.runs]
            joined = [*rows[0], *(v for row in rows[1:] for v in row[1:])]
            there = plain.pieces[name].grid_vertices[without.runs[0].vertices[side]].tolist()
            assert joined in (there, there[::-1])
    legs = {(n, leg) for n, p in darted.pieces.items() for dart in p.darts.values() for leg in dart}
    assert len(legs) == 2 * 12
    sides = {(n, e) for s in darted.seams for run in s.runs for n, e in zip(s.pieces, run.edges, strict=True)}
    assert not legs & sides


def test_darts_end_before_the_bust_point(body, block):
    form = body.form(block)
    found = {(d.piece, d.name): d for d in form.darts}
    bust = found["front_bodice", "bust dart left"]
    assert bust.to_point == pytest.approx(0.025, abs=0.011)
    apex = form.vertices[body.layout.rings[body.layout.level_row["bust"], body.layout.to_princess]]
    assert np.linalg.norm(form.vertices[bust.row[-1]] - apex) == pytest.approx(bust.to_point, abs=0.002)
    back = form.vertices[found["back_skirt", "waist dart left"].row]
    assert np.linalg.norm(np.diff(back, axis=0), axis=1).sum() == pytest.approx(0.130, abs=0.011)
    mirrored = found["front_bodice", "bust dart right"]
    np.testing.assert_array_equal(body.layout.mirror[bust.row], mirrored.row)


def test_half_pieces_have_the_left_darts(body, block):
    half = body.form(block, half=True)
    assert list(half.pieces["front_bodice"].darts) == ["bust dart left", "waist dart left"]


def test_legs_are_sewn_and_the_mouth_kept(sewn):
    assert sewn.sewn.converged
    assert sewn.sewn.largest_difference < 2e-4
    front = {dart["name"]: dart for dart in sewn.metrics()["pieces"]["front_bodice"]["darts"]}
    assert front["waist dart left"]["intake_m"] == pytest.approx(0.050, abs=2e-4)
    assert front["bust dart left"]["intake_m"] == pytest.approx(front["bust dart right"]["intake_m"], abs=2e-4)
    for dart in front.values():
        assert dart["legs_m"][0] == pytest.approx(dart["legs_m"][1], abs=2e-4)
    prices = {result.name: result.cost for result in sewn.sewn.results}
    assert prices["front_bodice.waist dart left mouth 50 mm"] >= 0.0
    back = {dart["name"]: dart["intake_m"] for dart in sewn.metrics()["pieces"]["back_skirt"]["darts"]}
    assert back["waist dart left"] == pytest.approx(back["second waist dart left"], abs=2e-4)


def test_girths_are_the_body_and_its_ease(body, sewn):
    girths = sewn.metrics()["girths"]
    levels = ["bust", "underbust", "waist", "abdomen", "hip", "thigh", "knee"]
    assert list(girths) == [*levels, "neck", "armhole left", "armhole right"]
    wanted = {level: girth["ease_wanted_m"] for level, girth in girths.items() if "ease_wanted_m" in girth}
    assert wanted == pytest.approx({"bust": 0.05, "waist": 0.025, "hip": 0.03})
    # The skirt bridges the small of the back: it has more than the 3 cm of the preset there.
    assert 0.03 < girths["abdomen"]["ease_m"] < 0.06
    for level, ease in wanted.items():
        assert girths[level]["body_m"] == pytest.approx(body.levels()[level].girth)
        assert girths[level]["ease_m"] == pytest.approx(ease, abs=2e-3)


@pytest.mark.parametrize(
    ("ease", "message"),
    [
        ("clos", "did you mean 'close'"),
        ({"hips": 2.0}, "did you mean 'hip'"),
        ({"hip": "wide"}, "a number from -30 to 400 cm is needed"),
        (3, "a preset or a table of levels"),
    ],
)
def test_ease_that_cannot_be(ease, message):
    with pytest.raises(InputError, match=message):
        ease_from(ease, "scene")


def test_ease_of_a_preset_and_of_a_level():
    assert ease_from({"preset": "loose", "hip": 10}, "scene")["hip"] == 10.0
    assert ease_from({"hip": 10}, "scene", base={"hip": 1.0, "waist": 2.0}) == {"hip": 10.0, "waist": 2.0}


def test_the_front_wants_its_darts(body, sewn):
    plain = flatten_form(body, body.form("basic_block"), sewn=False).pieces["front_bodice"]
    darted = sewn.pieces["front_bodice"]
    assert darted.stages[-1].model_energy_j < 0.3 * plain.stages[-1].model_energy_j


def test_the_pattern_has_darts_and_whole_seams(sewn):
    pattern, _ = pattern_of_garment({"": sewn}, name="block")
    seams = {seam.name: seam for seam in pattern.seams}
    assert [side.edge for side in seams["front waist"].sides[0]] == ["waist", "waist 2", "waist 3"]
    assert {dart.name for dart in pattern.piece("front_bodice", "").darts} >= {"bust dart left", "waist dart right"}
    lengths = [sum(pattern.piece(s.piece, "").edge(s.edge).length for s in side) for side in seams["front waist"].sides]
    assert lengths[0] == pytest.approx(lengths[1], abs=2e-4)


def test_a_dart_without_an_end_of_its_own_takes_its_part(body):
    dart = FormDart(name="neck dart", piece="back_bodice", line="princess back left", part=(1.0, 0.8))
    placed = body.form(replace(shipped_form("basic_block"), darts=(dart,))).darts
    assert [d.name for d in placed] == ["neck dart left", "neck dart right"]
    assert int(placed[0].row[0]) in body.layout.lines["shoulder left"]


@pytest.mark.parametrize(
    ("dart", "message"),
    [
        ({"piece": "front_bodic", "line": "bust"}, "no piece 'front_bodic'"),
        ({"piece": "front_bodice", "line": "bustt"}, "line 'bustt' is unknown"),
        ({"piece": "front_bodice", "line": "hip"}, "does not run from the border into piece 'front_bodice'"),
        ({"piece": "front_bodice", "line": "underbust"}, "give its part"),
        ({"piece": "front_bodice", "line": "bust", "part": (0.2, 0.2)}, "has no length"),
        ({"piece": "front_bodice", "line": "bust", "part": (0.2, 0.21)}, "two mesh edges away"),
        ({"piece": "front_bodice", "line": "bust", "part": (0.0, 1.0)}, "inside it"),
    ],
)
def test_darts_that_cannot_be(body, dart, message):
    with pytest.raises(InputError, match=message):
        body.form(replace(shipped_form("basic_block"), darts=(FormDart(name="d", **dart),)))


def test_legs_that_overlap_close_where_they_meet():
    x = np.linspace(0.0, 0.1, 6)
    left = np.column_stack([x, [0.01, 0.006, 0.002, -2e-5, -1e-5, 0.0]])
    count, overlap = open_length(left, left * [1.0, -1.0])
    assert count == 3
    assert overlap == pytest.approx(4e-5, rel=0.05)
    assert open_length(np.column_stack([x, 0.01 - 0.1 * x]), np.column_stack([x, 0.1 * x - 0.01])) == (6, 0.0)


def test_a_dress_has_darts_with_two_tips(body):
    eased = replace(shipped_form("dress"), ease=ease_from("close", "test"))
    darts = shaped_form(body.layout, eased, "darts", body.vertices).darts
    assert [(d.piece, d.name) for d in darts] == [
        ("front", "bust dart"),
        ("front", "waist dart"),
        ("back", "waist dart"),
    ]
    form = body.form(shaped_form(body.layout, eased, "darts", body.vertices))
    waist, bust = (body.layout.lines[level] for level in ("waist", "bust"))
    for piece in form.pieces.values():
        assert set(piece.fisheyes) == {"waist dart left", "waist dart right"}
        for left, right in piece.fisheyes.values():
            # The legs part at one tip and meet at the other.
            assert (left[0], left[-1]) == (right[0], right[-1])
            assert not set(left[1:-1]) & set(right)
            row = piece.grid_vertices[left]
            assert np.array_equal(row, piece.grid_vertices[right])
            assert np.isin(row[1:-1], waist).sum() == 1
            heights = form.vertices[row, 1]
            assert heights[0] < form.vertices[bust[0], 1] - 0.01
            assert form.vertices[waist, 1].mean() - heights[-1] == pytest.approx(0.12, abs=0.03)

    sewn, plain = (flatten_form(body, each, curves_mm=0.0) for each in (form, body.form(eased)))
    energy = [sum(p.stages[-1].model_energy_j for p in garment.pieces.values()) for garment in (sewn, plain)]
    assert energy[0] < 0.4 * energy[1]
    for name, piece in form.pieces.items():
        flat = sewn.pieces[name].positions
        for left, right in piece.fisheyes.values():
            assert np.linalg.norm(flat[left] - flat[right], axis=1).max() > 0.01
            assert polyline_length(flat[left]) == pytest.approx(polyline_length(flat[right]), abs=1e-4)
            assert open_length(flat[left], flat[right])[1] < OVERLAP
    assert closed_darts(form, {name: piece.positions for name, piece in sewn.pieces.items()}) == []

    pattern, _ = pattern_of_garment({"": sewn}, name="dress")
    assert {(hole.name, hole.kind) for hole in pattern.piece("back", "").holes} == {
        ("waist dart left", "dart"), ("waist dart right", "dart")
    }  # fmt: skip
    # On the fold of the cloth half of the piece is drawn, with its own dart.
    half = next(p for p in halved(draft_garment(pattern)).pieces[""] if p.name == "back")
    assert half.piece.on_fold
    assert list(half.fisheyes) == ["waist dart"]


def test_the_width_of_a_dart_with_two_tips_can_be_asked_for(body):
    dart = FormDart(name="eye", piece="front", line="princess front left", part=(0.5, 0.8), mouth_mm=12.0)
    form = body.form(replace(shipped_form("a_line_skirt"), darts=(dart,)))
    sewn = flatten_form(body, form, curves_mm=0)
    left, right = form.pieces["front"].fisheyes["eye left"]
    middle = len(left) // 2
    flat = sewn.pieces["front"].positions
    assert np.linalg.norm(flat[left[middle]] - flat[right[middle]]) == pytest.approx(0.012, abs=2e-4)


def test_princess_seams_part_the_pieces(body):
    form = body.form(shaped_form(body.layout, shipped_form("bodice"), "princess", body.vertices))
    assert list(form.pieces) == [
        f"{face}_{part}" for face in ("front", "back") for part in ("centre", "side_left", "side_right")
    ]
    assert "princess front left" in {seam.name for seam in form.seams}
    # So are those of one side of the body.
    half = form_from_mapping("vest", {"pieces": {"front_left": {"bricks": ["shoulder-waist/front-left-*"]}}})
    bricks = select_bricks(body.layout, half.pieces["front_left"].bricks)
    parted = part_pieces(body.layout, body.vertices, half, princess_seams(body.layout, bricks, "front_left"))
    datums = {name: piece.datum for name, piece in parted.pieces.items()}
    assert datums == {"front_left_centre": "princess front left", "front_left_side_left": "princess front left"}
    own = form_from_mapping(
        "sleeve", {"pieces": {"arm": {"bricks": ["armhole-biceps/arm-left-*"], "open": ["underarm left"]}}}
    )
    assert shaped_form(body.layout, own, "princess", body.vertices).pieces == own.pieces


def test_darts_whose_legs_overlap_are_refused(sewn):
    bodice = sewn.pieces["front_bodice"]
    left, right = (sewn.form.pieces["front_bodice"].edges[f"waist dart left.{leg}"] for leg in ("left", "right"))
    turned = bodice.positions.copy()
    turned[left[:-1]], turned[right[1:]] = bodice.positions[right[:0:-1]], bodice.positions[left[-2::-1]]
    crossed = {**sewn.pieces, "front_bodice": replace(bodice, positions=turned)}
    with pytest.raises(InputError, match="dart 'waist dart left' overlaps at its mouth"):
        pattern_of_garment({"": replace(sewn, pieces=crossed)}, name="block")


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"cuts": [{"line": "bust"}]}, r"cuts\[0\]: on a form a dart needs its piece"),
        ({"cuts": [{"line": "bust", "piece": "front"}]}, "cuts: dart 'bust': no piece 'front'"),
        ({"cuts": [{"line": "bust", "piece": "front_bodice", "tip_back": 0.02}]}, "give tip_mm"),
        ({"ease": "clos"}, "ease 'clos' is unknown"),
        ({"auto_cut": {}, "shape": "auto"}, r"give \[auto_cut\] or shape"),
    ],
)
def test_scenes_that_ask_for_impossible_shapes(tmp_path, more, message):
    table = {"form": "basic_block", "mannequin": {"size": "EU 38", "resolution_mm": 40}, **more}
    with pytest.raises(InputError, match=message):
        plan_form_scene(make_scene(table, name="x", folder=tmp_path, where="x.toml"))


def test_a_cut_of_a_scene_replaces_the_dart_along_its_line(tmp_path):
    cut = {"line": "princess front left", "piece": "front_bodice", "mouth_mm": 50}
    table = {
        "form": "basic_block",
        "shape": "darts",
        "ease": "close",
        "mannequin": {"size": "EU 38", "resolution_mm": 40},
    }
    plan = plan_form_scene(make_scene({**table, "cuts": [cut]}, name="x", folder=tmp_path, where="x.toml"))
    front = [dart for dart in plan.form.darts if dart.piece == "front_bodice"]
    assert [(d.name, d.asked.mouth_mm) for d in front if d.name.endswith("left")] == [
        ("bust dart left", None),
        ("waist dart left", 50.0),
    ]


@pytest.mark.parametrize("more", [{"ease": "close"}, {"shape": "darts"}, {"cuts": [{"line": "left", "mouth_mm": 3}]}])
def test_surfaces_have_no_ease_shape_or_mouths(tmp_path, more):
    with pytest.raises(InputError, match="belongs to a form"):
        make_scene({"surface": {"shape": "dome"}, **more}, name="x", folder=tmp_path, where="x.toml")


def test_sizes_lie_upon_each_other(sewn):
    away = {
        name: replace(piece, positions=np.add(piece.positions, [0.1, -0.02])) for name, piece in sewn.pieces.items()
    }
    pattern, _ = pattern_of_garment({"36": sewn, "38": replace(sewn, pieces=away)}, name="block")
    first, second = (pattern.piece("back_bodice", size).outline for size in ("36", "38"))
    np.testing.assert_allclose(first, second, atol=1e-12)


def test_a_knit_smaller_than_the_body_keeps_its_girths(body):
    form = body.form(form_from_mapping("knit", {"like": "bodice", "ease": {"bust": -5.0, "waist": -4.0}}))
    girths = flatten_form(body, form, fabric="jersey").metrics()["girths"]
    for level, ease in (("bust", -0.05), ("waist", -0.04)):
        assert girths[level]["ease_m"] == pytest.approx(ease, abs=2e-3)
