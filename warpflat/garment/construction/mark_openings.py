"""Openings on a pattern: a zip's line and the notch at its end, edges of slits and vents, godets, button stands, wraps, keyholes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from warpflat.core import FloatArray, InputError, find_unused_name, part_between, polyline_length
from warpflat.garment.construction.button_stand import bust_depth, button_depths, with_button_stand, with_wrap
from warpflat.garment.construction.details import OpeningTable
from warpflat.garment.construction.edges import (
    ON,
    above_and_below,
    added,
    changed,
    direction,
    downwards,
    drawn_on,
    edge_at,
    falling,
    in_sizes,
    lengths_of,
    lines_inside,
    lines_of,
    new_piece,
    parted,
    redrawn,
    runs_down,
    sewn,
    sewn_places,
    with_pieces,
)
from warpflat.garment.construction.openings import OpeningPart
from warpflat.garment.construction.strips import folded_strip
from warpflat.pattern import Edge, Pattern, Piece, Seam, SeamOpening, SeamSide, even_notches

__all__ = ["mark_openings", "with_notches"]

# How far inside the sewing line the line of a zip is drawn [m].
_INSIDE = 0.004
# A seam's own notches keep this clear of a zip's end [m].
_CLEAR = 0.030
# A slit or vent closer to the whole seam than this [m] leaves nothing to sew.
_LEAST_SEWN = 0.02
#: Finished width of the ties of a wrap [m].
TIE_WIDTH = 0.025

#: By size and opening, the seams that the opening runs along.
Placed = Mapping[str, Sequence[Sequence[OpeningPart]]]
#: Of one opening.
_Parts = Mapping[str, Sequence[OpeningPart]]


def mark_openings(pattern: Pattern, openings: Sequence[OpeningTable], placed: Placed) -> Pattern:
    """Return a pattern with its openings drawn.

    A zip is a line along its edges with its name, and a notch at its end. A slit or a vent is an edge of its own, which
    is not sewn and has an allowance of its width; a godet is sewn into it. Where it buttons or wraps, a piece runs beyond its edge,
    which is not sewn. A keyhole is drawn on its piece.

    Args:
        pattern: pieces and seams, without mirror images.
        openings: to be drawn.
        placed: see :data:`Placed`.

    Raises:
        InputError: a slit takes the whole seam, or the pattern has no such seam.
    """
    for number, opening in enumerate(openings):
        parts = {size: row[number] for size, row in placed.items()}
        try:
            depths = _button_depths(pattern, opening, parts) if opening.kind == "buttons" else {}
            for part in parts[pattern.sample]:
                if _is_open(opening, part):
                    pattern = _with_opening(pattern, opening, part, parts, depths)
        except InputError as error:
            raise InputError(f"openings[{number}]: {error}") from None
    return pattern


def _seam_along(pattern: Pattern, part: OpeningPart) -> Seam:
    """Return the seam that a part of an opening lies in.

    Raises:
        InputError: the pattern does not have it.
    """
    for seam in pattern.seams:
        if seam.name == part.seam:
            return seam
    raise InputError(f"the pattern has no seam {part.seam!r} of its own")


def _with_opening(
    pattern: Pattern, opening: OpeningTable, part: OpeningPart, parts: _Parts, depths: Mapping[str, FloatArray]
) -> Pattern:
    """Return a pattern with what an opening does to one of its seams, or to the piece across which it lies."""
    if opening.kind == "keyhole":
        return redrawn(pattern, part.piece, lambda piece: _keyhole(piece, opening))
    seam = _seam_along(pattern, part)
    if opening.kind == "wrap":
        if seam.openings:
            raise InputError(f"{seam.name!r} has another opening; a wrap is open all along it")
        # Its halves run beyond the centre line, each over the other; they are not sewn there, but tied.
        edges = {side.piece: side.edge for side in seam.stretches}
        pattern = replace(pattern, seams=[each for each in pattern.seams if each.name != seam.name])
        wrapped = [with_wrap(piece, edge, opening) for name, edge in edges.items() for piece in in_sizes(pattern, name)]
        pattern = with_pieces(pattern, wrapped)
        if not opening.tie or any(piece.name == "tie" for piece in pattern.pieces[pattern.sample]):
            return pattern
        return added(
            pattern,
            lambda like: folded_strip("tie", like, opening.tie, TIE_WIDTH, role="tie", quantity=2, grain=(0.2, 0.5)),
        )
    end = _reach(opening, part)[1]
    if opening.kind != "godet":
        opened = SeamOpening(
            kind=opening.kind, length=_length(opening, parts[pattern.sample]), begin=opening.start - part.before, whole=end >= part.whole,
            style=opening.style if opening.kind == "zip" else "",
        )  # fmt: skip
        seam = replace(seam, openings=(*seam.openings, opened))
        pattern = _with_seam(pattern, seam)
    if opening.kind == "zip":
        return _with_zip(pattern, seam, opening, parts)
    if opening.kind == "buttons":
        # A button stand on both sides of the seam, which is sewn only below it, if the stand ends within the seam.
        if any(len(row) > 1 for row in seam.sides) or opening.start > 0.0:
            raise InputError("buttons begin at the upper end of a seam between two edges")

        def buttoned(piece: Piece, edge: str) -> Piece:
            own = _part_of(parts[piece.size], seam)
            below = depths[piece.size] - own.before
            here = below[(below >= 0.0) & (below < own.whole)]
            stop = _reach(opening, own)[1]
            # All along an edge that is rounded it ends with that.
            return with_button_stand(piece, edge, opening, stop if stop < own.whole else np.inf, here)

        places = dict.fromkeys(side.place for side in seam.stretches)
        pattern = replace(
            pattern, seams=[each for each in pattern.seams if each.name != seam.name or not seam.openings[-1].whole]
        )
        return with_pieces(
            pattern, [buttoned(piece, edge) for name, edge in places for piece in in_sizes(pattern, name)]
        )
    if any(len(row) > 1 for row in seam.sides) or opening.start > 0.0:
        raise InputError(f"a {opening.kind} begins at the lower end of a seam between two edges")
    for side in [side for side in seam.stretches if not side.mirrored]:
        names = {edge.name for edge in pattern.piece(side.piece, pattern.sample).edges}
        if names & {f"{side.edge} {kind}" for kind in ("slit", "vent", "godet")}:
            raise InputError(f"the lower end of {seam.name!r} is open already")
        for row in parts.values():
            whole = _part_of(row, seam).whole
            if whole - opening.length < _LEAST_SEWN:
                raise InputError(
                    f"a {opening.kind} of {1e3 * opening.length:.0f} mm leaves nothing of the seam {seam.name!r}, "
                    f"{1e3 * whole:.0f} mm long; make it shorter, or leave the seam out of the form"
                )
        pattern = changed(pattern, side.place, lambda piece, edge: _free_end(piece, edge, opening))
    return _with_godet(pattern, seam, opening) if opening.kind == "godet" else pattern


def _reach(opening: OpeningTable, part: OpeningPart) -> tuple[float, float]:
    """Return where along a seam, from the end of measuring, an opening begins and ends [m]."""
    begin, end = opening.start - part.before, opening.start + opening.length - part.before
    return max(0.0, begin), min(part.whole, end)


def _is_open(opening: OpeningTable, part: OpeningPart) -> bool:
    """Return whether an opening reaches into a seam along its line."""
    begin, end = _reach(opening, part)
    return end > begin


def _part_of(parts: Sequence[OpeningPart], seam: Seam) -> OpeningPart:
    return next(part for part in parts if part.seam == seam.name)


def _length(opening: OpeningTable, parts: Sequence[OpeningPart]) -> float:
    """Return how long an opening is that runs along some seams [m]: at most all along them."""
    return min(opening.length, sum(each.whole for each in parts))


def _with_seam(pattern: Pattern, seam: Seam) -> Pattern:
    """Return a pattern with another seam in place of that of its name."""
    return replace(pattern, seams=[seam if each.name == seam.name else each for each in pattern.seams])


def _with_zip(pattern: Pattern, seam: Seam, opening: OpeningTable, parts: _Parts) -> Pattern:
    """Return a pattern with the line of a zip beside the edges of a seam, and a notch where it ends, if it does within the seam."""
    import shapely

    for row in seam.sides:
        first = pattern.piece(row[0].piece, pattern.sample)
        # From the upper end, past the darts that part a side into several edges.
        passed = dict.fromkeys(parts, 0.0)
        for side in row if downwards(first, row[0].edge)[1] != row[0].reversed else row[::-1]:

            def beside_edge(piece: Piece, edge: str = side.edge, passed: Mapping[str, float] = passed) -> Piece:
                begin, stop = (
                    place - passed[piece.size] for place in _reach(opening, _part_of(parts[piece.size], seam))
                )
                line = np.asarray(shapely.LineString(piece.edge(edge).points).offset_curve(_INSIDE).coords)
                line = falling(piece, line)
                begin, stop = max(begin, 0.0), min(stop, polyline_length(line))
                title = f"{opening.style} zip {1e3 * _length(opening, parts[piece.size]):.0f} mm"
                return drawn_on(piece, [(title, part_between(line, begin, stop))] if stop > begin else [])

            if not side.mirrored:
                pattern = redrawn(pattern, side.piece, beside_edge)
            passed = {size: past + edge_at(pattern, side, size).length for size, past in passed.items()}
    if seam.openings[-1].whole:
        return pattern
    return with_notches(pattern, seam, {size: [_reach(opening, _part_of(row, seam))[1]] for size, row in parts.items()})


def with_notches(pattern: Pattern, seam: Seam, lengths: Mapping[str, Sequence[float]]) -> Pattern:
    """Return a pattern with more notches in a seam, which its own keep clear of; if it has none, those are spaced as on any seam.

    Args:
        pattern: with the seam.
        seam: whose first side runs along one edge or more.
        lengths: by size, from the upper end of the seam [m].
    """
    row, by_size = seam.sides[0], dict[str, tuple[float, ...]]()
    down = downwards(pattern.piece(row[0].piece, pattern.sample), row[0].edge)[1]
    for size, at in lengths.items():
        whole = sum(lengths_of(pattern, row, size))
        shares = np.asarray(at) / whole if down != row[0].reversed else 1.0 - np.asarray(at) / whole
        given = seam.of_size(size).notches
        spaced = given if given is not None else even_notches(whole)
        kept = [each for each in spaced if np.abs(each - shares).min() * whole > _CLEAR]
        by_size[size] = tuple(sorted([*shares.tolist(), *kept]))
    return _with_seam(pattern, replace(seam, notches=by_size[pattern.sample], size_notches=by_size))


def _button_depths(pattern: Pattern, opening: OpeningTable, parts: _Parts) -> dict[str, FloatArray]:
    """Return by size how far below the upper end of an opening its buttons lie [m], evenly through all of its seams."""
    depths = dict[str, FloatArray]()
    # The sample size first: the others have as many buttons.
    for size in sorted(pattern.pieces, key=lambda each: each != pattern.sample):
        busts = list[float]()
        for part in (part for part in parts[size] if _is_open(opening, part)):
            name, edge = _seam_along(pattern, part).stretches[0].place
            bust = bust_depth(pattern.piece(name, size), edge)
            busts += [] if bust is None else [part.before + bust]
        count = len(depths[pattern.sample]) if depths else None
        depths[size] = button_depths(opening, _length(opening, parts[size]), next(iter(busts), None), count)
    return depths


def _with_godet(pattern: Pattern, seam: Seam, opening: OpeningTable) -> Pattern:
    """Return a pattern with a wedge, a sector of a circle, in the lower end of a seam, whose edges have that end as edges of their own.

    On the fold a seam stands for both sides of the body.
    """
    first = seam.sides[0][0]
    shell, freed = pattern.piece(first.piece, pattern.sample), f"{first.edge} godet"
    # The edge beyond its lower end is the hem, which runs on along the wedge.
    hem = shell.edge(above_and_below(shell, freed)[1])
    if (shell.name, hem.name) in sewn_places(pattern):
        raise InputError(f"a godet runs out into a hem; {seam.name!r} ends at {hem.name!r}, which is sewn")
    half = 0.5 * opening.width / opening.length
    turn = np.linspace(-half, half, 2 * max(8, round(np.degrees(half) / 2.5)) + 1)
    arc = opening.length * np.column_stack([np.sin(turn), -np.cos(turn)])
    known = {piece.name.replace("_", " ") for piece in pattern.pieces[pattern.sample]}
    apex, name = np.zeros((1, 2)), find_unused_name("godet", known).replace(" ", "_")
    both = 2 if all(pattern.piece(row[0].piece, pattern.sample).on_fold for row in seam.sides) else 1

    def wedge(piece: Piece) -> Piece:
        side = piece.edge(freed)
        edges = [
            Edge(name="left", points=np.vstack([apex, arc[:1]]), allowance=side.allowance),
            Edge(name=hem.name, points=arc, kind=hem.kind, allowance=hem.allowance),
            Edge(name="right", points=np.vstack([arc[-1:], apex]), allowance=side.allowance),
        ]
        grain = np.array([[0.0, -0.8 * opening.length], [0.0, -0.3 * opening.length]])
        return new_piece(name, piece, edges, "shell", quantity=both, grain=grain)

    pattern = redrawn(pattern, first.piece, wedge)
    for (side,) in seam.sides:
        free = f"{side.edge} godet"
        down = downwards(pattern.piece(side.piece, pattern.sample), free)[1]
        # A piece whose edge runs up lies to the left of it; its mirror image to the right.
        edge = "left" if down == side.mirrored else "right"
        other = SeamSide(piece=name, edge=edge, reversed=edge == "right")
        pattern = sewn(pattern, f"{seam.name} godet", replace(side, edge=free, reversed=not down), other)
    return pattern


def _keyhole(piece: Piece, opening: OpeningTable) -> Piece:
    import shapely

    line = lines_of(piece).get(opening.seam)
    if line is None:
        raise InputError(f"a keyhole is cut along a line inside its piece; {piece.name} has no {opening.seam!r} inside")
    slit = part_between(falling(piece, line), 0.0, opening.length)
    along = direction(slit)
    across, radius = np.array([along[1], -along[0]]), 0.5 * opening.width
    turn = np.radians(np.linspace(-150.0, 150.0, 33))
    centre = slit[-1] - radius * along
    ring = centre + radius * (np.cos(turn)[:, None] * along + np.sin(turn)[:, None] * across)
    half = radius * np.sin(np.radians(30.0))
    shapes = {"keyhole": slit[[0, -1]], "keyhole end": ring}
    for number, (sign, end) in enumerate(((-1.0, ring[0]), (1.0, ring[-1]))):
        shapes[f"keyhole side {number + 1}"] = np.array([slit[0] + sign * half * across, end])
    body = shapely.Polygon(piece.outline).buffer(ON)
    button = slit[0] + 0.010 * along + (half + 0.008) * across
    marks = [("button", button)] if body.contains(shapely.Point(button)) else []
    return drawn_on(piece, lines_inside(shapes, piece.outline).items(), marks)


def _free_end(piece: Piece, edge: Edge, opening: OpeningTable) -> Sequence[Edge]:
    """Return an edge of a piece with its lower end as an edge of its own."""
    free = find_unused_name(f"{edge.name} {opening.kind}", {each.name for each in piece.edges})
    how: dict[str, Any] = {} if opening.kind == "godet" else {"kind": "hem", "allowance": opening.width}
    if runs_down(piece, edge.points):
        above, below = parted(edge, edge.length - opening.length, (edge.name, free))
        return above, replace(below, **how)
    below, above = parted(edge, opening.length, (free, edge.name))
    return replace(below, **how), above
