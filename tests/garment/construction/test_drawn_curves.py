"""Garments of woven cloth whose borders are drawn as by hand, and whose girths have the ease that was asked for."""

from types import SimpleNamespace

import numpy as np
import pytest
from bodies import body_of_size

from warpflat.core.polyline import turning_angles
from warpflat.garment.construction.drawn_curves import _open_edges
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.garment import Garment


@pytest.fixture(scope="module")
def dress() -> Garment:
    mannequin = body_of_size(30.0)
    return flatten_form(mannequin, mannequin.form("dress"), fabric="woven")


def test_borders_are_faired_within_the_bound_and_seams_still_match(dress: Garment):
    assert dress.sewn is not None
    assert dress.sewn.converged
    assert dress.curves is not None
    assert 0.0 < dress.curves.price_j < dress.sewn.energy_before
    lines = {line.place: line for line in dress.curves.lines}
    assert len(lines) == 12, "all borders but the armholes"
    assert all(line.inflections_after <= line.inflections_before for line in lines.values())
    assert max(line.shift_mm for line in lines.values()) < 1.5 * dress.curves.bound_mm
    assert max(abs(seam.difference) for seam in dress.seams) < 2e-4
    assert "curves" in dress.metrics()


def test_a_side_seam_is_straight_below_the_hip(dress: Garment):
    piece = dress.form.pieces["front"]
    side = piece.edges["side left"]
    lines = {line.place: line for line in dress.curves.lines} if dress.curves else {}
    assert lines["front.side left"].book == "below hip"
    assert lines["front.side left"].straight
    low = piece.surface.vertices[side, 1] < dress.mannequin.levels()["hip"].height - 0.03
    assert low.sum() > 5
    assert np.abs(np.degrees(turning_angles(dress.pieces["front"].positions[side[low]]))).max() < 0.5


def test_girths_have_their_ease_without_darts(dress: Garment):
    girths = dress.metrics()["girths"]
    wanted = {level: girth for level, girth in girths.items() if "ease_wanted_m" in girth}
    assert set(wanted) == {"bust", "waist", "abdomen", "hip"}
    for level, girth in wanted.items():
        assert girth["ease_m"] == pytest.approx(girth["ease_wanted_m"], abs=2e-3), level


def test_levels_do_not_wave_to_be_as_long_as_asked(dress: Garment):
    """Edges that are only to be longer find it in waves: with their lengths for an equation, neighbours turned by 50 degrees to and fro."""
    for name, piece in dress.form.pieces.items():
        for level in ("bust", "waist"):
            row = dress.mannequin.layout.rings[dress.mannequin.layout.level_row[level]]
            line = np.flatnonzero(np.isin(piece.grid_vertices, row))
            places = dress.pieces[name].positions[line]
            turns = np.degrees(turning_angles(places[np.argsort(places[:, 0])]))
            assert np.abs(np.diff(turns)).max() < 15.0, (name, level)


def test_an_edge_is_drawn_in_parts_that_meet_at_its_corners():
    bent = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [3.0, 1.0], [3.0, 2.0]])
    piece = SimpleNamespace(fold=None, leg_edges=frozenset(), edges={"side": np.arange(6)})
    parts = list(_open_edges(SimpleNamespace(pieces={"front": piece}), "front", bent))  # type: ignore[arg-type]
    assert [(edge, vertices.tolist()) for edge, vertices in parts] == [("side", [0, 1, 2, 3]), ("side", [3, 4, 5])]
