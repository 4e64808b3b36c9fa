"""One scene in several fabrics: the same points, figures that agree with the patterns, files that can be read."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from bodies import body_of_size, with_bent_elbows
from devices import DEVICE

from warpflat.app.cli.main import main
from warpflat.app.scene.compare import compare_fabrics, comparison_table, save_comparison
from warpflat.app.scene.comparison import Comparison, outline
from warpflat.app.scene.form_edits import edit_dart
from warpflat.app.scene.load import Scene, load_scene
from warpflat.app.scene.plan import plan_scene
from warpflat.app.scene.run import run_scene
from warpflat.core.errors import InputError

TEXT = 'datum = "centre"\nmodel = "membrane"\n[surface]\nshape = "bodice"\nresolution = 17\n'


def scene_in(folder: Path, text: str = TEXT) -> Scene:
    (folder / "front.toml").write_text(text)
    return load_scene(folder / "front.toml")


@pytest.fixture(scope="module")
def comparison(tmp_path_factory: pytest.TempPathFactory) -> Comparison:
    return compare_fabrics(
        scene_in(tmp_path_factory.mktemp("compare")), ["denim", "jersey", "power-net"], device=DEVICE
    )


def test_fabrics_are_compared_with_the_first(comparison: Comparison):
    assert comparison.fabrics == ["denim", "jersey", "power-net"]
    assert comparison.pieces == ["front"]
    distances = comparison.distances("front")
    assert list(distances) == ["jersey", "power-net"]
    for name in ("left start / bottom start", "bust start", "centre end"):
        assert name in distances["jersey"]
    # Laid upon it by turning and shifting only: lengths stay, and the mean stays put.
    for fabric in comparison.fabrics:
        own, laid = comparison.results[fabric]["front"].positions, comparison.layouts[fabric]["front"]
        np.testing.assert_allclose(
            np.linalg.norm(np.diff(laid, axis=0), axis=1), np.linalg.norm(np.diff(own, axis=0), axis=1), atol=1e-12
        )
        np.testing.assert_allclose(laid.mean(axis=0), comparison.layouts["denim"]["front"].mean(axis=0), atol=1e-12)
    vertex = comparison.points("front")["bust start"]
    there = comparison.layouts["power-net"]["front"][vertex] - comparison.layouts["denim"]["front"][vertex]
    assert distances["power-net"]["bust start"] == pytest.approx(np.linalg.norm(there), rel=1e-12)
    assert distances["power-net"]["outline, most"] >= distances["power-net"]["bust start"] > 5e-3


def test_stiffness_shows_as_the_cloth_has_it(comparison: Comparison):
    """Denim's weft is five times as stiff as its warp: it is strained less; the net gives both ways."""
    worn = {fabric: result["front"].measures["wear"] for fabric, result in comparison.results.items()}
    spread = {fabric: w["strain_weft"]["max"] - w["strain_weft"]["min"] for fabric, w in worn.items()}
    assert spread["denim"] < spread["jersey"] < spread["power-net"]
    borders = {fabric: comparison.borders(fabric, "front") for fabric in comparison.fabrics}
    assert set(borders["denim"]) == {"outline", "left", "right", "bottom", "top"}
    for lengths in borders.values():
        sides = sum(lengths[side] for side in ("left", "right", "bottom", "top"))
        assert sides == pytest.approx(lengths["outline"], rel=1e-12)


def test_files_and_table(comparison: Comparison, tmp_path: Path):
    assert save_comparison(comparison, tmp_path) == (["compare.json", "compare.png", "compare.svg"], ())
    data = json.loads((tmp_path / "compare.json").read_text())
    assert data["compared_with"] == "denim"
    assert set(data["fabrics"]["jersey"]["front"]) >= {"area_m2", "border_lengths_m", "model_energy_j", "wear"}
    assert (tmp_path / "compare.png").read_bytes().startswith(b"\x89PNG")

    root = ET.parse(tmp_path / "compare.svg").getroot()
    paths = {p.get("id"): p.get("d") for p in root.iter("{http://www.w3.org/2000/svg}path") if p.get("id")}
    assert set(paths) == {"front.denim", "front.jersey", "front.power-net"}
    for fabric in comparison.fabrics:
        drawn = np.array([[float(x) for x in at[1:].split(",")] for at in paths[f"front.{fabric}"].split(" ")[:-1]])
        loop = 1e3 * outline(comparison.results[fabric]["front"], comparison.layouts[fabric]["front"])[0][:-1]
        # One unit is one millimetre, y down.
        np.testing.assert_allclose(np.diff(drawn, axis=0), np.diff(loop, axis=0) * [1, -1], atol=2e-3)
    assert root.get("width", "").endswith("mm")

    table = comparison_table(comparison)
    assert table.splitlines()[0].split() == ["front", "denim", "jersey", "power-net"]
    for row in (
        "area [cm2]",
        "left [mm]",
        "strain energy [mJ]",
        "strain warp [%]",
        "bust start [mm]",
        "outline, most [mm]",
    ):
        assert any(line.startswith(row) for line in table.splitlines())


@pytest.mark.parametrize(
    ("fabrics", "message"),
    [
        (["denim"], r"1 fabric given to compare; name two or more"),
        (["jersey", "interlock"], r"fabric 'interlock' is given twice \(jersey\)"),
        (["denim", "jersy"], r"fabric: unknown fabric 'jersy': did you mean 'jersey'"),
    ],
)
def test_mistakes(tmp_path: Path, fabrics: list[str], message: str):
    with pytest.raises(InputError, match=message):
        compare_fabrics(scene_in(tmp_path), fabrics)


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.chdir(tmp_path)
    Path("cap.toml").write_text('datum = "centre"\n[surface]\nshape = "dome"\nresolution = 9\n')
    assert main(["compare", "cap.toml", "--fabric", "woven", "--fabric", "swim"]) == 0
    told = capsys.readouterr().out
    assert "cap" in told.splitlines()[0]
    assert "compare.svg" in told.splitlines()[-1]


HEM = """datum = "centre"
[surface]
shape = "bodice"
resolution = 17
[[cuts]]
line = "centre"
part = [0.0, 0.4]
name = "dart"
[[constraints]]
line = "top"
straight = "weft"
[[constraints]]
line = "bust"
length_mm = "body"
[output]
frames = 0
picture = false
[pattern]
formats = []
"""
SKIRT = """form = "a_line_skirt"
half = true
[mannequin]
size = "EU 38"
resolution_mm = 40
[[seams]]
name = "side left"
fullness = 0.03
longer = "front"
[output]
frames = 0
picture = false
[pattern]
formats = []
"""


@pytest.mark.parametrize(("text", "pieces"), [(HEM, ["front"]), (SKIRT, ["front", "back"])], ids=["surface", "garment"])
def test_all_else_is_what_a_run_makes_in_that_fabric(tmp_path: Path, text: str, pieces: list[str]):
    """Seams, constraints and the legs of darts included."""
    scene = scene_in(tmp_path, text)
    found = compare_fabrics(scene, ["denim", "jersey"], device=DEVICE)
    assert found.pieces == pieces
    for fabric in found.fabrics:
        run = replace(scene, settings=scene.settings.model_copy(update={"fabric": fabric}))
        metrics = run_scene(run, tmp_path / fabric, device=DEVICE).metrics
        for name in pieces:
            rows = (tmp_path / fabric / f"{name}.obj").read_text().splitlines()
            flat = np.array([row.split()[1:] for row in rows if row.startswith("vt ")], dtype=float)
            np.testing.assert_allclose(found.results[fabric][name].positions, flat, atol=2e-6)
        assert found.sewing[fabric]["sewing"]["converged"]
        for key in ("seams", "constraints"):
            told = [{k: v for k, v in entry.items() if k != "price_j"} for entry in found.sewing[fabric][key]]
            assert told == [{k: v for k, v in entry.items() if k != "price_j"} for entry in metrics[key]]
    assert json.loads(json.dumps(found.as_dict()))["sewing"]["denim"]["seams"]


@pytest.mark.parametrize("pulled_on", [False, True])
def test_a_dart_that_only_woven_cloth_needs_is_in_each_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pulled_on: bool
):
    bent = with_bent_elbows(body_of_size(40.0))
    monkeypatch.setattr("warpflat.app.scene.form.scene_mannequin", lambda scene: bent)
    plan = plan_scene(
        scene_in(
            tmp_path,
            f'fabric = "woven"\npulled_on = {str(pulled_on).lower()}\n'
            + SKIRT.split("[[seams]]")[0].replace("a_line_skirt", "shirt"),
        )
    )
    knit = plan.in_cloth(replace(plan.scene, settings=plan.scene.settings.model_copy(update={"fabric": "jersey"})))
    points = [[len(surface.vertices) for surface in each.surfaces] for each in (plan, knit)]
    assert "elbow dart left" in plan.form.pieces["sleeve_left"].darts
    assert points[0] == points[1]
    # What is pulled on grows less in a cloth that gives more.
    assert (knit.form.recipe.neckline != plan.form.recipe.neckline) == pulled_on


def test_a_dart_that_a_run_leaves_out_is_not_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene = scene_in(
        tmp_path, 'form = "bodice"\nhalf = true\nshape = "darts"\n[mannequin]\nsize = "EU 32"\nresolution_mm = 40\n'
    )
    for garment in (
        compare_fabrics(scene, ["woven", "denim"]).results["woven"],
        edit_dart(scene, "front.waist dart", how="turn", aim="nothing").before.parts,
    ):
        assert not any(line.startswith("waist dart") for line in garment["back"].surface.lines)
        assert any(line.startswith("bust dart") for line in garment["front"].surface.lines)
    assert main(["cuts", str(tmp_path / "front.toml"), "--out", str(tmp_path / "out")]) == 0
    assert "back: the waist dart is left out" in capsys.readouterr().err
    assert main(["cuts", str(tmp_path / "front.toml"), "--apply", "1", "--turn", "front.waist dart", "nothing"]) == 2
    assert "--turn and --apply: give one edit at a time" in capsys.readouterr().err


def test_what_a_run_refuses_is_not_compared(tmp_path: Path):
    with pytest.raises(InputError, match=r"front.toml: grain_angle: .* on the fold, with the grain at 30 degrees"):
        compare_fabrics(scene_in(tmp_path, "grain_angle = 30\n" + SKIRT), ["denim", "jersey"])


def test_cuts_are_ranked_without_constraints_and_say_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene_in(tmp_path, HEM)
    assert main(["cuts", str(tmp_path / "front.toml"), "--out", str(tmp_path / "out")]) == 0
    assert "note: candidates are compared without the scene's constraints; a run keeps them" in capsys.readouterr().err
    assert len(json.loads((tmp_path / "out" / "ledger.json").read_text())["notes"]) == 1


def test_each_cloth_is_draped_on_demand(tmp_path: Path):
    text = '[surface]\nshape = "dome"\nresolution = 9\n[drape]\nmax_steps = 200\n'
    path = tmp_path / "dome.toml"
    path.write_text(text)
    comparison = compare_fabrics(load_scene(path), ["woven", "denim"], drape=True)
    assert list(comparison.drapes) == ["woven", "denim"]
    files, notes = save_comparison(comparison, tmp_path / "out")
    assert (files[-1], notes) == ("compare-drape.png", ())
    assert (tmp_path / "out" / "compare-drape.png").stat().st_size > 10_000
    found = json.loads((tmp_path / "out" / "compare.json").read_text())["drapes"]
    assert found["denim"]["steps"] <= 200
    assert found["denim"]["bending_n_m"] > found["woven"]["bending_n_m"]
    table = comparison_table(comparison)
    worn = table[table.index("\nworn") :]
    assert f"{1e3 * found['denim']['misfit_m']['max']:.1f}" in worn
    assert "pressure, mean [Pa]" in worn
    # The picture of an earlier comparison is not taken for one of this.
    files, notes = save_comparison(replace(comparison, drapes={}), tmp_path / "out")
    assert sorted(files) == sorted(file.name for file in (tmp_path / "out").iterdir())
    assert notes == ("removed what an earlier run had left and this one did not make: compare-drape.png",)
