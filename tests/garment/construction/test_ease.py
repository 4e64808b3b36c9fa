"""Ease and gathers: which seam, which side, how much cloth, and where it goes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bodies import body_of_size

from warpflat.core.errors import InputError
from warpflat.core.polyline import arc_lengths, turning_angles
from warpflat.flat.fabric.library import find_fabric
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.model.membrane import Model
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.shapes import make_shape
from warpflat.garment.construction.details import SeamTable
from warpflat.garment.construction.ease import cap_wishes, seam_ratios
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.fullness import FullEdge, give_fullness, measure_fullness
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.to_pattern import pattern_of_garment
from warpflat.garment.mannequin.forms import FormResult, PieceRecipe, shipped_form
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.edge_rules import EdgeRules


@pytest.fixture(scope="module")
def mannequin() -> Mannequin:
    return body_of_size(35.0)


@pytest.fixture(scope="module")
def shirt(mannequin: Mannequin) -> FormResult:
    return mannequin.form("tshirt")


WISHES = (
    SeamTable(name="armhole left", gather=1.04),
    SeamTable(name="shoulder right", fullness=0.03, longer="front"),
    SeamTable(name="side left", fullness=0.02, longer="back.side left"),
)


@pytest.fixture(scope="module")
def eased(mannequin: Mannequin, shirt: FormResult) -> Garment:
    return flatten_form(mannequin, shirt, fabric="interlock", wishes=WISHES)


# --- from names to ratios


def test_a_wish_finds_all_stretches_of_its_seam_and_the_longer_side(shirt: FormResult):
    wished = seam_ratios(shirt, WISHES)
    ratio = {seam.name: runs[0] for seam, runs in zip(shirt.seams, wished.ratios, strict=True)}
    # The cap lies at the front's armhole and at the back's: both are shorter than it.
    assert ratio["front armhole left"] == ratio["back armhole left"] == pytest.approx(1 / 1.04)
    assert ratio["shoulder right"] == pytest.approx(1.03)
    assert ratio["side left"] == pytest.approx(1 / 1.02)
    assert ratio["front armhole right"] == ratio["shoulder left"] == 1.0
    # As the pattern says it: how much longer the second side is.
    assert wished.ease == pytest.approx({"armhole left": 0.04, "shoulder right": 1 / 1.03 - 1, "side left": 0.02})
    assert {piece: len(edges) for piece, edges in wished.full.items()} == {"sleeve_left": 2, "front": 1, "back": 1}
    assert seam_ratios(shirt, [SeamTable(name="back armhole left", gather=1.04)]).ease == {
        "armhole left": pytest.approx(0.04)
    }


def test_cap_below_a_yoke_has_fullness_where_it_reaches_its_upper_part(mannequin: Mannequin):
    shirt = shipped_form("shirt")
    pieces = {
        **shirt.pieces,
        "back": PieceRecipe(bricks=("chest-hip/back-*",), datum="centre back"),
        "yoke": PieceRecipe(bricks=("shoulder-chest/back-*",), datum="centre back"),
    }
    form = mannequin.form(replace(shirt, pieces=pieces))
    full = seam_ratios(form, cap_wishes(form, find_fabric("woven"))).full
    assert {"sleeve_left", "sleeve_right"} <= set(full)
    # A single vertex is no stretch of an edge.
    assert all(len(edge.vertices) > 1 for edges in full.values() for edge in edges)


def test_cap_in_two_parts_is_eased_beside_the_seam_over_the_arm(mannequin: Mannequin):
    shirt = shipped_form("shirt")
    pieces = {name: recipe for name, recipe in shirt.pieces.items() if not name.startswith("sleeve")}
    pieces |= {
        f"sleeve_{face}_{side}": PieceRecipe(bricks=(f"armhole-wrist/arm-{side}-{face}",), datum=f"overarm {side}")
        for side in ("left", "right")
        for face in ("front", "back")
    }
    form = mannequin.form(replace(shirt, pieces=pieces))
    wished = seam_ratios(form, cap_wishes(form, find_fabric("woven")))
    assert set(wished.eased) == {f"{face} armhole {side}" for side in ("left", "right") for face in ("front", "back")}
    for name, edges in wished.full.items():
        piece = form.pieces[name]
        over = piece.edges[f"overarm {name.rpartition('_')[2]}"]
        # The fullness reaches up to the seam over the arm, and begins well above the underarm.
        assert all({int(over[0]), int(over[-1])} & set(edge.vertices.tolist()) for edge in edges), name
    for first, last in wished.eased.values():
        assert (first, last) in ((0.0, pytest.approx(0.6)), (pytest.approx(0.4), 1.0))


@pytest.mark.parametrize(
    ("wish", "message"),
    [
        (SeamTable(name="armhol left", fullness=0.04), r"there is no seam 'armhol left'; did you mean 'armhole left'"),
        (
            SeamTable(name="side left", fullness=0.04, longer="sleeve_left"),
            r"seam 'side left': 'sleeve_left' is not one of",
        ),
        (
            SeamTable(name="underarm left", fullness=0.02, longer="sleeve_left"),
            r"both sides are of 'sleeve_left'; name the edge",
        ),
    ],
)
def test_a_wrong_wish_is_told_in_one_line(shirt: FormResult, wish: SeamTable, message: str):
    with pytest.raises(InputError, match=message) as caught:
        seam_ratios(shirt, [wish])
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="is named twice"):
        seam_ratios(shirt, [WISHES[0], SeamTable(name="back armhole left", fullness=0.1)])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"name": "side left"}, "SeamTable: give either fullness = 0.02"),
        ({"name": "side left", "gather": 9}, "SeamTable: gather: should be less than or equal to 5, got 9"),
        ({"name": "side left", "gahter": 1.5}, "SeamTable: gahter: unknown key 'gahter'; did you mean 'gather'?"),
        ({"fullness": 0.02}, "SeamTable: name: is missing"),
    ],
)
def test_a_wish_that_cannot_be_is_told_in_one_line(wrong: dict[str, Any], message: str):
    with pytest.raises(InputError) as caught:
        SeamTable(**wrong)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


# --- what comes out


def test_seams_come_out_with_their_ease_and_the_shorter_side_keeps_its_length(
    mannequin: Mannequin, shirt: FormResult, eased: Garment
):
    assert eased.sewn is not None
    assert eased.sewn.converged
    plain = {seam.name: seam for seam in flatten_form(mannequin, shirt, fabric="interlock").seams}
    measured = {seam.name: seam for seam in eased.seams}
    for seam in eased.seams:
        assert abs(seam.difference) < 5e-4, seam.name
    first, second = measured["front armhole left"].lengths
    assert second / first == pytest.approx(1.04, abs=1e-3)
    # The cap lies flat longer than over the round shoulder. That is part of its ease: the armhole keeps its length.
    on_body = plain["front armhole left"].length_3d
    assert first == pytest.approx(on_body, rel=0.03)
    for seams in (measured, plain):
        halves = [seams[f"{half} armhole left"] for half in ("front", "back")]
        assert sum(each.lengths[0] for each in halves) == pytest.approx(
            sum(each.length_3d for each in halves), abs=1e-3
        )
    front, back = measured["shoulder right"].lengths
    assert front / back == pytest.approx(1.03, abs=1e-3)
    assert back == pytest.approx(plain["shoulder right"].lengths[1], rel=0.01)
    # Edge by edge, not only in the sum.
    seam = next(seam for seam in shirt.seams if seam.name == "front armhole left")
    sides = [
        np.linalg.norm(np.diff(eased.pieces[n].positions[v], axis=0), axis=1)
        for n, v in zip(seam.pieces, seam.runs[0].vertices, strict=True)
    ]
    assert np.abs(1.04 * sides[0] - sides[1]).max() < 5e-5


def test_the_pattern_knows_the_ease_and_its_notches_meet(eased: Garment, shirt: FormResult):
    rules = EdgeRules(ease=seam_ratios(shirt, WISHES).ease)
    pattern, _ = pattern_of_garment({"EU 38": eased}, name="shirt", rules=rules)
    drafted = draft_garment(pattern)
    reports = {report.name: report for report in drafted.seams}
    for report in reports.values():
        assert abs(report.difference_mm) < 1.0, report
    assert reports["armhole left"].length_mm[1] / reports["armhole left"].length_mm[0] == pytest.approx(1.04, abs=3e-3)
    pieces = {piece.name: piece for piece in drafted.pieces["EU 38"]}
    back, front = (
        sorted(notch.length for notch in pieces[name].notches if notch.seam == "shoulder right")
        for name in ("back", "front")
    )
    assert len(back) == len(front) > 0
    np.testing.assert_allclose(front, 1.03 * np.array(back), rtol=5e-3)


def test_a_woven_cap_is_eased_in_above_its_notches_and_a_knit_one_is_not(mannequin: Mannequin):
    form = mannequin.form("tshirt", half=True)
    assert not cap_wishes(form, find_fabric("interlock"))
    made = flatten_form(mannequin, form, fabric="woven", wishes=cap_wishes(form, find_fabric("woven")))
    assert made.sewn is not None
    assert made.sewn.converged
    assert max(abs(seam.difference) for seam in made.seams) < 2e-4
    # Stretched at the shoulder point by a cap that wants more than its ease, the armhole would hook the shoulder seam up.
    seam = next(seam for seam in form.seams if seam.name == "front armhole left")
    row, piece = seam.runs[0].vertices[0], form.pieces[seam.pieces[0]]
    worn, flat = (
        np.diff(arc_lengths(at[row])) for at in (piece.surface.vertices, made.pieces[seam.pieces[0]].positions)
    )
    upper = np.argsort(piece.surface.vertices[row[:-1], 1] + piece.surface.vertices[row[1:], 1])[-3:]
    assert abs(flat[upper].sum() / worn[upper].sum() - 1.0) < 0.02
    pattern, _ = pattern_of_garment({"EU 38": made}, name="shirt")
    drafted = draft_garment(pattern)
    armhole, cap = next(report for report in drafted.seams if report.name == "armhole left").length_mm
    assert 15.0 < cap - armhole < 40.0
    # From each notch to the underarm cap and armhole are equally long; the rest lies between: single in front, double at the back.
    pieces = {piece.name: piece for piece in drafted.pieces["EU 38"]}
    marks = {
        name: [notch for notch in pieces[name].notches if notch.seam == "armhole left"]
        for name in ("front", "back", "sleeve_left")
    }
    assert [len(notch.base) for name in ("front", "back") for notch in marks[name]] == [1, 2]
    (double,) = (notch.length for notch in marks["sleeve_left"] if len(notch.base) == 2)
    single = max((notch.length for notch in marks["sleeve_left"]), key=lambda at: abs(at - double))
    back, front = marks["back"][0].length, marks["front"][0].length
    ends = sorted((min(at, whole - at) for at, whole in ((back, armhole / 1e3), (front, armhole / 1e3))))
    assert sorted(min(at, cap / 1e3 - at) for at in (double, single)) == pytest.approx(ends, abs=1e-3)


def test_no_ease_is_no_fullness(shirt: FormResult):
    wished = seam_ratios(
        shirt, [SeamTable(name="side left", fullness=0.0), SeamTable(name="side right", fullness=0.02)]
    )
    assert {name: len(edges) for name, edges in wished.full.items()} == {"back": 1}
    assert wished.ease == {"side left": 0.0, "side right": pytest.approx(0.02)}


def test_gathers_widen_the_skirt_and_leave_the_bodice(mannequin: Mannequin):
    form = mannequin.form("basic_block", half=True)
    wishes = [SeamTable(name=name, gather=1.5) for name in ("front waist", "back waist")]
    plain, full = (flatten_form(mannequin, form, fabric="woven", wishes=w, curves_mm=0.0) for w in ((), wishes))
    assert full.sewn is not None
    assert full.sewn.converged
    assert all(piece.flipped_faces == 0 for piece in full.pieces.values())
    for seam, before in zip(full.seams, plain.seams, strict=True):
        assert abs(seam.difference) < 5e-4, seam.name
        if seam.name.endswith("waist"):
            assert seam.lengths[1] / seam.lengths[0] == pytest.approx(1.5, abs=2e-3)
            assert seam.lengths[0] == pytest.approx(before.lengths[0], rel=0.02)
    # The fullness falls to the hem; it stores no energy, since the cloth is not stretched by it.
    hem = [
        np.ptp(garment.pieces["front_skirt"].positions[form.pieces["front_skirt"].edges["knee"]][:, 0])
        for garment in (plain, full)
    ]
    assert hem[1] / hem[0] == pytest.approx(1.5, abs=0.03)
    assert full.sewn.energy_after < 2.0 * plain.sewn.energy_after  # type: ignore[union-attr]
    assert any("front_skirt: it has up to 50 % more length" in note for note in full.notes)


@pytest.mark.parametrize("fabric", ["interlock", "isotropic"])
def test_gathered_seams_are_smooth_in_soft_cloth_also_across_the_fold(fabric: str):
    mannequin = body_of_size(20.0)
    form = mannequin.form("basic_block", half=True)
    wishes = [SeamTable(name=name, gather=1.5) for name in ("front waist", "back waist")]
    made = flatten_form(mannequin, form, fabric=fabric, wishes=wishes)
    assert made.sewn is not None
    assert made.sewn.converged
    for piece in made.pieces.values():
        waist = piece.positions[piece.surface.lines["waist"]]
        if abs(waist[0, 0] - piece.positions[piece.datum[0], 0]) > 1e-6:
            waist = waist[::-1]
        unfolded = np.concatenate([waist[:0:-1] * [-1, 1] + [2 * waist[0, 0], 0], waist])
        turns = turning_angles(unfolded)
        there_and_back = np.abs(turns).sum() - np.ptp(np.concatenate([[0.0], np.cumsum(turns)]))
        assert there_and_back < np.radians(40.0), piece.surface.name
    rules = EdgeRules(ease=seam_ratios(form, wishes).ease)
    drafted = draft_garment(pattern_of_garment({"EU 38": made}, name="dress", rules=rules)[0])
    assert max(abs(seam.difference_mm) for seam in drafted.seams) < 0.5


# --- where the fullness goes


def test_fullness_fades_towards_an_edge_that_is_sewn_plainly():
    piece = flatten(make_shape("strip", resolution=9), datum="centre", fabric="woven")
    lines = piece.surface.lines
    gathered = FullEdge(vertices=lines["top"], factor=1.6, gathered=True)
    through = measure_fullness(piece, [gathered], [lines["left"], lines["right"]])
    np.testing.assert_allclose(through, np.tile([1.0, 1.6], (len(through), 1)), atol=1e-9)
    fading = measure_fullness(piece, [gathered], [lines["bottom"], lines["left"], lines["right"]])
    np.testing.assert_allclose(fading[lines["bottom"], 1], 1.0)
    np.testing.assert_allclose(fading[lines["top"], 1], 1.6)
    upwards = lines["left"][np.argsort(piece.positions[lines["left"], 1])]
    inner = fading[upwards, 1]
    assert np.all(np.diff(inner) > 0.0)
    assert inner[len(inner) // 2] == pytest.approx(np.sqrt(1.6), rel=0.02), "halfway, in its logarithm"
    near = measure_fullness(piece, [FullEdge(vertices=lines["top"], factor=1.05, gathered=False)], [])
    np.testing.assert_allclose(near[lines["top"]], 1.05)
    np.testing.assert_allclose(near[lines["bottom"]], 1.0)
    np.testing.assert_allclose(near[:, 0], near[:, 1])


@pytest.mark.parametrize("model", ["springs", "membrane"])
def test_a_plane_with_fullness_is_a_wider_plane_without_energy(model: str):
    piece = flatten(make_shape("strip", resolution=9), datum="centre", fabric="woven", model=model)  # type: ignore[arg-type]
    edge = FullEdge(vertices=piece.surface.lines["top"], factor=1.5, gathered=True)
    wide = give_fullness(piece, [edge], [])
    before, after = (np.ptp(p.positions, axis=0) for p in (piece, wide))
    np.testing.assert_allclose(after, before * [1.5, 1.0], rtol=1e-5)
    assert wide.stages[-1].name == "fullness"
    assert wide.stages[-1].converged
    assert wide.stages[-1].model_energy_j < 1e-9
    assert wide.stages[-1].strain_energy_j < 1e-9


@pytest.mark.parametrize("factor", [1.0, 1.5, 3.0])
def test_a_plane_with_fullness_stores_what_its_fabric_does(factor: float):
    fabric = find_fabric("interlock")
    piece = flatten(make_shape("strip", resolution=9), datum="centre", fabric=fabric)
    wide = give_fullness(piece, [FullEdge(vertices=piece.surface.lines["top"], factor=factor, gathered=True)], [])
    area = float(np.prod(np.ptp(wide.positions, axis=0)))
    for strain, stiffness in (
        ([[1.0, 0.0], [0.0, 0.0]], float(fabric.tension(1e-4, "weft")) / 1e-4),
        ([[0.0, 0.0], [0.0, 1.0]], float(fabric.tension(1e-4, "warp")) / 1e-4),
        ([[0.0, 0.5], [0.5, 0.0]], fabric.shear_stiffness),
    ):
        worn = wide.positions @ np.linalg.inv(np.eye(2) + 1e-4 * np.array(strain))
        stored = Relaxation(wide.network, RelaxOptions(), start=worn).energies().potential
        assert stored == pytest.approx(0.5 * stiffness * 1e-8 * area, rel=2e-3)


@pytest.mark.parametrize(("gathered", "model"), [(True, "membrane"), (False, "springs")])
def test_what_is_gathered_is_measured_cell_by_cell(gathered: bool, model: Model):
    """Gathers slant the mesh's edges off the grain: springs along them would be another cloth."""
    piece = flatten(make_shape("bodice", resolution=13), datum="centre", fabric="woven")
    full = give_fullness(piece, [FullEdge(vertices=piece.surface.lines["bottom"], factor=1.3, gathered=gathered)], [])
    assert piece.network.model == "springs"
    assert full.network.model == model
    if gathered:
        assert full.stages[-1].strain_energy_j == pytest.approx(full.stages[-1].model_energy_j, rel=1e-9)
