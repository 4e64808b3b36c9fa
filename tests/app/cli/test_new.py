"""`warpflat new`: garments and choices are listed, a scene is written, and no file of the user is replaced."""

from __future__ import annotations

from pathlib import Path

import pytest

from warpflat.app.cli.main import main
from warpflat.app.scene.load import load_scene
from warpflat.pattern.export.figure import Pen


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = main(["new", *arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_garments_and_their_choices_are_listed(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    code, out, _ = run(capsys)
    assert code == 0
    assert {"shirt", "hoodie", "circle_skirt"} <= {line.split(" ")[0] for line in out.splitlines()}
    code, out, _ = run(capsys, "shirt")
    assert code == 0
    assert "* --collar shirt: a stand with a fall" in out
    assert "  --collar stand: a stand alone" in out


def test_scene_is_written_with_what_was_chosen(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    file = tmp_path / "mine" / "shirt.toml"
    code, out, _ = run(capsys, "shirt", "--size", "EU 38", "--collar", "stand", "--ease=loose", "-o", str(file))
    assert code == 0
    assert "* --collar stand" in out
    scene = load_scene(file)
    assert scene.settings.ease == {"bust": 17, "hip": 14, "biceps": 11, "elbow": 11, "forearm": 10, "wrist": 8}
    assert [(table.kind, table.style) for table in scene.settings.finishing][-1] == ("collar", "stand")
    before = file.read_text()
    code, _, err = run(capsys, "shirt", "--size", "EU 40", "-o", str(file))
    assert (code, file.read_text()) == (2, before)
    assert "exists and is kept" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["shrt", "--size", "EU 38"], "did you mean 'shirt'"),
        (["skirt", "--size", "EU 38"], "'skirt' is unknown: valid: circle_skirt, gored_skirt, pencil_skirt"),
        (["shirt", "--size", "EU 38", "--collar", "stnd"], "did you mean 'stand'"),
        (["shirt", "--size", "EU 38", "--colar", "stand"], "did you mean 'collar'"),
        (["shirt", "--size", "EU 99"], "EU 99"),
        (["shirt", "--collar"], "--collar needs an option"),
        (["shirt", "--collar", "stand", "--collar", "flat", "--size", "EU 38"], "--collar is given twice"),
        (["shirt", "hoodie"], "one garment at a time"),
        (["shirt", "--collar", "stand"], "say whom it is for"),
        (["--size", "EU 38"], "name a garment"),
        (["shirt", "--scan", "nobody.obj"], "nobody.obj: no such file"),
        (["shirt", "--size", "EU 38", "--scan", "nobody.obj"], "command line"),
        (["shirt", "--measure", "bst=0.9"], "did you mean 'bust'"),
        (["shirt", "--fabric", "wovn", "--size", "EU 38"], "did you mean 'woven'"),
        (["tote", "--size", "EU 38"], "a tote lies on no body"),
        (["tote", "--card", "card.png"], "a tote lies on no body"),
        (["shirt", "--card", "card.pdf"], "name it *.png"),
        (["shirt", "--card", "card.png", "-o", "x.toml"], "writes no scene"),
        (["shirt", "--card", "card.png", "--scan", "nobody.obj"], "leave out --scan"),
    ],
)
def test_a_mistake_is_one_line(
    arguments: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_style_edits_are_listed_and_written(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    code, out, _ = run(capsys, "shift_dress")
    assert code == 0
    assert "--length (" in out
    assert "--sleeve-length" not in out
    file = tmp_path / "dress.toml"
    style = ["--length", "ankle+3", "--ease-bust=9", "--flare", "-4"]
    code, _, _ = run(capsys, "shift_dress", "--size", "EU 38", *style, "-o", str(file))
    assert code == 0
    scene = load_scene(file)
    assert (scene.settings.ease["bust"], scene.settings.ease["ankle"]) == (9, -4)
    assert scene.settings.form["profiles"]["ankle"]["raise_cm"] == -3


def test_a_first_project_needs_no_body_and_takes_a_measure_from_one(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    file = tmp_path / "hat.toml"
    code, out, _ = run(capsys, "sun_hat")
    assert code == 0
    assert "* --brim medium" in out
    assert run(capsys, "sun_hat", "--size", "men 50", "-o", str(file))[0] == 0
    assert load_scene(file).settings.surface.model_extra["head"] > 0.56
    assert run(capsys, "tote", "-o", str(tmp_path / "tote.toml"))[0] == 0


@pytest.mark.parametrize("garment", ["shirt", "trousers"])
def test_each_measure_of_a_card_is_in_its_picture(
    garment: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    shown, written = list[str](), list[str]()
    monkeypatch.setattr(Pen, "badge", lambda _, x, y, text, colour: shown.append(text))
    monkeypatch.setattr(Pen, "write", lambda _, x, y, text, *more, **look: written.append(text))
    assert run(capsys, garment, "--size", "EU 38", "--card", str(tmp_path / "card.png"))[0] == 0
    assert sorted(shown, key=int) == [text for text in written if text.isdigit()]


def test_card_shows_what_to_measure_and_keeps_what_is_there(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    from PIL import Image

    from warpflat.garment.mannequin.card import needed_measurements

    card = tmp_path / "card.png"
    code, out, _ = run(capsys, "trousers", "--size", "EU 38", "--card", str(card))
    assert code == 0
    assert "what to measure for trousers" in out
    with Image.open(card) as picture:
        assert picture.size == (1240, 1753)
    before = card.read_bytes()
    code, _, err = run(capsys, "trousers", "--card", str(card))
    assert (code, card.read_bytes()) == (2, before)
    assert "exists and is kept" in err
    # Asked for only as far as the garment needs it.
    trousers = needed_measurements({("waist", "hip"), ("crotch", "leg_ankle")})
    assert {"waist", "hip", "inside_leg", "ankle_girth"} <= set(trousers)
    assert not {"bust", "neck", "wrist"} & set(trousers)
    assert "arm_length" in needed_measurements({("shoulder", "hip"), ("armhole", "wrist")})
    assert "inside_leg" not in needed_measurements({("shoulder", "hip"), ("armhole", "wrist")})
