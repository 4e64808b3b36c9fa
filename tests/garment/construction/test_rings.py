"""Rings of a garment, and what must pass through them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import body_of_size

from warpflat.app.cli.tables import rings_line
from warpflat.core.arrays import FloatArray
from warpflat.garment.construction.girths import pattern_girths
from warpflat.garment.construction.rings import GarmentRing, measure_rings
from warpflat.garment.mannequin.darts import FormDart
from warpflat.garment.mannequin.forms import Form, FormResult, PieceRecipe, shipped_form
from warpflat.garment.mannequin.mannequin import Mannequin


@pytest.fixture(scope="module")
def mannequin() -> Mannequin:
    return body_of_size(25.0)


def on_body(form: FormResult) -> dict[str, FloatArray]:
    return {name: piece.surface.vertices for name, piece in form.pieces.items()}


def rings_of(mannequin: Mannequin, name: str, *, half: bool = False) -> dict[str, GarmentRing]:
    form = mannequin.form(name, half=half)
    placed = on_body(form)
    girths = pattern_girths(mannequin, form, placed)
    return {r.name: r for r in measure_rings(mannequin, form, placed, strain_limit=0.05, girths=girths)}


def test_rings_are_the_edges_that_seams_close(mannequin: Mannequin):
    rings = rings_of(mannequin, "dress")
    assert {name for name, ring in rings.items() if ring.edge} == {"neck", "armhole left", "armhole right", "knee"}
    neck = mannequin.form("dress").vertices[mannequin.layout.lines["neck"]]
    assert rings["neck"].length == pytest.approx(np.linalg.norm(np.diff(neck, axis=0), axis=1).sum(), abs=1e-9)
    assert set(rings_of(mannequin, "trousers")) >= {"waist", "ankle left", "ankle right"}


@pytest.mark.parametrize("name", ["dress", "trousers", "tshirt"])
def test_half_garments_have_the_same_rings(mannequin: Mannequin, name: str):
    whole, half = rings_of(mannequin, name), rings_of(mannequin, name, half=True)
    assert {n: r.edge for n, r in half.items()} == {n: r.edge for n, r in whole.items()}
    for ring, other in zip(whole.values(), half.values(), strict=True):
        assert other.length == pytest.approx(ring.length, abs=5e-4)


def test_what_passes_depends_on_how_the_garment_is_put_on(mannequin: Mannequin):
    dress, skirt = rings_of(mannequin, "dress"), rings_of(mannequin, "a_line_skirt")
    assert (dress["neck"].over, dress["waist"].over, skirt["waist"].over) == ("head", "bust", "hip")
    assert dress["neck"].girth == pytest.approx(0.343 * mannequin.lengths["stature"])
    assert skirt["waist"].girth == pytest.approx(0.96, abs=1e-3)
    sleeve = rings_of(mannequin, "tshirt")["biceps left"]
    assert (sleeve.over, sleeve.passes) == ("elbow left", True)


def test_a_suit_with_legs_is_stepped_into(mannequin: Mannequin):
    pieces = {
        f"{face}_{side}": PieceRecipe(
            bricks=(f"shoulder-hip/{face}-{side}-*", f"crotch-leg_ankle/leg-{side}-{face}"),
            datum=f"princess {face} {side}",
        )
        for face in ("front", "back")
        for side in ("left", "right")
    }
    form = mannequin.form(Form(name="suit", pieces=pieces))
    placed = on_body(form)
    girths = pattern_girths(mannequin, form, placed)
    rings = {r.name: r for r in measure_rings(mannequin, form, placed, strain_limit=0.05, girths=girths)}
    assert (rings["neck"].over, rings["waist"].over) == ("hip", "hip")
    assert rings["neck"].passes is False


def test_opening_that_is_needed_lets_the_ring_pass():
    neck = GarmentRing(
        name="neck", edge=True, length=0.372, stretched=0.391, over="head", girth=0.570, source="EU 38", opened=0.0
    )
    assert not neck.passes
    assert neck.opening_needed_mm == 100.0
    assert "neck 10 cm (37.2 < head 57.0)" in rings_line([neck.as_dict()])


def test_darts_do_not_open_a_ring(mannequin: Mannequin):
    dart = FormDart(name="waist dart", piece="back", line="princess back left", part=(0.5, 1.0))
    form = mannequin.form(replace(shipped_form("skirt"), darts=(dart,)))
    assert form.darts
    placed = on_body(form)
    rings = measure_rings(mannequin, form, placed, strain_limit=0.05, girths={})
    assert [ring.name for ring in rings] == ["waist", "knee"]
    line = form.vertices[mannequin.layout.lines["waist"]]
    assert rings[0].length == pytest.approx(np.linalg.norm(np.diff(line, axis=0), axis=1).sum(), abs=1e-9)


def test_a_ring_whose_girth_is_not_known_says_so(mannequin: Mannequin):
    form = mannequin.form("tshirt")
    rings = measure_rings(replace(mannequin, lengths={}), form, on_body(form), strain_limit=0.1, girths={})
    assert {ring.name: ring.passes for ring in rings}["neck"] is None
    assert "not known: neck" in rings_line([ring.as_dict() for ring in rings])
