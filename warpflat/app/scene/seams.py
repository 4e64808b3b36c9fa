"""The tables `seams` and `constraints` of a scene, as seams and constraints on named pieces and lines."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from warpflat.app.scene.schema import ConstraintTable
from warpflat.core import InputError, nearest
from warpflat.garment import Constraint, FixedLength, SeamTable, Straight, Symmetric

__all__ = ["scene_constraints", "scene_surface_seams"]


def scene_surface_seams(tables: Sequence[SeamTable], piece: str) -> list[SeamTable]:
    """Return the seams that a scene names on its surface, checked, with its lines by their names on the piece.

    Args:
        tables: of the scene, each with its sides.
        piece: name of the surface; lines may be named "piece.line".

    Raises:
        InputError: a name occurs twice, both sides are one line, or `longer` is neither of them.
    """
    seams: list[SeamTable] = []
    for number, table in enumerate(tables):
        where = f"seams[{number}]"
        first, second = (side.removeprefix(f"{piece}.") for side in table.sides or ["", ""])
        if table.name in {seam.name for seam in seams}:
            raise InputError(f"{where}: seam {table.name!r} is named twice; names are unique")
        if first == second:
            raise InputError(f"{where}: both sides are {first!r}; a side is sewn to another one")
        longer = second if table.longer is None else table.longer.removeprefix(f"{piece}.")
        if longer not in (first, second):
            raise InputError(f"{where}: longer is {longer!r}, not one of its sides; {nearest(longer, (first, second))}")
        seams.append(table.model_copy(update={"sides": [first, second], "longer": longer}))
    return seams


def scene_constraints(
    tables: Sequence[ConstraintTable],
    lines: Mapping[str, Collection[str]],
    folds: Mapping[str, str] | None = None,
) -> list[Constraint]:
    """Return the constraints that a scene puts on borders and lines, for every piece that has the line.

    A fold is straight and upright anyway, so that `straight` is left out there.

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
        asked = [piece for piece in lines if table.piece in (None, piece)]
        pieces = [piece for piece in asked if table.line in lines[piece]]
        if not pieces:
            known = {line for piece in asked for line in lines[piece]}
            what = "no piece has a line" if table.piece is None else f"piece {table.piece!r} has no line"
            raise InputError(f"{where}: {what} {table.line!r}; {nearest(table.line, known)}")
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
