"""Cuts of a scene's form: compared, made by themselves, and edited."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from warpflat.app.cli.main import main
from warpflat.app.scene.form import scene_form
from warpflat.app.scene.form_edits import edit_dart, rotate_dart, split_dart, turn_dart
from warpflat.app.scene.form_shaping import settle_shape, without_closed_darts
from warpflat.app.scene.ledger import scene_ledger, with_cut
from warpflat.app.scene.load import make_scene
from warpflat.app.scene.plan import plan_form_scene
from warpflat.app.scene.run import run_scene
from warpflat.core.errors import InputError
from warpflat.core.polyline import arc_lengths, polyline_length
from warpflat.core.toml_file import tomllib
from warpflat.garment.construction.garment_files import garment_files
from warpflat.pattern.export.pattern_files import PatternOptions
from warpflat.pattern.export.pattern_json import read_pattern_json

BODICE = {"form": "bodice", "mannequin": {"size": "EU 38", "resolution_mm": 40}}
FRONT = {"piece": "front", "line": "princess front left"}


def scene(**tables: object):
    return make_scene({**BODICE, **tables}, name="trial", folder=Path(), where="trial.toml")


@pytest.fixture(scope="module")
def ledger():
    return scene_ledger(scene(), by="released")


def test_the_ledger_knows_the_darts_of_a_book_and_what_they_release(ledger):
    entries = {(entry.cut["piece"], entry.cut["name"]): entry for entry in ledger.entries}
    bust = entries["front", "bust dart"]
    assert bust.released > 0.5 * bust.model_energy_before
    assert bust.outside_after < bust.outside_before
    assert 0.05 < bust.mouth < 0.11

    assert entries["front", "princess seam"].released > bust.released
    assert [entry.can_be_sewn for entry in ledger.entries] == sorted(
        (entry.can_be_sewn for entry in ledger.entries), reverse=True
    )


def test_the_ledger_of_a_half_garment_is_half_of_the_whole(ledger):
    names = ("bust dart", "waist dart")
    halves = {(e.cut["piece"], e.cut["name"]): e for e in scene_ledger(scene(half=True), by="released").entries}
    for whole in (entry for entry in ledger.entries if entry.cut["name"] in names):
        half = halves[whole.cut["piece"], whole.cut["name"]]
        assert 2.0 * half.released == pytest.approx(whole.released, rel=0.05)
        assert half.mouth == pytest.approx(whole.mouth, rel=0.02)


def test_a_trial_tells_the_energy_of_the_piece_in_the_garment(ledger):
    entry = next(
        entry for entry in ledger.entries if entry.cut["name"] == "waist dart" and entry.cut["piece"] == "front"
    )
    garment = plan_form_scene(with_cut(scene(curves_mm=0), entry.cut)).flatten()
    assert garment.sewn.converged
    # Sewn to the back it stores a little more.
    alone, sewn = entry.model_energy_after, garment.pieces["front"].stages[-1].model_energy_j
    assert alone < 1.01 * sewn
    assert sewn < 1.3 * alone


def test_a_whole_line_is_a_seam_that_parts_the_piece_and_takes_over_its_darts():
    cuts = [{**FRONT, "part": [0, 1]}]
    form = scene_form(scene(shape="darts", cuts=cuts))[1]
    assert list(form.pieces) == ["front_centre", "front_side_left", "front_side_right", "back"]
    assert {dart.piece for dart in form.darts} == {"back"}
    seam = next(seam for seam in form.seams if seam.name == "princess front left")
    assert set(seam.pieces) == {"front_side_left", "front_centre"}
    halves = scene_form(scene(half=True, cuts=cuts))[1]
    assert list(halves.pieces) == ["front_centre", "front_side_left", "back"]


@pytest.mark.parametrize(
    ("cut", "message"),
    [
        ({**FRONT, "at": "shoulder lef"}, "line 'shoulder lef' is unknown"),
        ({**FRONT, "at": "neck"}, "does not end at 'neck' in piece 'front'; it ends at .*shoulder left"),
        ({**FRONT, "omit": True}, "the form has none along 'princess front left'"),
        ({"piece": "front", "line": "hip", "part": [0, 1]}, "'hip' do not part piece 'front'"),
        ({**FRONT, "part": [0, 1], "mouth_mm": 20}, "is a seam, which has no mouth"),
    ],
)
def test_cuts_that_cannot_be(cut, message):
    with pytest.raises(InputError, match=message):
        scene_form(scene(cuts=[cut]))


def test_a_shoulder_dart_ends_before_the_bust_point():
    form = scene_form(scene(cuts=[{**FRONT, "at": "shoulder left", "tip_mm": 30}]))[1]
    dart = next(dart for dart in form.darts if dart.name.endswith("left"))
    assert form.vertices[dart.row[0], 1] > form.vertices[dart.row[-1], 1]
    assert dart.to_point == pytest.approx(0.030, abs=0.0125)


def test_darts_are_made_until_the_cloth_keeps_its_limit():
    front = {"pieces": {"front": {"bricks": ["shoulder-waist/front-*"], "datum": "centre front"}}}
    # What stands out at the bust is taken in from the side here, and the rest from the shoulder.
    for fabric, darts in (("woven", {"bust dart", "shoulder dart"}), ("isotropic", {"shoulder dart", "waist dart"})):
        bare = plan_form_scene(scene(form=front, fabric=fabric)).flatten().pieces["front"].fit
        assert bare.misfits[0].words.startswith("sheared " if fabric == "woven" else "stretched ")
        assert bare.outside > 0.1
        shaped, notes = settle_shape(scene(shape="auto", form=front, fabric=fabric))
        garment = plan_form_scene(shaped).flatten()
        assert {(dart.piece, dart.asked.name) for dart in garment.form.darts} == {("front", dart) for dart in darts}
        assert "front.shoulder dart along princess front left releases" in notes[0]
        # An isotropic sheet does not shear more easily than it stretches; a book has no dart for what is left of it.
        fit = garment.pieces["front"].fit
        assert fit.outside < (0.01 if fabric == "woven" else 0.1 * bare.outside)


def test_auto_cut_leaves_pieces_that_have_enough():
    enough, notes = settle_shape(scene(auto_cut={"stop_below": 10.0}))
    assert enough.settings.cuts == []
    assert notes == ("no cut was found that would help",)


def test_edits_are_other_tables():
    darted = scene(shape="darts", cuts=[{**FRONT, "mouth_mm": 40}])
    rotated = rotate_dart(darted, "front.bust dart", "princess front left", at="shoulder left")
    assert {d.name for d in scene_form(rotated)[1].darts if d.piece == "front"} == {
        f"{name} {side}" for name in ("waist dart", "princess front dart") for side in ("left", "right")
    }
    split = split_dart(darted, "front.waist dart", "side left")
    mouths = {dart.name: dart.asked.mouth_mm for dart in scene_form(split)[1].darts if dart.piece == "front"}
    assert mouths["waist dart left"] == mouths["second waist dart left"] == 20
    with pytest.raises(InputError, match=r"there is no dart 'front\.dart'"):
        rotate_dart(darted, "front.dart", "bust")


def test_what_comes_of_a_dart_of_one_side_stays_there():
    alone = scene(cuts=[{**FRONT, "name": "waist", "mirrored": False}])
    for edited in (
        rotate_dart(alone, "front.waist", "bust"),
        split_dart(alone, "front.waist", "bust"),
        turn_dart(alone, "front.waist", "seam", None),
    ):
        assert not any(cut.mirrored for cut in edited.settings.cuts if not cut.omit)


def test_a_seam_takes_over_the_darts_that_a_scene_asks_for():
    darted = scene(cuts=[{"piece": "front", "line": "bust"}, FRONT, {"piece": "back", "line": "princess back left"}])
    seam = {"name": "princess seam", "piece": "front", "line": "princess front left", "part": [0.0, 1.0]}
    for edited in (with_cut(darted, seam), turn_dart(darted, "front.princess front", "seam", None)):
        assert [cut.line for cut in edited.settings.cuts] == ["princess back left", "princess front left"]
        assert set(scene_form(edited)[1].pieces) == {"front_centre", "front_side_left", "front_side_right", "back"}
    with pytest.raises(InputError, match="takes in what it would"):
        scene_form(scene(cuts=[{"piece": "front", "line": "bust"}, seam]))


@pytest.mark.parametrize("half", [False, True])
def test_a_dart_turned_into_gathers_lengthens_its_seam(half: bool):
    edit = edit_dart(
        scene(half=half, cuts=[{"piece": "front", "line": "bust", "name": "bust dart"}]),
        "front.bust dart",
        how="turn",
        aim="gathers",
    )
    data = edit.as_dict()
    assert data["before"]["model_energy_j"] < data["after"]["model_energy_j"]
    mouth = data["before"]["mouths_m"]["front.bust dart left"]
    side = next(seam for seam in edit.after.seams if seam.name == "side left")
    longer, shorter = max(side.lengths), min(side.lengths)
    assert longer - shorter == pytest.approx(mouth, rel=0.1)
    assert tomllib.loads(data["toml"])["seams"][0]["longer"] == "front"


def test_a_dart_turned_into_a_pleat_is_sewn_as_far_as_it_is_drawn(tmp_path: Path):
    """The mouth stays and is sewn for 40 mm; below, the cloth is free, which can only cost less."""
    darted = scene(cuts=[{**FRONT, "name": "waist dart", "mouth_mm": 40}])
    edit = edit_dart(darted, "front.waist dart", how="turn", aim="pleat")
    data = edit.as_dict()
    assert data["after"]["model_energy_j"] < data["before"]["model_energy_j"] * 1.001
    assert data["after"]["mouths_m"] == pytest.approx(data["before"]["mouths_m"], abs=1e-5)
    assert tomllib.loads(data["toml"])["cuts"][-1]["pleat_mm"] == 40
    piece = edit.after.form.pieces["front"]
    left, right = (piece.edges[leg] for leg in piece.darts["waist dart left"])
    apart = np.linalg.norm(
        np.diff(edit.after.pieces["front"].positions[np.stack([left, right[::-1]])], axis=0)[0], axis=1
    )
    # Legs that are sewn to each other are as long; the tip is one point.
    assert apart[0] == pytest.approx(0.04, abs=1e-4)
    written = garment_files(
        {"": edit.after}, tmp_path, name="pleat", options=PatternOptions(formats=("dxf", "svg", "json"))
    )
    drafted = read_pattern_json(tmp_path / "pattern.json").pieces[""]
    front = next(own for own in drafted if own.name == "front")
    assert {dart.dart.pleat for dart in front.darts} == {0.04}
    assert front.drill_holes == ()
    legs = [front.edge(name) for dart in front.darts for name in (dart.dart.left, dart.dart.right)]
    assert [polyline_length(front.drawn_line(leg)) for leg in legs] == pytest.approx([0.04] * len(legs), abs=1e-6)
    assert sum(notch.seam.startswith("waist dart") for notch in front.notches) == len(legs)
    assert "PLEAT: waist dart left" in (tmp_path / "pleat.dxf").read_text(encoding="utf-8")
    assert any("pleat waist dart left: fold 4 cm" in note for note in written.notes)


def test_the_command_makes_a_cut_of_a_form(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    table = '[form.pieces]\nfront = { bricks = ["shoulder-waist/front-*"], datum = "centre front" }\n'
    table += '[mannequin]\nsize = "EU 38"\nresolution_mm = 40\n[output]\nframes = 0\npicture = false\n'
    (tmp_path / "b.toml").write_text(table + "[pattern]\nformats = []\n")
    assert (
        main(["cuts", str(tmp_path / "b.toml"), "--out", str(tmp_path / "out"), "--apply", "1", "--by", "released"])
        == 0
    )
    best = json.loads((tmp_path / "out/ledger.json").read_text())["entries"][0]["cut"]
    assert tomllib.loads((tmp_path / "out/cuts.toml").read_text())["cuts"] == [best]
    assert "beyond the limit" in capsys.readouterr().out


def test_an_edit_that_is_not_at_rest_is_told_as_a_run_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "b.toml").write_text(
        'form = "bodice"\nshape = "darts"\nhalf = true\n[mannequin]\nsize = "EU 38"\nresolution_mm = 40\n[relax]\nmax_steps = 5\n'
    )
    turned = ("--turn", "front.waist dart", "nothing", "--out", str(tmp_path / "out"), "-q")
    assert main(["cuts", str(tmp_path / "b.toml"), *turned]) == 1
    assert "warpflat: front did not converge within " in capsys.readouterr().err


def test_the_advice_of_a_run_can_be_pasted(tmp_path: Path):
    quiet = {"output": {"frames": 0, "picture": False}, "pattern": {"formats": []}}
    wear = run_scene(scene(mannequin={"size": "EU 38", "resolution_mm": 20}, **quiet), tmp_path).metrics["pieces"][
        "front"
    ]["wear"]
    best = wear["would_help"][0]
    assert best["cut"].startswith("a dart along bust, ")
    assert best["table"]["piece"] == "front"
    form = scene_form(scene(mannequin={"size": "EU 38", "resolution_mm": 20}, cuts=[best["table"]]))[1]
    lengths = [arc_lengths(form.vertices[dart.row])[-1] for dart in form.darts]
    assert lengths == pytest.approx([best["length_m"]] * 2, rel=1e-6)


def test_a_dart_that_the_body_does_not_want_is_left_out(tmp_path: Path):
    # Her belly stands out below the waist, so that a dart of the front skirt would overlap.
    belly = {"measurements": {"bust": 1.12, "waist": 1.02, "hip": 1.08}, "resolution_mm": 40}
    tables = {
        "form": "skirt",
        "half": True,
        "output": {"picture": False, "frames": 0},
        "pattern": {"formats": ["json"]},
        "shape": "darts",
        "ease": "close",
        "mannequin": belly,
    }
    result = run_scene(scene(**tables), tmp_path)
    (note,) = (note for note in result.notes if "left out" in note)
    assert note.startswith("front: the waist dart is left out, since the cloth would not open it")
    assert "not_drawn" not in result.metrics["pattern"]
    assert "darts" not in result.metrics["pieces"]["front"]
    assert result.metrics["pieces"]["back"]["darts"]
    # What a scene asks for itself is made as it is asked for.
    own = {"piece": "front", "line": "princess front left", "mouth_mm": 8}
    kept = plan_form_scene(scene(**tables, cuts=[own], curves_mm=0)).flatten()
    assert without_closed_darts(scene(**tables, cuts=[own]), [kept])[1] == ()


def test_a_dart_too_near_the_armhole_moves_to_the_shoulder_or_goes(monkeypatch):
    asked = scene(shape="darts", half=True, curves_mm=0)
    made = plan_form_scene(asked).flatten()
    # A size table leaves room for it.
    assert without_closed_darts(asked, [made])[1] == ()
    # It lies 38 mm off; no strip of less than 60 mm may be left now, which a dart from the shoulder leaves.
    monkeypatch.setattr("warpflat.garment.construction.darts.NEAR_ARMHOLE", 0.06)
    moved, (note,) = without_closed_darts(asked, [made])
    assert note.startswith("front: the bust dart lies along the shoulder's princess line instead")
    darts = plan_form_scene(moved).flatten().metrics()["pieces"]["front"]["darts"]
    assert {dart["name"] for dart in darts} == {"shoulder dart left", "waist dart left"}
    # One on a shoulder too narrow for it goes.
    monkeypatch.setattr("warpflat.app.scene.form_shaping.NEAR_ARMHOLE", 0.20)
    left, (note,) = without_closed_darts(asked, [made])
    assert note.startswith("front: the bust dart is left out, since it would come within 30 mm of the armhole")
    assert [cut.omit for cut in left.settings.cuts] == [True]
