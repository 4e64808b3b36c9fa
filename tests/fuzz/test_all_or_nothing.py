"""A run that fails or is stopped, wherever, leaves its folder as it was; one that ends well leaves it complete."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest

import warpflat
from warpflat.app.cli.main import main
from warpflat.core.errors import InputError
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.surface.shapes import make_shape
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.output import write_mannequin
from warpflat.pattern.export.piece_files import save_piece
from warpflat.pattern.export.usd import FrameWriter
from warpflat.pattern.files import output
from warpflat.pattern.files.output import atomic_path, output_folder, prepare_folder, remove_file, write_json

# A bodice has four cuts to compare, a dome thirty-one.
SCENE = "[surface]\nshape = 'bodice'\nresolution = 9\n[output]\nframes = 4\n"
CUT = "[lines.across]\nplane = { point = [0, 0, 0], normal = [1, 0, 0] }\n"

Files = dict[str, bytes]


def files(folder: Path) -> Files:
    """All files of a folder, hidden ones too."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def write(folder: Path, *names: str, text: str) -> None:
    for name in names:
        with atomic_path(folder / name) as temporary:
            temporary.write_text(text)


# --- a disk or a limit that is full


@contextmanager
def file_limit(size: int) -> Iterator[None]:
    """As `ulimit -f`: a file that grows beyond so many bytes cannot be written."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


COMMANDS = {
    "run": ("run", "cap.toml", "--out", "out"),
    "flatten": ("flatten", "mesh.obj", "--units", "m", "--name", "cap", "--out", "out"),
    "compare": ("compare", "cap.toml", "--fabric", "denim", "--fabric", "jersey", "--out", "out"),
    "cuts": ("cuts", "cap.toml", "--apply", "1", "--out", "out"),
    "export": ("export", "out", "--format", "svg", "--format", "dxf", "--format", "pdf"),
    "mannequin": ("mannequin", "--size", "EU 38", "--resolution", "40", "--out", "out"),
}


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, int]]:
    """A folder with the results of every command, and the bytes of the largest file that each has written."""
    folder = tmp_path_factory.mktemp("done")
    largest = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("cap.toml").write_text(SCENE + CUT)
        save_piece(flatten(make_shape("dome", resolution=13)), "mesh", picture=False, frames=False)
        Path("mesh/dome.obj").rename("mesh.obj")
        for name, command in COMMANDS.items():
            before = times(folder)
            assert main([*command, "-q"]) == 0, name
            written = {path for path, time in times(folder).items() if before.get(path) != time}
            largest[name] = max(path.stat().st_size for path in written)
    return folder, largest


def times(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("share", [0.0, 0.95])
def test_a_full_disk_leaves_the_folder_as_it_was(
    name: str,
    share: float,
    done: tuple[Path, dict[str, int]],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
):
    folder, largest = done
    monkeypatch.chdir(folder)
    before = files(folder)
    with file_limit(max(int(share * largest[name]), 2000)):  # standard error is a file, too
        code = main([*COMMANDS[name], "-q"])
    told = capfd.readouterr()
    assert (code, told.out, told.err.count("\n")) == (2, "", 1), told
    assert "cannot write out" in told.err
    assert "file too large" in told.err.lower()
    assert files(folder) == before


def test_a_fresh_folder_is_not_there_after_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    Path("cap.toml").write_text(SCENE)
    with file_limit(2000):
        assert main(["run", "cap.toml", "--out", "a/b", "-q"]) == 2
    assert os.listdir() == ["cap.toml"]


def test_saving_is_all_or_nothing(tmp_path: Path):
    result = flatten(make_shape("dome", resolution=9))
    with file_limit(20_000), pytest.raises(InputError, match="cannot write"):
        save_piece(result, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    save_piece(result, tmp_path / "out")
    before = files(tmp_path)
    with file_limit(20_000), pytest.raises(InputError, match="cannot write"):
        save_piece(result, tmp_path / "out")
    with file_limit(20_000), pytest.raises(InputError, match="cannot write"):
        write_mannequin(Mannequin.from_size("EU 38", resolution_mm=40), tmp_path / "out")
    assert files(tmp_path) == before


def test_usd_that_fails_without_a_word_is_found_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from pxr import Usd

    save = Usd.Stage.Save

    def cut_short(stage: Any) -> None:
        save(stage)
        path = stage.GetRootLayer().realPath
        os.truncate(path, os.path.getsize(path) - 100)

    monkeypatch.setattr(Usd.Stage, "Save", cut_short)
    with (
        pytest.raises(InputError, match=r"cannot write .*frames\.usdc"),
        FrameWriter(tmp_path / "frames.usdc", scale=1.0),
    ):
        pass
    assert files(tmp_path) == {}


# --- the moment when the new files are moved in


def _change(folder: Path) -> None:
    with output_folder(folder):
        write(folder, "metrics.json", "a.txt", "b.txt", "new.txt", text="after")
        remove_file(folder / "stale.txt")


BEFORE = dict.fromkeys(("metrics.json", "a.txt", "b.txt", "stale.txt", "users.txt"), b"before")
AFTER = {**dict.fromkeys(("metrics.json", "a.txt", "b.txt", "new.txt"), b"after"), "users.txt": b"before"}


def _small_change(folder: Path) -> None:
    with output_folder(folder):
        write(folder, "a.txt", "new.txt", text="after")
        remove_file(folder / "stale.txt")


AFTER_SMALL = {**BEFORE, "a.txt": b"after", "new.txt": b"after"}
del AFTER_SMALL["stale.txt"]


def _filled(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for path in folder.iterdir():
        path.unlink()
    for name, content in BEFORE.items():
        (folder / name).write_bytes(content)
    return folder


def test_a_change_is_complete(tmp_path: Path):
    _change(_filled(tmp_path))
    assert files(tmp_path) == AFTER
    assert set(os.listdir(tmp_path)) == set(AFTER)


def test_nothing_is_seen_before_the_end(tmp_path: Path):
    with output_folder(_filled(tmp_path)):
        write(tmp_path, "a.txt", "new.txt", text="after")
        remove_file(tmp_path / "stale.txt")
        assert {name: content for name, content in files(tmp_path).items() if name[0] != "."} == BEFORE
        with output_folder(tmp_path / "." / ""):  # the same folder: part of the same change
            write(tmp_path, "b.txt", text="after")
        assert (tmp_path / "b.txt").read_text() == "before"
    assert (tmp_path / "b.txt").read_text() == "after"


@pytest.mark.parametrize("links", [True, False], ids=["links", "no links"])
def test_what_cannot_be_moved_in_is_put_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool):
    if not links:
        monkeypatch.setattr(os, "link", _no_links)
    replace = os.replace
    for number in range(100):
        _filled(tmp_path)
        left = [number]

        def failing(source: Any, target: Any, left: list[int] = left) -> None:
            left[0] -= 1
            if left[0] == -1:
                raise PermissionError(13, "Permission denied", str(target))
            replace(source, target)

        with monkeypatch.context() as patched:
            patched.setattr(os, "replace", failing)
            try:
                _change(tmp_path)
                break
            except InputError as error:
                told = str(error)
        assert "permission denied" in told
        assert files(tmp_path) == BEFORE, number
        assert set(os.listdir(tmp_path)) == set(BEFORE)
    assert number > 8
    assert files(tmp_path) == AFTER


def _no_links(*_: object, **__: object) -> None:
    raise OSError(1, "Operation not permitted")


KILLED = """
import os, signal, sys
from pathlib import Path
from warpflat.pattern.files.output import atomic_path, output_folder, remove_file
folder, number, links = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3] == "True"
replace = os.replace
def fatal(source, target):
    global number
    if number == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    number -= 1
    replace(source, target)
os.replace = fatal
def no_links(*_, **__):
    raise OSError(1, "Operation not permitted")
if not links:
    os.link = no_links
with output_folder(folder):
    for name in ("metrics.json", "a.txt", "b.txt", "new.txt"):
        with atomic_path(folder / name) as temporary:
            temporary.write_text("after")
    remove_file(folder / "stale.txt")
"""


@pytest.mark.skipif(os.name != "posix", reason="other systems tell nothing of a process by its number")
@pytest.mark.parametrize(("number", "links"), [(2, True), (4, True), (6, True), (8, True), (6, False), (9, False)])
def test_the_next_run_puts_back_what_a_killed_one_was_about_to_change(tmp_path: Path, number: int, links: bool):
    _filled(tmp_path)
    found = {**os.environ, "PYTHONPATH": str(Path(warpflat.__file__).parents[1])}
    command = [sys.executable, "-c", KILLED, str(tmp_path), str(number), str(links)]
    assert subprocess.run(command, env=found, check=False).returncode == -9
    prepare_folder(tmp_path)
    assert files(tmp_path) == BEFORE
    assert set(os.listdir(tmp_path)) == set(BEFORE)


def test_a_folder_that_takes_the_place_of_a_file_meanwhile_stays(tmp_path: Path):
    def change() -> None:
        with output_folder(_filled(tmp_path)):
            write(tmp_path, "a.txt", "b.txt", "new.txt", text="after")
            (tmp_path / "new.txt").mkdir()
            (tmp_path / "new.txt" / "mine").write_text("mine")

    with pytest.raises(InputError, match="is a directory"):
        change()
    assert files(tmp_path) == {**BEFORE, os.path.join("new.txt", "mine"): b"mine"}


@pytest.mark.skipif(os.name != "posix", reason="other systems tell nothing of a process by its number")
@pytest.mark.parametrize(
    "listed", ['["../users.txt", "/etc/hostname", "..", 3]', '{"users.txt": 1}', "[" * 100_000, "3"]
)
def test_what_a_hidden_folder_lists_of_other_places_is_left_alone(tmp_path: Path, listed: str):
    out = _filled(tmp_path / "out")
    (tmp_path / "users.txt").write_text("mine")
    left = out / f".run-warpflat-{output._machine()}-4194999-01234567"
    (left / "aside").mkdir(parents=True)
    (left / "fresh.json").write_text(listed)
    prepare_folder(out)
    assert files(tmp_path) == {"users.txt": b"mine", **{os.path.join("out", k): v for k, v in BEFORE.items()}}


# --- an interruption at every line

_WATCHED = ("/files/output.py", "contextlib.py")


def _interrupted(action: Callable[[], None], at: int, watched: tuple[str, ...]) -> bool:
    """Whether the action was interrupted, as by Ctrl-C, before the line of that number among those of the files `watched`."""
    left = [at]

    def at_each_line(frame: FrameType, event: str, _: Any) -> Any:
        if frame.f_code.co_filename.endswith(watched):
            left[0] -= 1
            if left[0] == -1:
                raise KeyboardInterrupt
            return at_each_line
        return None

    before = sys.gettrace()
    sys.settrace(at_each_line)
    try:
        action()
    except KeyboardInterrupt:
        pass
    finally:
        sys.settrace(before)
    return left[0] < 0


def _frames(folder: Path) -> None:
    with FrameWriter(folder / "frames.usdc", scale=1.0) as writer:
        writer.add_piece("dome", make_shape("dome", resolution=5))
        writer.write(
            "dome", positions=make_shape("dome", resolution=5).vertices[:, :2], face_energy_density=np.zeros(16)
        )


@pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnraisableExceptionWarning"
)  # interrupted while a generator is closed
@pytest.mark.parametrize(
    ("action", "watched", "step"),
    [(_small_change, _WATCHED, 3), (_frames, (*_WATCHED, "/usd.py"), 23)],
    ids=["folder", "frames"],
)
def test_an_interruption_anywhere_leaves_nothing_behind(
    tmp_path: Path, action: Callable[[Path], None], watched: tuple[str, ...], step: int
):
    action(_filled(tmp_path / "first"))  # what it imports, it has imported
    gc.collect()
    gc.freeze()  # what there is already need not be looked through each time
    out = tmp_path / "made" / "out"
    for number in range(0, 100_000, step):
        if not _interrupted(lambda: action(_filled(out)), number, watched):
            break
        gc.collect()
        output._clear_all()  # as at the end of the process
        left = files(out)
        assert left in (BEFORE, AFTER_SMALL) or set(left) == {*BEFORE, "frames.usdc"}, number
        assert set(os.listdir(out)) == set(left), number
        assert not output._unfinished
    assert number > 100
    # A folder that was made for it goes, too.
    fresh = tmp_path / "other" / "out"
    for number in range(0, 200, 5):
        if _interrupted(lambda: _change_fresh(fresh), number, _WATCHED):
            gc.collect()
            output._clear_all()
            assert not (tmp_path / "other").exists(), number


def _change_fresh(folder: Path) -> None:
    with output_folder(folder):
        write_json(folder / "a.json", {})
        raise KeyboardInterrupt


# --- output folders that cannot be


@pytest.mark.parametrize(
    ("folder", "said"),
    [
        ("a" * 300, "name too long"),
        ("new/" + "a" * 300, "name too long"),
        ("a\udcff", r"'a\udcff' has bytes in its name"),
    ],
    ids=["300 letters", "300 letters below", "bytes"],
)
@pytest.mark.parametrize("command", ["run", "compare", "cuts", "mannequin", "export"])
def test_a_folder_that_no_system_can_make_is_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    folder: str,
    said: str,
    command: str,
):
    monkeypatch.chdir(tmp_path)
    Path("cap.toml").write_text(SCENE)
    arguments = ["export", folder, "--format", "svg"] if command == "export" else [*COMMANDS[command][:-1], folder]
    assert main(arguments) == 2
    told = capfd.readouterr()
    assert (told.out, told.err.count("\n")) == ("", 1)
    assert said in told.err.lower() or command == "export"
    assert len(told.err) < 1000
    assert os.listdir() == ["cap.toml"]


def test_a_temporary_file_that_cannot_be_written_is_not_blamed_on_standard_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    def full() -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.chdir(tmp_path)
    Path("cap.toml").write_text(SCENE)
    monkeypatch.setattr("warpflat.app.cli.run.start_warp_silently", full)
    assert main(["run", "cap.toml"]) == 2
    assert capfd.readouterr().err == "warpflat: cannot read or write a temporary file: no space left on device\n"
