"""Lengths of a finished garment."""

from __future__ import annotations

import pytest
from polygons import corners_of, drafted, polygon, sewn

from warpflat.pattern.drafting.finished import finished_lengths


@pytest.mark.parametrize("opened", ["vent", "slit"])
def test_a_skirt_is_as_long_with_an_opening_at_its_hem(opened: str):
    corners = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.6), (0.0, 0.6), (0.0, 0.2)]
    names = ("hem", "side left", "waist", "centre back", f"centre back {opened}")
    back = polygon("back", corners, names=names, kinds=("hem", "seam", "seam", "seam", "hem"), quantity=2)
    assert finished_lengths(drafted(back), "")["length at the centre back"] == pytest.approx(0.6)
    band = polygon("waistband", corners_of(0.6, 0.04), role="waistband")
    lengths = finished_lengths(drafted(back, band, seams=[sewn("back.waist", "waistband.e0", "waist")]), "")
    assert lengths["length at the centre back, below the waistband"] == pytest.approx(0.6)
