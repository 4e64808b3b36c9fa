"""Pieces of a garment that is being cut, laid flat coarsely: how much of each stays beyond the cloth's limits, and where it is narrow."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from warpflat.core import FloatArray, InputError, arc_lengths, laid_upon, points_at_lengths
from warpflat.flat import (
    Fabric,
    Flattening,
    Surface,
    as_rigid_layout,
    border_loops,
    coarse_options,
    flatten,
    is_injective,
)
from warpflat.garment.seams.anatomy import Anatomy
from warpflat.garment.seams.cloth import Cloth, PieceMesh
from warpflat.garment.seams.solid import NARROW, SEWABLE, LaidFlat, parts_within
from warpflat.garment.seams.symmetric import mirror_image

__all__ = [
    "OWNER",
    "PRICE_LEFT",
    "TRIAL_LEFT",
    "Measure",
    "Measured",
    "laid_flat",
    "least_width",
    "measured",
    "remembered",
    "without_memory",
]

Ids = NDArray[np.int64]
Measure = Callable[..., list["Measured"]]

# A piece is narrow between stretches of its border that are longer than so many times its width.
_BESIDE_NECK = 3.0
#: Labels of faces: the number of the piece that each was of when that was measured, and its own.
OWNER, _FACE = "piece before", "face before"
#: Energies of prices are known to the first share, those of what is made to the second.
PRICE_LEFT, TRIAL_LEFT = 0.1, 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """A piece, flattened coarsely; `mirrored` if it was its mirror image that was flattened.

    `mesh` is that of the cloth as it was when the piece was measured (see `remembered`).
    """

    mesh: PieceMesh
    surface: Surface
    result: Flattening
    outside: float
    energy: float
    area: float
    mirrored: bool = False


def remembered(cloth: Cloth, pieces: Sequence[Measured]) -> Cloth:
    """Return the cloth with the number of each face, and of its piece, as labels, by which what is cut or joined has its old layout."""
    owner = np.full(len(cloth.faces), -1, dtype=np.int64)
    for number, piece in enumerate(pieces):
        owner[piece.mesh.face_of] = number
    return cloth.with_labels(**{_FACE: np.arange(len(owner)), OWNER: owner})


def without_memory(cloth: Cloth) -> Cloth:
    """Return the cloth without these labels."""
    return cloth.with_labels(**{_FACE: None, OWNER: None})


def _layout_before(
    cloth: Cloth, mesh: PieceMesh, surface: Surface, pieces: Sequence[Measured], anatomy: Anatomy
) -> FloatArray | None:
    """Return the layout that a piece had before it was cut, or those of two that were joined, side by side; None if there is none.

    Each vertex lies in its face as it did: both sides of a new cut lie on each other.
    """
    if OWNER not in cloth.labels or (cloth.labels[OWNER][mesh.face_of] < 0).any():
        return None
    owner, face = cloth.labels[OWNER][mesh.face_of], cloth.labels[_FACE][mesh.face_of]
    numbers, areas = np.unique(owner), np.bincount(owner, cloth.face_areas[mesh.face_of])
    laid = np.full((len(mesh.vertices), 2), np.nan)
    for number in sorted(numbers.tolist(), key=lambda one: -areas[one]):
        old, chosen = pieces[number], owner == number
        place = np.searchsorted(old.mesh.face_of, face[chosen])
        a, b, c = old.mesh.vertices[old.mesh.faces[place]].transpose(1, 0, 2)
        way = mesh.vertices[mesh.faces[chosen]] - a[:, None]
        ab, ac = b - a, c - a
        # Barycentric coordinates in the plane of the face.
        uu, uv, vv = (np.einsum("ij,ij->i", p, q)[:, None] for p, q in ((ab, ab), (ab, ac), (ac, ac)))
        wu, wv = np.einsum("ikj,ij->ik", way, ab), np.einsum("ikj,ij->ik", way, ac)
        least = np.maximum(uu * vv - uv * uv, 1e-30)
        share = np.stack([(vv * wu - uv * wv) / least, (uu * wv - uv * wu) / least], axis=2)
        share = np.concatenate([1.0 - share.sum(axis=2, keepdims=True), share], axis=2)
        # Where the corners of its faces lie in its layout, #F by 3 by 2 [m]: a mirror image has that of the piece that was flattened.
        faces = old.surface.faces[:, :3]
        flat = old.result.positions[faces]
        if old.mirrored:
            there, here = anatomy.image(old.surface.vertices[faces]), old.mesh.vertices[old.mesh.faces]
            image = cKDTree(there.mean(axis=1)).query(here.mean(axis=1))[1]
            corner = np.linalg.norm(here[:, :, None] - there[image][:, None], axis=3).argmin(axis=2)
            flat = np.asarray(flat[image[:, None], corner] * [-1.0, 1.0])
        corners = np.einsum("ikj,ijd->ikd", share, flat[place]).reshape(-1, 2)
        # Of the faces at a vertex, the one in which it lies the deepest.
        at, depth = mesh.faces[chosen].ravel(), share.min(axis=2).ravel()
        order = np.lexsort((-depth, at))
        vertices, first = np.unique(at[order], return_index=True)
        own = corners[order[first]]
        both = np.isfinite(laid[vertices, 0])
        if np.isfinite(laid).any():
            if both.sum() < 2:
                return None
            # It is turned and shifted onto the others along what they share.
            there = laid[vertices[both]]
            own = laid_upon(there, own, both)
            own[both] = 0.5 * (own[both] + there)
        laid[vertices] = own
    p = laid[mesh.faces]
    double = (p[:, 1, 0] - p[:, 0, 0]) * (p[:, 2, 1] - p[:, 0, 1]) - (p[:, 1, 1] - p[:, 0, 1]) * (
        p[:, 2, 0] - p[:, 0, 0]
    )
    if len(numbers) == 1 and (np.all(double > 0.0) or np.all(double < 0.0)):
        return laid
    unfolded = as_rigid_layout(surface, laid)
    return unfolded if unfolded is not None and is_injective(surface, unfolded) else None


def measured(
    cloth: Cloth,
    known: Sequence[Measured],
    *,
    anatomy: Anatomy,
    fabric: Fabric,
    prepare: Callable[[Cloth, PieceMesh], Surface],
    changed: Collection[int] | None = None,
    energy_left: float = TRIAL_LEFT,
) -> list[Measured]:
    """Return the pieces, flattened coarsely; those that are as they were are taken over, and mirror images are flattened once.

    The energy is right to a share of `energy_left`, from above.

    Args:
        cloth: cut.
        known: pieces that are known, first those by whose numbers the cloth is labelled (see `remembered`).
        anatomy: of the garment.
        fabric: the cloth's.
        prepare: makes the surface of a piece, with its grain.
        changed: only what was of the pieces of these numbers is returned; all if not given.
        energy_left: how well the energy is known, as a share.

    Raises:
        InputError: a piece cannot be flattened.
    """
    found: list[Measured] = []
    for mesh in cloth.pieces(None if changed is None else np.isin(cloth.labels[OWNER], list(changed))):
        alike = [one for one in (*known, *found) if len(one.mesh.faces) == len(mesh.faces)]
        same = next((one for one in alike if np.array_equal(one.mesh.vertices, mesh.vertices)), None)
        if same is not None:
            found.append(replace(same, mesh=mesh))
            continue
        if anatomy.mirror is not None:
            others = [one for one in alike if not one.mirrored]
            same = next((one for one in others if mirror_image(mesh, one.mesh, anatomy) is not None), None)
            if same is not None:
                found.append(replace(same, mesh=mesh, mirrored=True))
                continue
        surface = prepare(cloth, mesh)
        if not mesh.is_disk:
            # A tube is opened when all seams are known.
            continue
        result = _laid(surface, fabric, energy_left, start=_layout_before(cloth, mesh, surface, known, anatomy))
        area = float(result.fit.area.sum())
        found.append(
            Measured(
                mesh=mesh,
                surface=surface,
                result=result,
                outside=result.fit.outside * area,
                energy=result.layout_measures["strain_energy_j"],
                area=area,
            )
        )
    return found


def laid_flat(surface: Surface, fabric: Fabric, width: float) -> LaidFlat:
    """Return what becomes of a piece that is laid flat coarsely.

    Args:
        surface: of the piece, a disk.
        fabric: the cloth's.
        width: what is narrower is [m].

    Returns:
        What it is; all of it is beyond its limit where it cannot be laid flat.
    """
    try:
        result = _laid(surface, fabric, PRICE_LEFT)
    except InputError:
        return LaidFlat(outside=1.0, overlap=0.0, width=width)
    least, ends = _narrowest(surface, result.positions, max(width, SEWABLE))
    neck = surface.vertices[ends] if len(ends) and parts_within(surface.faces, result.positions, SEWABLE) > 1 else None
    return LaidFlat(outside=result.fit.outside, overlap=result.overlap, width=min(least, width), neck=neck)


def _laid(surface: Surface, fabric: Fabric, energy_left: float, *, start: FloatArray | None = None) -> Flattening:
    """Flatten a piece so far that good is told from bad; what is left is estimated at every step, and checked where it is little."""
    relax = replace(coarse_options(), energy_left=energy_left, outline_left_mm=100.0 * energy_left, check_every=100)
    datum = "grain" if "grain" in surface.lines else None
    return flatten(surface, fabric=fabric, datum=datum, start=start, relax=relax)


def _narrowest(surface: Surface, flat: FloatArray, width: float) -> tuple[float, Ids]:
    """Return the least width of a pattern between stretches of its border that are long compared with a width [m]; that width at most.

    Returns:
        The width, and the two vertices between which it is; none where it is not less.
    """
    from matplotlib.path import Path as Outline

    border = border_loops(surface.faces)[0].astype(np.int64)
    loop = flat[border]
    arc = arc_lengths(np.concatenate([loop, loop[:1]]))
    count = int(np.clip(4.0 * arc[-1] / width, 24, 400))
    at = np.arange(count) * arc[-1] / count
    points = points_at_lengths(np.concatenate([loop, loop[:1]]), at)
    apart = np.abs(at[:, None] - at)
    around = np.minimum(apart, arc[-1] - apart)
    distance = np.linalg.norm(points[:, None] - points, axis=2)
    one, other = np.nonzero((around > _BESIDE_NECK * width) & (distance < width))
    # Across an open dart or a concave corner there is no cloth.
    inside = Outline(points).contains_points(0.5 * (points[one] + points[other]))
    across = distance[one, other][inside]
    if len(across) == 0:
        return width, np.empty(0, dtype=np.int64)
    least = int(across.argmin())
    ends = points[[one[inside][least], other[inside][least]]]
    return float(across[least]), border[np.linalg.norm(loop - ends[:, None], axis=2).argmin(axis=1)]


def least_width(pieces: Sequence[Measured], size: float) -> float:
    """Return the least width of some patterns in a garment of a size [m]; what nobody calls narrow at most."""
    width = NARROW * size
    return min((_narrowest(one.surface, one.result.positions, width)[0] for one in pieces), default=width)
