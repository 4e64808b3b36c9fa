"""A piece of a pattern is checked when it is made: names, outline, darts and holes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.file_names import check_label
from warpflat.pattern.piece_parts import FOLD_STRAIGHT, SAME_POINT, Dart, Edge, Hole
from warpflat.surface.overlap import OVERLAP, overlap_width, overlapping

if TYPE_CHECKING:
    import shapely

__all__ = ["check_piece"]

# A place in Shapely's messages: "Self-intersection[0.036 0.674]".
_PLACE = re.compile(r"\[(\S+) (\S+)\]")


def check_piece(
    where: str, *, edges: Sequence[Edge], darts: Sequence[Dart], holes: Sequence[Hole], lines: Mapping[str, FloatArray]
) -> None:
    """Check a piece of a pattern.

    Args:
        where: what messages begin with.
        edges, darts, holes: of the piece.
        lines: inside it, by name.

    Raises:
        InputError: a name that is unfit or occurs twice, edges that do not follow each other around a simple outline, a fold that is
            not straight, a dart whose legs are none, or a hole that crosses itself.
    """
    _check_names(where, edges=edges, darts=darts, holes=holes, lines=lines)
    _check_outline(edges, where)
    _check_darts(edges, darts, where)
    _check_holes(holes, where)


def _check_names(
    where: str, *, edges: Sequence[Edge], darts: Sequence[Dart], holes: Sequence[Hole], lines: Mapping[str, FloatArray]
) -> None:
    """Check that names are printable and unique."""
    for what, names in (
        ("edge", [e.name for e in edges]),
        ("dart", [d.name for d in darts]),
        ("hole", [h.name for h in holes]),
        ("line", list(lines)),
    ):
        for name in names:
            check_label(name, f"{where}: {what}")
        doubled = sorted({n for n in names if names.count(n) > 1})
        if doubled:
            raise InputError(f"{where}: {what} {doubled[0]!r} occurs twice; names are unique in a piece")


def _check_outline(edges: Sequence[Edge], where: str) -> None:
    """Check that edges follow each other around a simple outline, counter-clockwise."""
    import shapely

    if not edges:
        raise InputError(f"{where} has no edges; its outline needs at least one")
    for edge, follows in zip(edges, [*edges[1:], edges[0]], strict=True):
        gap = float(np.linalg.norm(edge.points[-1] - follows.points[0]))
        if gap > SAME_POINT:
            raise InputError(
                f"{where}: edge {edge.name!r} ends {gap * 1000:.3f} mm from where {follows.name!r} starts; "
                "edges follow each other and share their corners"
            )
        if edge.kind == "fold":
            _check_straight(edge, where)
    outline = np.concatenate([edge.points[:-1] for edge in edges])
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


def _check_darts(edges: Sequence[Edge], darts: Sequence[Dart], where: str) -> None:
    """Check that a dart's legs are edges of its kind that follow each other."""
    by_name = {edge.name: edge for edge in edges}
    names = list(by_name)
    legs = []
    for dart in darts:
        for leg in (dart.left, dart.right):
            if leg not in by_name:
                raise InputError(f"{where} has no edge {leg!r}; {nearest(leg, names)}")
            if by_name[leg].kind != "dart":
                raise InputError(
                    f"{where}: dart {dart.name!r} uses edge {leg!r} of kind {by_name[leg].kind!r}, not 'dart'"
                )
        if names[(names.index(dart.left) + 1) % len(names)] != dart.right:
            raise InputError(
                f"{where}: dart {dart.name!r}: edge {dart.right!r} must follow {dart.left!r} (the left leg comes "
                "first, counter-clockwise, and ends in the tip)"
            )
        legs += [dart.left, dart.right]
    for edge in edges:
        if edge.kind == "dart" and legs.count(edge.name) != 1:
            raise InputError(
                f"{where}: edge {edge.name!r} is of kind 'dart' but belongs to {legs.count(edge.name)} darts, not 1"
            )


def _check_holes(holes: Sequence[Hole], where: str) -> None:
    """Check that the cloth around holes does not overlap."""
    for hole in holes:
        width = overlap_width(hole.points)
        if width <= OVERLAP:
            continue
        if hole.kind == "dart":
            raise InputError(f"{where}: dart {hole.name!r} {overlapping(width)}")
        raise InputError(
            f"{where}: the cloth around hole {hole.name!r} lies on itself by {width * 1000:.1f} mm; a hole runs "
            "counter-clockwise and does not cross itself"
        )
