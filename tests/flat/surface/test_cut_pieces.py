"""A cut carried over to a surface: lines, pieces and their names."""

from __future__ import annotations

import numpy as np
import pytest
from cut_meshes import cylinder, edge_set, flat, grid, surface

from warpflat.core.errors import InputError
from warpflat.flat.surface.cut.cut_mesh import cut_along
from warpflat.flat.surface.cut.pieces import apply_cut, split_pieces

FIVE = surface(
    flat(5, 5),
    grid(5, 5),
    {"centre": [2, 7, 12, 17, 22], "bust": [5, 6, 7, 8, 9], "waist": [10, 11, 12, 13, 14], "hem": [0, 1, 2, 3, 4]},
)


def cut_of(*paths):
    return cut_along(FIVE.faces, paths, vertex_count=25)


def as_lists(lines):
    return {name: line.tolist() for name, line in lines.items()}


def test_lines_of_a_dart():
    lines = as_lists(apply_cut(FIVE, cut_of([2, 7, 12])).lines)
    assert lines == {
        "centre": [12, 17, 22],
        "centre.left": [2, 7, 12],
        "centre.right": [25, 26, 12],
        "bust.1": [5, 6, 7],
        "bust.2": [26, 8, 9],
        "waist": [10, 11, 12, 13, 14],
        "hem.1": [0, 1, 2],
        "hem.2": [25, 3, 4],
    }


def test_left_and_right_of_a_line_follow_the_line_not_the_cut():
    up = as_lists(apply_cut(FIVE, cut_of([2, 7, 12])).lines)
    down = apply_cut(FIVE, cut_of([12, 7, 2]))
    assert down.vertices[down.lines["centre.left"]].tolist() == FIVE.vertices[[2, 7, 12]].tolist()
    # The left copy is the one that the line "bust.1", coming from the left, ends at.
    assert down.lines["centre.left"][1] == down.lines["bust.1"][-1]
    assert up["centre.left"][1] == up["bust.1"][-1]


def test_every_carried_line_runs_along_edges_and_none_of_its_length_is_lost():
    cut = cut_of([2, 7, 12], [10, 11, 12], [18, 17, 16])
    whole = apply_cut(FIVE, cut)
    edges = edge_set(whole.faces)
    covered = {name: set() for name in FIVE.lines}
    for name, line in whole.lines.items():
        for a, b in zip(line[:-1].tolist(), line[1:].tolist(), strict=True):
            assert (min(a, b), max(a, b)) in edges
            old = sorted(cut.vertex_origin[[a, b]].tolist())
            covered[name.split(".")[0]].add(tuple(old))
    for name, line in FIVE.lines.items():
        assert covered[name] == {tuple(sorted(e)) for e in zip(line[:-1].tolist(), line[1:].tolist(), strict=True)}


def test_closed_line_around_a_tube_becomes_one_open_line():
    tube = cylinder(6, 3)
    tube = surface(tube.vertices, tube.faces, {"ring": [6, 7, 8, 9, 10, 11, 6]})
    whole = apply_cut(tube, cut_along(tube.faces, [[2, 8, 14]], vertex_count=18))
    ring = whole.lines["ring"]
    assert len(ring) == 7
    assert ring[0] != ring[-1]
    np.testing.assert_array_equal(whole.vertices[ring[0]], whole.vertices[ring[-1]])


def test_line_names_do_not_collide():
    odd = surface(FIVE.vertices, FIVE.faces, {"bust": [5, 6, 7, 8, 9], "bust.1": [15, 16, 17]})
    lines = apply_cut(odd, cut_of([2, 7, 12])).lines
    assert len(lines) == 3
    assert lines["bust.1"].tolist() == [15, 16, 17]


def test_two_pieces_with_names_and_maps():
    cut = cut_of([2, 7, 12, 17, 22])
    pieces = split_pieces(FIVE, cut)
    assert [piece.surface.name for piece in pieces] == ["front.right", "front.left"]
    for piece in pieces:
        part = piece.surface
        np.testing.assert_array_equal(part.vertices, FIVE.vertices[piece.vertex_origin])
        np.testing.assert_array_equal(piece.vertex_origin[part.faces], FIVE.faces[piece.face_index])
        np.testing.assert_array_equal(part.input_vertices[part.input_index], part.vertices)
        assert set(part.lines) == {"centre", "bust", "waist", "hem"}
    assert sum(len(piece.face_index) for piece in pieces) == len(FIVE.faces)


def test_names_by_height_by_hole_and_by_number():
    assert {p.surface.name for p in split_pieces(FIVE, cut_of([10, 11, 12, 13, 14]))} == {"front.upper", "front.lower"}
    hole = split_pieces(FIVE, cut_of([6, 7, 8, 13, 18, 17, 16, 11, 6]))
    assert {p.surface.name: len(p.face_index) for p in hole} == {"front.outer": 12, "front.inner": 4}
    cross = split_pieces(FIVE, cut_of([2, 7, 12, 17, 22], [10, 11, 12, 13, 14]))
    assert [p.surface.name for p in cross] == ["front.1", "front.2", "front.3", "front.4"]
    assert [p.surface.name for p in split_pieces(FIVE, cut_of([2, 7]))] == ["front"]


def test_lines_of_one_piece_keep_their_numbers_where_the_plain_name_would_be_taken():
    outer = next(
        p.surface
        for p in split_pieces(FIVE, cut_of([6, 7, 8, 13, 18, 17, 16, 11, 6]))
        if p.surface.name == "front.outer"
    )
    assert {name for name in outer.lines if name.startswith("waist")} == {"waist.1", "waist.3"}


def test_a_line_off_the_mesh_is_refused_by_name():
    odd = surface(FIVE.vertices, FIVE.faces, {"stray": [7, 13]})
    with pytest.raises(InputError, match="'stray' leaves the mesh between vertices 7 and 13"):
        apply_cut(odd, cut_of([2, 7, 12]))
