"""Several runs into one folder: what stays of the earlier ones."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from warpflat.app.cli.main import main
from warpflat.app.scene.load import make_scene
from warpflat.app.scene.run import SceneResult, run_scene
from warpflat.core.errors import CannotWriteError, InputError
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.surface.shapes import make_shape
from warpflat.pattern.export.pattern_files import export_patterns
from warpflat.pattern.export.piece_files import save_piece
from warpflat.pattern.files.output import remove_stale

PATTERN = {"cap.dxf", "cap.svg", "pattern.pdf", "pattern.json"}


def run(
    folder: Path, *, name: str = "cap", shape: str = "dome", frames: int = 0, formats: Sequence[str] = ()
) -> SceneResult:
    tables = {
        "surface": {"shape": shape, "resolution": 9},
        "output": {"frames": frames, "picture": False},
        "pattern": {"formats": list(formats)},
    }
    return run_scene(make_scene(tables, name=name, folder=folder, where="test"), folder / "out")


def files(folder: Path) -> set[str]:
    return {path.name for path in (folder / "out").iterdir()}


def metrics(folder: Path) -> dict:
    return json.loads((folder / "out" / "metrics.json").read_text())


def test_a_run_removes_what_an_earlier_one_left_and_it_does_not_make(tmp_path: Path):
    first = run(tmp_path, frames=3, formats=("dxf", "svg", "pdf", "json"))
    assert set(metrics(tmp_path)["files"]["cap"]) == set(first.files) - {"metrics.json"} == {
        *PATTERN, "cap.obj", "frames.usdc"
    }  # fmt: skip
    second = run(tmp_path, shape="bodice")
    assert files(tmp_path) == {"cap.obj", "metrics.json"} == set(second.files)
    (note,) = [note for note in second.notes if note.startswith("removed")]
    assert all(file in note for file in (*PATTERN, "frames.usdc"))
    assert json.loads(json.dumps(second.metrics)) == metrics(tmp_path)
    with pytest.raises(InputError, match=r"pattern\.json"):
        export_patterns(tmp_path / "out", ["dxf"])


def test_the_console_says_what_was_removed(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene = tmp_path / "cap.toml"
    text = "[surface]\nshape = 'dome'\nresolution = 9\n[output]\nframes = 0\npicture = false\n[pattern]\nformats = "
    for formats in ("['svg']", "[]"):
        scene.write_text(text + formats)
        assert main(["run", str(scene), "--out", str(tmp_path / "out")]) == 0
    assert "removed what an earlier run had left and this one did not make: cap.svg" in capsys.readouterr().err


def test_nothing_of_the_user_is_removed(tmp_path: Path):
    run(tmp_path, frames=3, formats=("svg", "json"))
    out = tmp_path / "out"
    own = {"sketch.svg": "mine", "cap.dxf": "from another program", "cap.svg": "drawn on by hand"}
    for name, text in own.items():
        (out / name).write_text(text)
    again = run(tmp_path)
    assert {name: (out / name).read_text() for name in own} == own
    assert files(tmp_path) == {*own, "cap.obj", "metrics.json"}
    assert [note for note in again.notes if "cap.svg" in note and "stays" in note]
    assert not any("sketch.svg" in note for note in again.notes)


def test_a_folder_whose_files_are_not_known_is_left_alone(tmp_path: Path):
    run(tmp_path, formats=("svg",))
    known = metrics(tmp_path)
    del known["files"]
    (tmp_path / "out" / "metrics.json").write_text(json.dumps(known))
    before = contents(tmp_path)
    with pytest.raises(InputError, match=r"cap\.obj: is not of warpflat, and would be replaced"):
        run(tmp_path)
    assert contents(tmp_path) == before


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (folder / "out").iterdir()}


def test_metrics_that_were_changed_stay(tmp_path: Path):
    run(tmp_path)
    known = {**metrics(tmp_path), "my note": "keep"}
    (tmp_path / "out" / "metrics.json").write_text(json.dumps(known))
    before = contents(tmp_path)
    with pytest.raises(InputError, match=r"metrics\.json: was changed since warpflat wrote it"):
        run(tmp_path)
    assert contents(tmp_path) == before
    del known["my note"]  # with other blanks it is still what warpflat has written
    (tmp_path / "out" / "metrics.json").write_text(json.dumps(known))
    run(tmp_path)


def test_pieces_of_another_name_stay_in_a_shared_folder(tmp_path: Path):
    run(tmp_path, formats=("svg", "json"))
    second = run(tmp_path, name="other", shape="bodice", formats=("svg",))
    # The pattern of the first would be taken to be that of the second.
    assert files(tmp_path) == {"cap.obj", "cap.svg", "other.obj", "other.svg", "metrics.json"}
    assert [note for note in second.notes if note.endswith("pattern.json")]
    assert {run: set(known) for run, known in metrics(tmp_path)["files"].items()} == {
        "cap": {"cap.obj", "cap.svg"}, "other": {"other.obj", "other.svg"}
    }  # fmt: skip
    run(tmp_path)
    assert files(tmp_path) == {"cap.obj", "other.obj", "other.svg", "metrics.json"}


def test_nothing_is_removed_by_a_run_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    run(tmp_path, frames=3, formats=("svg", "json"))
    before = files(tmp_path)

    def full(*_: object, **__: object) -> None:
        raise CannotWriteError("cannot write: no space left on device")

    monkeypatch.setattr("warpflat.pattern.export.pattern_files._write", full)
    with pytest.raises(InputError, match="no space"):
        run(tmp_path, shape="bodice", formats=("pdf",))
    assert files(tmp_path) == before
    monkeypatch.undo()
    # What the first run wrote is still known, and goes with the next one that ends well.
    run(tmp_path, shape="bodice")
    assert files(tmp_path) == {"cap.obj", "metrics.json"}


def test_saving_a_result_by_hand_removes_nothing_and_forgets_nothing(tmp_path: Path):
    run(tmp_path, formats=("svg",))
    save_piece(flatten(make_shape("bodice", resolution=9)), tmp_path / "out", picture=False, frames=False)
    assert {"cap.svg", "cap.obj", "bodice.obj"} < files(tmp_path)
    run(tmp_path)
    assert files(tmp_path) == {"cap.obj", "bodice.obj", "metrics.json"}


def test_what_was_exported_later_belongs_to_the_run(tmp_path: Path):
    run(tmp_path, formats=("json", "dxf"))
    for kind in ("dxf", "svg"):
        export_patterns(tmp_path / "out", [kind], dialect="astm")
    run(tmp_path)
    assert files(tmp_path) == {"cap.obj", "metrics.json"}


def test_a_mesh_that_the_run_was_made_from_stays(tmp_path: Path):
    run(tmp_path, frames=3)
    tables = {
        "surface": {"file": "out/frames.usdc", "prim": "/World/cap/cap_surface"},
        "output": {"frames": 0, "picture": False},
        "pattern": {"formats": []},
    }
    made = run_scene(make_scene(tables, name="cap", folder=tmp_path, where="test"), tmp_path / "out")
    assert "frames.usdc" in files(tmp_path)
    assert [note for note in made.notes if "frames.usdc" in note and "made from it" in note]


@pytest.mark.parametrize("name", ["../user.txt", "/etc/hostname", "..", "", "metrics.json", "folder/user.txt"])
def test_a_record_that_names_other_places_is_not_followed(tmp_path: Path, name: str):
    user = tmp_path / "user.txt"
    user.write_text("")
    empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    out = tmp_path / "out"
    (out / "folder").mkdir(parents=True)
    (out / "folder" / "user.txt").write_text("")
    (out / "metrics.json").write_text(json.dumps({"warpflat": "0.1.0", "files": {"cap": {name: empty}}}))
    _, notes = remove_stale(out, {}, name="cap", files=())
    assert notes == ()
    assert all(path.exists() for path in (user, out / "folder" / "user.txt", out / "metrics.json"))


FOREIGN = {
    "lists in lists": "[" * 100_000,
    "digits": '{"warpflat": ' + "9" * 5000 + "}",
    "of another program": '{"accuracy": 0.9}',
    "a list": "[]",
    "no JSON": "accuracy = 0.9",
    "empty": "",
    "no text": "\x00\udcff",
}


@pytest.mark.parametrize("text", FOREIGN.values(), ids=FOREIGN)
def test_metrics_of_another_program_are_not_replaced(
    tmp_path: Path, text: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    def too_late(*_: object, **__: object) -> None:
        raise AssertionError("it was flattened first")

    monkeypatch.setattr("warpflat.flat.flatten", too_late)
    own = tmp_path / "out" / "metrics.json"
    own.parent.mkdir()
    own.write_text(text, errors="surrogateescape")
    before = own.read_bytes()
    scene = tmp_path / "cap.toml"
    scene.write_text("[surface]\nshape = 'dome'\nresolution = 5\n")
    assert main(["run", str(scene), "--out", str(own.parent)]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert f"{own}: is not of warpflat" in told
    assert [path.name for path in own.parent.iterdir()] == ["metrics.json"]
    assert own.read_bytes() == before


def test_a_result_saved_by_hand_does_not_replace_the_metrics_of_another_program(tmp_path: Path):
    (tmp_path / "metrics.json").write_text('{"accuracy": 0.9}')
    with pytest.raises(InputError, match="is not of warpflat"):
        save_piece(flatten(make_shape("dome", resolution=5)), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["metrics.json"]


def test_a_pattern_is_exported_beside_the_metrics_of_another_program(tmp_path: Path):
    run(tmp_path, formats=("json",))
    (tmp_path / "out" / "metrics.json").write_text('{"accuracy": 0.9}')
    assert export_patterns(tmp_path / "out", ["svg"])[0] == [tmp_path / "out" / "cap.svg"]
    assert (tmp_path / "out" / "metrics.json").read_text() == '{"accuracy": 0.9}'
