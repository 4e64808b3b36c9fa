"""The tables `openings` and `finishing` of a scene, as openings along seams and finishing of free edges."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from warpflat.app.scene.schema import FinishingTable, PocketTable, SceneTable
from warpflat.garment import CENTRES, COLLARS, FINISHES, Buttons, Collar, Finishing, Opening, Pocket
from warpflat.pattern import EdgeRules

if TYPE_CHECKING:
    from warpflat.garment import Constraint, FormResult

__all__ = ["scene_finishing", "scene_openings", "scene_pockets", "sewn_centres", "straight_stands"]

# Allowance of a slit, flap of a vent, button stand or wrap beyond its line, round end of a keyhole, hem of a godet [mm], if not given.
_WIDTH_MM = {"zip": 0.0, "slit": 15.0, "vent": 40.0, "buttons": 20.0, "keyhole": 12.0, "wrap": 120.0, "godet": 250.0}


def scene_openings(settings: SceneTable) -> list[Opening]:
    """Return the openings that a scene wants."""
    lined = settings.cloth is not None and settings.cloth.lining != ""
    return [
        Opening(
            kind=table.kind,
            line=table.seam,
            length=math.inf if table.length_mm is None else 1e-3 * table.length_mm,
            share=table.length_share or 0.0,
            start=1e-3 * table.start_mm,
            style=table.style,
            width=1e-3 * (_WIDTH_MM[table.kind] if table.width_mm is None else table.width_mm),
            buttons=Buttons(
                diameter=1e-3 * table.button_mm,
                spacing=1e-3 * table.spacing_mm,
                count=table.count,
                facing=table.facing or ("separate" if lined else "grown-on"),
                facing_width=1e-3 * table.facing_mm,
            )
            if table.kind == "buttons"
            else None,
            tie=1e-3 * table.tie_mm if table.kind == "wrap" else 0.0,
        )
        for table in settings.openings
    ]


def straight_stands(form: FormResult, openings: Sequence[Opening]) -> list[Constraint]:
    """Return the constraints that lay the edges of button stands and wraps straight along the grain; a fold is so anyway."""
    from warpflat.garment import Straight

    return [
        Straight(piece=name, line=opening.line, along="warp")
        for opening in openings
        if opening.kind in ("buttons", "wrap")
        for name, piece in form.pieces.items()
        if opening.line in piece.edges and piece.fold != opening.line
    ]


def scene_finishing(tables: Sequence[FinishingTable]) -> list[Finishing]:
    """Return the finishing that a scene wants."""
    found = []
    for table in tables:
        usual = COLLARS[table.style] if table.kind == "collar" else FINISHES[table.kind]
        width = usual if table.width_mm is None else 1e-3 * table.width_mm
        collar = None
        if table.kind in ("collar", "hood"):
            style = table.style if table.kind == "collar" else ""
            collar = Collar(style=style, width=width, **table.metres("rise", "fall", "point", "strip"))
        found.append(
            Finishing(
                kind=table.kind,
                edge=table.edge,
                # A turtleneck is turned down upon itself.
                width=2.0 * width if table.style == "turtleneck" else width,
                share=table.share,
                **table.metres("overlap", "placket", "pleat"),
                shaped=table.shaped,
                shorten={line: 1e-3 * mm for line, mm in table.shorten_mm.items()}
                if isinstance(table.shorten_mm, dict)
                else 1e-3 * table.shorten_mm,
                elastic=table.elastic,
                turns=table.turns,
                collar=collar,
            )
        )
    return found


def scene_pockets(tables: Sequence[PocketTable]) -> list[Pocket]:
    """Return the pockets that a scene wants."""
    return [
        Pocket(
            kind=table.kind,
            where=table.piece if table.kind in ("patch", "welt") else table.seam,
            line=table.line,
            **table.metres("width", "height", "below", "from_centre", "welt"),
            most_share=table.most_share or math.inf,
        )
        for table in tables
    ]


def sewn_centres(rules: EdgeRules, openings: Sequence[Opening]) -> EdgeRules:
    """Return rules by which a half piece has a seam instead of the fold at the centre lines that have openings."""
    lines = {opening.line: "seam" for opening in openings if opening.line in CENTRES and opening.parts_pieces}
    return replace(rules, kinds={**lines, **rules.kinds})
