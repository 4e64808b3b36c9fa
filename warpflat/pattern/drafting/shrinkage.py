"""Pieces drawn larger for cloth that shrinks in the wash or under the iron."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warpflat.core import FloatArray, InputError, arc_lengths
from warpflat.pattern.drafting.curves import Curve
from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece

__all__ = ["Shrinkage", "as_worn", "enlarged", "resized"]

#: More than this share is no cloth's shrinkage.
MOST = 0.25


@dataclass(frozen=True, kw_only=True)
class Shrinkage:
    """The share of its length that cloth loses, along each thread.

    Attributes:
        warp, weft: shares from 0 to `MOST`.
    """

    warp: float = 0.0
    weft: float = 0.0

    def __post_init__(self) -> None:
        for name, value in (("warp", self.warp), ("weft", self.weft)):
            if not 0.0 <= value <= MOST:
                raise InputError(
                    f"shrinkage along {name} is {value!r}; it must lie between 0 and {MOST:g} (0.03 is 3 %)"
                )

    @property
    def factors(self) -> FloatArray:
        """By what a drafted piece, whose grain runs upwards, is made larger: across and along."""
        return 1.0 / (1.0 - np.array([self.weft, self.warp]))

    @property
    def words(self) -> str:
        """What the page says."""
        return f"drawn larger for cloth that shrinks by {100 * self.warp:.3g} % along the warp and {100 * self.weft:.3g} % along the weft"


def enlarged(garment: DraftedGarment, shrinkage: Shrinkage, fabric: str) -> DraftedGarment:
    """Return a garment whose pieces of one fabric are drawn larger along warp and weft, allowances and notches included.

    After the cloth has shrunk, its seams are as long as before, and their notches meet. The reports on seams stay those of the
    finished garment.
    """
    if not (shrinkage.warp or shrinkage.weft):
        return garment
    return garment.with_each(
        lambda piece: (
            replace(resized(piece, shrinkage.factors), notes=(*piece.notes, shrinkage.words))
            if piece.piece.fabric == fabric
            else piece
        )
    )


def as_worn(piece: DraftedPiece) -> DraftedPiece:
    """Return a drafted piece as large as it is once its cloth has shrunk."""
    return resized(piece, 1.0 / np.array(piece.enlarged))


def resized(piece: DraftedPiece, factors: FloatArray) -> DraftedPiece:
    """Return a drafted piece made larger by factors across and along its grain, allowances and notches included."""
    if (factors == 1.0).all():
        return piece
    lines = {name: line * factors for name, line in piece.internal_lines.items()}
    cutouts = {
        name: replace(cutout, sew_line=cutout.sew_line * factors, cut_line=cutout.cut_line * factors)
        for name, cutout in piece.cutouts.items()
    }
    darts = [
        replace(dart, tip=dart.tip * factors, fold=None if dart.fold is None else dart.fold * factors)
        for dart in piece.darts
    ]
    notches = [
        replace(notch, at=notch.at * factors, base=tuple(base * factors for base in notch.base))
        for notch in piece.notches
    ]
    edges = [
        replace(
            edge,
            curve=Curve(bezier=edge.curve.bezier * factors, straight=edge.curve.straight),
            line=edge.line * factors,
            places=np.interp(edge.places, arc_lengths(edge.line), arc_lengths(edge.line * factors)),
        )
        for edge in piece.edges
    ]
    leader = None if piece.label.leader is None else piece.label.leader * factors
    return replace(
        piece,
        edges=tuple(edges),
        cut_line=piece.cut_line * factors,
        darts=tuple(darts),
        drill_holes=tuple(replace(hole, at=hole.at * factors) for hole in piece.drill_holes),
        notches=tuple(notches),
        internal_lines=lines,
        cutouts=cutouts,
        fisheyes={name: line * factors for name, line in piece.fisheyes.items()},
        grain=piece.grain * factors,
        label=replace(piece.label, at=piece.label.at * factors, leader=leader),
        enlarged=(float(piece.enlarged[0] * factors[0]), float(piece.enlarged[1] * factors[1])),
    )
