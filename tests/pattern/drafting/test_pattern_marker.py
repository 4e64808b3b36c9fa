"""The marker: everything on the cloth, nothing upon anything, the grain along the cloth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from polygons import corners_of, polygon
from sample_dress import sample_dress

from warpflat.core.errors import InputError
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.layout import covered_rings, lay_out, nests
from warpflat.pattern.drafting.marker import Cloth, cloth_needed, make_marker, unfold_piece
from warpflat.pattern.drafting.piece_parts import Hole
from warpflat.pattern.drafting.pieces import Pattern, Piece
from warpflat.pattern.export.pattern_files import lay_markers
from warpflat.pattern.export.pattern_json import write_pattern_json
from warpflat.pattern.export.svg import write_marker_svg


@pytest.fixture(scope="module", params=[False, True], ids=["two_way", "one_way"])
def marker(dress, request):
    return make_marker(dress, Cloth(width=1.4, one_way=request.param), sizes={"38": 1}, seconds=1), request.param


def test_every_copy_lies_on_the_cloth_and_none_on_another(marker):
    plan, _ = marker
    assert len(plan.placements) == 1 + 2 + 2 + 1 + 2
    polygons = [shapely.Polygon(copy.cut_line) for copy in plan.placements]
    cloth = shapely.box(0, 0, plan.length, plan.width).buffer(1e-6)
    assert all(cloth.contains(polygon) for polygon in polygons)
    for i, a in enumerate(polygons):
        assert all(a.distance(b) > 0.0015 for b in polygons[i + 1 :]), "the gap is kept"


def test_the_grain_lies_along_the_cloth_and_the_nap_one_way(marker):
    plan, one_way = marker
    for copy in plan.placements:
        along = copy.grain[1] - copy.grain[0]
        assert abs(along[1]) < 1e-9
        if one_way:
            assert along[0] > 0
        assert (along[0] < 0) == copy.turned


@pytest.mark.parametrize("gap", [-0.001, 0.14, 0.2])
def test_a_gap_is_small_against_the_cloth(gap):
    assert Cloth(width=1.4, gap=0.139).gap == 0.139
    with pytest.raises(InputError, match=r"gap .* between pieces; it must be 0 or more, and small"):
        Cloth(width=1.4, gap=gap)


def test_pairs_are_mirrored_and_nothing_is_scaled(marker):
    plan, _ = marker
    for name in ("back bodice", "sleeve", "skirt back"):
        assert sorted(c.mirrored for c in plan.placements if c.piece.name == name) == [False, True]
    for copy in plan.placements:
        assert abs(np.linalg.det(copy.matrix[:, :2])) == pytest.approx(1.0)
        assert (np.linalg.det(copy.matrix[:, :2]) < 0) == copy.mirrored


def test_a_whole_piece_is_notched_on_both_halves(marker):
    plan, _ = marker
    (copy,) = (c for c in plan.placements if c.piece.name == "front bodice")
    assert len(copy.notches) == 2 * sum(len(n.base) for n in copy.piece.notches)
    ring = shapely.LinearRing(copy.cut_line)
    assert max(ring.distance(shapely.Point(slit[0])) for slit in copy.notches) < 1e-5


def test_utilisation_is_area_over_cloth(marker):
    plan, _ = marker
    area = sum(shapely.Polygon(c.cut_line).area for c in plan.placements)
    assert plan.utilisation == pytest.approx(area / (plan.length * plan.width))
    assert 0.6 < plan.utilisation < 1.0


def frame(name, width, height, rim, *, fold=False):
    """A piece with a hole `rim` [m] from its border."""
    hole = np.array(corners_of(width - 2 * rim, height - 2 * rim, rim, rim))
    kinds = ("seam", "seam", "seam", "fold" if fold else "seam")
    holes = [Hole(name="hole", points=hole, allowance=0.0)]
    return polygon(name, corners_of(width, height), kinds=kinds, holes=holes)


@pytest.mark.parametrize("fold", [False, True])
def test_what_is_cut_out_is_drawn_and_is_not_used(fold, tmp_path):
    garment = Pattern(name="g", pieces={"": [frame("rim", 0.4, 0.5, 0.08, fold=fold)]})
    plan = make_marker(draft_garment(garment), Cloth(width=1.4), seconds=1)
    (copy,) = plan.placements
    halves = 1 + fold
    used = halves * ((0.40 + (0.01 if fold else 0.02)) * 0.52 - 0.24 * 0.34)
    assert plan.utilisation * plan.length * plan.width == pytest.approx(used, rel=1e-3)
    assert len(copy.cutouts) == halves
    for line in copy.cutouts:
        assert shapely.Polygon(copy.cut_line).contains(shapely.Polygon(line))
        assert not shapely.Polygon(line).intersects(shapely.Polygon(copy.name.box))
    write_marker_svg(plan, tmp_path / "m.svg")
    assert (tmp_path / "m.svg").read_text().count('class="cutout"') == halves


def test_names_stay_on_their_pieces():
    long = frame("front_facing_of_the_placket", 0.3, 0.2, 0.03)
    narrow = Piece(name="side panel.left", edges=frame("n", 0.04, 0.5, 0.01).edges)
    plan = make_marker(draft_garment(Pattern(name="g", pieces={"": [long, narrow]})), Cloth(width=1.0), seconds=1)
    for copy in plan.placements:
        cloth = shapely.Polygon(copy.cut_line, copy.cutouts)
        assert cloth.covers(shapely.Polygon(copy.name.box))
        assert not shapely.Polygon(copy.name.box).intersects(shapely.LineString(copy.grain))
        assert copy.name.height > 0.006


def test_a_half_on_the_fold_is_cut_whole(dress):
    (front,) = (p for p in dress.pieces["38"] if p.name == "front bodice")
    whole = shapely.Polygon(unfold_piece(front))
    assert whole.area == pytest.approx(2 * shapely.Polygon(front.cut_line).area, rel=1e-4)
    assert whole.bounds[0] == pytest.approx(-whole.bounds[2], abs=1e-5)


def test_reversible_cloth_may_cut_both_of_a_pair_one_way_up(dress):
    plan = make_marker(dress, Cloth(width=1.4, reversible=True), sizes={"38": 1}, seconds=1)
    assert len(plan.placements) == 8
    assert plan.utilisation > 0.6


def test_bad_cloth_and_names_are_refused(dress):
    with pytest.raises(InputError, match=r"'front bodice' size 36 is \d+ mm wide, the cloth"):
        make_marker(dress, Cloth(width=0.3), seconds=1)
    (first, *_) = sample_dress(("38",)).pieces["38"]
    plain = draft_garment(Pattern(name="plain", pieces={"": [replace(first, size="")]}))
    with pytest.raises(InputError, match=r"'front bodice' is \d+ mm wide, the cloth"):
        make_marker(plain, Cloth(width=0.3), seconds=1)
    with pytest.raises(InputError, match="no size"):
        make_marker(dress, Cloth(width=1.4), sizes={"99": 1}, seconds=1)
    with pytest.raises(InputError, match="no piece is of fabric"):
        make_marker(dress, Cloth(width=1.4), fabric="lining", seconds=1)
    with pytest.raises(InputError, match=r"between 0\.1 and 10 m"):
        Cloth(width=1400.0)


def test_the_sheet_keeps_pieces_apart_and_sizes_together(dress):
    sheet = lay_out(nests(dress), width=1.0)
    laid = [placed.on_sheet(np.concatenate(covered_rings(placed.pieces))) for placed in sheet.placed]
    boxes = [shapely.MultiPoint(points).envelope for points in laid]
    for i, a in enumerate(boxes):
        assert all(a.distance(b) > 0.0099 for b in boxes[i + 1 :])
    assert sheet.size[0] <= 1.0 + 1e-9
    assert all([p.size for p in placed.pieces] == ["36", "38"] for placed in sheet.placed)
    assert all(shapely.box(0, 0, *sheet.size).contains(box) for box in boxes)


@pytest.mark.parametrize(("width", "length", "needed"), [(1.05, 1.0, 1.20), (1.05, 0.9, 1.25)])
def test_a_size_that_lies_within_a_larger_one_needs_no_more_cloth(
    monkeypatch: pytest.MonkeyPatch, width: float, length: float, needed: float
):
    """The lay of a size is searched for by itself, and that of a larger one may turn out shorter."""
    corners = np.array([[0.0, 0.0], [0.5, 0.0], [0.4, 0.8], [0.1, 0.8]])
    sizes = {"38": np.array([1.0, 1.0]), "42": np.array([width, length])}
    pieces = {size: [polygon("front", grown * corners, size=size)] for size, grown in sizes.items()}
    found = iter([1.25, 1.25, None, 1.20, 1.20, 1.30])
    monkeypatch.setattr("warpflat.pattern.drafting.marker.nest_on_strip", lambda *_, **__: next(found))
    cloth = cloth_needed(draft_garment(Pattern(name="dress", pieces=pieces)))
    assert cloth == {"38": {"": (needed, needed, 1.30 if needed == 1.20 else None)}, "42": {"": (1.20, 1.20, 1.30)}}


def test_each_cloth_has_a_marker_of_its_own_whatever_it_is_called(tmp_path: Path) -> None:
    """A fabric's name may have what no file's has, and two may differ in what files do not tell apart."""
    fabrics = ("wool", "cotton/linen", "Cotton/Linen", "cötton/linen")
    pieces = [polygon(f"p{k}", corners_of(0.2, 0.3), fabric=fabric) for k, fabric in enumerate(fabrics)]
    write_pattern_json(draft_garment(Pattern(name="g", pieces={"": pieces})), tmp_path / "pattern.json")
    files, _, plans = lay_markers(tmp_path / "pattern.json", Cloth(width=1.0), out=tmp_path / "out", seconds=1)
    ends = ("", ".cotton_linen", ".Cotton_Linen_2", ".cotton_linen_3")
    assert [file.name for file in files if file.suffix == ".svg"] == [f"g{end}.marker.svg" for end in ends]
    assert all(file.is_file() for file in files)
    assert not any("not_made" in plan for plan in plans)
