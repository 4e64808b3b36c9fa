from __future__ import annotations

import numpy as np
import pytest
from surface_meshes import broken_invariants, cylinder, grid, rings, scattered, sphere

from warpflat.core.errors import InputError
from warpflat.flat.surface.half_edges import mesh_edges
from warpflat.flat.surface.paths.lines import (
    line_between,
    line_from_curve,
    line_from_indices,
    line_on_plane,
    with_lines,
)
from warpflat.flat.surface.repair.validate import make_surface


def runs_along_edges(surface, line):
    edges = {tuple(edge) for edge in mesh_edges(surface.faces).tolist()}
    return all((min(a, b), max(a, b)) in edges for a, b in zip(line[:-1].tolist(), line[1:].tolist(), strict=True))


def length(surface, line):
    return np.linalg.norm(np.diff(surface.vertices[line], axis=0), axis=1).sum()


@pytest.fixture
def sheet():
    return make_surface(*grid(7, 5), name="sheet")


@pytest.fixture
def tube():
    return make_surface(*rings(24, 9), name="tube")


def test_indices_are_checked_edge_by_edge(sheet):
    assert line_from_indices(sheet, [0, 1, 1, 8]).tolist() == [0, 1, 8]
    with pytest.raises(InputError, match="breaks between vertices 1 and 9 of 'sheet'"):
        line_from_indices(sheet, [0, 1, 9])
    with pytest.raises(InputError, match="vertex 35 does not exist in 'sheet': valid are 0 to 34"):
        line_from_indices(sheet, [28, 35])
    for bad in ([3], [0.5, 1.0], 7, [[0, 1]]):
        with pytest.raises(InputError, match="at least two vertex indices"):
            line_from_indices(sheet, bad)
    with pytest.raises(InputError, match="two different"):
        line_from_indices(sheet, [3, 3])


def test_indices_may_count_the_vertices_of_the_file():
    vertices, quads = grid(3, 2)
    padded = np.vstack([[[5.0, 5.0, 5.0]], vertices, vertices[:1]])
    faces = (quads + 1).tolist()
    surface = make_surface(padded, [[7, *faces[0][1:]], faces[1]])
    assert line_from_indices(surface, [7, 2, 3], as_read=True).tolist() == [5, 0, 1]
    assert line_between(surface, 7, 3, as_read=True).tolist() == [5, 0, 1]
    # Vertex 1 of the file is not used, but vertex 7 lies at its place.
    assert line_from_indices(surface, [1, 2], as_read=True).tolist() == [5, 0]
    with pytest.raises(InputError, match="vertex 0 of the input is not part"):
        line_from_indices(surface, [0, 2], as_read=True)
    # So do the messages.
    with pytest.raises(InputError, match="both ends of the line are vertex 3 of"):
        line_between(surface, 3, 3, as_read=True)
    with pytest.raises(InputError, match="its nearest vertex is 7 at"):
        line_between(surface, 3, surface.vertices[5] - [0.0, 9.0, 0.0], as_read=True)


def test_shortest_path_takes_indices_or_points_and_keeps_to_the_chord(sheet):
    path = line_between(sheet, 0, [1.0, 1.01, 0.02])
    assert path[[0, -1]].tolist() == [0, 34]
    assert runs_along_edges(sheet, path)
    assert length(sheet, path) == pytest.approx(2.0)
    off = np.abs(sheet.vertices[path, 0] - sheet.vertices[path, 1]) / np.sqrt(2)
    assert off.max() < 0.2


def test_path_is_the_shortest_by_the_lengths_of_the_edges():
    surface = make_surface(*scattered(400, sphere)[:2])
    ends = np.argmin(surface.vertices[:, 0]), np.argmax(surface.vertices[:, 0])
    path = line_between(surface, *map(int, ends))
    assert runs_along_edges(surface, path)
    chord = np.linalg.norm(np.diff(surface.vertices[list(ends)], axis=0))
    assert chord < length(surface, path) < 1.25 * chord


def test_path_ends_that_are_none_are_refused(sheet):
    with pytest.raises(InputError, match=r"is 3\.61 m off the piece 'sheet'.*nearest vertex is 34"):
        line_between(sheet, 0, [3.0, 4.0, 0.0])
    with pytest.raises(InputError, match="both ends"):
        line_between(sheet, 3, 3)
    for bad in ("left", [1.0, 2.0], [np.nan, 0, 0], True, 1.5):
        with pytest.raises(InputError, match="vertex index or a point"):
            line_between(sheet, 0, bad)


def test_plane_through_a_column_gives_that_column_upwards(sheet):
    assert line_on_plane(sheet, [0.5, 9, 9], [2, 0, 0]).tolist() == [3, 10, 17, 24, 31]
    assert line_on_plane(sheet, [0.5, 9, 9], [-2, 0, 0]).tolist() == [31, 24, 17, 10, 3]
    assert line_on_plane(sheet, [0, 0.5, 0], [0, 1, 0]).tolist() == [20, 19, 18, 17, 16, 15, 14]


def test_plane_on_the_border_gives_the_border(sheet):
    assert line_on_plane(sheet, [0, 0, 0], [1, 0, 0]).tolist() == [0, 7, 14, 21, 28]
    assert line_on_plane(sheet, [1, 0, 0], [1, 0, 0]).tolist() == [6, 13, 20, 27, 34]


@pytest.mark.parametrize("slant", [0.0, 0.4, -1.0])
def test_slanting_plane_is_followed_within_an_edge(slant):
    surface = make_surface(*scattered(900, cylinder)[:2])
    normal = np.array([1.0, slant, 0.0])
    line = line_on_plane(surface, [0.01, 0.25, 0.0], normal)
    assert runs_along_edges(surface, line)
    off = (surface.vertices[line] - [0.01, 0.25, 0.0]) @ normal / np.linalg.norm(normal)
    edge = np.linalg.norm(np.diff(surface.vertices[mesh_edges(surface.faces)], axis=1), axis=2).mean()
    assert np.abs(off).max() < 1.3 * edge
    assert np.sqrt(np.mean(off**2)) < 0.6 * edge
    assert surface.vertices[line[-1], 1] > surface.vertices[line[0], 1]
    assert len(np.unique(line)) == len(line)


def test_plane_around_a_tube_gives_a_closed_line(tube):
    line = line_on_plane(tube, [0, 0.51, 0], [0, 1, 0])
    assert line[0] == line[-1]
    assert len(line) == 25
    assert np.unique(tube.vertices[line, 1]).tolist() == [0.5]
    slant = line_on_plane(tube, [0, 1.0, 0], [0.3, 1, 0])
    assert slant[0] == slant[-1]
    assert runs_along_edges(tube, slant)
    angles = np.unwrap(np.arctan2(tube.vertices[slant, 0], tube.vertices[slant, 2]))
    assert abs(angles[-1] - angles[0]) == pytest.approx(2 * np.pi)
    assert len(np.unique(slant)) == len(slant) - 1


def test_longest_of_several_sections_counts():
    vertices, quads = grid(9, 5)
    legs = np.delete(quads, [3, 4, 11, 12], axis=0)
    legs = legs[~np.isin(np.arange(len(legs)), [0])]
    surface = make_surface(vertices, legs)
    line = line_on_plane(surface, [0, 0.1, 0], [0, 1, 0])
    assert surface.vertices[line, 0].min() == pytest.approx(0.625)
    assert surface.vertices[line, 0].max() == pytest.approx(1.0)


def test_plane_that_misses_or_is_none_is_refused(sheet):
    with pytest.raises(InputError, match=r"does not cut the piece 'sheet'.*0 to 1 m and the plane lies at 2 m"):
        line_on_plane(sheet, [2, 0, 0], [1, 0, 0])
    with pytest.raises(InputError, match="no length"):
        line_on_plane(sheet, [0, 0, 0], [0, 0, 0])
    with pytest.raises(InputError, match="a point and a normal"):
        line_on_plane(sheet, [0, 0], [1, 0, 0])


def test_curve_along_edges_is_found_again(sheet):
    line = line_between(sheet, 0, 34)
    assert np.array_equal(line_from_curve(sheet, sheet.vertices[line]), line)
    assert line_from_curve(sheet, sheet.vertices[[3, 31]] + [0.01, 0, 0.02]).tolist() == [3, 10, 17, 24, 31]


def test_free_curve_is_followed_without_zigzag():
    surface = make_surface(*scattered(900, sphere)[:2])
    t = np.linspace(-0.5, 0.5, 200)
    curve = 0.2 * np.stack([np.sin(t) * np.cos(0.4 * t**2), np.sin(0.4 * t**2), np.cos(t) * np.cos(0.4 * t**2)], 1)
    line = line_from_curve(surface, curve)
    assert runs_along_edges(surface, line)
    assert len(np.unique(line)) == len(line)
    off = np.linalg.norm(surface.vertices[line][:, None] - curve[None], axis=2).min(axis=1)
    assert off.max() < 0.01
    assert length(surface, line) < 1.25 * np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()


def test_closed_curve_gives_a_closed_line(tube):
    t = np.linspace(0, 2 * np.pi, 100)
    curve = np.stack([np.sin(t), np.full(100, 1.02), np.cos(t)], axis=1)
    line = line_from_curve(tube, curve)
    assert line[0] == line[-1]
    assert len(line) == 25


def test_closed_curve_that_meets_one_vertex_only_goes_around(sheet):
    curve = sheet.vertices[8] + np.array([[0, 0], [2.3, 0.3], [2.2, 1.6], [0.4, 1.7], [0, 0]]) @ [
        [1 / 6, 0, 0],
        [0, 1 / 4, 0],
    ]
    line = line_from_curve(sheet, curve)
    assert line[0] == line[-1] == 8
    assert runs_along_edges(sheet, line)
    assert {10, 17, 24} < set(line.tolist())


def test_curve_off_the_piece_is_refused(sheet):
    with pytest.raises(InputError, match=r"curve 'hem' does not lie on the piece 'sheet': its point 1 is 4 m off"):
        line_from_curve(sheet, [[0, 0, 0], [5, 1, 0]], name="hem")
    with pytest.raises(InputError, match="shorter than the edges"):
        line_from_curve(sheet, [[0, 0, 0], [0.01, 0, 0]])
    with pytest.raises(InputError, match="at least two points"):
        line_from_curve(sheet, [[0, 0, 0]])


def test_lines_are_added_and_replaced(sheet):
    once = with_lines(sheet, {"a": [0, 1], "b": [0, 7]})
    twice = with_lines(once, {"a": [1, 2]})
    assert broken_invariants(twice) == []
    assert {name: line.tolist() for name, line in twice.lines.items()} == {"a": [1, 2], "b": [0, 7]}
    assert dict(sheet.lines) == {}
    with pytest.raises(InputError, match="line 'c': the line breaks"):
        with_lines(sheet, {"c": [0, 34]})
