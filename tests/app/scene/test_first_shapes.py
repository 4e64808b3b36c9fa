"""First projects by formula: their pieces are as large as they are asked to be, and meet where they are sewn."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.app.scene.first_shapes import PIECES, make_pieces
from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length


def test_gusset_reaches_around_three_sides_of_a_tote():
    front, back, gusset, *handles = make_pieces("tote", width=0.30, height=0.35, depth=0.08)
    assert polyline_length(gusset.vertices[gusset.lines["centre"]]) == pytest.approx(2 * 0.35 + 0.30)
    assert [piece.name for piece in handles] == ["handle_front", "handle_back"]
    x, y = front.vertices[:, 0], front.vertices[:, 1]
    for point in front.vertices[(np.abs(np.abs(x) - 0.15) < 1e-9) | (y < 1e-9)]:
        assert np.linalg.norm(gusset.vertices - point, axis=1).min() < 1e-9
    assert np.allclose(sorted(back.vertices[:, 2]), -0.04)


def test_hat_goes_around_the_head():
    pieces = {piece.name: piece for piece in make_pieces("sun_hat", head=0.55, brim=0.07)}
    assert set(pieces) == {"crown", "side_front", "side_back", "brim_front", "brim_back"}
    side = pieces["side_front"].vertices
    half = polyline_length(side[np.abs(side[:, 1]) < 1e-9])
    assert 2 * half == pytest.approx(0.57, rel=1e-3)
    assert pieces["brim_front"].vertices[:, 1].min() < -0.01


@pytest.mark.parametrize("name", list(PIECES))
def test_normals_look_outwards_or_to_one_side(name: str):
    for piece in make_pieces(name):
        corners = piece.vertices[piece.faces[:, :3]]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        if np.ptp(piece.vertices[:, 2]) < 1e-9:
            assert (normals[:, 2] > 0).all() or (normals[:, 2] < 0).all()
        elif name == "sun_hat" and piece.name != "crown":
            away = piece.vertices[piece.faces[:, 0]] * [1.0, 0.0, 1.0]
            assert ((normals * away).sum(axis=1) > 0).all()


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("tote", {"widht": 0.3}, "did you mean 'width'"),
        ("tote", {"depth": 0.0}, "depth = 0; must lie between"),
        ("apron", {"bib": 0.7}, "bib = 0.7; must lie between"),
        ("sun_hat", {"head": "big"}, "should be a number"),
    ],
)
def test_wrong_parameters_are_refused(name: str, parameters: dict, message: str):
    with pytest.raises(InputError, match=message):
        make_pieces(name, **parameters)
