"""Pictures, films and pages: a run can do without them, so none of them costs the pattern.

Whatever goes wrong while such a file is made becomes a note: one sentence on the console and under `notes` in `metrics.json`. The run
goes on, and its exit code stays. What the user must see to ends it as ever: a place that cannot be written, or a file of the user's
there. So do an interruption and a want of memory.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from warpflat.core.atomic_files import keep_note, require_writable
from warpflat.core.errors import CannotWriteError, InputError
from warpflat.core.memory_limit import is_out_of_memory
from warpflat.core.text import one_line

__all__ = ["SIGNALS", "leave_out", "listening_to_left_out", "optional_file"]

#: Called with the path of a file that was left out, and the note on it.
Listener = Callable[[Path, str], object]

#: Signals that have asked the program to end. A library may make an error of its own of one, which is no fault of a picture.
SIGNALS: list[int] = []

_listeners: ContextVar[tuple[Listener, ...]] = ContextVar("left_out", default=())


@contextmanager
def optional_file(path: str | os.PathLike[str], files: list[str], *, part: str = "") -> Iterator[Path]:
    """Make a file that the run can do without in a ``with`` block; an error in the block becomes a note, and the block ends there.

    Args:
        path: the file.
        files: its name is added to these when the block ends well.
        part: what is made, if it is only a part of the file, such as "the guide".

    Raises:
        InputError: the folder cannot be written, the disk is full, or `path` is a folder, or a file that the run has read.
    """
    path = Path(path)
    require_writable(path)
    try:
        yield path
    except Exception as error:
        if SIGNALS or isinstance(error, CannotWriteError) or is_out_of_memory(error):
            raise
        why = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
        leave_out(path, one_line(f"{part or path.name} was left out{f' of {path.name}' if part else ''}: {why}"))
    else:
        files.append(path.name)


def leave_out(path: Path, note: str) -> None:
    """Keep a note on a file that was left out, for `metrics.json` and for whoever listens."""
    keep_note(path, note)
    for listener in _listeners.get():
        listener(path, note)


@contextmanager
def listening_to_left_out(listener: Listener) -> Iterator[None]:
    """Call `listener` with each file that is left out in the block."""
    before = _listeners.set((*_listeners.get(), listener))
    try:
        yield
    finally:
        _listeners.reset(before)
