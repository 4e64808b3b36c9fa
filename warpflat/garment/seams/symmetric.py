"""A garment that is nearly its own mirror image is made so: its two sides are averaged, and its seams drawn once and mirrored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from warpflat.core import FloatArray, other_side, project_on_segments
from warpflat.garment.construction.meet import SAME_PLACE
from warpflat.garment.seams.anatomy import Anatomy
from warpflat.garment.seams.cloth import ALIKE, BESIDE_LINE, FACES, LEVELS, Cloth, PieceMesh, are_among, edge_components
from warpflat.garment.seams.tailor import LEFT

__all__ = ["averaged", "mirror_image", "mirrored"]

Ids = NDArray[np.int64]

# Lengths are shares of the garment's size, the square root of its area.
# Cloth is averaged if its mirror image lies as near as this at all but a hundredth of its vertices: half of this it moves.
_FARTHEST = 0.035
# A seam that keeps so near to the plane of symmetry is in it.
_IN_PLANE = 0.008
# Cloth that is so far from the plane, as a share of what is the farthest at its height, is of its side.
_FAR = 0.5
# Cloth that moves by less is not worth a word [m].
_TOLD = 5e-4


def mirror_image(mesh: PieceMesh, other: PieceMesh, anatomy: Anatomy) -> Ids | None:
    """Return for each vertex of a piece the one of another piece that is its mirror image; None where the other is not its mirror image."""
    away, nearest = cKDTree(other.vertices).query(anatomy.image(mesh.vertices))
    return nearest if float(away.max()) < SAME_PLACE else None


def averaged(cloth: Cloth, anatomy: Anatomy) -> tuple[Cloth, str, bool]:
    """Return the cloth with both sides moved half way to each other, how far in words, and true; as it was where they differ too much.

    Borders move to the mirror images of borders: a sleeve that is longer by a centimetre becomes half a centimetre shorter.
    """
    mirror, image, size = anatomy.mirror, anatomy.image, anatomy.size
    if mirror is None:
        return cloth, "", False
    apart = ""
    if anatomy.asymmetry > 1e-3:
        apart = f"left and right differ by {1e3 * anatomy.asymmetry:.0f} mm in the middle: lines are averaged over both sides"

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
        # Each vertex goes to the nearest place of that border's mirror image.
        loop, points = image(vertices[mate.vertices]), vertices[border.vertices]
        following = np.roll(loop, -1, axis=0)
        share, off = project_on_segments(points[:, None], loop, following)
        nearest = off.argmin(axis=1)
        at = share[np.arange(len(points)), nearest][:, None]
        given.append((1.0 - at) * loop[nearest] + at * following[nearest] - points)
    if fixed:
        held = np.concatenate(fixed)
        gap[held] = np.concatenate(given)
        gap = np.stack(
            [cloth.solve(held, column[held], data=column, length=BESIDE_LINE * size) for column in gap.T], axis=1
        )
    away = np.linalg.norm(gap, axis=1)
    share = cloth.mass / cloth.mass.sum()
    if float(np.quantile(away, 0.99)) > _FARTHEST * size:
        return cloth, apart, False
    moved = 0.5 * away
    words = f"the cloth moved by {1e3 * float(share @ moved):.1f} mm in the mean, {1e3 * moved.max():.0f} mm at most"
    return replace(cloth, vertices=vertices + 0.5 * gap), words if moved.max() >= _TOLD else "", True


def mirrored(cloth: Cloth, anatomy: Anatomy) -> tuple[Cloth, str]:
    """Return the left half of an averaged cloth with its seams, and its mirror image, vertex by vertex; else the cloth, and why.

    The halves meet where a harmonic field between the sides is zero, which is one line even in folds and at a crotch; it moves into the
    plane of symmetry, and the cloth beside it by less and less.
    """
    if anatomy.mirror is None:
        return cloth, "it has no plane of symmetry"
    if lone := sorted(name for name in cloth.seams if other_side(name) not in cloth.seams):
        return cloth, f"{lone[0]} is on one side alone"
    split = cloth.with_values(across=_between_sides(cloth, anatomy))
    split, left, _ = split.split("across", np.ones(len(cloth.faces), dtype=bool))
    if not left.any() or left.all():
        return cloth, "one side has no cloth"
    half = split.only(left)
    height, count = anatomy.across(half.vertices), len(half.vertices)
    middle = np.flatnonzero(half.values["across"] == 0.0)
    level = height + half.solve(middle, -height[middle], data=np.zeros(count), length=BESIDE_LINE * anatomy.size)
    level[middle] = 0.0
    vertices = half.vertices + (level - height)[:, None] * anatomy.normal
    off = np.setdiff1d(np.arange(count), middle)
    twin = np.arange(count)
    twin[off] = count + np.arange(len(off))
    seams: dict[str, Ids] = {}
    for name, edges in half.seams.items():
        for title, rows in ((name, edges), (other_side(name), np.sort(twin[edges], axis=1))):
            if len(rows):
                seams[title] = np.unique(np.concatenate([seams[title], rows]) if title in seams else rows, axis=0)
    values = {
        name: np.concatenate([value, (-1.0 if name == LEFT else 1.0) * value[off]])
        for name, value in half.values.items()
        if name != "across"
    }
    sleeves = anatomy.limbs_of("sleeve")
    mates = {sleeves.index(one): sleeves.index(mate) for one in sleeves if (mate := anatomy.mate(one)) is not None}
    labels = {}
    for name, label in half.labels.items():
        image = np.array([mates.get(int(one), int(one)) for one in label]) if name == "sleeve" else label
        labels[name] = np.concatenate([label, image])
    made = Cloth(
        vertices=np.concatenate([vertices, anatomy.image(vertices[off])]),
        faces=np.concatenate([half.faces, twin[half.faces][:, ::-1]]),
        values=values,
        labels=labels,
        seams=seams,
    )
    if (made.half_edges.count > 2).any():
        return cloth, "its halves meet at more than the middle"
    areas = [float(one.face_areas.sum()) for one in (made, cloth)]
    if abs(areas[0] - areas[1]) > ALIKE * areas[1]:
        return cloth, "one side has more cloth than the other"
    shapes = [(one.shape, sorted(mesh.shape for mesh in one.pieces())) for one in (made, cloth)]
    if shapes[0] != shapes[1]:
        return cloth, "one side has openings, seams or pieces that the other has not"
    return made, ""


def _between_sides(cloth: Cloth, anatomy: Anatomy) -> FloatArray:
    """Return a field, #V: the distance from the plane of symmetry [m] far from it and where cloth plainly crosses it; else harmonic.

    It is 0 along seams in the plane.
    """
    lateral = anatomy.across(cloth.vertices)
    heights = cloth.vertices @ anatomy.up
    level = np.clip(((heights - heights.min()) / max(np.ptp(heights), 1e-300) * LEVELS).astype(np.int64), 0, LEVELS - 1)
    farthest = np.zeros(LEVELS)
    np.maximum.at(farthest, level, np.abs(lateral))
    far = np.flatnonzero(np.abs(lateral) > np.maximum(_FAR * farthest[level], BESIDE_LINE * anatomy.size))
    he = cloth.half_edges
    edges = he.edges.astype(np.int64)
    # Where edges lie in the plane but for rounding, and along seams that keep near to it.
    exact = edges[(np.abs(lateral[edges]) < 1e-6 * anatomy.size).all(axis=1)]
    parts = [part for line in (exact, *cloth.seams.values()) for part in edge_components(line)]
    parts = [part for part in parts if np.abs(lateral[part]).max() < _IN_PLANE * anatomy.size]
    while True:
        inner = np.setdiff1d(np.concatenate([np.empty(0, dtype=np.int64), *(part.ravel() for part in parts)]), far)
        fixed = np.concatenate([far, inner])
        field = cloth.solve(fixed, np.concatenate([lateral[far], np.zeros(len(inner))]))
        # One that has the same side of the garment on both of its sides, along most of its edges, is not in it.
        between = []
        for part in parts:
            beside = np.flatnonzero(are_among(he.edges, part)[he.edge])
            third = field[cloth.faces[he.face[beside]].sum(axis=1) - he.tail[beside] - he.head[beside]]
            left, right = np.unique(he.edge[beside[third > 0.0]]), np.unique(he.edge[beside[third < 0.0]])
            if 2 * len(np.intersect1d(left, right)) > len(part):
                between.append(part)
        if len(between) == len(parts):
            break
        parts = between
    # Near the plane of symmetry cloth plainly crosses it where all around is steep to it, and goes as the field rises.
    near = BESIDE_LINE * anatomy.size
    corners, normals = cloth.vertices[cloth.faces], cloth.face_normals
    # Of a linear function, by the edges opposite to the corners, each turned by a right angle.
    turned = np.cross(normals[:, None], np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1))
    rise = np.einsum("fk,fka->fa", field[cloth.faces], turned)
    across = rise @ anatomy.normal > FACES * np.linalg.norm(rise, axis=1)
    other = (np.abs(lateral[cloth.faces]).min(axis=1) < 2.0 * near) & ~across
    away = np.full(len(lateral), np.inf)
    if other.any():
        away = cKDTree(corners[other].mean(axis=1)).query(cloth.vertices)[0]
    plain = np.setdiff1d(np.flatnonzero((np.abs(lateral) < near) & (away > near)), fixed)
    given = np.concatenate([lateral[far], np.zeros(len(inner)), lateral[plain]])
    return cloth.solve(np.concatenate([fixed, plain]), given)
