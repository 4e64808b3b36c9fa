"""Plackets: slits that open an edge; in a sleeve behind, bound with one strip, in a neck in front, with two that button."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpflat.core import FloatArray, InputError, arc_lengths, find_unused_name, points_at_lengths
from warpflat.garment.construction.button_stand import buttonhole
from warpflat.garment.construction.free_edges import Break, free_chain, marks_of, split_edge
from warpflat.garment.construction.strips import Strip, strip_edges, swept
from warpflat.pattern import Pattern, Piece

__all__ = ["with_placket", "with_slits"]

# Finished width of the binding of a slit, and how much longer it is cut than both edges of the slit [m].
_BINDING, _LONGER = 0.015, 0.020
# Finished width of the strips of a neck's placket, and their least distance between buttons [m].
_STRIP, _APART = 0.030, 0.045
# The slit lies at this share of the edge from its middle to its back end.
_BEHIND = 0.5


def with_slits(
    pattern: Pattern, places: Sequence[tuple[str, str]], length: float, called: str
) -> tuple[Pattern, list[Break]]:
    """Return a pattern with a slit up from each of some edges, where a chain of free edges is broken, and its binding.

    The slit lies towards the back: on the side of the piece that is sewn to a back, half-way from the middle of the edge to its end.

    Args:
        pattern: with all its openings.
        places: pieces and edges.
        length: of the slit [m].
        called: what the bindings are named after.

    Raises:
        InputError: the slit does not lie within its piece.
    """
    import shapely

    breaks = []
    for name, edge in places:
        at, lines = {}, {}
        back = _towards_back(pattern, name, edge)
        for size in pattern.pieces:
            piece = pattern.piece(name, size)
            points = piece.edge(edge).points
            at[size] = float(arc_lengths(points)[-1]) * (0.5 + 0.5 * _BEHIND * back)
            ends = points_at_lengths(points, [at[size] - 1e-3, at[size], at[size] + 1e-3])
            along = (ends[2] - ends[0]) / np.linalg.norm(ends[2] - ends[0])
            lines[size] = np.array([ends[1], ends[1] + length * np.array([-along[1], along[0]])])
            if not shapely.Polygon(piece.outline).buffer(1e-6).contains(shapely.LineString(lines[size])):
                raise InputError(f"a slit of {1e3 * length:.0f} mm from {name}.{edge} does not lie within the piece")
        pattern, broken = split_edge(pattern, (name, edge), at)
        breaks.append(broken)
        title = f"slit {1e3 * length:.0f} mm"
        pieces = {
            size: [
                replace(piece, internal_lines={**piece.internal_lines, find_unused_name(title, piece.internal_lines): lines[size]})
                if piece.name == name
                else piece
                for piece in row
            ]
            for size, row in pattern.pieces.items()
        }  # fmt: skip
        pattern = replace(pattern, pieces=pieces)
    count = sum(pattern.piece(name, pattern.sample).quantity for name, _ in places)
    title = find_unused_name(f"{called}_placket", {piece.name for piece in pattern.pieces[pattern.sample]})
    whole, high = 2.0 * length + _LONGER, 2.0 * _BINDING
    # Cut as it is: its edges are turned in by a quarter of its width.
    edges = strip_edges(
        *swept(Strip(length=whole, height=high)), kinds=dict.fromkeys(("lower", "upper", "right end", "left end"), "cut"),
        allowance={"lower": 0.006, "upper": 0.006},
    )  # fmt: skip
    binding = Piece(
        name=title, fabric=pattern.pieces[pattern.sample][0].fabric, quantity=count, edges=edges, paired=False, role="placket",
        internal_lines={"fold line": np.array([[0.0, _BINDING], [whole, _BINDING]])},
        grain=np.array([[0.1 * whole, 0.5 * high], [0.9 * whole, 0.5 * high]]),
    )  # fmt: skip
    pieces = {size: [*row, replace(binding, size=size)] for size, row in pattern.pieces.items()}
    return replace(pattern, pieces=pieces), breaks


def with_placket(
    pattern: Pattern, places: Sequence[tuple[str, str]], length: float, called: str
) -> tuple[Pattern, list[Break]]:
    """Return a pattern with a slit down from the centre front of an edge, a box around it, and the two strips that fill the box.

    The strips lie on each other, and button; the chain of free edges is broken at the centre front.

    Args:
        pattern: with all its openings.
        places: pieces and edges.
        length: of the slit [m].
        called: what the strips are named after.

    Raises:
        InputError: no edge crosses the centre front, or the slit does not lie within its piece.
    """
    import shapely

    for place in places:
        name, edge = place
        chain = free_chain(pattern, [place])
        at = {size: marks_of(pattern, chain, size, "centre front") for size in pattern.pieces}
        if all(
            len(row) == 1 and 1e-3 < row[0] < pattern.piece(name, size).edge(edge).length - 1e-3
            for size, row in at.items()
        ):
            break
    else:
        raise InputError("a placket lies in the centre front, and no piece of this edge crosses it")
    pieces = {}
    for size, row in pattern.pieces.items():
        piece = pattern.piece(name, size)
        top = points_at_lengths(piece.edge(edge).points, at[size])[0]
        grain = np.array([[0.0, 0.0], [0.0, 1.0]]) if piece.grain is None else piece.grain
        down = (grain[0] - grain[1]) / np.linalg.norm(grain[1] - grain[0])
        across = np.array([-down[1], down[0]])
        low, half = top + length * down, 0.5 * _STRIP
        # The box reaches up to the edge.
        uppers = [top + sign * half * across for sign in (1.0, -1.0)]
        body = shapely.Polygon(piece.outline)
        lines = {
            f"slit {1e3 * length:.0f} mm": np.array([top, low]),
            "placket": np.array([uppers[0], low + half * across]),
            "placket 2": np.array([uppers[1], low - half * across]),
            "placket 3": np.array([low + half * across, low - half * across]),
        }
        drawn = dict(piece.internal_lines)
        for title, line in lines.items():
            if not body.buffer(0.02).contains(shapely.LineString(line)):
                raise InputError(f"a placket of {1e3 * length:.0f} mm does not lie within {name!r}")
            inside = shapely.LineString(line).intersection(body.buffer(1e-6))
            drawn[find_unused_name(title, drawn)] = np.asarray(inside.coords)
        piece = replace(piece, internal_lines=drawn)
        whole, high = length + _LONGER, 2.0 * _STRIP
        names = ("lower", "right end", "upper", "left end")
        edges = strip_edges(
            *swept(Strip(length=whole, height=high)),
            kinds=dict.fromkeys(names, "cut"),
            allowance=dict.fromkeys(names, 0.010),
        )
        count = max(2, int((length - 0.02) / _APART))
        marks, holes = dict[str, FloatArray](), dict[str, FloatArray]()
        # The upper end lies on the left. Both strips are marked: one gets the buttons, the other one the buttonholes.
        for number, x in enumerate(np.linspace(0.018, length - 0.030, count)):
            marks[find_unused_name("button", marks)] = np.array([x, 0.5 * _STRIP])
            for title, line in buttonhole(np.array([x, 0.5 * _STRIP]), np.array([1.0, 0.0])).items():
                holes[f"{title} of {number + 1}"] = line
        strip = Piece(
            name=find_unused_name(f"{called}_placket", {each.name for each in row}), size=size, fabric=piece.fabric, quantity=2,
            edges=edges, paired=False, role="placket", marks=marks,
            internal_lines={"fold line": np.array([[0.0, _STRIP], [whole, _STRIP]]), **holes},
            grain=np.array([[0.1 * whole, 0.5 * high], [0.9 * whole, 0.5 * high]]),
        )  # fmt: skip
        pieces[size] = [*(piece if each.name == name else each for each in row), strip]
    pattern = replace(pattern, pieces=pieces)
    pattern, broken = split_edge(pattern, place, {size: row[0] for size, row in at.items()})
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
            run = np.concatenate([piece.edge(side.edge).points[:: -1 if side.reversed else 1] for side in own])
            # What of the other side is a front or a back, and the place opposite to its middle.
            parts = [pattern.piece(side.piece, pattern.sample).edge(side.edge).length for side in other]
            middles = (np.cumsum(parts) - 0.5 * np.array(parts)) / sum(parts)
            for side, share in zip(other, middles, strict=True):
                for face in set(side.piece.split("_")) & set(found):
                    place = points_at_lengths(run, [share * arc_lengths(run)[-1]])[0]
                    found[face] += float((place - middle) @ along)
    return 1.0 if found["back"] >= found["front"] else -1.0
