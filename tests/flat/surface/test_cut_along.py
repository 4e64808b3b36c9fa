"""Single cuts with a known outcome, and the paths that are refused."""

from __future__ import annotations

import numpy as np
import pytest
from cut_meshes import cone, cylinder, glue, grid

from warpflat.core.errors import InputError
from warpflat.flat.surface.connectivity import border_loops, euler_characteristic
from warpflat.flat.surface.cut.cut_mesh import cut_along, faces_at
from warpflat.flat.surface.half_edges import border_edges

FIVE = grid(5, 5)


@pytest.mark.parametrize(
    ("path", "kind", "tips", "pieces", "added"),
    [
        ([2, 7, 12], "dart", [12], 1, 2),
        ([12, 7, 2], "dart", [12], 1, 2),
        ([2, 7], "dart", [7], 1, 1),
        ([2, 7, 12, 17, 22], "split", [], 2, 5),
        ([6, 7, 8], "slit", [6, 8], 1, 1),
        ([6, 7, 8, 13, 18, 17, 16, 11, 6], "hole", [], 2, 8),
        ([6, 5], "dart", [6], 1, 1),
        ([7, 2, 1], None, None, None, None),
    ],
)
def test_kinds(path, kind, tips, pieces, added):
    if kind is None:
        with pytest.raises(InputError, match="runs along the border between vertices 2 and 1"):
            cut_along(FIVE, [path], vertex_count=25)
        return
    cut = cut_along(FIVE, [path], vertex_count=25)
    assert cut.kind == kind
    assert cut.tips.tolist() == tips
    assert cut.component_count == pieces
    assert len(cut.vertex_origin) == 25 + added
    np.testing.assert_array_equal(cut.vertex_origin[:25], np.arange(25))
    np.testing.assert_array_equal(glue(cut), FIVE)
    assert glue(cut).dtype == FIVE.dtype


def test_left_keeps_the_old_vertices_and_lies_to_the_left():
    cut = cut_along(FIVE, [[2, 7, 12]], vertex_count=25)
    (seam,) = cut.seams
    assert seam.path.tolist() == [2, 7, 12]
    assert seam.left.tolist() == [2, 7, 12]
    assert seam.right.tolist() == [25, 26, 12]
    # Walking from row 0 upwards, seen from +Z, column 1 lies to the left: face 1 is between columns 1 and 2.
    assert cut.faces[1].tolist() == [1, 2, 7, 6]
    assert cut.faces[2].tolist() == [25, 3, 8, 26]


def test_both_sides_of_a_cut_are_border_with_the_cloth_on_the_right_side():
    cut = cut_along(FIVE, [[2, 7, 12, 13]], vertex_count=25)
    border = {tuple(edge) for edge in border_edges(cut.faces).tolist()}
    assert set(zip(cut.seams[0].left[:-1].tolist(), cut.seams[0].left[1:].tolist(), strict=True)) <= border
    assert set(zip(cut.seams[0].right[1:].tolist(), cut.seams[0].right[:-1].tolist(), strict=True)) <= border


def test_opening_of_a_tube_gives_a_disk():
    tube = cylinder(12, 4)
    cut = cut_along(tube.faces, [[0, 12, 24, 36]], vertex_count=48)
    assert cut.kind == "opening"
    assert euler_characteristic(cut.faces) == 1
    assert len(border_loops(cut.faces)) == 1
    assert len(cut.vertex_origin) == 52


def test_tube_cut_across_falls_into_two_tubes():
    tube = cylinder(6, 4)
    cut = cut_along(tube.faces, [[6, 7, 8, 9, 10, 11, 6]], vertex_count=24)
    assert cut.kind == "split"
    assert cut.component_count == 2
    assert cut.seams[0].left[0] == cut.seams[0].left[-1]
    assert len(border_loops(cut.faces)) == 4


def test_cone_cut_along_a_generator_stays_a_disk_with_its_apex_whole():
    shape = cone(10, 4)
    apex = len(shape.vertices) - 1
    cut = cut_along(shape.faces, [[3, 13, 23, 33, apex]], vertex_count=apex + 1)
    assert cut.kind == "dart"
    assert cut.tips.tolist() == [apex]
    assert euler_characteristic(cut.faces) == 1
    loop = border_loops(cut.faces)[0]
    assert len(loop) == 10 + 2 * 4
    assert apex in loop


def test_cuts_that_meet_in_a_point():
    cut = cut_along(FIVE, [[2, 7, 12], [10, 11, 12], [12, 13, 14], [22, 17, 12]], vertex_count=25)
    assert cut.kind == "network"
    assert cut.component_count == 4
    assert int((cut.vertex_origin == 12).sum()) == 4
    assert len(cut.seams) == 4
    np.testing.assert_array_equal(glue(cut), FIVE)


def test_a_crossing_breaks_the_seams_of_the_cut_it_crosses():
    cut = cut_along(FIVE, [[2, 7, 12, 17, 22], [10, 11, 12, 13, 14]], vertex_count=25)
    assert [seam.path.tolist() for seam in cut.seams] == [[2, 7, 12], [12, 17, 22], [10, 11, 12], [12, 13, 14]]
    for seam in cut.seams:
        np.testing.assert_array_equal(cut.vertex_origin[seam.left], seam.path)
        np.testing.assert_array_equal(cut.vertex_origin[seam.right], seam.path)


def test_a_branch_breaks_only_the_side_it_leaves_from():
    cut = cut_along(FIVE, [[2, 7, 12, 17], [12, 13]], vertex_count=25)
    assert [seam.path.tolist() for seam in cut.seams] == [[2, 7, 12], [12, 17], [12, 13]]
    assert cut.seams[0].left[-1] == cut.seams[1].left[0]
    assert cut.seams[0].right[-1] != cut.seams[1].right[0]


def test_closed_seam_touched_by_another_cut_starts_at_the_branch():
    loop = [6, 7, 8, 13, 18, 17, 16, 11, 6]
    cut = cut_along(FIVE, [loop, [13, 14]], vertex_count=25)
    assert [seam.path.tolist() for seam in cut.seams] == [[13, 18, 17, 16, 11, 6, 7, 8, 13], [13, 14]]


def test_a_slit_that_touches_the_border_is_a_dart():
    assert cut_along(FIVE, [[6, 1, 0][:2]], vertex_count=25).kind == "dart"
    triangles = grid(5, 5, kinds=np.ones(16, dtype=int))
    cut = cut_along(triangles, [[6, 1, 7]], vertex_count=25)
    assert cut.kind == "dart"
    assert cut.tips.tolist() == [6, 7]
    assert int((cut.vertex_origin == 1).sum()) == 3


def test_the_input_is_left_alone():
    faces = FIVE.copy()
    cut_along(faces, [[2, 7, 12]], vertex_count=25)
    np.testing.assert_array_equal(faces, FIVE)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ([], "at least two vertices, got 0"),
        ([7], "only vertex 7"),
        ([6, 12], "leaves the mesh between vertices 6 and 12"),
        ([2, 7, 99], "vertex 99 does not exist; valid: 0 to 24"),
        ([2, -1], "vertex -1 does not exist"),
        ([2, 7, 8, 7], "vertex 7 occurs twice, at positions 1 and 3"),
        ([7, 7], "vertex 7 occurs twice"),
        ([7, 8, 7], "vertex 7 occurs twice"),
        ([0, 1, 2], "along the border between vertices 0 and 1"),
        ([0, 1, 2, 3, 4, 9, 14, 19, 24, 23, 22, 21, 20, 15, 10, 5, 0], "along the border between vertices 0 and 1"),
        ([2, 7, 6, 5, 0], "along the border between vertices 5 and 0"),
        ([6, 7], "edge 6-7 separates nothing"),
        ([2.0, 7.0], "row of vertex indices"),
        ([[2, 7]], "row of vertex indices"),
    ],
)
def test_refused(path, message):
    with pytest.raises(InputError, match=message) as error:
        cut_along(FIVE, [path], vertex_count=25)
    assert "\n" not in str(error.value)


def test_refused_together():
    with pytest.raises(InputError, match="edge 7-12 is cut by two paths"):
        cut_along(FIVE, [[2, 7, 12], [7, 12, 13]], vertex_count=25)
    with pytest.raises(InputError, match="no path"):
        cut_along(FIVE, [], vertex_count=25)
    with pytest.raises(InputError, match="edge 16-17 separates nothing"):
        cut_along(FIVE, [[2, 7, 12], [16, 17]], vertex_count=25)


def test_a_vertex_without_faces_is_refused_by_name():
    with pytest.raises(InputError, match=r"vertex 25 belongs to no face|between vertices 25 and 26"):
        cut_along(FIVE, [[25, 26]], vertex_count=27)


def test_inconsistent_winding_is_noticed():
    faces = FIVE.copy()
    faces[1] = faces[1][::-1]
    with pytest.raises(InputError, match="wound inconsistently"):
        cut_along(faces, [[2, 7, 12]], vertex_count=25)


def test_faces_at_vertices_have_one_of_them_and_a_triangle_has_no_last_vertex():
    mixed = np.array([[0, 1, 2, 3], [1, 4, 2, -1]], dtype=np.int32)
    assert faces_at(mixed, np.array([4], dtype=np.int32)).tolist() == [1]
    assert faces_at(mixed, np.array([2, 9], dtype=np.int32)).tolist() == [0, 1]
    assert faces_at(mixed, np.array([3, 0], dtype=np.int32)).tolist() == [0]
    assert faces_at(mixed, np.array([9], dtype=np.int32)).tolist() == []
