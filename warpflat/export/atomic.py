"""Files that appear whole or not at all: written under a hidden name beside the final one, then renamed."""

from __future__ import annotations

import functools
import hashlib
import os
import platform
import re
import time
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from warpflat.errors import InputError, expect
from warpflat.names import checked_name

__all__ = [
    "atomic_path",
    "file_in",
    "hidden_beside",
    "output_folder",
    "prepare_folder",
    "remove_unfinished",
    "require_writable",
]

# .NAME-warpflat-MACHINE-PROCESS-RANDOM.SUFFIX
_HIDDEN = re.compile(r"\..*-warpflat-(?P<machine>[0-9a-f]{8})-(?P<process>\d+)-[0-9a-f]{8}(\.\w+)?")
# After so long without a change nobody writes it any more, on whichever machine [s].
_ABANDONED = 24 * 3600.0


def file_in(folder: Path, name: str, ending: str) -> Path:
    """The file of what is called `name` in a folder: whoever names it, nothing is written elsewhere.

    Raises:
        InputError: `name` leads out of the folder, or cannot name a file for another reason.
    """
    return folder / f"{checked_name(name)}{ending}"


def hidden_beside(final: Path) -> Path:
    """A fresh hidden name in the folder of `final`, with its suffix (writers choose the format by it)."""
    mark = f"warpflat-{_machine()}-{os.getpid()}-{uuid.uuid4().hex[:8]}"
    return final.with_name(f".{final.stem}-{mark}{final.suffix}")


def remove_unfinished(folder: Path) -> None:
    """Remove the hidden files of runs that were killed: their process is gone, or it is another machine's and a day has passed."""
    with suppress(OSError):
        for path in folder.iterdir():
            found = _HIDDEN.fullmatch(path.name)
            if found and not path.is_symlink() and _is_abandoned(path, found["machine"], int(found["process"])):
                with suppress(OSError):
                    path.unlink()


def _is_abandoned(path: Path, machine: str, process: int) -> bool:
    if os.name == "posix" and machine == _machine():
        return not _is_running(process)
    try:
        return time.time() - path.stat().st_mtime > _ABANDONED
    except OSError:
        return False


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True  # somebody else's
    return True


@functools.cache
def _machine() -> str:
    """Eight digits for where a process's number means one process: a machine, until it starts anew, and a container on it."""
    known = [platform.node()]
    with suppress(OSError):
        known.append(Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii"))
        known.append(os.readlink("/proc/self/ns/pid"))
    return hashlib.sha256("\n".join(known).encode(errors="replace")).hexdigest()[:8]


def require_writable(final: str | os.PathLike[str]) -> None:
    """Make sure that a file of this name can be written, without leaving one.

    Raises:
        InputError: the folder is missing or cannot be written, or `final` is a folder.
    """
    final = Path(final)
    try:
        if final.is_dir():
            raise InputError(f"cannot write {final}: it is a folder; give the name of a file")
        _probe(hidden_beside(final))
    except OSError as error:
        raise _cannot_write(final, error) from error


def _probe(path: Path) -> None:
    """See that a file can be made, and remove it, also where a signal comes between."""
    try:
        path.touch(exist_ok=False)
    finally:
        path.unlink(missing_ok=True)


@contextmanager
def atomic_path(final: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path in the same folder; it becomes `final` on success and is removed on failure.

    A run that is killed leaves at most a hidden file, and never half a file under the final name. A file that is
    already there stays as it is until the new one is complete.

    Raises:
        InputError: the folder is missing or cannot be written, `final` is a folder, or the disk is full.
    """
    final = Path(final)
    require_writable(final)
    temporary = hidden_beside(final)
    try:
        # Created with the user's usual permissions: some libraries write through a private file of their own.
        temporary.touch(exist_ok=False)
        mode = temporary.stat().st_mode
        yield temporary
        temporary.chmod(mode)
        os.replace(temporary, final)
    except OSError as error:
        raise _cannot_write(final, error) from error
    finally:
        with suppress(OSError):
            temporary.unlink()


def prepare_folder(path: str | os.PathLike[str], files: Iterable[str] = ()) -> Path:
    """Create the output folder, parents included, and make sure that files, those of the names given too, can be written into it.

    What killed runs have left half-written there is removed (see `remove_unfinished`).

    Raises:
        InputError: it is a file, lies below a file, cannot be created or written, or has a folder where a file is to be.
    """
    expect(path, (str, os.PathLike), "folder", "the path of one")
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"output folder {folder} is a file; give a folder, or a name that is not taken")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _probe(hidden_beside(folder / "probe"))
    except OSError as error:
        raise InputError(f"output folder {folder} cannot be written: {_reason(error)}; choose another one") from error
    for file in files:
        if (folder / file).is_dir():
            raise InputError(
                f"{folder / file} is a folder, where a file is to be written; remove it, or choose another folder"
            )
    remove_unfinished(folder)
    return folder


@contextmanager
def output_folder(path: str | os.PathLike[str], files: Iterable[str] = ()) -> Iterator[Path]:
    """The output folder for a run that may yet fail: what it has made of it goes again if nothing has been written there.

    Raises:
        InputError: as :func:`prepare_folder`.
    """
    folder = Path(path)
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    try:
        yield prepare_folder(folder, files)
    finally:
        for each in made:
            with suppress(OSError):  # it holds files
                each.rmdir()


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()


def _cannot_write(final: Path, error: OSError) -> InputError:
    return InputError(f"cannot write {final}: {_reason(error)}; choose a folder that exists and can be written")
