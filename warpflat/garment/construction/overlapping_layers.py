"""Layers of cloth that lie on each other in part: told where both are kept, dropped where vertices at one place are to be joined."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from warpflat.core import BoolArray, FloatArray, InputError, IntArray, area_words, format_count
from warpflat.flat import (
    Layer,
    distinct_corners,
    flat_areas,
    half_edges,
    orient,
    outer_sheet,
    split_polygons,
)

__all__ = ["overlap_notes", "surplus_faces"]

# Layers that lie on each other over more than this [m2] are told. So many parts of a mesh, the largest, are compared.
_OVERLAP, _MOST_PARTS = 1e-4, 100


def overlap_notes(layers: Sequence[Layer], names: Sequence[str]) -> list[str]:
    """Return a note on each two layers that lie on each other in part, with the area."""
    notes = []
    for one, two in combinations(range(len(layers)), 2):
        a, b = layers[one], layers[two]
        # The finer one of both says how far it goes.
        area = max(_area_of(layer, _covered_faces(layer, other)) for layer, other in ((a, b), (b, a)))
        if area > _OVERLAP:
            notes.append(
                f"{names[one]} and {names[two]} lie on each other over {area_words(area)}: both are kept; delete one of them there, unless "
                "it is a pocket or a facing"
            )
    return notes


def surplus_faces(vertices: FloatArray, polygons: NDArray[np.int64], part: IntArray) -> tuple[BoolArray, list[str]]:
    """Return which polygons (#F) are no cloth of their own, and notes, before vertices at one place are joined.

    Of a closed part that is thick cloth these are the inner sheet and the rim, which else would be joined to those of the next; of others
    what lies on a larger part with vertices of its own.

    Args:
        vertices: #V by 3 [m].
        polygons: #F by k vertices, filled up with -1.
        part: #F, the connected part of each; -1 for those that repair drops.
    """
    given = np.flatnonzero(part >= 0)
    distinct, keep, _ = distinct_corners(polygons[given])
    given = given[keep]
    faces, of = split_polygons(vertices, distinct[keep])
    own = part[given[of]]
    single = np.ones(len(faces), dtype=bool)
    rows, layers, notes = list[NDArray[np.int64]](), list[Layer](), list[str]()
    for number in np.argsort(-np.bincount(own), kind="stable")[:_MOST_PARTS].tolist():
        row = np.flatnonzero(own == number)
        used, place = np.unique(faces[row], return_inverse=True)
        points, corners = vertices[used[used >= 0]], place.reshape(-1, 4).astype(np.int32) - np.int32(used[0] < 0)
        he = half_edges(corners)
        if (he.count == 2).all():
            with suppress(InputError):  # a one-sided part has no sides
                corners = orient(he)[0]
                if (sheet := outer_sheet(points, half_edges(corners))) is not None:
                    notes.append(sheet.describe())
                    single[row[~sheet.faces]] = False
                    row, corners = row[sheet.faces], corners[sheet.faces]
        rows.append(row)
        layers.append(Layer(points, corners))
    order = sorted(range(len(rows)), key=lambda number: -layers[number].area)
    second = np.zeros(len(faces), dtype=bool)
    for after, small in enumerate(order):
        for large in order[:after]:
            second[rows[small]] |= _covered_faces(layers[small], layers[large])
    if second.any():
        area = float(flat_areas(vertices, faces[second]).sum())
        count = format_count(len(np.unique(of[second])), "face")
        notes.append(f"{count} of {area_words(area)} dropped: a second layer that lies on another part there")
    surplus = np.zeros(len(polygons), dtype=bool)
    surplus[given] = np.bincount(of, single & ~second, minlength=len(given)) == 0.0
    return surplus, notes


def _covered_faces(layer: Layer, other: Layer) -> BoolArray:
    """Return #F, which faces of a layer lie on another one: their corners and their middles do."""
    corners = np.where(layer.faces >= 0, layer.faces, layer.faces[:, :1])
    covered: BoolArray = np.all(other.is_at(layer.vertices)[corners], axis=1)
    rows = np.flatnonzero(covered)
    middles = layer.vertices[layer.faces[rows, :3]].mean(axis=1)
    covered[rows] = other.is_at(middles)
    return covered


def _area_of(layer: Layer, chosen: BoolArray) -> float:
    """Return the area [m2] of the chosen faces (#F)."""
    return float(flat_areas(layer.vertices, layer.faces[chosen]).sum())
