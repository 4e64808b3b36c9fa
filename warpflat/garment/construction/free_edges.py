"""Free edges of a pattern, and the chains that they form once its seams are sewn."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core import FloatArray, find_unused_name, other_side, points_at_lengths, polyline_length, without_side
from warpflat.garment.construction.edges import (
    SAME_PIECE,
    Place,
    changed,
    direction,
    edge_at,
    lines_ending_on,
    lines_of,
    neighbour,
    parted,
    runs_down,
    side_points,
)
from warpflat.pattern import Pattern, Seam, SeamSide, drawn_length, unnumbered

__all__ = [
    "Break",
    "FreeChain",
    "chain_allowance",
    "chain_length",
    "crossed_at",
    "free_chain",
    "free_chains",
    "joined_line",
    "marks_of",
    "split_edge",
]

#: A corner: piece, edge, whether it is of the copy that is turned over, and the end of the edge (0 or 1).
_Corner = tuple[str, str, bool, int]
#: Where chains end though the cloth goes on, as at a slit: piece, edge, and the end of the edge (0 or 1).
Break = tuple[str, str, int]

# A line meets an edge inside it, not at its ends, beyond this distance [m].
OFF_END = 2e-3
# Directions at the ends of edges are those of their first or last so much [m].
_NEAR_END = 0.004


@dataclass(frozen=True, kw_only=True)
class FreeChain:
    """Free edges that follow each other across seams, folds and darts.

    Attributes:
        sides: the edges in order, as a seam's side.
        closed: whether the last one ends where the first one begins.
    """

    sides: tuple[SeamSide, ...]
    closed: bool


def free_chain(
    pattern: Pattern,
    places: Sequence[Place],
    gaps: Collection[str] = (),
    breaks: Collection[Break] = (),
) -> FreeChain:
    """Return the chain of free edges that the first of some places is part of.

    Args:
        pattern: its sample size tells which edges meet.
        places: pieces and edges that the chain may have.
        gaps: names of seams at which it ends.
        breaks: ends of edges at which it ends.
    """
    start = (*places[0], False, 0)
    here, seen = start, set[tuple[str, str, bool]]()
    # First back to where the chain begins, then along it.
    while here[:3] not in seen:
        seen.add(here[:3])
        before = _next(pattern, here, places, gaps, breaks)
        if before is None:
            break
        here = _other_end(before)
    sides, seen = [], set()
    corner: _Corner | None = here
    while corner is not None and corner[:3] not in seen:
        seen.add(corner[:3])
        piece, edge, mirrored, end = corner
        sides.append(SeamSide(piece=piece, edge=edge, mirrored=mirrored, reversed=end == 1))
        corner = _next(pattern, _other_end(corner), places, gaps, breaks)
    return FreeChain(sides=tuple(sides), closed=corner is not None)


def free_chains(
    pattern: Pattern,
    places: Sequence[Place],
    gaps: Collection[str] = (),
    breaks: Collection[Break] = (),
) -> list[tuple[FreeChain, int]]:
    """Return the chains of free edges, each with how often the garment has it; see :func:`free_chain`.

    A chain of one side of the body, as an armhole, stands for that of the other side too, where both are equally long.
    """
    left, chains = list(places), list[FreeChain]()
    while left:
        chain = free_chain(pattern, [left[0], *places], gaps, breaks)
        chains.append(chain)
        left = [place for place in left if place not in {side.place for side in chain.sides}]
    found, drawn_for_both = list[tuple[FreeChain, int]](), list[FreeChain]()
    for chain in chains:
        own = {side.place for side in chain.sides}
        mirrored = {(other_side(piece), other_side(edge)) for piece, edge in own}
        sided = any(without_side(edge) != edge for _, edge in own)
        twin = next((each for each in chains if each is not chain and mirrored & {s.place for s in each.sides}), None)
        if not sided or (
            twin is not None and abs(chain_length(pattern, chain) - chain_length(pattern, twin)) > SAME_PIECE
        ):
            found.append((chain, 1))
        elif twin not in drawn_for_both:
            found.append((chain, 2))
            drawn_for_both.append(chain)
    return found


def chain_length(pattern: Pattern, chain: FreeChain, size: str | None = None) -> float:
    """Return the length of a chain in a size, or in the sample size, along the curves as which its edges are drawn [m]."""
    return sum(drawn_length(edge_at(pattern, side, size).points) for side in chain.sides)


def chain_allowance(pattern: Pattern, chain: FreeChain, size: str) -> float:
    """Return the allowance of a chain's first edge [m], which what is sewn to the chain has too."""
    return edge_at(pattern, chain.sides[0], size).width


def _other_end(corner: _Corner) -> _Corner:
    return (*corner[:3], 1 - corner[3])


def _next(
    pattern: Pattern,
    corner: _Corner,
    places: Sequence[Place],
    gaps: Collection[str],
    breaks: Collection[Break],
) -> _Corner | None:
    """Return the corner of the free edge that goes on where another one ends; None where the chain ends."""
    piece, edge, mirrored, end = corner
    if (piece, edge, end) in breaks:
        return None
    name, at = neighbour(pattern.piece(piece, pattern.sample), edge, end)
    beside = pattern.piece(piece, pattern.sample).edge(name)
    if beside.kind == "fold":
        return piece, edge, not mirrored, end
    if (piece, name) in places:
        return None if (piece, name, at) in breaks else (piece, name, mirrored, at)
    if beside.kind == "dart":
        # The other leg follows, and beyond it the other part of the edge.
        leg, _ = neighbour(pattern.piece(piece, pattern.sample), name, end)
        other, at = neighbour(pattern.piece(piece, pattern.sample), leg, end)
        return (piece, other, mirrored, at) if (piece, other) in places else None
    across = _across(pattern, (piece, name, mirrored, at), gaps)
    if across is None:
        return None
    piece, edge, mirrored, end = across
    name, at = neighbour(pattern.piece(piece, pattern.sample), edge, end)
    return (piece, name, mirrored, at) if (piece, name) in places else None


def _across(pattern: Pattern, corner: _Corner, gaps: Collection[str]) -> _Corner | None:
    """Return the corner that a seam sews to another one; None in a gap, or where no seam begins or ends."""
    piece, edge, mirrored, end = corner
    for turned in (False, True):
        for seam in pattern.seams:
            for number, row in enumerate(seam.sides):
                for at_start in (True, False):
                    side, other = row[0 if at_start else -1], seam.sides[1 - number][0 if at_start else -1]
                    reached = (side.piece, side.edge, side.mirrored != turned)
                    if reached != (piece, edge, mirrored) or (end == 0) == (at_start == side.reversed):
                        continue
                    # Halves that meet in the centre are one edge twice. Of a half's other seams the list has the left one.
                    centre = side.place == other.place
                    if seam.name in gaps and (centre or not turned) and _is_open_at(pattern, seam, side, at_start):
                        return None
                    turned_over = not mirrored if centre else other.mirrored != turned
                    return other.piece, other.edge, turned_over, int(at_start == other.reversed)
    return None


def _is_open_at(pattern: Pattern, seam: Seam, side: SeamSide, at_start: bool) -> bool:
    """Return whether a seam whose upper end is open is so at an end of one of its sides: at the lower one if all of it opens."""
    piece = pattern.piece(side.piece, pattern.sample)
    down = runs_down(piece, side_points(pattern, side, pattern.sample))
    return at_start == down or any(opening.whole for opening in seam.openings)


def split_edge(pattern: Pattern, place: Place, at: Mapping[str, float]) -> tuple[Pattern, Break]:
    """Return a pattern with an edge in two, and the end of the first part at which a chain is to be broken.

    Args:
        pattern: whose seams do not have the edge.
        place: piece and edge. The longer part keeps its name.
        at: by size, where along the edge it is parted [m].
    """
    name, edge = place
    sample = pattern.piece(name, pattern.sample)
    new = find_unused_name(edge, {each.name for each in sample.edges})
    # Of two parts that are equally long, as in the centre, the last one.
    names = (edge, new) if at[pattern.sample] > 0.5 * sample.edge(edge).length + OFF_END else (new, edge)
    made = changed(pattern, place, lambda piece, whole: parted(whole, at[piece.size], names))
    return made, (name, names[0], 1)


def marks_of(pattern: Pattern, chain: FreeChain, size: str, line: str) -> list[float]:
    """Return where along a chain a line of its pieces, inside or on their border, meets it [m]."""
    found, before = list[float](), 0.0
    for side in chain.sides:
        known = lines_of(pattern.piece(side.piece, size)).items()
        lines = {name: each for name, each in known if unnumbered(name) == line and name != side.edge}
        points = side_points(pattern, side, size)
        for at in (before + at for _, at in lines_ending_on(points, lines)):
            if all(abs(at - other) > OFF_END for other in found):
                found.append(at)
        before += polyline_length(points)
    return sorted(found)


def crossed_at(pattern: Pattern, place: Place, line: str) -> dict[str, float] | None:
    """Return by size where a line of its piece crosses an edge [m], clear of both ends; None where it does not in every size."""
    found, chain = dict[str, float](), FreeChain(sides=(SeamSide(piece=place[0], edge=place[1]),), closed=False)
    for size in pattern.pieces:
        at, length = marks_of(pattern, chain, size, line), edge_at(pattern, place, size).length
        if len(at) != 1 or not OFF_END < at[0] < length - OFF_END:
            return None
        found[size] = at[0]
    return found


def joined_line(pattern: Pattern, chain: FreeChain, size: str, *, lapped: float = 0.0) -> FloatArray:
    """Return a chain as one line in the plane, its pieces laid against each other along their seams (#P by 2 [m]).

    The cloth lies to the left of the line.

    Args:
        pattern: with the chain.
        chain: free edges that follow each other.
        size: of the pieces.
        lapped: by how much pieces are turned over each other at the seams [rad], as for a collar that is to roll.
    """
    line, before, ray = np.empty((0, 2)), ("", False, ""), np.zeros(2)
    for side in chain.sides:
        piece = pattern.piece(side.piece, size)
        # Walked against its own direction, an edge has the cloth to its right; so has a copy that is turned over, walked along it.
        flip = np.array([1.0, -1.0 if side.reversed else 1.0])
        points = side_points(pattern, side, size) * flip
        # The edges that meet it at both ends, and how they run from there.
        names, at = zip(*(neighbour(piece, side.edge, end != side.reversed) for end in (0, 1)), strict=True)
        rays = [
            _heading(piece.edge(name).points[:: -1 if end else 1]) * flip for name, end in zip(names, at, strict=True)
        ]
        if not len(line):
            line = points
        else:
            goes_on = before == (side.piece, side.mirrored, side.edge)
            (x, y), (u, v) = _heading(points) if goes_on else rays[0], ray
            by = float(np.arctan2(x * v - y * u, x * u + y * v)) + (0.0 if goes_on else lapped)
            rotation = np.array([[np.cos(by), np.sin(by)], [-np.sin(by), np.cos(by)]])
            line, rays[1] = np.vstack([line, line[-1] + (points[1:] - points[0]) @ rotation]), rays[1] @ rotation
        before, ray = (side.piece, side.mirrored, names[1]), rays[1]
    return line


def _heading(points: FloatArray) -> FloatArray:
    """Return the direction in which a line begins."""
    return direction(np.array([points[0], points_at_lengths(points, _NEAR_END)]))
