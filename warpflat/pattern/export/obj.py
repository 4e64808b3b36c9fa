"""`NAME.obj`: the 3D surface with the pattern as its texture coordinates, both in metres."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np
from numpy.typing import ArrayLike
from pydantic_core import to_json

from warpflat.core import FloatArray
from warpflat.flat import Surface
from warpflat.pattern.files.output import atomic_path

__all__ = ["write_obj"]

_ROWS_AT_ONCE = 65_536


def write_obj(
    path: str | os.PathLike[str],
    surface: Surface,
    positions: ArrayLike,
    *,
    faces: ArrayLike | None = None,
    pattern_to_surface: ArrayLike | None = None,
) -> None:
    """Write the surface (`v`, its input's vertices in their order) and the pattern (`vt`), atomically.

    Every number is written with the fewest digits that read back as the same float64. Quads stay quads. Where a cut
    doubled a vertex, `vt` is doubled and `v` is not.

    Args:
        path: the file, ``*.obj``.
        surface: the piece in space [m].
        positions: #P by 2, the pattern [m].
        faces: #F by 4, in the pattern's numbering, -1 in the last column of a triangle; the surface's own if not given.
        pattern_to_surface: #P, for each pattern vertex its vertex on the surface; each its own if not given.

    Raises:
        InputError: the file cannot be written, or the surface was read from it.
        ValueError: the arrays do not fit together.
    """
    flat = np.asarray(positions, dtype=np.float64)
    corners = np.asarray(surface.faces if faces is None else faces, dtype=np.int64)
    origin = np.arange(len(flat)) if pattern_to_surface is None else np.asarray(pattern_to_surface, dtype=np.int64)
    if flat.ndim != 2 or flat.shape[1] != 2:
        raise ValueError(f"positions must be #P by 2, not {flat.shape}")
    if corners.ndim != 2 or corners.shape[1] != 4:
        raise ValueError(f"faces must be #F by 4, not {corners.shape}")
    if origin.shape != (len(flat),):
        raise ValueError(f"pattern_to_surface must hold {len(flat)} indices, one per position, not {origin.shape}")
    if corners.size and (corners.max() >= len(flat) or corners[:, :3].min() < 0):
        raise ValueError(f"faces refer to vertices beyond the {len(flat)} positions")
    if origin.size and (origin.max() >= len(surface.vertices) or origin.min() < 0):
        raise ValueError(f"pattern_to_surface refers to vertices beyond the {len(surface.vertices)} of the surface")
    in_input = np.asarray(surface.input_index, dtype=np.int64)[origin]
    with atomic_path(path, sources=surface.sources) as temporary, temporary.open("wb") as file:
        name = " ".join(surface.name.split())
        file.write(f"# warpflat: v = surface [m], vt = pattern [m], not normalised\no {name}\n".encode())
        _write_rows(file, b"v", np.asarray(surface.input_vertices, dtype=np.float64))
        _write_rows(file, b"vt", flat)
        # Faces are pairs of vertex and texture coordinate.
        for part in _chunks(len(corners)):
            block = corners[part]
            used = block >= 0
            pairs = np.stack([in_input[np.where(used, block, 0)] + 1, block + 1], axis=-1)
            rows = np.where(used[:, 3], "f %d/%d %d/%d %d/%d %d/%d\n", "f %d/%d %d/%d %d/%d\n")
            file.write(("".join(rows.tolist()) % tuple(pairs[used].ravel().tolist())).encode())


def _chunks(count: int) -> Iterator[slice]:
    """Return slices over rows, a chunk at a time."""
    return (slice(start, start + _ROWS_AT_ONCE) for start in range(0, count, _ROWS_AT_ONCE))


def _write_rows(file: BinaryIO, key: bytes, values: FloatArray) -> None:
    """Write one row of numbers per line, after a key."""
    for part in _chunks(len(values)):
        # Pydantic's JSON has the shortest digits that read back as the same number, three times as fast as Python's.
        rows = to_json(values[part].tolist(), inf_nan_mode="constants")[2:-2]
        file.write(key + b" " + rows.replace(b"],[", b"\n" + key + b" ").replace(b",", b" ") + b"\n")
