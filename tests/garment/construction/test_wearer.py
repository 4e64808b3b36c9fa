"""How a garment fits the body itself, place by place: ease where the cloth is larger, strain and pressure where it is smaller."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import body_of_size

from warpflat.app.cli.fit_lines import fit_lines
from warpflat.flat.fabric.library import find_fabric
from warpflat.garment.construction.tapes import stretch_tape
from warpflat.garment.construction.wearer import assess_wearer, tension_around
from warpflat.garment.mannequin.forms import form_from_mapping
from warpflat.garment.mannequin.profiles import convex_girth


def test_a_tape_spans_hollows_and_turns_once() -> None:
    """A clover's tape: its hull's length; its curvature along it sums to a whole turn and is nothing over a hollow."""
    angle = np.linspace(0.0, 2.0 * np.pi, 240, endpoint=False) + 0.3
    radius = 0.14 + 0.02 * np.cos(4 * angle)
    row = np.column_stack([radius * np.sin(angle), np.full(240, 0.9), radius * np.cos(angle)])
    tape = stretch_tape(row)
    assert tape.girth == pytest.approx(convex_girth(row), rel=1e-12)
    assert (tape.edges > 0.0).all()
    weights = 0.5 * (tape.edges + np.roll(tape.edges, 1))
    assert float(tape.curvature @ weights) == pytest.approx(2.0 * np.pi, rel=0.01)
    hollow = radius < 0.125
    assert tape.curvature[hollow].max() < 1e-6 < tape.curvature[radius > 0.1599].min()


@pytest.mark.parametrize("grain_angle", [0.0, 20.0, 45.0, 70.0, 90.0])
def test_cloth_around_the_body_is_pulled_as_by_its_compliance_turned(grain_angle: float) -> None:
    """The strain n . (S : nn) n of a stress along n alone, warp upright at 0 degrees."""
    cloth = replace(find_fabric("denim"), curve_warp=(), curve_weft=(), poisson_ratio=0.2)
    warp, weft, shear = 1.0 / cloth.stiffness_warp, 1.0 / cloth.stiffness_weft, 1.0 / cloth.shear_stiffness
    cross = -cloth.poisson_ratio * warp
    compliance = np.array([[warp, cross, 0.0], [cross, weft, 0.0], [0.0, 0.0, shear]])
    along_warp, along_weft = np.sin(np.radians(grain_angle)), np.cos(np.radians(grain_angle))
    stress = np.array([along_warp**2, along_weft**2, along_warp * along_weft])
    assert tension_around(cloth, grain_angle, 0.01) == pytest.approx(0.01 / (stress @ compliance @ stress), rel=1e-9)


def test_ease_where_the_cloth_is_larger_and_strain_where_it_is_smaller() -> None:
    """A T-shirt without ease whose cloth is 4 % smaller than the body's own surface, but for a wider front at the hip."""
    body = body_of_size(20.0)
    form = body.form(form_from_mapping("tshirt", {"like": "tshirt", "ease": "moulage"}))
    knit, woven = find_fabric("interlock"), find_fabric("denim")
    positions = {name: piece.surface.vertices / 1.04 for name, piece in form.pieces.items()}
    fit = assess_wearer(body, form, positions, knit)
    assert fit is not None
    wearer = fit.as_dict()
    bust, waist = wearer["levels"]["bust"], wearer["levels"]["waist"]
    # A tape spans the hollow between the breasts, the cloth's row does not.
    assert 0.02 < bust["strain"] <= 0.04
    assert bust["ease_m"] == pytest.approx(sum(side["ease_m"] for side in bust["sides"].values()), abs=1e-12)
    # The shirt hangs from bust to hip over the waist.
    assert waist["strain"] == 0.0
    assert waist["ease_m"] > 0.02
    assert all(side["pressure_pa"] == 0.0 for side in waist["sides"].values())
    assert wearer["levels"]["biceps left"]["strain"] == pytest.approx(0.04, abs=0.005)
    # All around a row the pressure holds the tension: the integral is T times a whole turn.
    row = next(row for row in fit.rows if row.level == "bust")
    tape = stretch_tape(body.vertices[row.vertices])
    pulled = float(row.pressure @ (0.5 * (tape.edges + np.roll(tape.edges, 1)))) / (2.0 * np.pi)
    assert pulled == pytest.approx(tension_around(knit, 0.0, bust["strain"]), rel=0.02)
    assert fit.pieces["front"].strain[np.isfinite(fit.pieces["front"].strain)].max() > 0.02
    assert not np.isfinite(fit.pieces["front"].strain).all()
    lines = fit_lines({"pieces": {}, "wear": {"outside": 0.0, "against": "form", "wearer": wearer}})
    assert lines[-2].startswith(f"wearer: stretched at bust {100 * bust['ease_m']:+.1f} cm (")
    assert "; ease at " in lines[-2]
    assert "biceps -" in lines[-2]
    assert lines[-1].startswith("wearer: touches with ")
    stiff = assess_wearer(body, form, {name: flat / 1.04 for name, flat in positions.items()}, woven)
    assert stiff is not None
    entry = stiff.as_dict()
    assert entry["most_stretched"]["strain"] > entry["strain_limit"] == woven.strain_limit
