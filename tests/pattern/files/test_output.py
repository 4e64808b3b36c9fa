"""Steps that cannot be taken are left out and named; what a killed run has left is swept."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from warpflat.app.cli.environment import require_environment
from warpflat.core.errors import CannotWriteError, InputError, StepError
from warpflat.pattern.files.left_out import LeftOut, listening_to_left_out
from warpflat.pattern.files.output import atomic_path, optional_step, output_folder, write_report


def test_a_step_that_cannot_be_taken_is_a_note_and_the_run_goes_on(tmp_path: Path):
    heard = list[LeftOut]()
    with listening_to_left_out(heard.append), output_folder(tmp_path / "out") as folder:
        with optional_step("the pieces were not sewn") as unsewn:
            raise StepError("they are crushed")
        with optional_step("no picture", is_needed=False) as undrawn:
            raise KeyError("gone")
        with optional_step("all went well") as well:
            pass
        write_report(folder / "metrics.json", {}, name="a", files=[])
    assert (unsewn, undrawn, well) == (
        ["the pieces were not sewn: they are crushed"],
        ["no picture: KeyError: 'gone'"],
        [],
    )
    assert [(step.folder, step.is_needed) for step in heard] == [(folder, True), (folder, False)]
    told = json.loads((folder / "metrics.json").read_text())
    assert (told["notes"], told["left_out"]) == ([*unsewn, *undrawn], unsewn)


@pytest.mark.parametrize("error", [InputError("no such line"), CannotWriteError("the disk is full")])
def test_what_the_user_must_see_to_ends_the_run(error: InputError):
    with pytest.raises(type(error), match=str(error)), optional_step("the pieces were not sewn", of=StepError):
        raise error
    with pytest.raises(MemoryError), optional_step("the pieces were not sewn"):
        raise MemoryError


def test_what_a_killed_run_has_left_beside_a_folder_is_swept(tmp_path: Path):
    with output_folder(tmp_path / "first") as folder, atomic_path(folder / "a.txt") as path:
        path.write_text("a")
        (hidden,) = folder.glob(".run-*")
        machine = hidden.name.split("-")[2]
    gone = next(number for number in range(2**22 - 1, 0, -1) if not Path(f"/proc/{number}").exists())
    stale = folder / f".run-warpflat-{machine}-{gone}-01234567"
    running = folder / f".run-warpflat-{machine}-{os.getppid()}-01234567"
    (stale / "new").mkdir(parents=True)
    running.mkdir()
    with output_folder(tmp_path / "second"):
        pass
    assert sorted(path.name for path in folder.iterdir()) == [running.name, "a.txt"]


@pytest.mark.parametrize("limit", ["x", "1e9", "99999999999", " 2"])
def test_a_variable_that_makes_a_library_abort_is_refused(monkeypatch: pytest.MonkeyPatch, limit: str):
    monkeypatch.setenv("PXR_WORK_THREAD_LIMIT", limit)
    with pytest.raises(InputError, match=r"PXR_WORK_THREAD_LIMIT.*whole number"):
        require_environment()


def test_a_stack_too_small_for_the_libraries_is_refused(monkeypatch: pytest.MonkeyPatch):
    resource = pytest.importorskip("resource")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (256 * 1024, 256 * 1024))
    with pytest.raises(InputError, match=r"limited to 256 kB; 1024 are needed: ulimit -s 1024"):
        require_environment()
