"""Pockets, and waistbands that are cut from the upper strip of a skirt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from flat_forms import whole_draft

from warpflat.core.errors import InputError
from warpflat.garment.construction.details import PocketTable
from warpflat.garment.construction.pockets import add_pockets
from warpflat.garment.construction.shaped_band import with_shaped_waistband
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.piece_parts import Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamOpening, SeamSide
from warpflat.pattern.drafting.sewing_order import sewing_steps, sewn_seams

PATCH = PocketTable(
    kind="patch", piece="front", width_mm=120, height_mm=140, line="hip", below_mm=20, from_centre_mm=50
)
BAGS = PocketTable(kind="inseam", seam="side left", width_mm=150, height_mm=160, below_mm=60)


def skirt() -> Pattern:
    """A flared skirt of two equal pieces with a curved waist."""
    across = np.linspace(0.18, -0.18, 21)
    waist = np.column_stack([across, 0.6 - 0.03 * np.cos(np.pi * across / 0.36)])
    hem = np.array([[-0.30, 0.0], [0.30, 0.0]])
    sides = {
        "hem": hem,
        "side left": np.array([hem[1], waist[0]]),
        "waist": waist,
        "side right": np.array([waist[-1], hem[0]]),
    }
    lines = {"hip": np.array([[-0.2, 0.4], [0.2, 0.4]]), "centre front": np.array([[0.0, 0.0], [0.0, 0.57]])}
    edges = [Edge(name=name, points=points, kind="hem" if name == "hem" else "seam") for name, points in sides.items()]
    pieces = [Piece(name=name, edges=edges, internal_lines=lines) for name in ("front", "back")]
    seams = [
        Seam(
            name=name,
            sides=((SeamSide(piece="front", edge=name),), (SeamSide(piece="back", edge=name),)),
            notches=(0.25,) if name == "side left" else None,
        )
        for name in ("side left", "side right")
    ]
    return Pattern(name="skirt", pieces={"": pieces}, seams=seams)


def test_a_patch_becomes_smaller_on_a_short_line_as_a_whole():
    """The line is 400 mm long, of which a fifth is 80: two thirds of the width that is asked for, and of the other lengths."""
    pattern = add_pockets(skirt(), [PATCH.model_copy(update={"most_share": 0.2})])
    front, patch = pattern.piece("front", ""), pattern.piece("front_pocket", "")
    assert np.ptp(patch.outline[:, 0]) == pytest.approx(0.08)
    assert patch.edge("left side").length == pytest.approx(0.14 * 2 / 3)
    marks = np.array([at for name, at in front.marks.items() if name.startswith("pocket corner")])
    ends = [0.05 * 2 / 3, 0.05 * 2 / 3 + 0.08]
    assert sorted(np.abs(marks[:, 0])) == pytest.approx(sorted([*ends, *ends]))
    assert marks[:, 1] == pytest.approx(0.4 - 0.02 * 2 / 3)
    # On a line that is long enough nothing changes.
    assert np.ptp(
        add_pockets(skirt(), [PATCH.model_copy(update={"most_share": 0.4})]).piece("front_pocket", "").outline[:, 0]
    ) == (pytest.approx(0.12))


def test_patch_lies_below_its_line_on_both_sides_of_the_centre():
    pattern = add_pockets(skirt(), [PATCH])
    front, patch = pattern.piece("front", ""), pattern.piece("front_pocket", "")
    marks = np.array([at for name, at in front.marks.items() if name.startswith("pocket corner")])
    assert sorted(map(tuple, marks.round(6).tolist())) == [(-0.17, 0.38), (-0.05, 0.38), (0.05, 0.38), (0.17, 0.38)]
    sides = [line for name, line in front.internal_lines.items() if name.startswith("pocket")]
    # All but the upper edge, where the hand goes in, on both sides.
    around = shapely.LinearRing(patch.outline).length - 0.12
    assert sum(np.linalg.norm(side[1] - side[0]) for side in sides) == pytest.approx(2 * around)
    assert (patch.quantity, patch.edge("upper").kind) == (2, "hem")
    with pytest.raises(InputError, match=r"pockets\[0\]: a pocket 120 by 140 mm does not lie on 'front' there"):
        add_pockets(
            skirt(),
            [PocketTable(kind="patch", piece="front", width_mm=120, height_mm=140, line="hip", from_centre_mm=300)],
        )


def test_opening_of_bags_is_notched_on_both_sides_of_the_seam():
    pattern = add_pockets(skirt(), [BAGS])
    assert pattern.piece("pocket_bag", "").quantity == 4
    drafted = draft_garment(pattern)
    for piece in (p for p in drafted.pieces[""] if p.name in ("front", "back")):
        edge = piece.edge("side left").line
        top = edge[edge[:, 1].argmax()]
        away = [float(np.linalg.norm(notch.at - top)) for notch in piece.notches if notch.seam == "side left"]
        for wanted in (0.06, 0.22):
            assert min(abs(each - wanted) for each in away) < 1e-4
    assert all(seam.matches for seam in drafted.seams)
    # The side is sewn after the bags are set in, and not across their opening.
    (bags,) = [step.words for step in sewing_steps(drafted, "") if step.technique == "inseam_bag"]
    assert "there the seam stays open" in bags
    # Two of the four bags are one pocket.
    assert [seam.count for seam in sewn_seams(sewing_steps(drafted, "")) if seam.name == "pocket bag"] == [2]
    with pytest.raises(InputError, match=r"ends 800 mm along 'side left'"):
        add_pockets(skirt(), [PocketTable(kind="inseam", seam="side left", width_mm=150, height_mm=400, below_mm=400)])


@pytest.mark.parametrize("zipped", ["side left", "side right"])
def test_pocket_in_a_seam_is_clear_of_its_zip(zipped: str):
    seams = [
        replace(seam, openings=(SeamOpening(kind="zip", length=0.2),)) if seam.name == zipped else seam
        for seam in skirt().seams
    ]
    pattern = replace(skirt(), seams=seams)
    with pytest.raises(InputError, match=f"from 60 to 220 mm along '{zipped}' meets the zip there, from 0 to 200 mm"):
        add_pockets(pattern, [BAGS])
    with pytest.raises(InputError, match=f"from 0 to 140 mm along '{zipped}' meets the zip"):
        add_pockets(pattern, [PocketTable(kind="hip", seam="side left", width_mm=50, height_mm=140)])
    below = add_pockets(pattern, [BAGS.model_copy(update={"below_mm": 225.0})])
    assert "pocket_bag" in {piece.name for piece in below.pieces[""]}


def test_shaped_waistband_and_skirt_are_the_skirt_before():
    before = skirt()
    pattern = with_shaped_waistband(before, [("front", "waist"), ("back", "waist")], 0.04, gaps=["side left"])
    rest, band = pattern.piece("front", ""), pattern.piece("front_waistband", "")
    areas = [shapely.Polygon(piece.outline).area for piece in (rest, band, before.piece("front", ""))]
    assert areas[0] + areas[1] == pytest.approx(areas[2])
    assert band.quantity == 2
    assert band.edge("waist").length == pytest.approx(before.piece("front", "").edge("waist").length)
    names = {seam.name for seam in pattern.seams}
    assert {"front waistband", "side right of the waistband"} <= names
    assert "side left of the waistband" not in names
    drafted = whole_draft(pattern)
    # The notch of the side seam stays where it was on the cloth.
    whole = before.piece("front", "").edge("side left").length
    notch = next(n for n in drafted.pieces[""][0].notches if n.seam == "side left")
    assert notch.length == pytest.approx(0.25 * whole, abs=1e-4)
    longest = max(line[:, 1].max() for line in rest.internal_lines.values())
    assert longest < 0.57 - 0.035


def test_welt_has_its_place_and_its_bags():
    pattern = add_pockets(skirt(), [PATCH.model_copy(update={"kind": "welt", "welt_mm": 20})])
    front = pattern.piece("front", "")
    sides = [line for name, line in front.internal_lines.items() if name.startswith("pocket")]
    assert sum(np.linalg.norm(side[1] - side[0]) for side in sides) == pytest.approx(2 * 2 * (0.12 + 0.02))
    welt, bag = pattern.piece("front_pocket_welt", ""), pattern.piece("front_pocket_bag", "")
    assert (welt.quantity, bag.quantity) == (2, 4)
    assert np.ptp(welt.outline, axis=0) == pytest.approx([0.14, 0.04])


def test_hip_pocket_cuts_the_corner_off_and_puts_a_facing_in_its_place():
    whole = skirt()
    area = shapely.Polygon(whole.piece("front", "").outline).area
    waist = Seam(
        name="waist seam",
        sides=((SeamSide(piece="back", edge="waist"),), (SeamSide(piece="front", edge="waist"),)),
    )
    whole = replace(whole, seams=[*whole.seams, waist])
    pattern = add_pockets(whole, [PocketTable(kind="hip", seam="side left", width_mm=50, height_mm=140)])
    drafted = draft_garment(pattern)
    assert all(seam.matches for seam in drafted.seams if seam.name != "side right")
    lost = area - shapely.Polygon(pattern.piece("front", "").outline).area
    # On both sides, about a triangle each.
    assert lost == pytest.approx(2 * 0.5 * 0.05 * 0.14, rel=0.1)
    for side in ("", " 2"):
        facing, bag = (pattern.piece(f"front_pocket_{what}{side}", "") for what in ("facing", "bag"))
        corner = shapely.Polygon(facing.outline).area - shapely.Polygon(bag.outline).area
        assert corner == pytest.approx(0.5 * lost, rel=0.02)
    seams = {seam.name: seam for seam in pattern.seams}
    assert {"pocket opening", "pocket bag"} <= seams.keys()
    # Front and facing together are as long as before in the waist's seam.
    parts = [pattern.piece(part.piece, "").edge(part.edge).length for part in seams["waist seam"].sides[1]]
    assert len(parts) == 3
    assert sum(parts) == pytest.approx(whole.piece("front", "").edge("waist").length, abs=1e-5)
    with pytest.raises(InputError, match="'side middle'"):
        add_pockets(whole, [PocketTable(kind="hip", seam="side middle", width_mm=50, height_mm=140)])
    with pytest.raises(InputError, match="which is"):
        add_pockets(whole, [PocketTable(kind="hip", seam="side left", width_mm=400, height_mm=140)])
