"""What is cut from each cloth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from warpflat.pattern.drafting.drafted import DraftedPiece
from warpflat.pattern.drafting.sewing_tasks import piece_titles

__all__ = ["CutEntry", "cut_list"]


@dataclass(frozen=True, kw_only=True)
class CutEntry:
    """A piece that is cut from a cloth.

    Attributes:
        piece: its name.
        title: as it is printed.
        quantity: how often it is cut.
        on_fold: half, on the fold of the cloth.
        mirrored: how many of them are cut turned over.
    """

    piece: str
    title: str
    quantity: int
    on_fold: bool
    mirrored: int


def cut_list(pieces: Sequence[DraftedPiece]) -> dict[str, list[CutEntry]]:
    """Return by cloth what is cut from it, the shell first."""
    titles = piece_titles([piece.piece for piece in pieces])
    found: dict[str, list[CutEntry]] = {}
    for piece in pieces:
        for cloth, quantity in piece.piece.cloths.items():
            entry = CutEntry(
                piece=piece.name, title=titles[piece.name], quantity=quantity, on_fold=piece.piece.on_fold,
                mirrored=sum(piece.piece.turned_over(quantity)),
            )  # fmt: skip
            found.setdefault(cloth, []).append(entry)
    return found
