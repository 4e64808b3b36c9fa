"""Girths that follow a line: armholes keep the length that was drafted, whatever cap is eased in; hems are as long as they are cut."""

from __future__ import annotations

import pytest
from bodies import body_of_size

from warpflat.core.polyline import polyline_length
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.girths import pattern_girths
from warpflat.garment.construction.rings import measure_rings


@pytest.mark.parametrize(("form", "fabric"), [("tshirt", "interlock"), ("shirt", "woven")])
def test_an_armhole_is_as_long_as_it_was_drafted(form: str, fabric: str):
    body = body_of_size(30.0)
    garment = flatten_form(body, body.form(form), fabric=fabric)
    girths = pattern_girths(body, garment.form, garment.positions)
    for side in ("left", "right"):
        armhole = girths[f"armhole {side}"]
        assert armhole["pattern_m"] == pytest.approx(armhole["form_m"], abs=1e-3)
        assert armhole["body_m"] == pytest.approx(polyline_length(body.line(f"armhole {side}")), abs=1e-9)
    assert girths["neck"]["pattern_m"] == pytest.approx(girths["neck"]["form_m"], rel=0.03)


@pytest.mark.parametrize(("size", "longer"), [("EU 38", 0.0226), ("EU 46", 0.015)])
def test_an_armhole_without_sleeve_that_would_be_too_large_is_taken_in(size: str, longer: float):
    """As the cloth rests it is longer by 2.3 and 3.1 %."""
    body = body_of_size(30.0, size)
    garment = flatten_form(body, body.form("bodice"), fabric="woven", curves_mm=0.0)
    for side in ("left", "right"):
        armhole = pattern_girths(body, garment.form, garment.positions)[f"armhole {side}"]
        assert armhole["pattern_m"] == pytest.approx((1.0 + longer) * armhole["form_m"], rel=1e-3)


@pytest.mark.parametrize(("form", "hem"), [("tshirt", "biceps"), ("shirt", "wrist"), ("trousers", "ankle")])
def test_a_hem_has_one_length_whatever_way_it_runs(form: str, hem: str):
    """A sleeve's hem slopes on the form: level to level it was 3.6 mm shorter than it is cut."""
    body = body_of_size(30.0)
    on_body = body.form(form)
    positions = {name: piece.surface.vertices for name, piece in on_body.pieces.items()}
    girths = pattern_girths(body, on_body, positions)
    rings = measure_rings(body, on_body, positions, strain_limit=0.05, girths=girths)
    for side in ("left", "right"):
        (ring,) = (ring for ring in rings if ring.name == f"{hem} {side}")
        assert ring.edge
        assert girths[ring.name]["pattern_m"] == pytest.approx(ring.length, abs=1e-9)
        assert girths[ring.name]["form_m"] == pytest.approx(ring.length, abs=1e-9)
