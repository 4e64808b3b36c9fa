"""What a run leaves behind: USD frames, OBJ, pictures, metrics. Each exporter is imported when it is first used."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warpflat.export.atomic import (
        atomic_path,
        expect_files,
        file_in,
        output_folder,
        prepare_folder,
        require_writable,
    )
    from warpflat.export.metrics import write_json
    from warpflat.export.obj import write_obj
    from warpflat.export.picture import PicturePiece, write_picture
    from warpflat.export.usd import FrameWriter
    from warpflat.export.usd_validation import validate_usd

__all__ = [
    "FrameWriter",
    "PicturePiece",
    "atomic_path",
    "expect_files",
    "file_in",
    "output_folder",
    "prepare_folder",
    "require_writable",
    "validate_usd",
    "write_json",
    "write_obj",
    "write_picture",
]

_HOME = {
    "FrameWriter": "usd",
    "PicturePiece": "picture",
    "atomic_path": "atomic",
    "expect_files": "atomic",
    "file_in": "atomic",
    "output_folder": "atomic",
    "prepare_folder": "atomic",
    "require_writable": "atomic",
    "validate_usd": "usd_validation",
    "write_json": "metrics",
    "write_obj": "obj",
    "write_picture": "picture",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
