"""Markers on folded cloth, and on stripes that meet at seams."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import shapely
from polygons import drafted, polygon, sewn
from sample_dress import sample_dress

from warpflat.core.errors import InputError
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.marker import Cloth, Marker, make_marker
from warpflat.pattern.drafting.matched_lay import Stripes
from warpflat.pattern.export.pattern_files import lay_markers
from warpflat.pattern.export.pattern_json import write_pattern_json


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
    name = next(seam.name for seam in dress.pattern.seams if "side" in seam.name and len(seam.sides[0]) == 1)
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


def whole_pair() -> DraftedGarment:
    """A front and a back, each its own mirror image, the front short of seams' notches, and their side seams."""
    names = ("hem", "side right", "top", "side left")
    pieces = [
        polygon(name, [(-0.2, 0.0), (0.2, 0.0), (0.15, high), (-0.15, high)], names=names)
        for name, high in (("front", 0.3), ("back", 0.302))
    ]
    seams = [
        sewn("front.side right", "back.side left", "right", notches=()),
        sewn("front.side left", "back.side right", "left", notches=()),
    ]
    return drafted(*pieces, seams=seams)


@pytest.mark.parametrize("name", ["left", "right"])
def test_stripes_meet_on_folded_cloth_at_seams_of_either_side(name: str):
    garment, stripes = whole_pair(), Stripes(warp=0.05, seams=(name,))
    marker = make_marker(garment, Cloth(width=1.0, folded=True, gap=0.004, stripes=stripes))
    places = {}
    for copy in marker.placements:
        assert copy.piece.piece.on_fold
        hem = copy.piece.edge("hem").line
        places[copy.piece.name] = (hem @ copy.matrix[:, :2].T + copy.matrix[:, 2])[0, 0]
    # The seam begins at the front's lower or upper end, the back's there, too.
    apart = places["front"] - places["back"]
    if name == "left":
        apart -= 0.002
    assert abs((apart + 0.025) % 0.05 - 0.025) < 3e-4


def test_copies_that_are_bound_keep_the_gap():
    stripes = Stripes(warp=0.03, weft=0.03, seams=("left", "right"))
    marker = make_marker(whole_pair(), Cloth(width=1.2, gap=0.05, stripes=stripes))
    outlines = [shapely.Polygon(copy.cut_line) for copy in marker.placements]
    assert min(a.distance(b) for a, b in combinations(outlines, 2)) > 0.05 - 1e-6
    for copy in marker.placements:
        assert copy.cut_line.min() > 0.05 - 1e-6
        assert copy.cut_line[:, 1].max() < 1.2 - 0.05 + 1e-6


def test_a_piece_that_double_cloth_gives_once_too_often_is_named(tmp_path):
    pieces = [
        polygon("welt", [(0.0, 0.0), (0.1, 0.0), (0.15, 0.1)]),
        polygon("pair", [(0.0, 0.0), (0.1, 0.0), (0.15, 0.1)], quantity=2),
    ]
    write_pattern_json(drafted(*pieces), tmp_path / "pattern.json")
    for folded in (True, False):
        _, notes, _ = lay_markers(tmp_path, Cloth(width=1.0, folded=folded), out=tmp_path / str(folded), seconds=1)
        assert ("marker: the cloth lies double: welt cut once too often" in notes) == folded
