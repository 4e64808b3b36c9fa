"""The nearest places of triangles to points."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from warpflat.flat.surface.closest import nearest_on_triangles


def test_no_place_of_a_triangle_is_nearer_than_that_which_is_found() -> None:
    random = np.random.default_rng(3)
    corners, points = random.normal(size=(5000, 3, 3)), 2.0 * random.normal(size=(5000, 3))
    # Some of them are needles, and some are nothing but a point.
    corners[:200, 2] = corners[:200, 1] + 1e-9 * corners[:200, 2]
    corners[:20] = corners[:20, :1]
    shares = nearest_on_triangles(corners, points)
    assert shares.sum(axis=1) == pytest.approx(1.0)
    assert shares.min() > -1e-12
    away = np.linalg.norm(np.einsum("tk,tkj->tj", shares, corners) - points, axis=1)
    peer = np.linalg.norm(trimesh.triangles.closest_point(corners, points) - points, axis=1)
    assert away[200:] == pytest.approx(peer[200:], abs=1e-12)
    at_corners = np.linalg.norm(corners[:200] - points[:200, None], axis=2).min(axis=1)
    assert (away[:200] <= at_corners + 1e-6).all()
