"""Files that appear whole or not at all: written under a hidden name beside the final one, then renamed."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from warpflat.errors import InputError
from warpflat.names import checked_name

__all__ = ["atomic_path", "file_in", "hidden_beside", "prepare_folder", "require_writable"]


def file_in(folder: Path, name: str, ending: str) -> Path:
    """The file of what is called `name` in a folder: whoever names it, nothing is written elsewhere.

    Raises:
        InputError: `name` leads out of the folder, or cannot name a file for another reason.
    """
    return folder / f"{checked_name(name)}{ending}"


def hidden_beside(final: Path) -> Path:
    """A fresh hidden name in the folder of `final`, with its suffix (writers choose the format by it)."""
    return final.with_name(f".{final.stem}-{uuid.uuid4().hex[:12]}{final.suffix}")


def require_writable(final: str | os.PathLike[str]) -> None:
    """Make sure that a file of this name can be written, without leaving one.

    Raises:
        InputError: the folder is missing or cannot be written, or `final` is a folder.
    """
    final = Path(final)
    try:
        if final.is_dir():
            raise InputError(f"cannot write {final}: it is a folder; give the name of a file")
        probe = hidden_beside(final)
        probe.touch(exist_ok=False)
        probe.unlink()
    except OSError as error:
        raise _cannot_write(final, error) from error


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


def prepare_folder(path: str | os.PathLike[str]) -> Path:
    """Create the output folder, parents included, and make sure that files can be written into it.

    Raises:
        InputError: it is a file, lies below a file, or cannot be created or written.
    """
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"output folder {folder} is a file; give a folder, or a name that is not taken")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = hidden_beside(folder / "probe")
        probe.touch(exist_ok=False)
        probe.unlink()
    except OSError as error:
        raise InputError(f"output folder {folder} cannot be written: {_reason(error)}; choose another one") from error
    return folder


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()


def _cannot_write(final: Path, error: OSError) -> InputError:
    return InputError(f"cannot write {final}: {_reason(error)}; choose a folder that exists and can be written")
