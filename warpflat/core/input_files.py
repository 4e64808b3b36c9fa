"""Input files are recorded here, so that a run never replaces one of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from warpflat.core.errors import CannotWriteError

__all__ = ["is_among", "listening_to_reads", "note_read", "noting_resolver", "refuse_to_replace"]

Listener = Callable[[Path], object]

_listeners: ContextVar[tuple[Listener, ...]] = ContextVar("readers", default=())


def note_read(path: str | os.PathLike[str]) -> None:
    """Report that a file is read; every reader of a user's file calls this first.

    Raises:
        InputError: a run that is going on would replace the file.
    """
    # Absolute, since a script may change its folder before it saves what it has read.
    file = Path(path).absolute()
    for listener in _listeners.get():
        listener(file)


@contextmanager
def listening_to_reads(listener: Listener) -> Iterator[None]:
    """Call `listener` with the path of each file that is read in the block."""
    before = _listeners.set((*_listeners.get(), listener))
    try:
        yield
    finally:
        _listeners.reset(before)


def noting_resolver(file: Path) -> Any:
    """Return a resolver for trimesh that reports the files of a mesh, such as materials, textures and buffers."""
    from trimesh.resolvers import FilePathResolver

    class Noting(FilePathResolver):
        def get(self, name: str) -> bytes:
            for place in (name.strip(), name.strip().lstrip("/"), Path(name).name):  # where trimesh looks for it
                note_read(Path(self.parent) / place)
            return bytes(super().get(name))

    return Noting(str(file))


def is_among(path: Path, files: Iterable[Path]) -> bool:
    """Return whether a path is one of these files, also by another link or, where the file system ignores it, other case."""
    return any(_is_same(path, file) for file in files)


def refuse_to_replace(final: Path, files: Iterable[Path]) -> None:
    """Refuse to write a file that was read.

    Raises:
        InputError: it is.
    """
    if is_among(final, files):
        raise CannotWriteError(
            f"{final} is read by this run, which would replace it; choose another output folder (--out) or another name"
        )


def _is_same(one: Path, other: Path) -> bool:
    try:
        return os.path.samefile(one, other)
    except (OSError, ValueError):
        return False  # one of them does not exist
