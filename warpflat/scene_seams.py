"""The tables `seams` and `constraints` of a scene, as wishes and constraints on named pieces and lines."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from warpflat.constraints import Constraint, FixedLength, Straight, Symmetric
from warpflat.errors import InputError, nearest
from warpflat.scene_types import ConstraintTable, SeamTable
from warpflat.seam_wishes import SeamWish

__all__ = ["scene_constraints", "scene_wishes"]


def scene_wishes(tables: Sequence[SeamTable]) -> list[SeamWish]:
    """What a scene wants of its seams."""
    return [
        SeamWish(
            name=table.name,
            factor=table.gather if table.gather is not None else 1.0 + (table.ease or 0.0),
            gathered=table.gather is not None,
            longer=table.longer,
        )
        for table in tables
    ]


def scene_constraints(
    tables: Sequence[ConstraintTable],
    lines: Mapping[str, Collection[str]],
    folds: Mapping[str, str] | None = None,
) -> list[Constraint]:
    """What a scene wants of its borders and lines, for every piece that has the line.

    A fold is straight and upright anyway: what asks that of it is left out.

    Args:
        tables: of the scene.
        lines: names of the lines (edges among them) by piece.
        folds: by piece, its edge on the fold.

    Raises:
        InputError: an unknown piece or line (names the nearest), or symmetry of a piece on the fold.
    """
    folds = folds or {}
    found: list[Constraint] = []
    for number, table in enumerate(tables):
        where = f"constraints[{number}]"
        if table.piece is not None and table.piece not in lines:
            raise InputError(f"{where}: no piece {table.piece!r}; {nearest(table.piece, lines)}")
        pieces = [piece for piece in lines if table.piece in (None, piece) and table.line in lines[piece]]
        if not pieces:
            known = {line for piece in lines if table.piece in (None, piece) for line in lines[piece]}
            of = "no piece has" if table.piece is None else f"piece {table.piece!r} has no"
            raise InputError(f"{where}: {of} a line {table.line!r}; {nearest(table.line, known)}".replace("no a", "no"))
        for piece in pieces:
            on_fold = folds.get(piece) == table.line
            if table.straight is not None and not on_fold:
                found.append(Straight(piece=piece, line=table.line, along=table.straight))
            if table.length_mm is not None:
                length = None if table.length_mm == "body" else 1e-3 * float(table.length_mm)
                found.append(FixedLength(piece=piece, line=table.line, length=length))
            if table.symmetric and on_fold:
                raise InputError(
                    f"{where}: piece {piece!r} is a half on the fold, its other half the mirror image anyway; leave "
                    "symmetric out, or set half = false"
                )
            if table.symmetric:
                found.append(Symmetric(piece=piece, line=table.line))
    return found
