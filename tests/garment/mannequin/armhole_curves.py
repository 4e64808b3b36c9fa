"""What a pattern maker checks on an armhole or a sleeve's cap: its turning, its corner, its distance from the body."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from warpflat.flat.surface.normals import vertex_normals
from warpflat.garment.mannequin.closest import Mesh
from warpflat.garment.mannequin.forms import FormResult
from warpflat.garment.mannequin.mannequin import Mannequin


def _turning(curve: np.ndarray, step: float) -> np.ndarray:
    """Angles [degrees] between consecutive chords of `step` [m] along a plane curve, left turns positive."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    count = max(4, round(s[-1] / step))
    at = np.linspace(0.0, s[-1], count + 1)
    # The smooth curve that is drawn through them: chords are shorter than a mesh edge, and no corner falls between two of them.
    even = CubicSpline(s, curve)(at)
    way = np.diff(even, axis=0)
    cross = way[:-1, 0] * way[1:, 1] - way[:-1, 1] * way[1:, 0]
    return np.degrees(np.arctan2(cross, (way[:-1] * way[1:]).sum(axis=1)))


def sharpest_turn(curve: np.ndarray) -> float:
    """Most that a plane curve turns within a centimetre [degrees]."""
    return float(np.abs(_turning(curve, 0.01)).max())


def inflections(curve: np.ndarray, least: float = 3.0) -> int:
    """How often a plane curve changes the side to which it bends; bends of less than `least` degrees do not count."""
    runs: list[float] = []
    for angle in _turning(curve, 0.01):
        if runs and np.sign(runs[-1]) == np.sign(angle):
            runs[-1] += angle
        else:
            runs.append(float(angle))
    sides = [np.sign(run) for run in runs if abs(run) >= least]
    return int(np.sum(np.diff(sides) != 0))


def corner_degrees(flat: np.ndarray, armhole: np.ndarray, side: np.ndarray) -> float:
    """Angle in the piece between armhole and side seam, as tangents of parabolas through 0, 10 and 20 mm."""
    joint = np.intersect1d(armhole, side)[0]
    ways = []
    for edge in (armhole, side):
        line = flat[edge if edge[0] == joint else edge[::-1]]
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        start, near, far = CubicSpline(s, line)([0.0, 0.01, 0.02])
        ways.append(4.0 * near - far - 3.0 * start)
    a, b = ways
    return float(np.degrees(np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))))


def depth_inside(form: FormResult, body: Mannequin) -> float:
    """How far the deepest vertex of a form's pieces lies inside the body [m]: trunk, arms and legs, but not the tube around both legs."""
    vertices, faces = body.vertices, body.layout.body_faces
    used = np.unique(np.concatenate([piece.grid_vertices for piece in form.pieces.values()]))
    off = np.abs(form.vertices - vertices)[used].max(axis=1) > 1e-9
    moved = used[off | ~np.isin(used, faces)]
    if not len(moved):
        return 0.0
    triangles = np.concatenate([faces[:, :3], faces[:, [0, 2, 3]]]).astype(np.int64)
    triangle, weights, place = Mesh(vertices, triangles).closest(form.vertices[moved])
    away = np.linalg.norm(form.vertices[moved] - place, axis=1)
    outward = np.einsum("nk,nkd->nd", weights, vertex_normals(vertices, faces)[triangles[triangle]])
    inside = ((form.vertices[moved] - place) * outward).sum(axis=1) < 0.0
    return float(np.where(inside, away, 0.0).max())
