"""Forms: pieces, seams, ease and blending."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bodies import body_of_size
from self_intersections import self_intersections

from warpflat.core.errors import InputError
from warpflat.garment.mannequin.blend import Adjustment, adjusted_vertices, bridge_rows
from warpflat.garment.mannequin.darts import standard_darts
from warpflat.garment.mannequin.forms import Form, PieceRecipe, form_from_mapping, form_names
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.part_pieces import princess_seams, taken_over
from warpflat.garment.mannequin.profiles import convex_girth
from warpflat.garment.mannequin.seam_names import name_seams


@pytest.fixture(scope="module")
def body() -> Mannequin:
    return Mannequin.from_size("EU 38", resolution_mm=15)


@pytest.mark.parametrize("name", form_names())
@pytest.mark.parametrize("half", [False, True])
def test_shipped_forms_are_disks_with_matching_seams_that_have_no_numbers(name: str, half: bool) -> None:
    form = body_of_size(30.0).form(name, half=half)
    for key, piece in form.pieces.items():
        faces, vertices = piece.surface.faces, piece.surface.vertices
        ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], -1).reshape(-1, 2), axis=1)
        assert len(vertices) - len(np.unique(ends, axis=0)) + len(faces) == 1, key
        assert len(self_intersections(vertices, faces)) == 0, key
        loop = np.concatenate([ids[:-1] for ids in piece.edges.values()])
        assert len(np.unique(loop)) == len(loop)
        assert piece.datum in piece.surface.lines
        assert piece.fold is None or piece.fold in piece.edges
        assert np.array_equal(piece.surface.vertices, form.vertices[piece.grid_vertices])
    assert form.seams
    assert [seam.name for seam in form.seams if seam.name[-1].isdigit()] == []
    for seam in form.seams:
        a, b = (form.pieces[p].surface.vertices[v] for p, v in zip(seam.pieces, seam.runs[0].vertices, strict=True))
        assert len(a) > 2
        assert np.array_equal(a, b)


def test_basic_block(body: Mannequin) -> None:
    whole = body.form("basic_block")
    assert list(whole.pieces) == ["front_bodice", "back_bodice", "front_skirt", "back_skirt"]
    names = {(s.edges[0], s.pieces) for s in whole.seams}
    assert ("shoulder left", ("front_bodice", "back_bodice")) in names
    assert ("waist", ("front_bodice", "front_skirt")) in names
    assert ("side right", ("front_skirt", "back_skirt")) in names
    assert set(whole.pieces["front_bodice"].edges) == {
        "waist", "side left", "armhole left", "shoulder left", "neck", "shoulder right", "armhole right", "side right",
    }  # fmt: skip
    assert {"centre front", "princess front left", "bust", "underbust", "chest front"} <= set(
        whole.pieces["front_bodice"].surface.lines
    )
    half = body.form("basic_block", half=True)
    assert half.pieces["front_bodice"].fold == "centre front"
    assert half.pieces["back_skirt"].fold == "centre back"
    assert (half.pieces["front_bodice"].surface.vertices[:, 0] > -1e-6).all()
    # The skirt hangs straight from the hip.
    hip, knee = (convex_girth(whole.vertices[body.layout.lines[k]]) for k in ("hip", "knee"))
    assert knee == pytest.approx(hip, rel=1e-6)


@pytest.mark.parametrize(
    ("lines", "pieces", "heights", "names"),
    [
        (["waist", "waist"], [("front_bodice", "front_skirt"), ("back_bodice", "back_skirt")], None, ["front waist", "back waist"]),
        (
            ["abdomen", "abdomen"], [("back_left", "yoke_left"), ("back_right", "yoke_right")], None,
            ["left yoke", "right yoke"],
        ),
        (["side left", "knee"], [("front", "back"), ("top", "leg")], None, ["side left", "knee"]),
        (
            ["armhole left", "armhole left"], [("front", "sleeve_left"), ("back", "sleeve_left")], None,
            ["front armhole left", "back armhole left"],
        ),
        (["side", "side"], [("front", "back"), ("front", "back")], (1.2, 0.7), ["upper side", "lower side"]),
        (["side", "side", "side"], [("a", "b")] * 3, (1.2, 0.9, 0.7), ["side", "side 2", "side 3"]),
    ],
)  # fmt: skip
def test_seams_of_one_line_are_told_apart_by_their_pieces_then_by_their_place(
    lines: list[str], pieces: list[tuple[str, str]], heights: tuple[float, ...] | None, names: list[str]
) -> None:
    points = None if heights is None else [np.array([[0.1, height, 0.0]]) for height in heights]
    assert list(name_seams(lines, pieces, points)) == names


def test_seams_of_shipped_forms_are_told_apart(body: Mannequin) -> None:
    seams = {name: {seam.name for seam in body.form(name).seams} for name in ("basic_block", "princess_dress")}
    assert {"front waist", "back waist", "bodice side left", "skirt side left"} <= seams["basic_block"]
    assert {"centre shoulder left", "side shoulder left"} <= seams["princess_dress"]


def test_princess_dress_has_panels_and_shirt_has_sleeves(body: Mannequin) -> None:
    dress = body.form("princess_dress")
    assert len(dress.pieces) == 6
    assert sum(s.name.startswith("princess") for s in dress.seams) == 4
    shirt = body.form("tshirt")
    under = [s for s in shirt.seams if s.pieces == ("sleeve_left", "sleeve_left")]
    assert len(under) == 1
    assert under[0].edges == ("underarm left", "underarm left 2")
    assert sum("armhole" in s.name for s in shirt.seams) == 4
    assert set(body.form("tshirt", half=True).pieces) == {"front", "back", "sleeve_left"}


def test_ease_is_what_the_tape_reads_more(body: Mannequin) -> None:
    form = form_from_mapping(
        "loose", {"like": "bodice", "profiles": {"waist": {"scale": 1.1}}, "ease": {"bust": 8.0, "waist": 5.0}}
    )
    made = body.form(form)
    girth = {k: convex_girth(made.vertices[body.layout.lines[k]]) for k in ("bust", "waist", "underbust")}
    assert girth["bust"] == pytest.approx(0.96, abs=1e-6)
    assert girth["waist"] == pytest.approx(0.72 * 1.1 + 0.05, abs=1e-6)
    assert girth["underbust"] == pytest.approx(body.levels()["underbust"].girth, abs=1e-9)
    # Neckline and shoulder seams hold the garment: they stay.
    for line in ("neck", "shoulder left"):
        assert np.array_equal(made.vertices[body.layout.lines[line]], body.line(line))
    # The chest follows the eased bust smoothly.
    moved = np.linalg.norm(made.vertices - body.vertices, axis=1)
    column = body.layout.lines["centre front"][body.layout.level_row["bust"] :]
    assert (np.abs(np.diff(moved[column])) < 0.006).all()


def test_offset_grows_girth_by_two_pi(body: Mannequin) -> None:
    made = body.form(
        form_from_mapping("off", {"like": "skirt", "profiles": {"hip": {"offset_cm": 2.0}}, "ease": {"hip": 0.0}})
    )
    assert convex_girth(made.vertices[body.layout.lines["hip"]]) == pytest.approx(0.96 + 2 * np.pi * 0.02, abs=1e-6)


def test_a_line_is_the_hip_blown_up(body: Mannequin) -> None:
    made = body.form("a_line_skirt")
    hip = body.line("hip")[:-1]
    knee = made.vertices[body.layout.lines["knee"]][:-1]
    middle = 0.5 * (hip.min(axis=0) + hip.max(axis=0))
    assert np.allclose((knee - middle)[:, [0, 2]], 1.35 * (hip - middle)[:, [0, 2]], atol=1e-9)
    # Ruled: every column between hip and knee is straight.
    rows = made.vertices[body.layout.rings[body.layout.level_row["knee"] : body.layout.level_row["hip"] + 1]]
    way = rows[-1] - rows[0]
    off = np.cross(rows - rows[0], way / np.linalg.norm(way, axis=1, keepdims=True))
    assert np.abs(off).max() < 1e-9


def test_bridging_removes_hollows(body: Mannequin) -> None:
    made = body.form(form_from_mapping("flat", {"like": "bodice", "profiles": {"bust": {"bridge": True}}}))
    row = made.vertices[body.layout.lines["bust"]][:, [0, 2]]
    length = np.linalg.norm(np.diff(row, axis=0), axis=1).sum()
    assert length == pytest.approx(convex_girth(row[:-1]), rel=1e-9)
    assert np.linalg.norm(np.diff(body.line("bust"), axis=0), axis=1).sum() > length + 1e-4


def test_weighted_blend_lies_between(body: Mannequin) -> None:
    a, b = body.form("skirt"), body.form("a_line_skirt")
    mixed = body.form(form_from_mapping("mix", {"like": "skirt", "blend": {"with": "a_line_skirt", "weight": 0.25}}))
    assert np.allclose(mixed.vertices, 0.75 * a.vertices + 0.25 * b.vertices)
    assert list(mixed.pieces) == list(a.pieces)


def test_sizes_of_one_form_correspond(body: Mannequin) -> None:
    other = Mannequin.from_size("EU 44", resolution_mm=15).form("dress")
    mine = body.form("dress")
    for name, piece in mine.pieces.items():
        assert np.array_equal(piece.surface.faces, other.pieces[name].surface.faces)
        assert {k: v.tolist() for k, v in piece.edges.items()} == {
            k: v.tolist() for k, v in other.pieces[name].edges.items()
        }


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"peices": {}}, "did you mean 'pieces'"),
        ({}, "pieces is missing"),
        ({"pieces": {"a": {"brick": ["x"]}}}, "did you mean 'bricks'"),
        ({"pieces": {"a": {"bricks": []}}}, "bricks is empty"),
        ({"like": "skirt", "ease": {"hips": 2}}, "did you mean 'hip'"),
        ({"like": "skirt", "profiles": {"hip": {"scale": 40}}}, r"from 0\.5 to 6"),
        ({"like": "skirt", "profiles": {"hip": {"scale": "big"}}}, "a number"),
        ({"like": "skirt", "profiles": {"hip": {"bridge": 1}}}, "true or false"),
        ({"like": "skirt", "blend": {"weight": 0.5}}, "with is missing"),
        ({"like": "skrit"}, "did you mean 'skirt'"),
        ({"like": "skirt", "ruled": [["hip"]]}, "pair of levels"),
        ({"pieces": "front"}, "a table is needed"),
    ],
)
def test_scene_mistakes_are_named(data: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        form_from_mapping("mine", data)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"like": "skirt", "profiles": {"neck": {"scale": 2}}}, "cannot be adjusted"),
        ({"like": "skirt", "profiles": {"knee": {"like": "biceps"}}}, "level of the same part"),
        ({"like": "skirt", "profiles": {"knee": {"raise_cm": 40}}}, "less than 1 cm above"),
        (
            {"like": "trousers", "profiles": {"leg_knee": {"raise_cm": 40}}},
            "leg_thigh comes to lie less than 1 cm above leg_knee",
        ),
        ({"like": "skirt", "ruled": [["hip", "neck"]]}, "ruled"),
        ({"pieces": {"a": {"bricks": ["waist-hip/*"]}}}, "not one disk"),
        (
            {"pieces": {"a": {"bricks": ["waist-abdomen/front-left-centre", "hip-thigh/back-left-side"]}}},
            "not one disk",
        ),
        ({"pieces": {"a": {"bricks": ["waist-hip/front-*"]}, "b": {"bricks": ["waist-hip/*-left-*"]}}}, "two pieces"),
        ({"pieces": {"a": {"bricks": ["waist-hip/front-*"], "datum": "center front"}}}, "did you mean 'centre front'"),
        ({"pieces": {"a": {"bricks": ["waist-hip/front-*"], "datum": "centre back"}}}, "does not run through it"),
    ],
)
def test_forms_that_cannot_be_made(body: Mannequin, data: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        body.form(form_from_mapping("mine", data))
    with pytest.raises(InputError, match="did you mean 'skirt'"):
        body.form("skrt")


def test_tube_can_be_opened_along_a_line(body: Mannequin) -> None:
    form = form_from_mapping(
        "tube", {"pieces": {"skirt": {"bricks": ["waist-knee/*"], "datum": "centre front", "open": ["centre back"]}}}
    )
    made = body.form(form)
    assert set(made.pieces["skirt"].edges) == {"waist", "knee", "centre back", "centre back 2"}
    assert [s.pieces for s in made.seams] == [("skirt", "skirt")]
    # Across the cut the hip is one line all around.
    hip = made.pieces["skirt"].surface.lines["hip"]
    assert len(hip) == len(body.layout.lines["hip"])


_FRONT = {"bricks": ["waist-knee/front-*"], "datum": "centre front"}
_SLEEVE = {"bricks": ["armhole-elbow/arm-left-*"], "datum": "overarm left", "open": ["underarm left"]}


@pytest.mark.parametrize(
    ("pieces", "words"),
    [
        (
            {"front": _FRONT, "back": {"bricks": ["waist-hip/back-left-*", "waist-knee/back-right-*"]}},
            r"in piece back hip-thigh/back-right-centre, .* have no mirror image; cut it whole: half = false",
        ),
        (
            {
                "over": {"bricks": ["chest-hip/front-right-*", "chest-hip/front-left-centre"]},
                "under": {"bricks": ["chest-hip/front-left-side"]},
            },
            r"in piece over .* and 1 more have no mirror image",
        ),
        (
            {"a": {"bricks": ["waist-hip/front-right-*"]}},
            r"no piece is the mirror image of piece a \(waist-abdomen/front-right",
        ),
        ({"front": _FRONT, "sleeve": _SLEEVE}, r"mirror image of piece sleeve \(armhole-biceps/arm-left-front, "),
        (
            {"yoke": {"bricks": ["shoulder-chest/*-left-*"]}, "right": {"bricks": ["shoulder-yoke/*-right-*"]}},
            r"mirror image of piece yoke \(yoke-chest/",
        ),
        ({"skirt": {"bricks": ["waist-knee/*"], "open": ["side left"]}}, "skirt is open along 'side left'"),
        (
            {"left": _SLEEVE, "right": {"bricks": ["armhole-elbow/arm-right-*"], "open": ["overarm right"]}},
            "left is open along 'underarm left' and piece right not along 'underarm right'",
        ),
        (
            {
                "left": {"bricks": ["waist-hip/*-left-*"], "datum": "side left"},
                "right": {"bricks": ["waist-hip/*-right-*"], "datum": "princess front right"},
            },
            "datum along 'side left' and piece right along 'princess front right'",
        ),
        (
            {"skirt": {"bricks": ["waist-knee/*"]}},
            r"joined along centre back and centre front.* open = \[.centre back.\]",
        ),
        ({"front": {**_FRONT, "open": ["centre front"]}}, "halves are joined along no centre line"),
        ({"front": {**_FRONT, "datum": "hip"}}, r"datum 'hip' runs across the fold, .* datum = 'centre front', or"),
    ],
)
def test_halves_that_do_not_stand_for_both_sides_are_refused(
    body: Mannequin, pieces: dict[str, dict[str, object]], words: str
) -> None:
    with pytest.raises(InputError, match=words) as caught:
        body.form(form_from_mapping("mine", {"pieces": pieces}), half=True)
    assert "\n" not in str(caught.value)


def test_a_half_piece_is_laid_along_its_fold_unless_told_otherwise(body: Mannequin) -> None:
    form = form_from_mapping("mine", {"pieces": {"front": {"bricks": ["waist-hip/front-*"]}}})
    assert body.form(form, half=True).pieces["front"].datum == "centre front"


def test_a_collar_stand_opens_at_the_front_and_folds_at_the_back(body: Mannequin) -> None:
    recipe = {"bricks": ["collar-neck/*"], "open": ["centre front"]}
    form = form_from_mapping("mine", {"pieces": {"stand": recipe}})
    whole = body.form(form)
    assert {"neck", "collar", "centre front", "centre front 2"} == set(whole.pieces["stand"].edges)
    assert [run.edges for seam in whole.seams for run in seam.runs] == [("centre front", "centre front 2")]
    half = body.form(form, half=True).pieces["stand"]
    assert set(half.edges) == {"neck", "collar", "centre front", "centre back"}
    assert half.fold == "centre back"
    assert np.abs(half.surface.vertices[half.edges["centre back"], 0]).max() < 1e-6


@pytest.mark.parametrize("half", [False, True])
def test_a_line_that_opens_a_piece_runs_through_it(body: Mannequin, half: bool) -> None:
    for line, recipe in (("biceps left", {"bricks": ["waist-knee/*"]}), ("side left", _FRONT)):
        form = form_from_mapping("mine", {"pieces": {"a": {**recipe, "open": [line]}}})
        with pytest.raises(InputError, match=f"line '{line}' does not run through piece a, which is to be open"):
            body.form(form, half=half)
    form = form_from_mapping("mine", {"pieces": {"a": {"bricks": ["waist-knee/*"], "open": ["hip"]}}})
    with pytest.raises(InputError, match=r"not one disk .* name another line to open it along"):
        body.form(form)


def test_a_line_that_leaves_the_border_is_one_line_with_its_edge(body: Mannequin) -> None:
    over = {"bricks": ["shoulder-hip/front-right-*", "chest-hip/front-left-centre"], "datum": "centre front"}
    strap = {"bricks": ["bust-hip/front-left-centre", "shoulder-hip/front-left-side"], "datum": "princess front left"}
    for recipe in (over, strap):
        (piece,) = body.form(form_from_mapping("odd", {"pieces": {"front": recipe}})).pieces.values()
        line = str(recipe["datum"])
        edge, whole = piece.edges[line], piece.surface.lines[piece.datum]
        assert piece.datum == line
        assert np.array_equal(
            np.sort(piece.grid_vertices[whole]), np.sort(np.intersect1d(body.layout.lines[line], piece.grid_vertices))
        )
        assert len(edge) < len(whole)
        assert set(edge.tolist()) < set(whole.tolist())


def test_every_part_of_a_line_is_kept(body: Mannequin) -> None:
    """Two straps: what crosses both is there twice, and what goes on under the neckline once."""
    straps = {"front": {"bricks": ["bust-hip/front-*-centre", "shoulder-hip/front-*-side"], "datum": "centre front"}}
    (piece,) = body.form(form_from_mapping("straps", {"pieces": straps})).pieces.values()
    lines = piece.surface.lines
    for line in ("chest front", "chest front 2"):
        assert line not in piece.edges
        assert set(piece.grid_vertices[lines[line]]) < set(body.layout.lines["chest front"].tolist())
    assert not set(lines["chest front"].tolist()) & set(lines["chest front 2"].tolist())
    assert "bust 2" not in lines
    assert set(piece.edges["bust"].tolist()) < set(lines["bust"].tolist())
    assert len(lines["bust"]) == len(np.intersect1d(body.layout.lines["bust"], piece.grid_vertices))


def test_cloth_bridges_the_small_of_the_back_and_stays_where_it_stands_out() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    radius = np.array([1.0, 0.8, 0.5, 0.45, 0.5])  # upwards: seat, small of the back, waist
    hollow = np.linspace(0.0, 1.0, 5)[:, None] * np.ones(24)
    rows = np.stack([radius[:, None] * np.cos(angle), hollow, radius[:, None] * np.sin(angle)], axis=-1)
    out, grid = rows.reshape(-1, 3).copy(), np.arange(5 * 24).reshape(5, 24)
    bridge_rows(out, grid, {"hip": 0, "waist": 4}, ("waist", "hip"))
    bridged = np.linalg.norm(out.reshape(5, 24, 3)[..., [0, 2]], axis=2)
    assert bridged == pytest.approx(np.linspace(1.0, 0.5, 5)[:, None] * np.ones(24), abs=5e-3)
    assert np.array_equal(out[:, 1], rows.reshape(-1, 3)[:, 1])
    full = rows.copy()
    full[1:4, :, [0, 2]] = rows[1:4][..., [0, 2]] * (np.array([0.95, 0.85, 0.7]) / radius[1:4])[:, None, None]
    kept = full.reshape(-1, 3).copy()
    bridge_rows(kept, grid, {"hip": 0, "waist": 4}, ("waist", "hip"))
    assert kept == pytest.approx(full.reshape(-1, 3), abs=1e-9)


def test_a_skirt_hangs_straight_from_a_belly(body: Mannequin) -> None:
    apple = Mannequin.from_measurements(bust=1.10, waist=1.14, hip=1.12, resolution_mm=15)
    layout = apple.layout
    rows = {level: layout.rings[layout.level_row[level]] for level in ("waist", "hip", "knee")}
    form = apple.form("skirt")
    # In front it stands no more than 20 mm behind the belly, down to the knee; the body's hip lies 60 mm behind.
    ahead = {level: float(form.vertices[row[0], 2]) for level, row in rows.items()}
    assert ahead["waist"] - float(apple.vertices[rows["hip"][0], 2]) > 0.06
    assert all(ahead["waist"] - ahead[level] < 0.021 for level in ("hip", "knee"))
    assert "hip" not in form.ease
    # A body that only leans gets its ease.
    form = body.form("skirt")
    assert form.ease["hip"] == 3.0
    girths = [convex_girth(vertices[rows["hip"]]) for vertices in (form.vertices, body.vertices)]
    assert girths[0] - girths[1] == pytest.approx(0.03, abs=0.0015)


@pytest.mark.parametrize("level", ["chest", "biceps", "elbow"])
@pytest.mark.parametrize("change", [{"raise_cm": 4.0}, {"bridge": True}])
def test_what_a_profile_cannot_do_is_refused(level: str, change: dict[str, Any]) -> None:
    body = body_of_size(30.0)
    with pytest.raises(InputError, match=f"profile {level}: it is neither bridged nor raised"):
        adjusted_vertices(body.layout, body.vertices, {level: Adjustment(**change)})


def test_numbers_of_numpy_are_numbers_in_every_table() -> None:
    data = {"like": "tshirt", "ease": {"hip": np.int64(4)}, "profiles": {"hip": {"offset_cm": np.int64(1)}}}
    form = form_from_mapping("mine", data)
    assert (form.ease["hip"], form.profiles["hip"].offset_cm) == (4.0, 1.0)


def test_an_armhole_moves_with_its_own_side_of_the_trunk_whichever_side_that_is() -> None:
    layout, lean = body_of_size(30.0).layout, body_of_size(30.0).vertices.copy()
    lean[layout.rings[layout.level_row["waist"]], 0] += 0.04
    flip = np.array([-1.0, 1.0, 1.0])
    like_waist = {"bust": Adjustment(like="waist")}
    left, right = (adjusted_vertices(layout, each, like_waist) for each in (lean, lean[layout.mirror] * flip))
    assert left == pytest.approx(right[layout.mirror] * flip, abs=1e-6)


def test_a_dart_of_another_piece_does_not_stand_for_one_that_a_seam_takes_over() -> None:
    layout, vertices = body_of_size(30.0).layout, body_of_size(30.0).vertices
    recipes = {"bodice": ("shoulder-waist/front-*",), "skirt": ("waist-knee/front-*",)}
    form = Form(name="x", pieces={name: PieceRecipe(bricks=bricks) for name, bricks in recipes.items()})
    built = body_of_size(30.0).form(form)
    form = replace(form, darts=standard_darts(layout, built.bricks))
    gone = taken_over(layout, vertices, form, princess_seams(layout, built.bricks["bodice"], "bodice"))
    assert {dart.name for dart in gone if dart.piece == "bodice"} == {"bust dart", "waist dart"}
    assert {dart.piece for dart in gone} == {"bodice"}
