"""Pieces that were drafted flat go on from what they are sewn to: bands, collars, cuffs, pockets, hoods."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Set

import numpy as np
from scipy.spatial import cKDTree

from warpflat.core import FloatArray, InputError, IntArray, polyline_length, project_on_segments, turned_left, unit
from warpflat.garment.draping.mesh_pieces import FlatMesh, MeshedPieces

__all__ = ["continue_pieces", "hang_from_edges", "hood_beside_head"]

# What falls from an edge hangs upright where the cloth above leads downwards by this share.
_HANGS = -0.8
# What is drafted follows so many of the nearest vertices of its seams.
_NEXT = 4


def _seams_to(
    lying: Collection[str], meshed: MeshedPieces, names: Collection[str]
) -> dict[str, list[tuple[str, IntArray, IntArray]]]:
    """Return by name the seams of pieces to those that lie: which, and the vertices that are joined, its own and those of that one."""
    found: dict[str, list[tuple[str, IntArray, IntArray]]] = {name: [] for name in names}
    for seam in meshed.welds:
        pairs: dict[tuple[str, str], list[tuple[int, int]]] = {}
        for (piece, vertex), *others in seam:
            for other, its in others:
                pairs.setdefault((piece, other), []).append((vertex, its))
        for (piece, other), rows in pairs.items():
            first, second = np.array(rows, dtype=np.int32).T
            for name, lies, own, its in ((piece, other, first, second), (other, piece, second, first)):
                if name in found and lies in lying and len(rows) > 1:
                    found[name].append((lies, own, its))
    return found


def continue_pieces(
    placed: Mapping[str, FloatArray], meshed: MeshedPieces, turned_down: Collection[str] = ()
) -> dict[str, FloatArray]:
    """Place bands, collars, pockets and whatever else was drafted flat: as if the cloth that they are sewn to ran on beyond the seam.

    The piece with the longest seams to those that lie comes first.

    Args:
        placed: by piece the points (#P by 3 [m]) of those that lie.
        meshed: all pieces.
        turned_down: pieces that lie back on what they are sewn to, as the fall of a collar on its stand.

    Raises:
        InputError: a piece hangs together with none that lies.
    """
    found, meshes = dict(placed), meshed.meshes
    while lost := [name for name in meshes if name not in found]:
        sewn = _seams_to(found, meshed, lost)
        lengths = {
            name: sum(polyline_length(meshes[name].points[own]) for _, own, _ in rows) for name, rows in sewn.items()
        }
        name = max(lost, key=lambda each: lengths[each])
        if not sewn[name]:
            raise InputError(f"piece {name!r} is sewn to no piece that has a designed surface")
        # The vertices that are sewn, their places, and where the piece's x and y lead from there.
        rows = []
        for other, own, its in sewn[name]:
            across = _border_frames(meshes[name], own).transpose(0, 2, 1)
            # Into this piece is out of the other one, or back into it.
            flat = _border_frames(meshes[other], its) * [1.0, 1.0 if name in turned_down else -1.0] @ across
            rows.append((own, found[other][its], _slopes(meshes[other], found[other])[its] @ flat))
        own, place, way = (np.concatenate(column) for column in zip(*rows, strict=True))
        flat = meshes[name].points
        far, near = cKDTree(flat[own]).query(flat, k=min(_NEXT, len(own)))
        weight = 1.0 / np.maximum(far, 1e-6) ** 2
        weight /= weight.sum(axis=1, keepdims=True)
        off = flat[:, None] - flat[own[near]]
        found[name] = np.einsum("pk,pka->pa", weight, place[near] + np.einsum("pkab,pkb->pka", way[near], off))
    return found


def hang_from_edges(
    placed: Mapping[str, FloatArray], meshed: MeshedPieces, falling: Mapping[str, float]
) -> dict[str, FloatArray]:
    """Place flounces and ruffles as a smooth skirt that falls from the edges to which they are sewn, without their folds.

    Args:
        placed: by piece the points (#P by 3 [m]) of those that lie.
        meshed: all pieces.
        falling: the pieces that are placed, with the share of its length by which each stands out.

    Returns:
        By piece its points, #P by 3 [m].
    """
    meshes = meshed.meshes
    found, sewn = {}, {name: seams for name, seams in _seams_to(placed, meshed, falling).items() if seams}
    edges = [placed[other][its] for seams in sewn.values() for other, _, its in seams]
    middle = np.concatenate(edges or [np.zeros((1, 3))]).mean(axis=0)
    for name, seams in sewn.items():
        flat, best = meshes[name].points, np.full(len(meshes[name].points), np.inf)
        found[name] = np.empty((len(flat), 3))
        for other, own, its in seams:
            out = -_border_frames(meshes[other], its)[:, :, 1:]
            place, down = placed[other][its], (_slopes(meshes[other], placed[other])[its] @ out)[:, :, 0]
            share, off = project_on_segments(flat[:, None], flat[own[:-1]], flat[own[1:]])
            nearest_side = off.argmin(axis=1)
            points, here = np.arange(len(flat)), off.min(axis=1) < best
            at, t = nearest_side[here], share[points, nearest_side][here, None]
            start, way = ((1.0 - t) * row[at] + t * row[at + 1] for row in (place, down))
            # On the trunk it hangs, on an arm it runs on.
            way = np.where((way[:, 1] < _HANGS * np.linalg.norm(way, axis=1))[:, None], [0.0, -1.0, 0.0], way)
            out = (start - middle) * [1.0, 0.0, 1.0]
            best = np.minimum(best, off.min(axis=1))
            found[name][here] = start + best[here, None] * unit(way + falling[name] * unit(out))
    return found


def hood_beside_head(
    placed: Mapping[str, FloatArray], meshed: MeshedPieces, hood: Set[str], beside: float
) -> dict[str, FloatArray]:
    """Place the halves of a hood flat beside a head, upright as they are drawn, with the middles of their seams at the neckline's.

    Args:
        placed: by piece the points (#P by 3 [m]) of those that lie.
        meshed: all pieces.
        hood: the pieces of the hood; what is sewn to both sides of the neckline, such as a strip over the crown, is no half.
        beside: how far from the middle the halves lie [m].

    Returns:
        By half its points, #P by 3 [m].
    """
    meshes = meshed.meshes
    found = {}
    for name, seams in _seams_to(placed.keys() - hood, meshed, hood).items():
        if not seams:
            continue
        own = np.concatenate([own for _, own, _ in seams])
        neckline = np.concatenate([placed[other][its] for other, _, its in seams])
        side = float(np.sign(neckline[:, 0]).mean())
        if abs(side) > 0.5:
            off = meshes[name].points - meshes[name].points[own].mean(axis=0)
            seen = neckline - neckline.mean(axis=0)
            # Drawn upright, it faces one way or the other.
            forwards = np.sign(off[own, 0] @ seen[:, 2])
            x, y = np.sign(side) * beside, neckline[:, 1].mean() + off[:, 1]
            found[name] = np.column_stack([np.full(len(y), x), y, neckline[:, 2].mean() + forwards * off[:, 0]])
    return found


def _border_frames(mesh: FlatMesh, row: IntArray) -> FloatArray:
    """Return the directions along a row of border vertices (#R) and into the piece as columns, #R by 2 by 2."""
    points = mesh.points
    along = unit(np.gradient(points[row], axis=0))
    inwards = turned_left(along)
    middle = points[mesh.triangles[np.isin(mesh.triangles, row).sum(axis=1) == 2]].mean(axis=1)
    place = cKDTree(points[row]).query(middle)[1]
    left = np.einsum("ta,ta->t", middle - points[row[place]], inwards[place])
    return np.stack([along, inwards * (1.0 if np.median(left) > 0.0 else -1.0)], axis=-1)


def _slopes(mesh: FlatMesh, points: FloatArray) -> FloatArray:
    """Return where a piece's x and y lead in space at its vertices, #P by 3 by 2, for places #P by 3."""
    flat, space = mesh.points[mesh.triangles], points[mesh.triangles]
    sides, edges = ((each[:, 1:] - each[:, :1]).transpose(0, 2, 1) for each in (flat, space))
    area = np.linalg.det(sides)
    of_triangles = (edges @ np.linalg.inv(sides)).reshape(-1, 6) * area[:, None]
    corner, count = mesh.triangles.ravel(), len(points)
    total = np.stack([np.bincount(corner, np.repeat(column, 3), count) for column in of_triangles.T], axis=1)
    return np.asarray((total / np.bincount(corner, np.repeat(area, 3), count)[:, None]).reshape(-1, 3, 2))
