"""Lengths of a finished garment, as a buyer asks for them: at the centre back, of sleeves and legs, and around its hems."""

from __future__ import annotations

from warpflat.core.polyline import polyline_length
from warpflat.core.text import without_side
from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.drafting.words import translate, translate_name

__all__ = ["finished_lengths"]

#: Lines along the body and what they measure; a garment has those that its pieces have.
_LINES = {
    "centre back": "length at the centre back",
    "overarm": "sleeve",
    "outseam": "outer leg, below the waistband",
    "inseam": "inner leg",
}


def finished_lengths(garment: DraftedGarment, size: str) -> dict[str, float]:
    """Return by what it is, in words, each length of the finished garment [m]; a cuff belongs to its sleeve.

    A length that ends at a band or a flounce is not told: they lengthen it.
    """
    pieces = [piece for piece in garment.pieces[size] if piece.piece.role == "shell"]
    legs = any(_called(seam.name) == "inseam" for seam in garment.seams)
    found: dict[str, float] = {}
    for line, words in _LINES.items():
        # Along pieces that lie below each other; left and right, and front and back of a leg or sleeve, are one length.
        lengths: dict[str, float] = {}
        ends = False
        for piece in pieces:
            stretches = [edge.line for edge in piece.edges if _called(edge.name) == line]
            stretches += [points for name, points in piece.internal_lines.items() if _called(name) == line]
            if stretches:
                sums = [polyline_length(points) for points in stretches]
                key = without_side(piece.name) if line == "centre back" else line
                lengths[key] = max(sum(sums) if line == "centre back" else max(sums), lengths.get(key, 0.0))
                ends = ends or any(edge.kind == "hem" for edge in piece.edges) or line == "overarm"
        for seam in garment.seams:
            if seam.size == size and _called(seam.name) == line != "centre back":
                lengths[line] = max(1e-3 * max(seam.length_mm), lengths.get(line, 0.0))
        if lengths and (ends or line in ("outseam", "inseam")) and not (legs and line == "centre back"):
            found[translate(words)] = sum(lengths.values())
    cuffs = [piece for piece in garment.pieces[size] if piece.piece.role == "cuff"]
    sleeve = translate("sleeve")
    if cuffs and sleeve in found:
        found[sleeve] += 0.5 * cuffs[0].edge("left end").length
    elif sleeve in found and not any(
        edge.kind == "hem" and "overarm" in _lines_of(piece) for piece in pieces for edge in piece.edges
    ):
        del found[sleeve]
    hems: dict[str, float] = {}
    for piece in pieces:
        count = piece.piece.quantity * (2 if piece.piece.on_fold else 1)
        for edge in piece.edges:
            name = _called(edge.name)
            if edge.kind == "hem" and not set(name.split(" ")) & {"facing", "vent", "slit", "edge"}:
                # Around one sleeve or leg where there are two.
                both = 2 if without_side(edge.name) != edge.name and count > 1 else 1
                hems[name] = hems.get(name, 0.0) + edge.length * count / both
    for name, hem in hems.items():
        # A flounce's hem is called nothing else.
        called = translate_name(name)
        found[called if name == "hem" else translate("hem at the {name}", name=called)] = hem
    return found


def _called(name: str) -> str:
    return without_side(name).rstrip(" 0123456789")


def _lines_of(piece: DraftedPiece) -> set[str]:
    return {_called(name) for name in (*piece.internal_lines, *(edge.name for edge in piece.edges))}
