"""The door for all that is read: each file is recorded, so that a run never replaces it, bounded, and read under one guard.

What is read of a run's folder is a regular file, too: links, pipes and devices are refused there.
"""

from __future__ import annotations

import difflib
import hashlib
import json
import os
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from warpflat.core.errors import InputError, system_reason
from warpflat.core.file_kinds import foreign_words
from warpflat.core.memory_limit import is_out_of_memory, memory_limit
from warpflat.core.text import control_in, one_line, quote_value

__all__ = [
    "FARTHEST",
    "FORMATS",
    "RIGHT_NUMBER",
    "FileFormat",
    "Place",
    "check_regular",
    "check_values",
    "file_digest",
    "guarded",
    "listening_to_reads",
    "note_read",
    "noting_resolver",
    "open_file",
    "read_json",
    "read_result",
    "reading",
]

Listener = Callable[[Path], object]


@dataclass(frozen=True)
class FileFormat:
    """What is read of a format.

    Attributes:
        name: as messages have it, with its article.
        most: the size of a file [bytes], at most; what it is read into takes some five times as much.
        right: what would be right, where a file cannot be read.
        links: whether it may be a link; in a folder of a run none may.
    """

    name: str
    most: int
    right: str
    links: bool = True


_MEGABYTE = 1_000_000
#: The formats that are read, by their names for `reading`.
FORMATS: Mapping[str, FileFormat] = {
    "TOML": FileFormat("TOML", 4 * _MEGABYTE, "give a text file in TOML"),
    "JSON": FileFormat("JSON", 200 * _MEGABYTE, "run the scene again"),
    "DXF": FileFormat("a DXF pattern", 50 * _MEGABYTE, "export it again as DXF R12, outlines as closed polylines"),
    "SVG": FileFormat("an SVG pattern", 20 * _MEGABYTE, "export it again as plain SVG, outlines as closed paths"),
    "pattern": FileFormat("a pattern", 50 * _MEGABYTE, "export it again from the program that made it"),
    "mesh": FileFormat("a mesh", 500 * _MEGABYTE, "export it again with vertices and faces alone"),
    "edges": FileFormat(
        "a list of edges", 50 * _MEGABYTE, "give the numbers of a row of vertices in each line, or JSON lists"
    ),
    "piece": FileFormat("a piece of a run", 500 * _MEGABYTE, "run the scene again"),
    "picture": FileFormat("a picture of a run", 200 * _MEGABYTE, "run the scene again"),
    "film": FileFormat("the film of a run", 4000 * _MEGABYTE, "run the scene again"),
    "named": FileFormat("a file that a scene names", 4000 * _MEGABYTE, "give a regular file"),
    "report": FileFormat("JSON", 200 * _MEGABYTE, "run the scene again", links=False),
    "output": FileFormat("a file of a run", 4000 * _MEGABYTE, "run the scene again", links=False),
}
#: No coordinate of a surface or a pattern is larger [m].
FARTHEST = 1e4
# Tables and lists of a file lie in at most so many others.
_DEEPEST = 50
# Texts of several lines may have these; what reads a name refuses them.
_BLANKS = "\t\n\r"
#: What a message says of a whole number that is too large.
RIGHT_NUMBER = "a whole number is written in 64 bits, up to 9223372036854775807"
# Letters of a library's words that a message quotes.
_LONGEST_REASON = 120


@dataclass
class Place:
    """Where in a file its reader is.

    Attributes:
        at: in words, such as "line 3"; a message about the file begins with it.
    """

    at: str = ""


@contextmanager
def reading(
    path: str | os.PathLike[str], kind: str, *, missing: str = "no such file", noted: bool = True
) -> Iterator[Place]:
    """Guard the reading of a file that others made: whatever goes wrong in the block is one line about the file.

    The file is reported as by :func:`note_read`, and must be as :func:`check_regular` asks. A reader that knows where it is says so in
    the `Place` that is yielded. Errors of input that the block raises are passed on, with the file's name before them.

    Args:
        path: of the file.
        kind: a key of `FORMATS`.
        missing: what is said where there is no such file.
        noted: whether it is reported; not what a run reads of its own folder.

    Raises:
        InputError: the file cannot be read, for whatever reason.
    """
    file = Path(path)
    if noted:
        note_read(file)
    with guarded(file, kind, missing=missing) as place:
        check_regular(file, FORMATS[kind].most, links=FORMATS[kind].links)
        if foreign := foreign_words(file):
            raise InputError(foreign)
        yield place


@contextmanager
def guarded(file: Path, kind: str, *, missing: str = "no such file") -> Iterator[Place]:
    """Guard what is done with the content of a file that has been read, or of a folder: see :func:`reading`.

    Raises:
        InputError: whatever went wrong.
    """
    import numpy as np

    form, place = FORMATS[kind], Place()
    try:
        with np.errstate(all="ignore"):  # what is no number is refused where it is checked, not warned of on the way
            yield place
    except InputError as error:
        message = str(error)
        # An error that already names a file, this one or one beside it, names no second one.
        named = str(file), f"{file.parent}{os.sep}"
        for before in (place.at, str(file)):
            message = message if message.startswith((before, *named)) else f"{before}: {message}"
        raise InputError(message) from error
    except FileNotFoundError as error:
        if error.filename is not None and Path(error.filename) != file:
            raise InputError(f"{file}: needs {error.filename}, which is missing") from None
        similar = list[str]()
        with suppress(OSError, ValueError):
            names = [entry.name for entry in file.parent.iterdir()]
            similar = difflib.get_close_matches(file.name, names, n=1, cutoff=0.7)
        hint = f"; did you mean {similar[0]!r}?" if similar else ""
        raise InputError(f"{file}: {missing}{hint}") from None
    except Exception as error:
        at = f"{place.at}: " if place.at else ""
        if is_out_of_memory(error):
            message = ", ".join(filter(None, ["not enough memory to read it", memory_limit()]))
            raise InputError(f"{file}: {at}{message}; give a smaller file, or more memory") from error
        if isinstance(error, OSError):
            raise InputError(f"{file}: {at}cannot be read: {system_reason(error)}") from error
        reason = "nested too deeply" if isinstance(error, RecursionError) else one_line(str(error))[:_LONGEST_REASON]
        if isinstance(error, LookupError) or not reason:
            # A missing key's only word is the key.
            reason = f"{type(error).__name__} {reason}".strip()
        raise InputError(f"{file}: {at}cannot be read as {form.name} ({reason}); {form.right}") from error


def check_regular(path: Path | int, most: int, *, links: bool = True) -> None:
    """Check that a path is that of a regular file of bounded size: a pipe would be waited for, and a device never ends.

    Args:
        path: of the file, or the number of one that is open.
        most: bytes that it may have.
        links: whether it may be a link to such a file.

    Raises:
        InputError: without the file's name: it is something else, or larger.
        OSError: there is no such file.
    """
    try:
        found = os.stat(path, follow_symlinks=links)
    except ValueError as error:  # a name with NUL in it
        raise InputError(f"cannot be read: {error}") from None
    if not links and not stat.S_ISREG(found.st_mode):
        raise InputError("is a link, a folder, a pipe or a device; a run leaves regular files, put one in its place")
    if stat.S_ISDIR(found.st_mode):
        raise InputError("is a directory; give the name of a file")
    if not stat.S_ISREG(found.st_mode):
        raise InputError("is a pipe or a device; give a regular file")
    if found.st_size > most:
        raise InputError(
            f"has {found.st_size / _MEGABYTE:,.0f} MB; at most {most / _MEGABYTE:,.0f} MB are read of this kind of file"
        )


def open_file(path: Path, kind: str = "output", *, most: int | None = None, missing: str = "no such file") -> BinaryIO:
    """Open a file as :func:`check_regular` asks, whatever takes its place meanwhile; it is not reported as read.

    Args:
        path: of the file.
        kind: a key of `FORMATS`.
        most: bytes that it may have, if not those of its format.
        missing: what is said where there is no such file.

    Raises:
        InputError: it is missing, something else, larger, or cannot be read.
    """
    form = FORMATS[kind]
    most = form.most if most is None else most
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    with guarded(path, kind, missing=missing):
        check_regular(path, most, links=form.links)
        stream = os.fdopen(os.open(path, flags if form.links else flags | getattr(os, "O_NOFOLLOW", 0)), "rb")
        try:
            check_regular(stream.fileno(), most)
        except InputError:
            stream.close()
            raise
        return stream


def file_digest(path: Path, kind: str = "output", *, missing: str = "no such file") -> str:
    """Return the SHA-256 of a file.

    Raises:
        InputError: as :func:`open_file`.
    """
    digest = hashlib.sha256()
    with open_file(path, kind, missing=missing) as stream, guarded(path, kind):
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def read_json(path: Path, *, missing: str = "no such file") -> Any:
    """Read the data of a file in JSON, which is reported as by :func:`note_read`.

    Raises:
        InputError: as :func:`open_file`, or it is no JSON, or is nested too deeply.
    """
    note_read(path)
    return _parse_json(path, "JSON", missing)


def read_result(path: Path) -> Any:
    """Read a file in JSON of a folder of results, which is not reported: the next run may replace it.

    Raises:
        InputError: as :func:`read_json`, or it is a link.
    """
    return _parse_json(path, "report", "no such file; give the folder of a run")


def _parse_json(path: Path, kind: str, missing: str) -> Any:
    with open_file(path, kind, missing=missing) as stream, guarded(path, kind):
        try:
            data = json.loads(stream.read().decode("utf-8-sig"))
        except json.JSONDecodeError as error:
            right = (
                FORMATS[kind].right
                if kind == "report"
                else "comments and commas before a bracket are none; write it again"
            )
            raise InputError(f"line {error.lineno}, column {error.colno}: is no JSON ({error.msg}); {right}") from None
        check_values(data, depth_only=True)
    return data


def check_values(data: Any, *, depth_only: bool = False) -> None:
    """Check data of a file: tables are not nested too deeply, whole numbers fit into 64 bits, texts have no control characters.

    Args:
        data: tables, lists, numbers and texts.
        depth_only: whether only the nesting is checked.

    Raises:
        InputError: without the file's name: the first that is not.
    """
    todo: list[tuple[str, int, Any]] = [("", 0, data)]
    for key, depth, value in todo:
        where = f"{key}: " if key else ""
        if depth > _DEEPEST:
            raise InputError(f"{where}nested too deeply; tables and lists may lie in at most {_DEEPEST} others")
        if isinstance(value, dict):
            for name, below in value.items():
                inner = f"{key}.{name}" if key else name
                if not depth_only and (letter := control_in(name, _BLANKS)):
                    raise InputError(f"{inner}: the key has the control character {letter!r} in it; leave it out")
                todo.append((inner, depth + 1, below))
        elif isinstance(value, list):
            todo += [(key, depth + 1, below) for below in value]
        elif depth_only:
            continue
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:
            raise InputError(f"{where}{quote_value(value)} is too large; {RIGHT_NUMBER}")
        elif isinstance(value, str) and (letter := control_in(value, _BLANKS)):
            raise InputError(f"{where}{quote_value(value)} has the control character {letter!r} in it; leave it out")


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
                if (Path(self.parent) / place).exists():
                    check_regular(Path(self.parent) / place, FORMATS["mesh"].most)
            return bytes(super().get(name))

    return Noting(str(file))
