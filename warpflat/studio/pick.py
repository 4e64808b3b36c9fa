"""Clicks on a form or a pattern: which piece, vertex and line is meant."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.surface.triangles import triangulate

__all__ = ["Hit", "nearest_line", "pick_flat", "pick_on_rays"]

# A click at most this far from a line means the line [m].
_NEAR_LINE = 0.02
# A click at most this far from a piece in the plane means the piece [m].
_NEAR_PIECE = 0.01


@dataclass(frozen=True, kw_only=True)
class Hit:
    """A place on a piece.

    Attributes:
        piece: its name.
        point: 3, the nearest vertex of the piece, where it was designed [m].
    """

    piece: str
    point: tuple[float, float, float]


def pick_on_rays(
    origin: ArrayLike, direction: ArrayLike, pieces: Mapping[str, tuple[FloatArray, IntArray]]
) -> tuple[str, int] | None:
    """Return the piece that a ray meets first and the vertex nearest to that place, None if it meets none.

    Args:
        origin, direction: of the ray, 3 each [m].
        pieces: by name the vertices in space, #V by 3 [m], and the faces, #F by 4.
    """
    start, way = np.asarray(origin, dtype=float), np.asarray(direction, dtype=float)
    best: tuple[float, str, int] | None = None
    for name, (vertices, faces) in pieces.items():
        triangles, _ = triangulate(faces)
        distance, triangle = _first_triangle(start, way, vertices[triangles])
        if triangle is None or (best is not None and distance >= best[0]):
            continue
        at, corners = start + distance * way, triangles[triangle]
        best = distance, name, int(corners[np.argmin(np.linalg.norm(vertices[corners] - at, axis=1))])
    return None if best is None else best[1:]


def _first_triangle(origin: FloatArray, way: FloatArray, corners: FloatArray) -> tuple[float, int | None]:
    """Return the distance along a ray to the first of some triangles (#T by 3 by 3), and its number (Moeller, Trumbore 1997)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(way, second)
    volume = np.einsum("ij,ij->i", first, across)
    flat = np.abs(volume) < 1e-15
    inverse = 1.0 / np.where(flat, 1.0, volume)
    to_corner = origin - corners[:, 0]
    u = np.einsum("ij,ij->i", to_corner, across) * inverse
    turned = np.cross(to_corner, first)
    v = turned @ way * inverse
    distance = np.einsum("ij,ij->i", second, turned) * inverse
    meets = ~flat & (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1.0 + 1e-9) & (distance > 0.0)
    if not meets.any():
        return np.inf, None
    number = int(np.argmin(np.where(meets, distance, np.inf)))
    return float(distance[number]), number


def pick_flat(place: ArrayLike, pieces: Mapping[str, FloatArray]) -> tuple[str, int] | None:
    """Return the piece and the vertex that lie at a place of the plane, None if none does.

    Args:
        place: 2 [m].
        pieces: by name the vertices, #V by 2 [m].
    """
    best: tuple[float, str, int] | None = None
    for name, flat in pieces.items():
        away = np.linalg.norm(flat - np.asarray(place, dtype=float), axis=1)
        vertex = int(np.argmin(away))
        if best is None or away[vertex] < best[0]:
            best = float(away[vertex]), name, vertex
    return None if best is None or best[0] > max(_NEAR_PIECE, _spacing(pieces[best[1]])) else best[1:]


def _spacing(flat: FloatArray) -> float:
    """Return about how far vertices lie from each other [m]."""
    return float(np.sqrt(np.ptp(flat, axis=0).prod() / len(flat)))


def nearest_line(point: ArrayLike, vertices: FloatArray, lines: Mapping[str, Iterable[int]]) -> str | None:
    """Return the name of the line that runs nearest to a point, None if none runs within 2 cm.

    Args:
        point: 3 [m].
        vertices: #V by 3 [m].
        lines: vertices of each line.
    """
    best: tuple[float, str] | None = None
    for name, ids in lines.items():
        away = _distance(np.asarray(point, dtype=float), vertices[np.asarray(list(ids), dtype=np.int64)])
        if best is None or away < best[0]:
            best = away, name
    return None if best is None or best[0] > _NEAR_LINE else best[1]


def _distance(point: FloatArray, polyline: FloatArray) -> float:
    """Return the distance of a point from a polyline (#N by 3) [m]."""
    start, step = polyline[:-1], np.diff(polyline, axis=0)
    length = np.maximum(np.einsum("ij,ij->i", step, step), 1e-30)
    share = np.clip(np.einsum("ij,ij->i", point - start, step) / length, 0.0, 1.0)
    return float(np.linalg.norm(start + share[:, None] * step - point, axis=1).min())
