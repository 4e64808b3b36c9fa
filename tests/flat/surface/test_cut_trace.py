"""Straight paths across faces: geodesics, and the faces split along them."""

from __future__ import annotations

import numpy as np
import pytest
from cut_meshes import broken_by_split, cylinder, dome, flat, glue, grid, surface
from hypothesis import given, settings
from hypothesis import strategies as st
from real_files import DATA, needs_data

from warpflat.core.errors import InputError
from warpflat.flat.surface.cut.cut_mesh import cut_along
from warpflat.flat.surface.cut.split_faces import split_faces_along
from warpflat.flat.surface.half_edges import border_edges
from warpflat.flat.surface.paths.trace import VertexStar, geodesic_path, locate, path_triangles, polyline_path


def smallest_angles(mesh):
    corner = mesh.vertices[path_triangles(mesh)[0]]
    angles = []
    for k in range(3):
        u, v = corner[:, (k + 1) % 3] - corner[:, k], corner[:, (k + 2) % 3] - corner[:, k]
        angles.append(np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v)))
    return np.min(angles, axis=0)


def test_locate_finds_vertices_edges_and_faces():
    mesh = surface(flat(4, 4), grid(4, 4, kinds=np.ones(9, dtype=int)))
    assert locate(mesh, 5) == {5: 1.0}
    assert locate(mesh, [0.1, 0.1, 0.4]) == {5: 1.0}
    on_edge = locate(mesh, [0.13, 0.1, 0.0])
    assert on_edge == pytest.approx({5: 0.7, 6: 0.3})
    inside = locate(mesh, [0.15, 0.12, -1.0])
    assert sum(w * mesh.vertices[v] for v, w in inside.items()) == pytest.approx([0.15, 0.12, 0.0])
    assert len(inside) == 3
    assert locate(mesh, [-1.0, -1.0, 0.0]) == {0: 1.0}


@pytest.mark.parametrize("kind", [0, 1, 2])
def test_geodesic_of_a_flat_sheet_is_the_straight_line(kind):
    mesh = surface(flat(7, 6), grid(7, 6, kinds=np.full(30, kind)))
    a, b = np.array([0.03, 0.11, 0.0]), np.array([0.52, 0.44, 0.0])
    path = geodesic_path(mesh, a, b)
    assert path.length == pytest.approx(np.linalg.norm(b - a), rel=1e-12)
    np.testing.assert_allclose(path.points[[0, -1]], [a, b], atol=1e-12)
    star = VertexStar(path_triangles(mesh)[0])
    for one, two in zip(path.support[:-1].tolist(), path.support[1:].tolist(), strict=True):
        assert star.sharing([v for v in one + two if v >= 0])
    result = split_faces_along(mesh, path, snap=0.0)
    assert broken_by_split(mesh, result) == []
    drawn = result.surface.vertices[result.path]
    direction = (b - a) / np.linalg.norm(b - a)
    off = np.linalg.norm(np.cross(drawn - a, direction), axis=1)
    assert off.max() < 1e-6


def test_geodesic_of_a_tube_is_straight_when_unrolled():
    around, radius, height = 40, 0.1, 0.3
    tube = cylinder(around, 13, radius=radius, height=height, triangles=True)
    steps, rise = 11, height
    path = geodesic_path(tube, 0, 12 * around + steps)
    chord = 2 * radius * np.sin(np.pi / around)
    assert path.length == pytest.approx(np.hypot(steps * chord, rise), rel=1e-9)


def test_snapping_stays_near_the_line_and_leaves_no_slivers():
    mesh = surface(flat(21, 21, step=0.01), grid(21, 21, kinds=np.ones(400, dtype=int)))
    rng = np.random.default_rng(5)
    worst_snapped = worst_exact = np.pi
    for _ in range(12):
        a, b = np.column_stack([rng.uniform(0, 0.2, (2, 2)), [0.0, 0.0]])
        path = geodesic_path(mesh, a, b)
        result = split_faces_along(mesh, path, snap=0.1)
        assert broken_by_split(mesh, result) == []
        drawn = result.surface.vertices[result.path]
        direction = (b - a) / np.linalg.norm(b - a)
        off = np.linalg.norm(np.cross(drawn - a, direction), axis=1)
        assert off.max() <= 0.1 * 0.01 * np.sqrt(2)
        worst_snapped = min(worst_snapped, smallest_angles(result.surface).min())
        worst_exact = min(worst_exact, smallest_angles(split_faces_along(mesh, path, snap=0.0).surface).min())
    assert np.degrees(worst_snapped) > 3.0
    assert worst_exact < 0.5 * worst_snapped


def test_quads_beside_the_path_stay_quads():
    mesh = dome(11)
    result = split_faces_along(mesh, geodesic_path(mesh, [-0.2, -0.13, 0.4], [0.18, 0.03, 0.4]))
    assert broken_by_split(mesh, result) == []
    divided = np.bincount(result.face_origin, minlength=len(mesh.faces)) > 1
    assert 8 <= divided.sum() <= 25
    kept = result.surface.faces[~divided[result.face_origin]]
    np.testing.assert_array_equal(kept, mesh.faces[~divided])
    assert (kept[:, 3] >= 0).all()


def test_a_detour_back_to_a_vertex_is_left_out():
    mesh = surface(flat(4, 4), grid(4, 4, kinds=np.ones(9, dtype=int)))
    corners = [[0.0, 0.1, 0.0], [0.1, 0.1, 0.0], [0.13, 0.14, 0.0], [0.1, 0.1, 0.0], [0.3, 0.1, 0.0]]
    result = split_faces_along(mesh, polyline_path(mesh, corners))
    assert result.path.tolist() == [4, 5, 6, 7]
    np.testing.assert_array_equal(result.surface.faces, mesh.faces)


def test_feature_lines_take_in_the_vertices_on_their_edges():
    base = dome(9, kinds=np.full(64, 2))
    mesh = surface(base.vertices, base.faces, {"level": list(range(36, 45)), "down": list(range(76, 3, -9))})
    result = split_faces_along(mesh, geodesic_path(mesh, [-0.21, -0.2, 0.4], [0.2, 0.15, 0.4]))
    assert broken_by_split(mesh, result) == []
    for name, line in mesh.lines.items():
        new = result.surface.lines[name]
        assert len(new) > len(line)
        assert [v for v in new.tolist() if v < len(mesh.vertices)] == line.tolist()
        crossing = [v for v in new.tolist() if v >= len(mesh.vertices)]
        assert set(crossing) <= set(result.path.tolist())


def test_path_along_edges_changes_nothing():
    mesh = surface(flat(5, 5), grid(5, 5))
    result = split_faces_along(mesh, geodesic_path(mesh, 2, 17))
    assert result.path.tolist() == [2, 7, 12, 17]
    np.testing.assert_array_equal(result.surface.faces, mesh.faces)


def test_path_within_one_face():
    mesh = surface(flat(2, 2), grid(2, 2, kinds=np.ones(1, dtype=int)))
    result = split_faces_along(mesh, geodesic_path(mesh, [0.05, 0.02, 0], [0.08, 0.04, 0]))
    assert broken_by_split(mesh, result) == []
    assert len(result.path) == 2
    assert len(result.surface.faces) == 6


def test_polyline_goes_through_its_points_and_may_close():
    mesh = dome(15, kinds=np.ones(196, dtype=int))
    corners = [[-0.1, -0.12, 0.4], [0.13, -0.1, 0.4], [0.02, 0.14, 0.4]]
    path = polyline_path(mesh, corners, closed=True)
    for corner in corners:
        place = locate(mesh, corner)
        point = sum(w * mesh.vertices[v] for v, w in place.items())
        assert np.linalg.norm(path.points - point, axis=1).min() < 1e-12
    result = split_faces_along(mesh, path)
    assert broken_by_split(mesh, result) == []
    assert result.path[0] == result.path[-1]
    cut = cut_along(result.surface.faces, [result.path], vertex_count=len(result.surface.vertices))
    assert cut.kind == "hole"


def test_refusals():
    mesh = surface(flat(5, 5), grid(5, 5))
    with pytest.raises(InputError, match="two different end points; both are at vertex 3"):
        geodesic_path(mesh, 3, 3)
    with pytest.raises(InputError, match="vertex 25 does not exist"):
        geodesic_path(mesh, 3, 25)
    with pytest.raises(InputError, match="three finite numbers"):
        locate(mesh, [0.0, np.nan, 0.0])
    with pytest.raises(InputError, match="at least 3 points, got 2"):
        polyline_path(mesh, [0, 1], closed=True)
    with pytest.raises(InputError, match=r"snap is a share .* got 0.7"):
        split_faces_along(mesh, geodesic_path(mesh, 0, 13), snap=0.7)
    with pytest.raises(InputError, match="crosses itself"):
        split_faces_along(mesh, polyline_path(mesh, [[0.05, 0.05, 0], [0.35, 0.3, 0], [0.3, 0.05, 0], [0.08, 0.33, 0]]))
    with pytest.raises(InputError, match="too short"):
        split_faces_along(mesh, geodesic_path(mesh, 12, [0.201, 0.2, 0.0]))
    two = surface(np.concatenate([flat(2, 2), flat(2, 2) + 1.0]), np.concatenate([grid(2, 2), grid(2, 2) + 4]))
    with pytest.raises(InputError, match="separate parts"):
        geodesic_path(two, 0, 5)


@settings(max_examples=60, deadline=None, derandomize=True, database=None)
@given(st.integers(0, 2**16), st.integers(3, 9), st.integers(3, 9), st.sampled_from([0.0, 0.05, 0.1, 0.3]))
def test_random_paths_on_random_surfaces(seed, columns, rows, snap):
    rng = np.random.default_rng(seed)
    vertices = flat(columns, rows) + rng.uniform(-0.03, 0.03, (columns * rows, 3))
    faces = grid(columns, rows, kinds=rng.integers(0, 3, (columns - 1) * (rows - 1)))
    row = columns * int(rng.integers(0, rows)) + np.arange(columns)
    mesh = surface(vertices, faces, {"level": row.tolist()})
    ends = rng.integers(0, len(vertices), 2)
    if ends[0] == ends[1]:
        return
    points = vertices[ends] + rng.normal(scale=0.01, size=(2, 3))
    if int(rng.integers(0, 2)):
        path = geodesic_path(mesh, int(ends[0]), int(ends[1]))
    else:
        path = geodesic_path(mesh, *points)
    try:
        result = split_faces_along(mesh, path, snap=snap)
    except InputError as error:
        # A short path may shrink to a point; straight, none crosses itself.
        if "too short" not in str(error) or path.length > 0.3:
            raise
        return
    assert broken_by_split(mesh, result) == []
    assert result.surface.vertices[result.path[0]] == pytest.approx(path.points[0], abs=0.3 * 0.25)
    on_border = set(border_edges(result.surface.faces).ravel().tolist())
    inside = [v for v in result.path.tolist()[1:-1] if v not in on_border]
    if len(inside) == len(result.path) - 2 and len(inside) > 0:
        cut = cut_along(result.surface.faces, [result.path], vertex_count=len(result.surface.vertices))
        np.testing.assert_array_equal(glue(cut), result.surface.faces)


@needs_data
def test_a_scan_with_slivers():
    rows = [line.split() for line in (DATA / "front_bodice_raw.obj").read_text().splitlines()]
    vertices = np.array([[float(x) for x in row[1:4]] for row in rows if row and row[0] == "v"])
    faces = np.array([[int(x.split("/")[0]) - 1 for x in row[1:4]] + [-1] for row in rows if row and row[0] == "f"])
    mesh = surface(vertices, faces)
    rng = np.random.default_rng(2)
    for _ in range(4):
        a, b = vertices[rng.integers(0, len(vertices), 2)]
        assert broken_by_split(mesh, split_faces_along(mesh, geodesic_path(mesh, a, b))) == []
