"""Tapes laid around a body mesh with trimesh and SciPy alone, to check what the package measures."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull


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
    places = np.round(ends * 1e7).astype(np.int64) @ np.array([1, 2**27, 2**54])
    key = np.unique(places, return_inverse=True)[1].ravel()
    graph = coo_matrix((np.ones(len(key) // 2), (key[::2], key[1::2])), (key.max() + 1,) * 2)
    label = connected_components(graph, directed=False)[1][key]
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


def tapes(points: np.ndarray, faces: np.ndarray, fold: float | None = None) -> dict[str, tuple[float, float]]:
    """Return height above the floor and girth [m] of hip, waist, underbust and bust at the standard's places (ISO 8559-1).

    Sections every 2 mm: hip where the trunk reaches furthest back, waist where it is narrowest, bust where it is fullest
    below the armpits, underbust at the fold under it, or else where two straight lines that fit the girth from waist to bust
    best meet.

    Args:
        points: #V by 3 [m], Y up, facing +Z, the midplane at x = 0.
        faces: #F by 4, -1 in the last column for a triangle.
        fold: height of the fold under the bust [m], if it is known.
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
    chest = np.flatnonzero(y > 0.69 * stature)
    armpit = next(i for i in chest if width[i + 1] > 1.2 * width[i])
    hip = int(np.argmin(np.where(y < 0.57 * stature, back, np.inf)))
    waist = int(np.argmin(np.where((y > 0.57 * stature) & (y < 0.68 * stature), girth, np.inf)))
    bust = int(waist + np.argmax(girth[waist : armpit + 1]))
    bend = waist + _bend(y[waist : bust + 1], girth[waist : bust + 1])
    under = bend if fold is None else int(np.argmin(np.abs(floor + y - fold)))
    rows = {"hip": hip, "waist": waist, "underbust": under, "bust": bust}
    return {name: (float(y[i]), float(girth[i])) for name, i in rows.items()}


def _bend(y: np.ndarray, values: np.ndarray) -> int:
    """Return the sample where the two joined straight lines bend that fit `values` best."""
    misses = []
    for at in range(2, len(y) - 2):
        lines = np.column_stack([np.ones_like(y), y - y[at], np.maximum(y - y[at], 0.0)])
        misses.append(np.linalg.norm(lines @ np.linalg.lstsq(lines, values, rcond=None)[0] - values))
    return 2 + int(np.argmin(misses))
