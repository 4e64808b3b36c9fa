"""A function runs in a fork of the process, and its files, result or error are those of the caller."""

from __future__ import annotations

import gc
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import warpflat
from warpflat.core.activity import activity_listener
from warpflat.core.errors import InputError
from warpflat.core.input_files import note_read
from warpflat.pattern.files.beside import Beside, two_at_a_time, work_beside
from warpflat.pattern.files.output import atomic_path, output_folder


@pytest.fixture(autouse=True)
def two_cores(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("WARPFLAT_THREADS", "2")
    if sys.platform != "linux":
        pytest.skip("processes are forked on Linux only")


def write(folder: Path, name: str) -> int:
    with atomic_path(folder / name) as temporary:
        temporary.write_text(name)
    return os.getpid()


def test_files_of_another_process_appear_with_those_of_the_run(tmp_path: Path):
    out = tmp_path / "out"
    with work_beside(), output_folder(out), Beside(lambda: write(out, "a.txt")) as work:
        assert write(out, "b.txt") == os.getpid()
        assert work.result() != os.getpid()
        assert not (out / "a.txt").exists()
    assert sorted(path.name for path in out.iterdir()) == ["a.txt", "b.txt"]


def test_items_are_done_two_at_a_time_and_come_in_their_order():
    with work_beside():
        found = list(two_at_a_time(lambda item: (item, os.getpid()), range(5)))
    assert [item for item, _ in found] == [0, 1, 2, 3, 4]
    assert [process == os.getpid() for _, process in found] == [True, False, True, False, True]
    assert [process for _, process in two_at_a_time(lambda item: (item, os.getpid()), range(3))] == [os.getpid()] * 3


def test_a_flattened_piece_comes_back_from_another_process():
    surface = warpflat.make_shape("dome", resolution=9)
    with work_beside(), Beside(lambda: warpflat.flatten(surface)) as work:
        there = work.result()
        assert work.process != os.getpid()
    here = warpflat.flatten(surface)
    np.testing.assert_array_equal(there.positions, here.positions)
    assert there.fit.outside == here.fit.outside


def test_only_a_program_has_other_processes(monkeypatch: pytest.MonkeyPatch):
    with Beside(os.getpid) as work:
        assert work.result() == os.getpid()
    monkeypatch.setenv("WARPFLAT_THREADS", "1")
    with work_beside(), Beside(os.getpid) as work:
        assert work.result() == os.getpid()


def test_an_error_is_raised_where_the_result_is_asked_for(tmp_path: Path):
    def fail() -> None:
        raise InputError("the disk is full")

    def run() -> None:
        with work_beside(), output_folder(out), Beside(fail) as work:
            write(out, "b.txt")
            work.result()

    out = tmp_path / "out"
    with pytest.raises(InputError, match=r"^the disk is full$"):
        run()
    assert not out.exists()


def test_a_function_whose_process_dies_runs_again():
    own = os.getpid()

    def die() -> str:
        if os.getpid() != own:
            os.kill(os.getpid(), signal.SIGKILL)
        return "done"

    with work_beside(), Beside(die) as work:
        assert work.result() == "done"


def test_what_the_caller_has_dropped_is_not_collected_by_another_process():
    """Its end may wait for a thread of the caller, as that of a Dask client does."""
    collected = list[int]()

    class Dropped:
        def __init__(self) -> None:
            self.itself = self

        def __del__(self) -> None:
            collected.append(os.getpid())

    def collect() -> list[int]:
        gc.collect()
        return collected

    gc.disable()
    try:
        Dropped()
        with work_beside(), Beside(collect) as work:
            assert work.result() == []
    finally:
        gc.enable()
    assert collect() == [os.getpid()]


def test_a_process_ends_with_its_block():
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt), work_beside(), Beside(lambda: time.sleep(60)) as work:
        raise KeyboardInterrupt
    assert time.monotonic() - begun < 30
    with pytest.raises(ProcessLookupError):
        os.kill(work.process, 0)


def test_a_result_larger_than_a_pipe_arrives_and_the_wait_is_reported():
    heard: list[str] = []
    with activity_listener(heard.append), work_beside(), Beside(lambda: b"x" * 1_000_000, "writing") as work:
        assert len(work.result()) == 1_000_000
    assert heard == ["writing"]


def test_a_process_dies_with_its_parent(tmp_path: Path):
    begun = tmp_path / "begun"

    def wait() -> None:
        begun.write_text(str(os.getpid()))
        time.sleep(60)

    child = os.fork()
    if child == 0:
        with work_beside(), Beside(wait):
            time.sleep(60)
        os._exit(0)
    deadline = time.monotonic() + 30
    while not (begun.exists() and begun.read_text()) and time.monotonic() < deadline:
        time.sleep(0.01)
    process = Path("/proc") / begun.read_text()
    assert process.exists()
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    while process.exists() and "Z" not in (process / "stat").read_text().split()[2] and time.monotonic() < deadline:
        time.sleep(0.01)
    assert time.monotonic() < deadline


def test_what_another_process_reads_the_run_has_read(tmp_path: Path):
    def run() -> None:
        with work_beside(), output_folder(tmp_path / "out"), Beside(lambda: note_read(own)) as work:
            work.result()
            write(tmp_path / "out", "mine.obj")

    own = tmp_path / "out" / "mine.obj"
    own.parent.mkdir()
    own.write_text("mine")
    with pytest.raises(InputError, match="is read by this run"):
        run()
    assert own.read_text() == "mine"
