"""A mesh as any format gives it: what all readers return, before it is checked and repaired.

The process that reads a USD file loads this module, which therefore brings no Warp with it.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray

__all__ = ["ALL_PRIMS", "RawMesh", "following_corners", "line_name", "numbered", "objects_in_turn"]

#: Stands for all mesh prims of a stage, or all nodes of a scene.
ALL_PRIMS = "*"


@dataclass(kw_only=True)
class RawMesh:
    """A mesh of a file.

    Attributes:
        vertices: #V by 3, in the file's unit.
        polygons: #F by the largest corner count, filled up with -1.
        scale: metres per unit, None where the file does not say.
        split_corners: whether the format has one vertex per corner of a face, or per texture coordinate.
        name: of the mesh in the file.
        curves: #P by 3 by name; `chains`: vertices by name.
        notes: one sentence each.
        objects: objects, nodes or prims as (first vertex, name), in their order, and #F, the one of each face; None where the format
            knows none.
        marked: rows of vertices without a name: creases of USD, edge elements of PLY.
        texture: #F by k by 2, texture coordinates at the corners, nan where there are none; None if the file has none.
        face_material, face_group: #F, a number for the material of each face, and for its group, object, node or subset, each with
            their names; None where the format knows none.
    """

    vertices: FloatArray
    polygons: NDArray[np.int64]
    scale: float | None = None
    split_corners: bool = False
    name: str | None = None
    curves: dict[str, FloatArray] = field(default_factory=dict)
    chains: dict[str, NDArray[np.int64]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    objects: tuple[list[tuple[int, str]], NDArray[np.int64]] | None = None
    marked: list[NDArray[np.int64]] = field(default_factory=list)
    texture: FloatArray | None = None
    face_material: tuple[NDArray[np.int64], tuple[str, ...]] | None = None
    face_group: tuple[NDArray[np.int64], tuple[str, ...]] | None = None


def numbered(names: Sequence[str]) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    """Return a number for each name, from 0 in their order, and the names."""
    number = {name: k for k, name in enumerate(dict.fromkeys(names))}
    return np.fromiter(map(number.__getitem__, names), dtype=np.int64, count=len(names)), tuple(number)


def line_name(name: str, number: int, count: int, taken: Container[str]) -> str:
    """Return the name of the line of a number, from 1, among `count` of one name in a file; with "_" behind it where it is taken."""
    found = name if count == 1 else f"{name}_{number}"
    while found in taken:
        found += "_"
    return found


def objects_in_turn(
    names: Sequence[str], first: Sequence[int], polygons: NDArray[np.int64]
) -> tuple[list[tuple[int, str]], NDArray[np.int64]]:
    """Return `RawMesh.objects` of objects whose vertices follow each other, the first vertex of each given."""
    of = np.searchsorted(np.array(first, dtype=np.int64), polygons[:, 0], side="right") - 1
    return list(zip(first, names, strict=True)), np.maximum(of, 0)


def following_corners(polygons: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the column of the corner that follows each one around its polygon (#F by k, filled up with -1)."""
    after = np.arange(1, polygons.shape[1] + 1)[None, :]
    return np.where(after < (polygons >= 0).sum(axis=1)[:, None], after, 0)
