"""Stretches of the border, by name or between two places."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.errors import InputError, nearest
from warpflat.surface.mesh import Surface
from warpflat.surface.paths import as_vertex
from warpflat.surface.topology import border_loops, triangulate

__all__ = ["SIDES", "line_on_border", "viewing_frame"]

SIDES = ("bottom", "left", "right", "top")
DIRECTIONS = ("against", "shortest", "with")

# Where the mean normal is this upright the piece is seen from above or below.
_UPRIGHT = 0.95


def viewing_frame(surface: Surface) -> NDArray[np.float64]:
    """3 by 3, rows: right, up and towards the viewer, for somebody who looks at the piece from outside.

    Outside is where the faces are wound counter-clockwise. Up is Y; a piece that faces up or down is seen with +Z, the
    body's front, at the bottom. A piece that goes all around is seen from +Z.
    """
    triangles, _ = triangulate(surface.faces)
    p = surface.vertices[triangles]
    normals = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    total = normals.sum(axis=0)
    size, area = float(np.linalg.norm(total)), float(np.linalg.norm(normals, axis=1).sum())
    towards = total / size if size > 0.05 * area else np.array([0.0, 0.0, 1.0])
    upright = np.array([0.0, 1.0, 0.0]) if abs(towards[1]) < _UPRIGHT else np.array([0.0, 0.0, -1.0])
    right = np.cross(upright, towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


def line_on_border(
    surface: Surface,
    side: str | None = None,
    *,
    start: int | ArrayLike | None = None,
    end: int | ArrayLike | None = None,
    direction: Literal["shortest", "with", "against"] = "shortest",
    as_read: bool = False,
) -> NDArray[np.int32]:
    """A stretch of the border.

    Give a `side`, or `start` and `end`. Sides are those that a viewer sees from outside (see :func:`viewing_frame`):
    the longest border loop is split at its four outermost corners, those that lie furthest towards the corners of the
    piece's bounding rectangle. "left" and "right" run upwards, "top" and "bottom" from left to right.

    Args:
        surface: where.
        side: "top", "bottom", "left" or "right".
        start, end: a vertex on the border, or a point [m] that stands for the nearest one; equal ones give the whole
            loop, closed.
        direction: which way from `start` to `end`: the shorter one in metres, the one in which the border runs (the
            surface to its left, seen from outside), or the one against it.
        as_read: indices count the vertices of the file (from 0) instead of the surface's.

    Raises:
        InputError: for an unknown side or direction, or a place that is not on the border.
    """
    loops = border_loops(surface.faces, surface.vertices)
    if side is not None:
        if start is not None or end is not None:
            raise InputError("a stretch of the border is a side, or from start to end, not both")
        return _side(surface, loops[0], side)
    if start is None or end is None:
        raise InputError(f"a stretch of the border needs a side ({', '.join(SIDES)}), or both start and end")
    if direction not in DIRECTIONS:
        raise InputError(f"unknown direction {direction!r} along the border; {nearest(str(direction), DIRECTIONS)}")
    return _stretch(surface, loops, start, end, direction, as_read)


def _between(loop: NDArray[np.int32], i: int, j: int) -> NDArray[np.int32]:
    """The loop from position i to position j, both included; the whole of it, closed, if they are one."""
    return np.roll(loop, -i)[np.arange((j - i - 1) % len(loop) + 2) % len(loop)]


def _side(surface: Surface, loop: NDArray[np.int32], side: str) -> NDArray[np.int32]:
    if side not in SIDES:
        raise InputError(f"unknown side {side!r} of the border; {nearest(str(side), SIDES)}")
    right, up, _ = viewing_frame(surface)
    x, y = surface.vertices[loop] @ right, surface.vertices[loop] @ up
    x = (x - x.min()) / max(float(np.ptp(x)), np.finfo(float).tiny)
    y = (y - y.min()) / max(float(np.ptp(y)), np.finfo(float).tiny)
    corner = {"tl": y - x, "bl": -x - y, "br": x - y, "tr": x + y}
    at = {key: int(np.argmax(value)) for key, value in corner.items()}
    if len(set(at.values())) < 4:
        raise InputError(
            f"the border of {surface.name!r} does not show four corners from the front; give start and end instead of "
            f"side {side!r}"
        )
    # Seen from outside the border runs counter-clockwise.
    ways = {"left": ("tl", "bl"), "bottom": ("bl", "br"), "right": ("br", "tr"), "top": ("tr", "tl")}
    line = _between(loop, at[ways[side][0]], at[ways[side][1]])
    return line[::-1].copy() if side in ("left", "top") else line


def _stretch(
    surface: Surface,
    loops: list[NDArray[np.int32]],
    start: int | ArrayLike,
    end: int | ArrayLike,
    direction: str,
    as_read: bool,
) -> NDArray[np.int32]:
    border = np.unique(np.concatenate(loops))
    a, b = (as_vertex(surface, place, as_read=as_read, among=border) for place in (start, end))
    for vertex in (a, b):
        if vertex not in border:
            raise InputError(f"vertex {vertex} of {surface.name!r} does not lie on its border")
    loop = next(loop for loop in loops if a in loop)
    if b not in loop:
        raise InputError(f"vertices {a} and {b} of {surface.name!r} lie on different border loops")
    i, j = int(np.flatnonzero(loop == a)[0]), int(np.flatnonzero(loop == b)[0])
    along, back = _between(loop, i, j), _between(loop, j, i)[::-1].copy()
    if direction == "shortest":
        length = [np.linalg.norm(np.diff(surface.vertices[way], axis=0), axis=1).sum() for way in (along, back)]
        direction = "with" if length[0] <= length[1] else "against"
    return along if direction == "with" else back
