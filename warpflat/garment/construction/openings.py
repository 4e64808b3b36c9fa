"""Openings along the lines of a form, from their upper or lower end: zips, buttons, wraps, slits, vents, godets and keyholes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import (
    FloatArray,
    InputError,
    IntArray,
    arc_lengths,
    nearest,
    other_side,
    without_side,
)
from warpflat.garment.construction.details import FinishingTable, OpeningTable
from warpflat.garment.construction.rings import find_rings
from warpflat.garment.mannequin.bricks import select_bricks
from warpflat.garment.mannequin.forms import Form, PieceRecipe
from warpflat.garment.mannequin.halves import is_side
from warpflat.garment.mannequin.layout import RING_LEVELS
from warpflat.garment.mannequin.part_pieces import part_labels, part_recipe
from warpflat.pattern import EdgeRules

if TYPE_CHECKING:
    from warpflat.garment.mannequin.forms import FormResult
    from warpflat.garment.mannequin.layout import Layout
    from warpflat.garment.mannequin.mannequin import Mannequin

__all__ = [
    "CENTRES",
    "OpeningPart",
    "one_sided",
    "opened_rings",
    "part_at_centres",
    "place_opening",
    "sewn_centres",
    "sized_opening",
]

#: The lines at which a piece may be cut in halves.
CENTRES = ("centre front", "centre back")


@dataclass(frozen=True, kw_only=True, eq=False)
class OpeningPart:
    """A part of an opening in one seam of the form.

    Attributes:
        seam: the name of the seam, or of the fold where halves are sewn.
        piece: on its first side.
        vertices: of the piece, from the end at which the opening is measured.
        before: length of the line before this seam [m].
        whole: length of the seam in the pattern [m].
    """

    seam: str
    piece: str
    vertices: IntArray
    before: float
    whole: float


def part_at_centres(layout: Layout, form: Form, openings: Sequence[OpeningTable]) -> Form:
    """Return a form whose pieces are parted along the centre lines that have openings; a piece "back" becomes two.

    One that goes all around, so that its halves are joined elsewhere, is opened along the line and stays one; where it buttons or
    wraps, each half runs beyond the line, and it becomes two.
    """
    pieces = dict(form.pieces)
    overlapping = {opening.seam for opening in openings if opening.kind in ("buttons", "wrap")}
    for line in dict.fromkeys(opening.seam for opening in openings if opening.seam in CENTRES and opening.parts_pieces):
        parted: dict[str, PieceRecipe] = {}
        for name, recipe in pieces.items():
            bricks = select_bricks(layout, recipe.bricks)
            sides = {side: [b for b in bricks if is_side(b, side)] for side in ("left", "right")}
            on_line = np.isin(layout.faces[layout.faces_of(bricks)], layout.lines[line]).sum() > 1
            if not (all(sides.values()) and on_line) or line in recipe.open:
                parted[name] = recipe
            elif line in overlapping or len(set(part_labels(layout, bricks, [line, *recipe.open]).tolist())) > 1:
                for side, half in sides.items():
                    parted[f"{name}_{side}"] = part_recipe(layout, recipe, half, [line])
            else:
                parted[name] = replace(recipe, open=(*recipe.open, line))
        pieces = parted
    return replace(form, pieces=pieces)


def sewn_centres(rules: EdgeRules, openings: Sequence[OpeningTable]) -> EdgeRules:
    """Return rules by which a half piece has a seam instead of the fold at the centre lines that have openings."""
    lines = {opening.seam: "seam" for opening in openings if opening.seam in CENTRES and opening.parts_pieces}
    return replace(rules, kinds={**lines, **rules.kinds})


def place_opening(form: FormResult, opening: OpeningTable, positions: Mapping[str, FloatArray]) -> list[OpeningPart]:
    """Return the seams along an opening's line, from the end at which it is measured.

    Args:
        form: the pieces.
        opening: along one of its seams.
        positions: by piece, #V by 2, or by 3 before the pieces are flattened [m].

    Raises:
        InputError: there is no such seam, it is shorter than the opening, or the opening lies in several pieces side by
            side.
    """
    found: list[tuple[str, str, IntArray]] = []
    for seam in form.seams:
        if seam.edges[0] == opening.seam or seam.name == opening.seam:
            found.append((seam.name, seam.pieces[0], np.concatenate([run.vertices[0] for run in seam.runs])))
    for name, piece in form.pieces.items():
        if piece.fold == opening.seam:
            found.append((opening.seam, name, np.asarray(piece.edges[opening.seam])))
        elif not opening.parts_pieces and opening.seam in piece.surface.lines:
            found.append((opening.seam, name, np.asarray(piece.surface.lines[opening.seam])))
    if opening.kind == "keyhole":
        found = found[:1]
    if not found:
        folds = {piece.fold for piece in form.pieces.values() if piece.fold}
        raise InputError(f"no seam {opening.seam!r}; {nearest(opening.seam, {s.name for s in form.seams} | folds)}")
    sign = 1.0 if opening.from_below else -1.0
    rows = []
    for seam_name, piece_name, ids in found:
        height = sign * form.pieces[piece_name].surface.vertices[ids, 1]
        rows.append((float(height.min()), seam_name, piece_name, ids if height[0] <= height[-1] else ids[::-1]))
    parts, before = list[OpeningPart](), 0.0
    for _, seam_name, piece_name, ids in sorted(rows, key=lambda row: row[0]):
        whole = float(arc_lengths(positions[piece_name][ids])[-1])
        parts.append(OpeningPart(seam=seam_name, piece=piece_name, vertices=ids, before=before, whole=whole))
        before += whole
    end = opening.start + opening.length
    if math.isfinite(end) and end > before:
        raise InputError(f"ends {1e3 * end:.0f} mm along {opening.seam!r}, which is {1e3 * before:.0f} mm long")
    return parts


def sized_opening(form: FormResult, opening: OpeningTable, positions: Mapping[str, FloatArray]) -> OpeningTable:
    """Return an opening whose share of its line has become a length, in whole centimetres; see :func:`place_opening`."""
    whole = sum(part.whole for part in place_opening(form, opening, positions))
    if opening.length_share is None:
        return opening
    end = opening.length_share * whole
    length = math.floor(100.0 * (end - opening.start))
    if length <= 0:
        raise InputError(
            f"length_share = {opening.length_share:g} ends {1e3 * end:.0f} mm along {opening.seam!r}, "
            f"and start_mm begins at {1e3 * opening.start:.0f}"
        )
    return opening.model_copy(update={"length_mm": 10.0 * length, "length_share": None})


def one_sided(openings: Sequence[OpeningTable]) -> list[OpeningTable]:
    """Return the openings for which pieces of one side of the body are cut unlike their mirror images.

    A zip is none: it is sewn into edges that are cut alike with and without it.
    """
    cut = [opening for opening in openings if opening.kind != "zip" and without_side(opening.seam) != opening.seam]
    return [opening for opening in cut if opening.model_copy(update={"seam": other_side(opening.seam)}) not in cut]


def opened_rings(
    mannequin: Mannequin,
    form: FormResult,
    positions: Mapping[str, FloatArray],
    openings: Sequence[OpeningTable],
    finishing: Sequence[FinishingTable],
) -> dict[str, float]:
    """Return by ring how much longer openings, and plackets below collars, make it [m].

    The way around goes along an opening to its end and back: twice the distance to the nearer end that is closed.
    """
    rings = {name: set(ring.tolist()) for name, (ring, _) in find_rings(mannequin, form, positions).items()}
    edges = set().union(*rings.values())
    levels = {level: set(mannequin.layout.lines[level].tolist()) for level in RING_LEVELS}
    found: dict[str, float] = {}
    for opening in openings:
        parts, passed = place_opening(form, opening, positions), dict[str, float]()
        whole = sum(part.whole for part in parts)
        begin, end = opening.start, min(opening.start + opening.length, whole)
        first = int(form.pieces[parts[0].piece].grid_vertices[parts[0].vertices[0]])
        # Where the opening runs out into an edge, that end is open.
        runs_out = begin == 0.0 and first in edges
        if runs_out and end == whole:
            # Open from edge to edge, as a coat: twice its length is more than any ring needs.
            end *= 2.0
        for part in parts:
            grid = form.pieces[part.piece].grid_vertices[part.vertices]
            places = part.before + arc_lengths(positions[part.piece][part.vertices])
            for vertex, place in zip(grid.tolist(), places.tolist(), strict=True):
                depth = max(0.0, end - place if runs_out else min(place - begin, end - place))
                for name in (name for name, row in (*levels.items(), *rings.items()) if vertex in row):
                    passed[name] = max(passed.get(name, 0.0), 2.0 * depth)
        for name, more in passed.items():
            found[name] = found.get(name, 0.0) + more
    for wish in finishing:
        if wish.kind == "collar" and wish.placket:
            found[wish.edge] = found.get(wish.edge, 0.0) + 2.0 * wish.placket
    return found
