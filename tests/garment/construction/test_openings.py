"""Openings along the seams of a form: parted pieces, rings, notches, edges of slits and vents."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import body_of_size
from flat_forms import pattern_of, whole_draft

from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.garment.construction import openings
from warpflat.garment.construction.details import OpeningTable
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.openings import one_sided, part_at_centres, sewn_centres
from warpflat.garment.construction.rings import find_rings
from warpflat.garment.construction.to_pattern import pattern_of_garment
from warpflat.garment.mannequin.forms import Form, PieceRecipe, shipped_form
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.edge_rules import EdgeRules
from warpflat.pattern.drafting.pieces import Pattern, Piece
from warpflat.pattern.drafting.sewing_order import sewing_steps, sewn_seams

ZIP = OpeningTable(kind="zip", seam="centre back", length_mm=200)


@pytest.fixture(scope="module")
def mannequin() -> Mannequin:
    return body_of_size(30.0)


@pytest.fixture(scope="module")
def skirt(mannequin: Mannequin) -> Garment:
    """A skirt parted at centre back for a zip."""
    form = part_at_centres(mannequin.layout, shipped_form("a_line_skirt"), [ZIP])
    return flatten_form(mannequin, mannequin.form(form), fabric="denim", curves_mm=0.0)


def opened(skirt: Garment, *openings: OpeningTable) -> Pattern:
    return pattern_of(skirt, openings=openings)


def passes(garment: Garment) -> dict[str, bool | None]:
    return {ring.name: ring.passes for ring in garment.rings}


def test_zip_at_centre_back_parts_the_back_and_lets_the_waist_pass(skirt: Garment):
    assert list(skirt.pieces) == ["front", "back_left", "back_right"]
    assert not passes(skirt)["waist"]
    zipped = replace(skirt, openings=(ZIP,))
    assert passes(zipped)["waist"]
    waist = next(ring for ring in zipped.rings if ring.name == "waist")
    assert waist.opened == pytest.approx(2 * 0.20)
    # The abdomen lies some way down the zip: only the rest of it is open there.
    line = zipped.form.pieces["back_left"].surface.lines
    down = set(line["centre back"].tolist()) & set(line["abdomen"].tolist())
    edge = zipped.form.pieces["back_left"].edges["centre back"]
    flat = zipped.pieces["back_left"].positions
    top = max(edge.tolist(), key=lambda v: zipped.form.pieces["back_left"].surface.vertices[v, 1])
    (level,) = down
    depth = np.linalg.norm(flat[top] - flat[level])
    abdomen = next(ring for ring in zipped.rings if ring.name == "abdomen")
    assert abdomen.opened == pytest.approx(2 * (0.20 - depth), abs=1e-3)


def test_a_zip_in_one_side_leaves_left_and_right_one_pattern(mannequin: Mannequin):
    form = part_at_centres(
        mannequin.layout, shipped_form("a_line_skirt"), [ZIP, ZIP.model_copy(update={"seam": "centre front"})]
    )
    skirt = flatten_form(mannequin, mannequin.form(form), fabric="denim", curves_mm=0.0)
    pattern = opened(skirt, ZIP.model_copy(update={"seam": "side left"}))
    assert {p.name: p.quantity for p in pattern.pieces[""]} == {"front_left": 2, "back_left": 2}
    drafted = draft_garment(pattern)
    sides = {seam.name: seam for seam in sewn_seams(sewing_steps(drafted, "")) if seam.name.startswith("side")}
    assert [(name, bool(seam.openings)) for name, seam in sides.items()] == [("side left", True), ("side right", False)]
    # One piece of paper has one letter at its side.
    assert len({seam.letter for seam in sides.values()}) == 1
    assert max(seam.notches_mm or 0.0 for seam in drafted.seams) < 0.2
    # A slit is cut: what has it is drawn for its own side, and nothing else is.
    slit = opened(
        skirt,
        OpeningTable(kind="slit", seam="centre back", length_mm=100),
        ZIP.model_copy(update={"seam": "side left"}),
    )
    assert {p.name: p.quantity for p in slit.pieces[""]} == {"front_left": 2, "back_left": 2}
    slit = opened(skirt, OpeningTable(kind="slit", seam="side left", length_mm=100))
    assert {p.quantity for p in slit.pieces[""]} == {1}


def test_a_half_is_open_where_its_piece_was_on_its_side(mannequin: Mannequin):
    sides = ("side left", "side right")
    poncho = Form(name="poncho", pieces={"cloth": PieceRecipe(bricks=("shoulder-waist/*",), open=sides)})
    zipped = part_at_centres(mannequin.layout, poncho, [ZIP, ZIP.model_copy(update={"seam": "centre front"})])
    assert {name: piece.open for name, piece in zipped.pieces.items()} == {
        "cloth_left": ("side left",),
        "cloth_right": ("side right",),
    }
    assert {"centre front", "centre back"} <= {seam.name for seam in mannequin.form(zipped).seams}


def test_a_piece_that_goes_all_around_is_opened_at_one_centre_and_stays_one(mannequin: Mannequin):
    """It had a seam at the other centre, too, for which nobody asked."""
    tube = Form(name="tube", pieces={"cloth": PieceRecipe(bricks=("waist-knee/*",))})
    form = mannequin.form(part_at_centres(mannequin.layout, tube, [ZIP]))
    assert [seam.name for seam in form.seams] == ["centre back"]
    skirt = flatten_form(mannequin, form, fabric="denim", curves_mm=0.0)
    (cloth,) = draft_garment(opened(skirt, ZIP)).pieces[""]
    assert "invisible zip 200 mm" in cloth.internal_lines
    assert {notch.seam for notch in cloth.notches} == {"centre back"}
    # Where it buttons, each half runs beyond the line.
    buttons = OpeningTable(kind="buttons", seam="centre back")
    assert list(part_at_centres(mannequin.layout, tube, [buttons]).pieces) == ["cloth_left", "cloth_right"]


def test_halves_that_rest_a_little_apart_are_drawn_once(skirt: Garment):
    """A tenth of a millimetre over a side: what a relaxation's tolerance may leave, and more than sides of seams may differ by."""
    half = skirt.pieces["back_left"]
    longer = replace(half, positions=half.positions * [1.0, 1.0002])
    pattern = opened(replace(skirt, pieces={**skirt.pieces, "back_left": longer}), ZIP)
    assert {p.name: p.quantity for p in pattern.pieces[""]} == {"front": 1, "back_left": 2}
    edge = pattern.piece("back_left", "").edge("centre back").length
    assert polyline_length(half.positions[skirt.form.pieces["back_left"].edges["centre back"]]) < edge


def test_zip_that_ends_too_early_lets_nothing_pass(skirt: Garment):
    assert not passes(replace(skirt, openings=(ZIP.model_copy(update={"length_mm": 50}),)))["waist"]


def test_zip_has_a_notch_at_its_end_and_a_line(skirt: Garment):
    pattern = opened(skirt, ZIP)
    assert {p.name: p.quantity for p in pattern.pieces[""]} == {"front": 1, "back_left": 2}
    back = next(p for p in draft_garment(pattern).pieces[""] if p.name == "back_left")
    assert "invisible zip 200 mm" in back.internal_lines
    edge = next(e for e in back.edges if e.name == "centre back")
    high = max(edge.line[0], edge.line[-1], key=lambda p: p[1])
    away = [float(np.linalg.norm(n.at - high)) for n in back.notches if n.seam == "centre back"]
    assert min(abs(each - 0.20) for each in away) < 1e-3


def free_edge(piece: Piece, name: str) -> float:
    return polyline_length(piece.edge(name).points)


def test_slit_and_vent_are_edges_of_their_own(skirt: Garment):
    vent = OpeningTable(kind="vent", seam="centre back", length_mm=150, width_mm=40)
    slits = [OpeningTable(kind="slit", seam=f"side {side}", length_mm=100, width_mm=15) for side in ("left", "right")]
    before, after = opened(skirt), opened(skirt, ZIP, vent, *slits)
    back, plain = after.piece("back_left", ""), before.piece("back_left", "")
    assert free_edge(back, "centre back vent") == pytest.approx(0.15, abs=1e-9)
    assert free_edge(back, "centre back") == pytest.approx(free_edge(plain, "centre back") - 0.15, abs=1e-6)
    assert (back.edge("centre back vent").width, back.edge("centre back vent").kind) == (0.04, "hem")
    front = after.piece("front", "")
    for side in ("left", "right"):
        assert free_edge(front, f"side {side} slit") == pytest.approx(0.1, abs=1e-9)
        points = front.edge(f"side {side} slit").points
        assert points[:, 1].max() < front.edge(f"side {side}").points[:, 1].max() - 0.3
    whole_draft(after)


def test_opening_on_one_side_alone_keeps_both_patterns(skirt: Garment):
    one = OpeningTable(kind="slit", seam="side left", length_mm=100)
    assert one_sided([one]) == [one]
    assert not one_sided([one, one.model_copy(update={"seam": "side right"})])
    assert not one_sided([ZIP])
    assert one_sided([one, one.model_copy(update={"seam": "side right", "length_mm": 200})])
    pattern = opened(skirt, one)
    assert {p.name for p in pattern.pieces[""]} == {"front", "back_left", "back_right"}
    whole_draft(pattern)


def test_opening_that_cannot_be_is_named(skirt: Garment):
    with pytest.raises(InputError, match="no seam 'side'"):
        opened(skirt, OpeningTable(kind="zip", seam="side", length_mm=200))
    with pytest.raises(InputError, match=r"ends 900 mm along 'centre back', which is \d+ mm long"):
        opened(skirt, ZIP.model_copy(update={"length_mm": 900}))
    whole = float(
        polyline_length(skirt.pieces["back_left"].positions[skirt.form.pieces["back_left"].edges["centre back"]])
    )
    with pytest.raises(InputError, match="leaves nothing of the seam"):
        opened(skirt, OpeningTable(kind="vent", seam="centre back", length_mm=1e3 * whole - 10))


@pytest.mark.parametrize("kind", ["zip", "vent", "slit", "godet"])
def test_a_half_that_is_cut_twice_is_opened_once(mannequin: Mannequin, kind: str):
    """Its centre seam has one edge, of the piece and of its mirror image."""
    opening = OpeningTable(kind=kind, seam="centre back", length_mm=150)
    form = Form(name="x", pieces={side: PieceRecipe(bricks=(f"waist-knee/{side}-*",)) for side in ("front", "back")})
    half = flatten_form(mannequin, mannequin.form(form, half=True), sewn=False)
    rules = sewn_centres(EdgeRules(), [opening])
    pattern, _ = pattern_of_garment({"": replace(half, openings=(opening,))}, name="x", rules=rules)
    back = pattern.piece("back", "")
    assert back.quantity == 2
    if kind == "zip":
        assert [name for name in back.internal_lines if "zip" in name] == ["invisible zip 150 mm"]
    else:
        assert back.edge(f"centre back {kind}").length == pytest.approx(0.15, abs=1e-3)
    if kind == "godet":
        sewn = [seam.sides for seam in pattern.seams if seam.name.startswith("centre back godet")]
        assert [(shell.mirrored, wedge.edge) for (shell,), (wedge,) in sewn] == [(False, "left"), (True, "right")]


def test_two_rings_at_one_line_are_opened_each_by_its_own(mannequin: Mannequin, skirt: Garment, monkeypatch):
    found = find_rings(mannequin, skirt.form, skirt.positions)
    waist, length = found["waist"]
    shorter = waist[:0], 0.5 * length
    monkeypatch.setattr(openings, "find_rings", lambda *_: {"waist": (waist, length), "waist 2": shorter})
    more = openings.opened_rings(mannequin, skirt.form, skirt.positions, [ZIP], [])
    assert more["waist"] == pytest.approx(0.4)
    assert more.get("waist 2", 0.0) == 0.0
