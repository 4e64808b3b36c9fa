"""Openings along the lines of a form, from their upper or lower end: zips, buttons, wraps, slits, vents, godets and keyholes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, InputError, IntArray, arc_lengths, nearest, other_side, without_side
from warpflat.garment.construction.rings import find_rings, ring_line
from warpflat.garment.mannequin.bricks import select_bricks
from warpflat.garment.mannequin.forms import Form, PieceRecipe
from warpflat.garment.mannequin.halves import is_side
from warpflat.garment.mannequin.layout import RING_LEVELS

if TYPE_CHECKING:
    from warpflat.garment.mannequin.forms import FormResult
    from warpflat.garment.mannequin.layout import Layout
    from warpflat.garment.mannequin.mannequin import Mannequin

__all__ = [
    "CENTRES",
    "Buttons",
    "Opening",
    "OpeningPart",
    "one_sided",
    "opened_rings",
    "part_at_centres",
    "place_opening",
    "sized_opening",
]

CENTRES = ("centre front", "centre back")


@dataclass(frozen=True, kw_only=True)
class Buttons:
    """The buttons of a stand, and its facing.

    Attributes:
        diameter: of a button [m].
        spacing: about how far apart they are [m]; one lies on the bust line, where a front gapes first.
        count: how many; None as many as the spacing gives.
        facing: "grown-on" (the stand is folded) or "separate" (a piece of its own).
        facing_width: from the edge of the stand [m].
    """

    diameter: float = 0.018
    spacing: float = 0.085
    count: int | None = None
    facing: str = "grown-on"
    facing_width: float = 0.06


@dataclass(frozen=True, kw_only=True)
class Opening:
    """A stretch of a seam that can be opened, or is never closed.

    Attributes:
        kind: "zip", "buttons", "wrap" or "keyhole" from the upper end of the line; "slit", "vent" or "godet" from its lower end.
        line: of the seam, as "centre back" or "side left"; pieces that run across a centre line are parted there, except
            by a keyhole, which is cut into the piece.
        length: [m]; infinite for a wrap, and for buttons or a zip all along the line.
        share: of its line, in place of the length; 0 if that is given.
        start: how far from that end it begins [m].
        style: of a zip, "invisible" or "lapped".
        width: of a vent's flap, of the button stand or the wrap beyond its line, of a godet's hem, or of a keyhole's round end [m].
        buttons: of a button stand.
        tie: length of the ties of a wrap [m]; 0 for none.
    """

    kind: str
    line: str
    length: float
    share: float = 0.0
    start: float = 0.0
    style: str = "invisible"
    width: float = 0.04
    buttons: Buttons | None = None
    tie: float = 0.0

    @property
    def from_below(self) -> bool:
        """Whether it is measured from the lower end of its line."""
        return self.kind in ("slit", "vent", "godet")

    @property
    def parts_pieces(self) -> bool:
        """Whether pieces that run across its line are parted there."""
        return self.kind != "keyhole"

    @property
    def opens_the_top(self) -> bool:
        """Whether it runs out into the upper edge."""
        return not self.from_below and self.start == 0.0

    @property
    def title(self) -> str:
        """Return what is written on the pieces."""
        words = f"{self.style} zip" if self.kind == "zip" else self.kind
        return f"{words} {1e3 * self.length:.0f} mm"


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


def part_at_centres(layout: Layout, form: Form, openings: Sequence[Opening]) -> Form:
    """Return a form whose pieces are parted along the centre lines that have openings; a piece "back" becomes two."""
    pieces = dict(form.pieces)
    for line in dict.fromkeys(opening.line for opening in openings if opening.line in CENTRES and opening.parts_pieces):
        parted: dict[str, PieceRecipe] = {}
        for name, recipe in pieces.items():
            bricks = select_bricks(layout, recipe.bricks)
            sides = {side: tuple(b for b in bricks if is_side(b, side)) for side in ("left", "right")}
            on_line = np.isin(layout.faces[layout.faces_of(bricks)], layout.lines[line]).sum() > 1
            if all(sides.values()) and on_line and line not in recipe.open:
                for side, half in sides.items():
                    parted[f"{name}_{side}"] = replace(recipe, bricks=half)
            else:
                parted[name] = recipe
        pieces = parted
    return replace(form, pieces=pieces)


def place_opening(form: FormResult, opening: Opening, positions: Mapping[str, FloatArray]) -> list[OpeningPart]:
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
        if seam.edges[0] == opening.line or seam.name == opening.line:
            found.append((seam.name, seam.pieces[0], np.concatenate([run.vertices[0] for run in seam.runs])))
    for name, piece in form.pieces.items():
        if piece.fold == opening.line:
            found.append((opening.line, name, np.asarray(piece.edges[opening.line])))
        elif not opening.parts_pieces and opening.line in piece.surface.lines:
            found.append((opening.line, name, np.asarray(piece.surface.lines[opening.line])))
    if opening.kind == "keyhole":
        found = found[:1]
    if not found:
        folds = {piece.fold for piece in form.pieces.values() if piece.fold}
        raise InputError(f"no seam {opening.line!r}; {nearest(opening.line, {s.name for s in form.seams} | folds)}")
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
        raise InputError(f"ends {1e3 * end:.0f} mm along {opening.line!r}, which is {1e3 * before:.0f} mm long")
    return parts


def sized_opening(form: FormResult, opening: Opening, positions: Mapping[str, FloatArray]) -> Opening:
    """Return an opening whose share of its line has become a length, in whole centimetres; see :func:`place_opening`."""
    whole = sum(part.whole for part in place_opening(form, opening, positions))
    if not opening.share:
        return opening
    length = 0.01 * math.floor(100.0 * (opening.share * whole - opening.start))
    if length <= 0.0:
        raise InputError(
            f"length_share = {opening.share:g} ends {1e3 * opening.share * whole:.0f} mm along {opening.line!r}, "
            f"and start_mm begins at {1e3 * opening.start:.0f}"
        )
    return replace(opening, length=length, share=0.0)


def one_sided(openings: Sequence[Opening]) -> list[Opening]:
    """Return the openings for which pieces of one side of the body are cut unlike their mirror images.

    A zip is none: it is sewn into edges that are cut alike with and without it.
    """
    cut = [opening for opening in openings if opening.kind != "zip" and without_side(opening.line) != opening.line]
    return [opening for opening in cut if replace(opening, line=other_side(opening.line)) not in cut]


def opened_rings(
    mannequin: Mannequin, form: FormResult, positions: Mapping[str, FloatArray], openings: Sequence[Opening]
) -> dict[str, float]:
    """Return by ring how much longer openings make it [m].

    The way around goes along an opening to its end and back: twice the distance to the nearer end that is closed.
    """
    rings = {ring_line(mannequin, ring): set(ring.tolist()) for ring, _ in find_rings(mannequin, form, positions)}
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
    return found
