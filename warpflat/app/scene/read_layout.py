"""A layout read from the texture coordinates of an OBJ file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpflat.core import FARTHEST, FloatArray, InputError
from warpflat.flat import read_mesh_file

__all__ = ["read_layout"]


def read_layout(path: Path) -> FloatArray:
    """Return the texture coordinates (`vt`) of the vertices of an OBJ file, #V by 2; not a number for those without.

    Raises:
        InputError: the file cannot be read, has no texture coordinates, or parts a vertex in the plane.
    """
    _, raw, _, _ = read_mesh_file(path, units="m", prim=None, name=None)
    if raw.texture is None or raw.notes:
        fault = raw.notes[0] if raw.notes else "has no texture coordinates"
        raise InputError(f"{path}: {fault}; a start is read from 'vt x y' and faces 'f v/vt'")
    known = (raw.polygons >= 0) & np.isfinite(raw.texture).all(axis=2)
    vertex, place = raw.polygons[known], raw.texture[known]
    if not np.abs(place).sum(axis=1).max() < FARTHEST:
        raise InputError(f"{path}: its texture coordinates reach beyond {FARTHEST:g}; 'vt x y' are in metres")
    layout = np.full((len(raw.vertices), 2), np.nan)
    layout[vertex] = place
    again = np.flatnonzero((layout[vertex] != place).any(axis=1))
    if len(again):
        raise InputError(f"{path}: vertex {vertex[again[0]]} has two texture coordinates; a start must not be cut")
    return layout
