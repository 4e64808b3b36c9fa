"""Names that become files: what is refused, what is changed, and that nothing is written outside the folder."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

import warpflat
from warpflat.app.cli.main import main
from warpflat.app.scene.load import make_scene
from warpflat.app.scene.run import run_scene
from warpflat.core.errors import InputError
from warpflat.core.file_names import check_file_name, make_file_name
from warpflat.flat.surface.io.read import read_surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.garment.mannequin.forms import form_from_mapping
from warpflat.pattern.export.pattern_files import export_patterns

BAD = {
    "": "it is empty",
    " ": "it is empty",
    ".": "begins with a dot",
    ".hidden": "begins with a dot",
    "../evil": "it has '/' in it",
    "/tmp/absolute": "it has '/' in it",
    "a\\b": "in it",
    "c:front": "it has ':' in it",
    'a "b"': "in it",
    "what?": "in it",
    "a\nb": r"it has '\\n' in it",
    "a\0b": "in it",
    "a\u2028b": "in it",
    "\udcff": "in it",
    "con": "Windows keeps it",
    "LPT1.left": "Windows keeps it",
    "x" * 201: "it takes 201 bytes, 200 are the most",
    "裁" * 67: "it takes 201 bytes",
}
GOOD = ("front_bodice", "devant é", "裁 片", "a.b", "back (lining), 2 of 'silk' & +", "console", "x" * 200)


@pytest.mark.parametrize(("name", "words"), BAD.items())
def test_names_that_no_file_can_bear_are_refused_in_one_line(name: str, words: str):
    with pytest.raises(InputError, match=words) as refused:
        check_file_name(name)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 200


@pytest.mark.parametrize("name", GOOD)
def test_other_names_stay_as_they_are(name: str):
    assert check_file_name(name) == make_file_name(name) == name


@pytest.mark.parametrize("name", BAD)
def test_names_that_nobody_chose_are_made_to_fit(name: str):
    fitted = make_file_name(name)
    assert check_file_name(fitted) == fitted


@pytest.mark.parametrize("piece", ["../evil", "/tmp/absolute", "", "a\nb"])
def test_a_form_names_its_pieces_as_files_can_be_named(tmp_path: Path, piece: str, capsys: pytest.CaptureFixture[str]):
    scene = tmp_path / "names.toml"
    recipe = '{ bricks = ["waist-hip/front-*"], datum = "centre front" }'
    scene.write_text(f'[mannequin]\nsize = "EU 36"\n[form.pieces]\n{json.dumps(piece)} = {recipe}\n', encoding="utf-8")
    assert main(["run", str(scene), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert f"pieces: {piece!r} cannot name a file" in told
    assert told.count("\n") == 1
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [scene]


def test_two_pieces_of_a_form_are_two_files_everywhere():
    recipe = {"bricks": ["waist-hip/front-*"]}
    for first, second in (("front", "Front"), ("devant \u00e9", "devant e\u0301")):
        with pytest.raises(InputError, match=f"'{first}' and '{second}' would be one file"):
            form_from_mapping("top", {"pieces": {first: recipe, second: recipe}})


def test_surfaces_are_named_as_files_can_be(tmp_path: Path):
    triangle = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    for name in ("..", "a/b", "a\nb"):
        with pytest.raises(InputError, match="cannot name a file"):
            make_surface(*triangle, name=name)
    mesh = tmp_path / "front: 1.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert read_surface(mesh, units="m").name == "front_ 1"
    with pytest.raises(InputError, match=r"front: 1\.obj: '\.\./x' cannot name a file"):
        read_surface(mesh, units="m", name="../x")


def test_a_scene_is_named_after_its_file_as_far_as_files_can_be():
    tables = {"surface": {"shape": "dome"}}
    assert make_scene(tables, name="cap <2>", folder=Path(), where="test").name == "cap _2_"
    with pytest.raises(InputError, match="test: name: 'aux' cannot name a file"):
        make_scene({"name": "aux", **tables}, name="cap", folder=Path(), where="test")


def test_nothing_is_written_outside_the_folder_whoever_gave_the_name(tmp_path: Path):
    out = tmp_path / "out"
    dome = make_shape("dome", resolution=5)
    with pytest.raises(InputError, match="cannot name a file"):
        warpflat.save_piece(warpflat.flatten(replace(dome, name="../evil"), device="cpu"), out)
    tables = {"surface": {"shape": "dome", "resolution": 9}, "output": {"frames": 0, "picture": False}}
    run_scene(make_scene(tables, name="cap", folder=tmp_path, where="test"), out)
    drawn = json.loads((out / "pattern.json").read_text())
    (out / "pattern.json").write_text(json.dumps({**drawn, "name": "../evil"}))
    with pytest.raises(InputError, match="cannot name a file"):
        export_patterns(out, ["svg"])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]
