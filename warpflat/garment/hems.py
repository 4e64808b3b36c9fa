"""Hems of long sleeves: straight across the grain, whatever the elbow does above them."""

from __future__ import annotations

from collections.abc import Sequence

from warpflat.garment.constraints import Constraint, Straight
from warpflat.mannequin.forms import FormResult

__all__ = ["straight_hems"]

# The arm's levels from the elbow on: an elbow that is bent makes the cloth below it as long as it is bent, by column.
_BELOW_ELBOW = ("elbow", "forearm", "wrist")


def straight_hems(form: FormResult, asked: Sequence[Constraint]) -> list[Straight]:
    """Return the hems of sleeves that end at or below the elbow as straight lines; fullness at the elbow takes up the bend.

    A hem lies along the weft, or square to the forearm where an elbow dart swings it.

    Args:
        form: the garment.
        asked: constraints of its lines; what is asked for of a hem holds instead.
    """
    sewn = {(piece, edge) for seam in form.seams for piece, edge in zip(seam.pieces, seam.edges, strict=True)}
    sewn |= {
        (constraint.piece, getattr(constraint, "line", "")) for constraint in asked if hasattr(constraint, "piece")
    }
    return [
        Straight(piece=name, line=edge, along="free" if piece.darts else "weft")
        for name, piece in form.pieces.items()
        for edge in piece.edges
        if edge.split(" ")[0] in _BELOW_ELBOW and (name, edge) not in sewn and edge not in sum(piece.darts.values(), ())
    ]
