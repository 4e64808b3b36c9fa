"""A layout read from the texture coordinates of an OBJ file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from warpflat.core import FARTHEST, FloatArray, InputError, quote_value, reading

__all__ = ["read_layout"]

_CORNER = re.compile(r"(-?\d+)/(-?\d+)")


def read_layout(path: Path) -> FloatArray:
    """Return the texture coordinates (`vt`) of the vertices of an OBJ file, #V by 2; not a number for those without.

    Raises:
        InputError: the file cannot be read, has no texture coordinates, or parts a vertex in the plane.
    """
    places: list[list[float]] = []
    of_vertex: dict[int, int] = {}
    count = 0
    with reading(path, "start") as place:
        for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
            place.at = f"line {number}"
            key, _, rest = line.strip().partition(" ")
            if key == "v":
                count += 1
            elif key == "vt":
                x, y = (float(word) for word in rest.split()[:2])
                if not abs(x) + abs(y) < FARTHEST:
                    raise InputError(f"line {number}: {line.strip()[:40]!r} is not 'vt x y' in metres")
                places.append([x, y])
            elif key == "f":
                for vertex, corner in ((int(v), int(t)) for v, t in _CORNER.findall(rest)):
                    index = vertex - 1 if vertex > 0 else count + vertex
                    at = corner - 1 if corner > 0 else len(places) + corner
                    if not (0 <= index < count and 0 <= at < len(places)):
                        raise InputError(
                            f"line {number}: corner {quote_value(vertex)}/{quote_value(corner)} is not in the file"
                        )
                    before = of_vertex.setdefault(index, at)
                    if places[before] != places[at]:
                        raise InputError(
                            f"line {number}: vertex {index} has two texture coordinates; a start must not be cut"
                        )
    if not of_vertex:
        raise InputError(f"{path}: has no texture coordinates; a start is read from 'vt x y' and faces 'f v/vt'")
    layout = np.full((count, 2), np.nan)
    layout[list(of_vertex)] = np.array(places)[list(of_vertex.values())]
    return layout
