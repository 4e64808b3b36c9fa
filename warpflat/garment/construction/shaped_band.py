"""Strips that are cut off along an edge: shaped waistbands, what a band or cuff takes the place of, and slanted hems."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from warpflat.core import (
    FloatArray,
    InputError,
    arc_lengths,
    nearest,
    other_side,
    part_between,
    points_at_lengths,
    polyline_length,
)
from warpflat.garment.construction.edges import (
    ON_EDGE,
    Place,
    beside,
    direction,
    downwards,
    edge_at,
    in_sizes,
    lines_ending_on,
    neighbour,
    redrawn,
    sewn,
    trimmed,
    up_and_across,
    with_pieces,
)
from warpflat.garment.construction.facings import INNER, centre_notch, sewn_alike, sewn_inside, strip_along, strip_piece
from warpflat.garment.construction.free_edges import free_chains
from warpflat.pattern import Edge, Pattern, Piece, Seam, SeamSide

# So much is left of an edge beside a strip at least [m].
_LEAST_LEFT = 0.005
# A slanted edge has so many points at least, and is moved by so much [m] where it stays: a strip has two ends.
_SLANTED, _LEAST_RISE = 33, 2e-5

__all__ = ["shortened", "slant_rises", "with_shaped_waistband", "without_strip"]


def without_strip(piece: Piece, strip: Sequence[Edge], inner: str) -> Piece:
    """Return a piece without the strip along one of its borders, and with the parts of its lines that lie inside what is left.

    Args:
        piece: whole.
        strip: the outline of the strip, as :func:`warpflat.garment.construction.facings.strip_along` gives it.
        inner: name of the edge that takes the strip's place; if it is that of an edge of the piece, it is of its kind.

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
        if edge.length - end < _LEAST_LEFT:
            raise InputError(
                f"{piece.name}: strips meet at {edge.name!r}; make them narrower, or bind one of the edges"
            )
        corner = strip[at].points[0 if turn == 1 else -1]
        left = points[arc_lengths(points) > end + 1e-9]
        beside[0] = replace(edge, points=np.vstack([corner, left])[::turn], vertices=None)
        rest = beside[::turn]
    line = strip[at].points[::-1]
    like = next((edge for edge in piece.edges if edge.name == inner), Edge(name=inner, points=line))
    edges = [replace(like, points=line, vertices=None), *rest]
    start = next(k for name in whole for k, edge in enumerate(edges) if edge.name == name)
    edges = [*edges[start:], *edges[:start]]
    try:
        return trimmed(piece, edges)
    except InputError:
        raise InputError(f"{piece.name}: nothing can be drawn beside {covered[0]!r}; take a narrower strip") from None


def with_shaped_waistband(
    pattern: Pattern, places: Sequence[Place], width: float, *, gaps: Collection[str] = ()
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
    shell, parts = pattern, dict[Place, SeamSide]()
    # By edge beside the waist the band that takes its upper end, and whether the edge begins there.
    cut = dict[Place, tuple[str, bool]]()
    for name, edge in places:
        title, whole = f"{name}_waistband", shell.piece(name, shell.sample)

        def banded(piece: Piece, edge: str = edge, title: str = title) -> tuple[Piece, Piece]:
            strip = strip_along(piece, [edge], width)
            band = sewn_inside(strip)
            middle = np.concatenate([part.points for part in band]).mean(axis=0)
            # Twice as often as its piece: the outside and its facing.
            return without_strip(piece, strip, f"{edge} seam"), strip_piece(
                piece, band, title, "waistband", quantity=2 * piece.quantity, paired=piece.paired and piece.quantity % 2 == 0,
                grain=middle + np.outer([-0.015, 0.015], up_and_across(piece)[0]), internal_lines={},
            )  # fmt: skip

        pattern = redrawn(pattern, name, banded)
        before, after = beside(whole, edge)
        cut |= {(name, before): (title, False), (name, after): (title, True)}
        parts |= {(name, each): SeamSide(piece=title, edge=each) for each in (before, after)}
        upper, lower = SeamSide(piece=title, edge=INNER, reversed=True), SeamSide(piece=name, edge=f"{edge} seam")
        pattern = sewn(pattern, title, lower, upper, notches=centre_notch(whole))
    pattern = sewn_alike(pattern, shell, parts, gaps, "the waistband")
    moved = [_with_moved_notches(shell, seam, cut, dict.fromkeys(cut, width)) for seam in shell.seams]
    return replace(pattern, seams=[*moved, *pattern.seams[len(moved) :]])


def shortened(pattern: Pattern, places: Sequence[Place], width: float | Mapping[str, float]) -> Pattern:
    """Return a pattern without the strip along some free edges, which keep their names: a band or a cuff takes its place, or a slanted hem.

    Args:
        pattern: with all its openings.
        places: pieces and edges.
        width: of the strip [m], or its width where a line meets the edges, by line; between those lines it changes smoothly.

    Raises:
        InputError: a dart ends in an edge, the strip is too wide, or no edge is met by a line of that name.
    """
    cut, widths, shell = dict[Place, tuple[str, bool]](), dict[Place, float](), pattern
    by_line = width if isinstance(width, Mapping) else {}
    rises = {size: slant_rises(shell, places, by_line, size) for size in shell.pieces} if by_line else {}
    for name, edge in places:
        made = []
        for piece in in_sizes(pattern, name):
            if isinstance(width, float):
                strip = strip_along(piece, [edge], width)
            elif (name, edge) in rises[piece.size]:
                strip = _slanted_strip(piece, edge, rises[piece.size][name, edge])
            else:
                continue
            made.append(without_strip(piece, strip, edge))
            if piece.size == shell.sample:
                before, after = beside(piece, edge)
                cut |= {(name, before): (name, False), (name, after): (name, True)}
                widths |= {(name, before): strip[-1].length, (name, after): strip[1].length}
        pattern = with_pieces(pattern, made)
    return replace(pattern, seams=[_with_moved_notches(shell, seam, cut, widths) for seam in shell.seams])


def slant_rises(
    pattern: Pattern, places: Sequence[Place], by_line: Mapping[str, float], size: str
) -> dict[Place, tuple[FloatArray, FloatArray]]:
    """Return how wide a strip is along each of some edges (lengths from its start and widths there [m]), from its widths at lines.

    Between the lines along a chain of edges the width follows a monotone cubic (Fritsch and Carlson 1980).

    Raises:
        InputError: no edge is met by a line of such a name; gives the nearest.
    """
    from scipy.interpolate import PchipInterpolator

    found, met = dict[Place, tuple[FloatArray, FloatArray]](), set[str]()
    for chain, _ in free_chains(pattern, places):
        knots, starts, start = dict[float, float](), list[float](), 0.0
        for side in chain.sides:
            piece = pattern.piece(side.piece, size)
            edge = piece.edge(side.edge)
            crossed = [(neighbour(piece, side.edge, end)[0], end * edge.length) for end in (0, 1)]
            for key, place in [*crossed, *lines_ending_on(edge.points, piece.internal_lines)]:
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
        at = at[np.diff(at, prepend=-np.inf) > ON_EDGE]
        values = np.array([knots[place] for place in at.tolist()])
        for side, begin in zip(chain.sides, starts, strict=True):
            arc = arc_lengths(edge_at(pattern, side, size).points)
            arc = np.unique(np.concatenate([arc, np.linspace(0.0, arc[-1], _SLANTED)]))
            along = np.clip(begin + (arc[-1] - arc if side.reversed else arc), at[0], at[-1])
            wide = PchipInterpolator(at, values)(along) if len(at) > 1 else np.full(len(arc), values[0])
            if np.abs(found.setdefault(side.place, (arc, wide))[1] - wide).max() > ON_EDGE:
                raise InputError(
                    f"{side.piece} is cut on the fold or twice, and cannot be shorter on one side; with half = false it is cut whole"
                )
    for name in by_line:
        if not any(f"{key} ".startswith(f"{each} ") for key in met for each in (name, other_side(name))):
            raise InputError(f"no line {name!r} meets {places[0][1]!r}; {nearest(name, met)}")
    return found


def _slanted_strip(piece: Piece, name: str, rise: tuple[FloatArray, FloatArray]) -> list[Edge]:
    """Return the outline of a strip that is not equally wide everywhere, in the order of :func:`strip_along`."""
    edge = piece.edge(name)
    before, after = (piece.edge(each) for each in beside(piece, name))
    if "dart" in (before.kind, after.kind):
        raise InputError(f"a dart ends in {piece.name}.{name}: it cannot be slanted")
    arc, wide = rise
    wide = np.maximum(wide, _LEAST_RISE)
    ends = list(zip((before.points[::-1], after.points), wide[[0, -1]].tolist(), strict=True))
    if any(polyline_length(line) < height + _LEAST_LEFT for line, height in ends):
        raise InputError(f"the edges beside {piece.name}.{name} are shorter than {1e3 * wide.max():.0f} mm")
    # Away from the edge's ends along the edges beside it, and between them in a direction between those.
    parts = [part_between(line, 0.0, height) for line, height in ends]
    ways = [direction(np.array([line[0], points_at_lengths(line, max(height, 0.02))])) for line, height in ends]
    share = (arc / arc[-1])[:, None]
    inner = points_at_lengths(edge.points, arc) + wide[:, None] * ((1.0 - share) * ways[0] + share * ways[1])
    inner[0], inner[-1] = parts[0][-1], parts[1][-1]
    return [
        replace(edge, vertices=None),
        replace(after, points=parts[1], vertices=None),
        Edge(name=INNER, points=inner[::-1], kind="cut"),
        replace(before, points=parts[0][::-1], vertices=None),
    ]


def _with_moved_notches(
    pattern: Pattern, seam: Seam, cut: dict[Place, tuple[str, bool]], widths: Mapping[Place, float]
) -> Seam:
    """Return a seam whose openings and given notches keep their places on the cloth where one of its ends is cut off."""
    side = seam.sides[0][0]
    for each in seam.stretches:
        if seam.openings and each.place in cut:
            upper = cut[each.place][1] == downwards(pattern.piece(each.piece, pattern.sample), each.edge)[1]
            moved = [
                replace(one, begin=one.begin - widths[each.place]) if upper == (one.kind in ("zip", "buttons")) else one
                for one in seam.openings
            ]
            seam = replace(seam, openings=tuple(moved))
            break
    if seam.notches is None or side.place not in cut or len(seam.sides[0]) > 1:
        return seam
    # The strip lies at the start of the edge after the waist, and at the end of the one before it.
    at_start, width, by_size = cut[side.piece, side.edge][1] != side.reversed, widths[side.piece, side.edge], {}
    for size in pattern.pieces:
        length = edge_at(pattern, side, size).length
        places = [share * length - (width if at_start else 0.0) for share in seam.of_size(size).notches or ()]
        by_size[size] = tuple(p / (length - width) for p in places if 0.0 < p < length - width)
    return replace(seam, notches=by_size[pattern.sample], size_notches=by_size)
