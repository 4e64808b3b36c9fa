"""How a garment fits the body itself: ease where the cloth is larger, strain where it is smaller."""

import pytest

from warpflat.flattening.fit_report import fit_lines
from warpflat.garment.girths import wearer_fit


def test_ease_where_the_cloth_is_larger_and_strain_where_it_is_smaller() -> None:
    """A shirt that is 5 % narrower at the bust and wider at the waist, within a knit's limit and beyond a woven one's."""
    girths = {
        "bust": {"body_m": 0.92, "pattern_m": 0.92 / 1.05, "ease_m": 0.92 / 1.05 - 0.92},
        "waist": {"body_m": 0.76, "pattern_m": 0.80, "ease_m": 0.04},
    }
    knit, woven = wearer_fit(girths, 0.15), wearer_fit(girths, 0.03)
    assert (knit["fits"], woven["fits"]) == (True, False)
    assert knit["levels"]["bust"]["strain"] == pytest.approx(0.05)
    assert knit["levels"]["waist"] == {"ease_m": 0.04, "strain": 0.0}
    wear = {"fits": False, "outside": 0.1, "where_not": [], "would_help": [], "against": "form", "wearer": knit}
    lines = fit_lines({"pieces": {}, "wear": wear})
    assert lines[-1] == "wearer: fits: yes (ease at waist +4.0 cm; stretched at bust -4.4 cm (5.0 %))"
