from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surface_meshes import grid

from warpflat.core.errors import InputError
from warpflat.core.sorting import counting_sort, stable_argsort
from warpflat.flat.surface.connectivity import (
    border_loops,
    coincident_vertices,
    components,
    euler_characteristic,
    join_labels,
    non_manifold_vertices,
    orient,
)
from warpflat.flat.surface.half_edges import (
    border_edges,
    half_edges,
    half_edges_of,
    mesh_edges,
    opposite_half_edges,
)
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.triangles import corner_triangles, triangulate, unfold_quad_diagonals

MIXED = np.array([[0, 1, 2, 3], [1, 4, 2, -1]], dtype=np.int32)


def turned(faces, which):
    out = faces.copy()
    for row in np.flatnonzero(which):
        corners = [c for c in faces[row] if c >= 0][::-1]
        out[row, : len(corners)] = corners
    return out


@st.composite
def shuffled_meshes(draw):
    """A grid in which some quads are split either way, some faces are left out and some wound the other way."""
    columns, rows = draw(st.integers(2, 6)), draw(st.integers(2, 6))
    vertices, quads = grid(columns, rows)
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    split, other = random.random(len(quads)) < 0.5, random.random(len(quads)) < 0.5
    triangles, _ = triangulate(quads[split], other_diagonal=other[split])
    faces = np.concatenate([quads[~split], np.column_stack([triangles, np.full(len(triangles), -1, np.int32)])])
    faces = faces[random.permutation(len(faces))]
    if draw(st.booleans()):
        faces = faces[: max(1, int(len(faces) * 0.8))]
    return vertices, faces, random.random(len(faces)) < draw(st.floats(0, 1))


def test_mixed_mesh_has_the_edges_of_both_kinds_and_no_diagonal():
    assert mesh_edges(MIXED).tolist() == [[0, 1], [0, 3], [1, 2], [1, 4], [2, 3], [2, 4]]


def test_three_columns_are_triangles():
    assert np.array_equal(mesh_edges(np.array([[0, 1, 2]])), mesh_edges(np.array([[0, 1, 2, -1]])))


def test_no_faces_have_no_edges():
    none = np.empty((0, 4), dtype=np.int32)
    assert mesh_edges(none).shape == (0, 2)
    assert components(none).shape == (0,)
    assert non_manifold_vertices(none).shape == (0,)
    assert border_loops(none) == []


def test_half_edges_run_around_each_face():
    he = half_edges(MIXED)
    assert np.array_equal(he.tail[he.next], he.head)
    assert np.array_equal(he.face[he.next], he.face)
    assert he.tail[he.face == 1].tolist() == [1, 4, 2]


def test_border_runs_with_the_faces():
    vertices, quads = grid(4, 3)
    (loop,) = border_loops(quads)
    assert loop.tolist() == [0, 1, 2, 3, 7, 11, 10, 9, 8, 4]
    p = vertices[loop]
    area = 0.5 * np.sum(p[:, 0] * np.roll(p[:, 1], -1) - p[:, 1] * np.roll(p[:, 0], -1))
    assert area == pytest.approx(1.0)
    directed = {tuple(e) for e in border_edges(quads).tolist()}
    assert directed == set(zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True))


def test_longest_loop_is_first_by_count_or_by_metres():
    vertices, quads = grid(8, 8)
    hole = [0 <= f % 7 - 2 < 2 and 0 <= f // 7 - 2 < 2 for f in range(49)]
    faces = quads[~np.array(hole)]
    loops = border_loops(faces)
    assert [len(loop) for loop in loops] == [28, 8]
    inside_out = vertices.copy()
    centre = np.array([0.5 / 7 * 6, 0.5 / 7 * 6, 0])
    inside_out[np.setdiff1d(np.arange(64), loops[1])] = centre
    assert len(border_loops(faces, inside_out)[0]) == 8
    assert euler_characteristic(faces) == 0


def test_loops_that_touch_in_a_vertex_stay_with_their_fans():
    _, quads = grid(5, 5)
    faces = np.delete(quads, [5, 10], axis=0)
    loops = border_loops(faces)
    assert sorted(len(loop) for loop in loops) == [8, 16]
    assert non_manifold_vertices(faces).tolist() == [12]


def test_inconsistent_border_is_refused():
    with pytest.raises(InputError, match="orient them first"):
        border_loops(turned(grid(3, 2)[1], [True, False]))


def test_the_faces_at_an_edge_are_counted():
    book = half_edges(np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
    assert book.edges[book.count > 2].tolist() == [[0, 1]]
    assert half_edges(MIXED).count.tolist() == [1, 1, 2, 1, 1, 1]


def test_bow_tie_is_found_whether_open_or_closed():
    assert non_manifold_vertices(np.array([[0, 1, 2], [0, 3, 4]])).tolist() == [0]
    cone = [[0, i, i % 4 + 1] for i in range(1, 5)]
    other = [[0, i + 4, i % 4 + 5] for i in range(1, 5)]
    assert non_manifold_vertices(np.array(cone + other)).tolist() == [0]
    assert len(non_manifold_vertices(np.array(cone))) == 0


def test_components_are_numbered_by_their_first_face_and_stop_at_a_barrier():
    faces = np.array([[5, 6, 7, -1], [0, 1, 2, 3], [1, 4, 2, -1]])
    assert components(faces).tolist() == [0, 1, 1]
    assert components(faces, barrier=np.array([[2, 1]])).tolist() == [0, 1, 2]
    touching = np.array([[0, 1, 2], [2, 3, 4]])
    assert components(touching).tolist() == [0, 1]


def test_triangles_of_quads_keep_order_winding_and_area():
    vertices, quads = grid(3, 3)
    faces = np.vstack([quads[:2], [[4, 5, 8, -1]]]).astype(np.int32)
    for other in (False, True, np.array([True, False, True])):
        triangles, face = triangulate(faces, other_diagonal=other)
        assert face.tolist() == [0, 0, 1, 1, 2]
        p = vertices[triangles]
        z = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2]
        assert np.all(z > 0)
        assert np.bincount(face, weights=z / 2) == pytest.approx([0.25, 0.25, 0.125])
    assert triangulate(quads[:1])[0].tolist() == [[0, 1, 4], [0, 4, 3]]
    assert triangulate(quads[:1], other_diagonal=True)[0].tolist() == [[1, 4, 3], [1, 3, 0]]


def test_diagonals_may_be_kept_apart_from_each_other_and_from_sides():
    doublet = np.array([[0, 1, 2, 4], [0, 4, 2, 3], [3, 2, 5, 6]])
    fan = np.array([[0, 1, 2, 3], [0, 2, 1, -1]])
    # Four quads in a row: the second must turn as the first cannot, and so on.
    chain = np.array([[0, 1, 2, 3], [0, 2, 7, -1], [1, 4, 3, 5], [4, 6, 5, 8]])
    for faces in (doublet, fan, chain):
        for turn in (False, True):
            triangles, _ = triangulate(faces, other_diagonal=turn, distinct=True)
            plain, _ = triangulate(faces, other_diagonal=turn)
            assert len(triangles) == len(plain)
            edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
            sides = {tuple(edge) for edge in half_edges(faces).edges.tolist()}
            inner = [tuple(edge) for edge in edges.tolist() if tuple(edge) not in sides]
            diagonals = int((faces[:, 3] >= 0).sum())
            assert len(set(inner)) == diagonals
            assert len(inner) == 2 * diagonals
    assert triangulate(doublet, distinct=True)[0][-2:].tolist() == [[3, 2, 5], [3, 5, 6]]


def test_corner_triangles_measure_the_mean_of_both_splits():
    random = np.random.default_rng(3)
    vertices, quads = grid(4, 4)
    vertices = vertices + 0.1 * random.normal(size=vertices.shape)
    faces = np.vstack([quads, [[0, 1, 5, -1]]]).astype(np.int32)

    def area(triangles):
        p = vertices[triangles]
        return np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1) / 2

    corners, face, weight = corner_triangles(faces)
    assert np.array_equal(face, np.sort(face))
    both = [np.bincount(f, weights=area(t)) for t, f in (triangulate(faces), triangulate(faces, other_diagonal=True))]
    assert np.bincount(face, weights=weight * area(corners)) == pytest.approx(np.mean(both, axis=0))


def test_euler_characteristic_of_disc_annulus_and_closed_surface():
    assert euler_characteristic(grid(5, 4)[1]) == 1
    assert euler_characteristic(np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])) == 2


def test_moebius_strip_is_refused_with_a_face():
    n = 6
    strip = [[2 * i, 2 * ((i + 1) % n), 2 * ((i + 1) % n) + 1, 2 * i + 1] for i in range(n)]
    strip[-1] = [2 * n - 2, 1, 0, 2 * n - 1]
    with pytest.raises(InputError, match=r"one-sided .* face \d+"):
        orient(np.array(strip))


@settings(max_examples=40, deadline=None)
@given(shuffled_meshes())
def test_orient_makes_any_winding_agree_and_turns_the_minority(mesh):
    _, faces, flip = mesh
    mixed = turned(faces, flip)
    fixed, count = orient(mixed)
    he = half_edges(fixed)
    assert len(np.unique(np.stack([he.tail, he.head], axis=1), axis=0)) == len(he.tail)
    assert np.array_equal(np.sort(fixed, axis=1), np.sort(faces, axis=1))
    assert count == int((fixed != mixed).any(axis=1).sum())
    label = components(faces)
    for part in range(label.max() + 1):
        at = label == part
        assert (fixed[at] != mixed[at]).any(axis=1).sum() <= at.sum() / 2


@settings(max_examples=40, deadline=None)
@given(shuffled_meshes())
def test_border_loops_hold_each_border_edge_once_and_close_the_count(mesh):
    _, faces, _ = mesh
    loops = border_loops(faces)
    steps = [pair for loop in loops for pair in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)]
    assert sorted(steps) == sorted(map(tuple, border_edges(faces).tolist()))
    assert [len(loop) for loop in loops] == sorted(map(len, loops), reverse=True)
    ties = len(non_manifold_vertices(faces))
    if ties == 0:
        # Planar, so without handles: per part 2 = characteristic + loops.
        assert euler_characteristic(faces) == 2 * (components(faces).max() + 1) - len(loops)


def test_planar_quads_have_their_plain_diagonals_convex_or_not():
    for corner in ([1.0, 1.0, 0.0], [0.2, 0.2, 0.0]):
        vertices = np.array([[0, 0, 0], [1, 0, 0], corner, [0, 1, 0]], dtype=float)
        for roll in range(4):
            lengths, face = unfold_quad_diagonals(vertices, np.roll([[0, 1, 2, 3]], roll, axis=1).astype(np.int32))
            plain = [np.linalg.norm(corner), np.sqrt(2)]
            assert lengths[0] == pytest.approx(plain if roll % 2 == 0 else plain[::-1], rel=1e-12)
            assert face.tolist() == [0]


def test_bent_quad_is_as_long_as_before_it_was_bent():
    for angle in (0.3, 1.0, 1.5, 2.5):
        vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
        middle, out = np.array([0.5, 0.5, 0]), np.array([-0.5, 0.5, 0])
        # Fold corner 3 up about the diagonal 0-2.
        vertices[3] = middle + out * np.cos(angle) + np.linalg.norm(out) * np.array([0, 0, np.sin(angle)])
        lengths, _ = unfold_quad_diagonals(vertices, np.array([[0, 1, 2, 3]], dtype=np.int32))
        assert lengths[0, 1] == pytest.approx(np.sqrt(2), rel=1e-12)
        assert np.linalg.norm(vertices[3] - vertices[1]) < np.sqrt(2) * 0.99


def test_quad_with_a_hinge_of_no_length_gives_the_plain_distance():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 1, 0]], dtype=float)
    lengths, _ = unfold_quad_diagonals(vertices, np.array([[0, 1, 2, 3]], dtype=np.int32))
    assert np.isfinite(lengths).all()
    assert lengths[0, 1] == pytest.approx(np.sqrt(2))


def test_triangles_have_no_diagonals():
    lengths, face = unfold_quad_diagonals(grid(3, 3)[0], MIXED)
    assert lengths.shape == (1, 2)
    assert face.tolist() == [0]


@pytest.mark.parametrize("greatest", [3, 2**20, 2**62])
def test_stable_order_is_that_of_a_stable_sort(greatest):
    keys = np.random.default_rng(4).integers(0, greatest, 500, dtype=np.int64)
    keys[::7] = keys[0]
    assert np.array_equal(stable_argsort(keys), np.argsort(keys, kind="stable"))
    assert len(stable_argsort(keys[:0])) == 0


def test_order_by_is_that_of_a_stable_sort_and_says_where_each_number_begins():
    keys = np.random.default_rng(4).integers(0, 20, 300, dtype=np.int32)
    keys[keys == 7] = 8
    order, offset = counting_sort(keys, 22)
    assert np.array_equal(order, np.argsort(keys, kind="stable"))
    assert np.array_equal(offset, np.searchsorted(np.sort(keys), np.arange(23)))
    none, offset = counting_sort(keys[:0], 3)
    assert len(none) == 0
    assert offset.tolist() == [0, 0, 0, 0]


@pytest.mark.parametrize(("nodes", "pairs"), [(0, 0), (1, 0), (1, 2), (40, 25), (200, 190), (200, 600)])
def test_nodes_that_are_joined_have_one_label_and_first_nodes_come_first(nodes, pairs):
    a, b = np.random.default_rng(4).integers(0, max(nodes, 1), (2, pairs), dtype=np.int32)
    reached = np.eye(nodes, dtype=bool)
    reached[a, b] = reached[b, a] = True
    for _ in range(nodes.bit_length()):
        reached = (reached.astype(int) @ reached) > 0
    first = reached.argmax(axis=1) if nodes else np.zeros(0, dtype=int)
    labels = join_labels(nodes, a, b)
    assert labels.dtype == np.int32
    assert np.array_equal(labels, np.unique(first, return_inverse=True)[1])
    assert np.array_equal(join_labels(nodes, b.astype(np.int64), a.astype(np.int64)), labels)


def test_half_edges_of_a_surface_are_made_once_and_not_to_be_changed():
    vertices, quads = grid(3, 3)
    surface = Surface(vertices=vertices, faces=quads)
    he = half_edges_of(surface)
    assert half_edges_of(surface) is he
    for name, values in vars(half_edges(quads)).items():
        assert np.array_equal(getattr(he, name), values), name
    with pytest.raises(ValueError, match="read-only"):
        he.tail[0] = 1
    assert surface.faces.flags.writeable


def test_the_two_sides_of_a_crack_are_at_one_place():
    vertices, quads = grid(4, 4)
    assert np.array_equal(coincident_vertices(vertices, quads), np.arange(16))
    # The faces right of the line 1, 5, 9 get vertices 16, 17, 18 there, in the very same places.
    cut = quads.copy()
    right = np.isin(np.arange(9) % 3, [1, 2])
    for new, old in enumerate((1, 5, 9)):
        cut[right] = np.where(cut[right] == old, 16 + new, cut[right])
    # Another one inside, at the place of vertex 6, is no side of a crack.
    both = np.concatenate([vertices, vertices[[1, 5, 9]]])
    both[10] = both[6]
    assert coincident_vertices(both, cut)[16:].tolist() == [1, 5, 9]
    assert np.array_equal(coincident_vertices(both, cut)[:16], np.arange(16))
    assert np.array_equal(
        coincident_vertices(both, cut, border=np.unique(border_edges(cut))), coincident_vertices(both, cut)
    )


def test_twins_run_along_the_same_edge_the_other_way():
    faces = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 6, -1]])
    he = half_edges(faces)
    twin = opposite_half_edges(he)
    inner = np.flatnonzero(twin >= 0)
    assert len(inner) == 4
    assert np.array_equal(he.tail[twin[inner]], he.head[inner])
    assert np.array_equal(he.head[twin[inner]], he.tail[inner])
    assert (he.count[he.edge[twin < 0]] == 1).all()
