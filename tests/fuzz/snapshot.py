"""What lies in a folder, to compare it before and after."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["snapshot"]


def snapshot(root: Path) -> dict[str, bytes | None]:
    """Every file below a folder with its content, every link with its target, and every folder or pipe with None."""
    found: dict[str, bytes | None] = {}
    for folder, folders, files in os.walk(os.fsencode(root)):
        for entry in folders + files:
            path = os.path.join(folder, entry)
            name = os.fsdecode(os.path.relpath(path, os.fsencode(root)))
            if os.path.islink(path):
                found[name] = b"link to " + os.readlink(path)
            elif os.path.isfile(path):
                found[name] = Path(os.fsdecode(path)).read_bytes()
            else:
                found[name] = None
    return found
