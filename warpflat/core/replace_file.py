"""Renaming a file over another one, also on Windows, where a program may have one of them open."""

from __future__ import annotations

import os
import time
from pathlib import Path

__all__ = ["is_open_elsewhere", "replace_file"]

# Windows refuses to replace a file that a program has open (access denied, sharing violation).
_OPEN_ELSEWHERE = 5, 32
# Virus scanners and indexers open new files for moments: waits between attempts [s].
_WAITS = 0.02, 0.05, 0.1, 0.2, 0.4, 0.8


def replace_file(source: Path, target: Path) -> None:
    """Rename a file over another one; on Windows wait a moment for programs that have one of them open.

    Raises:
        OSError: it cannot be renamed; :func:`is_open_elsewhere` tells whether a program still has it open.
    """
    for wait in _WAITS:
        try:
            os.replace(source, target)
            return
        except PermissionError as error:
            if not is_open_elsewhere(error):
                raise
        time.sleep(wait)
    os.replace(source, target)


def is_open_elsewhere(error: OSError) -> bool:
    """Return whether an error is that of Windows for a file that a program has open."""
    return getattr(error, "winerror", None) in _OPEN_ELSEWHERE
