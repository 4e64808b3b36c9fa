"""Tapes laid around a body mesh with trimesh and SciPy alone, to check what the package measures."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, cKDTree


def plane_parts(mesh: trimesh.Trimesh, at: np.ndarray, normal: np.ndarray) -> list[np.ndarray]:
    """Return the connected parts of a plane section, each #P by 3."""
    away = (mesh.vertices.view(np.ndarray) - at) @ normal
    # trimesh sorts the signs of all faces; only those that reach the plane are given to it.
    signs = (away > 1e-7).astype(np.int8) - (away < -1e-7)
    a, b, c = mesh.faces.view(np.ndarray).T
    near = np.flatnonzero(np.abs(signs[a] + signs[b] + signs[c]) < 3)
    if not len(near):
        return []
    ends = np.asarray(trimesh.intersections.mesh_plane(mesh, normal, at, local_faces=near, cached_dots=away)).reshape(
        -1, 3
    )
    if not len(ends):
        return []
    # Ends of two faces at one place are apart by rounding; a grid of places would part some of them.
    pairs = cKDTree(ends).query_pairs(1e-7, output_type="ndarray")
    own = np.arange(len(ends)).reshape(-1, 2)
    graph = coo_matrix((np.ones(len(pairs) + len(own)), np.concatenate([pairs, own]).T), (len(ends),) * 2)
    label = connected_components(graph, directed=False)[1]
    return [ends[label == i] for i in range(label.max() + 1)]


def section_parts(mesh: trimesh.Trimesh, height: float) -> list[np.ndarray]:
    """Return the connected parts of a level section, each #P by 2 (x, z), largest box first."""
    parts = plane_parts(mesh, np.array([0.0, height, 0.0]), np.array([0.0, 1.0, 0.0]))
    return sorted((p[:, [0, 2]] for p in parts), key=lambda p: -np.prod(np.ptp(p, axis=0)))


def _trunk(mesh: trimesh.Trimesh, height: float) -> np.ndarray:
    parts = section_parts(mesh, height)
    largest = parts[0]
    return largest if largest[:, 0].min() < 0 < largest[:, 0].max() else np.concatenate(parts[:2])


def tape(mesh: trimesh.Trimesh, height: float) -> float:
    """Return the girth [m] of a level tape around trunk or both legs."""
    return float(ConvexHull(_trunk(mesh, height)).area)


def armpit_and_crotch(mesh: trimesh.Trimesh) -> tuple[float, float, float]:
    """Return heights of armpits and crotch, half the width there [m].

    The armpit is the last level section before the trunk's width leaps, the crotch the first of one part.
    """
    floor, stature = mesh.vertices[:, 1].min(), np.ptp(mesh.vertices[:, 1])
    y = floor + np.arange(0.40, 0.58, 0.002 / stature) * stature
    crotch = next(at for at in y if (p := section_parts(mesh, at)[0])[:, 0].min() < 0 < p[:, 0].max())
    y = floor + np.arange(0.69, 0.84, 0.002 / stature) * stature
    width = [np.ptp(_trunk(mesh, at)[:, 0]) for at in y]
    armpit = next(i for i in range(len(y) - 1) if width[i + 1] > 1.2 * width[i])
    return float(y[armpit] - floor), float(crotch - floor), 0.5 * float(width[armpit])


def tapes(points: np.ndarray, faces: np.ndarray, fold: float, bust_points: float) -> dict[str, tuple[float, float]]:
    """Return height above the floor and girth [m] of hip, waist, underbust, bust and fullest chest at the standard's places (ISO 8559-1).

    Sections every 2 mm: hip where the trunk reaches furthest back, waist where it is narrowest, chest where it is fullest
    below the armpits, underbust at the fold, bust at its points.

    Args:
        points: #V by 3 [m], Y up, facing +Z, the midplane at x = 0.
        faces: #F by 4, -1 in the last column for a triangle.
        fold, bust_points: heights of the fold under the bust and of its points [m].
    """
    triangles = np.concatenate([faces[:, :3], faces[faces[:, 3] >= 0][:, [0, 2, 3]]])
    mesh = trimesh.Trimesh(points, triangles, process=False)
    floor, stature = points[:, 1].min(), np.ptp(points[:, 1])
    y = np.arange(0.48, 0.80, 0.002 / stature) * stature
    trunks = [_trunk(mesh, floor + at) for at in y]
    girth = np.array([ConvexHull(t).area for t in trunks])
    back = np.array([t[:, 1].min() for t in trunks])
    # Where the arms join, the section's width leaps.
    width = np.array([np.ptp(t[:, 0]) for t in trunks])
    upper = np.flatnonzero(y > 0.69 * stature)
    armpit = next(i for i in upper if width[i + 1] > 1.2 * width[i])
    hip = int(np.argmin(np.where(y < 0.57 * stature, back, np.inf)))
    waist = int(np.argmin(np.where((y > 0.57 * stature) & (y < 0.68 * stature), girth, np.inf)))
    chest = int(waist + np.argmax(girth[waist : armpit + 1]))
    under, bust = (int(np.argmin(np.abs(floor + y - at))) for at in (fold, bust_points))
    rows = {"hip": hip, "waist": waist, "underbust": under, "bust": bust, "chest, fullest": chest}
    return {name: (float(y[i]), float(girth[i])) for name, i in rows.items()}
