"""Openings on a pattern: a zip's line and the notch at its end, edges of slits and vents, godets, button stands, wraps, keyholes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from warpflat.core import FloatArray, InputError, find_unused_name, part_between, polyline_length
from warpflat.garment.construction.button_stand import bust_depth, button_depths, with_button_stand, with_wrap
from warpflat.garment.construction.openings import Opening, OpeningPart
from warpflat.garment.construction.strips import Strip, strip_edges, swept
from warpflat.pattern import Edge, Pattern, Piece, Seam, SeamOpening, SeamSide

__all__ = ["lines_inside", "mark_openings", "with_notches"]

# How far inside the sewing line the line of a zip is drawn [m].
_INSIDE = 0.004
# A seam's own notches keep this clear of a zip's end [m], and are this far apart, as in `warpflat.pattern.drafting.notches`.
_CLEAR, _SPACING = 0.030, 0.200
# A slit or vent closer to the whole seam than this [m] leaves nothing to sew.
_LEAST_SEWN = 0.02
#: Finished width of the ties of a wrap [m].
TIE_WIDTH = 0.025

#: By size and opening, the seams that the opening runs along.
Placed = Mapping[str, Sequence[Sequence[OpeningPart]]]


def mark_openings(pattern: Pattern, openings: Sequence[Opening], placed: Placed) -> Pattern:
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
        for part in placed[pattern.sample][number]:
            begin, end = _reach(opening, part)
            if end <= begin:
                continue
            if opening.kind == "keyhole":
                pieces = {
                    size: [_keyhole(piece, opening) if piece.name == part.piece else piece for piece in row]
                    for size, row in pattern.pieces.items()
                }
                pattern = replace(pattern, pieces=pieces)
                continue
            seam = next((each for each in pattern.seams if each.name == part.seam), None)
            if seam is None:
                raise InputError(f"openings[{number}]: the pattern has no seam {part.seam!r} of its own")
            if opening.kind == "wrap":
                if seam.openings:
                    raise InputError(
                        f"openings[{number}]: {seam.name!r} has another opening; a wrap is open all along it"
                    )
                pattern = _with_wrap(pattern, seam, opening)
                continue
            if opening.kind != "godet":
                opened = SeamOpening(
                    kind=opening.kind, length=min(opening.length, sum(each.whole for each in placed[pattern.sample][number])),
                    begin=begin, whole=end >= part.whole, style=opening.style if opening.kind == "zip" else "",
                )  # fmt: skip
                seam = replace(seam, openings=(*seam.openings, opened))
                pattern = replace(pattern, seams=[seam if each.name == seam.name else each for each in pattern.seams])
            if opening.kind == "zip":
                pattern = _with_zip(pattern, seam, opening, end if end < part.whole else None, number, placed)
            elif opening.kind == "buttons":
                pattern = _with_buttons(pattern, seam, opening, number, placed)
            else:
                sides = [side for row in seam.sides for side in row]
                if any(len(row) > 1 for row in seam.sides) or opening.start > 0.0:
                    raise InputError(
                        f"openings[{number}]: a {opening.kind} begins at the lower end of a seam between two edges"
                    )
                for side in (side for side in sides if not side.mirrored):
                    names = {edge.name for edge in pattern.piece(side.piece, pattern.sample).edges}
                    if names & {f"{side.edge} {kind}" for kind in ("slit", "vent", "godet")}:
                        raise InputError(f"openings[{number}]: the lower end of {seam.name!r} is open already")
                pieces = {size: list(row) for size, row in pattern.pieces.items()}
                for size in pieces:
                    part = _part_of(placed, size, number, seam.name)
                    if part.whole - opening.length < _LEAST_SEWN:
                        raise InputError(
                            f"openings[{number}]: a {opening.kind} of {1e3 * opening.length:.0f} mm leaves nothing of the "
                            f"seam {seam.name!r}, {1e3 * part.whole:.0f} mm long; make it shorter, or leave the seam out of the form"
                        )
                    for side in (side for side in sides if not side.mirrored):
                        pieces[size] = [
                            _with_free_end(piece, side.edge, opening) if piece.name == side.piece else piece
                            for piece in pieces[size]
                        ]
                pattern = replace(pattern, pieces=pieces)
                if opening.kind == "godet":
                    pattern = _with_godet(pattern, seam, opening)
    return pattern


def _reach(opening: Opening, part: OpeningPart) -> tuple[float, float]:
    """Return where along a seam, from the end of measuring, an opening begins and ends [m]."""
    begin, end = opening.start - part.before, opening.start + opening.length - part.before
    return max(0.0, begin), min(part.whole, end)


def _part_of(placed: Placed, size: str, number: int, seam: str) -> OpeningPart:
    return next(part for part in placed[size][number] if part.seam == seam)


def _with_zip(
    pattern: Pattern, seam: Seam, opening: Opening, end: float | None, number: int, placed: Placed
) -> Pattern:
    """Return a pattern with the line of a zip beside the edges of a seam, and a notch where it ends."""
    import shapely

    pieces = dict(pattern.pieces)
    for size in pieces:
        begin, stop = _reach(opening, _part_of(placed, size, number, seam.name))
        for side in (side for row in seam.sides for side in row if not side.mirrored):
            row = list(pieces[size])
            at = next(k for k, piece in enumerate(row) if piece.name == side.piece)
            line = np.asarray(shapely.LineString(row[at].edge(side.edge).points).offset_curve(_INSIDE).coords)
            if not _runs_down(row[at], line):
                line = line[::-1]
            drawn = dict(row[at].internal_lines)
            title = replace(opening, length=min(opening.length, sum(each.whole for each in placed[size][number]))).title
            drawn[find_unused_name(title, drawn)] = part_between(line, begin, min(stop, polyline_length(line)))
            row[at] = replace(row[at], internal_lines=drawn)
            pieces[size] = row
    if end is None:
        return replace(pattern, pieces=pieces)
    by_size = {}
    for size in pieces:
        part = _part_of(placed, size, number, seam.name)
        share = _reach(opening, part)[1] / part.whole
        side = seam.sides[0][0]
        piece = pattern.piece(side.piece, pattern.sample)
        by_size[size] = with_notches(
            seam.of_size(size),
            [share if (_runs_down(piece, piece.edge(side.edge).points) != side.reversed) else 1.0 - share],
            part.whole,
        )
    notched = replace(seam, notches=by_size[pattern.sample], size_notches=by_size)
    seams = [notched if each.name == seam.name else each for each in pattern.seams]
    return replace(pattern, pieces=pieces, seams=seams)


def with_notches(seam: Seam, shares: Sequence[float], whole: float) -> tuple[float, ...]:
    """Return the notches of a seam (shares of its length) with some more, which its own keep clear of.

    Args:
        seam: given notches, or none: then they are spaced as on any seam.
        shares: of the new ones.
        whole: length of the seam [m].
    """
    count = max(1, round(whole / _SPACING))
    spaced = seam.notches if seam.notches is not None else [(k + 0.42) / count for k in range(count)]
    kept = [each for each in spaced if np.abs(each - np.asarray(shares)).min() * whole > _CLEAR]
    return tuple(sorted([*shares, *kept]))


def _runs_down(piece: Piece, points: FloatArray) -> bool:
    """Return whether a line of a piece runs against the grain."""
    grain = np.array([0.0, 1.0]) if piece.grain is None else piece.grain[1] - piece.grain[0]
    return bool((points[-1] - points[0]) @ grain < 0.0)


def _with_buttons(pattern: Pattern, seam: Seam, opening: Opening, number: int, placed: Placed) -> Pattern:
    """Return a pattern with a button stand on both sides of a seam, which is sewn only below it."""
    sides = {(side.piece, side.edge) for row in seam.sides for side in row}
    if any(len(row) > 1 for row in seam.sides) or opening.start > 0.0 or opening.buttons is None:
        raise InputError(f"openings[{number}]: buttons begin at the upper end of a seam between two edges")
    pieces, counts = dict(pattern.pieces), list[int]()
    # The sample size first: the others have as many buttons.
    for size in sorted(pieces, key=lambda each: each != pattern.sample):
        part = _part_of(placed, size, number, seam.name)
        whole = sum(each.whole for each in placed[size][number])
        name, edge = next(iter(sides))
        piece = pattern.piece(name, size)
        bust = bust_depth(piece, edge, _runs_down(piece, piece.edge(edge).points))
        length = min(opening.length, whole)
        depths = button_depths(opening.buttons, length, None if bust is None else part.before + bust, *counts)
        counts = [len(depths)]
        here = depths[(depths >= part.before) & (depths < part.before + part.whole)] - part.before
        # All along an edge that is rounded it ends with that.
        end = np.inf if opening.length >= whole else length - part.before
        for name, edge in sides:
            pieces[size] = [
                with_button_stand(each, edge, opening, end, here) if each.name == name else each
                for each in pieces[size]
            ]
    at = pattern.piece(*(next(iter(sides))[0], pattern.sample)).edge(next(iter(sides))[1]).length
    still_sewn = opening.length < at
    seams = [each for each in pattern.seams if each.name != seam.name or still_sewn]
    return replace(pattern, pieces=pieces, seams=seams)


def _with_godet(pattern: Pattern, seam: Seam, opening: Opening) -> Pattern:
    """Return a pattern with a wedge, a sector of a circle, in the lower end of a seam, whose edges have that end as edges of their own.

    On the fold a seam stands for both sides of the body.
    """
    first = seam.sides[0][0]
    shell, freed = pattern.piece(first.piece, pattern.sample), f"{first.edge} godet"
    order = [edge.name for edge in shell.edges]
    # The edge beyond its lower end is the hem, which runs on along the wedge.
    down = _runs_down(shell, shell.edge(freed).points)
    hem = shell.edges[(order.index(freed) + (1 if down else -1)) % len(order)]
    if (shell.name, hem.name) in {
        (side.piece, side.edge) for each in pattern.seams for row in each.sides for side in row
    }:
        raise InputError(f"a godet runs out into a hem; {seam.name!r} ends at {hem.name!r}, which is sewn")
    half = 0.5 * opening.width / opening.length
    turn = np.linspace(-half, half, 2 * max(8, round(np.degrees(half) / 2.5)) + 1)
    arc = opening.length * np.column_stack([np.sin(turn), -np.cos(turn)])
    known = {piece.name.replace("_", " ") for piece in pattern.pieces[pattern.sample]}
    apex, name = np.zeros((1, 2)), find_unused_name("godet", known).replace(" ", "_")
    both = 2 if all(pattern.piece(row[0].piece, pattern.sample).on_fold for row in seam.sides) else 1
    pieces = {}
    for size, row in pattern.pieces.items():
        sewn = pattern.piece(first.piece, size).edge(freed).allowance
        wedge = Piece(
            name=name, size=size, fabric=shell.fabric, quantity=both, paired=False,
            edges=[
                Edge(name="left", points=np.vstack([apex, arc[:1]]), allowance=sewn),
                Edge(name=hem.name, points=arc, kind=hem.kind, allowance=hem.allowance),
                Edge(name="right", points=np.vstack([arc[-1:], apex]), allowance=sewn),
            ],
            grain=np.array([[0.0, -0.8 * opening.length], [0.0, -0.3 * opening.length]]),
        )  # fmt: skip
        pieces[size] = [*row, wedge]
    seams, taken = list(pattern.seams), {each.name for each in pattern.seams}
    for (side,) in seam.sides:
        piece = pattern.piece(side.piece, pattern.sample)
        runs_down = _runs_down(piece, piece.edge(f"{side.edge} godet").points)
        # A piece whose edge runs up lies to the left of it; its mirror image to the right.
        edge = "left" if runs_down == side.mirrored else "right"
        title = find_unused_name(f"{seam.name} godet", taken)
        taken.add(title)
        rows = (
            (replace(side, edge=f"{side.edge} godet", reversed=not runs_down),),
            (SeamSide(piece=name, edge=edge, reversed=edge == "right"),),
        )
        seams.append(Seam(name=title, sides=rows))
    return replace(pattern, pieces=pieces, seams=seams)


def _with_wrap(pattern: Pattern, seam: Seam, opening: Opening) -> Pattern:
    """Return a pattern whose halves run beyond a centre line, each over the other; they are not sewn there, but tied."""
    sides, tied = {(side.piece, side.edge) for row in seam.sides for side in row}, "tie"
    pieces = {}
    for size, row in pattern.pieces.items():
        made = []
        for piece in row:
            edge = next((edge for name, edge in sides if name == piece.name), None)
            if edge is not None:
                piece = with_wrap(piece, edge, opening)
                piece = replace(piece, internal_lines=lines_inside(piece.internal_lines, piece.outline))
            made.append(piece)
        if opening.tie and not any(piece.name == tied for piece in row):
            edges = strip_edges(*swept(Strip(length=opening.tie, height=2.0 * TIE_WIDTH)))
            fold = np.array([[0.0, TIE_WIDTH], [opening.tie, TIE_WIDTH]])
            grain = np.array([[0.2, 0.5], [0.8, 0.5]]) * [opening.tie, TIE_WIDTH]
            made.append(
                Piece(
                    name=tied, size=size, fabric=row[0].fabric, quantity=2, role="tie", paired=False, grain=grain,
                    edges=[replace(edge, kind="cut", allowance=0.010) for edge in edges], internal_lines={"fold line": fold},
                )
            )  # fmt: skip
        pieces[size] = made
    return replace(pattern, pieces=pieces, seams=[each for each in pattern.seams if each.name != seam.name])


def _keyhole(piece: Piece, opening: Opening) -> Piece:
    import shapely

    folds = {edge.name: edge.points for edge in piece.edges}
    line = piece.internal_lines.get(opening.line, folds.get(opening.line))
    if line is None:
        raise InputError(f"a keyhole is cut along a line inside its piece; {piece.name} has no {opening.line!r} inside")
    line = line if _runs_down(piece, line) else line[::-1]
    slit = part_between(line, 0.0, opening.length)
    along = (slit[-1] - slit[0]) / np.linalg.norm(slit[-1] - slit[0])
    across, radius = np.array([along[1], -along[0]]), 0.5 * opening.width
    turn = np.radians(np.linspace(-150.0, 150.0, 33))
    centre = slit[-1] - radius * along
    ring = centre + radius * (np.cos(turn)[:, None] * along + np.sin(turn)[:, None] * across)
    half = radius * np.sin(np.radians(30.0))
    shapes = {"keyhole": slit[[0, -1]], "keyhole end": ring}
    for number, (sign, end) in enumerate(((-1.0, ring[0]), (1.0, ring[-1]))):
        shapes[f"keyhole side {number + 1}"] = np.array([slit[0] + sign * half * across, end])
    body = shapely.Polygon(piece.outline).buffer(1e-6)
    lines = {**piece.internal_lines, **lines_inside(shapes, piece.outline)}
    button = slit[0] + 0.010 * along + (half + 0.008) * across
    marks = {**piece.marks, "button": button} if body.contains(shapely.Point(button)) else dict(piece.marks)
    return replace(piece, internal_lines=lines, marks=marks)


def lines_inside(lines: Mapping[str, FloatArray], outline: FloatArray) -> dict[str, FloatArray]:
    """Return of each line the longest part that lies inside an outline; lines with less than 1 mm inside are left out."""
    import shapely

    body, found = shapely.Polygon(outline).buffer(1e-6), {}
    for name, line in lines.items():
        parts = shapely.get_parts(shapely.LineString(line).intersection(body))
        parts = [part for part in parts if part.geom_type == "LineString" and part.length > 1e-3]
        if parts:
            found[name] = np.asarray(max(parts, key=lambda part: part.length).coords)
    return found


def _with_free_end(piece: Piece, name: str, opening: Opening) -> Piece:
    """Return a piece one of whose edges has its lower end as an edge of its own."""
    edges: list[Edge] = []
    taken = {edge.name for edge in piece.edges}
    for edge in piece.edges:
        if edge.name != name:
            edges.append(edge)
            continue
        down, whole = _runs_down(piece, edge.points), edge.length
        at = whole - opening.length if down else opening.length
        free = find_unused_name(f"{name} {opening.kind}", taken)
        parts = [part_between(edge.points, 0.0, at), part_between(edge.points, at, whole)]
        # Corners are shared bit for bit.
        parts[0][0], parts[1][-1], parts[1][0] = edge.points[0], edge.points[-1], parts[0][-1]
        names = (name, free) if down else (free, name)
        edges += [
            Edge(
                name=part, points=points, kind="hem" if part == free and opening.kind != "godet" else edge.kind,
                allowance=opening.width if part == free and opening.kind != "godet" else edge.allowance,
            )
            for part, points in zip(names, parts, strict=True)
        ]  # fmt: skip
    return replace(piece, edges=edges)
