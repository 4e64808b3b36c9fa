"""Cloth that is turned inside at an opening: drawn thickness, which is no cloth to be cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from warpflat.core import BoolArray, format_count, unit
from warpflat.flat import join_labels
from warpflat.garment.seams.anatomy import HOLE, RING, Border
from warpflat.garment.seams.cloth import BESIDE_LINE, Cloth

__all__ = ["even_line", "without_thickness"]

# A layer of faces around an opening is turned inside if it faces its middle by this (mean cosine), and outside from the second on.
_INSIDE, _OUTSIDE = -0.25, 0.35
# So is a first layer that lies across the opening, no wider than this share, if the next one stands up from it: both by this (mean cosine).
_RIM, _SQUARE = 0.025, 0.85
# Turned cloth is no wider than this share of the square root of the area.
_WIDEST = 0.15
# What takes more than this share of a piece that the user has drawn is that piece, as a waistband, and is worn as it lies.
_PIECE = 0.5
# The line where it ends is evened over this share of the garment's size; one that strays from it by no more than the second is even.
_EVEN, _RAGGED = 0.03, 0.004


def without_thickness(cloth: Cloth) -> tuple[Cloth, list[str]]:
    """Return the cloth without what is turned inside at its openings, and a note if there was any."""
    size = cloth.size
    drop = np.zeros(len(cloth.faces), dtype=bool)
    openings, areas, part = 0, cloth.face_areas, cloth.parts
    piece = np.bincount(part, areas)
    for loop in cloth.loops:
        border = Border.measured(cloth.vertices, loop)
        if border.length < HOLE * size or np.linalg.norm(border.normal) < RING:
            continue
        turned = _turned(cloth, border, size)
        if turned is not None and (np.bincount(part, areas * turned) <= _PIECE * piece).all():
            drop |= turned
            openings += 1
    if not openings or drop.mean() > 0.5:
        return cloth, []
    cloth, drop = even_line(cloth, drop, size)
    area_out = 1e4 * float(cloth.face_areas[drop].sum())
    kept = cloth.only(~drop)
    part = replace(kept, seams={}).parts
    return kept.only(part == np.bincount(part).argmax()), [
        f"cloth turned inside at {format_count(openings, 'opening')} ({area_out:.0f} cm2) left out: it is drawn thickness"
    ]


def even_line(cloth: Cloth, drop: BoolArray, size: float) -> tuple[Cloth, BoolArray]:
    """Return the cloth split along an even line where some of its faces end, and #F, those beyond it.

    They are found layer by layer, and the mesh's own edges between them and the others are ragged. The line is where the distance from
    these edges, negative beyond them, is zero when it is smoothed.
    """
    among, others = (np.isin(np.arange(len(cloth.vertices)), cloth.faces[chosen]) for chosen in (drop, ~drop))
    rim = np.flatnonzero(among & others)
    away, nearest = cKDTree(cloth.vertices[rim]).query(cloth.vertices)
    away *= np.where(others, 1.0, -1.0)
    level = cloth.smooth(away, _EVEN * size)
    # A strip is narrower than what smoothing reaches: each line is shifted back to where it was in the mean.
    ring = cloth.faces[drop]
    own = join_labels(len(cloth.vertices), ring[:, [0, 1]].ravel(), ring[:, [1, 2]].ravel())[rim]
    shift = np.bincount(own, level[rim]) / np.maximum(np.bincount(own), 1)
    level -= shift[own[nearest]]
    stray = np.zeros(len(shift))
    np.maximum.at(stray, own, np.abs(level[rim]))
    ragged = stray > _RAGGED * size
    if not ragged.any():
        return cloth, drop
    near = ((np.abs(away) < BESIDE_LINE * size) & ragged[own[nearest]])[cloth.faces].any(axis=1)
    marked = replace(cloth, values={"turned": level}, labels={"turned": drop.astype(np.int64)})
    made, outside, near = marked.split("turned", near)
    dropped = np.where(near, ~outside, made.labels["turned"] > 0)
    return replace(made, values={}, labels={}), dropped


def _turned(cloth: Cloth, border: Border, size: float) -> BoolArray | None:
    """Return #F, the faces turned inside around one opening; None if there are none."""
    normals, middles = cloth.face_normals, cloth.vertices[cloth.faces].mean(axis=1)
    areas, loop, axis = cloth.face_areas, border.vertices, unit(border.normal)
    reached = np.zeros(len(cloth.vertices), dtype=bool)
    reached[loop] = True
    taken = np.zeros(len(cloth.faces), dtype=bool)
    turned, width = False, 0.0
    rim: BoolArray | None = None
    ring = cloth.vertices[loop].mean(axis=0)
    for _ in range(40):
        layer = reached[cloth.faces].any(axis=1) & ~taken
        if not layer.any():
            return None
        weight = areas[layer]
        radial = middles[layer] - ring
        radial = unit(radial - (radial @ axis)[:, None] * axis)
        facing = float((np.einsum("ij,ij->i", normals[layer], radial) * weight).sum() / max(weight.sum(), 1e-300))
        if rim is not None:
            return rim if facing > _SQUARE else None
        across = abs(float(((normals[layer] @ axis) * weight).sum())) / max(float(weight.sum()), 1e-300)
        lies_across = _INSIDE <= facing < _OUTSIDE and across > _SQUARE
        if not turned and lies_across and weight.sum() < _RIM * size * border.length:
            rim = layer
        elif facing >= _OUTSIDE or (not turned and facing >= _INSIDE):
            break
        turned |= facing < _INSIDE
        taken |= layer
        width += float(weight.sum()) / max(border.length, 1e-300)
        if width > _WIDEST * size:
            return None
        new = np.unique(cloth.faces[layer])
        new = new[~reached[new]]
        if len(new) == 0:
            return None
        reached[new] = True
        ring = cloth.vertices[new].mean(axis=0)
    return taken if turned else None
