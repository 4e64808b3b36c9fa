"""Seams and constraints in scene files: what they ask, what metrics, pattern and console say of it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from warpflat.app.cli.summary import notes_line, summary_lines
from warpflat.app.cli.tables import run_summary
from warpflat.app.review.faults import faults_of
from warpflat.app.review.page import seam_table
from warpflat.app.scene.load import make_scene
from warpflat.app.scene.run import run_scene
from warpflat.core.errors import InputError
from warpflat.core.text import energy_words

QUIET = {"output": {"frames": 0, "picture": False}, "pattern": {"formats": ["json"]}}
SKIRT = {"fabric": "denim", "form": "a_line_skirt", "mannequin": {"size": "EU 38", "resolution_mm": 35.0}}
BODICE = {"fabric": "woven", "datum": "centre", "surface": {"shape": "bodice", "resolution": 13}}


def scene(base: dict[str, object], **tables: object):
    return make_scene({**base, **QUIET, **tables}, name="trial", folder=Path(), where="trial.toml")


def flat_lines(folder: Path, piece: str) -> np.ndarray:
    rows = (folder / f"{piece}.obj").read_text().splitlines()
    return np.array([[float(x) for x in row.split()[1:]] for row in rows if row.startswith("vt ")])


@pytest.fixture(scope="module")
def skirt(tmp_path_factory: pytest.TempPathFactory):
    out = tmp_path_factory.mktemp("skirt")
    asked = {
        "seams": [{"name": "side left", "fullness": 0.01, "longer": "front"}],
        "constraints": [
            {"line": "hip", "straight": "weft", "piece": "front"},
            {"line": "waist", "length_mm": "body"},
            {"line": "centre back", "straight": "warp", "symmetric": False},
        ],
    }
    return run_scene(scene(SKIRT, **asked), out), out


def test_a_garments_scene_asks_for_ease_lines_and_lengths(skirt):
    _, out = skirt
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["sewing"]["converged"]
    left, right = (next(s for s in metrics["seams"] if s["name"] == f"side {side}") for side in ("left", "right"))
    assert left["sides"] == ["front.side left", "back.side left"]
    assert left["ease"] == pytest.approx(1 / 1.01 - 1)
    assert left["length_mm"][0] / left["length_mm"][1] == pytest.approx(1.01, abs=5e-4)
    assert abs(left["difference_mm"]) < 0.2
    assert right["ease"] == 0.0
    held = {entry["name"]: entry for entry in metrics["constraints"]}
    assert set(held) == {
        "front.hip straight along weft",
        "front.waist length",
        "back.waist length",
        "back.centre back straight along warp",
        "waist girth",
        "abdomen girth",
        "hip girth",
    }
    girths = {name for name in held if name.endswith("girth")}
    assert all(held[name]["amiss_mm"] < 0.11 for name in held.keys() - girths)
    assert all(held[name]["amiss_mm"] < 0.5 for name in girths)
    assert held["front.hip straight along weft"]["price_j"] > 1e-4
    total = sum(entry["price_j"] for entry in [*metrics["constraints"], *metrics["seams"]])
    assert total == pytest.approx(metrics["sewing"]["price_j"], rel=0.15)


def test_the_pattern_has_the_ease(skirt):
    _, out = skirt
    pattern = json.loads((out / "pattern.json").read_text())
    seam = next(s for s in pattern["seams"] if s["name"] == "side left")
    assert seam["ease"] == pytest.approx(1 / 1.01 - 1)
    assert abs(seam["difference_mm"]) < 0.5


def test_the_console_is_a_line_each_and_none_is_wide(skirt):
    result, _ = skirt
    lines = summary_lines(result.metrics, result.files, "out", width=100)
    heads = [line.split(":")[0] for line in lines if not line.startswith(" ")]
    assert len(lines) <= 5
    assert heads[0] == result.metrics["verdict"]["words"]
    assert heads[-1] == "out"
    # A path can be pasted, whatever is in it.
    *_, printed, listed = summary_lines(result.metrics, [*result.files, "pattern.pdf"], "my out")
    assert printed == "print 'my out/pattern.pdf'"
    assert listed.startswith("'my out': ")
    assert summary_lines(result.metrics, [], "my out")[-1] == "'my out': no files"
    # A correction may end before its first round.
    ended = {"rounds": [{"misfit_m": 1e-3}], "reason": "no step lowers the misfit"}
    words = summary_lines({"pieces": {}, "drape": {"correction": ended}}, [], "out")
    assert "  corrected: misfit 1.00 to 1.00 mm in 0 rounds; no step lowers the misfit" in words
    assert max(map(len, lines)) <= 100
    assert "-0.0" not in " ".join(lines)
    guessed = sum("guess" not in note and " cm is " in note for note in result.notes)
    assert guessed > 5
    assert notes_line(result.notes).startswith(f"note: {guessed} measurements guessed from others")
    assert notes_line(("the mesh was mended", *result.notes[:3], "x" * 90)) == (
        "note: 3 measurements guessed from others; the mesh was mended; 1 more; -v lists them"
    )
    assert notes_line(("the mesh was mended",)) == "note: the mesh was mended"
    assert energy_words(3.07e-20) == "0 mJ"


def test_console_and_page_show_the_same_figures_of_a_seam(skirt):
    result, _ = skirt
    seam = {
        **result.metrics["seams"][0],
        "name": "hem",
        "length_mm": [100.04, 105.4],
        "ease": 0.0539,
        "difference_mm": -4e-4,
    }
    text, page = run_summary({**result.metrics, "seams": [seam]}, (), "out"), seam_table({"seams": [seam]})
    for words in ("100.0 mm", "105.4 mm", "+5.39 %", "+0.00 mm"):
        assert words in text
        assert f">{words}<" in page


def test_the_console_shows_ease_and_prices(skirt):
    result, _ = skirt
    text = run_summary(result.metrics, result.files, "out")
    row = next(line for line in text.splitlines() if line.startswith("side left"))
    assert "-0.99 %" in row
    assert row.endswith(" mJ")
    row = next(line for line in text.splitlines() if line.startswith("front.hip straight along weft"))
    assert row.endswith(" mJ")
    assert faults_of(result.metrics) == []


def test_both_legs_of_a_dart_become_equally_long(tmp_path: Path):
    """Cut slantwise, so that one leg runs through cloth that stretches more than the other's."""
    cuts = [
        {"name": "slant", "from": [0.16, 0.20, 0.02], "to": [0.08, 0.26, 0.14]},
        {"line": "centre", "part": [0.0, 0.4]},
    ]
    surface = {"shape": "bodice", "resolution": 17}
    result = run_scene(scene({**BODICE, "surface": surface}, cuts=cuts), tmp_path)
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    stages = metrics["pieces"]["trial"]["stages"]
    assert [stage["name"] for stage in stages][-1] == "sew"
    legs = {seam["name"]: seam["length_mm"] for seam in metrics["seams"]}
    assert set(legs) == {"slant", "centre"}
    for first, second in legs.values():
        assert abs(first - second) < 0.2
    assert {"trial.slant.left", "trial.slant.right"} == {
        side for s in metrics["seams"] if s["name"] == "slant" for side in s["sides"]
    }
    assert result.metrics["pieces"]["trial"]["flipped_faces"] == 0


def test_a_surface_keeps_lines_straight_by_the_names_of_its_sides(tmp_path: Path):
    asked = [{"line": "bottom", "straight": "weft"}, {"line": "bust", "length_mm": 300}]
    result = run_scene(scene(BODICE, constraints=asked), tmp_path)
    flat = flat_lines(tmp_path, "trial")
    assert np.ptp(flat[:13, 1]) < 2e-4
    assert result.metrics["seams"] == []
    assert [held["name"] for held in result.metrics["constraints"]] == [
        "trial.bottom straight along weft",
        "trial.bust length 300 mm",
    ]
    plain = run_scene(scene(BODICE), tmp_path / "plain")
    assert "constraints" not in plain.metrics
    assert np.ptp(flat_lines(tmp_path / "plain", "trial")[:13, 1]) > 2e-3


def test_a_contradiction_is_a_warning_that_names_it(tmp_path: Path):
    asked = [{"line": "bust", "length_mm": 300}, {"line": "bust", "length_mm": 310}]
    result = run_scene(scene(BODICE, constraints=asked, relax={"max_steps": 3000}), tmp_path)
    assert not result.metrics["sewing"]["converged"]
    assert result.metrics["sewing"]["contradictory"]
    told = faults_of(result.metrics)
    assert any("trial.bust length 310 mm is amiss by" in line for line in told)
    assert any("its seams and constraints ask for more than it can give" in line for line in told)
    assert not any("raise max_steps" in line for line in told), "more steps end at the same one"


def test_a_limit_that_is_too_low_is_told_apart_from_a_contradiction(tmp_path: Path):
    result = run_scene(
        scene(BODICE, constraints=[{"line": "bust", "length_mm": 300}], relax={"max_steps": 5}), tmp_path
    )
    assert not result.metrics["sewing"]["converged"]
    assert not result.metrics["sewing"]["contradictory"]
    assert any("raise max_steps" in line for line in faults_of(result.metrics))


@pytest.mark.parametrize(
    ("base", "tables", "message"),
    [
        (SKIRT, {"seams": [{"name": "side left"}]}, r"seams\[0\]: give either fullness = 0.02"),
        (SKIRT, {"seams": [{"name": "side left", "fullness": 0.1, "gather": 2}]}, r"seams\[0\]: give either"),
        (SKIRT, {"seams": [{"name": "side left", "gather": 0.5}]}, r"seams\[0\].gather: .*greater than or equal to 1"),
        (SKIRT, {"seams": [{"nam": "x", "fullness": 0.1}]}, r"seams\[0\].nam: unknown key 'nam'; did you mean 'name'"),
        (BODICE, {"seams": [{"name": "x", "fullness": 0.1}]}, r"seams\[0\]: on a \[surface\] give the two lines"),
        (SKIRT, {"constraints": [{"line": "hip"}]}, r"constraints\[0\]: ask for something"),
        (SKIRT, {"constraints": [{"line": "hip", "straight": "up"}]}, r"constraints\[0\].straight: .*'warp'"),
        (SKIRT, {"constraints": [{"line": "hip", "length_mm": "bdy"}]}, r"constraints\[0\].length_mm: .*'body'"),
        (SKIRT, {"constraints": [{"line": "hip", "strait": "warp"}]}, r"unknown key 'strait'; did you mean 'straight'"),
    ],
)
def test_wrong_tables_are_told_in_one_line(base: dict[str, object], tables: dict[str, object], message: str):
    with pytest.raises(InputError, match=message) as caught:
        scene(base, **tables)
    assert "\n" not in str(caught.value)


def test_a_wrong_line_is_told_before_anything_is_flattened(tmp_path: Path):
    with pytest.raises(InputError, match=r"trial.toml: constraints\[0\]: unknown line 'botom'; did you mean 'bottom'"):
        run_scene(scene(BODICE, constraints=[{"line": "botom", "straight": "free"}]), tmp_path)
    with pytest.raises(
        InputError, match=r"seams: seam 'side left': 'frnt' is not one of its sides; did you mean 'front'"
    ):
        run_scene(scene(SKIRT, seams=[{"name": "side left", "fullness": 0.1, "longer": "frnt"}]), tmp_path)


def test_an_oblique_grain_on_the_fold_is_told_before_anything_is_flattened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def too_late(*_: object, **__: object) -> None:
        raise AssertionError("it was flattened first")

    monkeypatch.setattr("warpflat.app.scene.plan.flatten_form", too_late)
    with pytest.raises(InputError, match=r"trial.toml: grain_angle: front, back on the fold, with the grain at 30 deg"):
        run_scene(scene(SKIRT, half=True, grain_angle=30.0), tmp_path)
    for sound in ({"half": True, "grain_angle": 90.0}, {"grain_angle": 30.0}):
        with pytest.raises(AssertionError, match="flattened"):
            run_scene(scene(SKIRT, **sound), tmp_path)
