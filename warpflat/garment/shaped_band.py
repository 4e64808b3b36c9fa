"""Shaped waistbands: the upper strip of a skirt or trousers as pieces of their own, curved as the body is."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from warpflat.core.errors import InputError
from warpflat.core.polyline import arc_lengths
from warpflat.core.text import find_unused_name
from warpflat.garment.facings import INNER, centre_notch, facing_edges
from warpflat.garment.mark_openings import lines_inside
from warpflat.pattern.piece_parts import Edge
from warpflat.pattern.pieces import Pattern, Piece, Seam, SeamSide

__all__ = ["shortened", "with_shaped_waistband", "without_strip"]


def without_strip(piece: Piece, strip: Sequence[Edge], inner: str) -> Piece:
    """Return a piece without the strip along one of its borders, and with the parts of its lines that lie inside what is left.

    Args:
        piece: whole.
        strip: the outline of the strip, as :func:`warpflat.garment.facings.facing_edges` gives it.
        inner: name of the edge that takes the strip's place.

    Raises:
        InputError: hardly anything of a neighbouring edge is left.
    """

    names = [edge.name for edge in strip]
    at = names.index(INNER)
    covered, after, before = names[: at - 1], strip[at - 1], strip[at + 1]
    edges = []
    for edge in piece.edges:
        if edge.name == covered[0]:
            edges.append(Edge(name=inner, points=strip[at].points[::-1]))
        elif edge.name in (after.name, before.name):
            part = after if edge.name == after.name else before
            if edge.length - part.length < 0.005:
                raise InputError(
                    f"{piece.name}: strips meet at {edge.name!r}; make them narrower, or bind one of the edges"
                )
            # What the strip leaves of it: the strip lies at the start of the edge after it, at the end of the one before.
            turn = 1 if edge.name == after.name else -1
            points = edge.points[::turn]
            left = points[arc_lengths(points) > part.length + 1e-9]
            edges.append(replace(edge, points=np.vstack([part.points[::turn][-1:], left])[::turn], vertices=None))
        elif edge.name not in covered:
            edges.append(edge)
    lines = lines_inside(piece.internal_lines, np.concatenate([edge.points[:-1] for edge in edges]))
    try:
        return replace(piece, edges=edges, internal_lines=lines)
    except InputError:
        raise InputError(f"{piece.name}: nothing can be drawn beside {covered[0]!r}; take a narrower strip") from None


def with_shaped_waistband(
    pattern: Pattern, places: Sequence[tuple[str, str]], width: float, *, gaps: Collection[str] = ()
) -> Pattern:
    """Return a pattern whose upper strip is a waistband of its own, each piece cut for its outside and its inside.

    Args:
        pattern: with all its openings.
        places: pieces and edges.
        width: of the band [m].
        gaps: names of seams that an opening leaves open at their upper end.

    Raises:
        InputError: a dart ends in an edge, or the band is too wide.
    """
    pieces = {size: list(row) for size, row in pattern.pieces.items()}
    seams, called = [], {seam.name for seam in pattern.seams}
    names = {name: f"{name}_waistband" for name, _ in places}
    cut = dict[tuple[str, str], tuple[str, bool]]()
    for name, edge in places:
        for row in pieces.values():
            at = next(k for k, piece in enumerate(row) if piece.name == name)
            piece, strip = row[at], facing_edges(row[at], (edge,), width)
            row[at] = without_strip(piece, strip, f"{edge} seam")
            edges = [replace(part, kind="seam", allowance=None) if part.name == INNER else part for part in strip]
            middle = np.concatenate([part.points for part in edges]).mean(axis=0)
            grain = np.array([[0.0, 0.0], [0.0, 1.0]]) if piece.grain is None else piece.grain
            along = (grain[1] - grain[0]) / np.linalg.norm(grain[1] - grain[0])
            try:
                # Twice as often as its piece: the outside and its facing.
                band = Piece(
                    name=names[name], size=piece.size, fabric=piece.fabric, quantity=2 * piece.quantity, edges=edges,
                    paired=piece.paired and piece.quantity % 2 == 0, role="waistband",
                    grain=middle + np.outer([-0.015, 0.015], along),
                )  # fmt: skip
            except InputError:
                raise InputError(
                    f"no waistband can be drawn along {piece.name}.{strip[0].name}: make it narrower"
                ) from None
            row.append(band)
        whole = pattern.piece(name, pattern.sample)
        order = [each.name for each in whole.edges]
        place = order.index(edge)
        cut[name, order[place - 1]] = names[name], False
        cut[name, order[(place + 1) % len(order)]] = names[name], True
        words = find_unused_name(names[name].replace("_", " "), called)
        called.add(words)
        first, second = (
            SeamSide(piece=name, edge=f"{edge} seam"),
            SeamSide(piece=names[name], edge=INNER, reversed=True),
        )
        seams.append(Seam(name=words, sides=((first,), (second,)), notches=centre_notch(whole)))
    for seam in pattern.seams:
        both = [row[0] for row in seam.sides]
        # Of halves on the fold one seam is listed for both sides, and just one of them has the opening.
        opened = seam.name in gaps and not any(pattern.piece(side.piece, pattern.sample).on_fold for side in both)
        if opened or any(len(row) > 1 or (row[0].piece, row[0].edge) not in cut for row in seam.sides):
            continue
        sides = [replace(side, piece=cut[side.piece, side.edge][0]) for side in both]
        words = find_unused_name(f"{seam.name} of the waistband", called)
        called.add(words)
        seams.append(Seam(name=words, sides=((sides[0],), (sides[1],))))
    kept = [_with_moved_notches(pattern, seam, cut, width) for seam in pattern.seams]
    return replace(pattern, pieces=pieces, seams=[*kept, *seams])


def shortened(pattern: Pattern, places: Sequence[tuple[str, str]], width: float) -> Pattern:
    """Return a pattern without the strip along some free edges, which keep their names: a band or a cuff takes its place.

    Args:
        pattern: with all its openings.
        places: pieces and edges.
        width: of the strip [m].

    Raises:
        InputError: a dart ends in an edge, or the strip is too wide.
    """
    import shapely

    pieces, cut = {size: list(row) for size, row in pattern.pieces.items()}, dict[tuple[str, str], tuple[str, bool]]()
    for name, edge in places:
        for row in pieces.values():
            at = next(k for k, piece in enumerate(row) if piece.name == name)
            piece = without_strip(row[at], facing_edges(row[at], (edge,), width), edge)
            own = row[at].edge(edge)
            edges = [replace(e, kind=own.kind, allowance=own.allowance) if e.name == edge else e for e in piece.edges]
            body = shapely.Polygon(piece.outline)
            marks = {key: mark for key, mark in piece.marks.items() if body.contains(shapely.Point(mark))}
            row[at] = replace(piece, edges=edges, marks=marks)
        order = [each.name for each in pattern.piece(name, pattern.sample).edges]
        cut[name, order[order.index(edge) - 1]] = name, False
        cut[name, order[(order.index(edge) + 1) % len(order)]] = name, True
    seams = [_with_moved_notches(pattern, seam, cut, width) for seam in pattern.seams]
    return replace(pattern, pieces=pieces, seams=seams)


def _with_moved_notches(
    pattern: Pattern, seam: Seam, cut: dict[tuple[str, str], tuple[str, bool]], width: float
) -> Seam:
    """Return a seam whose given notches keep their places on the cloth where its upper end is cut off."""
    side = seam.sides[0][0]
    if seam.notches is None or (side.piece, side.edge) not in cut or len(seam.sides[0]) > 1:
        return seam
    # The strip lies at the start of the edge after the waist, and at the end of the one before it.
    at_start, by_size = cut[side.piece, side.edge][1] != side.reversed, {}
    for size in pattern.pieces:
        length = pattern.piece(side.piece, size).edge(side.edge).length
        places = [share * length - (width if at_start else 0.0) for share in seam.of_size(size).notches or ()]
        by_size[size] = tuple(p / (length - width) for p in places if 0.0 < p < length - width)
    return replace(seam, notches=by_size[pattern.sample], size_notches=by_size)
