"""Borders of flat meshes as named edges, cracks as darts."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from polygons import drafted_piece
from shapely.affinity import scale
from surface_meshes import quads_between

from warpflat.core.errors import InputError
from warpflat.pattern.drafting.drawing import draw_piece
from warpflat.pattern.drafting.from_mesh import MeshFeatures, piece_from_mesh
from warpflat.pattern.files.left_out import LeftOut, listening_to_left_out


def grid(columns=10, rows=12, width=0.2, height=0.3):
    x, y = np.meshgrid(np.linspace(0, width, columns + 1), np.linspace(0, height, rows + 1))
    index = np.arange((columns + 1) * (rows + 1)).reshape(rows + 1, columns + 1)
    faces = quads_between(index)
    lines = {"hem": index[0], "side": index[:, -1], "centre": index[:, 0], "level": index[6]}
    return faces.astype(np.int32), np.column_stack([x.ravel(), y.ravel()]), lines, index


def make_piece(faces, flat, *, name, **features):
    return piece_from_mesh(faces, flat, name=name, features=MeshFeatures(**features))


def cracked(opening=0.02):
    """The grid with its middle column doubled over five rows from below and pulled open."""
    faces, flat, lines, index = grid()
    path = index[:6, 5]
    copies = {int(v): len(flat) + i for i, v in enumerate(path[:-1])}
    flat = np.concatenate([flat, flat[path[:-1]]])
    right = flat[faces].mean(axis=1)[:, 0] > 0.1
    for row in np.flatnonzero(right):
        faces[row] = [copies.get(int(v), v) for v in faces[row]]
    share = 1 - flat[:, 1] / flat[path[-1], 1]
    for v, copy in copies.items():
        flat[copy, 0] += opening / 2 * share[v]
        flat[v, 0] -= opening / 2 * share[v]
    return faces, flat, lines, path, copies


def test_a_crack_that_gapes_where_it_is_worn_is_a_vent_and_no_dart():
    faces, flat, _, _, _ = cracked()
    assert len(make_piece(faces, flat, name="panel").darts) == 1
    vent = make_piece(faces, flat, name="panel", worn=np.pad(flat, ((0, 0), (0, 1))))
    assert not vent.darts
    assert {edge.kind for edge in vent.edges} == {"seam"}
    worn = np.pad(cracked(opening=0.5e-3)[1], ((0, 0), (0, 1)))
    assert len(make_piece(faces, flat, name="panel", worn=worn).darts) == 1


def test_edges_take_the_names_of_the_lines_along_them():
    faces, flat, lines, index = grid()
    piece = make_piece(
        faces, flat, name="panel", lines=lines, kinds={"hem": "hem", "centre": "fold"}, allowances={"side": 0.015}
    )
    assert [e.name for e in piece.edges] == ["hem", "side", "edge_1", "centre"]
    assert [e.kind for e in piece.edges] == ["hem", "seam", "seam", "fold"]
    assert piece.edge("side").width == 0.015
    assert piece.on_fold
    assert list(piece.internal_lines) == ["level"]
    assert np.array_equal(piece.edge("side").vertices, index[:, -1])
    assert shapely.Polygon(piece.outline).area == pytest.approx(0.06)
    assert len(drafted_piece(piece).edge("side").curve.bezier) == 1


def test_a_line_that_runs_along_two_stretches_names_both():
    faces, flat, _, index = grid()
    around = np.concatenate([index[3:7, -1], index[6, -2:0:-1], index[6:2:-1, 0]])
    piece = make_piece(faces, flat, name="p", lines={"belt": around})
    names = [e.name for e in piece.edges]
    assert {"belt", "belt_2"} <= set(names)
    assert len(piece.internal_lines) == 1


def test_a_crack_is_found_and_becomes_a_dart_that_folds():
    faces, flat, lines, path, _ = cracked()
    piece = make_piece(faces, flat, name="p", lines={k: v for k, v in lines.items() if k != "hem"})
    assert [d.name for d in piece.darts] == ["dart"]
    left, right = piece.edge("dart.left"), piece.edge("dart.right")
    assert left.length == pytest.approx(right.length)
    assert left.points[-1] == pytest.approx(flat[path[-1]])
    drafted = drafted_piece(piece)
    cut = shapely.Polygon(drafted.cut_line)
    assert cut.is_valid
    assert cut.contains(shapely.Point(drafted.darts[0].tip - np.array([0, 0.1]))), "the wedge stays in the cloth"


def test_a_dart_may_be_named_by_its_vertices():
    faces, flat, _, path, copies = cracked()
    mouth = (int(path[0]), int(path[-1]), copies[int(path[0])])
    piece = make_piece(faces, flat, name="p", darts={"waist": mouth})
    assert [d.name for d in piece.darts] == ["waist"]
    assert piece.edge("waist.left").kind == "dart"
    with pytest.raises(InputError, match="counter-clockwise"):
        make_piece(faces, flat, name="p", darts={"waist": mouth[::-1]})
    with pytest.raises(InputError, match="not on the outer border"):
        make_piece(faces, flat, name="p", darts={"waist": (mouth[0], 93, mouth[2])})


def test_a_layout_on_its_back_is_turned_over():
    faces, flat, lines, _ = grid()
    piece = make_piece(faces, flat * [-1, 1], name="p", lines=lines)
    assert np.array_equal(piece.outline, make_piece(faces, flat, name="p", lines=lines).outline)


def test_a_border_inside_becomes_a_cutout():
    faces, flat, _, _ = grid()
    middle = np.linalg.norm(flat[faces].mean(axis=1) - [0.1, 0.15], axis=1) < 0.03
    piece = make_piece(faces[~middle], flat, name="p")
    (hole,) = piece.holes
    assert shapely.Polygon(hole.points).area == pytest.approx(middle.sum() * 0.02 * 0.025)


def test_a_smooth_border_without_lines_is_one_closed_edge():
    t = np.linspace(0, 2 * np.pi, 73)[:-1]
    flat = np.concatenate([[[0.0, 0.0]], 0.1 * np.column_stack([np.cos(t), np.sin(t)])])
    ring = np.arange(1, 73)
    faces = np.column_stack([np.zeros(72), ring, np.roll(ring, -1), np.full(72, -1)]).astype(np.int32)
    piece = make_piece(faces, flat, name="disc")
    assert len(piece.edges) == 1
    cut = shapely.Polygon(drafted_piece(piece).cut_line)
    assert cut.is_valid
    assert cut.area == pytest.approx(np.pi * 0.11**2, rel=2e-3)


def test_a_ragged_border_has_no_more_corners_than_its_shape():
    faces, flat, _, index = grid(columns=60, rows=80)
    ragged = np.concatenate([index[0, 1:-1], index[-1, 1:-1], index[1:-1, 0], index[1:-1, -1]])
    flat[ragged] += np.random.default_rng(3).uniform(-0.0008, 0.0008, (len(ragged), 2))
    piece = make_piece(faces, flat, name="p")
    assert len(piece.edges) == 4
    assert sorted(int(e.vertices[0]) for e in piece.edges) == sorted(
        [index[0, 0], index[0, -1], index[-1, 0], index[-1, -1]]
    )
    assert shapely.Polygon(drafted_piece(piece).cut_line).is_valid


def strap(width, step, across, bend=0.0):
    """A strip of quads 0.6 m long, its corners' indices, bent to an arc of so much [rad]."""
    faces, flat, _, index = grid(across, round(0.6 / step), width, 0.6)
    if bend:
        x, turn = flat[:, 0] + 0.6 / bend, flat[:, 1] / 0.6 * bend
        flat = np.column_stack([x * np.cos(turn), x * np.sin(turn)])
    return faces, flat, [index[0, 0], index[0, -1], index[-1, 0], index[-1, -1]]


@pytest.mark.parametrize("bend", [0.0, 1.2])
@pytest.mark.parametrize("across", [1, 2, 5])
@pytest.mark.parametrize("step", [0.001, 0.005, 0.02])
@pytest.mark.parametrize("width", [0.004, 0.0077, 0.010, 0.012, 0.0121, 0.020, 0.040])
def test_a_strap_has_four_corners_however_narrow(width, step, across, bend):
    faces, flat, corners = strap(width, step, across, bend)
    piece = make_piece(faces, flat, name="strap")
    assert sorted(int(e.vertices[0]) for e in piece.edges) == sorted(corners)


def test_a_narrow_side_keeps_its_allowance_all_along():
    faces, flat, lines, _ = grid(4, 160, 0.010, 0.8)
    piece = make_piece(
        faces,
        flat,
        name="binding",
        lines={"left": lines["centre"], "right": lines["side"]},
        allowances={"left": 0.02, "right": 0.02},
    )
    assert [(e.name, round(e.length, 6)) for e in piece.edges] == [
        ("edge_1", 0.01),
        ("right", 0.8),
        ("edge_2", 0.01),
        ("left", 0.8),
    ]
    cut = drafted_piece(piece).cut_line
    np.testing.assert_allclose(np.ptp(cut, axis=0), [0.05, 0.82], atol=1e-9)


def test_a_pointed_end_has_a_corner_at_its_point_too():
    """A tie with a sewn point: three corners within one window."""
    faces, flat, corners = strap(0.010, 0.005, 2)
    tip = len(flat) - 2
    flat[tip, 1] += 0.003
    piece = make_piece(faces, flat, name="tie")
    assert sorted(int(e.vertices[0]) for e in piece.edges) == sorted([*corners, tip])


@pytest.mark.parametrize("count", [7, 13, 25])
@pytest.mark.parametrize("width", [0.006, 0.008, 0.010])
def test_a_round_end_has_one_corner(width, count):
    turn = np.linspace(0, np.pi, count)
    up = np.linspace(0, 0.3, 61)
    ring = np.concatenate(
        [
            np.column_stack([width / 2 * np.cos(turn), 0.3 + width / 2 * np.sin(turn)]),
            np.column_stack([np.full(60, -width / 2), up[-2::-1]]),
            np.column_stack([np.full(60, width / 2), up[:-1]]),
        ]
    )
    faces = np.stack([np.arange(len(ring)), np.roll(np.arange(len(ring)), -1)], axis=1)
    faces = np.column_stack([np.full(len(ring), len(ring)), faces, np.full(len(ring), -1)]).astype(np.int32)
    piece = make_piece(faces, np.concatenate([ring, [[0.0, 0.15]]]), name="strap")
    starts = sorted(int(e.vertices[0]) for e in piece.edges)
    assert len(starts) == 3
    assert starts[1:] == [count + 59, count + 60]


def test_the_grain_follows_the_datum_line_inside_the_piece():
    faces, flat, lines, _ = grid()
    angle = np.radians(20)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    piece = make_piece(faces, flat @ turn.T, name="p", lines=lines, grain_line="centre")
    along = piece.grain[1] - piece.grain[0]
    assert along / np.linalg.norm(along) == pytest.approx(turn[:, 1])
    assert shapely.Polygon(piece.outline).contains(shapely.LineString(piece.grain))


def test_unknown_names_and_bad_layouts_are_refused():
    faces, flat, lines, _ = grid()
    with pytest.raises(InputError, match="did you mean 'hem'"):
        make_piece(faces, flat, name="p", lines=lines, kinds={"hen": "hem"})
    with pytest.raises(InputError, match="no line 'centr'"):
        make_piece(faces, flat, name="p", lines=lines, grain_line="centr")
    with pytest.raises(InputError, match="#V by 2"):
        make_piece(faces, np.zeros((3, 3)), name="p")
    tetrahedron = np.array([[0, 1, 2, -1], [0, 2, 3, -1], [0, 3, 1, -1], [1, 3, 2, -1]], dtype=np.int32)
    with pytest.raises(InputError, match="no border"):
        make_piece(tetrahedron, np.random.default_rng(0).random((4, 2)), name="p")


@pytest.mark.parametrize("rows", [30, 60])
def test_a_narrow_hollow_tip_has_its_corner_where_the_border_turns_and_an_even_allowance(rows):
    """Both corners of the tip lie in one window, in which the border turns most between them."""
    faces, flat, _, index = grid(columns=8, rows=rows)
    share = np.linspace(-1, 1, 9)
    half = 0.0008 + 0.03 * np.sin(np.pi * np.arange(rows + 1) / rows)
    flat[:, 0] = np.tile(share, rows + 1) * np.repeat(half, 9)
    # A tenth of a millimetre, as deep as a gore's tip comes out in woven cloth.
    hollow = 1e-4 * (1 - share**4)
    flat[index[0], 1] += hollow
    flat[index[-1], 1] -= hollow
    piece = make_piece(faces, flat, name="gore")
    ends = {int(edge.vertices[0]) for edge in piece.edges}
    assert ends <= {int(index[row, column]) for row in (0, -1) for column in (0, -1)}
    cut = shapely.Polygon(drafted_piece(piece).cut_line)
    assert cut.symmetric_difference(scale(cut, xfact=-1, origin=(0, 0))).area < 1e-5


def test_a_hole_that_lies_on_itself_is_not_cut_and_drawn_dashed():
    faces, flat, _, index = grid()
    flat = flat.copy()
    hole = np.isin(faces, index[5:8, 4:7]).all(axis=1)
    # One side of the hole is pulled across the other.
    flat[index[6, 4]] += [0.07, 0.0]
    heard = list[LeftOut]()
    with listening_to_left_out(heard.append):
        piece = make_piece(faces[~hole], flat, name="kite")
    assert not piece.holes
    assert list(piece.internal_lines) == ["hole_1 left out"]
    assert [step.is_needed for step in heard] == [True]
    assert heard[0].note.startswith("hole_1 of kite is not cut, and drawn dashed: ")
    strokes = draw_piece(drafted_piece(piece)).strokes
    assert [stroke.name for stroke in strokes if stroke.role == "left_out"] == ["hole_1 left out"]


def test_a_hole_that_meets_the_border_at_a_point_opens_there():
    """Two squares without cloth, one on the border and one beside it, which meet at a vertex."""
    faces, flat, _, index = grid()
    missing = [
        np.isin(faces, index[row : row + 2, column : column + 2]).all(axis=1) for row, column in ((0, 4), (1, 5))
    ]
    faces, double = faces[~np.any(missing, axis=0)].copy(), len(flat)
    # Its cloth on either side has a vertex of its own.
    at = index[1, 5]
    right = (faces == at) & (faces == index[0, 5]).any(axis=1, keepdims=True)
    faces[right] = double
    piece = make_piece(faces, np.vstack([flat, flat[at]]), name="clipped")
    outline = shapely.Polygon(piece.outline)
    cell = 0.02 * 0.025
    assert outline.is_valid
    assert not piece.holes
    assert outline.area == pytest.approx(0.06 - 2 * cell, abs=1e-6)
    assert shapely.Polygon(drafted_piece(piece).cut_line).is_valid
