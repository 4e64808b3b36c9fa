"""Patterns of polygons, to be sewn and laid around a body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from warpflat.pattern.drafting.piece_parts import Edge
from warpflat.pattern.drafting.pieces import Piece, Seam, SeamSide

__all__ = ["ARMHOLE", "SLEEVE", "TOP", "polygon", "sewn", "top"]

#: Corners of half a top, counter-clockwise from the hem's left end: sides, armholes, shoulders and the neck between these.
TOP = [(0.0, 0.0), (0.5, 0.0), (0.5, 0.35), (0.43, 0.56), (0.34, 0.58), (0.16, 0.58), (0.07, 0.56), (0.0, 0.35)]
ARMHOLE = 2.0 * float(np.hypot(0.07, 0.21))
SLEEVE = [(0.0, 0.0), (ARMHOLE, 0.0), (ARMHOLE, 0.25), (0.0, 0.25)]


def polygon(name: str, corners: Sequence[tuple[float, float]], **more: Any) -> Piece:
    """A piece whose edges e0, e1 ... join its corners."""
    ring = np.array([*corners, corners[0]], dtype=float)
    edges = [Edge(name=f"e{k}", points=ring[k : k + 2]) for k in range(len(corners))]
    return Piece(name=name, edges=edges, **more)


def sewn(first: str, second: str, name: str = "", **more: Any) -> Seam:
    """A seam of two sides "piece.edge + piece.edge", of which the second runs against its edges."""
    sides = [
        tuple(SeamSide(piece=p, edge=e, reversed=k == 1) for p, e in (word.split(".") for word in text.split(" + ")))
        for k, text in enumerate((first, second))
    ]
    return Seam(name=name or f"{first} {second}", sides=(sides[0], sides[1]), **more)


def top(first: str = "p", second: str = "q") -> tuple[list[Piece], list[Seam]]:
    """A top of two equal pieces with two sleeves, one of which is drawn upside down."""
    pieces = [polygon(first, TOP), polygon(second, TOP), polygon("l", SLEEVE), polygon("r", SLEEVE)]
    seams = [sewn(f"{first}.e{k}", f"{second}.e{8 - k}") for k in (1, 3, 5, 7)]
    seams += [sewn("l.e1", "l.e3"), sewn("r.e1", "r.e3")]
    return pieces, [*seams, sewn(f"{first}.e2 + {second}.e6", "l.e2"), sewn(f"{second}.e2 + {first}.e6", "r.e0")]
