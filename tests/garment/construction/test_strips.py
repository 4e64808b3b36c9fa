"""Ribs, cuffs, plackets, ruffles, flounces and casings: strips drafted for the edges that they are sewn to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flat_forms import flat_form, pattern_of, whole_draft

from warpflat.app.cli.fit_lines import wearer_words
from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.garment.construction.details import FinishingTable, OpeningTable
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.garment_files import garment_files
from warpflat.garment.construction.strips import Strip, swept
from warpflat.pattern.drafting.fitting import drawn_length
from warpflat.pattern.drafting.half_pieces import halved
from warpflat.pattern.drafting.pieces import Pattern
from warpflat.pattern.drafting.sewing_order import notions, sewing_steps
from warpflat.pattern.export.pattern_files import PatternOptions

ZIP = OpeningTable(kind="zip", seam="centre back", length_mm=300)


@pytest.fixture(scope="module")
def shirt() -> Garment:
    return flat_form("shirt", ZIP)


@pytest.fixture(scope="module")
def half_skirt() -> Garment:
    return flat_form("skirt", half=True)


def lengths(pattern: Pattern) -> Mapping[str, tuple[float, float]]:
    """Lengths of both sides of every seam [mm], all of which match."""
    return {seam.name: seam.length_mm for seam in whole_draft(pattern).seams}


@pytest.mark.parametrize("turn", [-1.2, -0.2, 0.3])
@pytest.mark.parametrize("even", [True, False])
def test_curved_strip_has_the_length_of_its_edge_and_its_outer_edge_follows_from_the_turn(turn: float, even: bool):
    lower, upper = swept(Strip(length=0.4, height=0.04, turn=turn, even=even))
    assert drawn_length(lower) == pytest.approx(0.4, abs=2e-5)
    assert polyline_length(upper) == pytest.approx(0.4 - 2.0 * turn * 0.04, rel=1e-3)
    assert np.linalg.norm(upper - lower, axis=1) == pytest.approx(0.04)


def test_rib_takes_the_place_of_a_strip_along_the_hem(shirt: Garment):
    plain = pattern_of(shirt)
    rib = FinishingTable(kind="band", edge="hip", width_mm=60, share=0.85, shorten_mm=60)
    pattern = pattern_of(shirt, rib)
    side = ("front", "side left")
    assert plain.piece(side[0], "").edge(side[1]).length - pattern.piece(side[0], "").edge(side[1]).length == (
        pytest.approx(0.06)
    )
    found = lengths(pattern)
    assert found["hip band"][0] == pytest.approx(0.85 * found["hip band"][1], abs=0.1)
    # The zip opens the neck, and not the hem: the rib is a ring.
    assert "hip band ends" in found
    assert pattern.piece("front", "").edge("hip").kind == "seam"
    assert plain.piece("front", "").edge("hip").kind == "hem"


def test_a_rib_is_in_girths_rings_and_seams(shirt: Garment, tmp_path: Path):
    """As on paper: without it the hip and the way through it were those of the cloth, and the side ran to its lower edge."""
    rib = FinishingTable(kind="band", edge="hip", width_mm=60, share=0.85, shorten_mm=60)
    garment, options = replace(shirt, finishing=(rib,)), PatternOptions(formats=("json",))
    plain, drawn = (garment_files({"": each}, tmp_path, name="s", options=options).metrics for each in (shirt, garment))
    band = 1e-3 * lengths(pattern_of(shirt, rib))["hip band"][0]
    assert drawn["girths"]["hip"]["pattern_m"] == pytest.approx(band, abs=1e-4)
    assert "ease_wanted_m" not in drawn["girths"]["hip"]
    assert drawn["girths"]["bust"] == plain["girths"]["bust"]
    before, after = ({ring["name"]: ring for ring in each["rings"]} for each in (plain, drawn))
    assert after["hip"]["length_mm"] == pytest.approx(1e3 * band, abs=0.1)
    share = after["hip"]["length_mm"] / before["hip"]["length_mm"]
    assert after["hip"]["stretched_mm"] == pytest.approx(share * before["hip"]["stretched_mm"])
    assert after["neck"] == before["neck"]
    # What is said of the wearer is the same ease: at the hip that of the rib, which is shorter than the way around the hip.
    wear = shirt.metrics()["wear"]
    told, drawn_in = (wearer_words(wear["wearer"], girths) for girths in (plain["girths"], drawn["girths"]))
    ease, of_cloth = (f"hip {100 * each['girths']['hip']['ease_m']:+.1f} cm" for each in (drawn, plain))
    assert of_cloth in told
    assert f"stretched at {ease} (" in drawn_in
    for name, cut in (("side left", 60.0), ("shoulder left", 0.0)):
        was, now = (next(seam for seam in each["seams"] if seam["name"] == name) for each in (plain, drawn))
        assert np.subtract(was["length_mm"], now["length_mm"]) == pytest.approx([cut, cut], abs=0.5)


def test_cuff_is_buttoned_behind_where_the_sleeve_is_slit(shirt: Garment):
    cuff = FinishingTable(
        kind="cuff", edge="wrist", width_mm=60, share=0.8, overlap_mm=25, shorten_mm=50, placket_mm=110
    )
    pattern = pattern_of(shirt, cuff)
    piece = pattern.piece("cuff", "")
    assert piece.quantity == 2
    assert "button" in piece.marks
    # One cuff goes around the whole wrist, from the slit to the slit.
    seam = next(each for each in pattern.seams if each.name == "cuff")
    assert [side.edge for side in seam.sides[1]] == ["wrist left 2", "wrist left"]
    assert "cuff ends" not in {each.name for each in pattern.seams}
    found = lengths(pattern)
    assert found["cuff"][0] == pytest.approx(0.8 * found["cuff"][1], abs=0.1)
    # The slit lies on the side of the sleeve that is sewn to the back.
    sleeve = pattern.piece("sleeve_left", "")
    slit = sleeve.internal_lines["slit 110 mm"][0]
    armhole = next(each for each in pattern.seams if each.name == "armhole left")
    cap = sleeve.edge(armhole.sides[1][0].edge).points
    if armhole.sides[1][0].reversed:
        cap = cap[::-1]
    begins_behind = armhole.sides[0][0].piece.startswith("back")
    back, front = (cap[0], cap[-1]) if begins_behind else (cap[-1], cap[0])
    assert np.linalg.norm(slit - back) < np.linalg.norm(slit - front)
    binding = pattern.piece("sleeve_placket", "")
    assert binding.quantity == 2
    assert binding.edge("lower").length > 0.22
    steps = [step.words for step in sewing_steps(whole_draft(pattern), "")]
    assert any("slits" in step for step in steps)
    assert any("buttonhole at one end" in step and "cuff" in step for step in steps)
    assert "2 small buttons" in notions(sewing_steps(whole_draft(pattern), ""))
    with pytest.raises(InputError, match="does not lie within the piece"):
        pattern_of(shirt, cuff.model_copy(update={"placket_mm": 900}))


def test_ruffle_is_gathered_itself(shirt: Garment):
    pattern = pattern_of(shirt, FinishingTable(kind="ruffle", edge="hip", width_mm=100, share=2.2))
    found = lengths(pattern)["hip ruffle"]
    assert found[1] == pytest.approx(2.2 * found[0], abs=0.1)
    assert pattern.piece("hip_ruffle", "").edge("upper").kind == "hem"
    assert any("gather the hip ruffle" in step.words for step in sewing_steps(whole_draft(pattern), ""))


@pytest.mark.parametrize("turns", [0.5, 1.0])
def test_flounce_has_a_panel_for_each_piece_and_the_hem_of_a_ring(half_skirt: Garment, turns: float):
    pattern = pattern_of(half_skirt, FinishingTable(kind="flounce", edge="knee", width_mm=200, turns=turns))
    found = lengths(pattern)
    assert {"front knee flounce", "back knee flounce", "side left of the flounce"} <= set(found)
    panels = [piece for piece in pattern.pieces[""] if piece.name.endswith("flounce")]
    assert len(panels) == 2
    assert all(piece.on_fold for piece in panels)
    inner = 2.0 * sum(piece.edge("knee").length for piece in panels)
    hem = 2.0 * sum(piece.edge("hem").length for piece in panels)
    assert hem - inner == pytest.approx(2.0 * np.pi * turns * 0.2, rel=1e-3)
    with pytest.raises(InputError, match="take fewer turns"):
        pattern_of(half_skirt, FinishingTable(kind="flounce", edge="knee", width_mm=200, turns=2.5))


def test_casing_is_turned_in_and_has_an_elastic_of_the_body(half_skirt: Garment):
    pattern = pattern_of(half_skirt, FinishingTable(kind="casing", edge="waist", width_mm=30, elastic=0.9))
    edge = pattern.piece("front", "").edge("waist")
    assert (edge.kind, edge.width) == ("hem", pytest.approx(0.04))
    assert half_skirt.mannequin is not None
    girth = half_skirt.mannequin.levels()["waist"].girth
    assert pattern.elastics[0].lengths[""] == pytest.approx(0.9 * girth)
    drafted = whole_draft(pattern)
    assert any("thread elastic" in step.words for step in sewing_steps(drafted, ""))
    assert any("elastic" in notion for notion in notions(sewing_steps(drafted, "")))
    with pytest.raises(InputError, match="no free edge 'hip'"):
        pattern_of(half_skirt, FinishingTable(kind="casing", edge="hip", width_mm=30, elastic=0.9))


def test_pleats_of_a_ruffle_lie_beside_each_other(half_skirt: Garment):
    wish = FinishingTable(kind="ruffle", edge="knee", width_mm=200, share=3.0, pleat_mm=50)
    pattern = pattern_of(half_skirt, wish)
    ruffle = pattern.piece("knee_ruffle", "")
    whole = ruffle.edge("lower").length
    folds = sorted(line[0, 0] for name, line in ruffle.internal_lines.items() if name.startswith("pleat fold"))
    ends = sorted(line[0, 0] for name, line in ruffle.internal_lines.items() if name.startswith("pleat lies"))
    count, stretch = round(whole / 3.0 / 0.05), 3.0 * 0.05 * whole / 3.0 / 0.05 / round(whole / 3.0 / 0.05)
    assert len(folds) == len(ends) == count
    assert np.diff(folds) == pytest.approx(stretch)
    # A third of each stays visible, and the strip begins and ends in the inner fold of a pleat.
    assert np.array(folds) - ends == pytest.approx(stretch / 3.0)
    assert ends[0] == pytest.approx(stretch / 3.0) == pytest.approx(whole - folds[-1])
    assert "Lay the pleats" in " ".join(step.words for step in sewing_steps(whole_draft(pattern), ""))
    lengths(pattern)


@pytest.mark.parametrize(("cloth", "count"), [(1.4, 3), (0.9, 4), (4.0, 1)])
def test_strip_that_is_wider_than_the_cloth_is_cut_as_equal_panels(shirt: Garment, cloth: float, count: int):
    wish = FinishingTable(kind="ruffle", edge="hip", width_mm=200, share=3.0, pleat_mm=40)
    pattern = pattern_of(shirt, wish, cloth_width=cloth)
    panel = pattern.piece("hip_ruffle", "")
    assert panel.quantity == count
    assert np.ptp(panel.outline[:, 0]) + 2.0 * panel.edge("right end").width <= cloth
    found = lengths(pattern)
    assert found["hip ruffle"][1] == pytest.approx(count * 1000 * panel.edge("lower").length, abs=0.1)
    joints = [seam for seam in pattern.seams if seam.name.startswith("hip ruffle ends")]
    assert len(joints) == count
    # All are sewn alike, and where they lie along the edge is marked there, not on the panel.
    drafted = whole_draft(pattern)
    own = [
        notch
        for notch in next(piece for piece in drafted.pieces[""] if piece.name == "hip_ruffle").notches
        if notch.edge == "lower"
    ]
    # Places along it are the same before and after pleating where a pleat ends, and its notches meet those of the edge.
    pleats = sum(name.startswith("pleat fold") for name in panel.internal_lines)
    stretch = panel.edge("lower").length / pleats
    assert all(notch.length / stretch == pytest.approx(round(notch.length / stretch), abs=0.01) for notch in own)
    apart = next(seam for seam in drafted.seams if seam.name == "hip ruffle").notches_mm
    assert apart == pytest.approx(0.0, abs=0.1) if own else apart is None or apart <= 0.2
    steps = [step.words for step in sewing_steps(drafted, "")]
    order = [
        next(k for k, step in enumerate(steps) if text in step and "hip ruffle" in step)
        for text in ("Join the", "Hem the free edges", "Lay the pleats", "Sew the ruffles on")
    ]
    assert order == sorted(order)
    # Its pleats all turn one way, so that it is no half on the fold.
    assert not any(piece.piece.on_fold for piece in halved(drafted).pieces[""] if piece.name == "hip_ruffle")


def test_flounce_that_is_wider_than_the_cloth_is_cut_as_equal_panels(shirt: Garment):
    wish = FinishingTable(kind="flounce", edge="hip", width_mm=600, turns=1.0)
    pattern = pattern_of(shirt, wish, cloth_width=1.15)
    panels = [piece for piece in pattern.pieces[""] if "flounce" in piece.name]
    assert max(piece.quantity for piece in panels) > 1
    assert all(np.ptp(piece.outline[:, 0]) < 1.15 for piece in panels)
    lengths(pattern)
    whole = sum(piece.quantity * (piece.edge("hem").length - piece.edge("hip").length) for piece in panels)
    assert whole == pytest.approx(2.0 * np.pi * 0.6, rel=1e-3)
    # Every end of every panel is sewn once.
    ends = [
        (side.piece, side.edge, side.copy, side.mirrored)
        for seam in pattern.seams
        for side in seam.stretches
        if "flounce" in side.piece and side.edge != "hip"
    ]
    assert len(ends) == len(set(ends)) == 2 * sum(piece.quantity for piece in panels)


def test_no_sleeve_is_drawn_below_a_band_that_is_sewn_on_much_higher(shirt: Garment):
    views = [
        pattern_of(shirt, FinishingTable(kind="band", edge="wrist", width_mm=50, shorten_mm=mm)).worn.views
        for mm in (50.0, 250.0)
    ]
    for name in ("front", "back"):
        # Arms hang away from the body: the sleeve's end is the farthest from its middle.
        far = [max(float(np.abs(ring[:, 0]).max()) for piece in row[name] for ring in piece.outlines) for row in views]
        assert far[0] - far[1] > 0.08
