"""Finishing pieces derived from a pattern's own free edges: facings, bands, waistbands and bindings."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core.errors import InputError, nearest
from warpflat.core.text import find_unused_name, without_side
from warpflat.garment.facings import Stand, centre_notch, with_facings, with_stand_facings
from warpflat.garment.free_edges import FreeChain, free_chain, free_edges
from warpflat.garment.shaped_band import with_shaped_waistband
from warpflat.pattern.piece_parts import DEFAULT_ALLOWANCE, Edge
from warpflat.pattern.pieces import Pattern, Piece, Seam, SeamSide

__all__ = ["FINISHES", "Finishing", "finish_edges"]

#: By kind the width of a finishing piece [m]; of bands that of the finished band, which is cut twice as wide and folded.
FINISHES = {"facing": 0.06, "band": 0.02, "waistband": 0.035, "binding": 0.035}


@dataclass(frozen=True, kw_only=True)
class Finishing:
    """A finishing of free edges.

    Attributes:
        kind: one of `FINISHES`.
        edge: name of the edges, without their side: "neck", "armhole", "waist".
        width: [m].
        share: length of a band over that of its edge; it is stretched as it is sewn.
        overlap: by how much a waistband runs past one end [m].
        shaped: whether a waistband is cut from the upper strip of the pieces, as curved as they are, not straight.
    """

    kind: str
    edge: str
    width: float
    share: float = 1.0
    overlap: float = 0.0
    shaped: bool = False

    @property
    def name(self) -> str:
        """Return what its pieces are called."""
        return {"waistband": "waistband", "band": f"{self.edge}_band"}.get(self.kind, f"{self.edge}_{self.kind}")


def finish_edges(
    pattern: Pattern, finishing: Sequence[Finishing], *, gaps: Collection[str] = (), stands: Sequence[Stand] = ()
) -> Pattern:
    """Return a pattern with the pieces that finish its edges, and the seams that join them.

    Args:
        pattern: with all its openings.
        finishing: what is wanted.
        gaps: names of seams that an opening leaves open at their upper end; a band ends there.
        stands: button stands; what no facing of an edge beside them takes along gets one of its own.

    Raises:
        InputError: no free edge has the name, or a facing cannot be drawn there.
    """
    for number, wish in enumerate(finishing):
        found = [place for place in free_edges(pattern) if without_side(place[1]).rstrip(" 0123456789") == wish.edge]
        if not found:
            known = {without_side(edge).rstrip(" 0123456789") for _, edge in free_edges(pattern)}
            raise InputError(f"finishing[{number}]: no free edge {wish.edge!r}; {nearest(wish.edge, known)}")
        try:
            if wish.kind == "facing":
                pattern = with_facings(pattern, found, wish.width, gaps=gaps, stands=stands)
            elif wish.shaped:
                pattern = with_shaped_waistband(pattern, found, wish.width, gaps=gaps)
            else:
                chain = free_chain(pattern, found, gaps)
                name = find_unused_name(wish.name, {piece.name for piece in pattern.pieces[pattern.sample]})
                sided = any(without_side(side.edge) != side.edge for side in chain.sides)
                ring = chain.closed and not wish.overlap
                pieces = {}
                for size, row in pattern.pieces.items():
                    length = wish.share * sum(
                        pattern.piece(side.piece, size).edge(side.edge).length for side in chain.sides
                    )
                    strip = _strip(wish, name, length, row[0], quantity=2 if sided else 1, ring=ring)
                    pieces[size] = (*row, strip)
                taken = {seam.name for seam in pattern.seams}
                words = name.replace("_", " ")
                seams = [
                    *pattern.seams,
                    Seam(
                        name=find_unused_name(words, taken), sides=((SeamSide(piece=name, edge="lower"),), chain.sides),
                        ease=1.0 / wish.share - 1.0, notches=None if sided else _centres(pattern, chain),
                    ),
                ]  # fmt: skip
                if ring:
                    ends = (
                        (SeamSide(piece=name, edge="right end"),),
                        (SeamSide(piece=name, edge="left end", reversed=True),),
                    )
                    seams.append(Seam(name=find_unused_name(f"{words} ends", taken), sides=ends))
                pattern = replace(pattern, pieces=pieces, seams=seams)
        except InputError as error:
            raise InputError(f"finishing[{number}]: {error}") from None
    sewn = {(side.piece, side.edge) for seam in pattern.seams for row in seam.sides for side in row}
    edges = {piece.name: {edge.name for edge in piece.edges} for piece in pattern.pieces[pattern.sample]}
    left = [each for each in stands if each.edge in edges[each.piece] and (each.piece, each.edge) not in sewn]
    return with_stand_facings(pattern, left)


def _centres(pattern: Pattern, chain: FreeChain) -> tuple[float, ...]:
    """Return the shares of a chain at the middles of the edges that cross a centre line; its joints are notched anyway.

    A piece that is printed half has the notch on its fold, and the strip has one for it.
    """
    lengths = [pattern.piece(side.piece, pattern.sample).edge(side.edge).length for side in chain.sides]
    ends = np.cumsum(lengths)
    whole = [centre_notch(pattern.piece(side.piece, pattern.sample)) is not None for side in chain.sides]
    return tuple(
        float((end - 0.5 * length) / ends[-1])
        for end, length, crosses in zip(ends, lengths, whole, strict=True)
        if crosses
    )


def _strip(wish: Finishing, name: str, length: float, like: Piece, *, quantity: int, ring: bool) -> Piece:
    """Return a strip of one size; its grain runs along a waistband, across a band and aslant over a binding."""
    folded = wish.kind != "binding"
    high, whole = wish.width * (2 if folded else 1), length + wish.overlap
    corners = [[0.0, 0.0], [length, 0.0], [whole, 0.0], [whole, high], [0.0, high]]
    names = ["lower", "overlap", "right end", "upper", "left end"]
    edges = []
    for i, edge in enumerate(names):
        ends = np.array([corners[i], corners[(i + 1) % len(corners)]])
        if np.linalg.norm(ends[1] - ends[0]) > 0.0:
            sewn = edge == "lower" or (ring and edge.endswith("end"))
            # What is turned in has an allowance too, and no seam; a binding's other edge is folded over as it is cut.
            turned_in = 0.0 if wish.kind == "binding" and edge == "upper" else DEFAULT_ALLOWANCE["seam"]
            edges.append(
                Edge(name=edge, points=ends, kind="seam" if sewn else "cut", allowance=None if sewn else turned_in)
            )
    along = {"waistband": [1.0, 0.0], "band": [0.0, 1.0], "binding": [0.7071, 0.7071]}[wish.kind]
    middle, reach = np.array([0.5 * whole, 0.5 * high]), 0.4 * (whole if wish.kind == "waistband" else high)
    grain = middle + np.outer([-reach, reach], along)
    lines = {"fold line": np.array([[0.0, wish.width], [whole, wish.width]])} if folded else {}
    return Piece(
        name=name, size=like.size, fabric=like.fabric, quantity=quantity, edges=edges, internal_lines=lines, grain=grain,
        paired=False, role="waistband" if wish.kind == "waistband" else "strip",
    )  # fmt: skip
