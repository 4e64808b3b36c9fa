"""Patterns of polygons, to be sewn and laid around a body."""

from __future__ import annotations

import numpy as np
from polygons import corners_of, polygon, sewn

from warpflat.pattern.drafting.pieces import Piece, Seam

__all__ = ["ARMHOLE", "SLEEVE", "TOP", "top"]

#: Corners of half a top, counter-clockwise from the hem's left end: sides, armholes, shoulders and the neck between these.
TOP = [(0.0, 0.0), (0.5, 0.0), (0.5, 0.35), (0.43, 0.56), (0.34, 0.58), (0.16, 0.58), (0.07, 0.56), (0.0, 0.35)]
ARMHOLE = 2.0 * float(np.hypot(0.07, 0.21))
SLEEVE = corners_of(ARMHOLE, 0.25)


def top(first: str = "p", second: str = "q") -> tuple[list[Piece], list[Seam]]:
    """A top of two equal pieces with two sleeves, one of which is drawn upside down."""
    pieces = [polygon(first, TOP), polygon(second, TOP), polygon("l", SLEEVE), polygon("r", SLEEVE)]
    seams = [sewn(f"{first}.e{k}", f"{second}.e{8 - k}") for k in (1, 3, 5, 7)]
    seams += [sewn("l.e1", "l.e3"), sewn("r.e1", "r.e3")]
    return pieces, [*seams, sewn(f"{first}.e2 + {second}.e6", "l.e2"), sewn(f"{second}.e2 + {first}.e6", "r.e0")]
