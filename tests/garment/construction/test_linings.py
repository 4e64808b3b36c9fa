"""Linings, interfacings and shrinkage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from flat_forms import whole_draft

from warpflat.core.errors import InputError
from warpflat.garment.construction.facings import with_facings
from warpflat.garment.construction.linings import add_interfacing, add_lining
from warpflat.pattern.drafting.cut_list import cut_list
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.piece_parts import Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamSide
from warpflat.pattern.drafting.shrinkage import Shrinkage, enlarged
from warpflat.pattern.export.pattern_json import pattern_from_json, pattern_json


def bodice() -> Pattern:
    """A front and a back of a plain top, 40 by 50 cm, with a neck 20 cm wide."""
    across = np.linspace(0.0, np.pi, 21)
    neck = np.column_stack([0.1 * np.cos(across), 0.5 - 0.08 * np.sin(across)])
    corners = {
        "hem": [[-0.2, 0.0], [0.2, 0.0]],
        "side left": [[0.2, 0.0], [0.2, 0.5]],
        "shoulder left": [[0.2, 0.5], [0.1, 0.5]],
        "neck": neck,
        "shoulder right": [[-0.1, 0.5], [-0.2, 0.5]],
        "side right": [[-0.2, 0.5], [-0.2, 0.0]],
    }
    edges = [
        Edge(name=name, points=np.array(points), kind="hem" if name == "hem" else "seam")
        for name, points in corners.items()
    ]
    pieces = [Piece(name=name, fabric="wool", edges=edges) for name in ("front", "back")]
    seams = [
        Seam(
            name=name,
            sides=((SeamSide(piece="front", edge=name),), (SeamSide(piece="back", edge=name),)),
        )
        for name in ("side left", "shoulder left", "side right", "shoulder right")
    ]
    return with_facings(
        Pattern(name="top", pieces={"": pieces}, seams=seams), [("front", "neck"), ("back", "neck")], 0.05
    )


def test_lining_and_facing_together_are_as_large_as_the_shell():
    pattern = add_lining(bodice(), "silk")
    assert {piece.name: piece.fabric for piece in pattern.pieces[""] if piece.role == "lining"} == {
        "front_lining": "silk",
        "back_lining": "silk",
    }
    outline = {
        name: shapely.Polygon(pattern.piece(name, "").outline)
        for name in ("front", "front_lining", "front_neck_facing")
    }
    assert outline["front_lining"].area + outline["front_neck_facing"].area == pytest.approx(outline["front"].area)
    drafted = whole_draft(pattern)
    names = {seam.name for seam in drafted.seams}
    assert {"side left of the lining", "shoulder right of the lining", "lining to front neck facing"} <= names
    hem = pattern.piece("front_lining", "").edge("hem")
    assert hem.width == pytest.approx(pattern.piece("front", "").edge("hem").width - 0.02)


def test_lines_of_a_lining_end_where_its_facing_begins():
    pattern = bodice()
    down = {"centre front": np.array([[0.0, 0.42], [0.0, 0.0]]), "yoke": np.array([[-0.08, 0.44], [0.0, 0.415]])}
    pieces = [replace(p, internal_lines=down) if p.name == "front" else p for p in pattern.pieces[""]]
    lining = add_lining(replace(pattern, pieces={"": pieces}), "silk").piece("front_lining", "")
    body = shapely.Polygon(lining.outline).buffer(1e-6)
    # The yoke lies in the facing alone.
    assert set(lining.internal_lines) == {"centre front"}
    line = shapely.LineString(lining.internal_lines["centre front"])
    assert body.contains(line)
    assert line.length == pytest.approx(0.42 - 0.05, abs=1e-3)


def test_lining_of_facings_that_meet_is_refused():
    pattern = bodice()
    wide = with_facings(
        Pattern(name="top", pieces={"": [p for p in pattern.pieces[""] if p.role == "shell"]}),
        [("front", "neck")],
        0.098,
    )
    with pytest.raises(InputError, match="strips meet at 'shoulder"):
        add_lining(wide, "silk")


def test_interfacing_is_cut_by_the_facings_patterns():
    cloths = cut_list(draft_garment(add_interfacing(add_lining(bodice(), "silk"), "fleece")).pieces[""])
    assert {cloth: [entry.piece for entry in rows] for cloth, rows in cloths.items()} == {
        "wool": ["front", "back", "front_neck_facing", "back_neck_facing"],
        "fleece": ["front_neck_facing", "back_neck_facing"],
        "silk": ["front_lining", "back_lining"],
    }


def test_cloth_that_has_shrunk_has_the_pattern_s_size():
    drafted = draft_garment(add_lining(bodice(), "silk"))
    larger = enlarged(drafted, Shrinkage(warp=0.05, weft=0.02), "wool")
    for before, after in zip(drafted.pieces[""], larger.pieces[""], strict=True):
        shrunk = after.cut_line * ([0.98, 0.95] if before.piece.fabric == "wool" else [1.0, 1.0])
        assert np.allclose(shrunk, before.cut_line, atol=1e-12)
        assert any("5 % along the warp" in note for note in after.notes) == (before.piece.fabric == "wool")
        for one, other in zip(before.notches, after.notches, strict=True):
            assert np.allclose(other.at * shrunk[0] / after.cut_line[0], one.at, atol=1e-9)
    read = pattern_from_json(pattern_json(larger))
    assert read.pieces[""][0].enlarged == pytest.approx((1 / 0.98, 1 / 0.95))
    with pytest.raises(InputError, match="shrinkage along warp"):
        Shrinkage(warp=0.4)
