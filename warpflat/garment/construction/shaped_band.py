"""Strips that are cut off along an edge: shaped waistbands, what a band or cuff takes the place of, and slanted hems."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from warpflat.core import (
    FloatArray,
    InputError,
    arc_lengths,
    find_unused_name,
    nearest,
    other_side,
    part_between,
    points_at_lengths,
)
from warpflat.garment.construction.facings import INNER, centre_notch, facing_edges
from warpflat.garment.construction.free_edges import free_chains, neighbour
from warpflat.garment.construction.mark_openings import lines_inside
from warpflat.pattern import Edge, Pattern, Piece, Seam, SeamSide

# A line ends on an edge within this distance [m].
_ON_EDGE = 1e-3
# A slanted edge has so many points at least, and is moved by so much [m] where it stays: a strip has two ends.
_SLANTED, _LEAST_RISE = 33, 2e-5

__all__ = ["shortened", "slant_rises", "with_shaped_waistband", "without_strip"]


def without_strip(piece: Piece, strip: Sequence[Edge], inner: str) -> Piece:
    """Return a piece without the strip along one of its borders, and with the parts of its lines that lie inside what is left.

    Args:
        piece: whole.
        strip: the outline of the strip, as :func:`warpflat.garment.construction.facings.facing_edges` gives it.
        inner: name of the edge that takes the strip's place.

    Raises:
        InputError: hardly anything of a neighbouring edge is left.
    """

    names = [edge.name for edge in strip]
    at = names.index(INNER)
    covered, ends = names[: at - 1], {1: strip[at - 1].length, -1: strip[at + 1].length}
    whole = [edge.name for edge in piece.edges]
    after = whole.index(covered[0]) + len(covered)
    # What the strip leaves of the others: it lies along those that follow it, and along those before.
    rest = [piece.edges[(after + k) % len(whole)] for k in range(len(whole) - len(covered))]
    for turn, end in ends.items():
        beside = rest[::turn]
        while len(beside) > 1 and beside[0].length <= end + 1e-9:
            end -= beside.pop(0).length
        edge, points = beside[0], beside[0].points[::turn]
        if edge.length - end < 0.005:
            raise InputError(
                f"{piece.name}: strips meet at {edge.name!r}; make them narrower, or bind one of the edges"
            )
        corner = strip[at].points[0 if turn == 1 else -1]
        left = points[arc_lengths(points) > end + 1e-9]
        beside[0] = replace(edge, points=np.vstack([corner, left])[::turn], vertices=None)
        rest = beside[::turn]
    edges = [Edge(name=inner, points=strip[at].points[::-1]), *rest]
    start = next(k for name in whole for k, edge in enumerate(edges) if edge.name == name)
    edges = [*edges[start:], *edges[:start]]
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
    kept = [_with_moved_notches(pattern, seam, cut, dict.fromkeys(cut, width)) for seam in pattern.seams]
    return replace(pattern, pieces=pieces, seams=[*kept, *seams])


def shortened(pattern: Pattern, places: Sequence[tuple[str, str]], width: float | Mapping[str, float]) -> Pattern:
    """Return a pattern without the strip along some free edges, which keep their names: a band or a cuff takes its place, or a slanted hem.

    Args:
        pattern: with all its openings.
        places: pieces and edges.
        width: of the strip [m], or its width where a line meets the edges, by line; between those lines it changes smoothly.

    Raises:
        InputError: a dart ends in an edge, the strip is too wide, or no edge is met by a line of that name.
    """
    import shapely

    pieces, cut = {size: list(row) for size, row in pattern.pieces.items()}, dict[tuple[str, str], tuple[str, bool]]()
    widths = dict[tuple[str, str], float]()
    for size, row in pieces.items():
        rises = {} if isinstance(width, float) else slant_rises(pattern, places, width, size)
        for name, edge in places:
            at = next(k for k, piece in enumerate(row) if piece.name == name)
            order = [each.name for each in row[at].edges]
            before, after = order[order.index(edge) - 1], order[(order.index(edge) + 1) % len(order)]
            if isinstance(width, float):
                strip = facing_edges(row[at], (edge,), width)
            elif (name, edge) in rises:
                strip = _slanted_strip(row[at], edge, rises[name, edge])
            else:
                continue
            piece = without_strip(row[at], strip, edge)
            own = row[at].edge(edge)
            edges = [replace(e, kind=own.kind, allowance=own.allowance) if e.name == edge else e for e in piece.edges]
            body = shapely.Polygon(piece.outline)
            marks = {key: mark for key, mark in piece.marks.items() if body.contains(shapely.Point(mark))}
            row[at] = replace(piece, edges=edges, marks=marks)
            if size == pattern.sample:
                cut |= {(name, before): (name, False), (name, after): (name, True)}
                widths |= {(name, before): strip[-1].length, (name, after): strip[1].length}
    seams = [_with_moved_notches(pattern, seam, cut, widths) for seam in pattern.seams]
    return replace(pattern, pieces=pieces, seams=seams)


def slant_rises(
    pattern: Pattern, places: Sequence[tuple[str, str]], by_line: Mapping[str, float], size: str
) -> dict[tuple[str, str], tuple[FloatArray, FloatArray]]:
    """Return how wide a strip is along each of some edges (lengths from its start and widths there [m]), from its widths at lines.

    Between the lines along a chain of edges the width follows a monotone cubic (Fritsch and Carlson 1980).

    Raises:
        InputError: no edge is met by a line of such a name; gives the nearest.
    """
    import shapely
    from scipy.interpolate import PchipInterpolator

    found, met = dict[tuple[str, str], tuple[FloatArray, FloatArray]](), set[str]()
    for chain, _ in free_chains(pattern, places):
        knots, starts, start = dict[float, float](), list[float](), 0.0
        for side in chain.sides:
            piece = pattern.piece(side.piece, size)
            edge = piece.edge(side.edge)
            line = shapely.LineString(edge.points)
            crossed = [(neighbour(piece, side.edge, end)[0], end * edge.length) for end in (0, 1)]
            crossed += [
                (key, float(line.project(shapely.Point(point))))
                for key, points in piece.internal_lines.items()
                for point in points[[0, -1]]
                if line.distance(shapely.Point(point)) < _ON_EDGE
            ]
            for key, place in crossed:
                key = other_side(key) if side.mirrored else key
                met.add(key)
                here = start + (edge.length - place if side.reversed else place)
                asked = [rise for name, rise in by_line.items() if f"{key} ".startswith(f"{name} ")]
                if asked:
                    knots[round(here, 3)] = asked[0]
            starts.append(start)
            start += edge.length
        if not knots:
            continue
        if chain.closed:
            knots = {place + turn * start: rise for turn in (-1, 0, 1) for place, rise in knots.items()}
        at = np.array(sorted(knots))
        at = at[np.diff(at, prepend=-np.inf) > _ON_EDGE]
        values = np.array([knots[place] for place in at.tolist()])
        for side, begin in zip(chain.sides, starts, strict=True):
            points = pattern.piece(side.piece, size).edge(side.edge).points
            arc = arc_lengths(points)
            arc = np.unique(np.concatenate([arc, np.linspace(0.0, arc[-1], _SLANTED)]))
            along = np.clip(begin + (arc[-1] - arc if side.reversed else arc), at[0], at[-1])
            wide = PchipInterpolator(at, values)(along) if len(at) > 1 else np.full(len(arc), values[0])
            if np.abs(found.setdefault((side.piece, side.edge), (arc, wide))[1] - wide).max() > _ON_EDGE:
                raise InputError(
                    f"{side.piece} is cut on the fold or twice, and cannot be shorter on one side; with half = false it is cut whole"
                )
    for name in by_line:
        if not any(f"{key} ".startswith(f"{each} ") for key in met for each in (name, other_side(name))):
            raise InputError(f"no line {name!r} meets {places[0][1]!r}; {nearest(name, met)}")
    return found


def _slanted_strip(piece: Piece, name: str, rise: tuple[FloatArray, FloatArray]) -> list[Edge]:
    """Return the outline of a strip that is not equally wide everywhere, in the order of :func:`facing_edges`."""
    (before, _), (after, _) = neighbour(piece, name, 0), neighbour(piece, name, 1)
    edge, beside = piece.edge(name), (piece.edge(before), piece.edge(after))
    if "dart" in (beside[0].kind, beside[1].kind):
        raise InputError(f"a dart ends in {piece.name}.{name}: it cannot be slanted")
    arc, wide = rise
    wide = np.maximum(wide, _LEAST_RISE)
    if any(each.length < height + 0.005 for each, height in zip(beside, wide[[0, -1]], strict=True)):
        raise InputError(f"the edges beside {piece.name}.{name} are shorter than {1e3 * wide.max():.0f} mm")
    # Away from the edge's ends along the edges beside it, and between them in a direction between those.
    parts = [part_between(beside[0].points[::-1], 0.0, wide[0]), part_between(beside[1].points, 0.0, wide[-1])]
    ways = [
        points_at_lengths(line, max(height, 0.02)) - line[0]
        for line, height in zip((beside[0].points[::-1], beside[1].points), wide[[0, -1]], strict=True)
    ]
    ways = [way / np.linalg.norm(way) for way in ways]
    share = (arc / arc[-1])[:, None]
    inner = points_at_lengths(edge.points, arc) + wide[:, None] * ((1.0 - share) * ways[0] + share * ways[1])
    inner[0], inner[-1] = parts[0][-1], parts[1][-1]
    return [
        replace(edge, vertices=None),
        replace(beside[1], points=parts[1], vertices=None),
        Edge(name=INNER, points=inner[::-1], kind="cut"),
        replace(beside[0], points=parts[0][::-1], vertices=None),
    ]


def _with_moved_notches(
    pattern: Pattern, seam: Seam, cut: dict[tuple[str, str], tuple[str, bool]], widths: Mapping[tuple[str, str], float]
) -> Seam:
    """Return a seam whose given notches keep their places on the cloth where its upper end is cut off."""
    side = seam.sides[0][0]
    if seam.notches is None or (side.piece, side.edge) not in cut or len(seam.sides[0]) > 1:
        return seam
    # The strip lies at the start of the edge after the waist, and at the end of the one before it.
    at_start, width, by_size = cut[side.piece, side.edge][1] != side.reversed, widths[side.piece, side.edge], {}
    for size in pattern.pieces:
        length = pattern.piece(side.piece, size).edge(side.edge).length
        places = [share * length - (width if at_start else 0.0) for share in seam.of_size(size).notches or ()]
        by_size[size] = tuple(p / (length - width) for p in places if 0.0 < p < length - width)
    return replace(seam, notches=by_size[pattern.sample], size_notches=by_size)
