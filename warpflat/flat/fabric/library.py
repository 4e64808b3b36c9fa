"""The library of fabrics: the shipped ones, and those of a user's files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path

from warpflat.core.errors import InputError, expect
from warpflat.flat.fabric.fabric import (
    DEFAULT_FABRIC,
    Fabric,
    fabric_called,
)

__all__ = ["as_fabric", "find_fabric", "load_library"]


def load_library(extra_files: Iterable[str | Path] = ()) -> dict[str, Fabric]:
    """Return the fabrics that ship with the package, and those of further files.

    Args:
        extra_files: TOML files in the format of ``data/fabrics.toml``; a later one replaces one of the same name.

    Returns:
        Fabrics by name, in the files' order.

    Raises:
        InputError: a file cannot be read, or has an unknown key or an impossible value.
    """
    from warpflat.flat.fabric.file import read_fabrics, read_shipped_fabrics

    if isinstance(extra_files, (str, PathLike)) or not isinstance(extra_files, Iterable):
        raise InputError(
            f"extra_files is of type {type(extra_files).__name__}; it must be a list of the paths of files"
        )
    library = read_shipped_fabrics()
    for path in extra_files:
        expect(path, (str, PathLike), "a path in extra_files", "a str or Path")
        library.update(read_fabrics(Path(path), library))
    return library


def find_fabric(name: str, library: Mapping[str, Fabric] | None = None) -> Fabric:
    """Return the fabric of that name or alias; case, spaces and underscores do not matter.

    Raises:
        InputError: there is none; names the nearest.
    """
    expect(name, str, "name", f"that of a fabric, such as {DEFAULT_FABRIC!r}")
    return fabric_called(name, load_library() if library is None else library)


def as_fabric(fabric: Fabric | str) -> Fabric:
    """Return a fabric, or the one of the library of that name.

    Raises:
        InputError: there is none of that name, or it is neither.
    """
    if isinstance(fabric, Fabric):
        return fabric
    if not isinstance(fabric, str):
        raise InputError(f"fabric {fabric!r} is neither a Fabric nor the name of one, such as {DEFAULT_FABRIC!r}")
    return find_fabric(fabric)
