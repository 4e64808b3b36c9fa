"""Facings, bands, waistbands and bindings, derived from the free edges of a pattern."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from flat_forms import flat_form, pattern_of, whole_draft
from sample_dress import sample_dress

from warpflat.core.errors import InputError
from warpflat.garment.construction.details import FinishingTable, OpeningTable
from warpflat.garment.construction.facings import with_facings
from warpflat.garment.construction.garment import Garment
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.fitting import drawn_length
from warpflat.pattern.drafting.pieces import Pattern
from warpflat.pattern.drafting.sewing_order import notions, sewing_steps

ZIP = OpeningTable(kind="zip", seam="centre back", length_mm=400)
FACING = FinishingTable(kind="facing", edge="neck", width_mm=55)


@pytest.fixture(scope="module")
def parted() -> Garment:
    """A bodice whose back is parted for a zip."""
    return flat_form("bodice", ZIP)


@pytest.fixture(scope="module")
def half() -> Garment:
    """The left half of a bodice without openings."""
    return flat_form("bodice", half=True)


def edge_length(pattern: Pattern, places: Sequence[tuple[str, str]]) -> float:
    """Return the length of edges along the curves as which they are drawn."""
    return sum(drawn_length(pattern.piece(piece, "").edge(edge).points) for piece, edge in places)


def test_facings_repeat_the_neck_and_are_joined_at_the_shoulders(parted: Garment):
    pattern = pattern_of(parted, FACING)
    front, back = pattern.piece("front_neck_facing", ""), pattern.piece("back_left_neck_facing", "")
    assert (front.quantity, back.quantity) == (1, 2)
    assert front.edge("neck").length == pytest.approx(pattern.piece("front", "").edge("neck").length)
    assert front.edge("shoulder left").length == pytest.approx(0.055)
    drafted = draft_garment(pattern)
    own = {seam.name: seam for seam in drafted.seams if "facing" in seam.name}
    assert {"front neck facing", "back left neck facing", "shoulder left of neck facing"} <= set(own)
    assert "centre back of neck facing" not in own
    assert all(seam.matches for seam in own.values())
    # Every seam of a facing meets the pieces with a notch on both sides.
    for seam in ("front neck facing", "back left neck facing"):
        notched = [piece.name for piece in drafted.pieces[""] for notch in piece.notches if notch.seam == seam]
        assert len(notched) % 2 == 0
        assert len(set(notched)) == 2


def test_facings_are_joined_where_a_dart_parts_one_side_of_the_seam():
    # The front's side is parted by the bust dart, and its facing lies along the upper part.
    faced = with_facings(sample_dress(), [("front bodice", "armhole"), ("back bodice", "armhole")], 0.040)
    seam = next(seam for seam in faced.seams if seam.name == "side of armhole facing")
    assert [side.place for side in seam.stretches] == [
        ("front_bodice_armhole_facing", "side_upper"),
        ("back_bodice_armhole_facing", "side"),
    ]
    lengths = [faced.piece(side.piece, "38").edge(side.edge).length for side in seam.stretches]
    assert lengths == pytest.approx([0.040, 0.040])


def test_band_of_a_closed_neck_is_a_ring(half: Garment):
    share = 0.87
    pattern = pattern_of(half, FinishingTable(kind="band", edge="neck", width_mm=20, share=share))
    whole = 2 * edge_length(pattern, [("front", "neck"), ("back", "neck")])
    band = pattern.piece("neck_band", "")
    assert band.quantity == 1
    assert band.edge("lower").length == pytest.approx(share * whole)
    seams = {seam.name: seam for seam in pattern.seams}
    assert len(seams["neck band"].sides[1]) == 4
    assert "neck band ends" in seams
    whole_draft(pattern)


def test_zip_at_one_side_of_a_half_opens_its_ring_once(half: Garment):
    shoulder = OpeningTable(kind="zip", seam="shoulder left", length_mm=100)
    pattern = pattern_of(replace(half, openings=(shoulder,)), FinishingTable(kind="band", edge="neck", width_mm=20))
    seams = {seam.name: seam for seam in pattern.seams}
    # All around, and not sewn to a ring.
    assert len(seams["neck band"].sides[1]) == 4
    assert "neck band ends" not in seams


def test_waistband_ends_at_the_zip(parted: Garment):
    opened = replace(parted, openings=(ZIP.model_copy(update={"length_mm": 100}),))
    pattern = pattern_of(opened, FinishingTable(kind="waistband", edge="neck", width_mm=30, overlap_mm=25))
    band = pattern.piece("waistband", "")
    sides = next(seam for seam in pattern.seams if seam.name == "waistband").sides[1]
    # From one side of the centre back around to the other.
    assert [side.piece for side in sides] == ["back_left", "front", "back_left"]
    assert {side.mirrored for side in (sides[0], sides[-1])} == {True, False}
    length = edge_length(pattern, [("back_left", "neck"), ("front", "neck"), ("back_left", "neck")])
    assert band.edge("lower").length == pytest.approx(length)
    assert band.edge("upper").length == pytest.approx(length + 0.025)
    assert "waistband ends" not in {seam.name for seam in pattern.seams}
    whole_draft(pattern)
    # What runs past one end has the button, and the buttonhole lies as far from the other one: closed, both ends meet at the zip.
    np.testing.assert_allclose(band.marks["button"], [length + 0.0125, 0.015])
    np.testing.assert_allclose(band.internal_lines["buttonhole"].mean(axis=0), [0.0125, 0.015])
    assert "1 hook and bar" not in notions(sewing_steps(draft_garment(pattern), ""))


def test_armholes_get_a_binding_each(parted: Garment):
    pattern = pattern_of(parted, FinishingTable(kind="binding", edge="armhole", width_mm=35))
    binding = pattern.piece("armhole_binding", "")
    assert binding.quantity == 2
    assert binding.edge("lower").length == pytest.approx(
        edge_length(pattern, [("front", "armhole left"), ("back_left", "armhole left")])
    )
    # Where its ends come to lie no seam of the garment is turned to meet them.
    places = [corner.place for corner in draft_garment(pattern).corners]
    assert not [place for place in places if place.startswith("armhole binding:")]
    assert [place for place in places if place.startswith("side left:")]


def test_edge_that_is_not_free_is_named(parted: Garment):
    with pytest.raises(InputError, match=r"finishing\[0\]: no free edge 'shoulder'"):
        pattern_of(parted, FACING.model_copy(update={"edge": "shoulder"}))
    with pytest.raises(InputError, match="shorter than the facing is wide"):
        pattern_of(parted, FACING.model_copy(update={"width_mm": 250}))
