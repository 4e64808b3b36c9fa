"""Linings and interfacings, derived from the pieces of the shell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpflat.core import InputError
from warpflat.garment.construction.edges import free_piece_name, in_sizes, new_piece, sewn, with_pieces
from warpflat.garment.construction.facings import INNER, centre_notch, sewn_inside
from warpflat.garment.construction.shaped_band import without_strip
from warpflat.pattern import Edge, Pattern, Piece, SeamSide

__all__ = ["add_interfacing", "add_lining", "add_pocketing"]

# The hem of a lining is turned up this much less [m] than the shell's, and at least the second: it ends above it.
_SHORTER, _LEAST_HEM = 0.020, 0.010


def add_interfacing(pattern: Pattern, cloth: str) -> Pattern:
    """Return a pattern whose facings, waistbands, flies, cuffs and collars are cut from an interfacing too, by the same patterns.

    A facing that is grown on gets a piece of interfacing of its own, without allowances.
    """
    made = list[Piece]()
    for piece in pattern:
        if piece.role in ("facing", "waistband", "cuff", "collar", "fly"):
            made.append(replace(piece, also={**piece.also, cloth: piece.quantity}))
        if _has_grown_facing(piece):
            facing = [edge for edge in piece.edges if edge.name.startswith("facing ")]
            fold = Edge(name="fold line", points=np.array([facing[-1].points[-1], facing[0].points[0]]))
            edges = [replace(edge, kind="cut", allowance=0.0, vertices=None) for edge in (*facing, fold)]
            same = {"fabric": cloth, "quantity": piece.quantity, "paired": piece.paired}
            made.append(new_piece(f"{piece.name}_facing_interfacing", piece, edges, "interfacing", **same))
    return with_pieces(pattern, made)


def add_pocketing(pattern: Pattern, cloth: str) -> Pattern:
    """Return a pattern whose pocket bags are cut from a cloth of their own: what of a pocket is seen neither outside nor at its opening."""
    seen = {side.piece for seam in pattern.seams for row in seam.sides if len(row) > 1 for side in row}

    def cut(piece: Piece) -> Piece:
        plain = not any(edge.kind == "hem" for edge in piece.edges) and "fold line" not in piece.internal_lines
        return replace(piece, fabric=cloth) if piece.role == "pocket" and plain and piece.name not in seen else piece

    return with_pieces(pattern, map(cut, pattern))


def _has_grown_facing(piece: Piece) -> bool:
    return any(edge.name == f"facing {INNER}" for edge in piece.edges)


def add_lining(pattern: Pattern, cloth: str) -> Pattern:
    """Return a pattern with a lining of the shell's pieces, sewn as they are, and to the inner edges of the facings.

    A lining leaves out what facings cover, and its hems end above the shell's.

    Args:
        pattern: with its facings.
        cloth: what the lining is called on its pieces.

    Raises:
        InputError: a piece has a facing grown on, or facings that meet.
    """
    shell = [piece.name for piece in pattern.pieces[pattern.sample] if piece.role == "shell"]
    names = {name: free_piece_name(pattern, f"{name}_lining") for name in shell}
    # By piece its facings, each with the edge that takes the place of what it covers.
    faced = dict[str, dict[str, str]]()
    for name in shell:
        if _has_grown_facing(pattern.piece(name, pattern.sample)):
            raise InputError(f'{name}: a facing that is grown on cannot be lined; give the buttons facing = "separate"')
        faced[name] = {}
        for seam in pattern.seams:
            sewn_on = pattern.piece(seam.sides[1][0].piece, pattern.sample)
            if seam.sides[0][0].piece == name and sewn_on.role == "facing":
                faced[name][sewn_on.name] = f"{sewn_on.edges[0].name} {INNER}"

    def lining(piece: Piece) -> Piece:
        name = names[piece.name]
        for facing, inner in faced[piece.name].items():
            piece = without_strip(piece, pattern.piece(facing, piece.size).edges, inner)
        hems = [
            replace(edge, allowance=max(edge.width - _SHORTER, _LEAST_HEM)) if edge.kind == "hem" else edge
            for edge in piece.edges
        ]
        kept = {k: line for k, line in piece.internal_lines.items() if "zip" not in k and "pocket" not in k}
        return replace(
            piece, name=name, fabric=cloth, role="lining", edges=hems, marks={}, also={}, internal_lines=kept
        )

    inside = [replace(piece, edges=sewn_inside(piece.edges)) for piece in pattern if piece.role == "facing"]
    whole = with_pieces(pattern, inside)
    whole = with_pieces(whole, [lining(piece) for name in shell for piece in in_sizes(pattern, name)])
    edges = {(piece.name, edge.name) for piece in whole.pieces[pattern.sample] for edge in piece.edges}
    seams = list(pattern.seams)
    for seam in pattern.seams:
        first, second = (tuple(replace(side, piece=names.get(side.piece, "")) for side in row) for row in seam.sides)
        if all(side.place in edges for side in (*first, *second)):
            seams.append(replace(seam, name=f"{seam.name} of the lining", sides=(first, second), notches=None))
    whole = replace(whole, seams=seams)
    for name, facings in faced.items():
        for facing, inner in facings.items():
            sides = SeamSide(piece=facing, edge=INNER), SeamSide(piece=names[name], edge=inner, reversed=True)
            notch = centre_notch(pattern.piece(name, pattern.sample))
            whole = sewn(whole, f"lining to {facing}", *sides, notches=notch)
    return whole
