"""Button stands, their facings and buttons; keyholes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from flat_forms import flat_form, pattern_of, whole_draft

from warpflat.core.errors import InputError
from warpflat.core.polyline import off_line
from warpflat.garment.construction.button_stand import button_depths
from warpflat.garment.construction.details import FinishingTable, OpeningTable
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.linings import add_interfacing
from warpflat.garment.construction.openings import OpeningPart, place_opening
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.pieces import Pattern
from warpflat.pattern.drafting.sewing_order import sewing_steps

BUTTONED = OpeningTable(kind="buttons", seam="centre front", width_mm=20)
FACING = FinishingTable(kind="facing", edge="neck", width_mm=55)


@pytest.fixture(scope="module")
def bodice() -> Garment:
    """A bodice parted at centre front."""
    return flat_form("bodice", BUTTONED)


@pytest.fixture(scope="module")
def whole() -> Garment:
    """A bodice in two pieces."""
    return flat_form("bodice")


def opened(garment: Garment, *openings: OpeningTable, finishing: tuple[FinishingTable, ...] = ()) -> Pattern:
    return pattern_of(garment, *finishing, openings=openings)


def test_stand_lies_upon_the_other_half_where_it_is_buttoned(bodice: Garment):
    separate = BUTTONED.model_copy(update={"facing": "separate"})
    before, after = opened(bodice).piece("front_left", ""), opened(bodice, separate).piece("front_left", "")
    line = after.internal_lines["centre front"]
    along = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    across = np.array([along[1], -along[0]])
    added = shapely.Polygon(after.outline).difference(shapely.Polygon(before.outline).buffer(1e-7))
    mirror = shapely.transform(added, lambda p: p - 2 * np.outer((p - line[0]) @ across, across))
    # Its mirror image about the centre line lies within the piece, and is 20 mm wide.
    assert mirror.difference(shapely.Polygon(before.outline).buffer(1e-5)).area < 1e-7
    assert added.area == pytest.approx(0.02 * np.linalg.norm(line[1] - line[0]), rel=0.02)
    edge = after.edge("centre front button stand").points
    assert np.allclose(np.abs((edge - line[0]) @ across), 0.02, atol=2e-4)


def test_buttons_lie_on_the_centre_and_one_on_the_bust(bodice: Garment):
    pattern = opened(bodice, BUTTONED)
    front = pattern.piece("front_left", "")
    marks = np.array(list(front.marks.values()))
    assert len(marks) >= 4
    line = shapely.LineString(front.internal_lines["centre front"])
    assert max(line.distance(shapely.Point(mark)) for mark in marks) < 1e-9
    bust = next(points for name, points in front.internal_lines.items() if name.startswith("bust"))
    assert min(np.linalg.norm(marks - end, axis=1).min() for end in bust[[0, -1]]) < 1e-3
    holes = [points for name, points in front.internal_lines.items() if name.rstrip(" 0123456789") == "buttonhole"]
    assert [np.linalg.norm(np.diff(hole, axis=0)) for hole in holes] == pytest.approx([0.021] * len(marks))
    drafted = next(piece for piece in draft_garment(pattern).pieces[""] if piece.name == "front_left")
    assert len(drafted.drill_holes) == len(marks)
    assert "centre front" not in {seam.name for seam in pattern.seams}


@pytest.mark.parametrize("facing", ["grown-on", "separate"])
def test_facing_of_neck_and_stand_is_joined_at_the_shoulders(bodice: Garment, facing: str):
    opening = BUTTONED.model_copy(update={"facing": facing})
    pattern = opened(bodice, opening, finishing=(FACING,))
    names = [piece.name for piece in pattern.pieces[""]]
    assert ("front_left_neck_facing" in names) == (facing == "separate")
    drafted = whole_draft(pattern)
    own = {seam.name: seam for seam in drafted.seams}
    assert {"front left neck facing", "back neck facing", "shoulder left of neck facing"} <= set(own)
    assert own["shoulder left of neck facing"].length_mm[0] == pytest.approx(55.0, abs=0.1)
    if facing == "grown-on":
        front = pattern.piece("front_left", "")
        fold = shapely.LineString(front.internal_lines["fold line"])
        # Folded back, it lies upon the piece.
        points = front.edge("facing neck").points
        start, end = np.asarray(fold.coords)
        along = (end - start) / np.linalg.norm(end - start)
        folded = start + 2 * np.outer((points - start) @ along, along) - (points - start)
        assert np.allclose(folded[::-1], front.edge("neck").points, atol=1e-9)


def test_interfacing_of_a_grown_on_facing_is_as_large_as_that(bodice: Garment):
    pattern = add_interfacing(opened(bodice, BUTTONED, finishing=(FACING,)), "fleece")
    front, own = pattern.piece("front_left", ""), pattern.piece("front_left_facing_interfacing", "")
    separate = BUTTONED.model_copy(update={"facing": "separate"})
    facing = opened(bodice, separate, finishing=(FACING,)).piece("front_left_neck_facing", "")
    assert shapely.Polygon(own.outline).area == pytest.approx(shapely.Polygon(facing.outline).area, rel=1e-6)
    assert shapely.Polygon(front.outline).buffer(1e-6).contains(shapely.Polygon(own.outline))
    assert (own.fabric, own.quantity) == ("fleece", 2)


def test_ring_open_from_edge_to_edge_passes(bodice: Garment):
    shut, opened = (
        {ring.name: ring for ring in replace(bodice, openings=openings).rings} for openings in ((), (BUTTONED,))
    )
    assert not shut["neck"].passes
    assert all(ring.passes for name, ring in opened.items() if not name.startswith("armhole"))


def test_stand_of_a_part_of_the_seam_leaves_the_rest_sewn(bodice: Garment):
    pattern = opened(bodice, BUTTONED.model_copy(update={"length_mm": 200}))
    front = pattern.piece("front_left", "")
    assert "centre front" in {seam.name for seam in pattern.seams}
    full = opened(bodice).piece("front_left", "").edge("centre front").length
    assert front.edge("centre front").length == pytest.approx(full - 0.2, abs=1e-3)
    whole_draft(pattern)


def test_a_stand_all_along_an_edge_ends_with_it(bodice: Garment, monkeypatch: pytest.MonkeyPatch):
    """Points are rounded to a micrometre, so that an edge and its seam on the layout differ."""

    def shorter(*given: Any) -> list[OpeningPart]:
        return [replace(part, whole=part.whole - 3e-6) for part in place_opening(*given)]

    monkeypatch.setattr("warpflat.garment.construction.to_pattern.place_opening", shorter)
    assert "centre front" not in {edge.name for edge in opened(bodice, BUTTONED).piece("front_left", "").edges}


def test_buttons_keep_to_the_count_of_another_size():
    depths = button_depths(BUTTONED.model_copy(update={"spacing_mm": 90}), 0.5, 0.2)
    assert len(button_depths(BUTTONED.model_copy(update={"spacing_mm": 90}), 0.55, 0.22, len(depths))) == len(depths)
    assert len(button_depths(BUTTONED.model_copy(update={"count": 7}), 0.5, None)) == 7
    with pytest.raises(InputError, match="no room for buttons"):
        button_depths(BUTTONED, 0.03, None)


def test_curved_edge_has_no_stand(whole: Garment):
    side = OpeningTable(kind="buttons", seam="side left", width_mm=20)
    with pytest.raises(InputError, match=r"strays .* mm from straight and cannot have a button stand"):
        opened(whole, side)


def test_keyhole_is_drawn_on_its_piece_and_on_its_facing(whole: Garment):
    hole = OpeningTable(kind="keyhole", seam="centre back", length_mm=120, width_mm=12)
    plain, pattern = opened(whole, finishing=(FACING,)), opened(whole, hole, finishing=(FACING,))
    assert [piece.name for piece in pattern.pieces[""]] == [piece.name for piece in plain.pieces[""]]
    for name in ("back", "back_neck_facing"):
        piece = pattern.piece(name, "")
        assert np.linalg.norm(np.diff(piece.internal_lines["keyhole"], axis=0)) == pytest.approx(0.12, abs=1e-3)
        ring = shapely.LineString(piece.internal_lines["keyhole end"])
        assert shapely.Polygon(piece.outline).contains(ring)
        assert np.ptp(shapely.get_coordinates(ring)[:, 0]) == pytest.approx(0.012, rel=0.02)
    larger = shapely.Polygon(pattern.piece("back_neck_facing", "").outline)
    around = shapely.LineString(pattern.piece("back", "").internal_lines["keyhole"]).buffer(0.03)
    assert larger.contains(around.intersection(shapely.Polygon(plain.piece("back", "").outline).buffer(-1e-4)))
    neck = next(ring for ring in replace(whole, openings=(hole,)).rings if ring.name == "neck")
    assert neck.opened == pytest.approx(0.24)


def test_below_a_stand_the_seam_may_bend():
    """Buttons at the back of trousers end above the crotch; held straight all along, its seam crossed itself."""
    buttoned = OpeningTable(kind="buttons", seam="crotch back", length_mm=180, facing="separate")
    pattern = opened(flat_form("trousers", buttoned), buttoned)
    back = pattern.piece("back_left", "")
    stand, below = back.edge("crotch back button stand"), back.edge("crotch back")
    assert stand.length == pytest.approx(0.180, abs=2e-3)
    assert float(off_line(below.points, below.points[[0, -1]]).max()) > 0.02
    assert {seam.name for seam in pattern.seams} >= {"crotch back", "crotch front"}
    whole_draft(pattern)


@pytest.fixture(scope="module")
def banded() -> Pattern:
    """Trousers that button at the back, with a waistband that buttons."""
    garment = flat_form("trousers", OpeningTable(kind="buttons", seam="crotch back", length_mm=180, facing="separate"))
    grown_on = OpeningTable(kind="buttons", seam="crotch back", length_mm=180, width_mm=25)
    band = FinishingTable(kind="waistband", edge="waist", width_mm=35, overlap_mm=30)
    return opened(garment, grown_on, finishing=(band,))


def test_a_facing_is_folded_in_before_a_waistband_is_sewn_over_its_end(banded: Pattern):
    steps = [step.technique for step in sewing_steps(draft_garment(banded), "")]
    assert steps.index("grown_facing") < steps.index("waistband_ends")


def test_a_waistband_laps_as_the_stands_that_it_is_sewn_to(banded: Pattern):
    """Closed, it goes around once, as the waist does: its button lies on the line of the other ones."""
    band = banded.piece("waistband", "")
    length = band.edge("lower").length
    assert band.edge("upper").length == pytest.approx(length)
    assert band.marks["button"][0] == pytest.approx(length - 0.025, abs=1e-3)
    assert band.internal_lines["buttonhole"].mean(axis=0)[0] == pytest.approx(0.025, abs=1e-3)
    # Either half may lie above, and so may either end.
    assert band.marks["button 2"][0] == pytest.approx(band.internal_lines["buttonhole"].mean(axis=0)[0])
