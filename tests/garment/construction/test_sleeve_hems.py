"""Long sleeves on straight and on bent arms: the hem, the elbow's dart, and sleeves that are not wrung."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import body_of_size, with_bent_elbows

from warpflat.core.polyline import polyline_length, segment_lengths
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.garment.construction.constraints import Straight, straight_hems
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.garment import Garment
from warpflat.garment.mannequin.darts import FormDart
from warpflat.garment.mannequin.forms import FormResult, PieceRecipe, form_from_mapping, shipped_form
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.shapes import shaped_form


@pytest.fixture(scope="module")
def body() -> Mannequin:
    return body_of_size(25.0)


@pytest.fixture(scope="module")
def bent(body: Mannequin) -> Mannequin:
    return with_bent_elbows(body)


def _sleeve(
    body: Mannequin, name: str = "shirt", *, woven: bool = True, fabric: str = "isotropic"
) -> tuple[FormResult, Garment]:
    whole = shaped_form(body.layout, shipped_form(name), "none", body.vertices, woven=woven)
    darts = tuple(replace(dart, mirrored=False) for dart in whole.darts if dart.piece == "sleeve_left")
    form = body.form(replace(whole, pieces={"sleeve_left": whole.pieces["sleeve_left"]}, darts=darts))
    return form, flatten_form(body, form, fabric=fabric)


def _hem(form: FormResult, garment: Garment, level: str = "wrist") -> np.ndarray:
    line = garment.pieces["sleeve_left"].positions[form.pieces["sleeve_left"].edges[f"{level} left"]]
    return line if line[0, 0] < line[-1, 0] else line[::-1]


def test_hem_of_a_knit_on_a_bent_arm_is_straight_across_the_grain(bent: Mannequin) -> None:
    form, garment = _sleeve(bent, woven=False)
    hem = _hem(form, garment)
    assert np.ptp(hem[:, 1]) < 1e-4
    assert segment_lengths(hem).sum() == pytest.approx(np.ptp(hem[:, 0]), rel=1e-6)


def test_bent_elbow_has_a_dart_and_straight_one_none(body: Mannequin, bent: Mannequin) -> None:
    of_sleeve = [
        d for d in shaped_form(body.layout, shipped_form("shirt"), "darts", body.vertices).darts if "elbow" in d.name
    ]
    assert not of_sleeve
    form, garment = _sleeve(bent)
    left, right = (garment.pieces["sleeve_left"].positions[form.pieces["sleeve_left"].edges[leg]]
                   for leg in form.pieces["sleeve_left"].darts["elbow dart"])  # fmt: skip
    assert np.linalg.norm(left[0] - right[-1]) > 0.02
    assert garment.seams[0].lengths[0] == pytest.approx(garment.seams[0].lengths[1], abs=2e-4)
    # The dart swings the forearm: its hem is straight, and square to it, not to the grain.
    hem = _hem(form, garment)
    way = hem[-1] - hem[0]
    away = (hem - hem[0]) @ np.array([-way[1], way[0]]) / np.linalg.norm(way)
    assert np.abs(away).max() < 1e-4
    assert abs(way[1] / way[0]) > 0.05


@pytest.mark.parametrize("side", ["left", "right"])
def test_one_bent_elbow_gives_both_sleeves_their_darts(body: Mannequin, bent: Mannequin, side: str) -> None:
    vertices, arm = body.vertices.copy(), body.layout.arms[side]
    vertices[arm] = bent.vertices[arm]
    (dart,) = shaped_form(body.layout, shipped_form("shirt"), "none", vertices).darts
    assert (dart.name, dart.mirrored) == ("elbow dart", True)


def test_darts_of_both_sleeves_are_mirror_images(bent: Mannequin) -> None:
    form = bent.form("shirt")
    assert {name for name, piece in form.pieces.items() if "elbow dart left" in piece.darts} == {"sleeve_left"}
    assert {name for name, piece in form.pieces.items() if "elbow dart right" in piece.darts} == {"sleeve_right"}


def test_what_is_asked_for_of_a_hem_holds(body: Mannequin) -> None:
    form = body.form("shirt")
    assert {line.line for line in straight_hems(form, [])} == {"wrist left", "wrist right"}
    asked = [Straight(piece="sleeve_left", line="wrist left", along="free")]
    assert [line.piece for line in straight_hems(form, asked)] == ["sleeve_right"]
    assert {line.line for line in straight_hems(body.form("tshirt"), [])} == {"biceps left", "biceps right"}


def test_a_seam_that_a_dart_interrupts_is_no_hem() -> None:
    """A sleeve in two at the elbow, the lower one with a dart there."""
    lower = PieceRecipe(bricks=("elbow-wrist/arm-left-*",), datum="overarm left", open=("underarm left",))
    upper = replace(lower, bricks=("armhole-elbow/arm-left-*",))
    dart = FormDart(name="over", piece="lower", line="overarm left", at="elbow left", part=(0.0, 0.4), mirrored=False)
    form = body_of_size(35.0).form(
        replace(shipped_form("shirt"), pieces={"upper": upper, "lower": lower}, darts=(dart,))
    )
    assert {"elbow left", "elbow left 2"} <= set(form.pieces["lower"].edges)
    assert [(hem.piece, hem.line) for hem in straight_hems(form, [])] == [("lower", "wrist left")]


def test_short_sleeve_is_not_wrung_and_its_hem_is_straight(body: Mannequin) -> None:
    """The line through its underarm ends lies across the grain; wrung by 15 degrees it slants by 6. So does the hem."""
    form, garment = _sleeve(body, "tshirt")
    assert np.ptp(_hem(form, garment, "biceps")[:, 1]) < 1e-4
    cap = garment.pieces["sleeve_left"].positions[form.pieces["sleeve_left"].edges["armhole left"]]
    start, end = sorted((cap[0], cap[-1]), key=lambda p: p[0])
    assert abs(np.degrees(np.arctan2(end[1] - start[1], end[0] - start[0]))) < 3.5


def test_a_loose_sleeve_hangs_from_the_armhole_without_a_saddle() -> None:
    body = body_of_size(15.0)
    form, garment = _sleeve(body, fabric="woven")
    assert garment.pieces["sleeve_left"].measures["wear"]["outside"] < 0.006
    # It is as wide at the biceps as asked for.
    layout = body.layout
    row = layout.arms["left"][layout.arm_row["biceps"]]
    ease = polyline_length(form.vertices[row], closed=True) - polyline_length(body.vertices[row], closed=True)
    assert ease == pytest.approx(0.08, abs=0.001)
    # The underarm runs straight from the armhole to the biceps.
    line = form.vertices[layout.arms["left"][: layout.arm_row["biceps"] + 1, 0]]
    chord = np.linalg.norm(line[-1] - line[0])
    assert polyline_length(line) < 1.001 * chord


@pytest.mark.parametrize(("cut", "pieces"), [("set-in", ["sleeve_left"]), ("kimono", ["front", "back"])])
def test_hem_of_a_short_sleeve_lies_where_it_is_straight_when_flat(
    body: Mannequin, cut: str, pieces: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Around a sleeve that narrows a level of the arm lies flat as an arc of 2 cm; held straight it strained the corners by a fifth."""
    recipe = form_from_mapping("short", {"like": "tshirt", "sleeve": {"cut": cut}})
    form = body.form(recipe)
    monkeypatch.setattr("warpflat.garment.mannequin.forms.straighten_hems", lambda layout, vertices, pieces: vertices)
    level = body.form(recipe)
    hem = body.layout.arms["left"][body.layout.arm_row["biceps"]]
    moved = np.linalg.norm(form.vertices[hem] - level.vertices[hem], axis=1)
    # Under the arm, and where a kimono's sleeve has its other seam, the hem stays on the level.
    assert moved[[0, len(hem) // 2] if cut == "kimono" else [0]].max() < 1e-9
    assert 0.003 < moved.max() < 0.030
    for name in pieces:
        bows = []
        for each in (form, level):
            piece = each.pieces[name]
            flat = flatten(piece.surface).positions[piece.edges["biceps left"]]
            way = (flat[-1] - flat[0]) / np.linalg.norm(flat[-1] - flat[0])
            bows.append(np.abs((flat - flat[0]) @ [-way[1], way[0]]).max())
        assert bows[0] < 0.5 * bows[1]
