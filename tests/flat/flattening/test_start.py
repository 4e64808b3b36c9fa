"""The start of a relaxation: as-rigid iterations where they pay, a layout of one's own, and what is refused."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from devices import DEVICE

from warpflat.app.scene.read_layout import read_layout
from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.flattening.harmonic_layout import harmonic_layout
from warpflat.flat.flattening.start import choose_start
from warpflat.flat.surface.as_rigid import as_rigid_layout
from warpflat.flat.surface.injective import is_injective
from warpflat.flat.surface.laplacian import laplacian_of
from warpflat.flat.surface.shapes import make_shape


def bodice(**options):
    return make_shape("bodice", resolution=21, triangles=True, **options)


def test_triangles_start_from_as_rigid_iterations_and_grids_from_their_profiles():
    surface = bodice()
    start = choose_start(surface, surface.lines["centre"])
    assert start.as_rigid
    assert is_injective(surface, start.positions)
    chord = start.positions[surface.lines["centre"][[0, -1]]]
    assert abs(chord[1, 0] - chord[0, 0]) < 1e-12
    assert chord[1, 1] > chord[0, 1]
    grid = make_shape("bodice", resolution=21)
    assert choose_start(grid, grid.lines["centre"]).start == "the profiles development"


def test_as_rigid_iterations_go_on_while_they_move_the_piece(monkeypatch: pytest.MonkeyPatch):
    surface = bodice()
    laplacian, layouts = laplacian_of(surface), [harmonic_layout(surface)]

    def step(layout: FloatArray) -> FloatArray:
        layouts.append(laplacian.as_rigid_step(layout))
        return layouts[-1]

    monkeypatch.setattr("warpflat.flat.surface.as_rigid.laplacian_of", lambda _: SimpleNamespace(as_rigid_step=step))
    end = as_rigid_layout(surface, layouts[0])
    assert end is layouts[-1]
    moved = np.sqrt(np.mean(np.diff(layouts, axis=0) ** 2, axis=(1, 2)))
    assert (moved > 1e-3 * np.linalg.norm(np.ptp(surface.vertices, axis=0))).tolist() == [True] * (len(moved) - 1) + [
        False
    ]


def test_an_own_start_of_any_unit_side_and_angle_gives_the_same_pattern():
    surface = bodice()
    chosen = flatten(surface, datum="centre", device=DEVICE)
    assert chosen.measures["start"] == "as-rigid iterations from the geodesic development"
    own = 37.0 * chosen.positions @ [[0.6, 0.8], [0.8, -0.6]] + [5.0, -2.0]
    given = flatten(surface, datum="centre", start=own, device=DEVICE)
    assert given.measures["start"] == "the layout given"
    assert given.flipped_faces == 0
    assert given.stages[-1].model_energy_j == pytest.approx(chosen.stages[-1].model_energy_j, rel=1e-3)
    apart = given.positions - given.positions.mean(axis=0) - chosen.positions + chosen.positions.mean(axis=0)
    assert np.abs(apart).max() < 2e-4


def test_a_start_that_is_none_is_refused_in_one_line():
    surface = bodice()
    flat = surface.vertices[:, :2].copy()
    for start, words in (
        (flat[:-1], "440 rows; must be 441"),
        (flat[:, 0], "must be a row of two numbers"),
        (np.where(np.arange(len(flat))[:, None] == 7, np.nan, flat), "vertex 7 has no place"),
        (np.where(np.arange(len(flat))[:, None] == 200, flat + 1.0, flat), "faces; must mirror none"),
    ):
        with pytest.raises(InputError, match=words) as error:
            flatten(surface, datum="centre", start=start, device=DEVICE)
        assert "\n" not in str(error.value)


def test_a_layout_is_read_from_texture_coordinates(tmp_path):
    file = tmp_path / "own.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 0.5\nvt 0 0\nvt 1 0\nf 1/2 2/3 3/1\n")
    np.testing.assert_array_equal(read_layout(file), [[0, 0], [1, 0], [0.5, 0.5]])
    for text, words in (
        ("f 1 2 3\n", "no texture coordinates"),
        ("vt x\nf 1/1 2/1 3/1\n", "texture coordinates that are no two numbers"),
        ("vt 0 0\nvt 1 1\nf 1/1 2/2 3/2\nf 1/2 3/2 2/2\n", "vertex 0 has two texture coordinates"),
        ("vt 0 0\nf 1/1 2/1 3/9\n", "that the file does not have"),
        ("vt 0 1e300\nf 1/1 2/1 3/1\n", "reach beyond"),
    ):
        file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + text)
        with pytest.raises(InputError, match=words):
            read_layout(file)
