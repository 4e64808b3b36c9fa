"""Linings and interfacings, derived from the pieces of the shell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core.errors import InputError
from warpflat.core.text import find_unused_name
from warpflat.garment.facings import INNER, centre_notch
from warpflat.garment.shaped_band import without_strip
from warpflat.pattern.piece_parts import Edge
from warpflat.pattern.pieces import Pattern, Piece, Seam, SeamSide

__all__ = ["add_interfacing", "add_lining"]

# The hem of a lining is turned up this much less [m] than the shell's, and at least the second: it ends above it.
_SHORTER, _LEAST_HEM = 0.020, 0.010


def add_interfacing(pattern: Pattern, cloth: str) -> Pattern:
    """Return a pattern whose facings and waistbands are cut from an interfacing too, by the same patterns.

    A facing that is grown on gets a piece of interfacing of its own, without allowances.
    """
    pieces = {}
    for size, row in pattern.pieces.items():
        doubled = [
            replace(piece, also={**piece.also, cloth: piece.quantity})
            if piece.role in ("facing", "waistband")
            else piece
            for piece in row
        ]
        grown = [_of_grown_facing(piece, cloth) for piece in row if _has_grown_facing(piece)]
        pieces[size] = (*doubled, *grown)
    return replace(pattern, pieces=pieces)


def _has_grown_facing(piece: Piece) -> bool:
    return any(edge.name == f"facing {INNER}" for edge in piece.edges)


def _of_grown_facing(piece: Piece, cloth: str) -> Piece:
    """Return the interfacing of a facing that is grown on a piece."""
    own = [edge for edge in piece.edges if edge.name.startswith("facing ")]
    fold = Edge(name="fold line", points=np.array([own[-1].points[-1], own[0].points[0]]))
    edges = [replace(edge, kind="cut", allowance=0.0, vertices=None) for edge in (*own, fold)]
    return Piece(
        name=f"{piece.name}_facing_interfacing", size=piece.size, fabric=cloth, quantity=piece.quantity, edges=edges,
        paired=piece.paired, role="interfacing",
    )  # fmt: skip


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
        linings = [_lining(by_name[name], faced[name], by_name, names[name], cloth) for name in shell]
        pieces[size] = (*(_sewn_inside(piece) if piece.role == "facing" else piece for piece in row), *linings)
    edges = {piece.name: {edge.name for edge in piece.edges} for piece in pieces[pattern.sample]}
    seams = list(pattern.seams)
    for seam in pattern.seams:
        sides = [tuple(_on_lining(side, names) for side in row) for row in seam.sides]
        known = all(side is not None and side.edge in edges[side.piece] for row in sides for side in row)
        if known:
            kept = tuple(tuple(side for side in row if side is not None) for row in sides)
            seams.append(replace(seam, name=f"{seam.name} of the lining", sides=(kept[0], kept[1]), notches=None))
    for name, own in faced.items():
        for each in own:
            first, second = (
                SeamSide(piece=each.facing, edge=INNER),
                SeamSide(piece=names[name], edge=_inner(each), reversed=True),
            )
            notches = centre_notch(pattern.piece(name, pattern.sample))
            seams.append(
                Seam(name=f"lining to {each.facing}".replace("_", " "), sides=((first,), (second,)), notches=notches)
            )
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
        own = [edge.name for edge in other.edges]
        covered = tuple(own[: own.index(INNER) - 1])
        before, after = names[names.index(covered[0]) - 1], names[(names.index(covered[-1]) + 1) % len(names)]
        found.append(_Faced(facing=other.name, edges=covered, before=before, after=after))
    return found


def _inner(faced: _Faced) -> str:
    """Return the name of the edge that takes the place of what a facing covers."""
    return f"{faced.edges[0]} {INNER}"


def _on_lining(side: SeamSide, names: Mapping[str, str]) -> SeamSide | None:
    return replace(side, piece=names[side.piece]) if side.piece in names else None


def _sewn_inside(facing: Piece) -> Piece:
    """Return a facing whose inner edge is a seam."""
    edges = [replace(edge, kind="seam", allowance=None) if edge.name == INNER else edge for edge in facing.edges]
    return replace(facing, edges=edges)


def _lining(piece: Piece, faced: Sequence[_Faced], pieces: Mapping[str, Piece], title: str, cloth: str) -> Piece:
    """Return the lining of a piece."""
    for each in faced:
        piece = without_strip(piece, pieces[each.facing].edges, _inner(each))
    edges = [
        replace(edge, allowance=max(edge.width - _SHORTER, _LEAST_HEM)) if edge.kind == "hem" else edge
        for edge in piece.edges
    ]
    return replace(
        piece, name=title, fabric=cloth, role="lining", edges=edges, marks={}, also={},
        internal_lines={k: line for k, line in piece.internal_lines.items() if "zip" not in k and "pocket" not in k},
    )  # fmt: skip
