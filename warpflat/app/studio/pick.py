"""Clicks on a form or a pattern: which piece, vertex and line is meant."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core import FloatArray, IntArray, nearest_on_polyline
from warpflat.flat import triangulate

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
    start, ray = np.asarray(origin, dtype=float), np.asarray(direction, dtype=float)
    best: tuple[float, str, int] | None = None
    for name, (vertices, faces) in pieces.items():
        triangles, _ = triangulate(faces)
        # Where the ray meets each triangle: start + t ray = corner + u (second - corner) + v (third - corner).
        corners = vertices[triangles]
        sides = np.stack(
            [np.broadcast_to(-ray, (len(corners), 3)), *(corners[:, 1:] - corners[:, :1]).swapaxes(0, 1)], -1
        )
        met, distance = np.abs(np.linalg.det(sides)) >= 1e-15, np.full(len(corners), np.inf)
        t, u, v = np.linalg.solve(sides[met], (start - corners[met, 0])[:, :, None])[..., 0].T
        distance[met] = np.where((u >= -1e-9) & (v >= -1e-9) & (u + v <= 1.0 + 1e-9) & (t > 0.0), t, np.inf)
        number = int(np.argmin(distance))
        if distance[number] < (np.inf if best is None else best[0]):
            away = np.linalg.norm(corners[number] - (start + distance[number] * ray), axis=1)
            best = float(distance[number]), name, int(triangles[number][np.argmin(away)])
    return None if best is None else best[1:]


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
    if best is None:
        return None
    flat = pieces[best[1]]
    # About how far vertices lie from each other.
    spacing = float(np.sqrt(np.ptp(flat, axis=0).prod() / len(flat)))
    return None if best[0] > max(_NEAR_PIECE, spacing) else best[1:]


def nearest_line(point: ArrayLike, vertices: FloatArray, lines: Mapping[str, Iterable[int]]) -> str | None:
    """Return the name of the line that runs nearest to a point, None if none runs within 2 cm.

    Args:
        point: 3 [m].
        vertices: #V by 3 [m].
        lines: vertices of each line.
    """
    place, best = np.asarray(point, dtype=float), None
    for name, ids in lines.items():
        polyline = vertices[np.asarray(list(ids), dtype=np.int64)]
        away = float(np.linalg.norm(nearest_on_polyline(place, polyline) - place))
        if best is None or away < best[0]:
            best = away, name
    return None if best is None or best[0] > _NEAR_LINE else best[1]
