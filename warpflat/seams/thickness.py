"""Cloth that is turned inside at an opening: drawn thickness, which is no cloth to be cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpflat.core.arrays import BoolArray
from warpflat.core.text import format_count
from warpflat.seams.cloth import Cloth

__all__ = ["without_thickness"]

# A layer of faces around an opening is turned inside if it faces its middle by this (mean cosine), and outside from the second on.
_INSIDE, _OUTSIDE = -0.25, 0.35
# So is a first layer that lies across the opening, no wider than this share, if the next one stands up from it.
_ACROSS, _RIM, _UPRIGHT = 0.9, 0.025, 0.85
# Turned cloth is no wider than this share of the square root of the area.
_WIDEST = 0.15
# What takes more than this share of a piece that the user has drawn is that piece, as a waistband, and is worn as it lies.
_PIECE = 0.5
# An opening is level from this on (its area over that of a circle as long).
_LEVEL = 0.4


def without_thickness(cloth: Cloth) -> tuple[Cloth, list[str]]:
    """Return the cloth without what is turned inside at its openings, and a note if there was any."""
    size = float(np.sqrt(cloth.face_areas.sum()))
    drop = np.zeros(len(cloth.faces), dtype=bool)
    openings, areas, part = 0, cloth.face_areas, cloth.parts()
    piece = np.bincount(part, areas)
    for loop in cloth.borders():
        points = cloth.vertices[loop]
        following, middle = np.roll(points, -1, axis=0), points.mean(axis=0)
        area = 0.5 * np.cross(points - middle, following - middle).sum(axis=0)
        length = float(np.linalg.norm(following - points, axis=1).sum())
        if length < 0.06 * size or np.linalg.norm(area) < _LEVEL * length**2 / (4 * np.pi):
            continue
        turned = _turned(cloth, loop, area / np.linalg.norm(area), size)
        if turned is not None and (np.bincount(part, areas * turned) <= _PIECE * piece).all():
            drop |= turned
            openings += 1
    if not openings or drop.mean() > 0.5:
        return cloth, []
    kept = replace(cloth, faces=cloth.faces[~drop])
    part = replace(kept, seams={}).parts()
    kept = replace(kept, faces=kept.faces[part == np.bincount(part).argmax()])
    used, place = np.unique(kept.faces, return_inverse=True)
    area_out = 1e4 * float(cloth.face_areas[drop].sum())
    number = np.full(len(cloth.vertices), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    seams = {name: number[edges] for name, edges in cloth.seams.items()}
    made = Cloth(
        vertices=cloth.vertices[used],
        faces=place.reshape(-1, 3).astype(np.int64),
        seams={name: edges[(edges >= 0).all(axis=1)] for name, edges in seams.items()},
    )
    return made, [
        f"cloth turned inside at {format_count(openings, 'opening')} ({area_out:.0f} cm2) left out: it is drawn thickness"
    ]


def _turned(cloth: Cloth, loop: np.ndarray, axis: np.ndarray, size: float) -> BoolArray | None:
    """Return #F, the faces turned inside around one opening; None if there are none."""
    normals, middles = cloth.face_normals, cloth.vertices[cloth.faces].mean(axis=1)
    areas = cloth.face_areas
    reached = np.zeros(len(cloth.vertices), dtype=bool)
    reached[loop] = True
    taken = np.zeros(len(cloth.faces), dtype=bool)
    turned, last, width = False, np.zeros(len(cloth.faces), dtype=bool), 0.0
    rim: BoolArray | None = None
    ring = cloth.vertices[loop].mean(axis=0)
    around = float(np.linalg.norm(np.diff(cloth.vertices[np.append(loop, loop[0])], axis=0), axis=1).sum())
    for _ in range(40):
        layer = reached[cloth.faces].any(axis=1) & ~taken
        if not layer.any():
            return None
        weight = areas[layer]
        radial = middles[layer] - ring
        radial -= (radial @ axis)[:, None] * axis
        radial /= np.maximum(np.linalg.norm(radial, axis=1, keepdims=True), 1e-300)
        facing = float((np.einsum("ij,ij->i", normals[layer], radial) * weight).sum() / max(weight.sum(), 1e-300))
        if rim is not None:
            return rim if facing > _UPRIGHT else None
        across = abs(float(((normals[layer] @ axis) * weight).sum())) / max(float(weight.sum()), 1e-300)
        lies_across = _INSIDE <= facing < _OUTSIDE and across > _ACROSS
        if not turned and lies_across and weight.sum() < _RIM * size * around:
            rim = layer.copy()
        elif facing >= _OUTSIDE or (not turned and facing >= _INSIDE):
            break
        turned |= facing < _INSIDE
        taken |= layer
        last = taken.copy()
        width += float(weight.sum()) / max(around, 1e-300)
        if width > _WIDEST * size:
            return None
        new = np.unique(cloth.faces[layer])
        new = new[~reached[new]]
        if len(new) == 0:
            return None
        reached[new] = True
        ring = cloth.vertices[new].mean(axis=0)
    return last if turned else None
