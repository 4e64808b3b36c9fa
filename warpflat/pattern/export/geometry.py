"""Geometry that exporters need of a mesh: areas and lines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from warpflat.core import FloatArray, IntArray
from warpflat.flat import flat_areas, triangulate

__all__ = [
    "Polylines",
    "face_areas",
    "polylines_of",
]

Polylines = list[IntArray]


def polylines_of(lines: Mapping[str, Any] | None) -> dict[str, Polylines]:
    """Return lines by name as lists of vertex-index arrays, one per polyline; single points are dropped."""
    result: dict[str, Polylines] = {}
    for name, line in (lines or {}).items():
        single = len(line) > 0 and np.ndim(line[0]) == 0
        parts = [np.asarray(part, dtype=np.int32) for part in ([line] if single else line)]
        result[name] = [part for part in parts if len(part) > 1]
    return {name: parts for name, parts in result.items() if parts}


def face_areas(positions: FloatArray, faces: IntArray) -> FloatArray:
    """Return the area [m2] of each face (#F by 4) over positions (#V by 2 or 3); quads are split along corners 0-2."""
    triangles, face = triangulate(faces)
    areas = flat_areas(positions, triangles)
    return np.bincount(face, weights=areas, minlength=len(faces)).astype(np.float64)
