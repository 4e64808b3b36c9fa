"""The lines of lattices, along which steps go in a soft cloth."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from warpflat.surface.cut.cut_mesh import cut_along
from warpflat.surface.grid_lines import LineArrays, join_lines, lines_of
from warpflat.surface.half_edges import mesh_edges
from warpflat.surface.mesh import Surface
from warpflat.surface.repair.validate import make_surface
from warpflat.surface.shapes import make_shape


def cracked(seed: int = 0) -> Surface:
    """12 by 9 quads of 10 mm with a crack along a column, turning into a row, numbered at random."""
    rng = np.random.default_rng(seed)
    number = np.arange(13 * 10).reshape(13, 10)
    faces = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    y, x = np.divmod(np.arange(130), 10)
    path = [*number[:6, 4], *number[5, 5:8]]
    made = cut_along(faces, [int(v) for v in path], vertex_count=130)
    vertices = np.column_stack([0.01 * x, 0.01 * y, 0.0 * x])[made.vertex_origin]
    order = rng.permutation(len(vertices))
    place = np.argsort(order)
    return make_surface(vertices[order], place[made.faces[rng.permutation(len(made.faces))]])


def chains(lines: LineArrays) -> list[list[int]]:
    return [part.tolist() for part in np.split(lines.vertex, lines.offset[1:-1])]


@pytest.mark.parametrize("make", [lambda: make_shape("dome", resolution=9), cracked])
def test_each_vertex_is_in_one_row_and_one_column_along_edges(make):
    surface = make()
    lines = lines_of(surface)
    assert lines is not None
    count = len(surface.vertices)
    halves = chains(lines)[: lines.rows], chains(lines)[lines.rows :]
    edges = {tuple(edge) for edge in mesh_edges(surface.faces).tolist()}
    used = []
    for family in halves:
        np.testing.assert_array_equal(np.sort(np.concatenate(family)), np.arange(count))
        steps = [(a, b) for line in family for a, b in pairwise(line)]
        assert all((min(step), max(step)) in edges for step in steps)
        used += [(min(step), max(step)) for step in steps]
    # No edge in both, and all of them but where two sides of a crack meet at its tip.
    assert len(set(used)) == len(used) >= len(edges) - 2


def test_lines_run_straight_and_end_at_a_crack():
    surface = cracked()
    lines = lines_of(surface)
    assert lines is not None
    flat = surface.vertices[:, :2]
    for line in chains(lines):
        d = np.diff(flat[line], axis=0)
        np.testing.assert_allclose(np.linalg.norm(d, axis=1), 0.01, rtol=1e-9)
        assert np.allclose(d, d[:1])
    # Five rows end at the crack, at 5 and 6 vertices. Of the row that it follows one side has 3 of its own, the other goes on through the
    # tip; one side of the column that it follows ends at the corner, after 6, and two columns are parted into 6 and 8.
    lengths = sorted(map(len, chains(lines)))
    assert lengths == [3] + [5] * 5 + [6] * (5 + 1 + 2) + [8] * 2 + [10] * 8 + [13] * 8


def test_triangles_have_no_lines():
    assert lines_of(make_shape("dome", resolution=9, triangles=True)) is None


def test_lines_side_by_side_are_those_of_each_and_a_piece_without_has_none():
    dome, crack, triangles = (
        make_shape("dome", resolution=9),
        cracked(),
        make_shape("dome", resolution=4, triangles=True),
    )
    surfaces = [dome, triangles, crack]
    counts = [len(surface.vertices) for surface in surfaces]
    joined = join_lines([lines_of(surface) for surface in surfaces], counts)
    assert joined is not None
    begin = np.cumsum([0, *counts])
    wished: list[set[tuple[int, ...]]] = [set(), set()]
    for surface, first, count in zip(surfaces, begin, counts, strict=False):
        lines = lines_of(surface)
        for family in range(2):
            if lines is None:
                wished[family] |= {(int(first) + v,) for v in range(count)}
                continue
            own = chains(lines)[: lines.rows] if family == 0 else chains(lines)[lines.rows :]
            wished[family] |= {tuple(int(first) + v for v in line) for line in own}
    made = chains(joined)
    assert {tuple(line) for line in made[: joined.rows]} == wished[0]
    assert {tuple(line) for line in made[joined.rows :]} == wished[1]
    assert join_lines([None, lines_of(triangles)], [3, counts[1]]) is None
