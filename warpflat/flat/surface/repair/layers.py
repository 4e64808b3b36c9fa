"""Layers of cloth that lie on each other: a second copy of a part, or the inner sheet of thick cloth, which are no pieces of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.text import area_words, format_count
from warpflat.flat.surface.closest import nearest_on_triangles
from warpflat.flat.surface.normals import flat_areas
from warpflat.flat.surface.repair.sheets import inner_sheets
from warpflat.flat.surface.triangles import triangulate

__all__ = [
    "Layer",
    "doubled_layers",
    "lies_within",
    "surplus_layers",
]

# Layers nowhere further apart than this [m] are one: thinner than any cloth.
_SAME_LAYER = 5e-5
# Areas of one layer in two meshes agree within this share.
_SAME_AREA = 0.02
# Triangles that are tried as the nearest to a point, by their middles.
_TRIED = 24


@dataclass(frozen=True, eq=False)
class Layer:
    """One connected part: its vertices (#V by 3 [m]), all in use, and its faces (#F by 4)."""

    vertices: FloatArray
    faces: IntArray

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.vertices)

    @property
    def corners(self) -> FloatArray:
        """#T by 3 by 3, the corners of its triangles [m]."""
        return self.vertices[triangulate(self.faces)[0]]

    @property
    def area(self) -> float:
        """Area [m2]."""
        return float(flat_areas(self.vertices, triangulate(self.faces)[0]).sum())

    @cached_property
    def _near(self) -> Any:
        """Its corners (#T by 3 by 3 [m]), a search tree of the middles of its triangles, and how far their corners reach at most [m]."""
        from scipy.spatial import cKDTree

        corners = self.corners
        middles = corners.mean(axis=1)
        reach = float(np.linalg.norm(corners - middles[:, None], axis=2).max(initial=0.0))
        return corners, cKDTree(middles), reach

    def is_at(self, points: FloatArray, distance: float = _SAME_LAYER) -> BoolArray:
        """Return which points (#P by 3 [m]) lie within a distance [m] of it, else on it; some that do may count as further off."""
        found = (
            (points >= self.vertices.min(axis=0) - distance) & (points <= self.vertices.max(axis=0) + distance)
        ).all(axis=1)
        left = np.flatnonzero(found)
        found[left] = False
        if not len(left):
            return np.asarray(found)
        corners, tree, reach = self._near
        left = left[np.isfinite(tree.query(points[left], distance_upper_bound=reach + distance)[0])]
        if not len(left):
            return np.asarray(found)
        tried = np.asarray(tree.query(points[left], k=min(_TRIED, len(corners)))[1]).reshape(len(left), -1)
        for column in tried.T:
            open_ = ~found[left]
            at, triangles = left[open_], corners[column[open_]]
            place = np.einsum("tc,tcx->tx", nearest_on_triangles(triangles, points[at]), triangles)
            found[at] = np.linalg.norm(place - points[at], axis=1) <= distance
        return np.asarray(found)

    def describe(self) -> str:
        """Return how many faces of which area it has, in words."""
        return f"{format_count(len(self.faces), 'face')} of {area_words(self.area)}"

    def vertices_at(self, points: FloatArray, distance: float) -> tuple[IntArray, BoolArray]:
        """Return the nearest vertex to each point (#P by 3 [m]), and whether it lies within a distance [m]."""
        far, nearest = self._tree.query(points)
        return np.asarray(nearest, dtype=np.int32), np.asarray(far <= distance)


def surplus_layers(layers: Sequence[Layer], names: Sequence[str] | None = None) -> dict[int, str]:
    """Return the layers that are no cloth of their own, each with a sentence on what it is.

    Args:
        layers: connected parts, their faces wound alike.
        names: of the layers; without them a layer lies on "another part".
    """

    def name(number: int) -> str:
        return names[number] if names else "another part"

    told = {
        number: f"{layers[number].describe()}{f' of {name(number)}' if names else ''} dropped: a second layer that lies on "
        f"{name(other)}{' everywhere' if names else ''}"
        for number, other in doubled_layers(layers).items()
    }
    rest = [number for number in range(len(layers)) if number not in told]
    for row, (of, thickness) in inner_sheets([(layers[k].vertices, layers[k].faces) for k in rest]).items():
        number, other = rest[row], rest[of]
        told[number] = (
            f"cloth drawn {1e3 * thickness:.2g} mm thick: its outer sheet{f', {name(other)},' if names else ''} was taken, the inner "
            f"one or the rim ({f'{name(number)}, ' if names else ''}{layers[number].describe()}) left out"
        )
    return told


def doubled_layers(layers: Sequence[Layer]) -> dict[int, int]:
    """Return the layers that lie on another one everywhere, each with that one.

    A layer is doubled if each of its faces is one of the other's, or if both cover each other. The first of two that cover each other
    stays.
    """
    lower, upper = (np.array([bound(layer.vertices, axis=0) for layer in layers]) for bound in (np.min, np.max))
    doubled: dict[int, int] = {}
    for number, layer in enumerate(layers):
        inside = (lower[number] >= lower - _SAME_LAYER) & (upper[number] <= upper + _SAME_LAYER)
        for other in np.flatnonzero(inside.all(axis=1)).tolist():
            if other == number or other in doubled:
                continue
            whole = layers[other]
            fewer = len(layer.faces) < len(whole.faces)
            if ((other < number or fewer) and _has_faces(whole, layer)) or (
                other < number
                and abs(whole.area - layer.area) <= _SAME_AREA * max(whole.area, layer.area)
                and lies_within(whole, layer, _SAME_LAYER)
                and lies_within(layer, whole, _SAME_LAYER)
            ):
                doubled[number] = other
                break
    return doubled


def lies_within(layer: Layer, other: Layer, distance: float) -> bool:
    """Return whether each vertex of a layer is within a distance [m] of another one; some that are may count as further off."""
    if other.vertices_at(layer.vertices, distance)[1].all():
        return True
    return bool(other.is_at(layer.vertices, distance).all())


def _has_faces(whole: Layer, part: Layer) -> bool:
    place, near = whole.vertices_at(part.vertices, _SAME_LAYER)
    if not near.all():
        return False
    known = {tuple(sorted(face)) for face in whole.faces.tolist()}
    return all(tuple(sorted(face)) in known for face in np.where(part.faces >= 0, place[part.faces], -1).tolist())
