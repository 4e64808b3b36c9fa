"""One task of a batch is run, and its result is kept: a folder like a run's, or an error."""

from __future__ import annotations

import os
import platform
import re
import stat
import time
import traceback
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from warpflat.app.batch.plan import Task
from warpflat.app.review.faults import is_done
from warpflat.core import InputError, is_number, one_line, open_file, read_result
from warpflat.pattern import NotOursError, output_folder, refuse_to_replace_others, remove_unfinished, write_sealed

__all__ = [
    "DONE",
    "ERROR",
    "SET_ASIDE",
    "TO_DO",
    "WITH_FAULTS",
    "Row",
    "error_file",
    "forget_starts",
    "has_killed",
    "read_row",
    "run_task",
    "set_aside",
]

TO_DO, DONE, WITH_FAULTS, ERROR, SET_ASIDE = "to do", "done", "with faults", "error", "set aside"

# A task is set aside when it has killed its process so many times.
_MOST_KILLS = 3


@dataclass(frozen=True, kw_only=True)
class Row:
    """The row of a task in the index.

    Attributes:
        task: the task.
        status: one of the words above.
        strain_energy_j: of all pieces [J].
        fits: whether the cloth is within its limits; None if unknown.
        girths_m: of the pattern by level [m].
        seconds: wall time of the run [s].
        memory_mb: peak memory of its process until then [MB].
        message: the error.
        files: of the run, by name.
    """

    task: Task
    status: str = TO_DO
    strain_energy_j: float | None = None
    fits: bool | None = None
    girths_m: Mapping[str, float] = field(default_factory=dict)
    seconds: float | None = None
    memory_mb: float | None = None
    message: str = ""
    files: frozenset[str] = frozenset()


def run_task(task: Task, out: Path) -> Row:
    """Run a task unless its result is there; whatever error its scene meets is a result too.

    The files of the run lie in `out`/KEY, with `task.json`: what the task was and how long it took. They appear together or not at all.
    Each start is a line in `out`/KEY.started, which is removed at the end: lines that stay tell how often the task has killed its process.

    Raises:
        InputError: the result cannot be written.
    """
    try:
        if (out / task.key).is_symlink():
            raise NotOursError(f"{out / task.key}: is a link, and would be written into; move it away")
        done = read_row(task, out)
        if done is not None:
            return done
        if has_killed(task, out):
            return set_aside(task, out)
        # Whatever has the name of the count of starts by now is not followed, nor waited for.
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
        try:
            with os.fdopen(os.open(_started(task, out), flags, 0o666), "ab") as file:
                if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                    file.write(f"{platform.node() or 'here'} {os.getpid()}\n".encode())
        except OSError as error:
            raise InputError(f"{_started(task, out)} cannot be written ({error.strerror})") from None
        try:
            from warpflat.app.scene.run import run_scene

            begin, folder = time.perf_counter(), out / task.key
            try:
                with output_folder(folder, ["task.json"], guard=True):
                    run_scene(task.make_scene(), folder)
                    spent = {"seconds": time.perf_counter() - begin, "memory_mb": _peak_memory()}
                    write_sealed(folder / "task.json", {**_names(task), "scene": task.data, **spent})
            except NotOursError as error:
                raise NotOursError(f"{error}; the task is tried again once all of {folder} is moved away") from error
            except InputError as error:
                _write_error(task, out, ERROR, str(error))
            except Exception as error:  # a fault of the program in one task does not end the others
                _write_error(task, out, ERROR, f"{type(error).__name__}: {error}", traceback.format_exc())
            return read_row(task, out) or Row(task=task)
        finally:
            forget_starts(task, out)
    except NotOursError as error:  # once that is moved away, the task is tried again
        return Row(task=task, status=ERROR, message=str(error))


def has_killed(task: Task, out: Path) -> bool:
    """Return whether a task has killed its process as often as is allowed."""
    return len(_starts(task, out)) >= _MOST_KILLS


def forget_starts(task: Task, out: Path) -> None:
    """Begin the count of a task's kills anew: it has ended, or was stopped on purpose."""
    with suppress(NotOursError):
        if _starts(task, out):
            _started(task, out).unlink(missing_ok=True)


def _starts(task: Task, out: Path) -> list[str]:
    """Return the lines that the starts of a task have left.

    Raises:
        NotOursError: something else bears the name of their file.
    """
    path = _started(task, out)
    if not os.path.lexists(path):
        return []
    try:
        with open_file(path, most=1_000_000) as stream:
            lines = stream.read().decode(errors="replace").splitlines()
    except InputError:
        lines = [""]
    if not lines or not all(re.fullmatch(r"\S+ \d+", line) for line in lines):
        raise NotOursError(f"{path}: is not of warpflat, and would be written into; move it away")
    return lines


def _started(task: Task, out: Path) -> Path:
    return out / f"{task.key}.started"


def set_aside(task: Task, out: Path) -> Row:
    """Record that a task is not tried again, since it has killed its process too often; return its row.

    Raises:
        InputError: that cannot be written.
    """
    folder = out / task.key
    if folder.is_dir() and not folder.is_symlink():
        remove_unfinished(folder)
        if not any(folder.iterdir()):
            folder.rmdir()
    if read_row(task, out) is None:
        reason = f"its process was killed {_MOST_KILLS} times, perhaps for want of memory"
        _write_error(task, out, SET_ASIDE, reason)
    forget_starts(task, out)
    return read_row(task, out) or Row(task=task)


def error_file(task: Task, out: Path) -> Path:
    """Return the path of a task's error."""
    return out / f"{task.key}.error.json"


def read_row(task: Task, out: Path) -> Row | None:
    """Return the row of a task that is done, or None; a result that cannot be read counts as none."""
    folder = out / task.key
    if folder.is_symlink():
        return None
    with suppress(Exception):  # others may have changed it in any way
        metrics, record = read_result(folder / "metrics.json"), read_result(folder / "task.json")
        pieces = list(metrics["pieces"].values())
        verdict = metrics.get("verdict")
        if not pieces or (verdict is None and any(piece.get("wear") for piece in pieces)):
            raise ValueError("no pieces, or no verdict on them")
        fits = None if verdict is None else verdict["fits"]
        if fits not in (None, True, False):
            raise ValueError(fits)
        return Row(
            task=task,
            status=DONE if is_done(metrics) else WITH_FAULTS,
            strain_energy_j=sum(_number(piece["strain_energy_j"]) for piece in pieces),
            fits=fits,
            girths_m={
                one_line(level): _number(girth["pattern_m"]) for level, girth in metrics.get("girths", {}).items()
            },
            seconds=_number(record["seconds"]),
            memory_mb=None if record["memory_mb"] is None else _number(record["memory_mb"]),
            files=frozenset(os.listdir(folder)),
        )
    with suppress(Exception):
        error = read_result(error_file(task, out))
        if error["status"] in (ERROR, SET_ASIDE):
            return Row(task=task, status=error["status"], message=one_line(error["message"]) or "without a word")
    return None


def _number(value: Any) -> float:
    if not (is_number(value) and abs(number := float(value)) < float("inf")):
        raise ValueError(value)
    return number


def _write_error(task: Task, out: Path, status: str, message: str, trace: str = "") -> None:
    more = {"traceback": trace} if trace else {}
    file = error_file(task, out)
    refuse_to_replace_others(out, [file.name])
    write_sealed(
        file,
        {**_names(task), "status": status, "message": one_line(message), **more, "scene": task.data},
    )


def _names(task: Task) -> dict[str, str]:
    return {
        "key": task.key,
        "name": task.scene,
        "body": task.body,
        "fabric": task.fabric,
        "override": task.override,
    }


def _peak_memory() -> float | None:
    try:
        import resource
    except ImportError:  # on Windows
        return None
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
