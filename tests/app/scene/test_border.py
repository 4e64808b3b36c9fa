"""Stretches of the border of a piece, by the names of its sides and between two places."""

from __future__ import annotations

import numpy as np
import pytest
from surface_meshes import cylinder, grid, rings

from warpflat.app.scene.border import line_on_border
from warpflat.core.errors import InputError
from warpflat.flat.surface.repair.validate import make_surface


@pytest.fixture
def sheet():
    return make_surface(*grid(7, 5), name="sheet")


def test_sides_of_the_border_as_seen_from_outside(sheet):
    assert line_on_border(sheet, "bottom").tolist() == [0, 1, 2, 3, 4, 5, 6]
    assert line_on_border(sheet, "top").tolist() == [28, 29, 30, 31, 32, 33, 34]
    assert line_on_border(sheet, "left").tolist() == [0, 7, 14, 21, 28]
    assert line_on_border(sheet, "right").tolist() == [6, 13, 20, 27, 34]
    # From behind, left and right change places.
    back = make_surface(sheet.vertices, sheet.faces[:, ::-1])
    assert line_on_border(back, "left").tolist() == [6, 13, 20, 27, 34]
    # Lying flat and facing up, the front (+Z) is at the bottom.
    flat = make_surface(sheet.vertices * [1, 1, -1] @ [[1, 0, 0], [0, 0, -1], [0, 1, 0]], sheet.faces)
    assert line_on_border(flat, "bottom").tolist() == [0, 1, 2, 3, 4, 5, 6]


def test_sides_of_a_half_cylinder_and_of_a_tapered_piece():
    i = np.arange(13 * 6).reshape(6, 13)
    bent = make_surface(*grid(13, 6, cylinder))
    assert line_on_border(bent, "left").tolist() == i[:, 0].tolist()
    assert line_on_border(bent, "top").tolist() == i[-1].tolist()
    vertices, quads = grid(13, 6)
    vertices[:, 0] = (vertices[:, 0] - 0.5) * (1 - 0.5 * vertices[:, 1])
    assert line_on_border(make_surface(vertices, quads), "right").tolist() == i[:, -1].tolist()


def slit_tube(columns=25, rows=15, opening=0.0, slit=0.0):
    """A sleeve about +Y, wider above, slit at `slit` [rad] from +X towards -Z, seen from outside; `opening` [rad] wide."""

    def place(u, v):
        angle = slit + opening / 2 + (2 * np.pi - opening) * u
        radius = 0.05 + 0.03 * v
        return np.stack([radius * np.cos(angle), 0.3 * v, -radius * np.sin(angle)], axis=-1)

    return grid(columns, rows, place)


@pytest.mark.parametrize("slit", [0.0, 1.0, 2.0, np.pi, 4.5])
@pytest.mark.parametrize("opening", [0.0, 0.1, 2.5])
def test_sides_of_a_piece_that_wraps_round_lie_between_its_own_corners(slit, opening):
    vertices, quads = slit_tube(opening=opening, slit=slit)
    i = np.arange(25 * 15).reshape(15, 25)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    # The right way up, and an arm that is held out.
    across = vertices @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for faces in (quads, triangles):
        sleeve = make_surface(vertices, faces)
        assert line_on_border(sleeve, "bottom").tolist() == i[0].tolist()
        assert line_on_border(sleeve, "right").tolist() == i[:, -1].tolist()
        assert line_on_border(sleeve, "top").tolist() == i[-1].tolist()
        assert line_on_border(sleeve, "left").tolist() == i[:, 0].tolist()
    if opening == 0.0:
        arm = make_surface(across, quads)
        assert line_on_border(arm, "right").tolist() == i[0].tolist()
        assert line_on_border(arm, "top").tolist() == i[:, -1][::-1].tolist()


def test_sides_of_a_piece_that_wraps_round_are_refused_where_they_cannot_be_told():
    vertices, quads = slit_tube()
    lying = make_surface(vertices[:, [2, 0, 1]], quads, name="sleeve")
    with pytest.raises(
        InputError,
        match="which of the four sides of 'sleeve' is 'left' cannot be told from the front; give start and end",
    ):
        line_on_border(lying, "left")
    tube = make_surface(
        vertices, quads[(np.arange(len(quads)) < 24 * 6) | (np.arange(len(quads)) % 24 < 12)], name="step"
    )
    with pytest.raises(
        InputError, match="'step' wraps round, and its border does not turn at four corners only; give start"
    ):
        line_on_border(tube, "left")


def test_sides_that_curl_a_little_out_of_sight_end_at_the_corners():
    """A back with a square neckline, through 220 degrees: from the front its outermost points lie beside its corners."""
    vertices, quads = slit_tube(opening=np.radians(140), slit=-np.pi / 2)
    row, column = np.divmod(np.arange(len(quads)), 24)
    back = make_surface(vertices, quads[(row < 10) | (np.abs(column - 11.5) > 4)], name="back")
    bottom, right = line_on_border(back, "bottom"), line_on_border(back, "right")
    assert back.input_index[bottom].tolist() == list(range(25))
    assert back.input_index[right].tolist() == list(range(24, 25 * 15, 25))


def test_stretch_between_two_places(sheet):
    assert line_on_border(sheet, start=1, end=14).tolist() == [1, 0, 7, 14]
    assert line_on_border(sheet, start=[0.17, -0.1, 0], end=14).tolist() == [1, 0, 7, 14]
    with_faces = line_on_border(sheet, start=1, end=14, direction="with")
    assert with_faces[:3].tolist() == [1, 2, 3]
    assert with_faces[-2:].tolist() == [21, 14]
    assert line_on_border(sheet, start=1, end=14, direction="against").tolist() == [1, 0, 7, 14]
    whole = line_on_border(sheet, start=6, end=6, direction="with")
    assert len(whole) == 21
    assert whole[0] == whole[-1] == 6


def test_stretch_that_is_none_is_refused(sheet):
    with pytest.raises(InputError, match=r"unknown side 'botom'.*did you mean 'bottom'"):
        line_on_border(sheet, "botom")
    with pytest.raises(InputError, match="unknown direction 'long'"):
        line_on_border(sheet, start=0, end=1, direction="long")
    with pytest.raises(InputError, match="not both"):
        line_on_border(sheet, "top", start=0)
    with pytest.raises(InputError, match="needs a side"):
        line_on_border(sheet, start=0)
    with pytest.raises(InputError, match="vertex 8 of 'sheet' does not lie on its border"):
        line_on_border(sheet, start=0, end=8)
    with pytest.raises(InputError, match="different border loops"):
        line_on_border(make_surface(*rings(24, 9)), start=0, end=200)
