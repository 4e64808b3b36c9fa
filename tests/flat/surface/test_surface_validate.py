from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from real_files import DATA, needs_data
from surface_meshes import broken_invariants, cylinder, grid, scattered

from warpflat.core.errors import InputError
from warpflat.flat.surface.connectivity import border_loops
from warpflat.flat.surface.io.read import read_surface
from warpflat.flat.surface.repair.layers import Layer
from warpflat.flat.surface.repair.polygons import _quad_corners, find_crossed_quads
from warpflat.flat.surface.repair.slivers import degenerate_faces
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.triangles import triangulate


def area(surface):
    p = surface.vertices[triangulate(surface.faces)[0]]
    return np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2


def refusal(vertices, polygons, **options):
    """The line that refuses a mesh and begins with its name; "" if there is none."""
    try:
        make_surface(vertices, polygons, name="sleeve", **options)
    except InputError as error:
        message = str(error)
        return message if message.startswith("sleeve: ") and "\n" not in message else ""
    return ""


@pytest.mark.parametrize(("tolerance", "found"), [(0.38, []), (0.40, [0])])
def test_the_width_of_a_quad_is_twice_its_area_over_its_longer_diagonal(tolerance, found):
    """A trapezoid: its area is 0.08 m2, its diagonals are 0.806 m long, its edges meet at corners by 0.512 m in the mean."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.8, 0.1, 0.0], [0.2, 0.1, 0.0]])
    assert degenerate_faces(corners, np.array([[0, 1, 2, 3]], np.int32), tolerance).tolist() == found


def test_clean_mesh_comes_through_untouched():
    vertices, quads = grid(4, 3)
    surface = make_surface(vertices, quads, lines={"left": [0, 4, 8]})
    assert broken_invariants(surface) == []
    assert np.array_equal(surface.vertices, vertices)
    assert np.array_equal(surface.faces, quads)
    assert surface.notes == ()
    assert surface.lines["left"].tolist() == [0, 4, 8]


def test_lists_of_any_size_are_faces():
    surface = make_surface(grid(3, 2)[0].tolist(), [[0, 1, 4, 3], [1, 2, 4], (2, 5, 4)])
    assert surface.faces.tolist() == [[0, 1, 4, 3], [1, 2, 4, -1], [2, 5, 4, -1]]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_first_vertex_that_is_not_finite_is_named(bad):
    vertices, quads = grid(4, 3)
    vertices[[5, 7], 1] = bad
    assert "vertex 5 (counted from 0) is not finite" in refusal(vertices, quads)


@pytest.mark.parametrize(
    ("vertices", "polygons", "words"),
    [
        (np.empty((0, 3)), [[0, 1, 2]], "no vertices"),
        (np.zeros((4, 2)), [[0, 1, 2]], "#V by 3, got an array of shape (4, 2)"),
        ([["a", "b", "c"]], [[0, 1, 2]], "must be numbers"),
        ([[0, 0, 0], [1, 0, 0], [1, 1j, 0]], [[0, 1, 2]], "must be numbers"),
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0.0, 1.7, 2]], "face 0 (counted from 0) is [0.0, 1.7, 2]; its corners"),
        (
            [[0, 0, 0], [1, 0, 0], [1, 1, 0]],
            [[0, 1, 2], ["0", "1", "2"]],
            "face 1 (counted from 0) is ['0', '1', '2']; its corners",
        ),
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0]], None, "faces must be lists of vertex indices"),
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0]], 3, "faces must be lists of vertex indices"),
        (np.eye(3), [], "no faces"),
        (np.eye(3), np.empty((0, 3), dtype=int), "no faces"),
        (np.eye(3), [[0, 1]], "face 0 has 2 corners"),
        (np.eye(3), [[0, 1, 3]], "face 0 (counted from 0) refers to vertex 3, but there are 3 vertices (0 to 2)"),
        (np.eye(3), [[0, 1, -2]], "negative vertex index"),
        (np.eye(3), np.array([[0.0, 1.0, 2.0]]), "must be integers"),
        (np.eye(3), [["x", "y", "z"]], "lists of vertex indices"),
        (np.eye(3), [[0, 1, 1], [2, 2, 0]], "repeated vertices: nothing remains"),
    ],
)
def test_what_is_no_mesh_is_refused(vertices, polygons, words):
    assert words in refusal(vertices, polygons)


def test_faces_with_repeated_vertices_are_dropped_or_reduced_with_a_note():
    vertices, quads = grid(3, 3)
    polygons = [*quads.tolist(), [0, 0, 1], [1, 2, 1, 4]]
    surface = make_surface(vertices, polygons)
    assert len(surface.faces) == 4
    assert surface.notes == ("2 faces with repeated vertices dropped: 4, 5",)
    fan = make_surface(vertices, [[0, 1, 4, 4], [0, 4, 3, 3]])
    assert (fan.faces[:, 3] == -1).all()
    assert "2 faces with a doubled corner" in fan.notes[0]


def test_repeated_faces_are_dropped_with_a_note():
    vertices, quads = grid(3, 2)
    surface = make_surface(vertices, [*quads.tolist(), quads[0, ::-1].tolist()])
    assert np.array_equal(surface.faces, quads)
    assert surface.notes == ("1 face of 5,000 cm2 dropped that had the vertices of another: 2",)


@pytest.mark.parametrize("where", [0, 5, 7])
@pytest.mark.parametrize("order", [(0, 2, 1, 3), (1, 0, 2, 3)])
def test_a_quad_with_corners_out_of_order_is_cut_as_they_belong(where, order):
    # At a corner, at the border and inside; it made the surface one-sided, or tore a hole into it.
    vertices, quads = grid(5, 5)
    twisted = quads.copy()
    twisted[where] = quads[where][list(order)]
    surface = make_surface(vertices, twisted)
    whole = np.delete(surface.faces, np.flatnonzero(surface.faces[:, 3] < 0), axis=0)
    assert np.array_equal(np.sort(whole, axis=1), np.sort(np.delete(quads, where, axis=0), axis=1))
    assert len(border_loops(surface.faces)) == 1
    assert len(surface.vertices) == len(vertices)
    assert Layer(surface.vertices, surface.faces).area == pytest.approx(Layer(vertices, quads).area)
    assert f"1 quad with corners out of order, whose sides crossed, cut into triangles: {where}" in surface.notes


def test_unused_vertices_go_but_the_input_stays():
    vertices, quads = grid(3, 2)
    padded = np.vstack([[[9, 9, 9]], vertices[:3], [[8, 8, 8]], vertices[3:]])
    where = np.array([1, 2, 3, 5, 6, 7])
    surface = make_surface(padded, where[quads], lines={"left": [1, 5]})
    assert np.array_equal(surface.vertices, vertices)
    assert np.array_equal(surface.input_vertices, padded)
    assert np.array_equal(surface.input_index, where)
    assert surface.lines["left"].tolist() == [0, 3]


@pytest.mark.parametrize("order", [1, -1])
def test_large_polygons_become_triangles_also_where_they_are_not_convex(order):
    outline = np.array([[0, 0], [4, 0], [4, 3], [2, 1], [0, 3]], dtype=float)
    for turn in range(3):
        vertices = np.roll(np.column_stack([outline, np.zeros(5)]), turn, axis=1)
        surface = make_surface(vertices, [np.arange(5)[::order].tolist()])
        assert broken_invariants(surface) == []
        assert len(surface.faces) == 3
        assert area(surface) == pytest.approx(8.0)
        assert surface.notes == ("1 face of more than four corners cut into triangles",)


def test_polygon_that_crosses_itself_is_named():
    eight = [[-1, -1, 0], [1, 1, 0], [1.5, 0, 0], [1, -1, 0], [-1, 1, 0], [-1.5, 0, 0]]
    vertices = np.vstack([eight, [[0, 0, 1], [1, 0, 1], [0, 1, 1]]])
    assert "face 1 (counted from 0) crosses itself" in refusal(vertices, [[6, 7, 8], [0, 1, 2, 3, 4, 5]])


def test_quad_with_straight_or_inward_corner_is_cut_from_there():
    for corner in ([0.5, 0.5, 0.0], [0.3, 0.2, 0.0]):
        vertices = np.array([[0, 0, 0], [1, 0, 0], corner, [0, 1, 0]], dtype=float)
        surface = make_surface(vertices, [[0, 1, 2, 3]])
        assert surface.faces.tolist() == [[2, 3, 0, -1], [2, 0, 1, -1]]
        assert "straight or inward corner" in surface.notes[0]


@pytest.mark.parametrize("turn", range(4))
@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("crossing", [True, False])
def test_folded_quad_is_cut_where_its_halves_lie_flatter(turn: int, order: int, crossing: bool):
    if crossing:
        quad = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1.5, 0]])
    else:
        quad = np.array([[0, 0, 0], [5, 0, 4], [1, 5, 1], [1, 0, 0]])
    faces = [np.roll([0, 1, 2, 3], turn)[::order].tolist()]
    if not crossing:
        faces.append([2, 1, 4, 5][::order])
    surface = make_surface(np.vstack([quad, [[4, 8, 12], [0, 12, 9]]]), faces)
    assert broken_invariants(surface) == []
    assert surface.notes[0] == "1 quad folded over, or with crossing sides, cut into triangles: 0"
    cut = [set(face[:3]) for face in surface.faces.tolist() if face[3] < 0]
    # Both ways the crossing one is folded flat: the shorter diagonal is taken.
    assert cut[0] & cut[1] == ({0, 2} if crossing else {1, 3})


def test_two_quads_around_one_vertex_are_cut_from_it():
    vertices = np.array([[-1, 0, 0], [0, -1, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0.9]], dtype=float)
    quads = [[0, 1, 2, 4], [0, 4, 2, 3]]
    surface = make_surface(vertices, quads)
    assert broken_invariants(surface) == []
    assert surface.notes == ("2 quads that meet another at a vertex of no other face cut into triangles: 0, 1",)
    assert [face.count(4) for face in surface.faces.tolist()] == [1, 1, 1, 1]


def test_winding_is_mended_with_a_note():
    vertices, quads = grid(4, 4)
    mixed = quads.copy()
    mixed[[2, 7]] = mixed[[2, 7], ::-1]
    surface = make_surface(vertices, mixed)
    assert broken_invariants(surface) == []
    assert surface.notes == ("the winding of 2 faces was turned to agree with the others",)


def test_two_components_are_listed_and_can_be_chosen():
    vertices, quads = grid(5, 2)
    parts = quads[[0, 2, 3]]
    message = refusal(vertices, parts)
    assert "2 components" in message
    assert "2 and 1 faces" in message
    assert 'component = "largest"' in message
    for choice, faces in (("largest", 2), (0, 2), (1, 1)):
        surface = make_surface(vertices, parts, component=choice)
        assert broken_invariants(surface) == []
        assert len(surface.faces) == faces
    assert "component 2 does not exist" in refusal(vertices, parts, component=2)
    assert "does not exist" in refusal(vertices, parts, component="big")


def test_line_off_the_chosen_component_is_left_out_with_a_note():
    vertices, quads = grid(5, 2)
    surface = make_surface(vertices, quads[[0, 2, 3]], component=1, lines={"there": [0, 5], "here": [3, 8]})
    assert set(surface.lines) == {"there"}
    assert any("'here'" in note for note in surface.notes)


def test_crowded_edge_names_vertices_and_faces():
    vertices = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1.0]])
    message = refusal(vertices, [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert "edge between vertices 0 and 1" in message
    assert "0, 1, 2" in message


def test_bow_tie_is_parted_in_the_shared_vertex():
    vertices, quads = grid(4, 4)
    ring = np.delete(quads, [0, 4], axis=0)
    surface = make_surface(vertices, ring, lines={"up": [5, 6], "down": [1, 5]})
    assert broken_invariants(surface) == []
    assert len(surface.vertices) == 16
    assert surface.input_index[-1] == 5
    assert np.array_equal(surface.vertices[-1], vertices[5])
    assert "vertices 5" in surface.notes[0]


def test_closed_surface_and_handle_are_refused():
    box = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    corners = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=float)
    assert "closed" in refusal(corners, box)
    n, m = 8, 6
    i = np.arange(n * m).reshape(n, m)
    torus = np.stack([i, np.roll(i, -1, 0), np.roll(np.roll(i, -1, 0), -1, 1), np.roll(i, -1, 1)], -1).reshape(-1, 4)
    a, b = np.meshgrid(2 * np.pi * np.arange(n) / n, 2 * np.pi * np.arange(m) / m, indexing="ij")
    place = np.stack([(2 + np.cos(b)) * np.cos(a), (2 + np.cos(b)) * np.sin(a), np.sin(b)], -1).reshape(-1, 3)
    assert "1 handle" in refusal(place, torus[1:])


def test_annulus_is_let_through():
    _, quads = grid(5, 5)
    surface = make_surface(grid(5, 5)[0], np.delete(quads, [5, 6, 9, 10], axis=0))
    assert len(border_loops(surface.faces)) == 2


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ([0, 5], "breaks between vertices 0 and 5"),
        ([0, 99], "refers to vertex 99"),
        ([3], "at least two"),
        ([0.5, 1.5], "vertex indices"),
    ],
)
def test_line_that_is_none_is_refused(line, words):
    assert words in refusal(*grid(4, 3), lines={"front": line})


def split_per_corner(vertices, quads):
    return vertices[quads.ravel()], np.arange(quads.size).reshape(quads.shape)


def test_split_corners_are_welded_where_faces_hang_together_in_no_other_way():
    vertices, quads = grid(5, 4)
    soup = split_per_corner(vertices, quads)
    for options in ({}, {"split_corners": True}, {"weld": True}):
        surface = make_surface(*soup, **options)
        assert broken_invariants(surface) == []
        assert len(surface.vertices) == 20
        assert len(surface.input_vertices) == 48
        assert "joined" in surface.notes[0]
    assert "12 components" in refusal(*soup, weld=False)


def test_vertices_a_rounding_apart_are_one_place():
    vertices, quads = grid(5, 4)
    points, faces = split_per_corner(vertices, quads)
    points = points + 1e-9 * np.random.default_rng(0).uniform(-1, 1, points.shape)
    assert len(make_surface(points, faces).vertices) == 20


def test_a_cut_stays_open_and_a_tube_is_not_closed_behind_ones_back():
    vertices, quads = grid(9, 4)
    angle = 2 * np.pi * vertices[:, 0]
    tube = np.column_stack([np.cos(angle).round(12), vertices[:, 1], np.sin(angle).round(12)])
    assert len(make_surface(tube, quads).vertices) == 36
    kept = make_surface(tube, quads, split_corners=True)
    assert len(kept.vertices) == 36
    assert "would close the piece" in kept.notes[0]
    closed = make_surface(tube, quads, weld=True)
    assert len(closed.vertices) == 32
    assert len(border_loops(closed.faces)) == 2


def test_panels_with_a_common_seam_stay_apart_when_one_is_chosen():
    vertices, quads = grid(3, 2)
    both = np.vstack([vertices, vertices + np.array([1, 0, 0])])
    faces = np.vstack([quads, quads + 6])
    assert len(make_surface(both, faces, component=1).faces) == 2
    assert len(make_surface(both, faces).faces) == 4


def needle_mesh(gap):
    """A 5 by 5 grid of triangles whose middle vertex is doubled, `gap` apart, with two needles between."""
    vertices, quads = grid(5, 5)
    triangles = triangulate(quads)[0].tolist()
    new = len(vertices)
    vertices = np.vstack([vertices, vertices[12] + [gap, 0.0, 0.0]])
    for face in triangles:
        if 12 in face and np.mean(vertices[face][:, 0]) > 0.5:
            face[face.index(12)] = new
    around = [f for f in triangles if new in f]
    ends = [v for v in {x for f in around for x in f} - {new} if any(12 in f and v in f for f in triangles)]
    for v in ends:
        face = [12, new, v] if vertices[v, 1] > 0.5 else [new, 12, v]
        triangles.append(face)
    return vertices, np.array(triangles)


def test_needles_are_collapsed_and_nothing_else_moves():
    vertices, triangles = needle_mesh(1e-5)
    surface = make_surface(vertices, triangles, lines={"up": [2, 7, 12, 17, 22]})
    assert broken_invariants(surface) == []
    assert len(degenerate_faces(surface.vertices, surface.faces)) == 0
    assert len(surface.vertices) == 25
    assert len(surface.faces) == 32
    assert surface.lines["up"].tolist() == [2, 7, 12, 17, 22]
    assert "2 degenerate faces" in surface.notes[0]
    assert "32, 33" in surface.notes[0]
    kept = make_surface(*needle_mesh(0.01))
    assert len(kept.vertices) == 26
    assert kept.notes == ()


def test_caps_are_fanned_from_their_corner_inside_and_at_the_border():
    vertices, quads = grid(4, 4)
    triangles = [f for f in triangulate(quads)[0].tolist() if f != [5, 6, 10]]
    n = len(vertices)
    for height, offset in ((1e-6, 1e-6), (0.0, 0.0)):
        # A vertex on the diagonal 5-10, in the triangle 5 6 10: the cap has the diagonal for its longest side.
        middle = (vertices[5] + vertices[10]) / 2 + [height, -offset, 0]
        faces = [*triangles, [5, n, 10], [5, 6, n], [6, 10, n]]
        surface = make_surface(np.vstack([vertices, middle]), faces, lines={"slant": [5, 10]})
        assert broken_invariants(surface) == []
        assert len(degenerate_faces(surface.vertices, surface.faces)) == 0
        assert area(surface) == pytest.approx(1.0, abs=1e-5)
        assert len(surface.vertices) == n + 1
        assert surface.lines["slant"].tolist() == [5, n, 10]
    # A cap whose longest side is on the border.
    low = (vertices[0] + vertices[1]) / 2 + [0, 1e-6, 0]
    rest = [f for f in triangulate(quads)[0].tolist() if not {0, 1} <= set(f)]
    faces = [*rest, [0, 1, n], [1, 5, n], [5, 0, n]]
    surface = make_surface(np.vstack([vertices, low]), faces)
    assert broken_invariants(surface) == []
    assert n in border_loops(surface.faces)[0]
    assert area(surface) == pytest.approx(1.0, abs=1e-5)


def test_cap_beside_a_quad_is_fanned_too():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, -1e-7, 0], [0.5, -1, 0]])
    surface = make_surface(vertices, [[0, 1, 2, 3], [0, 4, 1], [4, 0, 5], [1, 4, 5]])
    assert broken_invariants(surface) == []
    assert area(surface) == pytest.approx(1.5, abs=1e-6)
    assert len(surface.faces) == 5


def test_quad_with_a_short_side_becomes_a_triangle_and_a_flat_one_goes():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1 - 1e-7, 1, 0], [2, 0, 0], [2, 1, 0]])
    short = make_surface(vertices, [[0, 1, 2, 3], [1, 4, 5, 2]])
    assert broken_invariants(short) == []
    assert sorted((short.faces >= 0).sum(axis=1)) == [3, 4]
    points, quads = grid(3, 3)
    points = np.insert(points, 6, points[3:6] + np.array([0, 1e-7, 0]), axis=0)
    quads = np.vstack([quads[:2], quads[:2] + 3, quads[:2] + 6])
    flat = make_surface(points, quads)
    assert broken_invariants(flat) == []
    assert len(flat.faces) == 4
    assert area(flat) == pytest.approx(1.0, abs=1e-6)


def test_zero_area_spike_is_refused_with_its_face():
    vertices, quads = grid(3, 3)
    tip = np.vstack([vertices, [[2.0, 2.0, 0.0]]])
    tip[5] = [1.0, 1.0 - 1e-9, 0.0]
    faces = [*quads.tolist(), [5, 9, 8]]
    tip[5], tip[8] = [1.0, 0.5, 0.0], [1.0, 1.0, 0.0]
    tip[9] = [1.0, 3.0, 0.0]
    message = refusal(tip, faces)
    assert "1 degenerate face " in message
    assert ": 4 (counted from 0)" in message


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 6), st.integers(2, 6), st.booleans())
def test_any_order_winding_or_splitting_gives_the_same_surface(seed, columns, rows, split):
    random = np.random.default_rng(seed)
    vertices, quads = grid(columns, rows, cylinder)
    faces = quads[random.permutation(len(quads))]
    flip = random.random(len(faces)) < 0.4
    faces[flip] = faces[flip, ::-1]
    faces = np.take_along_axis(faces, (np.arange(4) + random.integers(0, 4, (len(faces), 1))) % 4, axis=1)
    points = vertices
    if split and len(quads) > 1:
        points, faces = split_per_corner(vertices, faces)
    surface = make_surface(points, faces)
    assert broken_invariants(surface) == []
    assert len(surface.vertices) == len(vertices)
    assert len(surface.faces) == len(quads)
    assert area(surface) == pytest.approx(area(make_surface(vertices, quads)), rel=1e-12)
    assert len(border_loops(surface.faces)[0]) == 2 * (columns + rows) - 4


# In the first example a sliver lies on a side of a face that is almost one itself; in the second the face beyond it becomes one.
@settings(max_examples=30, deadline=None, derandomize=True)
@example(34192, 10)
@example(33554433, 6)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_random_slivers_are_merged_without_losing_area_or_border(seed, count):
    random = np.random.default_rng(seed)
    vertices, triangles, _ = scattered(120, cylinder, seed=1)
    faces = triangles.tolist()
    points = vertices.tolist()
    for _ in range(count):
        face = faces.pop(int(random.integers(len(faces))))
        share = random.dirichlet(np.full(3, 0.2)) if random.random() < 0.5 else random.permutation([0.5, 0.5, 0.0])
        share = (share + 1e-6) / (1 + 3e-6)
        n = len(points)
        points.append((share @ np.array([points[v] for v in face])).tolist())
        faces += [[face[0], face[1], n], [face[1], face[2], n], [face[2], face[0], n]]
    before = make_surface(vertices, triangles)
    surface = make_surface(points, faces)
    assert broken_invariants(surface) == []
    assert len(degenerate_faces(surface.vertices, surface.faces)) == 0
    assert area(surface) == pytest.approx(area(before), rel=2e-3)
    shift = np.linalg.norm(before.vertices[border_loops(before.faces)[0]][:, None] - surface.vertices[None], axis=2)
    assert shift.min(axis=1).max() < 1e-3


@needs_data
def test_slivers_of_the_real_bodice_are_merged_by_name():
    surface = read_surface(DATA / "front_bodice_raw.obj", units="m")
    assert broken_invariants(surface) == []
    assert len(surface.input_vertices) == 7736
    assert 7725 <= len(surface.vertices) < 7736
    assert len(degenerate_faces(surface.vertices, surface.faces)) == 0
    assert any("4663" in note and "4824" in note for note in surface.notes)
    whole = make_surface(surface.input_vertices, _raw_faces())
    assert np.array_equal(whole.vertices, surface.vertices)
    loop = border_loops(surface.faces)[0]
    assert len(loop) in (671, 672, 673)
    assert area(surface) == pytest.approx(_raw_area(), rel=1e-7)


def _raw_faces():
    text = (DATA / "front_bodice_raw.obj").read_text().splitlines()
    return np.array([[int(word.split("/")[0]) - 1 for word in row.split()[1:]] for row in text if row[:2] == "f "])


def _raw_area():
    text = (DATA / "front_bodice_raw.obj").read_text().splitlines()
    p = np.array([[float(word) for word in row.split()[1:4]] for row in text if row[:2] == "v "])[_raw_faces()]
    return np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2


@needs_data
def test_real_shirt_front_has_its_welded_vertices():
    surface = read_surface(DATA / "garment_shirtfront.obj", units="m")
    assert broken_invariants(surface) == []
    assert surface.vertices.shape == (3743, 3)
    assert len(surface.faces) == 7177
    assert surface.notes == ()


@pytest.mark.parametrize("spread", [0.02, 0.3, 1.0])
def test_crossed_quads_are_those_that_a_look_at_every_quad_finds(spread: float):
    rng = np.random.default_rng(5)
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    vertices = (corners + rng.normal(scale=spread, size=(2000, 4, 3))).reshape(-1, 3)
    vertices[:400:8] = vertices[2:402:8]  # some without any area
    faces = np.arange(8000, dtype=np.int32).reshape(-1, 4)
    faces[::7, 3] = -1
    quads = np.flatnonzero(faces[:, 3] >= 0)
    expected = quads[_quad_corners(vertices[faces[quads]], 1e-3)[3]]
    assert len(expected) or spread < 0.1
    np.testing.assert_array_equal(find_crossed_quads(vertices, faces), expected)


def test_components_count_by_area():
    """A panel of one quad, and a button of twelve small triangles, which the file has first."""
    turn = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    button = np.vstack([[0.0, 0.0, 0.0], 0.01 * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])])
    panel = [[1.0, 0.0, 0.0], [1.4, 0.0, 0.0], [1.4, 0.6, 0.0], [1.0, 0.6, 0.0]]
    fan = [[0, 1 + k, 1 + (k + 1) % 12, -1] for k in range(12)]
    vertices, faces = np.vstack([button, panel]), [*fan, [13, 14, 15, 16]]
    for component, count in (("largest", 1), (0, 1), (1, 12)):
        assert len(make_surface(vertices, faces, component=component).faces) == count


def test_a_quad_whose_halves_cancel_is_crossed():
    # Its diagonals are parallel: it spans no area, though each of its corners does.
    vertices = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    assert find_crossed_quads(vertices, np.array([[0, 1, 2, 3]], dtype=np.int32)).tolist() == [0]
