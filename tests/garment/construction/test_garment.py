"""Forms on a mannequin, flattened: pieces, seams, metrics, files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import body_of_size

from warpflat.app.cli.fit_lines import fit_lines
from warpflat.app.scene.load import load_scene
from warpflat.app.scene.run import run_scene
from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.flat.cutting.cut_piece import cut
from warpflat.flat.cutting.cut_plan import CutPlan
from warpflat.flat.cutting.remedies import advise
from warpflat.flat.flattening.edit import change_fabric, change_surface
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.wear import Wear
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.surface.shapes import make_shape
from warpflat.garment.construction.constraints import FixedLength
from warpflat.garment.construction.details import SeamTable
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.garment import Garment
from warpflat.garment.mannequin.forms import form_from_mapping
from warpflat.garment.mannequin.mannequin import Mannequin


@pytest.fixture(scope="module")
def mannequin() -> Mannequin:
    return body_of_size(25.0)


@pytest.fixture(scope="module")
def block(mannequin: Mannequin) -> Garment:
    return flatten_form(mannequin, mannequin.form("basic_block"), fabric="woven")


def test_every_piece_is_relaxed_and_lies_as_it_hangs(block: Garment):
    assert list(block.pieces) == ["front_bodice", "back_bodice", "front_skirt", "back_skirt"]
    for name, piece in block.pieces.items():
        assert piece.converged, name
        assert piece.flipped_faces == 0, name
        centre = piece.datum
        chord = piece.positions[centre[-1]] - piece.positions[centre[0]]
        assert abs(chord[0]) < 1e-9, name
        assert chord[1] > 0, name
        assert piece.surface.vertices[centre[-1], 1] > piece.surface.vertices[centre[0], 1], name


def test_symmetric_pieces_come_out_symmetric(block: Garment):
    piece = block.pieces["front_skirt"]
    left, right = (piece.positions[piece.surface.lines[f"side {side}"]] for side in ("left", "right"))
    axis = piece.positions[piece.datum[0], 0]
    left, right = left[np.argsort(left[:, 1])], right[np.argsort(right[:, 1])]
    np.testing.assert_allclose(left[:, 0] - axis, axis - right[:, 0], atol=2e-5)


def test_seams_match_and_say_what_that_costs(block: Garment, mannequin: Mannequin):
    assert block.sewn is not None
    assert block.sewn.converged
    alone = flatten_form(mannequin, block.form, fabric="woven", sewn=False)
    assert max(abs(seam.difference) for seam in alone.seams) > 2e-3
    for seam, measured in zip(block.form.seams, block.seams, strict=True):
        assert abs(measured.difference) < 5e-4, seam.name
        sides = [
            np.linalg.norm(np.diff(block.pieces[n].positions[v], axis=0), axis=1)
            for n, v in zip(seam.pieces, seam.runs[0].vertices, strict=True)
        ]
        # 0.2 mm per 5 cm, edge by edge
        assert np.abs(sides[0] - sides[1]).max() < 2e-4 * 0.025 / 0.05, seam.name
    assert 0.0 < block.sewn.cost < 0.2 * block.sewn.energy_before
    prices = {seam.name: seam.cost for seam in block.seams}
    assert sum(price for price in prices.values() if price is not None) == pytest.approx(block.sewn.cost, rel=0.05)
    assert prices["bodice side left"] == pytest.approx(prices["bodice side right"], rel=1e-3)
    assert all(seam.cost is None for seam in alone.seams)
    assert block.sewn.energy_before == pytest.approx(sum(p.stages[-1].model_energy_j for p in alone.pieces.values()))


def test_mirrored_pieces_are_recognised_as_pairs(mannequin: Mannequin, block: Garment):
    assert block.pairs == ()
    shirt = flatten_form(mannequin, mannequin.form("tshirt"), fabric="interlock", curves_mm=0.0)
    assert shirt.pairs == (("sleeve_left", "sleeve_right"),)
    assert shirt.metrics()["pairs"] == [["sleeve_left", "sleeve_right"]]
    # Ease on one side only, and they are two patterns.
    wishes = [SeamTable(name="armhole left", fullness=0.05)]
    odd = flatten_form(mannequin, mannequin.form("tshirt"), fabric="interlock", wishes=wishes, curves_mm=0.0)
    assert odd.pairs == ()


def test_half_pieces_have_a_straight_fold(mannequin: Mannequin, block: Garment):
    half = flatten_form(mannequin, mannequin.form("basic_block", half=True), fabric="woven")
    for name, piece in half.form.pieces.items():
        assert piece.fold is not None
        fold = half.pieces[name].positions[piece.edges[piece.fold]]
        assert np.ptp(fold[:, 0]) < 1e-9, name
    assert max(abs(seam.difference) for seam in half.seams) < 5e-4
    assert half.sewn is not None
    assert block.sewn is not None
    # The folds have their price too, and all prices together are what all of it costs.
    assert [held.name for held in half.sewn.constraints] == [f"{name} fold" for name in half.form.pieces]
    assert all(held.cost > 0.0 for held in half.sewn.constraints)
    assert sum(held.cost for held in half.sewn.results) == pytest.approx(half.sewn.cost, rel=0.05)
    # two halves are the whole, before their borders are drawn
    own, whole = (sewn.energy_after - sewn.drawing_cost for sewn in (half.sewn, block.sewn))
    assert 2 * own == pytest.approx(whole, rel=0.02)


def test_a_length_is_that_of_the_whole_line_on_a_half_piece_too(mannequin: Mannequin):
    wanted = {"waist": 0.36, "centre front": 0.54}
    asked = [FixedLength(piece="front", line=line, length=length) for line, length in wanted.items()]
    lengths = []
    for half in (False, True):
        form = mannequin.form("skirt", half=half)
        made = flatten_form(mannequin, form, fabric="woven", constraints=asked, curves_mm=0.0)
        piece = made.pieces["front"]
        lengths.append({line: polyline_length(piece.positions[piece.surface.lines[line]]) for line in wanted})
    assert lengths[0] == pytest.approx(wanted, abs=2e-4)
    assert lengths[1] == pytest.approx({**wanted, "waist": 0.18}, abs=2e-4)


@pytest.mark.parametrize("top", ["bust", "chest"])
def test_a_half_with_a_low_neck_is_half_of_the_whole(top: str):
    """Alone it bends its fold by 17 and 20 mm: moved to a line, these vertices alone pressed faces at the neck until they mirrored."""
    bricks = [f"{top}-hip/front-*-centre", "shoulder-hip/front-*-side"]
    form = form_from_mapping("straps", {"pieces": {"front": {"bricks": bricks, "datum": "centre front"}}})
    body = body_of_size(20.0)
    half, whole = (flatten_form(body, body.form(form, half=h), fabric="woven", curves_mm=0.0) for h in (True, False))
    assert half.sewn is not None
    assert half.sewn.converged
    assert half.pieces["front"].flipped_faces == 0
    # Its quads lie along the threads, as those of the harmonic maps did not from which they started.
    assert not any("times as stiff" in note for garment in (half, whole) for note in garment.notes)
    energy = [garment.pieces["front"].stages[-1].model_energy_j for garment in (half, whole)]
    assert 2 * energy[0] == pytest.approx(energy[1], rel=1e-3)
    of_half, of_whole = (garment.form.pieces["front"].grid_vertices for garment in (half, whole))
    there = whole.pieces["front"].positions[np.searchsorted(of_whole, of_half)]
    assert np.ptp(half.pieces["front"].positions - there, axis=0).max() < 1e-3


@pytest.mark.parametrize("size", ["EU 36", "EU 44"])
def test_seams_of_every_size_match_at_the_usual_resolution(size: str):
    mannequin = body_of_size(20.0, size)
    garment = flatten_form(mannequin, mannequin.form("basic_block", half=True), fabric="woven")
    assert garment.sewn is not None
    assert garment.sewn.converged
    assert max(abs(seam.difference) for seam in garment.seams) < 5e-4
    assert all(piece.flipped_faces == 0 for piece in garment.pieces.values())


def test_the_waist_of_a_small_body_does_not_zigzag_in_knitwear():
    """Quads of 7 by 10 mm: shear springs of all of G left nothing to hold a vertex against its four neighbours."""
    body = Mannequin.from_measurements(bust=0.70, waist=0.60, hip=0.74, stature=1.40)
    back = flatten_form(body, body.form("bodice"), fabric="interlock").pieces["back"]
    waist = back.positions[back.surface.lines["waist"]]
    bend = waist[1:-1, 1] - 0.5 * (waist[:-2, 1] + waist[2:, 1])
    assert np.abs(bend).max() < 3e-4
    last = back.stages[-1]
    assert back.measures["strain_energy_j"] < 2.0 * last.model_energy_j


def test_both_sides_of_a_seam_come_from_one_curve(block: Garment):
    names = {seam.name for seam in block.seams}
    assert {"bodice side left", "skirt side right", "shoulder left", "front waist"} <= names
    for seam, measured in zip(block.form.seams, block.seams, strict=True):
        first, second = (block.form.pieces[name].surface.vertices for name in seam.pieces)
        np.testing.assert_array_equal(first[seam.runs[0].vertices[0]], second[seam.runs[0].vertices[1]])
        flat = [block.pieces[n].positions[v] for n, v in zip(seam.pieces, seam.runs[0].vertices, strict=True)]
        lengths = [np.linalg.norm(np.diff(p, axis=0), axis=1).sum() for p in flat]
        np.testing.assert_allclose(measured.lengths, lengths)
        assert measured.as_dict()["difference_mm"] == pytest.approx(1e3 * (lengths[1] - lengths[0]), abs=1e-9)
        assert measured.ease == 0.0


def test_the_skirt_block_measures_what_the_table_says(block: Garment):
    """Front and back hip lines together are the hip girth: a skirt hangs free of hollows there."""
    hips = [block.pieces[name] for name in ("front_skirt", "back_skirt")]
    length = sum(
        np.linalg.norm(np.diff(piece.positions[piece.surface.lines["hip"]], axis=0), axis=1).sum() for piece in hips
    )
    assert length == pytest.approx(0.96, abs=0.01)


def test_metrics_and_files_of_a_garment(block: Garment, tmp_path: Path):
    files = block.save(tmp_path)
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert set(metrics["pieces"]) == set(block.pieces)
    assert metrics["mannequin"]["levels"]["bust"]["girth_m"] == pytest.approx(0.88, abs=0.001)
    for name, piece in block.pieces.items():
        energy = metrics["pieces"][name]["energy"]
        assert sum(energy["bricks"].values()) == pytest.approx(piece.stages[-1].strain_energy_j, rel=1e-9)
        assert energy["lines"].keys() == piece.surface.lines.keys()
        assert any(line in energy["peak"] for line in piece.surface.lines), energy["peak"]
    seam = metrics["seams"][0]
    assert {"name", "sides", "length_mm", "ease", "difference_mm", "price_j"} <= set(seam)
    assert metrics["sewing"]["price_j"] == pytest.approx(sum(seam["price_j"] for seam in metrics["seams"]), rel=0.05)
    assert all("." in side for side in seam["sides"])
    for name in block.pieces:
        assert f"{name}.obj" in files
        assert (tmp_path / f"{name}.obj").read_text().count("\nvt ") == len(block.pieces[name].positions)


DRESS = "form = 'dress'\n[mannequin]\nsize = 'EU 38'\nresolution_mm = 40\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("form = 'bodise'\n[mannequin]\nsize = 'EU 38'\n", r"form: form 'bodise' is unknown.*'bodice'"),
        ("form = 'bodice'\n[mannequin]\nsize = 'EU 138'\n", r"mannequin: size 'EU 138' is in no table"),
        (
            "form = 'bodice'\n[mannequin.measurements]\nwaist = 3.0\n",
            r"mannequin: measurement waist = 3 m: valid range",
        ),
        ("[mannequin]\nsize = 'EU 38'\n[form.pieces]\nx = { bricks = ['wast-hip/front-*'] }\n", r"form: .*wast-hip"),
        ("form = 'bodice'\n[mannequin]\nscan = 'nobody.obj'\n", r"mannequin: .*nobody.obj: does not exist"),
        (
            DRESS + "[[seams]]\nname = 'sid left'\nfullness = 0.02\n",
            r"seams: there is no seam 'sid left'; did you mean 'side left'",
        ),
        (
            DRESS + "[[constraints]]\nline = 'kne'\nstraight = 'weft'\n",
            r"constraints\[0\]: no piece has a line 'kne'.*'knee'",
        ),
        (
            DRESS + "[[constraints]]\npiece = 'frnt'\nline = 'knee'\nstraight = 'weft'\n",
            r"constraints\[0\]: no piece 'frnt'; did you mean 'front'",
        ),
        (
            DRESS + "[[constraints]]\npiece = 'front'\nline = 'centre back'\nlength_mm = 'body'\n",
            r"constraints\[0\]: piece 'front' has no line 'centre back'",
        ),
        (
            "half = true\n" + DRESS + "[[constraints]]\npiece = 'front'\nline = 'centre front'\nsymmetric = true\n",
            r"constraints\[0\]: piece 'front' is a half on the fold",
        ),
        (
            DRESS + "table = 'men'\n",
            "mannequin: size 'EU 38' is completed by the table 'women', not by 'men'",
        ),
        ("form = 'dress'\n[mannequin]\nscan = 'a.obj'\ntable = 'men'\n", "a scan has its own"),
        ("form = 'dress'\n[mannequin]\nscan = 'a.obj'\nsize = 'EU 38'\n", "give the body in one way"),
        (
            DRESS + "measurements = { waist = 0.76 }\n[pattern]\nsizes = ['EU 38', 'EU 40']\n",
            r"leave out \[mannequin",
        ),
    ],
)
def test_a_wrong_body_or_form_is_one_line(tmp_path: Path, text: str, message: str):
    path = tmp_path / "trial.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        run_scene(load_scene(path), tmp_path / "out")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"form": 3}, "form is of type int; it must be what Mannequin.form gives"),
        ({"mannequin": None}, "mannequin is of type NoneType; it must be a Mannequin"),
        ({"wishes": "side"}, "wishes is of type str; it must be a list"),
        (
            {"constraints": ["x"]},
            r"constraints\[0\] is of type str; it must be a Straight, FixedLength, Symmetric or DartMouth",
        ),
        ({"callback": 3}, "callback is of type int"),
    ],
)
def test_arguments_of_a_wrong_type_are_one_line(block: Garment, wrong: dict[str, Any], message: str):
    with pytest.raises(InputError, match=message):
        flatten_form(**{"mannequin": block.mannequin, "form": block.form, **wrong})


def test_a_sewn_piece_is_not_edited_as_if_it_were_not(block: Garment, mannequin: Mannequin):
    """Its fullness, its folds and the other sides of its seams would be lost without a word."""
    wish = SeamTable(name="front waist", gather=1.5)
    full = flatten_form(mannequin, block.form, fabric="woven", wishes=[wish], curves_mm=0.0).pieces["front_skirt"]
    line = full.surface.lines["hip"]
    plan = CutPlan(name="hip", paths=(line,))
    for edit in (
        lambda piece: change_fabric(piece, "denim"),
        lambda piece: change_surface(piece, piece.surface.vertices),
        lambda piece: cut(piece, plan),
    ):
        for piece in (full, block.pieces["front_skirt"]):
            with pytest.raises(InputError, match=r"'front_skirt' has been sewn: .* again with the change, or edit its"):
                edit(piece)
        assert full.unsewn is not None
        assert edit(full.unsewn).converged
    unsewn = flatten_form(mannequin, block.form, fabric="woven", sewn=False).pieces["front_skirt"]
    assert unsewn.unsewn is None
    np.testing.assert_array_equal(full.unsewn.positions, unsewn.positions)


def test_a_cut_is_offered_for_what_it_wins_and_not_for_what_sewing_does():
    """What is gathered here strains the back skirt's waist; the same skirt with a tiny dart, unsewn, fits, and so it does without."""
    # A bust that stands out: no darts, and the bodice does not fit alone either.
    body = Mannequin.from_size("EU 38", bust=0.96, resolution_mm=35.0)
    wishes = [
        SeamTable(name="front waist", gather=1.5),
        SeamTable(name="back waist", gather=1.5),
        SeamTable(name="shoulder left", fullness=0.01),
    ]
    form = body.form("basic_block", half=True)
    dress = flatten_form(body, form, fabric="woven", wishes=wishes, wear=Wear(), curves_mm=0.0)
    dress = replace(dress, pieces={name: advise(piece) for name, piece in dress.pieces.items()})
    skirt, bodice = (dress.pieces[name].measures["wear"] for name in ("back_skirt", "front_bodice"))
    assert skirt["held"] > 0.01
    assert skirt["outside_unsewn"] == 0.0
    assert skirt["would_help"] == []
    alone = flatten_form(body, form, fabric="woven", wear=Wear(), sewn=False, curves_mm=0.0).pieces["front_bodice"]
    assert bodice["outside_unsewn"] == pytest.approx(alone.fit.outside)
    assert bodice["outside"] > 2 * bodice["outside_unsewn"]
    assert bodice["would_help"]
    assert all(remedy["outside_after"] < 0.9 * bodice["outside_unsewn"] for remedy in bodice["would_help"])
    lines = fit_lines(dress.metrics())
    before = f"{100 * alone.fit.outside:.1f} % -> "
    told = [line for line in lines if line.startswith("  would help: ")]
    assert sum(before in line and line.endswith("beyond the limit, unsewn") for line in told) == len(
        bodice["would_help"]
    )
    assert (
        "  without its seams the piece fits; relax its seams, folds or constraints, or choose a stretchier fabric"
        in lines
    )


def test_cuts_are_tried_with_the_options_of_the_run(monkeypatch: pytest.MonkeyPatch):
    given: list[RelaxOptions] = []

    def noted(piece: Flattening, plan: CutPlan, *, relax: RelaxOptions) -> Flattening:
        given.append(relax)
        return cut(piece, plan, relax=relax)

    monkeypatch.setattr("warpflat.flat.cutting.ledger.cut", noted)
    options = RelaxOptions(solver="paper", check_every=7, energy_tolerance=1e-5)
    front = flatten(make_shape("bodice", resolution=13), fabric="denim", datum="centre", wear=Wear(), relax=options)
    assert not given
    assert front.measures["wear"]["would_help"] == []
    assert advise(front).measures["wear"]["would_help"]
    assert {(one.solver, one.check_every) for one in given} == {("paper", 7)}
    assert all(one.energy_tolerance == pytest.approx(1e-4) for one in given)


@pytest.mark.parametrize(
    ("size", "title"),
    [("", "made to measure"), ("size = 'EU 38'\n", "EU 38 made to measure")],
    ids=["own", "of a size"],
)
def test_a_garment_on_own_measures_says_so(tmp_path: Path, size: str, title: str):
    path = tmp_path / "skirt.toml"
    path.write_text(
        f"form = 'skirt'\nhalf = true\n[mannequin]\n{size}resolution_mm = 40\nmeasurements = {{ waist = 0.76, hip = 0.98 }}\n"
        "[output]\nframes = 0\npicture = false\n[pattern]\nformats = ['dxf', 'svg']\n"
    )
    run_scene(load_scene(path), tmp_path / "out")
    assert f"SIZE: {title}\n" in (tmp_path / "out" / "skirt.dxf").read_text()
    label = f">Size {title}<" if size else ">Made to measure<"
    assert label in (tmp_path / "out" / "skirt.svg").read_text()


def test_arms_and_legs_have_the_ease_that_is_asked_for(mannequin: Mannequin):
    garment = flatten_form(mannequin, mannequin.form("trousers"), fabric="woven", sewn=True, curves_mm=0.0)
    girths = garment.metrics()["girths"]
    asked = {
        level: girth["ease_m"] - girth["ease_wanted_m"] for level, girth in girths.items() if "ease_wanted_m" in girth
    }
    assert {"hip", "thigh left", "thigh right", "ankle left"} <= asked.keys()
    assert max(map(abs, asked.values())) < 2e-3
