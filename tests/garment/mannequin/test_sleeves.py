"""Sleeves that reach to the neck, or are parts of front and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from bodies import body_of_size

from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.garment.mannequin.forms import Form, form_from_mapping
from warpflat.garment.mannequin.mannequin import Mannequin


@pytest.fixture(scope="module")
def mannequin() -> Mannequin:
    return body_of_size(30.0)


def tshirt(sleeve: Mapping[str, Any], like: str = "tshirt") -> Form:
    return form_from_mapping("own", {"like": like, "sleeve": sleeve})


def test_raglan_sleeve_reaches_to_the_neck(mannequin: Mannequin):
    form = mannequin.form(tshirt({"cut": "raglan", "front_cm": 9.0, "back_cm": 10.0}))
    assert {"neck", "neck 2", "shoulder left", "shoulder left 2"} <= set(form.pieces["sleeve_left"].edges)
    assert not any("shoulder" in edge for name in ("front", "back") for edge in form.pieces[name].edges)
    # One seam from the neck to the underarm, for the sewing order a sleeve's.
    assert {seam.name for seam in form.seams if "armhole" in seam.name} == {
        f"{face} armhole {side}" for face in ("front", "back") for side in ("left", "right")
    }


def test_raglan_seam_meets_the_armhole_where_it_is_asked_to(mannequin: Mannequin):
    layout = mannequin.layout
    for depth in (7.0, 11.0):
        form = mannequin.form(tshirt({"cut": "raglan", "front_cm": depth, "back_cm": depth}))
        for patch in (layout.yokes["front-left"], layout.yokes["back-left"]):
            outer = 0 if patch[-1, -1] in layout.neck[0] else -1
            assert polyline_length(form.vertices[patch[:, outer]]) == pytest.approx(0.01 * depth, abs=5e-3)
    assert np.abs(form.vertices[layout.mirror] - form.vertices * [-1.0, 1.0, 1.0]).max() < 2e-3


def test_dropped_shoulder_is_wider_and_its_armhole_stays_under_the_arm(mannequin: Mannequin):
    layout = mannequin.layout
    before, form = (mannequin.form(tshirt(cut)) for cut in ({"cut": "set-in"}, {"cut": "dropped", "drop_cm": 4.0}))
    shoulder, underarm = layout.lines["shoulder left"], layout.arms["left"][0, 0]
    longer = polyline_length(form.vertices[shoulder]) - polyline_length(before.vertices[shoulder])
    assert longer == pytest.approx(0.04, abs=5e-3)
    assert np.array_equal(form.vertices[underarm], before.vertices[underarm])
    assert list(form.pieces) == list(before.pieces)
    assert np.abs(form.vertices[layout.mirror] - form.vertices * [-1.0, 1.0, 1.0]).max() < 2e-3
    with pytest.raises(InputError, match=r"drop_cm = 20: a shoulder can drop by at most \d+\.\d cm"):
        mannequin.form(tshirt({"cut": "dropped", "drop_cm": 20.0}))


def test_kimono_is_a_front_and_a_back(mannequin: Mannequin):
    form = mannequin.form(tshirt({"cut": "kimono"}))
    assert list(form.pieces) == ["front", "back"]
    assert {"biceps left", "underarm left", "overarm left"} <= set(form.pieces["front"].edges)


def test_sleeves_are_cut_once(mannequin: Mannequin):
    """A style edit writes the pieces of a form again, which are cut already."""
    for cut in ("raglan", "kimono"):
        form = tshirt({"cut": cut})
        pieces = {
            name: {"bricks": list(recipe.bricks), "datum": recipe.datum, "open": list(recipe.open)}
            for name, recipe in form.pieces.items()
        }
        again = form_from_mapping("own", {"like": "tshirt", "pieces": pieces, "sleeve": {"cut": cut}})
        assert again.pieces == form.pieces


@pytest.mark.parametrize(
    ("sleeve", "like", "why"),
    [
        ({"cut": "raglan"}, "skirt", "has no sleeves"),
        ({"cut": "ragaln"}, "tshirt", "one of set-in, dropped, raglan, kimono is needed"),
        ({"cut": "kimono", "front_cm": 9.0}, "tshirt", "front_cm belongs to a raglan sleeve"),
        ({"cut": "raglan", "drop_cm": 9.0}, "tshirt", "drop_cm belongs to a dropped sleeve"),
        ({"cut": "raglan", "side_cm": 9.0}, "tshirt", "side_cm.*is unknown"),
    ],
)
def test_what_makes_no_sense_is_refused(sleeve: Mapping[str, Any], like: str, why: str):
    with pytest.raises(InputError, match=why):
        tshirt(sleeve, like)


def test_seam_that_begins_too_deep_is_refused(mannequin: Mannequin):
    with pytest.raises(InputError, match=r"front_cm = 25: a seam can begin 2 to \d+\.\d cm below the shoulder"):
        mannequin.form(tshirt({"cut": "raglan", "front_cm": 25.0}))
