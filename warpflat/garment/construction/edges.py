"""An algebra of edges, in which the parts that finish a garment are said.

Lines are points, #P by 2 [m]: joined, rounded, parted. Edges are changed, and pieces drawn beside others or in their place, in every
size at once. Lines, marks, pieces and seams get the first name that is free.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from warpflat.core import FloatArray, find_unused_name, part_between, unit
from warpflat.pattern import Edge, Pattern, Piece, Seam, SeamSide

__all__ = [
    "ON",
    "ON_EDGE",
    "SAME_LINE",
    "SAME_PIECE",
    "SHORT",
    "Place",
    "above_and_below",
    "added",
    "backwards",
    "beside",
    "bezier",
    "changed",
    "copies_sewn",
    "direction",
    "downwards",
    "drawn_on",
    "edge_at",
    "falling",
    "free_piece_name",
    "in_sizes",
    "joined",
    "lengths_of",
    "lines_ending_on",
    "lines_inside",
    "lines_of",
    "neighbour",
    "new_piece",
    "parted",
    "polygon_edges",
    "redrawn",
    "runs_down",
    "sewn",
    "sewn_places",
    "side_points",
    "trimmed",
    "up_and_across",
    "with_edges",
    "with_pieces",
]

#: An edge of a pattern: its piece and its name.
Place = tuple[str, str]
Sides = SeamSide | tuple[SeamSide, ...]

#: What lies on a line or an outline does so within this distance [m]; a line of a piece ends on an edge within the second.
ON, ON_EDGE = 1e-6, 1e-3
#: A line or a stretch that is shorter is left out [m].
SHORT = 1e-3
#: Lines that differ by no more [m] are one.
SAME_LINE = 5e-5
#: What differs by less than this [m] from the mirror image of its partner becomes that exactly, and is cut by one pattern.
SAME_PIECE = 5e-4


def direction(points: FloatArray) -> FloatArray:
    """Return the unit vector from the first point of a line to its last."""
    return unit(points[-1] - points[0])


def joined(*lines: FloatArray) -> FloatArray:
    """Return lines, of which each begins where the one before it ends, as one."""
    return np.concatenate([lines[0], *(line[1:] for line in lines[1:])])


def bezier(*controls: FloatArray, count: int) -> FloatArray:
    """Return points along a Bezier curve (`count` by 2 [m]), by de Casteljau's construction."""
    at = np.linspace(0.0, 1.0, count)[:, None]
    rows = list(controls)
    while len(rows) > 1:
        rows = [(1.0 - at) * one + at * other for one, other in pairwise(rows)]
    return np.asarray(rows[0])


def lines_inside(lines: Mapping[str, FloatArray], outline: FloatArray) -> dict[str, FloatArray]:
    """Return of each line the longest part that lies inside an outline; lines with less than 1 mm inside are left out."""
    import shapely

    body, found = shapely.Polygon(outline).buffer(ON), {}
    for name, line in lines.items():
        parts = shapely.get_parts(shapely.LineString(line).intersection(body))
        parts = [part for part in parts if part.geom_type == "LineString" and part.length > SHORT]
        if parts:
            found[name] = np.asarray(max(parts, key=lambda part: part.length).coords)
    return found


def lines_of(piece: Piece) -> dict[str, FloatArray]:
    """Return the edges of a piece and the lines inside it."""
    return {**{edge.name: edge.points for edge in piece.edges}, **piece.internal_lines}


def lines_ending_on(edge: FloatArray, lines: Mapping[str, FloatArray]) -> list[tuple[str, float]]:
    """Return how far along an edge other lines end on it [m], within 1 mm, with their names."""
    import shapely

    line = shapely.LineString(edge)
    ends = [(name, shapely.Point(end)) for name, points in lines.items() for end in points[[0, -1]]]
    return [(name, float(line.project(end))) for name, end in ends if line.distance(end) < ON_EDGE]


def drawn_on(
    piece: Piece, lines: Iterable[tuple[str, FloatArray]], marks: Iterable[tuple[str, FloatArray]] = ()
) -> Piece:
    """Return a piece with more lines and marks, each of its name or the first one after it that is free."""
    drawn, marked = dict(piece.internal_lines), dict(piece.marks)
    for known, new in ((drawn, lines), (marked, marks)):
        for name, points in new:
            known[find_unused_name(name, known)] = points
    return replace(piece, internal_lines=drawn, marks=marked)


def up_and_across(piece: Piece) -> tuple[FloatArray, FloatArray]:
    """Return the unit vectors along the warp, upwards, and along the weft, to the right."""
    up = np.array([0.0, 1.0]) if piece.grain is None else direction(piece.grain)
    return up, np.array([up[1], -up[0]])


def runs_down(piece: Piece, points: FloatArray) -> bool:
    """Return whether a line of a piece runs against the grain."""
    return bool((points[-1] - points[0]) @ up_and_across(piece)[0] < 0.0)


def falling(piece: Piece, points: FloatArray) -> FloatArray:
    """Return a line of a piece from its upper end."""
    return points if runs_down(piece, points) else points[::-1]


def downwards(piece: Piece, name: str) -> tuple[FloatArray, bool]:
    """Return the points of an edge from its upper end, and whether it runs that way itself."""
    points = piece.edge(name).points
    return falling(piece, points), runs_down(piece, points)


def edge_at(pattern: Pattern, at: SeamSide | Place, size: str | None = None) -> Edge:
    """Return the edge at a place, or of a seam's side; of the sample size if none is given."""
    name, edge = (at.piece, at.edge) if isinstance(at, SeamSide) else at
    return pattern.piece(name, pattern.sample if size is None else size).edge(edge)


def lengths_of(pattern: Pattern, sides: Iterable[SeamSide], size: str | None = None) -> list[float]:
    """Return the lengths of edges [m], of the sample size if none is given."""
    return [edge_at(pattern, side, size).length for side in sides]


def side_points(pattern: Pattern, side: SeamSide, size: str) -> FloatArray:
    """Return the points of a seam's side, as the seam runs."""
    return edge_at(pattern, side, size).points[:: -1 if side.reversed else 1]


def neighbour(piece: Piece, edge: str, end: int) -> tuple[str, int]:
    """Return the edge that meets another one at its end (0 or 1), and which end of that it is."""
    names = [each.name for each in piece.edges]
    at = names.index(edge)
    return (names[(at + 1) % len(names)], 0) if end == 1 else (names[at - 1], 1)


def beside(piece: Piece, *chain: str) -> tuple[str, str]:
    """Return the names of the edges before and after some that follow each other."""
    return neighbour(piece, chain[0], 0)[0], neighbour(piece, chain[-1], 1)[0]


def above_and_below(piece: Piece, edge: str) -> tuple[str, str]:
    """Return the names of the edges that meet another one at its upper and at its lower end."""
    before, after = beside(piece, edge)
    return (before, after) if runs_down(piece, piece.edge(edge).points) else (after, before)


def polygon_edges(names: Sequence[str], corners: FloatArray, **how: Any) -> list[Edge]:
    """Return straight edges from corner to corner (#N by 2 [m], counter-clockwise), with other attributes, if given."""
    ends = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    return [Edge(name=name, points=np.array(both), **how) for name, both in zip(names, ends, strict=True)]


def backwards(edges: Sequence[Edge]) -> list[Edge]:
    """Return edges that follow each other as they are walked the other way."""
    rows = [(edge, None if edge.vertices is None else edge.vertices[::-1]) for edge in edges[::-1]]
    return [replace(edge, points=edge.points[::-1], vertices=vertices) for edge, vertices in rows]


def with_edges(piece: Piece, new: Mapping[str, Sequence[Edge]], **other: Any) -> Piece:
    """Return a piece with others in place of some edges, by name, and with other attributes, if given."""
    return replace(piece, edges=[each for edge in piece.edges for each in new.get(edge.name, (edge,))], **other)


def parted(edge: Edge, at: float, names: tuple[str, str]) -> tuple[Edge, Edge]:
    """Return the two parts of an edge that ends and begins at a length along it [m]."""
    first, second = part_between(edge.points, 0.0, at), part_between(edge.points, at, edge.length)
    # Corners are shared bit for bit.
    first[0], second[-1], second[0] = edge.points[0], edge.points[-1], first[-1]
    return (
        replace(edge, name=names[0], points=first, vertices=None),
        replace(edge, name=names[1], points=second, vertices=None),
    )


def trimmed(piece: Piece, edges: Sequence[Edge], **other: Any) -> Piece:
    """Return a piece with a smaller outline, and with what of its lines and marks lies inside."""
    import shapely

    outline = np.concatenate([edge.points[:-1] for edge in edges])
    body = shapely.Polygon(outline).buffer(ON)
    return replace(
        piece, edges=edges, internal_lines=lines_inside(piece.internal_lines, outline),
        marks={name: mark for name, mark in piece.marks.items() if body.contains(shapely.Point(mark))}, **other,
    )  # fmt: skip


def in_sizes(pattern: Pattern, name: str) -> list[Piece]:
    """Return the piece of a name in every size."""
    return [pattern.piece(name, size) for size in pattern.pieces]


def with_pieces(pattern: Pattern, pieces: Iterable[Piece]) -> Pattern:
    """Return a pattern with pieces in place of those of their names and sizes, and with those that are new."""
    rows = {size: {piece.name: piece for piece in row} for size, row in pattern.pieces.items()}
    for piece in pieces:
        rows[piece.size][piece.name] = piece
    return replace(pattern, pieces={size: tuple(row.values()) for size, row in rows.items()})


def redrawn(pattern: Pattern, name: str, draw: Callable[[Piece], Piece | Iterable[Piece]]) -> Pattern:
    """Return a pattern with what `draw` makes of a piece in every size: others in its place, or new ones."""
    made = [draw(piece) for piece in in_sizes(pattern, name)]
    return with_pieces(pattern, (each for row in made for each in ((row,) if isinstance(row, Piece) else row)))


def added(pattern: Pattern, draw: Callable[[Piece], Piece | Iterable[Piece]]) -> Pattern:
    """Return a pattern with new pieces in every size: `draw` gets a piece of that size and of the shell's cloth."""
    return redrawn(pattern, pattern.pieces[pattern.sample][0].name, draw)


def changed(pattern: Pattern, place: Place, change: Callable[[Piece, Edge], Sequence[Edge]]) -> Pattern:
    """Return a pattern with what `change` makes of an edge of a piece, in every size."""
    name, edge = place
    return redrawn(pattern, name, lambda piece: with_edges(piece, {edge: change(piece, piece.edge(edge))}))


def new_piece(name: str, like: Piece, edges: Sequence[Edge], role: str, **other: Any) -> Piece:
    """Return a piece of the size and the cloth of another one; unless `other` says so, it is not cut in pairs."""
    return Piece(name=name, size=like.size, edges=edges, role=role, **{"fabric": like.fabric, "paired": False, **other})


def free_piece_name(pattern: Pattern, name: str) -> str:
    """Return the name of a new piece: the one that is asked for, or the first one after it that is free."""
    return find_unused_name(name, {piece.name for piece in pattern.pieces[pattern.sample]})


def sewn(pattern: Pattern, name: str, first: Sides, second: Sides, **how: Any) -> Pattern:
    """Return a pattern with one more seam, of that name or the first one after it that is free.

    Args:
        pattern: with its pieces.
        name: what the seam is to be called, in words or as a piece is.
        first, second: its sides.
        how: other attributes of a :class:`Seam`.
    """
    rows = [(row,) if isinstance(row, SeamSide) else row for row in (first, second)]
    name = find_unused_name(name.replace("_", " "), {seam.name for seam in pattern.seams})
    return replace(pattern, seams=[*pattern.seams, Seam(name=name, sides=(rows[0], rows[1]), **how)])


def copies_sewn(pattern: Pattern, name: str, piece: str, *edges: str) -> Pattern:
    """Return a pattern with edges of a piece sewn to those of its copy that is turned over."""
    row = tuple(SeamSide(piece=piece, edge=edge) for edge in edges)
    return sewn(pattern, name, row, tuple(replace(side, mirrored=True) for side in row))


def sewn_places(pattern: Pattern) -> set[Place]:
    """Return the edges that seams join."""
    return {side.place for seam in pattern.seams for side in seam.stretches}
