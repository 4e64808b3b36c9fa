"""How much cloth a garment takes at the usual widths."""

from __future__ import annotations

from warpflat.pattern.cut_list import cloths_of
from warpflat.pattern.drafted import DraftedGarment
from warpflat.pattern.marker import unfold_piece
from warpflat.pattern.tile_nesting import nest_on_strip

__all__ = ["WIDTHS", "cloth_needed"]

#: Widths [m] at which cloth is sold.
WIDTHS = (0.90, 1.15, 1.50)
#: Between pieces, and unused at either selvedge [m].
GAP, SELVEDGE = 0.006, 0.010


def cloth_needed(garment: DraftedGarment, size: str) -> dict[str, tuple[float | None, ...]]:
    """Return the length [m] of cloth for one garment at each of `WIDTHS`, by fabric; None where a piece is too wide.

    Whole pieces are laid on one layer with their grain along it, either way up. The lay is quick and repeatable; a
    marker (:func:`warpflat.pattern.marker.make_marker`) searches longer and finds shorter ones.
    """
    import shapely

    shapes: dict[str, list[shapely.Polygon]] = {}
    for piece in garment.pieces[size]:
        whole = shapely.Polygon(unfold_piece(piece))
        mirrored = shapely.transform(whole, lambda points: points * [-1.0, 1.0])
        for cloth, quantity in cloths_of(piece).items():
            pairs = piece.piece.paired and not piece.piece.on_fold and quantity % 2 == 0
            shapes.setdefault(cloth, []).extend(mirrored if pairs and k % 2 else whole for k in range(quantity))
    return {
        fabric: tuple(nest_on_strip(row, width=width - 2 * SELVEDGE, gap=GAP) for width in WIDTHS)
        for fabric, row in shapes.items()
    }
