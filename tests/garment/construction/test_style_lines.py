"""Godets, wraps and slanted hems: pieces that run beyond a line, wedges in seams, edges that are cut along another line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import body_of_size
from flat_forms import pattern_of, whole_draft

from warpflat.core.errors import InputError
from warpflat.garment.construction.constraints import straight_stands
from warpflat.garment.construction.details import FinishingTable, OpeningTable
from warpflat.garment.construction.finishing import finish_edges
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.openings import part_at_centres
from warpflat.garment.mannequin.forms import Form, PieceRecipe, shipped_form
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.sewing_order import sewing_steps

WRAP = OpeningTable(kind="wrap", seam="centre front", width_mm=90, tie_mm=800)
GODETS = [OpeningTable(kind="godet", seam=f"side {side}", length_mm=200, width_mm=250) for side in ("left", "right")]


@pytest.fixture(scope="module")
def mannequin() -> Mannequin:
    return body_of_size(30.0)


def flattened(mannequin: Mannequin, form: Form, *openings: OpeningTable) -> Garment:
    built = mannequin.form(part_at_centres(mannequin.layout, form, openings))
    made = flatten_form(mannequin, built, fabric="denim", curves_mm=0.0, constraints=straight_stands(built, openings))
    return replace(made, openings=openings)


@pytest.fixture(scope="module")
def skirt(mannequin: Mannequin) -> Garment:
    return flattened(mannequin, shipped_form("a_line_skirt"))


@pytest.fixture(scope="module")
def wrapped(mannequin: Mannequin) -> Garment:
    """A bodice and a skirt, both wrapped."""
    pieces = {
        f"{face}_{part}": PieceRecipe(bricks=(f"{band}/{face}-*",), datum=f"centre {face}")
        for part, band in (("bodice", "shoulder-waist"), ("skirt", "waist-knee"))
        for face in ("front", "back")
    }
    return flattened(mannequin, Form(name="dress", pieces=pieces, ruled=(("hip", "knee"),)), WRAP)


def test_godet_is_a_wedge_between_the_lower_ends_of_a_seam(skirt: Garment):
    pattern = pattern_of(skirt, openings=GODETS)
    (wedge,) = (piece for piece in pattern.pieces[""] if piece.name.startswith("godet"))
    assert wedge.quantity == 2
    assert [edge.name for edge in wedge.edges] == ["left", "knee", "right"]
    assert wedge.edge("left").length == pytest.approx(0.2)
    assert wedge.edge("knee").length == pytest.approx(0.25, rel=1e-3)
    assert (wedge.edge("knee").kind, wedge.edge("left").kind) == ("hem", "seam")
    joined = [seam for seam in pattern.seams if "godet" in seam.name]
    assert len(joined) == 4
    assert {side.copy for seam in joined for side in seam.sides[1]} == {0, 1}
    whole_draft(pattern)


def test_godets_left_edge_is_sewn_to_the_piece_on_its_left(skirt: Garment):
    """At the left side of the body the front, seen from outside, lies to the left of the back."""
    pattern = pattern_of(skirt, openings=(GODETS[0],))
    joined = {seam.sides[0][0].piece: seam.sides[1][0].edge for seam in pattern.seams if "godet" in seam.name}
    points = {name: pattern.piece(name, "").edge("side left godet").points for name in joined}
    up = {name: line[-1, 1] > line[0, 1] for name, line in points.items()}
    assert {name: "left" if up[name] else "right" for name in joined} == joined
    assert set(joined.values()) == {"left", "right"}


def test_ruffle_goes_along_the_godet_too(skirt: Garment):
    ruffle = FinishingTable(kind="ruffle", edge="knee", width_mm=100, share=1.5)
    made = [replace(skirt, openings=openings, finishing=(ruffle,)) for openings in ((), tuple(GODETS))]
    strips = [pattern_of(each).piece("knee_ruffle", "") for each in made]
    lengths = [strip.quantity * strip.edge("lower").length for strip in strips]
    assert lengths[1] - lengths[0] == pytest.approx(2 * 1.5 * 0.25, rel=1e-2)


def test_slanted_hem_cuts_godets_too(skirt: Garment):
    wish = slanted({"side left": 100, "side right": 0})
    pattern = pattern_of(skirt, wish, openings=GODETS)
    wedges = [piece for piece in pattern.pieces[""] if piece.name.startswith("godet")]
    assert sorted(round(piece.edge("left").length, 2) for piece in wedges) == [0.1, 0.2]
    whole_draft(pattern)


def test_seam_has_one_opening_at_its_lower_end(skirt: Garment):
    slit = GODETS[0].model_copy(update={"kind": "slit", "width_mm": 15})
    with pytest.raises(InputError, match=r"openings\[1\]: the lower end of 'side left' is open already"):
        pattern_of(skirt, openings=(slit, GODETS[0]))


def test_godet_needs_a_hem(wrapped: Garment):
    godet = OpeningTable(kind="godet", seam="bodice side left", length_mm=100, width_mm=100)
    with pytest.raises(
        InputError, match="a godet runs out into a hem; 'bodice side left' ends at 'waist', which is sewn"
    ):
        pattern_of(wrapped, openings=(WRAP, godet))


def test_half_on_the_fold_has_no_hem_that_slants_to_one_side(mannequin: Mannequin):
    form = mannequin.form(shipped_form("a_line_skirt"), half=True)
    garment = flatten_form(mannequin, form, fabric="denim", curves_mm=0.0)
    with pytest.raises(InputError, match="cannot be shorter on one side"):
        pattern_of(garment, slanted({"side left": 200, "side right": 0}))
    cut = pattern_of(garment, slanted({"side": 100, "centre front": 0}))
    whole_draft(cut)


def test_wrap_lies_over_the_other_half(wrapped: Garment):
    pattern = pattern_of(wrapped)
    bodice, skirt = (pattern.piece(f"front_{part}_left", "") for part in ("bodice", "skirt"))
    assert bodice.quantity == skirt.quantity == 2
    assert "centre front" not in {seam.name for seam in pattern.seams}
    assert skirt.edge("wrap edge").kind == "hem"
    # The neckline is straight, from the shoulder to where the skirt's wrap begins.
    assert len(bodice.edge("neck").points) == 2
    assert "wrap edge" not in {edge.name for edge in bodice.edges}
    before = wrapped.pieces["front_skirt_left"].positions[wrapped.form.pieces["front_skirt_left"].edges["waist"]]
    assert skirt.edge("waist").length == pytest.approx(
        np.linalg.norm(np.diff(before, axis=0), axis=1).sum() + 0.09, abs=1e-4
    )
    assert pattern.piece("tie", "").quantity == 2
    assert "tie" in skirt.marks
    whole_draft(pattern)
    words = " ".join(step.words for step in sewing_steps(draft_garment(pattern), ""))
    assert "tie" in words
    assert all(ring.passes is not False for ring in wrapped.rings)


def test_wrapped_neckline_is_bound_from_one_side_to_the_other(wrapped: Garment):
    bound = finish_edges(pattern_of(wrapped), [FinishingTable(kind="binding", edge="neck", width_mm=35)])
    assert bound.piece("neck_binding", "").quantity == 1
    seam = next(seam for seam in bound.seams if seam.name == "neck binding")
    assert len(seam.sides[1]) == 3
    whole_draft(bound)


def test_wrap_that_is_too_wide_is_named(wrapped: Garment):
    with pytest.raises(InputError, match=r"too short for a wrap of 300 mm"):
        pattern_of(replace(wrapped, openings=(WRAP.model_copy(update={"width_mm": 300}),)))


def slanted(rises_mm: dict[str, float], kind: str = "hem", **more: object) -> FinishingTable:
    return FinishingTable(kind=kind, edge="knee", shorten_mm=rises_mm, **more)  # type: ignore[arg-type]


def test_slanted_hem_is_higher_on_one_side(skirt: Garment):
    wish = slanted({"side left": 200, "side right": 0})
    pattern = pattern_of(skirt)
    cut = finish_edges(pattern, [wish])
    for name in ("front", "back"):
        lost = {
            side: pattern.piece(name, "").edge(f"side {side}").length - cut.piece(name, "").edge(f"side {side}").length
            for side in ("left", "right")
        }
        assert lost["left"] == pytest.approx(0.2, abs=2e-4)
        assert lost["right"] == pytest.approx(0.0, abs=2e-4)
        assert cut.piece(name, "").edge("knee").kind == "hem"
    whole_draft(cut)
    assert wish.is_one_sided
    assert not slanted({"side left": 200, "side right": 200}).is_one_sided


def test_hem_that_is_higher_in_front_has_no_corner_there(skirt: Garment):
    cut = finish_edges(pattern_of(skirt), [slanted({"centre front": 150, "centre back": 0})])
    knee = cut.piece("front", "").edge("knee").points
    top = int(knee[:, 1].argmax())
    assert 0 < top < len(knee) - 1
    ahead, behind = knee[top + 1] - knee[top], knee[top] - knee[top - 1]
    assert ahead @ behind / np.linalg.norm(ahead) / np.linalg.norm(behind) > 0.999
    whole_draft(cut)


def test_ruffle_takes_the_place_of_what_a_slanted_hem_loses(skirt: Garment):
    rises = {"side left": 200, "side right": 50}
    sewn = finish_edges(pattern_of(skirt), [slanted(rises, "ruffle", width_mm=50, share=1.5)])
    ruffle = sewn.piece("knee_ruffle", "")
    assert ruffle.quantity * ruffle.edge("lower").length > 1.4
    whole_draft(sewn)


def test_a_slanted_hem_keeps_the_mark_of_the_tie_on_the_outline(wrapped: Garment):
    cut = finish_edges(pattern_of(wrapped), [slanted({"side": 100, "centre back": 0})])
    assert "tie" in cut.piece("front_skirt_left", "").marks


def test_line_that_meets_no_hem_is_named(skirt: Garment):
    with pytest.raises(InputError, match="no line 'cuff' meets 'knee'"):
        finish_edges(pattern_of(skirt), [slanted({"cuff": 100})])
    with pytest.raises(InputError, match="are shorter than 700 mm"):
        finish_edges(pattern_of(skirt), [slanted({"side left": 700})])


def test_line_drawing_shows_the_slanted_hem(skirt: Garment):
    worn = pattern_of(skirt, slanted({"side left": 200, "side right": 0})).worn
    assert worn is not None
    for side, sign in (("front", 1.0), ("back", -1.0)):
        points = np.concatenate([ring for piece in worn.views[side] for ring in piece.outlines])
        # The body's left is at positive x in front, and at negative x behind.
        left, right = (points[sign * turn * points[:, 0] > 0.15] for turn in (1.0, -1.0))
        assert left[:, 1].min() - right[:, 1].min() > 0.13
