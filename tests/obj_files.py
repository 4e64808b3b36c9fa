"""OBJ files of tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["obj_text", "write_obj"]


def obj_text(
    *parts: Any, names: Sequence[str] = (), texture: Sequence[Any] = (), digits: str = ".9g", more: Sequence[str] = ()
) -> str:
    """The text of an OBJ file of several meshes.

    Args:
        parts: each with `vertices` and `faces`, or these two; a face of less than four corners ends with -1.
        names: of objects, one for each part; none for one object without a name.
        texture: for each part the texture coordinates of its vertices, #V by 2.
        digits: format of coordinates; "" for all that they have.
        more: lines at its end.
    """
    rows, before = list[str](), 1
    for number, part in enumerate(parts):
        vertices, faces = part if isinstance(part, tuple) else (part.vertices, part.faces)
        rows += [f"o {names[number]}"] if names else []
        rows += [f"v {x:{digits}} {y:{digits}} {z:{digits}}" for x, y, z in np.asarray(vertices, dtype=float).tolist()]
        if texture:
            rows += [f"vt {u} {v}" for u, v in np.asarray(texture[number], dtype=float).tolist()]
        corner = "{0}/{0}" if texture else "{0}"
        rows += ["f " + " ".join(corner.format(before + int(k)) for k in face if k >= 0) for face in faces]
        before += len(vertices)
    return "\n".join([*rows, *more, ""])


def write_obj(path: Path, *parts: Any, **options: Any) -> Path:
    """Write an OBJ file of several meshes, as :func:`obj_text` takes them; return its path."""
    path.write_text(obj_text(*parts, **options), encoding="utf-8")
    return path
