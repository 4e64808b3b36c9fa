"""Hidden files and folders: their names, and what becomes of those that a killed process has left.

A hidden folder may hold files that were moved aside for new ones; before it goes they are put back (see `warpflat.core.atomic_files`).
"""

from __future__ import annotations

import atexit
import functools
import hashlib
import json
import os
import platform
import re
import shutil
import time
import uuid
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from warpflat.core.replace_file import replace_file

__all__ = ["ASIDE", "FRESH", "NEW", "clear_hidden", "hidden_name", "is_unfinished", "remove_unfinished"]

# .NAME-warpflat-MACHINE-PROCESS-RANDOM.SUFFIX
_HIDDEN = re.compile(r"\..*-warpflat-(?P<machine>[0-9a-f]{8})-(?P<process>\d+)-[0-9a-f]{8}(\.\w+)?")
# After so long without a change nobody writes it any more, on whichever machine [s].
_ABANDONED = 24 * 3600.0
#: In a hidden folder: the new files, those that they replace, and the names of those that replace none.
NEW, ASIDE, FRESH = "new", "aside", "fresh.json"

# Hidden files and folders that this process has made or is about to make, and the folders that go with each if nothing is left in them.
_unfinished: dict[Path, Sequence[Path]] = {}


def hidden_name(final: Path, made: Sequence[Path] = ()) -> Path:
    """Return a fresh hidden name beside `final`, which is remembered before a file of that name exists."""
    mark = f"warpflat-{_machine()}-{os.getpid()}-{uuid.uuid4().hex[:8]}"
    path = final.absolute().with_name(f".{final.stem}-{mark}{final.suffix}")
    _unfinished[path] = made
    return path


def clear_hidden(path: Path) -> None:
    """Remove a hidden file, or a hidden folder once the files kept in it are back in their places."""
    with suppress(OSError):
        if path.is_dir():
            _put_back(path)
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
    if not os.path.lexists(path):
        for each in _unfinished.get(path, ()):
            with suppress(OSError):  # it holds files, or could not be made
                each.rmdir()
        _unfinished.pop(path, None)


def is_unfinished(path: Path) -> bool:
    """Return whether this process has made a hidden file or folder, or is about to, and has not removed it."""
    return path in _unfinished


@atexit.register
def _clear_all() -> None:
    """Remove the hidden files that an interruption has left."""
    for path in list(_unfinished):
        if f"-{os.getpid()}-" in path.name:  # not in a child, by whom the parent's are known too
            clear_hidden(path)


def remove_unfinished(folder: Path) -> None:
    """Remove the hidden files of killed runs, and put back the files that they had moved aside.

    A run was killed if its process is gone, or if it is another machine's and a day has passed.
    """
    with suppress(OSError):
        for path in folder.iterdir():
            found = _HIDDEN.fullmatch(path.name)
            if found and not path.is_symlink() and _is_abandoned(path, found["machine"], int(found["process"])):
                clear_hidden(path)


def _is_abandoned(path: Path, machine: str, process: int) -> bool:
    if os.name == "posix" and machine == _machine():
        return not _is_running(process)
    try:
        latest = max(each.lstat().st_mtime for each in (path, *path.rglob("*")))
        return time.time() - latest > _ABANDONED
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
    """Return eight digits for the machine since its last start, and the container: within them a process number is unique."""
    known = [platform.node()]
    with suppress(OSError):
        known.append(Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii"))
        known.append(os.readlink("/proc/self/ns/pid"))
    return hashlib.sha256("\n".join(known).encode(errors="replace")).hexdigest()[:8]


def _put_back(hidden: Path) -> None:
    """Undo an unfinished exchange of files; to do it twice does no harm."""
    try:
        fresh = json.loads((hidden / FRESH).read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError, RecursionError):
        return  # it was not begun, or is complete
    folder = hidden.parent
    # Only plain names are followed: the list may have been put there by anybody.
    listed = [name for name in fresh if isinstance(name, str)] if isinstance(fresh, list) else []
    for name in listed:
        plain = Path(name).name == name and name not in ("", "..")
        if plain and not (hidden / NEW / name).exists():
            (folder / name).unlink(missing_ok=True)
    in_the_way: OSError | None = None
    for path in (hidden / ASIDE).iterdir():
        final = folder / path.name
        if final.exists() and path.samefile(final):
            continue  # it was not replaced; one that is open could not be moved, either
        try:
            replace_file(path, final)
        except OSError as error:
            in_the_way = error
    if in_the_way is not None:
        raise in_the_way
    (hidden / FRESH).unlink()
