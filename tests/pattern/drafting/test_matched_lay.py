"""Markers on folded cloth, and on stripes that meet at seams."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import shapely
from sample_dress import sample_dress

from warpflat.core.errors import InputError
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.marker import Cloth, Marker, make_marker
from warpflat.pattern.drafting.matched_lay import Stripes


@pytest.fixture(scope="module")
def dress():
    return draft_garment(sample_dress(("38",)))


def overlap(marker: Marker) -> float:
    outlines = [shapely.Polygon(copy.cut_line) for copy in marker.placements]
    return max(a.intersection(b).area for a, b in combinations(outlines, 2))


def test_halves_lie_against_the_fold_and_pairs_are_cut_at_once(dress):
    marker = make_marker(dress, Cloth(width=1.4, folded=True, gap=0.004))
    assert marker.width == 0.7
    assert overlap(marker) == 0.0
    counts = {piece.name: 1 if piece.piece.on_fold else (piece.piece.quantity + 1) // 2 for piece in dress.pieces["38"]}
    laid = [copy.piece.name for copy in marker.placements]
    assert {name: laid.count(name) for name in counts} == counts
    for copy in marker.placements:
        if copy.piece.piece.on_fold:
            assert max(np.abs(line[:, 1]).max() for line in copy.fold_lines) < 1e-9
        assert copy.cut_line[:, 1].max() <= 0.7 + 1e-9


def test_matched_seams_lie_on_the_same_stripe(dress):
    name = next(seam.name for seam in dress.garment.seams if "side" in seam.name and len(seam.sides[0]) == 1)
    repeat = np.array([0.06, 0.045])
    stripes = Stripes(warp=repeat[0], weft=repeat[1], seams=(name,))
    marker = make_marker(dress, Cloth(width=1.5, stripes=stripes))
    assert overlap(marker) == 0.0
    places = []
    for copy in marker.placements:
        own = [notch for notch in copy.piece.notches if notch.seam == name]
        if own:
            at = min(own, key=lambda notch: notch.length).at
            places.append(copy.matrix[:, :2] @ at + copy.matrix[:, 2])
    assert len({copy.piece.name for copy in marker.placements}) == len(dress.pieces["38"])
    assert len(places) >= 2
    apart = np.mod(np.array(places) - places[0] + repeat / 2, repeat) - repeat / 2
    assert np.abs(apart).max() < 1e-9
    with pytest.raises(InputError, match="match: no seam 'sidle'"):
        make_marker(dress, Cloth(width=1.5, stripes=Stripes(warp=0.06, seams=("sidle",))))
