"""Files that warpflat has written into a folder, known by digest; every other file there is the user's, and is never replaced.

The commands leave reports in JSON. Each lists the files beside it under `files`, by run and name, with their SHA-256, and has under
`sha256` a seal: the digest of its own content. What was read from such a folder is a regular file: links, pipes and devices are refused.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from warpflat.core.errors import CannotWriteError, InputError

__all__ = [
    "NotOursError",
    "file_digest",
    "has_seal",
    "open_result",
    "read_result",
    "recorded_files",
    "refuse_to_replace_others",
    "seal_of",
]

#: The reports that list files, of a run, a comparison, a ledger of cuts, an edited dart, and a batch.
_REPORTS = "metrics.json", "compare.json", "ledger.json", "edit.json", "batch.json"
#: The largest file in JSON that is read [bytes].
_MOST_JSON = 200_000_000
# Equal runs have equal seals: what they took is not part of it.
_TIMES = "seconds", "memory_mb"


class NotOursError(CannotWriteError):
    """A file stands where warpflat would write, and is not as warpflat has written it."""


def open_result(path: Path, *, most: int = 4_000_000_000) -> BinaryIO:
    """Open a file of a folder of results, which no link, pipe or device may stand for.

    Raises:
        InputError: it is missing, no regular file, of more than `most` bytes, or cannot be read.
    """
    try:
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        if stat.S_ISREG(path.lstat().st_mode):
            stream = os.fdopen(os.open(path, flags), "rb")
            if stat.S_ISREG((found := os.fstat(stream.fileno())).st_mode) and found.st_size <= most:
                return stream
            stream.close()
            raise InputError(f"{path}: is larger than {most:,} bytes; a run leaves no such file")
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise InputError(f"cannot read {path}: {reason}; give the folder of a run") from None
    raise InputError(
        f"{path}: is a link, a folder, a pipe or a device; a run leaves regular files, put one in its place"
    )


def read_result(path: Path) -> Any:
    """Read a file in JSON of a folder of results.

    Raises:
        InputError: as :func:`open_result`, or it is no JSON, nested too deeply, or has a number of thousands of digits.
    """
    with open_result(path, most=_MOST_JSON) as stream:
        try:
            return json.loads(stream.read().decode("utf-8-sig"))
        except (ValueError, RecursionError, MemoryError):
            raise InputError(f"{path}: is damaged: no JSON that can be read; run the scene again") from None


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a regular file.

    Raises:
        InputError: as :func:`open_result`.
    """
    digest = hashlib.sha256()
    with open_result(path) as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def seal_of(data: Mapping[str, Any]) -> str:
    """Return the digest of a report's content, as numbers and texts of JSON, without its seal and without times."""

    def timeless(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: timeless(below) for key, below in value.items() if key not in _TIMES}
        return [timeless(below) for below in value] if isinstance(value, list) else value

    text = json.dumps(timeless({key: value for key, value in data.items() if key != "sha256"}))
    return hashlib.sha256(text.encode()).hexdigest()


def has_seal(data: Any) -> bool:
    """Return whether what was read of a report is as warpflat wrote it."""
    try:
        return isinstance(data, dict) and data.get("sha256") == seal_of(data)
    except (RecursionError, ValueError):
        return False


def recorded_files(report: Any) -> dict[str, dict[str, str]]:
    """Return the files that a report lists, by run; names with a folder in them are left out, since no run writes such."""
    listed = report.get("files") if isinstance(report, dict) else None
    if not isinstance(listed, dict):
        return {}
    return {
        run: {file: was for file, was in known.items() if isinstance(was, str) and _is_plain(file)}
        for run, known in listed.items()
        if isinstance(known, dict)
    }


def refuse_to_replace_others(folder: Path, names: Iterable[str], new: Mapping[str, Path] | None = None) -> None:
    """Refuse to replace files that warpflat is not known to have written, or that were changed since.

    Args:
        folder: of the files.
        names: of those that would be replaced.
        new: what would replace them, by name, as far as it is there: a file of the same content is not in the way.

    Raises:
        NotOursError: the first such file.
    """
    there = [name for name in names if os.path.lexists(folder / name)]
    if not there:
        return
    reports = {report: _report(folder / report) for report in _REPORTS}
    known: dict[str, set[str]] = {}
    for data in reports.values():
        for files in recorded_files(data).values():
            for file, was in files.items():
                known.setdefault(file, set()).add(was)
    for name in there:
        path = folder / name
        try:
            found = file_digest(path)
            if found in known.get(name, ()) or (new and name in new and file_digest(new[name]) == found):
                continue
            data = reports[name] if name in reports else _report(path) if name.endswith(".json") else None
            if has_seal(data):
                continue
            is_changed = name in known or (isinstance(data, dict) and bool({"warpflat", "sha256"} & data.keys()))
        except InputError:
            is_changed = name in known
        what = "was changed since warpflat wrote it" if is_changed else "is not of warpflat"
        raise NotOursError(f"{path}: {what}, and would be replaced; move it away, or choose another folder")


def _report(path: Path) -> Any:
    try:
        return read_result(path)
    except InputError:
        return None


def _is_plain(file: str) -> bool:
    return bool(file) and Path(file).name == file and file not in ("..", "metrics.json")
