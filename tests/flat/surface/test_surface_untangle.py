from __future__ import annotations

import sys

import numpy as np
import pytest
from real_files import DATA, needs_data
from surface_meshes import cylinder, grid, plane, scattered

from warpflat.flat.surface.io.read import read_surface
from warpflat.flat.surface.paths.geodesic import signed_distance_and_station
from warpflat.flat.surface.paths.lines import line_on_plane
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.triangles import triangulate
from warpflat.flat.surface.untangle import untangle


def areas(surface, flat):
    p = flat[triangulate(surface.faces)[0]]
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    return 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def test_layout_without_mirrored_faces_is_left_alone():
    surface = make_surface(*grid(7, 7, cylinder))
    flat = surface.vertices[:, :2] + 1.0
    out, left = untangle(surface, flat)
    assert left == 0
    assert np.array_equal(out, flat)


def test_a_vertex_pulled_over_its_neighbours_comes_back_and_the_rest_stays():
    vertices, triangles, _ = scattered(300, plane)
    surface = make_surface(vertices, triangles)
    flat = surface.vertices[:, :2].copy()
    middle = int(np.argmin(np.linalg.norm(flat - [0.3, 0.5], axis=1)))
    rim = int(np.argmin(np.linalg.norm(flat - [0.0, 0.7], axis=1)))
    flat[middle] += 0.12
    flat[rim] += [0.0, 0.1]
    assert areas(surface, flat).min() < 0
    out, left = untangle(surface, flat)
    assert left == 0
    assert areas(surface, out).min() > 0
    moved = np.linalg.norm(out - flat, axis=1) > 0
    assert 2 <= moved.sum() < 60
    assert out[rim, 0] == pytest.approx(0.0, abs=1e-12)
    far = np.linalg.norm(flat - [0.8, 0.2], axis=1) < 0.2
    assert np.array_equal(out[far], flat[far])


def test_only_suspects_are_looked_at_to_begin_with():
    vertices, triangles, _ = scattered(300, plane)
    surface = make_surface(vertices, triangles)
    flat = surface.vertices[:, :2].copy()
    flat[int(np.argmin(np.linalg.norm(flat - [0.3, 0.5], axis=1)))] += 0.12
    mirrored = np.flatnonzero(areas(surface, flat) <= 0)
    everywhere, _ = untangle(surface, flat)
    out, left = untangle(surface, flat, suspects=mirrored)
    assert left == 0
    assert np.array_equal(out, everywhere)
    far = np.flatnonzero(np.linalg.norm(flat[surface.faces[:, 0]] - [0.8, 0.2], axis=1) < 0.2)
    out, _ = untangle(surface, flat, suspects=far)
    assert np.array_equal(out, flat)


def test_layout_folded_at_large_is_given_up_with_the_count():
    surface = make_surface(*grid(9, 9))
    flat = surface.vertices[:, :2] * [-1.0, 1.0]
    out, left = untangle(surface, flat)
    assert left > 0
    assert np.isfinite(out).all()


@needs_data
@pytest.mark.parametrize("name", ["front_bodice_raw", "garment_shirtfront"])
def test_first_layout_of_real_pieces_comes_free_of_folds(name):
    surface = read_surface(DATA / f"{name}.obj", units="m")
    line = line_on_plane(surface, surface.vertices.mean(axis=0), [1, 0, 0])
    out, left = untangle(surface, np.stack(signed_distance_and_station(surface, line), axis=1))
    assert left == 0
    assert areas(surface, out).min() > 0


@pytest.mark.parametrize("rings", [1, 2, 6])
def test_the_patch_that_sweeps_see_changes_nothing(rings: int, monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, triangles, _ = scattered(900, plane)
    surface = make_surface(vertices, triangles)
    flat, rng = surface.vertices[:, :2].copy(), np.random.default_rng(4)
    near = np.linalg.norm(flat - [0.4, 0.6], axis=1) < 0.15
    flat[near] += rng.normal(scale=0.06, size=(int(near.sum()), 2))
    layouts = []
    for reach in (rings, 100):
        monkeypatch.setattr(sys.modules["warpflat.flat.surface.untangle"], "_RINGS", reach)
        layouts.append(untangle(surface, flat))
    assert layouts[0][1] == layouts[1][1]
    np.testing.assert_array_equal(layouts[0][0], layouts[1][0])
    assert (layouts[0][0] != flat).any()
