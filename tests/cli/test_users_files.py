"""What a command has read, or is not known by digest to have written, it never replaces: one rule for all commands."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest

from warpflat.cli.main import main

SCENE = "[surface]\nshape = 'dome'\nresolution = 9\n[output]\nframes = 4\n[pattern]\nformats = ['svg', 'dxf', 'json']\n"
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


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("cap.toml").write_text(SCENE + CUT)
    Path("b.toml").write_text(BATCH)
    Path("mesh.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    return tmp_path


def contents(folder: Path = Path()) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def refused(arguments: tuple[str, ...], capfd: pytest.CaptureFixture[str]) -> str:
    """The line of a command that is refused, and that leaves everything as it was."""
    before = contents()
    capfd.readouterr()
    assert main(list(arguments)) == 2
    told = capfd.readouterr()
    assert (told.out, told.err.count("\n")) == ("", 1), told
    assert contents() == before
    return told.err


@pytest.mark.parametrize(("command", "file"), CASES)
def test_a_file_of_the_user_stays(command: str, file: str, capfd: pytest.CaptureFixture[str]):
    Path("out").mkdir()
    (Path("out") / file).write_text("mine")
    told = refused(COMMANDS[command][0], capfd)
    assert f"out/{file}: is not of warpflat" in told
    assert "move it away, or choose another folder" in told


@pytest.mark.parametrize("command", ["run", "compare", "cuts", "mannequin", "batch"])
def test_own_files_are_replaced_until_they_are_changed(command: str, capfd: pytest.CaptureFixture[str]):
    arguments, files = COMMANDS[command]
    for _ in range(2):
        assert main(list(arguments)) == 0
    if command == "batch":
        shutil.rmtree(next(path for path in Path("out").iterdir() if path.is_dir()))  # or nothing is to be done
    for file in files:
        path = Path("out") / file
        before = path.read_bytes()
        text = json.dumps({**json.loads(before), "mine": 1}).encode() if file.endswith(".json") else before + b"mine"
        path.write_bytes(text)
        assert f"out/{file}: was changed since warpflat wrote it" in refused(arguments, capfd)
        path.write_bytes(before)
    assert main(list(arguments)) == 0


@pytest.mark.parametrize("file", ["review.html", "film.webp", "contact_sheet.png"])
def test_review_replaces_its_own_files_alone(file: str, capfd: pytest.CaptureFixture[str]):
    assert main(list(COMMANDS["run"][0])) == 0
    command = ("review", "out", "--film", "--sheet", "-q")
    for _ in range(2):
        assert main(list(command)) == 0
    (Path("out") / file).write_text("mine")
    assert f"out/{file}: was changed since warpflat wrote it" in refused(command, capfd)


def test_export_replaces_its_own_files_alone(capfd: pytest.CaptureFixture[str]):
    assert main(list(COMMANDS["run"][0])) == 0
    command = ("export", "out", "--format", "dxf", "--format", "svg", "--format", "json", "-q")
    for _ in range(2):
        assert main([*command, "--dialect", "astm"]) == 0
    Path("out/cap.svg").write_text("mine")
    assert "out/cap.svg: was changed since warpflat wrote it" in refused(command, capfd)
    Path("other").mkdir()
    shutil.copy("out/pattern.json", "other/pattern.json")
    Path("other/cap.svg").write_text("mine")
    assert "other/cap.svg: is not of warpflat" in refused(("export", "other", "--format", "svg"), capfd)


def test_a_pattern_that_was_edited_is_not_written_anew(capfd: pytest.CaptureFixture[str]):
    assert main(list(COMMANDS["run"][0])) == 0
    pattern = Path("out/pattern.json")
    pattern.write_text(json.dumps({**json.loads(pattern.read_text()), "mine": 1}))
    assert "pattern.json: was changed" in refused(("export", "out", "--format", "json"), capfd)


def test_a_drape_keeps_what_review_and_export_have_left():
    scene = "form = 'skirt'\n[mannequin]\nsize = 'EU 38'\nresolution_mm = 40\n[output]\nframes = 4\npicture = false\n"
    Path("cap.toml").write_text(scene + "[pattern]\nformats = ['json']\n")
    assert main(list(COMMANDS["run"][0])) == 0
    assert main(["review", "out", "--film", "--sheet", "-q"]) == 0
    assert main(["export", "out", "--format", "dxf", "-q"]) == 0
    with Path("cap.toml").open("a") as file:
        file.write("[drape]\nmax_steps = 100\n")
    kept = {file: (Path("out") / file).read_bytes() for file in ("film.webp", "contact_sheet.png", "cap.dxf")}
    assert main(list(COMMANDS["drape"][0])) in (0, 1)
    assert {file: (Path("out") / file).read_bytes() for file in kept} == kept
    assert set(kept) < set(json.loads(Path("out/metrics.json").read_text())["files"]["cap"])


def test_a_drape_does_not_replace_its_pattern(capfd: pytest.CaptureFixture[str]):
    assert main(list(COMMANDS["run"][0])) == 0
    Path("in").mkdir()
    shutil.copy("out/pattern.json", "in/metrics.json")
    assert "in/metrics.json" in refused(("drape", "in/metrics.json", "--body", "EU 38", "--out", "in", "-q"), capfd)


@pytest.mark.parametrize("name", ["index.html", "index.csv", "bodies.csv", "batch.json"])
def test_a_batch_does_not_replace_what_it_is_made_from(name: str, capfd: pytest.CaptureFixture[str]):
    Path("out").mkdir()
    os.replace("b.toml", f"out/{name}")
    Path(f"out/{name}").write_text(BATCH.replace("cap.toml", "../cap.toml"))
    if name != "bodies.csv":  # of one body there is none
        refused(("batch", f"out/{name}", "--out", "out", "-q"), capfd)
    before = Path(f"out/{name}").read_bytes()
    main(["batch", f"out/{name}", "--out", "out", "-q"])
    assert Path(f"out/{name}").read_bytes() == before


def test_a_link_in_the_way_stays(capfd: pytest.CaptureFixture[str]):
    Path("out").mkdir()
    Path("photo.png").write_text("mine")
    os.symlink("../photo.png", "out/picture.png")
    assert "out/picture.png: is not of warpflat" in refused(COMMANDS["run"][0], capfd)
    assert os.path.islink("out/picture.png")


GARMENT = """form = "skirt"
[mannequin]
size = "EU 38"
resolution_mm = 40
[wear]
stretch_warp = 0.01
[pattern]
sizes = ["EU 38", "EU 40"]
formats = ["dxf", "svg", "pdf", "json"]
[output]
frames = 4


[marker]
width = 1.5
seconds = 1
"""


def test_every_file_of_a_garment_is_known_to_the_next_run():
    Path("skirt.toml").write_text(GARMENT)
    # The second writes over the files of the first, and the third over its own.
    cuts = ("cuts", "skirt.toml", "--apply", "1", "--out", "out", "-q")
    for command in (("run", "skirt.toml", "--out", "out", "-q"), cuts, cuts):
        assert main(list(command)) in (0, 1)
    listed = {
        file
        for report in ("metrics.json", "ledger.json")
        for files in json.loads(Path("out", report).read_text())["files"].values()
        for file in files
    }
    assert {path.name for path in Path("out").iterdir()} == {*listed, "metrics.json", "ledger.json"}
