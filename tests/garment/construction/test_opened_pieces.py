"""Openings, bands and pockets on pieces that are drawn by hand: what each leaves of the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from warpflat.core.errors import InputError
from warpflat.garment.construction.details import FinishingTable, OpeningTable, PocketTable
from warpflat.garment.construction.finishing import finish_edges, hem_rises
from warpflat.garment.construction.fly import with_flies
from warpflat.garment.construction.mark_openings import mark_openings
from warpflat.garment.construction.openings import OpeningPart
from warpflat.garment.construction.plackets import with_placket
from warpflat.garment.construction.pockets import add_pockets
from warpflat.pattern.drafting.piece_parts import Dart, Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamOpening, SeamSide

Points = NDArray[np.float64]


def points(*places: tuple[float, float]) -> Points:
    return np.array(places, float)


def panel(name: str, *, right: str = "side left", left: str = "side right", **lines: Points) -> Piece:
    """A rectangle of 0.3 by 0.5 m."""
    corners = points((0.0, 0.0), (0.3, 0.0), (0.3, 0.5), (0.0, 0.5), (0.0, 0.0))
    edges = [
        Edge(name=edge, points=corners[k : k + 2], kind="hem" if k == 0 else "seam")
        for k, edge in enumerate(("hem", right, "waist", left))
    ]
    return Piece(
        name=name, edges=edges, internal_lines={title.replace("_", " "): line for title, line in lines.items()}
    )


def side(piece: str, edge: str, *, up: bool = True) -> tuple[SeamSide]:
    return (SeamSide(piece=piece, edge=edge, reversed=not up),)


def heights(piece: Piece, title: str) -> list[tuple[float, float]]:
    """From where to where the lines of a title run, the uppermost first [m]."""
    found = [line[:, 1] for name, line in piece.internal_lines.items() if name.startswith(title)]
    return sorted(((float(y.max()), float(y.min())) for y in found), reverse=True)


def test_a_zip_across_a_dart_is_as_long_on_both_sides() -> None:
    corners = points((0, 0), (0.25, 0), (0.25, 0.38), (0.12, 0.40), (0.25, 0.42), (0.25, 0.5), (0, 0.5), (0, 0))
    named = ("hem", "side left", "bust dart.left", "bust dart.right", "side left 2", "waist", "centre")
    front = Piece(
        name="front", darts=[Dart(name="bust dart", left="bust dart.left", right="bust dart.right")],
        edges=[
            Edge(name=name, points=corners[k : k + 2], kind="dart" if "dart" in name else "seam") for k, name in enumerate(named)
        ],
    )  # fmt: skip
    low = points((0, 0), (0.25, 0), (0.25, 0.46), (0, 0.46), (0, 0))
    back = Piece(
        name="back",
        edges=[
            Edge(name=name, points=low[k : k + 2]) for k, name in enumerate(("hem", "centre", "waist", "side left"))
        ],
    )
    rows = (*side("front", "side left"), *side("front", "side left 2")), side("back", "side left", up=False)
    pattern = Pattern(name="t", pieces={"": [front, back]}, seams=[Seam(name="side left", sides=rows)])
    whole = OpeningPart(seam="side left", piece="front", vertices=np.arange(2), before=0.0, whole=0.46)
    opened = mark_openings(pattern, [OpeningTable(kind="zip", seam="side left", length_mm=300)], {"": [[whole]]})
    (first, last), (second, end) = heights(opened.piece("front", ""), "invisible zip")
    assert (first, last, second) == pytest.approx((0.5, 0.42, 0.38))
    assert first - last + second - end == pytest.approx(0.3)
    assert heights(opened.piece("back", ""), "invisible zip") == [pytest.approx((0.46, 0.16))]


def test_a_band_that_is_cut_off_takes_its_part_of_the_zip_and_of_the_fly() -> None:
    trousers = [panel(name, left="centre front") for name in ("front_left", "front_right")]
    rows = side("front_left", "centre front", up=False), side("front_right", "centre front")
    zipped = Seam(name="centre front", sides=rows, openings=(SeamOpening(kind="zip", length=0.2, style="lapped"),))
    pattern = Pattern(name="t", pieces={"": trousers}, seams=[zipped])
    reach = {}
    for shorter in (0, 50):
        band = FinishingTable(kind="waistband", edge="waist", width_mm=50, overlap_mm=40, shorten_mm=shorter)
        finished = finish_edges(pattern, [band], gaps=["centre front"])
        (opening,) = next(seam for seam in finished.seams if seam.name == "centre front").openings
        assert opening.begin == pytest.approx(-1e-3 * shorter)
        reach[shorter] = with_flies(finished).piece("fly_facing", "").outline[:, 1].min()
    # Both end 20 mm below the zip.
    assert reach == pytest.approx({0: 0.28, 50: 0.28})


@pytest.mark.parametrize("facing", ["", "separate"])
def test_a_pocket_is_placed_from_the_centre_line_and_not_from_the_button_stand(facing: str) -> None:
    mirrored = (SeamSide(piece="front", edge="centre front", mirrored=True),)
    pattern = Pattern(
        name="t", pieces={"": [panel("front", left="centre front", bust=points((0.0, 0.4), (0.3, 0.4)))]},
        seams=[Seam(name="centre front", sides=(side("front", "centre front"), mirrored))],
    )  # fmt: skip
    if facing:
        buttons = OpeningTable(kind="buttons", seam="centre front", length_mm=500, facing=facing)
        whole = OpeningPart(seam="centre front", piece="front", vertices=np.arange(2), before=0.0, whole=0.5)
        pattern = mark_openings(pattern, [buttons], {"": [[whole]]})
    pocket = PocketTable(
        kind="patch", piece="front", line="bust", width_mm=100, height_mm=110, below_mm=20, from_centre_mm=70
    )
    marks = add_pockets(pattern, [pocket]).piece("front", "").marks
    corners = [mark[0] for name, mark in marks.items() if name.startswith("pocket corner")]
    assert min(corners) == pytest.approx(0.07)


@pytest.mark.parametrize(("length_mm", "open_below"), [(None, 0.5), (700, 0.2)])
def test_buttons_go_on_below_a_seam_as_above_it(length_mm: float | None, open_below: float) -> None:
    """They are evenly spaced through bodice and skirt, and what of the skirt they do not open stays sewn."""
    bodice, skirt = (
        panel("bodice", left="centre front", bust=points((0.0, 0.2), (0.3, 0.2))),
        panel("skirt", left="centre front"),
    )
    halves = [(piece.name, SeamSide(piece=piece.name, edge="centre front")) for piece in (bodice, skirt)]
    seams = [Seam(name=name, sides=((half,), (replace(half, mirrored=True),))) for name, half in halves]
    pattern = Pattern(name="t", pieces={"": [bodice, skirt]}, seams=seams)
    parts = [
        OpeningPart(seam=name, piece=name, vertices=np.arange(2), before=before, whole=0.5)
        for (name, _), before in zip(halves, (0.0, 0.5), strict=True)
    ]
    buttons = OpeningTable(kind="buttons", seam="centre front", length_mm=length_mm)
    opened = mark_openings(pattern, [buttons], {"": [parts]})
    depths = sorted(
        before + 0.5 - float(mark[1])
        for (name, _), before in zip(halves, (0.0, 0.5), strict=True)
        for mark in opened.piece(name, "").marks.values()
    )
    assert np.ptp(np.diff(depths)) < 1e-9
    assert min(abs(depth - 0.3) for depth in depths) < 1e-9
    stand = opened.piece("skirt", "").edge("centre front button stand")
    assert stand.length == pytest.approx(open_below)
    assert {seam.name for seam in opened.seams} == ({"skirt"} if length_mm else set())


def test_a_placket_too_short_for_two_buttons_is_refused() -> None:
    pattern = Pattern(name="t", pieces={"": [panel("front", centre_front=points((0.15, 0.0), (0.15, 0.5)))]})
    places = [("front", "waist")]
    with pytest.raises(InputError, match="a placket of 80 mm is too short for two buttons; make it 93 mm or longer"):
        with_placket(pattern, places, 0.08, "waist")
    marks = with_placket(pattern, places, 0.1, "waist")[0].piece("waist_placket", "").marks
    first, last = sorted(mark[0] for name, mark in marks.items() if name.startswith("button"))
    assert last - first >= 0.045


def test_a_slanted_hem_without_its_edge_says_which_finishing_it_is() -> None:
    wish = FinishingTable(kind="hem", edge="hemm", shorten_mm={"side left": 100})
    with pytest.raises(InputError, match=r"finishing\[0\]: no free edge 'hemm'"):
        hem_rises(Pattern(name="t", pieces={"": [panel("front")]}), [wish])
