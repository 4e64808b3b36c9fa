"""No run and no result replaces a file that it was made from, by whatever name that goes."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh.exchange.gltf import export_gltf

from warpflat.cli.main import main
from warpflat.core.errors import InputError
from warpflat.core.toml_file import read_toml
from warpflat.export.obj import write_obj
from warpflat.flattening.flatten_piece import flatten
from warpflat.mannequin.table import mannequin_from_table
from warpflat.scene.load import make_scene
from warpflat.scene.run import run_scene
from warpflat.surface.io.read import read_surface
from warpflat.surface.shapes import make_shape

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0.2\nv 2 1 0.2\nf 1 2 3 4\nf 2 5 6 3\n"
SCENE = "[surface]\nfile = 'front.obj'\nunits = 'm'\n"
FLATTEN = ("flatten", "front.obj", "--units", "m", "--out", ".", "--frames", "0", "--no-picture")

Refused = Callable[..., str]


@pytest.fixture
def refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Refused:
    """Runs the command line in a folder with `front.obj`: nothing is computed or touched, one line says why; returns that."""
    monkeypatch.chdir(tmp_path)
    Path("front.obj").write_text(SQUARE)

    def fail(*_: object, **__: object) -> None:
        pytest.fail("it was computed")

    def run(*arguments: str) -> str:
        before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
        with monkeypatch.context() as patched:
            patched.setattr("warpflat.flattening.flatten_piece.flatten", fail)
            patched.setattr("warpflat.mannequin.mannequin.Mannequin.from_scan", fail)
            code = main(list(arguments))
        told = capfd.readouterr()
        assert (code, told.out, told.err.count("\n")) == (2, "", 1), told
        assert "is read by this run" in told.err
        assert {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()} == before
        return told.err

    return run


def test_a_mesh_beside_the_output(refused: Refused):
    assert "front.obj" in refused(*FLATTEN)


def test_another_name_or_folder_is_what_helps(refused: Refused):
    told = refused(*FLATTEN)
    assert "another output folder (--out) or another name" in told
    assert main([*FLATTEN, "--name", "other", "-q"]) == 0
    assert main([*FLATTEN, "--out", "there", "-q"]) == 0
    assert Path("front.obj").read_text() == SQUARE


@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_the_output_is_a_link_to_the_mesh(refused: Refused, link: Callable[..., None]):
    Path("there").mkdir()
    link(Path("front.obj").absolute(), "there/front.obj")
    refused(*FLATTEN, "--out", "there")


@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_the_mesh_is_a_link_to_the_output(refused: Refused, link: Callable[..., None]):
    Path("there").mkdir()
    Path("front.obj").rename("there/piece.obj")
    link(Path("there/piece.obj").absolute(), "front.obj")
    refused(*FLATTEN, "--out", "there", "--name", "piece")


def test_the_folder_has_another_path(refused: Refused):
    os.symlink(Path.cwd(), "here")
    refused(*FLATTEN, "--out", "here")
    refused(*FLATTEN, "--out", str(Path.cwd()))


def test_a_scene_beside_its_mesh(refused: Refused):
    Path("front.toml").write_text(SCENE)
    refused("run", "front.toml", "--out", ".")
    refused("cuts", "front.toml", "--apply", "1", "--out", ".")


def test_a_scan(refused: Refused):
    Path("mannequin.obj").write_text(SQUARE)
    refused("mannequin", "--scan", "mannequin.obj", "--out", ".")
    Path("body.toml").write_text("form = 'skirt'\n[mannequin]\nscan = 'pattern.obj'\n")
    Path("pattern.obj").write_text(SQUARE)
    os.link("pattern.obj", "pattern.json")
    refused("run", "body.toml", "--out", ".")


def test_what_is_compared(refused: Refused):
    Path("front.toml").write_text(SCENE)
    os.link("front.obj", "compare.svg")
    refused("compare", "front.toml", "--fabric", "denim", "--fabric", "jersey", "--out", ".")


def test_a_scene_file_and_a_fabric_file(refused: Refused):
    Path("front.toml").write_text("name = 'other'\nfabric = 'mine'\nfabric_files = ['mine.toml']\n" + SCENE)
    Path("mine.toml").write_text("[mine]\nbase = 'denim'\n")
    for file in ("front.toml", "mine.toml"):
        os.link(file, "other.svg")
        refused("run", "front.toml", "--out", ".")
        Path("other.svg").unlink()


def test_frames_and_the_layers_they_refer_to(refused: Refused):
    flatten(make_shape("dome", resolution=5)).save(".", picture=False)
    refused("flatten", "frames.usdc", "--prim", "/World/dome/surface", "--out", ".", "--name", "other")
    Path("scene.usda").write_text("#usda 1.0\n(\n metersPerUnit = 1\n subLayers = [@./frames.usdc@]\n)\n")
    refused("flatten", "scene.usda", "--prim", "/World/dome/surface", "--out", ".", "--name", "other")


def test_what_a_mesh_refers_to(refused: Refused):
    files = export_gltf(trimesh.Scene(trimesh.creation.box()), merge_buffers=True)
    (buffer,) = (name for name in files if name.endswith(".bin"))
    Path("picture.png").write_bytes(files[buffer])
    Path("model.gltf").write_bytes(files["model.gltf"].replace(buffer.encode(), b"picture.png"))
    refused("flatten", "model.gltf", "--out", ".", "--name", "other")


def test_a_piece_whose_name_a_cut_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    write_obj("whole.obj", make_shape("dome", resolution=7), make_shape("dome", resolution=7).vertices[:, :2])
    tables = {
        "surface": {"file": "whole.obj", "units": "m"},
        "lines": {"across": {"plane": {"point": [0, 0, 0], "normal": [1, 0, 0]}}},
        "cuts": [{"line": "across"}],
        "output": {"frames": 0, "picture": False},
    }
    files = run_scene(make_scene(tables, name="cap", folder=Path(), where="test"), "there").files
    part = next(file for file in files if file.endswith(".obj") and file != "cap.obj")
    Path("whole.obj").rename(part)
    tables["surface"]["file"] = part  # type: ignore[index]
    before = Path(part).read_bytes()
    with pytest.raises(InputError, match="is read by this run"):
        run_scene(make_scene(tables, name="cap", folder=Path(), where="test"), ".")
    assert Path(part).read_bytes() == before
    assert {path.name for path in Path().iterdir()} == {part, "there"}


def test_a_result_is_not_saved_over_its_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    Path("front.obj").write_text(SQUARE)
    result = flatten("front.obj", units="m")
    for save in (
        lambda: result.save(tmp_path, picture=False, frames=False),
        lambda: result.write_obj(tmp_path),
        lambda: write_obj(tmp_path / "front.obj", result.surface, result.positions),
    ):
        with pytest.raises(InputError, match="is read by this run"):
            save()
    assert [path.name for path in tmp_path.iterdir()] == ["front.obj"]
    # What was saved may be saved again, from another folder too, and a mesh that only happens to have been read may be replaced.
    result.save("there", picture=False, frames=False)
    read_surface("there/front.obj", units="m")
    monkeypatch.chdir("there")
    with pytest.raises(InputError, match="is read by this run"):
        result.save("..", picture=False, frames=False)
    result.save(".", picture=False, frames=False)
    again = flatten(read_surface("front.obj", units="m"))
    with pytest.raises(InputError, match="is read by this run"):
        again.save(".", picture=False, frames=False)
    assert (tmp_path / "front.obj").read_text() == SQUARE


def test_export_writes_beside_its_pattern_and_not_over_it(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    tables = {"surface": {"shape": "dome", "resolution": 7}, "output": {"frames": 0, "picture": False}}
    run_scene(make_scene(tables, name="cap", folder=Path(), where="test"), tmp_path)
    assert main(["export", str(tmp_path), "--format", "svg", "--format", "json", "-q"]) == 0
    (tmp_path / "cap.svg").unlink()
    os.link(tmp_path / "pattern.json", tmp_path / "cap.svg")
    before = (tmp_path / "pattern.json").read_bytes()
    assert main(["export", str(tmp_path), "--format", "svg"]) == 2
    assert "is read by this run" in capfd.readouterr().err
    assert (tmp_path / "pattern.json").read_bytes() == before
    assert json.loads(before)["schema"]


def test_every_reader_tells_what_it_reads(tmp_path: Path):
    from warpflat.core.input_files import listening_to_reads
    from warpflat.mannequin.table import MannequinTable

    mesh = trimesh.creation.box()
    told: list[Path] = []
    with listening_to_reads(told.append):
        for suffix in ("obj", "ply", "stl", "off", "glb"):
            mesh.export(tmp_path / f"a.{suffix}")
            with pytest.raises(InputError):
                read_surface(tmp_path / f"a.{suffix}", units="m")  # it has no border
        (tmp_path / "a.toml").write_text("a = 1")
        read_toml(tmp_path / "a.toml")
        np.savetxt(tmp_path / "scan.obj", [[0, 0, 0]], fmt="v %g %g %g")
        with pytest.raises(InputError):
            mannequin_from_table(MannequinTable(scan="scan.obj"), path_of=lambda file: tmp_path / file)
    assert {path.name for path in told} >= {"a.obj", "a.ply", "a.stl", "a.off", "a.glb", "a.toml", "scan.obj"}
