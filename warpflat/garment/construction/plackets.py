"""Plackets: slits that open an edge; in a sleeve behind, bound with one strip, in a neck in front, with two that button."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from warpflat.core import FloatArray, InputError, arc_lengths, find_unused_name, points_at_lengths
from warpflat.garment.construction.button_stand import buttonhole
from warpflat.garment.construction.edges import (
    ON,
    Place,
    added,
    direction,
    drawn_on,
    edge_at,
    free_piece_name,
    lengths_of,
    redrawn,
    side_points,
    up_and_across,
)
from warpflat.garment.construction.free_edges import Break, crossed_at, split_edge
from warpflat.garment.construction.strips import folded_strip
from warpflat.pattern import Pattern, Piece

__all__ = ["with_placket", "with_slits"]

# Finished width of the binding of a slit, and how much longer it is cut than both edges of the slit [m].
_BINDING, _LONGER = 0.015, 0.020
# Finished width of the strips of a neck's placket, and their least distance between buttons [m].
_STRIP, _APART = 0.030, 0.045
# The first button of a neck's placket lies so far from its upper end, and the last from the slit's lower end [m].
_FIRST, _LAST = 0.018, 0.030
# A binding is cut as it is: its edges are turned in by a quarter of its width, or so [m].
_TURNED_IN = 0.006
# The slit lies at this share of the edge from its middle to its back end.
_BEHIND = 0.5


def with_slits(pattern: Pattern, places: Sequence[Place], length: float) -> tuple[Pattern, list[Break]]:
    """Return a pattern with a slit up from each of some edges, where a chain of free edges is broken, and its binding.

    The slit lies towards the back: on the side of the piece that is sewn to a back, half-way from the middle of the edge to its end.

    Args:
        pattern: with all its openings.
        places: pieces and edges.
        length: of the slit [m].

    Raises:
        InputError: the slit does not lie within its piece.
    """
    import shapely

    breaks = []
    for place in places:
        share = 0.5 + 0.5 * _BEHIND * _towards_back(pattern, *place)
        at = {size: share * edge_at(pattern, place, size).length for size in pattern.pieces}

        def slit(piece: Piece, edge: str = place[1], at: Mapping[str, float] = at) -> Piece:
            near = at[piece.size] + np.array([-1e-3, 0.0, 1e-3])
            before, start, after = points_at_lengths(piece.edge(edge).points, near)
            x, y = direction(np.array([before, after]))
            line = np.array([start, start + length * np.array([-y, x])])
            if not shapely.Polygon(piece.outline).buffer(ON).contains(shapely.LineString(line)):
                words = f"a slit of {1e3 * length:.0f} mm from {piece.name}.{edge}"
                raise InputError(f"{words} does not lie within the piece")
            return drawn_on(piece, [(f"slit {1e3 * length:.0f} mm", line)])

        pattern, broken = split_edge(redrawn(pattern, place[0], slit), place, at)
        breaks.append(broken)
    count = sum(pattern.piece(name, pattern.sample).quantity for name, _ in places)
    title = free_piece_name(pattern, "sleeve_placket")
    turned_in = {"lower": _TURNED_IN, "upper": _TURNED_IN}

    def binding(like: Piece) -> Piece:
        return folded_strip(
            title, like, 2.0 * length + _LONGER, _BINDING, role="placket", quantity=count, allowance=turned_in, grain=(0.1, 1.0)
        )  # fmt: skip

    return added(pattern, binding), breaks


def with_placket(pattern: Pattern, places: Sequence[Place], length: float, called: str) -> tuple[Pattern, list[Break]]:
    """Return a pattern with a slit down from the centre front of an edge, a box around it, and the two strips that fill the box.

    The strips lie on each other, and button; the chain of free edges is broken at the centre front.

    Args:
        pattern: with all its openings.
        places: pieces and edges.
        length: of the slit [m].
        called: what the strips are named after.

    Raises:
        InputError: no edge crosses the centre front, the slit is too short for two buttons, or does not lie within its piece.
    """
    import shapely

    for place in places:
        at = crossed_at(pattern, place, "centre front")
        if at is not None:
            break
    else:
        raise InputError("a placket lies in the centre front, and no piece of this edge crosses it")
    name, edge = place

    def boxed(piece: Piece) -> Piece:
        # A box around the slit, up to the edge.
        top, (up, across) = points_at_lengths(piece.edge(edge).points, at[piece.size]), up_and_across(piece)
        low, half = top - length * up, 0.5 * _STRIP * across
        lines = {
            f"slit {1e3 * length:.0f} mm": np.array([top, low]),
            "placket": np.array([top + half, low + half]),
            "placket 2": np.array([top - half, low - half]),
            "placket 3": np.array([low + half, low - half]),
        }
        body = shapely.Polygon(piece.outline)
        if not body.buffer(0.02).contains(shapely.MultiLineString(list(lines.values()))):
            raise InputError(f"a placket of {1e3 * length:.0f} mm does not lie within {name!r}")
        inside = {title: shapely.LineString(line).intersection(body.buffer(ON)) for title, line in lines.items()}
        return drawn_on(piece, [(title, np.asarray(line.coords)) for title, line in inside.items()])

    least = _FIRST + _APART + _LAST
    if length < least:
        raise InputError(
            f"a placket of {1e3 * length:.0f} mm is too short for two buttons; make it {1e3 * least:.0f} mm or longer"
        )
    marks, holes = dict[str, FloatArray](), dict[str, FloatArray]()
    # The upper end lies on the left. Both strips are marked: one gets the buttons, the other one the buttonholes.
    for number, x in enumerate(np.linspace(_FIRST, length - _LAST, max(2, int((length - 0.02) / _APART)))):
        place_of_button = np.array([x, 0.5 * _STRIP])
        marks[find_unused_name("button", marks)] = place_of_button
        for title, line in buttonhole(place_of_button, np.array([1.0, 0.0])).items():
            holes[f"{title} of {number + 1}"] = line
    title = free_piece_name(pattern, f"{called}_placket")

    def boxed_and_filled(piece: Piece) -> tuple[Piece, Piece]:
        return boxed(piece), folded_strip(
            title, piece, length + _LONGER, _STRIP, role="placket", quantity=2, grain=(0.1, 1.0), marks=marks, internal_lines=holes
        )  # fmt: skip

    pattern = redrawn(pattern, name, boxed_and_filled)
    pattern, broken = split_edge(pattern, place, at)
    return pattern, [broken]


def _towards_back(pattern: Pattern, name: str, edge: str) -> float:
    """Return towards which end of an edge the back of its piece lies: 1 its last point, -1 its first."""
    piece = pattern.piece(name, pattern.sample)
    line = piece.edge(edge).points
    middle, along = line.mean(axis=0), line[-1] - line[0]
    found = {"front": 0.0, "back": 0.0}
    for seam in pattern.seams:
        for own, other in (seam.sides, seam.sides[::-1]):
            if any(side.piece != name for side in own):
                continue
            run = np.concatenate([side_points(pattern, side, pattern.sample) for side in own])
            # What of the other side is a front or a back, and the place opposite to its middle.
            parts = lengths_of(pattern, other)
            middles = (np.cumsum(parts) - 0.5 * np.array(parts)) / sum(parts)
            for side, share in zip(other, middles, strict=True):
                for face in set(side.piece.split("_")) & set(found):
                    place = points_at_lengths(run, [share * arc_lengths(run)[-1]])[0]
                    found[face] += float((place - middle) @ along)
    return 1.0 if found["back"] >= found["front"] else -1.0
