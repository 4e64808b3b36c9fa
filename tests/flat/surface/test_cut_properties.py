"""Random cuts on random meshes: nothing is lost, left dangling or moved, and glueing undoes every one of them."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
from cut_meshes import cone, cylinder, flat, glue, grid, surface
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from warpflat.flat.surface.connectivity import euler_characteristic, non_manifold_vertices
from warpflat.flat.surface.cut.cut_mesh import cut_along
from warpflat.flat.surface.cut.pieces import apply_cut, split_pieces
from warpflat.flat.surface.half_edges import border_edges, half_edges
from warpflat.flat.surface.triangles import corner_triangles

SETTINGS = settings(max_examples=120, deadline=None, derandomize=True, database=None)


@st.composite
def meshes(draw):
    shape = draw(st.sampled_from(["patch", "patch", "tube", "cone"]))
    if shape == "tube":
        return cylinder(draw(st.integers(3, 8)), draw(st.integers(2, 5)), triangles=draw(st.booleans()))
    if shape == "cone":
        return cone(draw(st.integers(3, 8)), draw(st.integers(1, 4)))
    columns, rows = draw(st.integers(2, 7)), draw(st.integers(2, 7))
    seed = draw(st.integers(0, 2**16))
    rng = np.random.default_rng(seed)
    faces = grid(columns, rows, kinds=rng.integers(0, 3, (columns - 1) * (rows - 1)))
    vertices = flat(columns, rows)
    return surface(vertices + rng.uniform(-0.02, 0.02, vertices.shape), faces[rng.permutation(len(faces))])


def inner_edges(faces):
    he = half_edges(faces)
    return {(int(a), int(b)) for a, b in he.edges[he.count == 2]}


@st.composite
def cuts(draw):
    """A mesh and up to three paths along inner edges, no edge twice; now and then a path closes."""
    mesh = draw(meshes())
    free = inner_edges(mesh.faces)
    assume(free)
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    paths = []
    for _ in range(draw(st.integers(1, 3))):
        neighbours: dict[int, list[int]] = {}
        for a, b in sorted(free):
            neighbours.setdefault(a, []).append(b)
            neighbours.setdefault(b, []).append(a)
        if not neighbours:
            break
        path = [int(rng.choice(sorted(neighbours)))]
        for _ in range(int(rng.integers(1, 12))):
            onward = [v for v in neighbours[path[-1]] if v not in path or (v == path[0] and len(path) > 2)]
            if not onward:
                break
            path.append(int(rng.choice(onward)))
            if path[-1] == path[0]:
                break
        free -= {(min(a, b), max(a, b)) for a, b in pairwise(path)}
        paths.append(path)
    border = set(border_edges(mesh.faces).ravel().tolist())
    degree = Counter(v for path in paths for edge in pairwise(path) for v in edge)
    splits = {v for v, d in degree.items() if d + (v in border) > 1}
    # An edge whose two ends stay whole is refused, which has a test of its own.
    assume(all(a in splits or b in splits for path in paths for a, b in pairwise(path)))
    return mesh, paths, degree, border


def union_count(faces, cut_edges):
    """Pieces of the mesh by flooding from face to face across uncut edges: an independent count."""
    he = half_edges(faces)
    beside: dict[tuple[int, int], list[int]] = {}
    for edge, face in zip(he.edge.tolist(), he.face.tolist(), strict=True):
        beside.setdefault(tuple(he.edges[edge].tolist()), []).append(face)
    around: dict[int, list[int]] = {}
    for edge, pair in beside.items():
        if len(pair) == 2 and edge not in cut_edges:
            around.setdefault(pair[0], []).append(pair[1])
            around.setdefault(pair[1], []).append(pair[0])
    seen: set[int] = set()
    count = 0
    for seed in range(len(faces)):
        if seed in seen:
            continue
        count += 1
        stack = [seed]
        seen.add(seed)
        while stack:
            for face in around.get(stack.pop(), []):
                if face not in seen:
                    seen.add(face)
                    stack.append(face)
    return count


@SETTINGS
@given(cuts())
def test_a_cut_conserves_everything_but_the_topology(case):
    mesh, paths, degree, border = case
    count = len(mesh.vertices)
    cut = cut_along(mesh.faces, paths, vertex_count=count)
    cut_edges = {(min(a, b), max(a, b)) for path in paths for a, b in pairwise(path)}

    np.testing.assert_array_equal(glue(cut), mesh.faces)
    np.testing.assert_array_equal(cut.vertex_origin[:count], np.arange(count))
    np.testing.assert_array_equal(cut.faces < 0, mesh.faces < 0)
    used = np.unique(cut.faces[cut.faces >= 0])
    np.testing.assert_array_equal(used, np.arange(len(cut.vertex_origin)))
    assert half_edges(cut.faces).count.max() <= 2
    assert len(non_manifold_vertices(cut.faces)) == 0

    copies = Counter(cut.vertex_origin.tolist())
    assert copies == {v: max(1, degree[v] + (v in border)) if degree[v] else 1 for v in range(count)}
    added = len(cut.vertex_origin) - count
    assert euler_characteristic(cut.faces) == euler_characteristic(mesh.faces) + added - len(cut_edges)
    assert cut.component_count == union_count(mesh.faces, cut_edges)
    assert set(cut.tips.tolist()) == {v for v, d in degree.items() if d == 1 and v not in border}

    edges = Counter(tuple(sorted(pair)) for pair in cut.vertex_origin[half_edges(cut.faces).edges].tolist())
    for edge, times in edges.items():
        assert times == (2 if edge in cut_edges else 1)
    assert len(edges) == len(half_edges(mesh.faces).edges)


@SETTINGS
@given(cuts())
def test_the_seams_are_the_paths_and_match_vertex_by_vertex(case):
    mesh, paths, _, _ = case
    cut = cut_along(mesh.faces, paths, vertex_count=len(mesh.vertices))
    border = {tuple(edge) for edge in border_edges(cut.faces).tolist()}
    covered = Counter()
    for seam in cut.seams:
        np.testing.assert_array_equal(cut.vertex_origin[seam.left], seam.path)
        np.testing.assert_array_equal(cut.vertex_origin[seam.right], seam.path)
        left, right = seam.left.tolist(), seam.right.tolist()
        assert set(pairwise(left)) <= border
        assert set(zip(right[1:], right[:-1], strict=True)) <= border
        covered.update(pairwise(seam.path.tolist()))
    assert covered == Counter(edge for path in paths for edge in pairwise(path))


@SETTINGS
@given(cuts())
def test_the_surface_keeps_its_area_and_its_edges_and_falls_into_its_pieces(case):
    mesh, paths, _, _ = case
    cut = cut_along(mesh.faces, paths, vertex_count=len(mesh.vertices))
    whole = apply_cut(mesh, cut)
    np.testing.assert_array_equal(whole.input_vertices[whole.input_index], whole.vertices)

    def face_areas(vertices, faces):
        triangles, face, weight = corner_triangles(faces)
        a, b, c = (vertices[triangles[:, k]] for k in range(3))
        return np.bincount(face, weights=0.5 * weight * np.linalg.norm(np.cross(b - a, c - a), axis=1))

    np.testing.assert_array_equal(face_areas(whole.vertices, whole.faces), face_areas(mesh.vertices, mesh.faces))
    pieces = split_pieces(mesh, cut)
    assert len(pieces) == cut.component_count
    assert len({piece.surface.name for piece in pieces}) == len(pieces)
    faces = np.concatenate([piece.face_index for piece in pieces])
    np.testing.assert_array_equal(np.sort(faces), np.arange(len(mesh.faces)))
    for piece in pieces:
        part = piece.surface
        lengths = np.linalg.norm(part.vertices[part.faces[:, 1]] - part.vertices[part.faces[:, 0]], axis=1)
        old = mesh.faces[piece.face_index]
        before = np.linalg.norm(mesh.vertices[old[:, 1]] - mesh.vertices[old[:, 0]], axis=1)
        np.testing.assert_array_equal(lengths, before)
        np.testing.assert_array_equal(np.unique(part.faces[part.faces >= 0]), np.arange(len(part.vertices)))


@SETTINGS
@given(st.integers(3, 14), st.integers(2, 6), st.integers(0, 100))
def test_a_tube_or_cone_cut_along_a_generator_is_a_disk(around, rows, which):
    column = which % around
    tube = cylinder(around, rows)
    cut = cut_along(tube.faces, [column + around * np.arange(rows)], vertex_count=len(tube.vertices))
    assert (cut.kind, euler_characteristic(cut.faces), cut.component_count) == ("opening", 1, 1)
    shape = cone(around, rows)
    apex = len(shape.vertices) - 1
    path = [*(column + around * np.arange(rows)).tolist(), apex]
    cut = cut_along(shape.faces, [path], vertex_count=apex + 1)
    assert (cut.kind, euler_characteristic(cut.faces), cut.component_count) == ("dart", 1, 1)
