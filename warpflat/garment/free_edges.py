"""Free edges of a pattern, and the chains that they form once its seams are sewn."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from warpflat.pattern.pieces import Pattern, Piece, SeamSide

__all__ = ["FreeChain", "free_chain", "free_edges"]

#: A corner: piece, edge, whether it is of the copy that is turned over, and the end of the edge (0 or 1).
_Corner = tuple[str, str, bool, int]


@dataclass(frozen=True, kw_only=True)
class FreeChain:
    """Free edges that follow each other across seams, folds and darts.

    Attributes:
        sides: the edges in order, as a seam's side.
        closed: whether the last one ends where the first one begins.
    """

    sides: tuple[SeamSide, ...]
    closed: bool


def free_edges(pattern: Pattern) -> list[tuple[str, str]]:
    """Return piece and edge of every edge with a seam's allowance that is in no seam."""
    sewn = {(side.piece, side.edge) for seam in pattern.seams for row in seam.sides for side in row}
    pieces = pattern.pieces[pattern.sample]
    return [
        (piece.name, edge.name)
        for piece in pieces
        for edge in piece.edges
        if edge.kind == "seam" and (piece.name, edge.name) not in sewn
    ]


def free_chain(pattern: Pattern, places: Sequence[tuple[str, str]], gaps: Collection[str] = ()) -> FreeChain:
    """Return the chain of free edges that the first of some places is part of.

    Args:
        pattern: its sample size tells which edges meet.
        places: pieces and edges that the chain may have.
        gaps: names of seams at which it ends.
    """
    start = (*places[0], False, 0)
    here, seen = start, set[tuple[str, str, bool]]()
    # First back to where the chain begins, then along it.
    while here[:3] not in seen:
        seen.add(here[:3])
        before = _next(pattern, here, places, gaps)
        if before is None:
            break
        here = _other_end(before)
    sides, seen = [], set()
    corner: _Corner | None = here
    while corner is not None and corner[:3] not in seen:
        seen.add(corner[:3])
        piece, edge, mirrored, end = corner
        sides.append(SeamSide(piece=piece, edge=edge, mirrored=mirrored, reversed=end == 1))
        corner = _next(pattern, _other_end(corner), places, gaps)
    return FreeChain(sides=tuple(sides), closed=corner is not None)


def _other_end(corner: _Corner) -> _Corner:
    return (*corner[:3], 1 - corner[3])


def _next(
    pattern: Pattern, corner: _Corner, places: Sequence[tuple[str, str]], gaps: Collection[str]
) -> _Corner | None:
    """Return the corner of the free edge that goes on where another one ends; None where the chain ends."""
    piece, edge, mirrored, end = corner
    name, at = _beside(pattern.piece(piece, pattern.sample), edge, end)
    beside = pattern.piece(piece, pattern.sample).edge(name)
    if beside.kind == "fold":
        return piece, edge, not mirrored, end
    if (piece, name) in places:
        return piece, name, mirrored, at
    if beside.kind == "dart":
        # The other leg follows, and beyond it the other part of the edge.
        leg, _ = _beside(pattern.piece(piece, pattern.sample), name, end)
        other, at = _beside(pattern.piece(piece, pattern.sample), leg, end)
        return (piece, other, mirrored, at) if (piece, other) in places else None
    across = _across(pattern, (piece, name, mirrored, at), gaps)
    if across is None:
        return None
    piece, edge, mirrored, end = across
    name, at = _beside(pattern.piece(piece, pattern.sample), edge, end)
    return (piece, name, mirrored, at) if (piece, name) in places else None


def _beside(piece: Piece, edge: str, end: int) -> tuple[str, int]:
    """Return the edge that meets another one at its end, and which end of that it is."""
    names = [each.name for each in piece.edges]
    at = names.index(edge)
    return (names[(at + 1) % len(names)], 0) if end == 1 else (names[at - 1], 1)


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
                    centre = (side.piece, side.edge) == (other.piece, other.edge)
                    if seam.name in gaps and (centre or not turned):
                        return None
                    turned_over = not mirrored if centre else other.mirrored != turned
                    return other.piece, other.edge, turned_over, int(at_start == other.reversed)
    return None
