"""Pieces whose sides are straight, and the seams between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.drafting.piece_parts import Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamSide

__all__ = ["corners_of", "drafted", "polygon", "sewn", "sides"]


def corners_of(width: float, height: float, left: float = 0.0, bottom: float = 0.0) -> list[tuple[float, float]]:
    """The corners of a rectangle, counter-clockwise from its lower left one [m]."""
    right, top = left + width, bottom + height
    return [(left, bottom), (right, bottom), (right, top), (left, top)]


def sides(
    corners: ArrayLike,
    *,
    names: Sequence[str] = (),
    kinds: Sequence[str] = (),
    widths: Sequence[float | None] = (),
    first: int = 0,
    closed: bool = True,
) -> list[Edge]:
    """Edges that join corners (#P by 2 [m]): numbered e0, e1 ... where they have no names, seams where they have no kinds.

    Args:
        corners: of a line.
        names: of the edges.
        kinds: of the edges.
        widths: of their allowances [m].
        first: number.
        closed: whether the last edge joins the last corner to the first.
    """
    line = np.asarray(corners, dtype=float)
    line = np.concatenate([line, line[:1]]) if closed else line
    count = len(line) - 1
    return [
        Edge(
            name=names[k] if names else f"e{first + k}",
            points=line[k : k + 2],
            kind=kinds[k] if kinds else "seam",  # type: ignore[arg-type]
            allowance=widths[k] if widths else None,
        )
        for k in range(count)
    ]


def polygon(
    name: str,
    corners: ArrayLike,
    *,
    names: Sequence[str] = (),
    kinds: Sequence[str] = (),
    widths: Sequence[float | None] = (),
    first: int = 0,
    **more: Any,
) -> Piece:
    """A piece of which :func:`sides` makes the edges."""
    return Piece(name=name, edges=sides(corners, names=names, kinds=kinds, widths=widths, first=first), **more)


def sewn(first: str, second: str, name: str = "", **more: Any) -> Seam:
    """A seam of two sides "piece.edge + piece.edge", of which the second runs against its edges."""
    both = [
        tuple(SeamSide(piece=p, edge=e, reversed=k == 1) for p, e in (word.split(".") for word in text.split(" + ")))
        for k, text in enumerate((first, second))
    ]
    return Seam(name=name or f"{first} {second}", sides=(both[0], both[1]), **more)


def drafted(*pieces: Piece, seams: Sequence[Seam] = (), name: str = "p") -> DraftedGarment:
    """The pattern of pieces in one size, drafted."""
    return draft_garment(Pattern(name=name, pieces={"": pieces}, seams=seams))


def drafted_piece(piece: Piece, *, name: str = "p", tolerance: float | None = None) -> DraftedPiece:
    """A piece, drafted as the only one of its pattern, whose corners nothing trues."""
    pattern = Pattern(name=name, pieces={piece.size: [piece]})
    return draft_garment(pattern, tolerance=tolerance, true=False).pieces[piece.size][0]
