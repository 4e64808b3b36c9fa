"""Girths that follow a line: armholes keep the length that was drafted, whatever cap is eased into them."""

from __future__ import annotations

import pytest
from bodies import body_of_size

from warpflat.core.polyline import polyline_length
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.girths import pattern_girths


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
