"""The manifest of a folder's outputs, by which stale files of earlier runs are removed.

`metrics.json` lists under `files`, by the name of the run, what each has written, with its SHA-256. Nothing else is ever removed,
and of that only what is still as it was written, so that a file which somebody has drawn on, or put there under that name, stays.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warpflat.core.atomic_files import is_input, latest_file, remove_file
from warpflat.core.errors import InputError
from warpflat.core.json_file import read_json, write_json

__all__ = ["record_file", "remove_stale", "require_own_metrics", "write_metrics"]

Record = dict[str, dict[str, str]]

#: Files that bear no name: in a folder with several runs they are taken to be the last one's.
_NAMELESS = (
    "frames.usdc", "picture.png", "wear.png", "drape.png", "drape.webp", "corrected.png", "walked.png", "pattern.pdf", "pattern.json",
    "review.html", "film.webp", "contact_sheet.png",
)  # fmt: skip


def write_metrics(folder: Path, metrics: Mapping[str, Any]) -> None:
    """Write `metrics.json` and keep the manifest of the one before.

    Raises:
        InputError: it cannot be written.
    """
    record = _record(_read(folder))
    write_json(folder / "metrics.json", {**metrics, **({"files": record} if record else {})})


def remove_stale(
    folder: Path, metrics: Mapping[str, Any], *, name: str, files: Sequence[str]
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

    Returns:
        What `metrics.json` holds, and what was removed or left, one sentence each.

    Raises:
        InputError: `metrics.json` cannot be written.
    """
    record = _record(_read(folder))
    mine = {file: _digest(latest_file(folder / file)) for file in files if file != "metrics.json"}
    earlier = {run: {file: was for file, was in known.items() if file not in mine} for run, known in record.items()}
    stale = {
        (run, file): was
        for run, known in earlier.items()
        for file, was in known.items()
        if run == name or file in _NAMELESS
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
    complete = {**metrics, "files": {run: known for run, known in earlier.items() if known}}
    write_json(folder / "metrics.json", complete)
    return complete, tuple(notes)


def record_file(folder: Path, name: str, file: str) -> None:
    """Add a file to the manifest of a run in `metrics.json`, if there is such a run.

    Raises:
        InputError: `metrics.json` cannot be written.
    """
    try:
        metrics = _read(folder)
    except InputError:
        return  # somebody else's, which knows of no run
    record = _record(metrics)
    if name in record:
        record[name][file] = _digest(latest_file(folder / file))
        write_json(folder / "metrics.json", {**metrics, "files": record})


def _take_away(path: Path, was: str) -> str:
    """Remove a file that is still as a run wrote it; return why it stays, or nothing if it is gone."""
    if is_input(path):
        return "this run was made from it"
    if path.is_symlink() or (path.exists() and not path.is_file()):
        return "it is not as an earlier run left it"
    try:
        if path.exists() and _digest(path) != was:
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
    if not latest.exists():
        return {}
    try:
        data = read_json(latest, noted=False)
    except InputError:
        data = None
    if not isinstance(data, dict) or "warpflat" not in data:
        raise InputError(
            f"{file}: is not of warpflat, and a run would replace it; move it away, or choose another folder"
        )
    return data


def _record(metrics: Mapping[str, Any]) -> Record:
    """Return the listed files by run; names with a folder in them are left out, since no run writes such."""
    listed = metrics.get("files")
    if not isinstance(listed, dict):
        return {}
    return {
        run: {file: was for file, was in known.items() if isinstance(was, str) and _is_plain(file)}
        for run, known in listed.items()
        if isinstance(known, dict)
    }


def _is_plain(file: str) -> bool:
    return bool(file) and Path(file).name == file and file not in ("..", "metrics.json")


def _digest(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()
