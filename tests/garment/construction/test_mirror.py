"""Partners across a line, by how faces hang together, wherever they lie; layouts that are nearly mirror images."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.flat.surface.shapes import make_shape
from warpflat.garment.construction.mirror import even_sides, mirror_partners


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


def test_layouts_that_are_nearly_mirror_images_become_so_where_they_lie() -> None:
    random = np.random.default_rng(5)
    left = random.uniform(0.0, 0.3, (12, 2))
    order = random.permutation(12)
    # The image, a tenth of a millimetre off, at another place on the table; the middle is its own image.
    right = (left * [-1.0, 1.0])[order] + [0.7, 0.2] + 1e-4 * random.uniform(-1.0, 1.0, (12, 2))
    aside = np.array([1.4, 0.0])
    back = np.concatenate([left + aside, left * [-1.0, 1.0] + aside])
    itself = np.concatenate([np.arange(12) + 12, np.arange(12)])
    images = {"left": ("right", np.argsort(order)), "right": ("left", order), "back": ("back", itself)}
    even = even_sides({"left": left, "right": right, "back": back}, images)
    shapes = [even[name] - even[name].mean(axis=0) for name in ("left", "right")]
    np.testing.assert_allclose(shapes[0] * [-1.0, 1.0], shapes[1][np.argsort(order)], atol=1e-12)
    for name, was in (("left", left), ("right", right), ("back", back)):
        np.testing.assert_allclose(even[name].mean(axis=0), was.mean(axis=0), atol=1e-12)
        assert np.abs(even[name] - was).max() < 2e-4
    # All or none.
    far = right + 1e-3 * random.uniform(-1.0, 1.0, (12, 2))
    same = even_sides({"left": left, "right": far, "back": back}, images)
    assert all(np.array_equal(same[name], was) for name, was in (("left", left), ("right", far), ("back", back)))
