"""A garment that is nearly its own mirror image is made so: its two sides are averaged, and its seams drawn once and mirrored."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.seams.anatomy import Anatomy
from warpflat.seams.cloth import Cloth, edge_components
from warpflat.seams.fields import Operators
from warpflat.surface.connectivity import border_loops, euler_characteristic

__all__ = ["averaged", "mirrored", "other_side"]

Ids = NDArray[np.int64]

# Lengths are shares of the garment's size, the square root of its area.
# Cloth is averaged if its mirror image lies as near as this, in the mean and at all but a hundredth of its vertices: half of this it moves.
_MEAN, _FARTHEST = 0.01, 0.035
# The move of the cloth fades over this where a border moves by more.
_FADE = 0.05
# A seam that keeps so near to the plane of symmetry is in it.
_IN_PLANE = 0.008
# What is mirrored has the area of what it was made from within this.
_SAME_AREA = 0.02


def other_side(name: str) -> str:
    """Return a seam's name with left and right changed."""
    return re.sub(r"\b(left|right)\b", lambda word: "right" if word[0] == "left" else "left", name)


def averaged(cloth: Cloth, anatomy: Anatomy, operators: Operators) -> tuple[Cloth, list[str], bool]:
    """Return the cloth with both sides moved half way to each other, a note on how far, and true; as it was where they differ too much.

    Borders move to the mirror images of borders: a sleeve that is longer by a centimetre becomes half a centimetre shorter.
    """
    mirror, normal, offset, size = anatomy.mirror, anatomy.normal, anatomy.offset, anatomy.size
    if mirror is None:
        return cloth, [], False
    apart = []
    if anatomy.asymmetry > 1e-3:
        apart = [
            f"left and right differ by {1e3 * anatomy.asymmetry:.0f} mm in the middle: lines are averaged over both sides"
        ]

    def image(points: FloatArray) -> FloatArray:
        return np.asarray(points - 2.0 * (points @ normal - offset)[:, None] * normal)

    vertices = cloth.vertices
    gap = image(np.asarray(mirror.matrix @ vertices)) - vertices
    fixed, given = [], []
    for border in anatomy.borders:
        mates = [one for one in anatomy.borders if one.role == border.role and one.side == -border.side]
        if not mates:
            return cloth, apart, False
        there = image(border.middle[None])[0]
        mate = min(mates, key=lambda one: float(np.linalg.norm(one.middle - there)))
        fixed.append(border.vertices)
        given.append(
            _nearest_on_loop(image(vertices[mate.vertices]), vertices[border.vertices]) - vertices[border.vertices]
        )
    if fixed:
        held = np.concatenate(fixed)
        gap[held] = np.concatenate(given)
        gap = np.stack(
            [operators.solve(held, column[held], data=column, length=_FADE * size) for column in gap.T], axis=1
        )
    away = np.linalg.norm(gap, axis=1)
    share = operators.mass / operators.mass.sum()
    if float(share @ away) > _MEAN * size or float(np.quantile(away, 0.99)) > _FARTHEST * size:
        return cloth, apart, False
    moved = 0.5 * away
    if moved.max() < 5e-4:
        return replace(cloth, vertices=vertices + 0.5 * gap), [], True
    words = (
        f"both sides are averaged and cut alike: the cloth moved by {1e3 * float(share @ moved):.1f} mm in the mean, "
        f"{1e3 * moved.max():.0f} mm at most"
    )
    return replace(cloth, vertices=vertices + 0.5 * gap), [words], True


def _nearest_on_loop(loop: FloatArray, points: FloatArray) -> FloatArray:
    """Return the points of a closed line (#L by 3) that are nearest to others (#P by 3)."""
    a, way = loop, np.roll(loop, -1, axis=0) - loop
    t = np.einsum("plk,lk->pl", points[:, None] - a, way) / np.maximum((way**2).sum(axis=1), 1e-300)
    foot = a + np.clip(t, 0.0, 1.0)[:, :, None] * way
    nearest = np.linalg.norm(foot - points[:, None], axis=2).argmin(axis=1)
    return np.asarray(foot[np.arange(len(points)), nearest])


def mirrored(cloth: Cloth, anatomy: Anatomy) -> Cloth | None:
    """Return the left half of an averaged cloth with its seams, and its mirror image, vertex by vertex; None where that is another one.

    It is another one where fronts overlap, a pocket lies on one side, or a seam has no counterpart.
    """
    if anatomy.mirror is None or any(other_side(name) not in cloth.seams for name in cloth.seams):
        return None
    normal, offset = anatomy.normal, anatomy.offset
    across = cloth.vertices @ normal - offset
    # What is off by rounding is in the plane.
    across[np.abs(across) < 1e-6 * anatomy.size] = 0.0
    for part in (part for edges in cloth.seams.values() for part in edge_components(edges)):
        if np.abs(across[part]).max() < _IN_PLANE * anatomy.size:
            across[part] = 0.0
    vertices = cloth.vertices + (across - (cloth.vertices @ normal - offset))[:, None] * normal
    split, left = replace(cloth, vertices=vertices, values={**cloth.values, "across": across}).split(
        "across", np.ones(len(cloth.faces), dtype=bool)
    )
    used, place = np.unique(split.faces[left], return_inverse=True)
    faces = place.reshape(-1, 3).astype(np.int64)
    half = split.vertices[used]
    height = np.where(split.values["across"][used] == 0.0, 0.0, half @ normal - offset)
    half = half + (height - (half @ normal - offset))[:, None] * normal
    off = np.flatnonzero(height != 0.0)
    twin = np.arange(len(used))
    twin[off] = len(used) + np.arange(len(off))
    place_of = np.full(len(split.vertices), -1, dtype=np.int64)
    place_of[used] = np.arange(len(used))
    rim = np.unique(np.sort(np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1), axis=0)
    known = rim[:, 0] * len(used) + rim[:, 1]
    seams: dict[str, Ids] = {}
    for name, edges in split.seams.items():
        own = np.sort(place_of[edges], axis=1)
        own = own[(own >= 0).all(axis=1)]
        own = own[np.isin(own[:, 0] * len(used) + own[:, 1], known)]
        for title, rows in ((name, own), (other_side(name), np.sort(twin[own], axis=1))):
            if len(rows):
                seams[title] = np.unique(np.concatenate([seams[title], rows]) if title in seams else rows, axis=0)
    mates = _sleeve_mates(anatomy)
    values = {
        name: np.concatenate([value[used], (-1.0 if name == "left" else 1.0) * value[used][off]])
        for name, value in split.values.items()
        if name != "across"
    }
    labels = {}
    for name, label in split.labels.items():
        image = np.array([mates.get(int(one), int(one)) for one in label[left]]) if name == "sleeve" else label[left]
        labels[name] = np.concatenate([label[left], image])
    made = Cloth(
        vertices=np.concatenate([half, half[off] - 2.0 * height[off, None] * normal]),
        faces=np.concatenate([faces, twin[faces][:, ::-1]]),
        values=values,
        labels=labels,
        seams=seams,
    )
    return made if _is_alike(made, cloth) else None


def _sleeve_mates(anatomy: Anatomy) -> dict[int, int]:
    limbs = anatomy.limbs_of("sleeve")
    return {
        number: other
        for number, limb in enumerate(limbs)
        for other, mate in enumerate(limbs)
        if mate.side == -limb.side
    }


def _is_alike(made: Cloth, cloth: Cloth) -> bool:
    """Return whether a cloth has the area, the borders, the seams and the pieces of another one."""
    if (made.half_edges.count > 2).any():
        return False
    areas = [float(one.face_areas.sum()) for one in (made, cloth)]
    if abs(areas[0] - areas[1]) > _SAME_AREA * areas[1]:
        return False
    shapes = []
    for one in (made, cloth):
        whole = len(one.borders()), euler_characteristic(one.faces.astype(np.int32))
        pieces = sorted(
            (len(border_loops(mesh.faces.astype(np.int32))), euler_characteristic(mesh.faces.astype(np.int32)))
            for mesh in one.pieces()
        )
        shapes.append((whole, pieces))
    return shapes[0] == shapes[1]
