"""Partners across a line: by how faces hang together, wherever they lie."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.surface.mirror import mirror_partners
from warpflat.surface.shapes import make_shape


def test_a_grid_is_its_own_mirror_image_about_its_middle_column():
    surface = make_shape("bodice", resolution=9)
    axis = surface.lines["centre"]
    partner = mirror_partners(surface.faces, axis, vertex_count=len(surface.vertices))
    np.testing.assert_array_equal(partner[partner], np.arange(len(partner)))
    np.testing.assert_array_equal(np.flatnonzero(partner == np.arange(len(partner))), np.sort(axis))
    mirrored = surface.vertices[partner] * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(mirrored, surface.vertices, atol=1e-12)


def test_triangles_and_quads_together():
    #  3 - 4 - 5
    #  | \ | / |     a triangle and a triangle to either side of the line 1-4, quads would do as well
    #  0 - 1 - 2
    faces = np.array([[0, 1, 3, -1], [1, 4, 3, -1], [1, 5, 4, -1], [1, 2, 5, -1]], dtype=np.int32)
    partner = mirror_partners(faces, np.array([1, 4], dtype=np.int32), vertex_count=7)
    np.testing.assert_array_equal(partner, [2, 1, 0, 5, 4, 3, -1])


@pytest.mark.parametrize(
    ("faces", "axis", "message"),
    [
        # one diagonal leans the other way
        ([[0, 1, 4, -1], [0, 4, 3, -1], [1, 5, 4, -1], [1, 2, 5, -1]], [1, 4], r"not its own mirror image .*vertex \d"),
        # a triangle against a quad
        ([[0, 1, 4, 3], [1, 5, 4, -1]], [1, 4], "not its own mirror image"),
        ([[0, 1, 4, 3], [1, 2, 5, 4]], [0, 3], "no faces on both sides between its vertices 0 and 3"),
        ([[0, 1, 4, 3], [1, 2, 5, 4], [2, 6, 7, 5]], [1, 4], "not its own mirror image"),
    ],
)
def test_a_mesh_without_a_mirror_image_is_told(faces: list[list[int]], axis: list[int], message: str):
    with pytest.raises(InputError, match=message):
        mirror_partners(np.array(faces, dtype=np.int32), np.array(axis, dtype=np.int32), vertex_count=8)
