"""Stretches of the border, by name or between two places."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core import FloatArray, InputError, IntArray, arc_lengths, nearest, polyline_length, segment_lengths
from warpflat.flat import Surface, area_vectors, as_vertex, border_loops, half_edges_of, triangulate

__all__ = ["SIDES", "line_on_border", "viewing_frame"]

SIDES = ("bottom", "left", "right", "top")
DIRECTIONS = ("against", "shortest", "with")

# A piece whose mean normal is shorter faces all ways: it goes all around.
_FACING = 0.25
# Where the mean normal is this upright the piece is seen from above or below.
_UPRIGHT = 0.95
# A border turns away from the viewer where its faces do by more than this sine, and the piece where that share of its border does.
_AWAY = 0.05
_AWAY_SHARE = 0.02
# A border vertex is a corner where the border turns by this angle [rad] on the surface. Four are its corners if no other turns by
# this share of the angle of each of them.
_CORNER = np.pi / 6
_SHARPER = 0.6
# A corner out of sight lies no further than this share of the border from the outermost point that is seen.
_NEAR = 0.05
# The best way to name four sides separates them by this share of the piece's size, and any other way by at most this share of that.
_APART = 0.1
_PLAINLY = 0.9


def viewing_frame(surface: Surface) -> FloatArray:
    """Return 3 by 3, rows: right, up and towards the viewer, for somebody who looks at the piece from outside.

    Outside is where the faces are wound counter-clockwise. Up is Y; a piece that faces up or down is seen with +Z, the
    body's front, at the bottom. A piece that goes all around is seen from +Z.
    """
    triangles, _ = triangulate(surface.faces)
    normals = area_vectors(surface.vertices, triangles)
    total = normals.sum(axis=0)
    size, area = float(np.linalg.norm(total)), float(np.linalg.norm(normals, axis=1).sum())
    towards = total / size if size > _FACING * area else np.array([0.0, 0.0, 1.0])
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
) -> IntArray:
    """Return a stretch of the border.

    Give a `side`, or `start` and `end`. Sides are those that a viewer sees from outside (see :func:`viewing_frame`):
    the longest border loop is split at its four outermost corners, those that lie furthest towards the corners of the
    piece's bounding rectangle. "left" and "right" run upwards, "top" and "bottom" from left to right. Where these are
    no corners, as on a piece that wraps round, they are the four at which the border itself turns most, measured on the surface;
    bottom and top then are the sides that lie lowest and highest, or left and right those furthest to either hand.
    Where the sides curl but a little out of sight, each corner seen is moved to the one of the border beside it.

    Args:
        surface: the surface.
        side: "top", "bottom", "left" or "right".
        start, end: a vertex on the border, or a point [m] that stands for the nearest one; equal ones give the whole
            loop, closed.
        direction: from `start` to `end`, "shortest": the way that is shorter in metres; "with": as the border runs (the surface to
            its left, seen from outside); "against": the other way.
        as_read: indices count the vertices of the file (from 0) instead of the surface's.

    Raises:
        InputError: for an unknown side or direction, a place that is not on the border, or a border whose four corners, or which
            way up they lie, cannot be decided.
    """
    loops = border_loops(surface.faces, surface.vertices)
    if side is not None:
        if start is not None or end is not None:
            raise InputError("a stretch of the border is a side, or from start to end, not both")
        loop = loops[0]
        if side not in SIDES:
            raise InputError(f"unknown side {side!r} of the border; {nearest(str(side), SIDES)}")
        at = _corners(surface, loop, side)
        # Seen from outside the border runs counter-clockwise.
        sides = {"left": ("tl", "bl"), "bottom": ("bl", "br"), "right": ("br", "tr"), "top": ("tr", "tl")}
        line = _between(loop, at[sides[side][0]], at[sides[side][1]])
        return line[::-1].copy() if side in ("left", "top") else line
    if start is None or end is None:
        raise InputError(f"a stretch of the border needs a side ({', '.join(SIDES)}), or both start and end")
    if direction not in DIRECTIONS:
        raise InputError(f"unknown direction {direction!r} along the border; {nearest(str(direction), DIRECTIONS)}")
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
        length = [polyline_length(surface.vertices[path]) for path in (along, back)]
        direction = "with" if length[0] <= length[1] else "against"
    return along if direction == "with" else back


def _between(loop: IntArray, i: int, j: int) -> IntArray:
    """Return the loop from position i to position j, both included; the whole loop, closed, if they are one."""
    return np.roll(loop, -i)[np.arange((j - i - 1) % len(loop) + 2) % len(loop)]


def _corners(surface: Surface, loop: IntArray, side: str) -> dict[str, int]:
    """Return the positions in the loop of the corners "bl", "br", "tr" and "tl".

    Raises:
        InputError: there are fewer than four, or more; it names the `side` that the user asked for.
    """
    right, up, towards = viewing_frame(surface)
    x, y = surface.vertices[loop] @ right, surface.vertices[loop] @ up
    x = (x - x.min()) / max(float(np.ptp(x)), np.finfo(float).tiny)
    y = (y - y.min()) / max(float(np.ptp(y)), np.finfo(float).tiny)
    corner = {"bl": -x - y, "br": x - y, "tr": x + y, "tl": y - x}
    at = {key: int(np.argmax(value)) for key, value in corner.items()}
    # The border turns at each of its vertices by pi less the angles of the faces there.
    sides = half_edges_of(surface)
    x, ahead, before = surface.vertices, sides.head, np.empty_like(sides.tail)
    before[sides.next] = sides.tail
    u, v = x[ahead] - x[sides.tail], x[before] - x[sides.tail]
    angle = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v))
    turn = np.asarray(np.pi - np.bincount(sides.tail, angle, minlength=len(x))[loop])
    if len(set(at.values())) == 4 and turn[list(at.values())].min() > _CORNER:
        return at
    order = np.argsort(-turn, kind="stable")
    least = float(turn[order[3]]) if len(turn) > 3 else 0.0
    if least >= _CORNER and not (len(turn) > 4 and turn[order[4]] > _SHARPER * least):
        # There are four corners, and the border hardly turns anywhere else.
        sharp = np.sort(order[:4])
        # The sides between four corners lie where their names say. Of each the mean place, weighed by length.
        middle = np.empty((4, 3))
        for k in range(4):
            points = surface.vertices[_between(loop, int(sharp[k]), int(sharp[(k + 1) % 4]))]
            length = segment_lengths(points)
            middle[k] = np.average(0.5 * (points[1:] + points[:-1]), axis=0, weights=length)
        size = float(np.linalg.norm(np.ptp(surface.vertices[loop], axis=0)))
        # As it is seen by somebody who stands before the piece, also if it faces up or down; then as it faces.
        towards, upright = viewing_frame(surface)[2] * [1.0, 0.0, 1.0], np.array([0.0, 1.0, 0.0])
        level = float(np.linalg.norm(towards))
        standing = np.cross(upright, towards / level) if level > _FACING else np.array([1.0, 0.0, 0.0])
        for right, up in ((standing, upright), viewing_frame(surface)[:2]):
            x, y = middle @ right, middle @ up
            # Beginning with each side in turn: bottom, right, top, left.
            fits = np.array([x[(k + 1) % 4] - x[(k + 3) % 4] + y[(k + 2) % 4] - y[k] for k in range(4)])
            first = int(np.argmax(fits))
            if fits[first] > _APART * size and np.delete(fits, first).max() < _PLAINLY * fits[first]:
                return {key: int(sharp[(first + k) % 4]) for k, key in enumerate(("bl", "br", "tr", "tl"))}
        raise InputError(
            f"which of the four sides of {surface.name!r} is {side!r} cannot be told from the front; give start and end instead"
        )
    # How much of the border's length has the surface beside it turned away from the viewer?
    triangles, face = triangulate(surface.faces)
    vector = area_vectors(surface.vertices, triangles)
    normal = np.stack([np.bincount(face, vector[:, k], minlength=len(surface.faces)) for k in range(3)], axis=1)
    away = normal @ towards < -_AWAY * np.linalg.norm(normal, axis=1)
    border = sides.count[sides.edge] == 1
    length = np.linalg.norm(surface.vertices[sides.head[border]] - surface.vertices[sides.tail[border]], axis=1)
    if float(length[away[sides.face[border]]].sum() / length.sum()) > _AWAY_SHARE:
        # Where a side curls a little out of sight, the outermost point that is seen lies beside the corner: where it turns most.
        station = arc_lengths(surface.vertices[loop], closed=True)
        near = {}
        for key, place in at.items():
            distance = np.abs(station[:-1] - station[place])
            is_near = np.minimum(distance, station[-1] - distance) < _NEAR * station[-1]
            near[key] = int(np.argmax(np.where(is_near, turn, -np.inf)))
        if len(set(near.values())) == 4 and turn[list(near.values())].min() > _CORNER:
            return near
        raise InputError(
            f"{surface.name!r} wraps round, and its border does not turn at four corners only; give start and end instead of "
            f"side {side!r}"
        )
    if len(set(at.values())) < 4:
        raise InputError(
            f"the border of {surface.name!r} does not show four corners from the front; give start and end instead of "
            f"side {side!r}"
        )
    return at
