"""What a command has read, or is not known by digest to have written, it never replaces: one rule for all commands."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from command import Command
from trimesh.exchange.gltf import export_gltf

from warpflat.app.cli.main import main
from warpflat.app.scene.load import make_scene
from warpflat.app.scene.run import run_scene
from warpflat.core.errors import InputError
from warpflat.core.input_files import listening_to_reads
from warpflat.core.toml_file import read_toml
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.surface.io.read import read_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.garment.mannequin.table import MannequinTable, mannequin_from_table
from warpflat.pattern.export.obj import write_obj
from warpflat.pattern.export.piece_files import save_piece, write_pieces

# A bodice has four cuts to compare, a dome thirty-one.
SCENE = (
    "[surface]\nshape = 'bodice'\nresolution = 9\n[output]\nframes = 4\n[pattern]\nformats = ['svg', 'dxf', 'json']\n"
)
CUT = "[lines.across]\nplane = { point = [0, 0, 0], normal = [1, 0, 0] }\n"
BATCH = (
    "scenes = ['cap.toml']\noverrides = [{ output = { picture = false, frames = 0 }, pattern = { formats = [] } }]\n"
)
FLAT = ("--units", "m", "--name", "cap", "--frames", "0", "--out", "out", "-q")
COMMANDS = {
    "run": (("run", "cap.toml", "--out", "out", "-q"), ("picture.png", "cap.svg", "review.html", "frames.usdc", "metrics.json")),
    "flatten": (("flatten", "mesh.obj", *FLAT), ("cap.obj", "pattern.pdf")),
    "drape": (("drape", "cap.toml", "--out", "out", "-q"), ("drape.png", "cap.draped.obj")),
    "compare": (
        ("compare", "cap.toml", "--fabric", "denim", "--fabric", "jersey", "--out", "out", "-q"),
        ("compare.json", "compare.svg"),
    ),
    "cuts": (("cuts", "cap.toml", "--out", "out", "-q"), ("ledger.json", "ledger.png")),
    "mannequin": (("mannequin", "--size", "EU 38", "--resolution", "40", "--out", "out", "-q"), ("mannequin.obj",)),
    "batch": (("batch", "b.toml", "--out", "out", "-q"), ("index.html", "index.csv", "batch.json")),
}  # fmt: skip
CASES = [(command, file) for command, (_, files) in COMMANDS.items() for file in files]
REVIEW = ("review", "out", "--film", "--sheet", "-q")
EXPORT = ("export", "out", "--format", "dxf", "--format", "svg", "--format", "json", "--dialect", "astm", "-q")
AFTERWARDS = {
    "review": (REVIEW, ("review.html", "film.webp", "contact_sheet.png")),
    "export": (EXPORT, ("cap.svg", "pattern.json")),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that a run leaves, with what `review` and `export` add."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("cap.toml").write_text(SCENE + CUT)
        for command in (COMMANDS["run"][0], REVIEW, EXPORT):
            assert main(list(command)) == 0
    return folder / "out"


@pytest.fixture(autouse=True)
def here(command: Command) -> None:
    """A folder with a scene, a batch and a mesh."""
    Path("cap.toml").write_text(SCENE + CUT)
    Path("b.toml").write_text(BATCH)
    Path("mesh.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")


@pytest.mark.parametrize(("name", "file"), CASES)
def test_a_file_of_the_user_stays(name: str, file: str, command: Command):
    Path("out").mkdir()
    (Path("out") / file).write_text("mine")
    told = command(*COMMANDS[name][0]).refusal
    assert f"out/{file}: is not of warpflat" in told
    assert "move it away, or choose another folder" in told


def test_a_link_in_the_way_stays(command: Command):
    Path("out").mkdir()
    Path("photo.png").write_text("mine")
    os.symlink("../photo.png", "out/picture.png")
    assert "out/picture.png: is not of warpflat" in command(*COMMANDS["run"][0]).refusal


@pytest.mark.parametrize("name", ["run", "compare", "cuts", "mannequin", "batch", "review", "export"])
def test_own_files_are_replaced_until_they_are_changed(name: str, made: Path, command: Command):
    arguments, files = {**COMMANDS, **AFTERWARDS}[name]
    if name in AFTERWARDS:
        shutil.copytree(made, "out")
    assert command(*arguments).code == 0
    if name == "batch":
        shutil.rmtree(next(path for path in Path("out").iterdir() if path.is_dir()))  # or nothing is to be done
    for file in files:
        path = Path("out") / file
        before = path.read_bytes()
        text = json.dumps({**json.loads(before), "mine": 1}).encode() if file.endswith(".json") else before + b"mine"
        path.write_bytes(text)
        assert f"out/{file}: was changed since warpflat wrote it" in command(*arguments).refusal
        path.write_bytes(before)
    assert command(*arguments).code == 0


def test_a_pattern_is_not_exported_over_a_file_of_the_user(made: Path, command: Command):
    Path("other").mkdir()
    shutil.copy(made / "pattern.json", "other/pattern.json")
    Path("other/cap.svg").write_text("mine")
    assert "other/cap.svg: is not of warpflat" in command("export", "other", "--format", "svg").refusal


def test_a_drape_keeps_what_review_and_export_have_left(command: Command):
    scene = "form = 'skirt'\n[mannequin]\nsize = 'EU 38'\nresolution_mm = 40\n[output]\nframes = 4\npicture = false\n"
    Path("cap.toml").write_text(scene + "[pattern]\nformats = ['json']\n")
    for arguments in (COMMANDS["run"][0], REVIEW, ("export", "out", "--format", "dxf", "-q")):
        assert command(*arguments).code == 0
    with Path("cap.toml").open("a") as file:
        file.write("[drape]\nmax_steps = 100\n")
    added = {"film.webp", "contact_sheet.png", "cap.dxf"}
    draped = command(*COMMANDS["drape"][0])
    assert draped.code in (0, 1)
    assert not draped.changed & {f"out/{name}" for name in added}
    assert added < set(json.loads(Path("out/metrics.json").read_text())["files"]["cap"])


def test_a_drape_does_not_replace_its_pattern(made: Path, command: Command):
    Path("in").mkdir()
    shutil.copy(made / "pattern.json", "in/metrics.json")
    told = command("drape", "in/metrics.json", "--body", "EU 38", "--out", "in", "-q").refusal
    assert "in/metrics.json" in told


@pytest.mark.parametrize("name", ["index.html", "index.csv", "batch.json", "bodies.csv"])
def test_a_batch_does_not_replace_what_it_is_made_from(name: str, command: Command):
    Path("out").mkdir()
    Path(f"out/{name}").write_text(BATCH.replace("cap.toml", "../cap.toml"))
    ended = command("batch", f"out/{name}", "--out", "out", "-q")
    assert f"out/{name}" not in ended.changed
    # A table of bodies is no file of a batch of one body.
    assert name == "bodies.csv" or f"out/{name}" in ended.refusal


GARMENT = """form = "a_line_skirt"
half = true
[mannequin]
size = "EU 38"
resolution_mm = 40
[wear]
stretch_warp = 0.01
[pattern]
formats = ["dxf", "svg", "pdf", "json"]
[output]
frames = 4
[marker]
width = 1.5
seconds = 1
"""


def test_every_file_of_a_garment_is_known_to_the_next_run(command: Command):
    Path("skirt.toml").write_text(GARMENT)
    # The second writes over the files of the first.
    cuts = ("cuts", "skirt.toml", "--apply", "1", "--out", "out", "-q")
    for arguments in (("run", "skirt.toml", "--out", "out", "-q"), cuts):
        assert command(*arguments).code in (0, 1)
    listed = {
        file
        for report in ("metrics.json", "ledger.json")
        for files in json.loads(Path("out", report).read_text())["files"].values()
        for file in files
    }
    assert {path.name for path in Path("out").iterdir()} == {*listed, "metrics.json", "ledger.json"}


# --- what was read

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0.2\nv 2 1 0.2\nf 1 2 3 4\nf 2 5 6 3\n"
MESH = "[surface]\nfile = 'front.obj'\nunits = 'm'\n"
FLATTEN = ("flatten", "front.obj", "--units", "m", "--out", ".", "--frames", "0", "--no-picture")
Commands = list[tuple[str, ...]]


def a_mesh_beside_the_output() -> Commands:
    return [FLATTEN]


def the_output_is_a_link_to_the_mesh() -> Commands:
    for link, folder in ((os.symlink, "there"), (os.link, "elsewhere")):
        Path(folder).mkdir()
        link(Path("front.obj").absolute(), f"{folder}/front.obj")
    return [(*FLATTEN, "--out", folder) for folder in ("there", "elsewhere")]


def the_mesh_is_a_link_to_the_output() -> Commands:
    Path("there").mkdir()
    Path("front.obj").rename("there/piece.obj")
    os.link("there/piece.obj", "hard.obj")
    os.symlink(Path("there/piece.obj").absolute(), "soft.obj")
    return [("flatten", mesh, *FLATTEN[2:], "--out", "there", "--name", "piece") for mesh in ("hard.obj", "soft.obj")]


def the_folder_has_another_path() -> Commands:
    os.symlink(Path.cwd(), "here")
    return [(*FLATTEN, "--out", "here"), (*FLATTEN, "--out", str(Path.cwd()))]


def a_scene_beside_its_mesh() -> Commands:
    Path("front.toml").write_text(MESH)
    return [("run", "front.toml", "--out", "."), ("cuts", "front.toml", "--apply", "1", "--out", ".")]


def a_scan() -> Commands:
    for file in ("mannequin.obj", "pattern.obj"):
        Path(file).write_text(SQUARE)
    Path("body.toml").write_text("form = 'skirt'\n[mannequin]\nscan = 'pattern.obj'\n")
    os.link("pattern.obj", "pattern.json")
    return [("mannequin", "--scan", "mannequin.obj", "--out", "."), ("run", "body.toml", "--out", ".")]


def what_is_compared() -> Commands:
    Path("front.toml").write_text(MESH)
    os.link("front.obj", "compare.svg")
    return [("compare", "front.toml", "--fabric", "denim", "--fabric", "jersey", "--out", ".")]


def a_scene_file_and_a_fabric_file() -> Commands:
    Path("front.toml").write_text("name = 'other'\nfabric = 'mine'\nfabric_files = ['mine.toml']\n" + MESH)
    Path("mine.toml").write_text("[mine]\nbase = 'denim'\n")
    for file in ("front.toml", "mine.toml"):
        Path(f"at {file}").mkdir()
        os.link(file, f"at {file}/other.svg")
    return [("run", "front.toml", "--out", f"at {file}") for file in ("front.toml", "mine.toml")]


def frames_and_the_layers_they_refer_to() -> Commands:
    save_piece(flatten(make_shape("dome", resolution=5)), ".", picture=False)
    Path("scene.usda").write_text("#usda 1.0\n(\n metersPerUnit = 1\n subLayers = [@./frames.usdc@]\n)\n")
    options = ("--prim", "/World/dome/dome_surface", "--out", ".", "--name", "other")
    return [("flatten", "frames.usdc", *options), ("flatten", "scene.usda", *options)]


def what_a_mesh_refers_to() -> Commands:
    files = export_gltf(trimesh.Scene(trimesh.creation.box()), merge_buffers=True)
    (buffer,) = (name for name in files if name.endswith(".bin"))
    Path("picture.png").write_bytes(files[buffer])
    Path("model.gltf").write_bytes(files["model.gltf"].replace(buffer.encode(), b"picture.png"))
    return [("flatten", "model.gltf", "--out", ".", "--name", "other")]


@pytest.mark.parametrize(
    "arranged",
    [
        a_mesh_beside_the_output, the_output_is_a_link_to_the_mesh, the_mesh_is_a_link_to_the_output,
        the_folder_has_another_path, a_scene_beside_its_mesh, a_scan, what_is_compared, a_scene_file_and_a_fabric_file,
        frames_and_the_layers_they_refer_to, what_a_mesh_refers_to,
    ],
    ids=lambda arranged: arranged.__name__.replace("_", " "),
)  # fmt: skip
def test_what_a_run_reads_it_neither_replaces_nor_computes_with(
    arranged: Callable[[], Commands], command: Command, monkeypatch: pytest.MonkeyPatch
):
    def fail(*_: object, **__: object) -> None:
        pytest.fail("it was computed")

    Path("front.obj").write_text(SQUARE)
    commands = arranged()
    monkeypatch.setattr("warpflat.flat.flatten", fail)
    monkeypatch.setattr("warpflat.garment.mannequin.mannequin.Mannequin.from_scan", fail)
    for arguments in commands:
        assert "is read by this run" in command(*arguments).refusal


def test_another_name_or_folder_is_what_helps(command: Command):
    Path("front.obj").write_text(SQUARE)
    assert "another output folder (--out) or another name" in command(*FLATTEN).refusal
    for helps in (("--name", "other"), ("--out", "there")):
        done = command(*FLATTEN, *helps, "-q")
        assert done.code == 0
        assert "front.obj" not in done.changed


def test_a_piece_whose_name_a_cut_gives():
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
    assert {path.name for path in Path().iterdir()} == {part, "there", "cap.toml", "b.toml", "mesh.obj"}


def test_a_result_is_not_saved_over_its_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    Path("front.obj").write_text(SQUARE)
    result = flatten(read_surface("front.obj", units="m"))
    for save in (
        lambda: save_piece(result, tmp_path, picture=False, frames=False),
        lambda: write_pieces([result], tmp_path, picture=False, frames=False),
        lambda: write_obj(tmp_path / "front.obj", result.surface, result.positions),
    ):
        with pytest.raises(InputError, match="is read by this run"):
            save()
    assert {path.name for path in tmp_path.iterdir()} == {"front.obj", "cap.toml", "b.toml", "mesh.obj"}
    assert (tmp_path / "front.obj").read_text() == SQUARE
    # What was saved may be saved again, from another folder too, and a mesh that only happens to have been read may be replaced.
    save_piece(result, "there", picture=False, frames=False)
    read_surface("there/front.obj", units="m")
    monkeypatch.chdir("there")
    with pytest.raises(InputError, match="is read by this run"):
        save_piece(result, "..", picture=False, frames=False)
    save_piece(result, ".", picture=False, frames=False)
    again = flatten(read_surface("front.obj", units="m"))
    with pytest.raises(InputError, match="is read by this run"):
        save_piece(again, ".", picture=False, frames=False)
    assert (tmp_path / "front.obj").read_text() == SQUARE


def test_export_writes_beside_its_pattern_and_not_over_it(made: Path, command: Command):
    shutil.copytree(made, "out")
    Path("out/cap.svg").unlink()
    os.link("out/pattern.json", "out/cap.svg")
    assert "is read by this run" in command("export", "out", "--format", "svg").refusal


def test_every_reader_tells_what_it_reads(tmp_path: Path):
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
