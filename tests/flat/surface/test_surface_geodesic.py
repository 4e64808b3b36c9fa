from __future__ import annotations

import numpy as np
import pytest
from real_files import DATA, needs_data
from surface_meshes import cylinder, grid, plane, scattered, sphere

from warpflat.core.errors import InputError
from warpflat.flat.surface.io.read import read_surface
from warpflat.flat.surface.paths.geodesic import distance_from, extend_to_border, signed_distance_and_station
from warpflat.flat.surface.paths.lines import line_on_plane
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.triangles import triangulate


def mirrored(surface, x, y):
    p = np.stack([x, y], axis=1)[triangulate(surface.faces)[0]]
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    return int((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] <= 0).sum())


def test_flat_irregular_triangles_keep_their_coordinates():
    vertices, triangles, column = scattered(800, plane)
    surface = make_surface(vertices, triangles)
    x, y = signed_distance_and_station(surface, column)
    assert np.abs(x - (vertices[:, 0] - 0.5)).max() < 1e-12
    assert np.abs(y - vertices[:, 1]).max() < 1e-12


@pytest.mark.parametrize("triangles", [False, True])
def test_cylinder_unrolls(triangles):
    if triangles:
        vertices, faces, column = scattered(2500, cylinder)
        surface = make_surface(vertices, faces)
    else:
        surface = make_surface(*grid(41, 33, cylinder))
        column = np.arange(33, dtype=np.int32) * 41 + 20
    x, y = signed_distance_and_station(surface, column)
    angle = np.arctan2(surface.vertices[:, 0], surface.vertices[:, 2])
    # Chords instead of arcs are all that is missing.
    assert np.abs(x - 0.2 * angle).max() < 4e-4
    assert np.abs(y - surface.vertices[:, 1]).max() < 4e-4
    assert mirrored(surface, x, y) == 0


def test_error_on_a_sphere_falls_with_the_edge_length():
    error = []
    for n in (21, 41, 81):
        surface = make_surface(*grid(n, n, sphere))
        x, y = signed_distance_and_station(surface, np.arange(n, dtype=np.int32) * n + n // 2)
        p = surface.vertices / 0.2
        middle = np.abs(p[:, 1]) < 0.3
        error.append(
            [
                np.abs(x - 0.2 * np.arcsin(p[:, 0]))[middle].max(),
                np.abs(y - 0.2 * (np.arctan2(p[:, 1], p[:, 2]) + 0.6))[middle].max(),
            ]
        )
        assert mirrored(surface, x, y) == 0
    error = np.array(error)
    assert error[0].max() < 3e-3
    assert (error[1:] < 0.6 * error[:-1]).all()


def test_distance_from_a_point_and_a_line_is_unsigned_and_zero_there():
    surface = make_surface(*grid(41, 41))
    line = np.arange(0, 41)
    distance = distance_from(surface, line)
    assert np.abs(distance - surface.vertices[:, 1]).max() < 1e-12
    centre = distance_from(surface, [20 * 41 + 20])
    exact = np.linalg.norm(surface.vertices - [0.5, 0.5, 0], axis=1)
    assert centre[20 * 41 + 20] == 0
    assert np.abs(centre - exact).max() < 0.03
    with pytest.raises(InputError, match="from 0 to 1680"):
        distance_from(surface, [1681])


def test_line_to_the_right_is_positive_and_turning_the_line_turns_the_signs():
    surface = make_surface(*grid(9, 7))
    column = np.arange(7, dtype=np.int32) * 9 + 2
    x, y = signed_distance_and_station(surface, column)
    assert np.abs(x - (surface.vertices[:, 0] - 0.25)).max() < 1e-12
    back, down = signed_distance_and_station(surface, column[::-1])
    assert np.abs(back + x).max() < 1e-12
    assert np.abs(down - (1 - y)).max() < 1e-12


def test_line_inside_is_carried_on_to_the_border():
    surface = make_surface(*grid(41, 33, cylinder))
    part = np.arange(8, 20, dtype=np.int32) * 41 + 20
    longer, start = extend_to_border(surface, part)
    assert longer.tolist() == (np.arange(33) * 41 + 20).tolist()
    assert longer[start] == part[0]
    x, y = signed_distance_and_station(surface, part)
    assert np.abs(x - 0.2 * np.arctan2(surface.vertices[:, 0], surface.vertices[:, 2])).max() < 1e-4
    assert np.abs(y - (surface.vertices[:, 1] - surface.vertices[part[0], 1])).max() < 1e-12


def test_where_cloth_is_folded_flat_no_line_is_carried_on():
    """There is no tangent plane in which the way ahead could be straight: the normals around the vertex add up to nothing."""
    vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.9, 0.0, 0.0], [0.0, -1.0, 0.0]]
    surface = make_surface(vertices, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]])
    assert extend_to_border(surface, np.array([4, 0], dtype=np.int32))[0].tolist() == [4, 0]


def test_beyond_the_ends_of_a_line_that_stays_inside_nothing_folds():
    surface = make_surface(*grid(41, 41))
    part = np.arange(12, 29, dtype=np.int32) * 41 + 20
    x, y = signed_distance_and_station(surface, part, extend=False)
    assert np.abs(x - (surface.vertices[:, 0] - 0.5)).max() < 0.12
    assert np.abs(y - (surface.vertices[:, 1] - 0.3)).max() < 0.12
    beside = np.abs(surface.vertices[:, 1] - 0.5) < 0.15
    assert np.abs(x - (surface.vertices[:, 0] - 0.5))[beside].max() < 1e-9
    assert mirrored(surface, x, y) == 0


def test_sides_hold_where_the_line_does_not_part_the_surface():
    vertices, quads = grid(21, 21)
    ring = quads[~((np.abs(vertices[quads].mean(axis=1) - 0.5) < 0.15)[:, :2].all(axis=1))]
    surface = make_surface(vertices, ring)
    column = np.flatnonzero((surface.vertices[:, 0] == 0.5) & (surface.vertices[:, 1] > 0.6))
    x, y = signed_distance_and_station(surface, column)
    off = surface.vertices[:, 0] - 0.5
    near = (surface.vertices[:, 1] > 0.65) & (np.abs(off) > 0.01)
    assert np.array_equal(np.sign(x[near]), np.sign(off[near]))
    assert np.isfinite(y).all()


def test_slivers_do_not_disturb():
    vertices, triangles, column = scattered(400, plane)
    cap = np.append(vertices, [[*(vertices[triangles[50]] * [[0.4985], [0.4985], [0.003]]).sum(axis=0)]], axis=0)
    a, b, c = triangles[50]
    n = len(vertices)
    faces = np.vstack([np.delete(triangles, 50, axis=0), [[a, b, n], [b, c, n], [c, a, n]]])
    surface = make_surface(cap, faces)
    assert len(surface.vertices) == n + 1
    x, y = signed_distance_and_station(surface, column)
    assert np.abs(x - (cap[:, 0] - 0.5)).max() < 1e-9
    assert np.abs(y - cap[:, 1]).max() < 1e-9


def test_closed_or_empty_line_is_no_datum():
    surface = make_surface(*grid(5, 5))
    for line in ([0, 1, 6, 5, 0], [3]):
        with pytest.raises(InputError, match="must be open"):
            signed_distance_and_station(surface, line)


@needs_data
@pytest.mark.parametrize(("name", "most"), [("garment_shirtfront", 0.001), ("front_bodice_raw", 0.003)])
def test_first_layout_of_real_pieces_is_nearly_free_of_folds(name, most):
    surface = read_surface(DATA / f"{name}.obj", units="m")
    centre = surface.vertices.mean(axis=0)
    line = line_on_plane(surface, centre, [1, 0, 0])
    x, y = signed_distance_and_station(surface, line)
    assert mirrored(surface, x, y) <= most * len(surface.faces)
    length = np.linalg.norm(np.diff(surface.vertices[line], axis=0), axis=1)
    assert y[line] == pytest.approx(np.concatenate([[0], np.cumsum(length)]))
    assert np.abs(x[line]).max() == 0
