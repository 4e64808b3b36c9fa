"""One task of a batch is run, and its result is kept: a folder like a run's, or an error."""

from __future__ import annotations

import json
import os
import platform
import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from warpflat.batch.plan import Task
from warpflat.core.atomic_files import output_folder
from warpflat.core.errors import InputError
from warpflat.core.hidden_files import remove_unfinished
from warpflat.core.json_file import write_json
from warpflat.core.text import one_line

__all__ = [
    "ERROR",
    "NOT_AT_REST",
    "SET_ASIDE",
    "TO_DO",
    "Row",
    "error_file",
    "forget_starts",
    "has_killed",
    "read_row",
    "run_task",
    "set_aside",
]

TO_DO, AT_REST, NOT_AT_REST, ERROR, SET_ASIDE = "to do", "at rest", "not at rest", "error", "set aside"

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
    done = read_row(task, out)
    if done is not None:
        return done
    if has_killed(task, out):
        return set_aside(task, out)
    _note_start(task, out)
    try:
        return _run(task, out)
    finally:
        forget_starts(task, out)


def _run(task: Task, out: Path) -> Row:
    from warpflat.scene.run import run_scene

    begin, folder = time.perf_counter(), out / task.key
    try:
        with output_folder(folder, ["task.json"]):
            run_scene(task.make_scene(), folder)
            own = {"scene": task.data, "seconds": time.perf_counter() - begin, "memory_mb": _peak_memory()}
            write_json(folder / "task.json", {**_names(task), **own})
    except InputError as error:
        _write_error(task, out, ERROR, str(error))
    except Exception as error:  # a fault of the program in one task does not end the others
        _write_error(task, out, ERROR, f"{type(error).__name__}: {error}", traceback.format_exc())
    return read_row(task, out) or Row(task=task)


def has_killed(task: Task, out: Path) -> bool:
    """Return whether a task has killed its process as often as is allowed."""
    try:
        return len(_started(task, out).read_text(encoding="utf-8").splitlines()) >= _MOST_KILLS
    except OSError:
        return False


def forget_starts(task: Task, out: Path) -> None:
    """Begin the count of a task's kills anew: it has ended, or was stopped on purpose."""
    _started(task, out).unlink(missing_ok=True)


def _started(task: Task, out: Path) -> Path:
    return out / f"{task.key}.started"


def _note_start(task: Task, out: Path) -> None:
    try:
        with _started(task, out).open("a", encoding="utf-8") as file:
            file.write(f"{platform.node()} {os.getpid()}\n")
    except OSError as error:
        raise InputError(f"{_started(task, out)} cannot be written ({error.strerror})") from None


def set_aside(task: Task, out: Path) -> Row:
    """Record that a task is not tried again, since it has killed its process too often; return its row.

    Raises:
        InputError: that cannot be written.
    """
    folder = out / task.key
    if folder.is_dir():
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
    try:
        metrics = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
        own = json.loads((folder / "task.json").read_text(encoding="utf-8"))
        return _row_of_run(task, metrics, own, frozenset(os.listdir(folder)))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        pass
    try:
        error = json.loads(error_file(task, out).read_text(encoding="utf-8"))
        return Row(task=task, status=str(error["status"]), message=str(error["message"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _row_of_run(task: Task, metrics: Mapping[str, Any], own: Mapping[str, Any], files: frozenset[str]) -> Row:
    pieces = list(metrics["pieces"].values())
    wear = metrics.get("wear") or pieces[0].get("wear") or {}
    return Row(
        task=task,
        status=AT_REST if _is_at_rest(metrics) else NOT_AT_REST,
        strain_energy_j=sum(piece["strain_energy_j"] for piece in pieces),
        fits=metrics.get("drape", wear).get("fits"),
        girths_m={level: girth["pattern_m"] for level, girth in metrics.get("girths", {}).items()},
        seconds=own["seconds"],
        memory_mb=own["memory_mb"],
        files=files,
    )


def _is_at_rest(metrics: Mapping[str, Any]) -> bool:
    """Return whether all is well with every piece, the seams and the drape, in every size."""
    return (
        all(
            piece["converged"] and not piece["flipped_faces"] and not piece.get("overlap_m2")
            for piece in metrics["pieces"].values()
        )
        and metrics.get("sewing", {}).get("converged", True)
        and metrics.get("drape", {}).get("converged", True)
        and all(_is_at_rest(other) for other in metrics.get("sizes", {}).values())
    )


def _write_error(task: Task, out: Path, status: str, message: str, trace: str = "") -> None:
    more = {"traceback": trace} if trace else {}
    write_json(
        error_file(task, out),
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
