"""The line drawing of a garment: its waistband and its zip are seen, each from the sides from which they can be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import body_of_size

from warpflat.garment.finishing import Finishing
from warpflat.garment.garment import Garment, flatten_form
from warpflat.garment.line_drawing import describe_worn
from warpflat.garment.openings import Buttons, Opening, part_at_centres
from warpflat.mannequin.forms import shipped_form


def skirt(opening: Opening, *, half: bool) -> Garment:
    mannequin, form = body_of_size(30.0), shipped_form("skirt")
    form = form if half else part_at_centres(mannequin.layout, form, [opening])
    garment = flatten_form(mannequin, mannequin.form(form, half=half), fabric="woven", sewn=True, curves_mm=0.0)
    return replace(garment, openings=(opening,), finishing=(Finishing(kind="waistband", edge="waist", width=0.03),))


def test_waistband_lies_above_the_waist_and_a_zip_in_the_side_is_seen_on_that_side():
    garment = skirt(Opening(kind="zip", line="side left", length=0.2), half=True)
    views = describe_worn({"": garment}, "").views
    for name, sign in (("front", 1.0), ("back", -1.0)):
        # What of the band is on the far side lies behind all pieces.
        _, *pieces, band, zipped = views[name]
        top = max(float(piece.outlines[0][:, 1].max()) for piece in pieces)
        (ring,) = band.outlines
        assert float(ring[:, 1].max()) == pytest.approx(top + 0.03, abs=0.003)
        # From side to side, of a half garment too.
        waist = max(float(np.ptp(piece.outlines[0][piece.outlines[0][:, 1] > top - 0.01, 0])) for piece in pieces)
        assert float(np.ptp(ring[:, 0])) == pytest.approx(waist, rel=0.05)
        middles = np.array([line.mean(axis=0) for line in zipped.lines])
        assert (sign * middles[:, 0] > 0.05).all()
        assert 0.15 < float(np.ptp(middles[:, 1])) < 0.21
        assert zipped.outlines == ()


def test_every_button_is_drawn_in_front():
    opening = Opening(kind="buttons", line="centre front", length=0.4, buttons=Buttons(count=5))
    views = describe_worn({"": skirt(opening, half=False)}, "").views
    (buttons,) = [piece for piece in views["front"] if not piece.outlines]
    heights = [float(circle[:, 1].mean()) for circle in buttons.lines]
    assert len(heights) == 5
    assert heights == sorted(heights, reverse=True)
    assert all(float(np.ptp(circle[:, 0])) == pytest.approx(0.018) for circle in buttons.lines)
    assert all(piece.outlines for piece in views["back"])


def test_a_zip_at_the_centre_back_is_not_seen_from_the_front():
    views = describe_worn({"": skirt(Opening(kind="zip", line="centre back", length=0.2), half=False)}, "").views
    drawn = {name: [piece for piece in row if not piece.outlines] for name, row in views.items()}
    assert drawn["front"] == []
    (zipped,) = drawn["back"]
    assert all(abs(float(line.mean(axis=0)[0])) < 0.01 for line in zipped.lines)
