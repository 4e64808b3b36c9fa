"""The manifest of a folder's outputs, by which stale files of earlier runs are removed.

`metrics.json` lists under `files`, by the name of the run, what each has written, with its SHA-256. Nothing else is ever removed,
and of that only what is still as it was written, so that a file which somebody has drawn on, or put there under that name, stays.
Other reports, such as `compare.json`, list the files beside them in the same way (see `warpflat.core.own_files`).
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warpflat.core.atomic_files import is_input, latest_file, note_amended, notes_kept, remove_file
from warpflat.core.errors import InputError
from warpflat.core.json_file import plain_json, write_json
from warpflat.core.own_files import NotOursError, file_digest, has_seal, read_result, recorded_files, seal_of

__all__ = ["record_file", "remove_stale", "require_own_metrics", "write_metrics", "write_report", "write_sealed"]

#: Files that bear no name: in a folder with several runs they are taken to be the last one's.
_NAMELESS = (
    "frames.usdc", "picture.png", "wear.png", "drape.png", "drape.webp", "corrected.png", "walked.png", "pattern.pdf", "pattern.json",
    "review.html", "film.webp", "contact_sheet.png",
)  # fmt: skip


def write_sealed(path: Path, data: Mapping[str, Any]) -> dict[str, Any]:
    """Write a file in JSON with its seal, by which it is known to be of warpflat, and return its content.

    Raises:
        InputError: it cannot be written.
    """
    plain: dict[str, Any] = plain_json(data)
    plain.pop("sha256", None)
    complete = {**plain, "sha256": seal_of(plain)}
    write_json(path, complete)
    return complete


def write_report(path: Path, data: Mapping[str, Any], *, name: str, files: Sequence[str]) -> None:
    """Write a report that lists files beside it, and those that it listed before.

    Args:
        path: of the report.
        data: all of it but `files`.
        name: of the run that has written the files.
        files: by name.

    Raises:
        InputError: it cannot be written.
    """
    before = latest_file(path)
    record = recorded_files(read_result(before)) if before.exists() else {}
    mine = {file: file_digest(latest_file(path.parent / file)) for file in files if file != path.name}
    others = {run: {file: was for file, was in known.items() if file not in mine} for run, known in record.items()}
    others[name] = {**others.get(name, {}), **mine}
    write_sealed(path, {**data, "files": {run: known for run, known in others.items() if known}})


def write_metrics(folder: Path, metrics: Mapping[str, Any], *, name: str, files: Sequence[str]) -> None:
    """Write `metrics.json` with the files of a result that is saved by hand, and keep the manifest of the one before.

    Raises:
        InputError: it cannot be written.
    """
    require_own_metrics(folder)
    write_report(folder / "metrics.json", {**metrics, **_noted(folder)}, name=name, files=files)


def remove_stale(
    folder: Path,
    metrics: Mapping[str, Any],
    *,
    name: str,
    files: Sequence[str],
    drape: bool = False,
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Write `metrics.json` at the end of a run, and remove files of earlier runs that could be taken for its own.

    That is what a run of the same name has written and this one has not, and of other runs those files that bear no name,
    such as `pattern.json`; never a file from which this run was made. In an
    :func:`warpflat.core.atomic_files.output_folder` they go when the new files are there.

    Args:
        folder: in which the run has written all else.
        metrics: all of `metrics.json` but `files`.
        name: of the run.
        files: that it has written, by name.
        drape: whether garments are draped, of which earlier ones are removed, and nothing else.

    Returns:
        What `metrics.json` holds, and what was left out, removed or left, one sentence each.

    Raises:
        InputError: `metrics.json` cannot be written.
    """
    record = recorded_files(_read(folder))
    mine = {file: file_digest(latest_file(folder / file)) for file in files if file != "metrics.json"}
    earlier = {run: {file: was for file, was in known.items() if file not in mine} for run, known in record.items()}
    stale = {
        (run, file): was
        for run, known in earlier.items()
        for file, was in known.items()
        if (file.endswith(".draped.obj") and run == name if drape else run == name or file in _NAMELESS)
    }
    earlier[name] = {**mine, **earlier.get(name, {})}
    removed, notes = [], []
    for (run, file), was in stale.items():
        if reason := _take_away(folder / file, was):
            notes.append(f"{file} was not made by this run, and stays: {reason}")
        else:
            removed.append(file)
            del earlier[run][file]
    if removed:
        notes.insert(0, f"removed what an earlier run had left and this one did not make: {', '.join(removed)}")
    record = {run: known for run, known in earlier.items() if known}
    complete = write_sealed(folder / "metrics.json", {**metrics, **_noted(folder), "files": record})
    return complete, (*notes_kept(folder), *notes)


def _noted(folder: Path) -> dict[str, list[str]]:
    """Return the entry of `metrics.json` for files that the run into a folder has left out; empty where there are none."""
    notes = list(notes_kept(folder))
    return {"notes": notes} if notes else {}


def record_file(folder: Path, name: str, file: str) -> None:
    """Add a file to the manifest of a run in `metrics.json`, if there is such a run.

    Raises:
        InputError: `metrics.json` cannot be written.
    """
    try:
        metrics = _read(folder)
    except InputError:
        return  # somebody else's, which knows of no run
    record = recorded_files(metrics)
    if name in record:
        record[name][file] = file_digest(latest_file(folder / file))
        # What the user has changed in it stays, and is known to be the user's by the seal that does not fit.
        note_amended(folder / "metrics.json")
        write = write_sealed if has_seal(metrics) else write_json
        write(folder / "metrics.json", {**metrics, "files": record})


def _take_away(path: Path, was: str) -> str:
    """Remove a file that is still as a run wrote it; return why it stays, or nothing if it is gone."""
    if is_input(path):
        return "this run was made from it"
    if path.is_symlink() or (path.exists() and not path.is_file()):
        return "it is not as an earlier run left it"
    try:
        if path.exists() and file_digest(path) != was:
            return "it is not as an earlier run left it"
        remove_file(path)
    except OSError as error:
        return f"it cannot be removed ({(error.strerror or str(error)).lower()})"
    return ""


def require_own_metrics(folder: Path) -> None:
    """Check that the `metrics.json` of a folder is of warpflat, since a run replaces it.

    Raises:
        InputError: it is something else by that name.
    """
    _read(folder)


def _read(folder: Path) -> dict[str, Any]:
    """Return the content of a folder's `metrics.json`, which is empty if there is none.

    Raises:
        InputError: it is something else by that name.
    """
    file = folder / "metrics.json"
    latest = latest_file(file)
    if not os.path.lexists(latest):
        return {}
    try:
        data = read_result(latest)
    except InputError:
        data = None
    if not isinstance(data, dict) or "warpflat" not in data:
        raise NotOursError(
            f"{file}: is not of warpflat, and a run would replace it; move it away, or choose another folder"
        )
    return data
