"""The line drawing of a garment: its waistband and its zip are seen, each from the sides from which they can be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flat_forms import flat_form, pattern_of

from warpflat.garment.construction.details import FinishingTable, OpeningTable
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.line_drawing import describe_worn
from warpflat.pattern.drafting.piece_parts import Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece
from warpflat.pattern.drafting.worn import ViewedPiece


def skirt(opening: OpeningTable, *, half: bool) -> Garment:
    garment = flat_form("skirt", opening, half=half)
    return replace(garment, finishing=(FinishingTable(kind="waistband", edge="waist", width_mm=30),))


def triangle(name: str, **other: Any) -> Piece:
    outline = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    return Piece(name=name, edges=[Edge(name=str(k), points=outline[[k, (k + 1) % 3]]) for k in range(3)], **other)


def views_of(garment: Garment, piece: Piece | None = None) -> Mapping[str, Sequence[ViewedPiece]]:
    """How a garment is seen, of whose pattern one piece counts."""
    return describe_worn({"": garment}, Pattern(name="p", pieces={"": [piece or triangle("other")]}), {}).views


def test_waistband_lies_above_the_waist_and_a_zip_in_the_side_is_seen_on_that_side():
    garment = skirt(OpeningTable(kind="zip", seam="side left", length_mm=200), half=True)
    views = views_of(garment)
    for name, sign in (("front", 1.0), ("back", -1.0)):
        # What of the band is on the far side lies behind all pieces.
        _, *pieces, band, zipped = views[name]
        top = max(float(piece.outlines[0][:, 1].max()) for piece in pieces)
        (ring,) = band.outlines
        assert float(ring[:, 1].max()) == pytest.approx(top + 0.03, abs=0.003)
        # From side to side, of a half garment too.
        waist = max(float(np.ptp(piece.outlines[0][piece.outlines[0][:, 1] > top - 0.01, 0])) for piece in pieces)
        assert float(np.ptp(ring[:, 0])) == pytest.approx(waist, rel=0.05)
        middles = np.array([line.mean(axis=0) for line in zipped.lines])
        assert (sign * middles[:, 0] > 0.05).all()
        assert 0.15 < float(np.ptp(middles[:, 1])) < 0.21
        assert zipped.outlines == ()


def test_every_button_is_drawn_in_front():
    opening = OpeningTable(kind="buttons", seam="centre front", length_mm=400, count=5)
    views = views_of(skirt(opening, half=False))
    (buttons,) = [piece for piece in views["front"] if not piece.outlines]
    heights = [float(circle[:, 1].mean()) for circle in buttons.lines]
    assert len(heights) == 5
    assert heights == sorted(heights, reverse=True)
    assert all(float(np.ptp(circle[:, 0])) == pytest.approx(0.018) for circle in buttons.lines)
    assert all(piece.outlines for piece in views["back"])


def test_a_zip_at_the_centre_back_is_not_seen_from_the_front():
    views = views_of(skirt(OpeningTable(kind="zip", seam="centre back", length_mm=200), half=False))
    drawn = {name: [piece for piece in row if not piece.outlines] for name, row in views.items()}
    assert drawn["front"] == []
    (zipped,) = drawn["back"]
    assert all(abs(float(line.mean(axis=0)[0])) < 0.01 for line in zipped.lines)


@pytest.mark.parametrize(
    ("wish", "wider", "lines"),
    [
        (FinishingTable(kind="ruffle", edge="knee", width_mm=200, share=3.0, pleat_mm=50), 0.015, 11),
        (FinishingTable(kind="ruffle", edge="knee", width_mm=100, share=1.8), 0.04, 17),
        (FinishingTable(kind="flounce", edge="knee", width_mm=200, turns=1.0), 0.14, 7),
    ],
)
def test_ruffle_hangs_below_its_edge_with_its_folds(wish: FinishingTable, wider: float, lines: int):
    garment = skirt(OpeningTable(kind="zip", seam="side left", length_mm=200), half=True)
    plain, drawn = (views_of(replace(garment, finishing=row)) for row in ((), (wish,)))
    for name in ("front", "back"):
        before, after = (
            np.concatenate([ring for piece in row[name] for ring in piece.outlines]) for row in (plain, drawn)
        )
        assert float(before[:, 1].min() - after[:, 1].min()) == pytest.approx(wish.width, abs=0.02)
        knee = before[before[:, 1] < before[:, 1].min() + 0.02, 0]
        assert float(np.ptp(after[:, 0]) - np.ptp(knee)) > wider
        # Folds of the near side alone are seen.
        seen = [sum(len(piece.lines) for piece in row[name]) for row in (plain, drawn)]
        assert seen[1] - seen[0] == pytest.approx(lines, abs=2)


@pytest.mark.parametrize("kind", ["band", "ruffle", "flounce"])
def test_what_is_sewn_to_a_slanted_edge_hangs_from_it(kind: str):
    rise = {"side left": 100.0, "side right": 0.0}
    garment = flat_form("skirt")
    hem = FinishingTable(kind="hem", edge="knee", shorten_mm=rise)
    wish = FinishingTable(kind=kind, edge="knee", width_mm=50, shorten_mm=rise)
    plain, drawn = (pattern_of(garment, each).worn.views for each in (hem, wish))
    for name, sign in (("front", 1.0), ("back", -1.0)):
        before, after = (
            np.concatenate([ring for piece in row[name] for ring in piece.outlines]) * [sign, 1.0]
            for row in (plain, drawn)
        )
        for x in (0.1, 0.0, -0.1):
            lowest = [float(row[np.abs(row[:, 0] - x) < 0.03, 1].min()) for row in (before, after)]
            assert lowest[0] - lowest[1] == pytest.approx(0.05, abs=0.02), (name, x)


def test_a_cuff_that_is_wider_than_what_it_takes_the_place_of_ends_lower():
    rows = [
        pattern_of(flat_form("skirt"), FinishingTable(kind="band", edge="knee", width_mm=60, shorten_mm=mm)).worn
        for mm in (60.0, 20.0)
    ]
    lowest = [min(float(ring[:, 1].min()) for piece in row.views["front"] for ring in piece.outlines) for row in rows]
    assert lowest[0] - lowest[1] == pytest.approx(0.04, abs=0.005)


@pytest.mark.parametrize("kind", ["band", "ruffle", "flounce"])
def test_nothing_is_drawn_below_what_is_sewn_on_much_higher(kind: str):
    views = [
        pattern_of(flat_form("skirt"), FinishingTable(kind=kind, edge="knee", width_mm=50, shorten_mm=mm)).worn.views
        for mm in (50.0, 200.0)
    ]
    for name in ("front", "back"):
        lowest = [min(float(ring[:, 1].min()) for piece in row[name] for ring in piece.outlines) for row in views]
        assert lowest[1] - lowest[0] == pytest.approx(0.15, abs=0.01)


def test_right_half_of_a_wrap_covers_the_left_one():
    garment = skirt(OpeningTable(kind="wrap", seam="centre front", width_mm=120), half=False)
    views = views_of(garment)
    shell = [piece for piece in views["front"] if piece.outlines][1:-1]
    # To the viewer's right of the centre by its width; nothing of the centre line is seen on it.
    upper = shell[-1]
    (ring,) = upper.outlines
    assert float(ring[:, 0].max()) == pytest.approx(0.12, abs=0.01)
    assert float(ring[:, 0].min()) < -0.15
    assert not any(np.abs(line[:, 0]).max() < 0.01 for line in upper.lines)


def test_patches_are_drawn_on_their_side_of_the_body():
    garment = skirt(OpeningTable(kind="zip", seam="side left", length_mm=200), half=False)
    sides = {
        "pocket": [[0.05, 0.4], [0.05, 0.3]], "pocket 2": [[0.05, 0.3], [0.15, 0.3]],
        "pocket 3": [[0.15, 0.3], [0.15, 0.4]],
    }  # fmt: skip
    flat = next(piece for name, piece in garment.pieces.items() if "front" in name)
    middle = flat.positions.mean(axis=0)
    lines = {name: np.array(line) - [0.1, 0.35] + middle for name, line in sides.items()}
    marked = triangle(flat.surface.name, internal_lines=lines)
    plain, drawn = views_of(garment), views_of(garment, marked)
    assert len(drawn["back"]) == len(plain["back"])
    (patch,) = drawn["front"][-1].lines
    # Closed where it is left open on the piece, and as large as that.
    assert np.allclose(patch[0], patch[-1])
    assert np.ptp(patch, axis=0) == pytest.approx([0.1, 0.1], abs=0.01)


def test_a_band_that_draws_the_garment_in_is_its_finished_measure():
    band = FinishingTable(kind="band", edge="waist", width_mm=40, share=0.9)
    garment = replace(
        flat_form("skirt", OpeningTable(kind="zip", seam="side left", length_mm=200), half=False), openings=()
    )
    finished = []
    for finishing in ((), (band,)):
        pattern = pattern_of(replace(garment, finishing=finishing))
        assert pattern.worn is not None
        finished.append({measure.name: measure.finished for measure in pattern.worn.measures[""]})
    plain, drawn = finished
    lengths = [piece.edge("lower").length for piece in pattern.pieces[""] if piece.role == "strip"]
    assert drawn["waist"] == pytest.approx(sum(lengths), abs=1e-6)
    assert drawn["waist"] == pytest.approx(0.9 * plain["waist"], rel=0.01)
    assert {name: length for name, length in drawn.items() if name != "waist"} == {
        name: length for name, length in plain.items() if name != "waist"
    }


def test_a_band_that_draws_the_garment_in_is_not_too_large():
    """Of a waist that is a fifth too large the pattern says what the run does, which looks at the band."""
    garment = replace(
        flat_form("skirt", OpeningTable(kind="zip", seam="side left", length_mm=200), half=False), openings=()
    )
    waist = garment.girths["waist"]
    large = 1.2 * waist["form_m"]
    girths = {"waist": {**waist, "pattern_m": large, "ease_m": large - waist["body_m"]}}
    failing = []
    for finishing in ((), (FinishingTable(kind="band", edge="waist", width_mm=40, share=0.9),)):
        made = replace(garment, finishing=finishing)
        pattern = pattern_of(made)
        made.__dict__["girths"] = girths
        failing.append("too large" in describe_worn({"": made}, pattern, {}).failing)
    assert failing == [True, False]
