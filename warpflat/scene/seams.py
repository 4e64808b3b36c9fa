"""The tables `seams` and `constraints` of a scene, as wishes and constraints on named pieces and lines."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from warpflat.core.errors import InputError, nearest
from warpflat.garment.constraints import Constraint, FixedLength, Straight, Symmetric
from warpflat.garment.ease import SeamWish
from warpflat.scene.schema import ConstraintTable, SeamTable
from warpflat.surface.border_seams import NamedSeam

__all__ = ["scene_constraints", "scene_surface_seams", "scene_wishes"]


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


def scene_surface_seams(tables: Sequence[SeamTable], piece: str) -> list[NamedSeam]:
    """The seams that a scene names on its surface.

    Args:
        tables: of the scene, each with its sides.
        piece: name of the surface; lines may be named "piece.line".

    Raises:
        InputError: a name occurs twice, both sides are one line, or `longer` is neither of them.
    """
    seams: list[NamedSeam] = []
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
        seams.append(
            NamedSeam(
                name=table.name,
                sides=(first, second),
                factor=table.gather if table.gather is not None else 1.0 + (table.ease or 0.0),
                gathered=table.gather is not None,
                longer=(first, second).index(longer),
            )
        )
    return seams


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
