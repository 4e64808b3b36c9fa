"""Linings and interfacings, derived from the pieces of the shell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core import InputError, find_unused_name
from warpflat.garment.construction.facings import INNER, centre_notch
from warpflat.garment.construction.shaped_band import without_strip
from warpflat.pattern import Edge, Pattern, Piece, Seam, SeamSide

__all__ = ["add_interfacing", "add_lining", "add_pocketing"]

# The hem of a lining is turned up this much less [m] than the shell's, and at least the second: it ends above it.
_SHORTER, _LEAST_HEM = 0.020, 0.010


def add_interfacing(pattern: Pattern, cloth: str) -> Pattern:
    """Return a pattern whose facings, waistbands, flies, cuffs and collars are cut from an interfacing too, by the same patterns.

    A facing that is grown on gets a piece of interfacing of its own, without allowances.
    """
    pieces: dict[str, Sequence[Piece]] = {}
    for size, row in pattern.pieces.items():
        doubled = [
            replace(piece, also={**piece.also, cloth: piece.quantity})
            if piece.role in ("facing", "waistband", "cuff", "collar", "fly")
            else piece
            for piece in row
        ]
        for piece in row:
            if _has_grown_facing(piece):
                facing = [edge for edge in piece.edges if edge.name.startswith("facing ")]
                fold = Edge(name="fold line", points=np.array([facing[-1].points[-1], facing[0].points[0]]))
                edges = [replace(edge, kind="cut", allowance=0.0, vertices=None) for edge in (*facing, fold)]
                doubled.append(
                    Piece(
                        name=f"{piece.name}_facing_interfacing", size=piece.size, fabric=cloth,
                        quantity=piece.quantity, edges=edges, paired=piece.paired, role="interfacing",
                    )
                )  # fmt: skip
        pieces[size] = doubled
    return replace(pattern, pieces=pieces)


def add_pocketing(pattern: Pattern, cloth: str) -> Pattern:
    """Return a pattern whose pocket bags are cut from a cloth of their own: what of a pocket is seen neither outside nor at its opening."""
    seen = {side.piece for seam in pattern.seams for row in seam.sides if len(row) > 1 for side in row}

    def cut(piece: Piece) -> Piece:
        plain = not any(edge.kind == "hem" for edge in piece.edges) and "fold line" not in piece.internal_lines
        return replace(piece, fabric=cloth) if piece.role == "pocket" and plain and piece.name not in seen else piece

    return replace(pattern, pieces={size: [cut(piece) for piece in row] for size, row in pattern.pieces.items()})


def _has_grown_facing(piece: Piece) -> bool:
    return any(edge.name == f"facing {INNER}" for edge in piece.edges)


@dataclass(frozen=True, kw_only=True)
class _Faced:
    """A facing of a piece.

    Attributes:
        facing: its name.
        edges: of the piece that it covers.
        before, after: edges of the piece that it shortens.
    """

    facing: str
    edges: tuple[str, ...]
    before: str
    after: str


def add_lining(pattern: Pattern, cloth: str) -> Pattern:
    """Return a pattern with a lining of the shell's pieces, sewn as they are, and to the inner edges of the facings.

    A lining leaves out what facings cover, and its hems end above the shell's.

    Args:
        pattern: with its facings.
        cloth: what the lining is called on its pieces.

    Raises:
        InputError: a piece has a facing grown on, or facings that meet.
    """
    sample = pattern.pieces[pattern.sample]
    shell = [piece.name for piece in sample if piece.role == "shell"]
    faced = {name: _facings_of(pattern, name) for name in shell}
    taken = {piece.name for piece in sample}
    names = {name: find_unused_name(f"{name}_lining", taken) for name in shell}
    pieces: dict[str, Sequence[Piece]] = {}
    for size, row in pattern.pieces.items():
        by_name = {piece.name: piece for piece in row}
        lined = list[Piece]()
        for piece in row:
            if piece.role == "facing":
                # Its inner edge is a seam now.
                outline = [
                    replace(each, kind="seam", allowance=None) if each.name == INNER else each for each in piece.edges
                ]
                piece = replace(piece, edges=outline)
            lined.append(piece)
        for name in shell:
            piece = by_name[name]
            for facing in faced[name]:
                piece = without_strip(piece, by_name[facing.facing].edges, _inner(facing))
            hems = [
                replace(edge, allowance=max(edge.width - _SHORTER, _LEAST_HEM)) if edge.kind == "hem" else edge
                for edge in piece.edges
            ]
            kept = {k: line for k, line in piece.internal_lines.items() if "zip" not in k and "pocket" not in k}
            lined.append(
                replace(
                    piece,
                    name=names[name],
                    fabric=cloth,
                    role="lining",
                    edges=hems,
                    marks={},
                    also={},
                    internal_lines=kept,
                )
            )
        pieces[size] = lined
    edges = {piece.name: {edge.name for edge in piece.edges} for piece in pieces[pattern.sample]}
    seams = list(pattern.seams)
    for seam in pattern.seams:
        if all(side.edge in edges.get(names.get(side.piece, ""), ()) for row in seam.sides for side in row):
            first, second = (tuple(replace(side, piece=names[side.piece]) for side in row) for row in seam.sides)
            seams.append(replace(seam, name=f"{seam.name} of the lining", sides=(first, second), notches=None))
    for name, facings in faced.items():
        for each in facings:
            notches = centre_notch(pattern.piece(name, pattern.sample))
            inner = SeamSide(piece=each.facing, edge=INNER)
            lining = SeamSide(piece=names[name], edge=_inner(each), reversed=True)
            words = f"lining to {each.facing}".replace("_", " ")
            seams.append(Seam(name=words, sides=((inner,), (lining,)), notches=notches))
    return replace(pattern, pieces=pieces, seams=seams)


def _facings_of(pattern: Pattern, name: str) -> list[_Faced]:
    """Return the facings of a piece.

    Raises:
        InputError: one is grown on.
    """
    piece = pattern.piece(name, pattern.sample)
    if _has_grown_facing(piece):
        raise InputError(f'{name}: a facing that is grown on cannot be lined; give the buttons facing = "separate"')
    found: list[_Faced] = []
    names = [edge.name for edge in piece.edges]
    for seam in pattern.seams:
        first, second = seam.sides[0][0], seam.sides[1][0]
        other = pattern.piece(second.piece, pattern.sample)
        if first.piece != name or other.role != "facing" or any(each.facing == other.name for each in found):
            continue
        outline = [edge.name for edge in other.edges]
        covered = tuple(outline[: outline.index(INNER) - 1])
        before, after = names[names.index(covered[0]) - 1], names[(names.index(covered[-1]) + 1) % len(names)]
        found.append(_Faced(facing=other.name, edges=covered, before=before, after=after))
    return found


def _inner(faced: _Faced) -> str:
    """Return the name of the edge that takes the place of what a facing covers."""
    return f"{faced.edges[0]} {INNER}"
