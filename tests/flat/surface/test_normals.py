"""Normals of the vertices of a mesh."""

from __future__ import annotations

import numpy as np

from warpflat.flat.surface.normals import vertex_normals


def test_a_vertex_whose_faces_cancel_has_no_normal_whatever_the_rounding() -> None:
    # A roof, and beside it a flap of two faces on each other, as in the mouth of a body model.
    points = np.array(
        [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0], [3.1, 0.3, 0.7], [4.7, 0.9, 0.1], [3.3, 1.7, 0.2]]
    )  # fmt: skip
    faces = np.array([[0, 1, 2], [1, 0, 3], [4, 5, 6], [5, 4, 6]])
    for shift in np.random.default_rng(0).normal(size=(20, 3)):
        normals = vertex_normals(points + shift, faces)
        np.testing.assert_array_equal(normals[4:], 0.0)
        np.testing.assert_allclose(normals[0], [0.0, 1.0, 0.0], atol=1e-12)
