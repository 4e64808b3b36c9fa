"""Collars and hoods: as long as the neckline, and as long outside as the line on which they come to lie."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from flat_forms import flat_form, pattern_of, whole_draft

from warpflat.core.errors import InputError
from warpflat.core.polyline import arc_lengths, points_at_lengths, polyline_length
from warpflat.garment.construction.details import FinishingTable, OpeningTable
from warpflat.garment.construction.free_edges import free_chain, joined_line
from warpflat.garment.construction.garment import Garment
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.fitting import drawn_length
from warpflat.pattern.drafting.piece_parts import Edge
from warpflat.pattern.drafting.pieces import Pattern
from warpflat.pattern.drafting.sewing_order import sewing_steps

BUTTONS = OpeningTable(kind="buttons", seam="centre front", width_mm=20)
ZIP = OpeningTable(kind="zip", seam="centre back", length_mm=300)


def drawn(edge: Edge) -> float:
    """Return the length of an edge along the curve as which it is drawn."""
    return drawn_length(edge.points)


@pytest.fixture(scope="module")
def plain() -> Garment:
    return flat_form("bodice")


@pytest.fixture(scope="module")
def zipped() -> Garment:
    return flat_form("bodice", ZIP)


@pytest.fixture(scope="module")
def buttoned() -> Garment:
    return flat_form("bodice", BUTTONS)


def with_neck(garment: Garment, kind: str = "collar", **given: object) -> Pattern:
    return pattern_of(garment, FinishingTable(kind=kind, edge="neck", **given))  # type: ignore[arg-type]


def check_seams(pattern: Pattern) -> None:
    drafted = whole_draft(pattern)
    on = {"collar_on", "collar_stand_on", "collar_between", "hood", "rib"}
    assert any(step.technique in on for step in sewing_steps(drafted, ""))


def test_stand_goes_to_the_edges_of_the_button_stand_and_leans_to_the_neck(buttoned: Garment):
    pattern = with_neck(buttoned, style="stand", width_mm=35)
    check_seams(pattern)
    stand, front, back = (pattern.piece(name, "") for name in ("collar_stand", "front_left", "back"))
    assert stand.quantity == 2
    assert drawn(stand.edge("lower")) == pytest.approx(
        2.0 * drawn(front.edge("neck")) + drawn(back.edge("neck")), abs=2e-6
    )
    assert {"button"} == set(stand.marks)
    assert "buttonhole" in stand.internal_lines
    lower = stand.edge("lower").points
    assert lower[-1, 1] - lower[len(lower) // 2, 1] == pytest.approx(0.015, rel=0.05)
    assert polyline_length(stand.edge("upper").points) < stand.edge("lower").length


@pytest.mark.parametrize("fall", [0.045, 0.06])
def test_outer_edge_of_a_shirt_collar_reaches_around_the_line_below_the_seam_of_its_stand(
    buttoned: Garment, fall: float
):
    pattern = with_neck(buttoned, style="shirt", width_mm=30, fall_mm=1e3 * fall, point_mm=70)
    check_seams(pattern)
    collar, stand = pattern.piece("collar", ""), pattern.piece("collar_stand", "")
    assert drawn(collar.edge("lower")) == pytest.approx(drawn(stand.edge("upper")), abs=2e-5)
    # From one centre front to the other: the button stand lies beyond.
    assert stand.edge("lower").length - stand.edge("upper").length > 2.0 * BUTTONS.width
    chain = free_chain(pattern_of(buttoned), [("front_left", "neck"), ("back", "neck")])
    plain = pattern_of(buttoned)
    line, at = joined_line(plain, chain, ""), plain.piece("front_left", "").edge("neck").length
    back = plain.piece("back", "").edge("neck").length
    behind = points_at_lengths(line, np.linspace(at, at + back, 200))
    wanted = shapely.LineString(behind).offset_curve(fall - 0.03).length
    # What of the collar's outer edge lies between the shoulders.
    lower, upper = collar.edge("lower").points, collar.edge("upper").points[::-1]
    share = 0.5 * back / collar.edge("lower").length
    middle = [round((0.5 + sign * share) * (len(lower) - 1)) for sign in (-1, 1)]
    own = arc_lengths(upper)[middle[1]] - arc_lengths(upper)[middle[0]]
    assert wanted <= own < 1.04 * wanted
    assert own > back
    assert collar.edge("right end").length == pytest.approx(0.07, abs=0.003)


def test_fall_that_does_not_hide_its_stand_is_refused(buttoned: Garment):
    with pytest.raises(InputError, match="fall_mm = 30 must be at least 4 more than width_mm = 30"):
        with_neck(buttoned, style="shirt", width_mm=30, fall_mm=30)


def test_convertible_collar_ends_at_the_centre_front(buttoned: Garment):
    pattern = with_neck(buttoned, style="convertible", width_mm=75)
    check_seams(pattern)
    neck = with_neck(buttoned, style="stand").piece("collar_stand", "").edge("lower").length
    assert neck - pattern.piece("collar", "").edge("lower").length == pytest.approx(2.0 * BUTTONS.width, rel=0.1)


def test_flat_collar_repeats_the_neckline_and_meets_in_front(plain: Garment):
    pattern = with_neck(plain, style="flat", width_mm=60)
    check_seams(pattern)
    collar = pattern.piece("collar", "")
    whole = sum(
        drawn(edge)
        for piece in ("front", "back")
        for edge in pattern.piece(piece, "").edges
        if edge.name.startswith("neck")
    )
    assert drawn(collar.edge("lower")) == pytest.approx(whole, abs=2e-6)
    distance = shapely.LineString(collar.edge("lower").points).distance(
        shapely.points(collar.edge("upper").points[20:-20])
    )
    assert distance == pytest.approx(0.06, abs=1e-3)
    # Two halves leave the back open.
    assert collar.quantity == 2


def test_flat_collar_with_a_zip_behind_has_two_halves(zipped: Garment):
    pattern = with_neck(zipped, style="flat", width_mm=60)
    check_seams(pattern)
    assert pattern.piece("collar", "").quantity == 4
    with pytest.raises(InputError, match="opens in front"):
        with_neck(zipped, style="shirt")


def test_collar_needs_an_opening(plain: Garment):
    with pytest.raises(InputError, match=r"finishing\[0\]: a shirt collar needs an opening in front"):
        with_neck(plain, style="shirt")


@pytest.mark.parametrize("strip", [0.0, 0.1])
def test_hood_goes_around_the_neck_and_over_the_head(plain: Garment, strip: float):
    pattern = with_neck(plain, kind="hood", strip_mm=1e3 * strip)
    check_seams(pattern)
    hood = pattern.piece("hood", "")
    whole = sum(
        drawn(edge)
        for piece in ("front", "back")
        for edge in pattern.piece(piece, "").edges
        if edge.name.startswith("neck")
    )
    assert 2.0 * drawn(hood.edge("neck")) + strip == pytest.approx(whole, abs=1e-4)
    assert plain.mannequin is not None
    head = plain.mannequin.extremity("head")
    assert head is not None
    # Its opening is as long as the tape from the neck over the crown to the neck again, of a head that is longer than wide.
    assert 2.0 * hood.edge("front edge").length + strip == pytest.approx(1.24 * head)
    if strip:
        middle = pattern.piece("hood_strip", "")
        assert middle.edge("right side").length == pytest.approx(drawn(hood.edge("crown")))


def test_hood_needs_a_neckline_that_is_whole_behind(zipped: Garment):
    with pytest.raises(InputError, match="begins and ends at the centre front"):
        with_neck(zipped, kind="hood")


def test_placket_opens_the_neck_in_front_and_its_strips_fill_a_box(plain: Garment):
    wish = FinishingTable(kind="collar", edge="neck", width_mm=70, placket_mm=140, style="convertible")
    garment = replace(plain, finishing=(wish,))
    pattern = pattern_of(garment)
    check_seams(pattern)
    strips, front = pattern.piece("neck_placket", ""), pattern.piece("front", "")
    assert strips.quantity == 2
    assert np.ptp(strips.outline, axis=0) == pytest.approx([0.16, 0.06])
    slit = next(line for name, line in front.internal_lines.items() if name.startswith("slit"))
    assert np.linalg.norm(slit[1] - slit[0]) == pytest.approx(0.14, abs=1e-6)
    # The box is as wide as a finished strip, with the slit in its middle.
    low = front.internal_lines["placket 3"]
    assert np.linalg.norm(low[1] - low[0]) == pytest.approx(0.03)
    assert low.mean(axis=0) == pytest.approx(slit[1])
    steps = " ".join(step.words for step in sewing_steps(draft_garment(pattern), ""))
    assert "Sew a strip to each side of the marked box" in steps
    assert "bind both their edges" not in steps
    # Both edges of the slit widen the ring of the neck.
    rings = {ring.name: ring for ring in garment.rings}
    assert rings["neck"].opened == pytest.approx(0.28)
    with pytest.raises(InputError, match="does not lie within 'front'"):
        pattern_of(plain, wish.model_copy(update={"placket_mm": 900}))
