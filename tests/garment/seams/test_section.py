"""Plane sections of a surface: their curves, and the faces split along them."""

from __future__ import annotations

import numpy as np
import pytest
from cut_meshes import broken_by_split, cylinder, dome, flat, grid, surface
from hypothesis import given, settings
from hypothesis import strategies as st
from real_files import DATA, needs_data
from scipy.spatial.transform import Rotation

from warpflat.core.errors import InputError
from warpflat.flat.surface.cut.cut_mesh import cut_along
from warpflat.flat.surface.cut.split_faces import split_faces_along
from warpflat.flat.surface.half_edges import border_edges
from warpflat.flat.surface.io.read import read_surface
from warpflat.flat.surface.paths.trace import locate
from warpflat.garment.seams.section import plane_path, plane_section, plane_sections


def test_plane_section_of_a_dome_lies_in_its_plane_and_reaches_the_border():
    mesh = dome(12, kinds=np.full(121, 2))
    normal = np.array([0.3, 1.0, 0.1])
    path = plane_path(mesh, [0.05, 0.06, 0.44], normal)
    place = locate(mesh, [0.05, 0.06, 0.44])
    origin = sum(w * mesh.vertices[v] for v, w in place.items())
    assert np.abs((path.points - origin) @ normal).max() < 1e-12
    assert not path.closed
    border = {tuple(sorted(edge)) for edge in border_edges(mesh.faces).tolist()}
    for end in (0, -1):
        assert tuple(sorted(v for v in path.support[end].tolist() if v >= 0)) in border
    assert broken_by_split(mesh, split_faces_along(mesh, path)) == []
    cut_kind = cut_along((new := split_faces_along(mesh, path)).surface.faces, [new.path], vertex_count=1000).kind
    assert cut_kind == "split"


@pytest.mark.parametrize("point", [78, [0.05, 0.06, 0.44], [0.03, 0.0375, 0.44]])
def test_plane_section_towards_a_side_is_a_dart_that_ends_at_its_point(point):
    mesh = dome(12, kinds=np.full(121, 1))
    place = locate(mesh, point)
    origin = sum(w * mesh.vertices[v] for v, w in place.items())
    for towards in ([1, 0, 0], [-1, 0, 0]):
        path = plane_path(mesh, point, [0.1, 1.0, 0.0], towards=towards)
        np.testing.assert_allclose(path.points[-1], origin, atol=1e-12)
        assert (path.points[0] - origin) @ towards > 0.1
        result = split_faces_along(mesh, path)
        assert broken_by_split(mesh, result) == []
        cut = cut_along(result.surface.faces, [result.path], vertex_count=len(result.surface.vertices))
        assert cut.kind == "dart"
        assert cut.tips.tolist() == [result.path[-1]]


def test_a_plane_all_through_is_as_it_was_given():
    mesh = dome(12, kinds=np.full(121, 2))
    normal = np.array([0.3, 1.0, 0.1])
    for point in ([0.05, 0.06, 0.44], [0.05, 0.06, 0.0], [2.0, -0.5, 0.25]):
        path = plane_section(mesh, point, normal)
        assert np.abs((path.points - point) @ normal).max() < 1e-12
        result = split_faces_along(mesh, path)
        assert cut_along(result.surface.faces, [result.path], vertex_count=len(result.surface.vertices)).kind == "split"
    # A tube's wall is met on either side of the axis.
    tube = cylinder(12, 5, triangles=True)
    for side in (1.0, -1.0):
        path = plane_section(tube, [3.0 * side, 0.011, 0.1], [0.0, 1.0, 0.0])
        assert (side * path.points[:, 0] > 0).all()
    with pytest.raises(
        InputError, match=r"does not cut the piece .*: along its normal the piece spans .* and the plane"
    ):
        plane_section(tube, [0.0, 0.0, 9.0], [0.0, 0.0, 1.0])
    with pytest.raises(InputError, match="not all zero"):
        plane_section(tube, [0.0, 0.0, 0.1], [0.0, 0.0, 0.0])
    with pytest.raises(InputError, match="a plane's point is three finite numbers"):
        plane_section(tube, [0.0, 0.1], [0.0, 0.0, 1.0])


@pytest.mark.parametrize("seed", range(4))
def test_a_plane_through_a_row_of_vertices_meets_them_whatever_rounding_does_to_their_heights(seed):
    turn = Rotation.random(random_state=seed).as_matrix()
    mesh = surface(flat(5, 5) @ turn.T + [0.3, -0.2, 0.7], grid(5, 5, kinds=np.ones(16, dtype=int)))
    path = plane_path(mesh, mesh.vertices[12], turn @ [0.0, 1.0, 0.0])
    assert sorted(path.support[:, 0].tolist()) == [10, 11, 12, 13, 14]
    assert (path.support[:, 1:] == -1).all()


def test_plane_around_a_tube_is_closed_and_straight_along_vertices():
    tube = cylinder(12, 5, triangles=True)
    path = plane_path(tube, [0.1, 0.0, 0.1], [0.0, 0.0, 1.0])
    assert path.closed
    assert path.length == pytest.approx(12 * 2 * 0.1 * np.sin(np.pi / 12))
    result = split_faces_along(tube, path)
    assert broken_by_split(tube, result) == []
    # Twelve quads with a diagonal each, and the first vertex again.
    assert len(result.path) == 2 * 12 + 1
    through_vertices = plane_path(tube, 12, [0.0, 0.0, 1.0])
    assert sorted(through_vertices.support[:, 0].tolist()) == list(range(12, 24))
    assert (through_vertices.support[:, 1] < 0).all()
    with pytest.raises(InputError, match="closed and reaches no border"):
        plane_path(tube, 12, [0.0, 0.0, 1.0], towards=[0, 1, 0])


def test_a_plane_without_a_normal_and_one_that_only_touches_are_refused():
    mesh = surface(flat(5, 5), grid(5, 5))
    with pytest.raises(InputError, match="not all zero"):
        plane_path(mesh, 12, [0.0, 0.0, 0.0])
    with pytest.raises(InputError, match="only touches the surface at vertex 12"):
        plane_path(mesh, 12, [0.0, 0.0, 1.0])


@settings(max_examples=30, deadline=None, derandomize=True, database=None)
@given(st.integers(0, 2**16), st.integers(3, 9), st.integers(3, 9), st.sampled_from([0.0, 0.05, 0.1, 0.3]))
def test_random_planes_split_random_surfaces(seed, columns, rows, snap):
    rng = np.random.default_rng(seed)
    vertices = flat(columns, rows) + rng.uniform(-0.03, 0.03, (columns * rows, 3))
    mesh = surface(vertices, grid(columns, rows, kinds=rng.integers(0, 3, (columns - 1) * (rows - 1))))
    # From a vertex inside, a plane cannot merely touch the surface.
    inside = (int(rng.integers(1, rows - 1)) * columns) + int(rng.integers(1, columns - 1))
    path = plane_path(mesh, inside, np.append(rng.normal(size=2), 0.0))
    assert broken_by_split(mesh, split_faces_along(mesh, path, snap=snap)) == []


@needs_data
def test_a_plane_splits_a_scan_with_slivers():
    mesh = read_surface(DATA / "front_bodice_raw.obj", units="m")
    centre = mesh.vertices.mean(axis=0) + np.array([0.0, 0.0, 0.2])
    result = split_faces_along(mesh, plane_path(mesh, centre, [0.0, 1.0, 0.0]))
    assert broken_by_split(mesh, result) == []
    cut = cut_along(result.surface.faces, [result.path], vertex_count=len(result.surface.vertices))
    assert cut.kind == "split"


@pytest.mark.parametrize("towards", [[0.0, 1.0, 0.0], [0.0, -2.0, 0.0]])
def test_half_a_plane_ends_at_its_point(towards):
    """A curve from border to border is parted there, and a closed one where the half plane ends on both sides of it."""
    mesh, at = dome(8), np.array([0.0113, 0.0371, 0.0])
    whole = plane_section(mesh, at, [1.0, 0.0, 0.0])
    (half,) = plane_sections(mesh, at, [1.0, 0.0, 0.0], towards=towards)
    (other,) = plane_sections(mesh, at, [1.0, 0.0, 0.0], towards=[-part for part in towards])
    along = (half.points - at) @ np.sign(towards)
    assert along.min() == pytest.approx(0.0, abs=1e-9)
    assert along[[0, -1]].min() == along.min()
    assert half.length + other.length == pytest.approx(whole.length, rel=1e-9)
    (arc,) = plane_sections(cylinder(12, 5), [0.0, 0.0137, 0.11], [0.0, 0.0, 1.0], towards=towards)
    assert not arc.closed
    assert arc.points[[0, -1], 1] == pytest.approx(0.0137, abs=1e-9)
    assert ((arc.points[1:-1, 1] - 0.0137) * towards[1] > 0.0).all()
