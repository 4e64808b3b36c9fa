"""Lengths of a finished garment, as a buyer asks for them: at the centre back, of sleeves and legs, and around its hems."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from warpflat.core import FloatArray, polyline_length, unit, without_side
from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.drafting.names import line_name
from warpflat.pattern.drafting.sewing_tasks import is_flounce
from warpflat.pattern.drafting.shrinkage import as_worn
from warpflat.pattern.drafting.words import translate, translate_name

__all__ = ["finished_lengths"]

# What is sewn on so near to the end of a line lengthens it [m].
_AT_END = 0.02
#: Lines along the body and what they measure; a garment has those that its pieces have.
_LINES = {
    "centre back": "length at the centre back",
    "overarm": "sleeve",
    "outseam": "outer leg",
    "inseam": "inner leg",
}


def finished_lengths(garment: DraftedGarment, size: str) -> dict[str, float]:
    """Return by what it is, in words, each length of the finished garment [m].

    What is sewn to its end belongs to it: a cuff, a band, a flounce. What of two fronts lies over each other counts once around a hem.
    """
    drafted = {piece.name: as_worn(piece) for piece in garment.pieces[size]}
    pieces = [piece for piece in drafted.values() if piece.piece.role == "shell" and not is_flounce(piece.piece)]
    legs = any(line_name(seam.name) == "inseam" for seam in garment.seams)
    banded = has_waistband = any(piece.piece.role == "waistband" for piece in drafted.values())
    found: dict[str, float] = {}
    for line, words in _LINES.items():
        # Along pieces that lie below each other; left and right, and front and back of a leg or sleeve, are one length.
        lengths: dict[str, float] = {}
        ends, beside = False, set[str]()
        for piece in pieces:
            parts = (line, *(f"{line} {opened}" for opened in ("vent", "slit", "godet")))
            stretches = [edge.line for edge in piece.edges if line_name(edge.name) in parts]
            within = [(line_name(name), points) for name, points in piece.internal_lines.items()]
            # Inside a piece the line of a leg is another one above the hip.
            above = [points[::-1] for name, points in within if line == "outseam" and name == "side"]
            stretches += [np.concatenate([*above, points]) for name, points in within if name == line]
            if stretches:
                beside.update(line_name(edge.name) for edge in piece.edges)
                sums = [polyline_length(points) for points in stretches]
                key = without_side(piece.name) if line == "centre back" else line
                length = sum(sums) if line == "centre back" else max(sums)
                points = np.concatenate(stretches)
                more = _band_at(garment, drafted, piece, points[points[:, 1].argmin()]) or 0.0
                banded = banded or _band_at(garment, drafted, piece, points[points[:, 1].argmax()]) is not None
                lengths[key] = max(length + more, lengths.get(key, 0.0))
                ends = ends or more > 0.0 or any(edge.kind == "hem" for edge in piece.edges)
        for seam in garment.seams:
            if seam.size == size and line_name(seam.name) == line != "centre back":
                lengths[line] = max(1e-3 * max(seam.length_mm), lengths.get(line, 0.0))
        if line == "inseam" and "thigh" in beside:
            # It ends where legs begin.
            continue
        if line == "outseam" and "armhole" in beside:
            words = "side, below the armhole"
        elif line == "outseam" and banded:
            words = "outer leg, below the waistband"
        elif line == "centre back" and has_waistband:
            words = "length at the centre back, below the waistband"
        if lengths and (ends or line in ("outseam", "inseam")) and not (legs and line == "centre back"):
            found[translate(words)] = sum(lengths.values())
    hems: dict[str, float] = {}
    for piece in (piece for piece in drafted.values() if piece.piece.role == "shell"):
        count = piece.piece.quantity * (2 if piece.piece.on_fold else 1)
        for edge in piece.edges:
            name = line_name(edge.name)
            if edge.kind == "hem" and not set(name.split(" ")) & {"facing", "vent", "slit", "edge"}:
                # Around one sleeve or leg where there are two.
                both = 2 if without_side(edge.name) != edge.name and count > 1 else 1
                hems[name] = hems.get(name, 0.0) + (edge.length - _laps(piece, edge.line)) * count / both
    for name, hem in hems.items():
        # A flounce's hem is called nothing else.
        called = translate_name(name)
        found[called if name == "hem" else translate("hem at the {name}", name=called)] = hem
    return found


def _band_at(
    garment: DraftedGarment, drafted: Mapping[str, DraftedPiece], piece: DraftedPiece, end: FloatArray
) -> float | None:
    """Return the width [m] of a cuff, a band or a flounce that is sewn to a piece at one of its points; None if there is none."""
    import shapely

    for seam in garment.pattern.seams:
        for own, other in (seam.sides, seam.sides[::-1]):
            band = drafted[other[0].piece].piece
            if band.role not in ("strip", "cuff", "waistband") and not is_flounce(band):
                continue
            edges = [piece.edge(side.edge) for side in own if side.piece == piece.name]
            if any(shapely.LineString(edge.line).distance(shapely.Point(end)) < _AT_END for edge in edges):
                sewn = band.edge(other[0].edge).points
                far = [points for name, points in band.internal_lines.items() if name.startswith("fold line")]
                far += [edge.points for edge in band.edges if edge.kind == "hem"]
                return float(shapely.LineString(sewn).distance(shapely.LineString(far[0]))) if far else 0.0
    return None


def _laps(piece: DraftedPiece, hem: FloatArray) -> float:
    """Return what of a hem (#P by 2 [m]) of one half of a front lies beyond its centre line, over or under the other half [m]."""
    import shapely.ops

    centre = [line for name, line in piece.internal_lines.items() if line_name(name) == "centre front"]
    if len(centre) != 1 or not piece.piece.is_pair:
        return 0.0
    way = unit(centre[0][-1] - centre[0][0])
    parts = shapely.ops.split(shapely.LineString(hem), shapely.LineString([centre[0][0] - way, centre[0][-1] + way]))
    # The narrower part lies beyond it.
    return float(min(part.length for part in parts.geoms)) if len(parts.geoms) == 2 else 0.0
