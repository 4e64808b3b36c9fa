"""Grids numbered row by row: what follows from the numbers is what is sorted out of the faces of any mesh."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from surface_meshes import numbered_grid as grid

from warpflat.surface.half_edges import half_edges
from warpflat.surface.mesh import Surface
from warpflat.surface.row_major_grid import row_major_grid
from warpflat.surface.unfold import corners_around

TURNS = [(turn, mirrored) for turn in range(4) for mirrored in (False, True)]


def springs_by_ends(surface: Surface) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Around each vertex the springs and their far ends, those sorted, from a list of all springs by their two ends."""
    edges, faces = half_edges(surface.faces).edges, surface.faces
    ends = np.concatenate([edges, faces[:, 0::2], faces[:, 1::2]])
    both, number = np.concatenate([ends, ends[:, ::-1]]), np.tile(np.arange(len(ends)), 2)
    order = np.lexsort([both[:, 1], both[:, 0]])
    offset = np.searchsorted(both[order, 0], np.arange(len(surface.vertices) + 1))
    return offset, number[order], both[order, 1]


@pytest.mark.parametrize(("rows", "columns"), [(2, 2), (2, 3), (3, 2), (2, 7), (7, 2), (3, 3), (5, 8), (70, 41)])
@pytest.mark.parametrize(("turn", "mirrored"), TURNS)
def test_what_follows_from_the_numbers_is_what_is_sorted_out_of_the_faces(
    rows: int, columns: int, turn: int, mirrored: bool
) -> None:
    surface = grid(rows, columns, turn, mirrored=mirrored)
    numbered = row_major_grid(surface)
    assert numbered is not None
    assert (numbered.rows, numbered.columns) == (rows, columns)
    edge, edges, count = numbered.edges()
    sorted_out = half_edges(surface.faces)
    for ours, theirs in zip((edge, edges, count), (sorted_out.edge, sorted_out.edges, sorted_out.count), strict=True):
        assert ours.dtype == theirs.dtype
        np.testing.assert_array_equal(ours, theirs)
    for ours, theirs in zip(numbered.corners_around(), corners_around(surface.faces, rows * columns), strict=True):
        assert ours.dtype == theirs.dtype
        np.testing.assert_array_equal(ours, theirs)
    offset, neighbor = numbered.neighbors_around()
    spring, value = numbered.springs_around(offset), np.random.default_rng(0).normal(size=len(neighbor) // 2)
    for ours, theirs in zip((offset, spring, neighbor), springs_by_ends(surface), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(numbered.listed(offset, value), value[spring])
    assert numbered.edge_count == len(edges)
    np.testing.assert_array_equal(numbered.border, np.unique(edges[count == 1]))


@pytest.mark.parametrize(("rows", "columns"), [(2, 2), (2, 7), (7, 2), (5, 8)])
@pytest.mark.parametrize(("turn", "mirrored"), TURNS)
def test_springs_of_a_grid_are_measured_as_those_of_any_other_mesh(
    rows: int, columns: int, turn: int, mirrored: bool
) -> None:
    surface = grid(rows, columns, turn, mirrored=mirrored)
    numbered, he = row_major_grid(surface), half_edges(surface.faces)
    assert numbered is not None
    random = np.random.default_rng(1)
    vertices, diagonals = random.normal(size=(rows * columns, 3)), random.normal(size=(len(surface.faces), 2))
    offset, _ = numbered.neighbors_around()
    lengths = np.linalg.norm(vertices[he.edges[:, 1]] - vertices[he.edges[:, 0]], axis=1)
    wished = numbered.listed(offset, np.concatenate([lengths, diagonals.T.ravel()]))
    np.testing.assert_allclose(numbered.listed_lengths(offset, vertices, diagonals), wished, rtol=1e-15)
    of_side, of_face = random.normal(size=len(he.edge)), random.normal(size=len(surface.faces))
    wished = numbered.listed(offset, np.concatenate([np.bincount(he.edge, of_side), of_face, of_face]))
    np.testing.assert_array_equal(numbered.listed_stiffness(offset, of_side, of_face), wished)


def test_neighbors_on_a_grid_are_those_an_edge_joins() -> None:
    surface = grid(5, 4)
    numbered = row_major_grid(surface)
    assert numbered is not None
    a, b = np.divmod(np.arange(400), 20)
    joined = {(int(i), int(j)) for edge in half_edges(surface.faces).edges for i, j in (edge, edge[::-1])}
    assert {(i, j) for i, j in zip(a.tolist(), b.tolist(), strict=True) if numbered.are_joined(i, j)} == joined
    np.testing.assert_array_equal(numbered.are_joined(a, b), [pair in joined for pair in zip(a, b, strict=True)])


@pytest.mark.parametrize(
    "change", ["a face fewer", "two faces swapped", "bow tie", "triangles", "a vertex more", "a face turned"]
)
def test_any_other_mesh_is_not_taken_for_one(change: str) -> None:
    surface = grid(6, 5)
    vertices, faces = surface.vertices, surface.faces.copy()
    if change == "a face fewer":
        faces = faces[:-1]
    if change == "two faces swapped":
        faces[[3, 4]] = faces[[4, 3]]
    if change == "bow tie":
        faces = faces[:, [0, 2, 1, 3]]
    if change == "triangles":
        faces[:, 3] = -1
    if change == "a vertex more":
        vertices = np.vstack([vertices, [[1.0, 1.0, 1.0]]])
    if change == "a face turned":
        faces[7] = np.roll(faces[7], 1)
    other = Surface(vertices=vertices, faces=faces, input_vertices=vertices, input_index=np.arange(len(vertices)))
    assert row_major_grid(other) is None
