"""The tables `openings` and `finishing` of a scene, as openings along seams and finishing of free edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from warpflat.garment.edge_rules import EdgeRules
from warpflat.garment.finishing import FINISHES, Finishing
from warpflat.garment.openings import CENTRES, Opening
from warpflat.scene.schema import FinishingTable, OpeningTable

__all__ = ["scene_finishing", "scene_openings", "sewn_centres"]

# Allowance of a slit and flap of a vent [mm], where none is given.
_WIDTH_MM = {"zip": 0.0, "slit": 15.0, "vent": 40.0}


def scene_openings(tables: Sequence[OpeningTable]) -> list[Opening]:
    """Return the openings that a scene wants."""
    return [
        Opening(
            kind=table.kind,
            line=table.seam,
            length=1e-3 * table.length_mm,
            start=1e-3 * table.start_mm,
            style=table.style,
            width=1e-3 * (_WIDTH_MM[table.kind] if table.width_mm is None else table.width_mm),
        )
        for table in tables
    ]


def scene_finishing(tables: Sequence[FinishingTable]) -> list[Finishing]:
    """Return the finishing that a scene wants."""
    return [
        Finishing(
            kind=table.kind,
            edge=table.edge,
            width=FINISHES[table.kind] if table.width_mm is None else 1e-3 * table.width_mm,
            share=table.share,
            overlap=1e-3 * table.overlap_mm,
        )
        for table in tables
    ]


def sewn_centres(rules: EdgeRules, openings: Sequence[Opening]) -> EdgeRules:
    """Return rules by which a half piece has a seam instead of the fold at the centre lines that have openings."""
    lines = {opening.line: "seam" for opening in openings if opening.line in CENTRES}
    return replace(rules, kinds={**lines, **rules.kinds})
