"""All that is written: a file appears whole or not at all, the files of a run together or none, and no file of the user's is replaced.

A single file is written under a hidden name beside the final one, then renamed. The files of a run are written into a hidden folder
inside the output folder. At the end those that they replace are kept aside in it while the new ones are moved in one by one; if one of
them cannot be, or the process is killed meanwhile, what was there is put back: at once, at the end of the process, or by the next run.

What warpflat has written it knows by digest. The commands leave reports in JSON: each lists the files beside it under `files`, by run
and name, with their SHA-256, and has under `sha256` a seal, the digest of its own content. Every other file, and one that was changed
since, is the user's: it is neither replaced nor removed, and nor is a file from which the run was made.

What is made is kept. Once pieces are flattened, a step that cannot be taken (:func:`optional_step`), such as sewing, a hole, a half on
the fold, a file of the pattern or a picture, is left out: the rest is made, and a note names it, one sentence on the console and under
`notes` in `metrics.json`. Under `left_out` stands there, too, what a pattern needs: the run then ends with exit code 1. A note that
names an error of Python is a fault of the program. What the user must see to ends a run as ever: a place that cannot be written, or a
file of the user's there. So do an interruption and a want of memory.
"""

from __future__ import annotations

import atexit
import errno
import functools
import hashlib
import json
import math
import os
import platform
import re
import shutil
import time
import uuid
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from warpflat.core import (
    SIGNALS,
    CannotWriteError,
    InputError,
    check_file_name,
    expect,
    file_digest,
    is_out_of_memory,
    listening_to_reads,
    one_line,
    read_result,
    system_reason,
)
from warpflat.pattern.files.left_out import LeftOut, is_heard, leave_out, listening_to_left_out

__all__ = [
    "NotOursError",
    "atomic_path",
    "expect_files",
    "file_in",
    "has_seal",
    "latest_file",
    "notes_left_out",
    "optional_file",
    "optional_step",
    "output_folder",
    "plain_json",
    "prepare_folder",
    "record_file",
    "recorded_files",
    "refuse_to_replace_others",
    "remove_file",
    "remove_stale",
    "remove_unfinished",
    "seal_of",
    "write_json",
    "write_report",
    "write_sealed",
    "written_folders",
]

# .NAME-warpflat-MACHINE-PROCESS-RANDOM.SUFFIX
_HIDDEN = re.compile(r"\..*-warpflat-(?P<machine>[0-9a-f]{8})-(?P<process>\d+)-[0-9a-f]{8}(\.\w+)?")
# After so long without a change nobody writes it any more, on whichever machine [s].
_ABANDONED = 24 * 3600.0
# In a hidden folder: the new files, those that they replace, and the names of those that replace none.
_NEW, _ASIDE, _FRESH = "new", "aside", "fresh.json"
# Windows refuses to replace a file that a program has open (access denied, sharing violation).
_OPEN_ELSEWHERE = 5, 32
# Virus scanners and indexers open new files for moments: waits between attempts [s].
_WAITS = 0.02, 0.05, 0.1, 0.2, 0.4, 0.8
# The reports that list files, of a run, a comparison, a ledger of cuts, an edited dart, a batch, and a study of bodies.
_REPORTS = "metrics.json", "compare.json", "ledger.json", "edit.json", "batch.json", "fit.json"
# Equal runs have equal seals: what they took is not part of it.
_TIMES = "seconds", "memory_mb"
# Files that bear no name: in a folder with several runs they are taken to be the last one's.
_NAMELESS = (
    "frames.usdc", "picture.png", "wear.png", "drape.png", "drape.webp", "corrected.png", "walked.png", "pattern.pdf", "pattern.json",
    "review.html", "film.webp", "contact_sheet.png", "worn.usdc", "mannequin.usdc",
)  # fmt: skip


class NotOursError(CannotWriteError):
    """A file stands where warpflat would write, and is not as warpflat has written it."""


@dataclass(eq=False)
class _Run:
    """The files that a run writes into a folder.

    Attributes:
        folder: where they belong.
        hidden: the folder for the time being.
        is_guarded: whether files are left alone that warpflat is not known to have written.
        has_begun: whether the first file is being written.
        expected: names of files that are going to be written.
        sources: files that have been read, which are not replaced.
        removed: names of files of earlier runs that go with the change.
        amended: names of files that keep what they hold when they are written again.
        left_out: the steps that were, each once.
    """

    folder: Path
    hidden: Path
    is_guarded: bool
    has_begun: bool = False
    expected: set[str] = field(default_factory=set)
    sources: set[Path] = field(default_factory=set)
    removed: set[str] = field(default_factory=set)
    amended: set[str] = field(default_factory=set)
    left_out: dict[LeftOut, None] = field(default_factory=dict)

    @property
    def new(self) -> Path:
        """The folder in the hidden one for what is written, here and in forks of this process."""
        return self.hidden / _NEW

    def expect(self, names: Collection[str]) -> None:
        """Files are going to be written; a conflict ends the run as soon as it is known."""
        for name in names:
            if (self.folder / name).is_dir():
                raise InputError(
                    f"{self.folder / name} is a folder, where a file is to be written; remove it, or choose another folder"
                )
        self.expected.update(names)
        _refuse_to_replace((self.folder / name for name in names), self.sources)
        if self.is_guarded and "metrics.json" in names:
            _require_own(self.folder)

    def protect(self, source: Path) -> None:
        """A file has been read."""
        self.sources.add(source)
        _refuse_to_replace((self.folder / name for name in self.expected), [source])

    def keep(self, step: LeftOut) -> None:
        """A step was left out; one of this folder belongs in its report."""
        if step.folder is not None and (step.folder == self.folder or _is_among(step.folder, [self.folder])):
            self.left_out[step] = None

    def commit(self) -> None:
        """Make the new files those of the folder, `metrics.json` at last; what fails here is undone when the hidden folder is cleared."""
        complete = (path.name for path in self.new.iterdir() if not _HIDDEN.fullmatch(path.name))
        written = sorted(complete, key=lambda name: (name == "metrics.json", name))
        if not written:
            return
        _refuse_to_replace((self.folder / name for name in (*written, *self.removed)), self.sources)
        if self.is_guarded:
            replaced = [name for name in written if name not in self.amended]
            refuse_to_replace_others(self.folder, replaced, {name: self.new / name for name in replaced})
        aside = self.hidden / _ASIDE
        fresh = [name for name in written if not os.path.lexists(self.folder / name)]
        name = ""
        try:
            aside.mkdir()
            (self.hidden / _FRESH).write_text(json.dumps(fresh), encoding="utf-8")
            for name in self.removed.difference(written):
                with suppress(FileNotFoundError):
                    _rename(self.folder / name, aside / name)
            for name in written:
                final = self.folder / name
                if final.is_dir():
                    raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(final))
                if os.path.lexists(final):
                    # A second name: the old file is there until the new one is. Some file systems have no links.
                    try:
                        os.link(final, aside / name, follow_symlinks=False)
                    except (OSError, NotImplementedError):
                        _rename(final, aside / name)
                _rename(self.new / name, final)
        except OSError as error:
            raise _cannot_write(self.folder / name, error) from error
        # From here on the new files are those of the folder, whatever happens to what is hidden.
        (self.hidden / _FRESH).unlink()
        _written.append(self.folder)


_runs: ContextVar[tuple[_Run, ...]] = ContextVar("runs", default=())
# The folders into which this process has written.
_written: list[Path] = []
# Hidden files and folders that this process has made or is about to make, and the folders that go with each if nothing is left in them.
_unfinished: dict[Path, Sequence[Path]] = {}


# --- the files of a run


@contextmanager
def output_folder(
    path: str | os.PathLike[str], files: Iterable[str] = (), *, sources: Iterable[Path] = (), guard: bool = False
) -> Iterator[Path]:
    """Yield the folder for the files of a run; they appear together at the end of the block, or none of them if it fails.

    The folder is made if need be, and goes again if nothing has been written there. What is read in the block, and `sources`, is never
    replaced. A block in another one for the same folder is part of that.

    Args:
        path: the folder.
        files: names of files that will be written, as far as they are known; :func:`expect_files` adds to them.
        sources: files that were read before.
        guard: whether files of the folder that warpflat is not known to have written are not replaced, either: so do all commands.

    Raises:
        InputError: as :func:`prepare_folder`, nothing can be written into the folder, or it would replace one that was read or, with
            `guard`, one that is not as warpflat wrote it; `metrics.json` at once, others when the first file is written.
    """
    expect(path, (str, os.PathLike), "folder", "the path of one")
    folder, files = Path(path), set(files)
    joined = _run_into(folder)
    if joined is not None:
        for source in sources:
            joined.protect(source)
        joined.is_guarded |= guard
        joined.expect(files)
        yield folder
        return
    made = list[Path]()
    with suppress(OSError):  # no folder can be called so
        made = [each.absolute() for each in (folder, *folder.parents) if not each.exists()]
    run = _Run(folder, _hidden_name(folder / "run", made), guard)
    before = _going_on()
    try:
        prepare_folder(folder)
        for source in sources:
            run.protect(source)
        run.expect(files)
        try:
            run.new.mkdir(parents=True)
        except OSError as error:
            raise _no_output_folder(folder, error) from error
        _runs.set((*before, run))
        with listening_to_reads(run.protect), listening_to_left_out(run.keep):
            yield folder
        run.commit()
    finally:
        try:
            _runs.set(before)
        finally:
            _clear_hidden(run.hidden)


def prepare_folder(path: str | os.PathLike[str]) -> Path:
    """Create the output folder, parents included.

    What killed runs have left half-written there, and in the folders beside it, is removed (see :func:`remove_unfinished`).

    Raises:
        InputError: it is a file, lies below a file, or cannot be created, or its name is no text.
    """
    expect(path, (str, os.PathLike), "folder", "the path of one")
    folder = Path(path)
    try:
        str(folder).encode()
        if folder.exists() and not folder.is_dir():
            raise InputError(f"output folder {folder} is a file; give a folder, or a name that is not taken")
        folder.mkdir(parents=True, exist_ok=True)
    except UnicodeEncodeError:
        raise InputError(
            f"output folder {str(folder)!a} has bytes in its name that are no UTF-8; choose another one"
        ) from None
    except OSError as error:
        raise _no_output_folder(folder, error) from error
    remove_unfinished(folder)
    with suppress(OSError):
        for beside in {path.parent for path in folder.absolute().parent.glob("*/.run-warpflat-*")}:
            if not beside.is_symlink():
                remove_unfinished(beside)
    return folder


def written_folders() -> tuple[Path, ...]:
    """Return the folders into which the runs of this process have written their files, in order."""
    return tuple(_written)


def expect_files(folder: Path, files: Iterable[str]) -> None:
    """Announce further files that the run of an :func:`output_folder` will write, so that a conflict ends it early.

    Raises:
        InputError: one of them was read by the run, or is a folder.
    """
    if run := _run_into(folder):
        run.expect(set(files))


def latest_file(path: Path) -> Path:
    """Return the path of an output file's latest content: the hidden one while an :func:`output_folder` is open."""
    run = _run_into(path.parent)
    return run.new / path.name if run is not None and (run.new / path.name).exists() else path


def remove_file(path: Path) -> None:
    """Remove a file of an earlier run; in an :func:`output_folder` it goes when the new files come."""
    run = _run_into(path.parent)
    if run is None:
        path.unlink(missing_ok=True)
    elif os.path.lexists(path):
        run.removed.add(path.name)


def _run_into(folder: Path) -> _Run | None:
    """Return the run that is writing into a folder, if there is one."""
    return next((run for run in _going_on() if run.folder == folder or _is_among(folder, [run.folder])), None)


def _going_on() -> tuple[_Run, ...]:
    """Return the runs that write at present; an interruption may have left others."""
    return tuple(run for run in _runs.get() if run.hidden in _unfinished)


# --- a single file


def file_in(folder: Path, name: str, ending: str) -> Path:
    """Return the path of a file in a folder; its name cannot lead out of the folder.

    Raises:
        InputError: `name` leads out of the folder, or cannot name a file for another reason.
    """
    return folder / f"{check_file_name(name)}{ending}"


@contextmanager
def _hidden_file(final: Path) -> Iterator[Path]:
    """Yield a fresh hidden name with the suffix of a file; whatever has that name at the end is removed.

    It lies beside `final`, or in the hidden folder of the run to which that belongs.
    """
    run = _run_into(final.parent)
    if run is not None:
        # What the run is made from has been read by now: see that no file of the user's is in the way.
        if run.is_guarded and not run.has_begun:
            refuse_to_replace_others(run.folder, sorted(run.expected))
        run.has_begun = True
    path = _hidden_name(final if run is None else run.new / final.name)
    try:
        yield path
    finally:
        _clear_hidden(path)


def _require_writable(final: str | os.PathLike[str]) -> None:
    """Check that a file of this name can be written; none is left.

    Raises:
        InputError: the folder is missing or cannot be written, or `final` is a folder, or a file that the run has read.
    """
    final = Path(final)
    run = _run_into(final.parent)
    try:
        if final.is_dir():
            raise CannotWriteError(f"cannot write {final}: it is a folder; give the name of a file")
        if run is not None:
            _refuse_to_replace([final], run.sources)
            return
        with _hidden_file(final) as probe:
            probe.touch(exist_ok=False)
    except OSError as error:
        raise _cannot_write(final, error) from error


@contextmanager
def atomic_path(final: str | os.PathLike[str], *, sources: Collection[Path] = ()) -> Iterator[Path]:
    """Yield a temporary path with the same suffix; it becomes `final` on success and is removed on failure.

    A run that is killed leaves at most a hidden file, and never half a file under the final name. A file that is
    already there stays as it is until the new one is complete, and in an :func:`output_folder` until all are.

    Args:
        final: the file.
        sources: files from which it is made; it must be none of them.

    Raises:
        InputError: the folder is missing or cannot be written, `final` is a folder or a file that the run has read, or the disk is full.
    """
    final = Path(final)
    _require_writable(final)
    _refuse_to_replace([final], sources)
    run = _run_into(final.parent)
    try:
        with _hidden_file(final) as temporary:
            # Created with the user's usual permissions: some libraries write through a private file of their own.
            temporary.touch(exist_ok=False)
            mode = temporary.stat().st_mode
            yield temporary
            temporary.chmod(mode)
            _rename(temporary, final if run is None else run.new / final.name)
    except OSError as error:
        raise _cannot_write(final, error) from error


def write_json(path: str | os.PathLike[str], data: Mapping[str, Any]) -> None:
    """Write `data` as JSON, atomically, keys in their order, numbers with every digit that tells them apart.

    NumPy scalars and arrays become numbers and lists. JSON has no word for NaN or infinity: both are written as
    ``null``, "no number", so that any reader can read the file.

    Raises:
        InputError: the file cannot be written.
        TypeError: a value has no meaning in JSON; the message says at which key.
    """
    text = json.dumps(plain_json(data), indent=2, ensure_ascii=False, allow_nan=False)
    with atomic_path(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def plain_json(value: Any, where: str = "metrics") -> Any:
    """Return a value as what JSON has: see :func:`write_json`."""
    if isinstance(value, np.generic | np.ndarray):
        return plain_json(value.tolist(), where)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        wrong = [key for key in value if not isinstance(key, str)]
        if wrong:
            raise TypeError(f"{where}: the key {wrong[0]!r} is not text")
        return {key: plain_json(entry, f"{where}.{key}") for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain_json(entry, f"{where}[{index}]") for index, entry in enumerate(value)]
    raise TypeError(f"{where}: a {type(value).__name__} cannot be written as JSON")


# --- steps that a run can do without


@contextmanager
def optional_step(
    words: str, *, of: type[InputError] = InputError, is_needed: bool = True, folder: Path | None = None
) -> Iterator[list[str]]:
    """Take a step that the run can do without in a ``with`` block; an error in the block becomes a note, and the block ends there.

    Args:
        words: how the note begins; the reason follows.
        of: errors of input that are no mistake of the user's; others are raised.
        is_needed: whether the pattern is not complete without it.
        folder: of the run; the one whose block is innermost if not given.

    Yields:
        The note, once the block has ended with an error; before, and where it has not, nothing.

    Raises:
        InputError: a place cannot be written, the disk is full, or the error is none of `of`; any error where nobody hears of the note.
    """
    notes = list[str]()
    try:
        yield notes
    except Exception as error:
        foreseen = isinstance(error, InputError)
        if (
            SIGNALS
            or isinstance(error, CannotWriteError)
            or is_out_of_memory(error)
            or (foreseen and not isinstance(error, of))
        ):
            raise
        run = next(reversed(_going_on()), None) if folder is None else _run_into(folder)
        if folder is None and run is None and not is_heard():
            raise  # nobody would hear of it
        notes.append(one_line(f"{words}: {error}" if foreseen else f"{words}: {type(error).__name__}: {error}"))
        leave_out(LeftOut(note=notes[0], folder=folder if run is None else run.folder, is_needed=is_needed))


@contextmanager
def optional_file(path: str | os.PathLike[str], files: list[str], *, part: str = "") -> Iterator[Path]:
    """Make a file that the run can do without in a ``with`` block, as an :func:`optional_step`.

    Args:
        path: the file.
        files: its name is added to these when the block ends well.
        part: what is made, if it is only a part of the file, such as "the guide".

    Raises:
        InputError: the folder cannot be written, the disk is full, or `path` is a folder, or a file that the run has read.
    """
    path = Path(path)
    _require_writable(path)
    words = f"{part or path.name} was left out{f' of {path.name}' if part else ''}"
    with optional_step(words, is_needed=False, folder=path.parent) as left_out:
        yield path
    if not left_out:
        files.append(path.name)


# --- what is not replaced


def _is_among(path: Path, files: Iterable[Path]) -> bool:
    """Return whether a path is one of these files, also by another link or, where the file system ignores it, other case."""
    for file in files:
        with suppress(OSError, ValueError):  # one of them does not exist
            if os.path.samefile(path, file):
                return True
    return False


def _refuse_to_replace(files: Iterable[Path], sources: Collection[Path]) -> None:
    for file in files:
        if _is_among(file, sources):
            raise CannotWriteError(
                f"{file} is read by this run, which would replace it; choose another output folder (--out) or another name"
            )


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
    reports = {file: _read_or_none(folder / file) for file in {*_REPORTS, *there} if file.endswith(".json")}
    known: dict[str, set[str]] = {}
    for report in _REPORTS:
        for files in recorded_files(reports[report]).values():
            for file, was in files.items():
                known.setdefault(file, set()).add(was)
    for name in there:
        try:
            found = file_digest(folder / name)
            if found in known.get(name, ()) or (new and name in new and file_digest(new[name]) == found):
                continue
        except InputError:  # no regular file
            pass
        data = reports.get(name)
        if has_seal(data):
            continue
        is_changed = name in known or (isinstance(data, dict) and bool({"warpflat", "sha256"} & data.keys()))
        what = "was changed since warpflat wrote it" if is_changed else "is not of warpflat"
        raise NotOursError(f"{folder / name}: {what}, and would be replaced; move it away, or choose another folder")


def _read_or_none(path: Path) -> Any:
    try:
        return read_result(path)
    except InputError:
        return None


def recorded_files(report: Any) -> dict[str, dict[str, str]]:
    """Return the files that a report lists, by run; names with a folder in them are left out, since no run writes such."""
    listed = report.get("files") if isinstance(report, dict) else None
    if not isinstance(listed, dict):
        return {}
    return {
        run: {
            file: was
            for file, was in known.items()
            if isinstance(was, str) and _is_plain(file) and file != "metrics.json"
        }
        for run, known in listed.items()
        if isinstance(known, dict)
    }


def _is_plain(name: str) -> bool:
    """Return whether a name that was read is that of a file in the same folder."""
    return name not in ("", "..") and Path(name).name == name


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
    return isinstance(data, dict) and data.get("sha256") == seal_of(data)


# --- reports, which list the files beside them


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


def write_report(
    path: Path, data: Mapping[str, Any], *, name: str, files: Iterable[str], gone: Collection[tuple[str, str]] = ()
) -> dict[str, Any]:
    """Write a report that lists files beside it, and those that it listed before; return its content.

    Args:
        path: of the report; `metrics.json` has the notes on files that were left out, too.
        data: all of it but `files`.
        name: of the run that has written the files.
        files: by name.
        gone: run and name of files that it listed before, and that are to be forgotten.

    Raises:
        InputError: it cannot be written.
    """
    folder, before = path.parent, latest_file(path)
    mine = {file: file_digest(latest_file(folder / file)) for file in files if file != path.name}
    record = {
        run: {file: was for file, was in known.items() if file not in mine and (run, file) not in gone}
        for run, known in recorded_files(read_result(before) if before.exists() else None).items()
    }
    record[name] = {**mine, **record.get(name, {})}
    told = notes_left_out(folder) if path.name == "metrics.json" else {}
    return write_sealed(path, {**data, **told, "files": {run: known for run, known in record.items() if known}})


def notes_left_out(folder: Path) -> dict[str, list[str]]:
    """Return the entries of `metrics.json` on what the run that writes into a folder has left out so far; none where there is nothing."""
    run = _run_into(folder)
    steps = [] if run is None else list(run.left_out)
    notes = {"notes": [step.note for step in steps], "left_out": [step.note for step in steps if step.is_needed]}
    return {key: list(dict.fromkeys(row)) for key, row in notes.items() if row}


def remove_stale(
    folder: Path,
    metrics: Mapping[str, Any],
    *,
    name: str,
    files: Sequence[str],
    drape: bool = False,
    report: str = "metrics.json",
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Write the report of a run at its end, and remove files of earlier runs that could be taken for its own.

    That is what a run of the same name has written and this one has not, and of other runs those files that bear no name,
    such as `pattern.json`; never a file from which this run was made, nor one that is not as it was written. In an
    :func:`output_folder` they go when the new files are there.

    Args:
        folder: in which the run has written all else.
        metrics: all of the report but `files`.
        name: of the run.
        files: that it has written, by name.
        drape: whether garments are draped, of which earlier ones are removed, and nothing else.
        report: the file's name.

    Returns:
        What the report holds, and what was left out, removed or left, one sentence each.

    Raises:
        InputError: the report cannot be written.
    """
    going_on = _run_into(folder)
    removed, notes = list[tuple[str, str]](), list[str]()
    for run, known in recorded_files(_require_own(folder, report)).items():
        for file, was in known.items():
            is_stale = file.endswith(".draped.obj") and run == name if drape else run == name or file in _NAMELESS
            if file in files or not is_stale:
                continue
            path, reason = folder / file, ""
            try:
                if going_on is not None and _is_among(path, going_on.sources):
                    reason = "this run was made from it"
                elif os.path.lexists(path) and file_digest(path) != was:
                    reason = "it is not as an earlier run left it"
                else:
                    remove_file(path)
            except InputError:
                reason = "it is not as an earlier run left it"
            except OSError as error:
                reason = f"it cannot be removed ({system_reason(error)})"
            if reason:
                notes.append(f"{file} was not made by this run, and stays: {reason}")
            else:
                removed.append((run, file))
    if removed:
        names = ", ".join(file for _, file in removed)
        notes.insert(0, f"removed what an earlier run had left and this one did not make: {names}")
    complete = write_report(folder / report, metrics, name=name, files=files, gone=removed)
    return complete, (*notes_left_out(folder).get("notes", ()), *notes)


def record_file(folder: Path, name: str, file: str) -> None:
    """Add a file to the manifest of a run in `metrics.json`, if there is such a run.

    Raises:
        InputError: `metrics.json` cannot be written.
    """
    try:
        metrics = _require_own(folder)
    except InputError:
        return  # somebody else's, which knows of no run
    record = recorded_files(metrics)
    if name in record:
        record[name][file] = file_digest(latest_file(folder / file))
        # What the user has changed in it stays, and is known to be the user's by the seal that does not fit.
        if run := _run_into(folder):
            run.amended.add("metrics.json")
        write = write_sealed if has_seal(metrics) else write_json
        write(folder / "metrics.json", {**metrics, "files": record})


def _require_own(folder: Path, report: str = "metrics.json") -> dict[str, Any]:
    """Check that a report in a folder is of warpflat, since a run replaces it; return its content, empty if there is none.

    Raises:
        InputError: it is something else by that name.
    """
    file = folder / report
    latest = latest_file(file)
    if not os.path.lexists(latest):
        return {}
    data = _read_or_none(latest)
    if not isinstance(data, dict) or "warpflat" not in data:
        raise NotOursError(
            f"{file}: is not of warpflat, and a run would replace it; move it away, or choose another folder"
        )
    return data


# --- hidden files and folders, also those that a killed process has left


def _hidden_name(final: Path, made: Sequence[Path] = ()) -> Path:
    """Return a fresh hidden name beside `final`, which is remembered before a file of that name exists."""
    mark = f"warpflat-{_machine()}-{os.getpid()}-{uuid.uuid4().hex[:8]}"
    path = final.absolute().with_name(f".{final.stem}-{mark}{final.suffix}")
    _unfinished[path] = made
    return path


@functools.cache
def _machine() -> str:
    """Return eight digits for the machine since its last start, and the container: within them a process number is unique."""
    known = [platform.node()]
    with suppress(OSError):
        known.append(Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii"))
        known.append(os.readlink("/proc/self/ns/pid"))
    return hashlib.sha256("\n".join(known).encode(errors="replace")).hexdigest()[:8]


def _clear_hidden(path: Path) -> None:
    """Remove a hidden file, or a hidden folder once the files kept in it are back in their places."""
    with suppress(OSError):
        if path.is_dir():
            _roll_back(path)
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
    if not os.path.lexists(path):
        for each in _unfinished.get(path, ()):
            with suppress(OSError):  # it holds files, or could not be made
                each.rmdir()
        _unfinished.pop(path, None)


def _roll_back(hidden: Path) -> None:
    """Undo an unfinished exchange of files; to do it twice does no harm."""
    try:
        fresh = json.loads((hidden / _FRESH).read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError, RecursionError):
        return  # it was not begun, or is complete
    folder = hidden.parent
    # Only plain names are followed: the list may have been put there by anybody.
    for name in fresh if isinstance(fresh, list) else ():
        if isinstance(name, str) and _is_plain(name) and not (hidden / _NEW / name).exists():
            (folder / name).unlink(missing_ok=True)
    in_the_way: OSError | None = None
    for path in (hidden / _ASIDE).iterdir():
        final = folder / path.name
        if final.exists() and path.samefile(final):
            continue  # it was not replaced; one that is open could not be moved, either
        try:
            _rename(path, final)
        except OSError as error:
            in_the_way = error
    if in_the_way is not None:
        raise in_the_way
    (hidden / _FRESH).unlink()


@atexit.register
def _clear_all() -> None:
    """Remove the hidden files that an interruption has left."""
    for path in list(_unfinished):
        if f"-{os.getpid()}-" in path.name:  # not in a child, by whom the parent's are known too
            _clear_hidden(path)


def remove_unfinished(folder: Path) -> None:
    """Remove the hidden files of killed runs, and put back the files that they had moved aside.

    A run was killed if its process is gone, or if it is another machine's and a day has passed.
    """
    with suppress(OSError):
        for path in folder.iterdir():
            found = _HIDDEN.fullmatch(path.name)
            if found and not path.is_symlink() and _is_abandoned(path, found["machine"], int(found["process"])):
                _clear_hidden(path)


def _is_abandoned(path: Path, machine: str, process: int) -> bool:
    try:
        if os.name != "posix" or machine != _machine():
            latest = max(each.lstat().st_mtime for each in (path, *path.rglob("*")))
            return time.time() - latest > _ABANDONED
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return True
    except OSError:  # the process is somebody else's, or the files cannot be seen
        return False
    return False


# --- renaming, and what is said where it fails


def _rename(source: Path, target: Path) -> None:
    """Rename a file over another one; on Windows wait a moment for programs that have one of them open."""
    for wait in _WAITS:
        try:
            os.replace(source, target)
            return
        except PermissionError as error:
            if getattr(error, "winerror", None) not in _OPEN_ELSEWHERE:
                raise
        time.sleep(wait)
    os.replace(source, target)


def _cannot_write(final: Path, error: OSError) -> InputError:
    if getattr(error, "winerror", None) in _OPEN_ELSEWHERE:
        return CannotWriteError(
            f"cannot write {final}: it is open in another program or write-protected; close it, and run again"
        )
    # Libraries raise errors of this kind for faults of their own, too; those of the system have a number.
    kind = InputError if error.errno is None else CannotWriteError
    return kind(f"cannot write {final}: {system_reason(error)}; choose a folder that exists and can be written")


def _no_output_folder(folder: Path, error: OSError) -> InputError:
    shown = f"{str(folder)[:60]}..." if len(str(folder)) > 200 else folder
    return InputError(f"output folder {shown} cannot be written: {system_reason(error)}; choose another one")
