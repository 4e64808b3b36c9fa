"""A piece of a pattern is checked when it is made: names, outline, darts and holes."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.core.file_names import check_label
from warpflat.surface.overlap import OVERLAP, overlap_width, overlapping

if TYPE_CHECKING:
    import shapely

    from warpflat.pattern.pieces import Edge, Piece

__all__ = ["FOLD_STRAIGHT", "SAME_POINT", "check_piece", "check_points"]

#: Ends of neighbouring edges that are closer than this [m] are one corner.
SAME_POINT = 1e-6
#: How far [m] an edge on the fold of the cloth may stray from straight.
FOLD_STRAIGHT = 5e-4
# A place in Shapely's messages: "Self-intersection[0.036 0.674]".
_PLACE = re.compile(r"\[(\S+) (\S+)\]")


def check_piece(piece: Piece, where: str) -> None:
    """Check a piece of a pattern.

    Args:
        piece: its edges, darts and holes are set.
        where: what messages begin with.

    Raises:
        InputError: a name that is unfit or occurs twice, edges that do not follow each other around a simple outline, a fold that is
            not straight, a dart whose legs are none, or a hole that crosses itself.
    """
    _check_names(piece, where)
    _check_outline(piece, where)
    _check_darts(piece, where)
    _check_holes(piece, where)


def check_points(points: ArrayLike, where: str, *, at_least: int) -> FloatArray:
    """Return points (#P by 2 [m]) as an array.

    Raises:
        InputError: another shape, fewer than `at_least`, or a value that is not finite.
    """
    array = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 2 or len(array) < at_least:
        raise InputError(f"{where}: points have shape {array.shape}; they must be #P by 2 with #P at least {at_least}")
    if not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise InputError(f"{where}: point {row} is not finite; all coordinates are metres")
    return array


def _check_names(piece: Piece, where: str) -> None:
    """Check that names are printable and unique."""
    for what, names in (
        ("edge", [e.name for e in piece.edges]),
        ("dart", [d.name for d in piece.darts]),
        ("hole", [h.name for h in piece.holes]),
        ("line", list(piece.internal_lines)),
    ):
        for name in names:
            check_label(name, f"{where}: {what}")
        doubled = sorted({n for n in names if names.count(n) > 1})
        if doubled:
            raise InputError(f"{where}: {what} {doubled[0]!r} occurs twice; names are unique in a piece")


def _check_outline(piece: Piece, where: str) -> None:
    """Check that edges follow each other around a simple outline, counter-clockwise."""
    import shapely

    if not piece.edges:
        raise InputError(f"{where} has no edges; its outline needs at least one")
    for edge, follows in zip(piece.edges, [*piece.edges[1:], piece.edges[0]], strict=True):
        gap = float(np.linalg.norm(edge.points[-1] - follows.points[0]))
        if gap > SAME_POINT:
            raise InputError(
                f"{where}: edge {edge.name!r} ends {gap * 1000:.3f} mm from where {follows.name!r} starts; "
                "edges follow each other and share their corners"
            )
        if edge.kind == "fold":
            _check_straight(edge, where)
    outline = piece.outline
    if len(outline) < 3:
        raise InputError(f"{where}: the outline has {len(outline)} points; it needs at least 3")
    polygon = shapely.Polygon(outline)
    if not polygon.is_valid or polygon.area <= 0:
        raise InputError(f"{where}: the outline {_outline_fault(polygon)}")
    if not polygon.exterior.is_ccw:
        raise InputError(f"{where}: the outline runs clockwise; list its edges counter-clockwise")


def _outline_fault(polygon: shapely.Polygon) -> str:
    """Return why a closed line is no outline, and what to do about it."""
    import shapely

    if polygon.length <= 0 or polygon.convex_hull.area <= 1e-9 * polygon.length**2:
        return "encloses no area"
    place = _PLACE.search(shapely.is_valid_reason(polygon))
    at = "" if place is None else f" at ({1e3 * float(place[1]):.1f}, {1e3 * float(place[2]):.1f}) mm in the plane"
    return f"crosses itself{at}: flat, the piece lies over itself there; cut it apart, so that no piece does"


def _check_straight(edge: Edge, where: str) -> None:
    """Check that a fold is straight."""
    start, end = edge.points[0], edge.points[-1]
    span = float(np.linalg.norm(end - start))
    if span < SAME_POINT:
        raise InputError(f"{where}: fold edge {edge.name!r} is closed; a fold is straight")
    direction = (end - start) / span
    offset = edge.points - start
    stray = float(np.abs(offset[:, 0] * direction[1] - offset[:, 1] * direction[0]).max())
    if stray > FOLD_STRAIGHT:
        raise InputError(
            f"{where}: fold edge {edge.name!r} strays {stray * 1000:.2f} mm from straight; a fold strays at most "
            f"{FOLD_STRAIGHT * 1000:.1f} mm (constrain it to a line)"
        )


def _check_darts(piece: Piece, where: str) -> None:
    """Check that a dart's legs are edges of its kind that follow each other."""
    names = [edge.name for edge in piece.edges]
    legs = []
    for dart in piece.darts:
        for leg in (dart.left, dart.right):
            if piece.edge(leg).kind != "dart":
                raise InputError(
                    f"{where}: dart {dart.name!r} uses edge {leg!r} of kind {piece.edge(leg).kind!r}, not 'dart'"
                )
        if names[(names.index(dart.left) + 1) % len(names)] != dart.right:
            raise InputError(
                f"{where}: dart {dart.name!r}: edge {dart.right!r} must follow {dart.left!r} (the left leg comes "
                "first, counter-clockwise, and ends in the tip)"
            )
        legs += [dart.left, dart.right]
    for edge in piece.edges:
        if edge.kind == "dart" and legs.count(edge.name) != 1:
            raise InputError(
                f"{where}: edge {edge.name!r} is of kind 'dart' but belongs to {legs.count(edge.name)} darts, not 1"
            )


def _check_holes(piece: Piece, where: str) -> None:
    """Check that the cloth around holes does not overlap."""
    for hole in piece.holes:
        width = overlap_width(hole.points)
        if width <= OVERLAP:
            continue
        if hole.kind == "dart":
            raise InputError(f"{where}: dart {hole.name!r} {overlapping(width)}")
        raise InputError(
            f"{where}: the cloth around hole {hole.name!r} lies on itself by {width * 1000:.1f} mm; a hole runs "
            "counter-clockwise and does not cross itself"
        )
