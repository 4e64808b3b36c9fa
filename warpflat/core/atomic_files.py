"""Files that appear whole or not at all, and all files of a run together or none of them.

A single file is written under a hidden name beside the final one, then renamed. The files of a run are written into a hidden folder
inside the output folder. At the end those that they replace are kept aside in it while the new ones are moved in one by one; if one of
them cannot be, or the process is killed meanwhile, what was there is put back: at once, at the end of the process, or by the next run.
This is also the one place that sees to it that no file is replaced from which a run was made, nor one of the user's.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

from warpflat.core.errors import CannotWriteError, InputError, expect
from warpflat.core.file_names import check_file_name
from warpflat.core.hidden_files import ASIDE, FRESH, NEW, clear_hidden, hidden_name, is_unfinished, remove_unfinished
from warpflat.core.input_files import is_among, listening_to_reads, refuse_to_replace
from warpflat.core.own_files import refuse_to_replace_others
from warpflat.core.replace_file import is_open_elsewhere, replace_file

__all__ = [
    "adopt_files",
    "atomic_path",
    "expect_files",
    "file_in",
    "files_written",
    "hidden_file",
    "is_input",
    "keep_note",
    "latest_file",
    "note_amended",
    "notes_kept",
    "output_folder",
    "prepare_folder",
    "remove_file",
    "require_writable",
]


def file_in(folder: Path, name: str, ending: str) -> Path:
    """Return the path of a file in a folder; its name cannot lead out of the folder.

    Raises:
        InputError: `name` leads out of the folder, or cannot name a file for another reason.
    """
    return folder / f"{check_file_name(name)}{ending}"


@contextmanager
def hidden_file(final: Path) -> Iterator[Path]:
    """Yield a fresh hidden name with the suffix of a file; whatever has that name at the end is removed.

    It lies beside `final`, or in the hidden folder of the run to which that belongs.
    """
    run = _run_into(final.parent)
    if run is not None:
        run.begin()
    path = hidden_name(final if run is None else run.new / final.name)
    try:
        yield path
    finally:
        clear_hidden(path)


def require_writable(final: str | os.PathLike[str]) -> None:
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
            run.refuse_inputs([final.name])
            return
        with hidden_file(final) as probe:
            probe.touch(exist_ok=False)
    except OSError as error:
        raise _cannot_write(final, error) from error


@contextmanager
def atomic_path(final: str | os.PathLike[str], *, sources: Iterable[Path] = ()) -> Iterator[Path]:
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
    require_writable(final)
    refuse_to_replace(final, sources)
    run = _run_into(final.parent)
    try:
        with hidden_file(final) as temporary:
            # Created with the user's usual permissions: some libraries write through a private file of their own.
            temporary.touch(exist_ok=False)
            mode = temporary.stat().st_mode
            yield temporary
            temporary.chmod(mode)
            if run is None:
                replace_file(temporary, final)
            else:
                run.take(temporary, final.name)
    except OSError as error:
        raise _cannot_write(final, error) from error


class _Run:
    """The files that a run writes into a folder: new ones in a hidden folder, and later the old ones that they replace.

    Attributes:
        folder: where the files belong.
        hidden: the folder for the time being.
        new: the folder in it for what is written.
        names: of the files written, in that order.
        removed: names of files of earlier runs that go with the change.
        notes: on files that were left out, each once.
        is_guarded: whether files are left alone that warpflat is not known to have written.
        amended: names of files that keep what they hold when they are written again.
    """

    def __init__(self, folder: Path, hidden: Path, *, guard: bool) -> None:
        self.folder = folder
        self.hidden = hidden
        self.is_guarded = guard
        self.new = hidden / NEW
        self.names: dict[str, None] = {}
        self.removed: dict[str, None] = {}
        self.notes: dict[str, None] = {}
        self._expected: set[str] = set()
        self._sources: set[Path] = set()
        self._has_begun = False
        self.amended: set[str] = set()

    def expect(self, files: Iterable[str]) -> None:
        """Names of files that are going to be written, as soon as they are known."""
        names = set(files)
        for name in names:
            if (self.folder / name).is_dir():
                raise InputError(
                    f"{self.folder / name} is a folder, where a file is to be written; remove it, or choose another folder"
                )
        self._expected |= names
        self.refuse_inputs(names)

    def begin(self) -> None:
        """Before the first file is written, when what the run is made from has been read, see that no file of the user's is in the way."""
        if self.is_guarded and not self._has_begun:
            refuse_to_replace_others(self.folder, sorted(self._expected))
        self._has_begun = True

    def protect(self, source: Path) -> None:
        """A file that has been read, which is not to be replaced."""
        self._sources.add(source)
        for name in self._expected:
            refuse_to_replace(self.folder / name, [source])

    def refuse_inputs(self, names: Iterable[str]) -> None:
        """See that none of these is a file that has been read."""
        for name in names:
            refuse_to_replace(self.folder / name, self._sources)

    def reads(self, path: Path) -> bool:
        """Return whether a file has been read."""
        return is_among(path, self._sources)

    def take(self, temporary: Path, name: str) -> None:
        """A file that is complete."""
        replace_file(temporary, self.new / name)
        self.names.pop(name, None)
        self.names[name] = None
        self.removed.pop(name, None)

    def commit(self) -> None:
        """Make the new files those of the folder, `metrics.json` at last; what fails here is undone when the hidden folder is cleared."""
        if not self.names:
            return
        self.refuse_inputs((*self.names, *self.removed))
        if self.is_guarded:
            replaced = [name for name in self.names if name not in self.amended]
            refuse_to_replace_others(self.folder, replaced, {name: self.new / name for name in replaced})
        aside = self.hidden / ASIDE
        fresh = [name for name in self.names if not os.path.lexists(self.folder / name)]
        name = ""
        try:
            aside.mkdir()
            (self.hidden / FRESH).write_text(json.dumps(fresh), encoding="utf-8")
            for name in self.removed:
                with suppress(FileNotFoundError):
                    replace_file(self.folder / name, aside / name)
            for name in sorted(self.names, key=lambda name: name == "metrics.json"):
                _keep_aside(self.folder / name, aside / name)
                replace_file(self.new / name, self.folder / name)
        except OSError as error:
            raise _cannot_write(self.folder / name, error) from error
        # From here on the new files are those of the folder, whatever happens to what is hidden.
        (self.hidden / FRESH).unlink()


_runs: ContextVar[tuple[_Run, ...]] = ContextVar("runs", default=())


def _run_into(folder: Path) -> _Run | None:
    """Return the run that is writing into a folder, if there is one."""
    return next((run for run in _going_on() if run.folder == folder or is_among(folder, [run.folder])), None)


def _going_on() -> tuple[_Run, ...]:
    """Return the runs that write at present."""
    return tuple(run for run in _runs.get() if is_unfinished(run.hidden))


def _keep_aside(final: Path, aside: Path) -> None:
    """Give a file a second name, where there is one; where the file system has no links, its only one until the new file is there."""
    if not os.path.lexists(final):
        return
    if final.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(final))
    try:
        os.link(final, aside, follow_symlinks=False)
    except (OSError, NotImplementedError):
        replace_file(final, aside)


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
            `guard`, one that is not as warpflat wrote it.
    """
    expect(path, (str, os.PathLike), "folder", "the path of one")
    folder = Path(path)
    joined = _run_into(folder)
    if joined is not None:
        for source in sources:
            joined.protect(source)
        joined.is_guarded |= guard
        joined.expect(files)
        yield folder
        return
    made = _missing(folder)
    run = _Run(folder, hidden_name(folder / "run", made), guard=guard)
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
        with listening_to_reads(run.protect):
            yield folder
        run.commit()
    finally:
        try:
            _runs.set(before)
        finally:
            clear_hidden(run.hidden)


def expect_files(folder: Path, files: Iterable[str]) -> None:
    """Announce further files that the run of an :func:`output_folder` will write, so that a conflict ends it early.

    Raises:
        InputError: one of them was read by the run, or is a folder.
    """
    if run := _run_into(folder):
        run.expect(files)


def latest_file(path: Path) -> Path:
    """Return the path of an output file's latest content: the hidden one while an :func:`output_folder` is open."""
    run = _run_into(path.parent)
    return path if run is None or path.name not in run.names else run.new / path.name


def files_written() -> list[tuple[str, str]]:
    """Return the complete files of the runs that write at present: folder and name of each."""
    return [(str(run.folder), name) for run in _going_on() for name in run.names]


def adopt_files(files: Iterable[tuple[str, str]]) -> None:
    """Add files to the runs that write at present, which a fork of this process has completed for them."""
    for folder, name in files:
        if run := _run_into(Path(folder)):
            run.names[name] = None


def keep_note(path: Path, note: str) -> None:
    """Keep a note on a file that the run into its folder has left out, if there is such a run."""
    if run := _run_into(path.parent):
        run.notes[note] = None


def notes_kept(folder: Path) -> tuple[str, ...]:
    """Return the notes on files that the run into a folder has left out."""
    run = _run_into(folder)
    return () if run is None else tuple(run.notes)


def note_amended(path: Path) -> None:
    """Note that what the run writes as a file is that file as it is, also with what the user has changed in it, and an entry more."""
    if run := _run_into(path.parent):
        run.amended.add(path.name)


def is_input(path: Path) -> bool:
    """Return whether a file was read by the run that is writing into its folder."""
    run = _run_into(path.parent)
    return run is not None and run.reads(path)


def remove_file(path: Path) -> None:
    """Remove a file of an earlier run; in an :func:`output_folder` it goes when the new files come."""
    run = _run_into(path.parent)
    if run is None:
        path.unlink(missing_ok=True)
    elif os.path.lexists(path):
        run.removed[path.name] = None


def prepare_folder(path: str | os.PathLike[str]) -> Path:
    """Create the output folder, parents included.

    What killed runs have left half-written there is removed (see `remove_unfinished`).

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
    return folder


def _missing(folder: Path) -> list[Path]:
    """Return the folder and its parents that do not exist."""
    try:
        return [each.absolute() for each in (folder, *folder.parents) if not each.exists()]
    except OSError:
        return []  # no folder can be called so


def _no_output_folder(folder: Path, error: OSError) -> InputError:
    shown = f"{str(folder)[:60]}..." if len(str(folder)) > 200 else folder
    return InputError(f"output folder {shown} cannot be written: {_reason(error)}; choose another one")


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()


def _cannot_write(final: Path, error: OSError) -> InputError:
    if is_open_elsewhere(error):
        return CannotWriteError(
            f"cannot write {final}: it is open in another program or write-protected; close it, and run again"
        )
    # Libraries raise errors of this kind for faults of their own, too; those of the system have a number.
    kind = InputError if error.errno is None else CannotWriteError
    return kind(f"cannot write {final}: {_reason(error)}; choose a folder that exists and can be written")
