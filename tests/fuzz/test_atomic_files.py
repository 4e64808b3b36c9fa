from __future__ import annotations

import json
import os
import stat
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from export_meshes import dome

import warpflat
from warpflat.core.errors import InputError
from warpflat.pattern.export.obj import write_obj
from warpflat.pattern.export.picture import PicturePiece, write_picture
from warpflat.pattern.export.usd import FrameWriter
from warpflat.pattern.files.output import atomic_path, output_folder, prepare_folder, write_json


def test_file_appears_whole_and_nothing_else(tmp_path: Path) -> None:
    final = tmp_path / "a.txt"
    final.write_text("before")
    with atomic_path(final) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".txt"
        assert temporary.name.startswith(".")
        temporary.write_text("after")
        assert final.read_text() == "before"
    assert final.read_text() == "after"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_failure_leaves_what_was_there(tmp_path: Path) -> None:
    final = tmp_path / "a.txt"
    final.write_text("before")

    def fail() -> None:
        with atomic_path(final) as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert final.read_text() == "before"
    assert os.listdir(tmp_path) == ["a.txt"]


KILLED = """
import os, signal, sys
from warpflat.pattern.files.output import atomic_path
with atomic_path(sys.argv[1]) as temporary:
    temporary.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(os.name != "posix", reason="other systems tell nothing of a process by its number")
def test_what_a_killed_run_has_left_is_removed_and_nothing_else(tmp_path: Path) -> None:
    others = [".notes-0123456789ab.txt", ".warpflat", "a-warpflat-01234567-1-01234567.txt"]
    for name in others:
        (tmp_path / name).touch()
    environment = {**os.environ, "PYTHONPATH": str(Path(warpflat.__file__).parents[1])}
    subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "frames.usdc")], env=environment)
    (left,) = set(os.listdir(tmp_path)) - set(others)
    assert left.startswith(".frames-")
    with atomic_path(tmp_path / "picture.png") as at_work:
        prepare_folder(tmp_path)
        assert set(os.listdir(tmp_path)) == {*others, at_work.name}
    # Another machine's stay for a day, since nobody here can tell whether they are being written.
    elsewhere = tmp_path / left.replace(left.split("-")[-3], "ffffffff")
    elsewhere.touch()
    prepare_folder(tmp_path)
    assert elsewhere.exists()
    os.utime(elsewhere, (0, 0))
    prepare_folder(tmp_path)
    assert set(os.listdir(tmp_path)) == {*others, "picture.png"}


def test_permissions_are_the_users_even_if_the_writer_was_private(tmp_path: Path) -> None:
    (tmp_path / "usual").touch()
    with atomic_path(tmp_path / "a.txt") as temporary:
        temporary.chmod(0o600)
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == stat.S_IMODE((tmp_path / "usual").stat().st_mode)


def _export(kind: str, path: Path) -> None:
    shape = dome(3)
    flat, density = shape.vertices[:, :2], np.ones(4)
    if kind == "json":
        write_json(path, {})
    elif kind == "obj":
        write_obj(path, shape, flat)
    elif kind == "usdc":
        with FrameWriter(path, scale=1.0) as writer:
            writer.add_piece("dome", shape)
            writer.write("dome", positions=flat, face_energy_density=density)
    else:
        piece = PicturePiece(name="dome", surface=shape, faces=shape.faces, positions=flat, face_energy_density=density)
        write_picture(path, [piece])


@pytest.mark.parametrize("kind", ["json", "obj", "usdc", "png"])
def test_every_exporter_refuses_a_place_that_cannot_be_written(tmp_path: Path, kind: str) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / f"folder.{kind}").mkdir()
    for place in (tmp_path / "file" / f"a.{kind}", tmp_path / "missing" / f"a.{kind}", tmp_path / f"folder.{kind}"):
        with pytest.raises(InputError) as failure:
            _export(kind, place)
        assert str(place) in str(failure.value)
        assert "\n" not in str(failure.value)
    assert sorted(os.listdir(tmp_path)) == ["file", f"folder.{kind}"]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write into read-only folders")
def test_read_only_folder_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match="cannot be written"), output_folder(tmp_path):
        pass
    with pytest.raises(InputError, match="cannot write"):
        write_json(tmp_path / "a.json", {})
    tmp_path.chmod(0o700)


@pytest.mark.parametrize("place", ["pathlib.Path.touch", "warpflat.pattern.export.usd.begin_stage"])
def test_a_signal_while_a_film_is_opened_leaves_no_file(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    touch, there = Path.touch, list[str]()

    def interrupted(path: object, **options: bool) -> None:
        if isinstance(path, Path):
            touch(path, **options)
        there.extend(os.listdir(tmp_path))
        raise KeyboardInterrupt

    monkeypatch.setattr(place, interrupted)
    with pytest.raises(KeyboardInterrupt), FrameWriter(tmp_path / "frames.usdc", scale=1.0):
        pass
    assert len(there) == 1
    assert os.listdir(tmp_path) == []


def test_prepare_folder_creates_it_and_leaves_it_empty(tmp_path: Path) -> None:
    assert prepare_folder(tmp_path / "a" / "b") == tmp_path / "a" / "b"
    assert os.listdir(tmp_path / "a" / "b") == []
    prepare_folder(tmp_path / "a" / "b")


def test_an_output_folder_stays_once_there_is_a_file_in_it(tmp_path: Path) -> None:
    with output_folder(tmp_path / "a" / "b"):
        assert (tmp_path / "a" / "b").is_dir()
    assert not (tmp_path / "a").exists()
    with suppress(KeyboardInterrupt), output_folder(tmp_path / "a" / "b") as folder:
        (folder.parent / "kept").write_text("")
        raise KeyboardInterrupt
    assert os.listdir(tmp_path / "a") == ["kept"]
    (tmp_path / "mine").mkdir()
    with output_folder(tmp_path / "mine"):
        pass
    assert (tmp_path / "mine").is_dir()


def test_prepare_folder_refuses_a_file_and_what_lies_below_it(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for place in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match="output folder"):
            prepare_folder(place)


def test_json_keeps_order_and_every_digit(tmp_path: Path) -> None:
    data = {
        "z": np.float64(0.1) + 0.2,
        "a": np.arange(3),
        "ok": np.bool_(True),
        "deep": {"b": (1, np.int32(2)), "c": None, "path": tmp_path, "name": "Ärmel"},
    }
    write_json(tmp_path / "metrics.json", data)
    text = (tmp_path / "metrics.json").read_text(encoding="utf-8")
    back = json.loads(text)
    assert list(back) == ["z", "a", "ok", "deep"]
    assert back["z"] == 0.1 + 0.2
    assert back["a"] == [0, 1, 2]
    assert back["ok"] is True
    assert back["deep"] == {"b": [1, 2], "c": None, "path": str(tmp_path), "name": "Ärmel"}
    assert "Ärmel" in text


def test_json_has_no_nan(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"a": float("nan"), "b": np.array([1.0, np.inf]), "c": np.float32(-np.inf)})
    back = json.loads((tmp_path / "a.json").read_text(), parse_constant=pytest.fail)
    assert back == {"a": None, "b": [1.0, None], "c": None}


def test_json_names_the_place_of_what_it_cannot_write(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match=r"metrics\.pieces\.front\[1\]"):
        write_json(tmp_path / "a.json", {"pieces": {"front": [1, object()]}})
    with pytest.raises(TypeError, match="key 3"):
        write_json(tmp_path / "a.json", {3: 1})  # type: ignore[dict-item]
    assert os.listdir(tmp_path) == []


def test_import_is_lazy() -> None:
    heavy = ("pxr", "matplotlib", "scipy", "trimesh")
    code = f"import sys, warpflat.pattern.export; print([m for m in {heavy!r} if m in sys.modules])"
    found = {**os.environ, "PYTHONPATH": str(Path(warpflat.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=found, check=True)
    assert done.stdout.strip() == "[]"


class OpenElsewhere:
    """`os.replace` as on Windows while a program has a file open, which it closes after some attempts."""

    def __init__(self, name: str, attempts: int) -> None:
        self.name, self.attempts = name, attempts
        self._replace = os.replace

    def __call__(self, source: Path, target: Path) -> None:
        # The hidden folder holds others of this name, which nobody has open.
        if target.name == self.name and not target.parent.name.startswith(("new", "aside")) and self.attempts > 0:
            self.attempts -= 1
            error = PermissionError(13, "Access is denied", str(source))
            error.winerror = 5  # type: ignore[attr-defined, unused-ignore]
            raise error
        self._replace(source, target)


def test_a_file_that_is_open_for_a_moment_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("time.sleep", lambda seconds: None)
    monkeypatch.setattr(os, "replace", OpenElsewhere("a.txt", attempts=3))
    final = tmp_path / "a.txt"
    final.write_text("before")
    with atomic_path(final) as temporary:
        temporary.write_text("after")
    assert final.read_text() == "after"


def test_a_file_that_stays_open_ends_the_run_in_one_line_and_all_files_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("time.sleep", lambda seconds: None)
    names = ("a.txt", "b.txt", "c.txt")
    for name in names:
        (tmp_path / name).write_text("before")
    monkeypatch.setattr(os, "replace", OpenElsewhere("b.txt", attempts=10**9))

    def run() -> None:
        with output_folder(tmp_path, names):
            for name in names:
                with atomic_path(tmp_path / name) as temporary:
                    temporary.write_text("after")

    with pytest.raises(InputError, match=r"b\.txt: it is open in another program") as caught:
        run()
    assert "\n" not in str(caught.value)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == dict.fromkeys(names, "before")
