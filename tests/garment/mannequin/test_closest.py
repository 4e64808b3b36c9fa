"""The nearest places on a mesh of triangles."""

from __future__ import annotations

import numpy as np

from warpflat.garment.mannequin.closest import Closest


def test_closest_is_exact_against_brute_force() -> None:
    rng = np.random.default_rng(0)
    vertices = rng.normal(size=(40, 3))
    triangles = rng.integers(40, size=(60, 3))
    triangles = triangles[(np.diff(np.sort(triangles, axis=1), axis=1) > 0).all(axis=1)]
    points = rng.normal(size=(50, 3)) * 1.5
    _, _, distance = Closest(vertices, triangles)(points)
    grid = np.array([(i, j, 40 - i - j) for i in range(41) for j in range(41 - i)]) / 40.0
    dense = np.einsum("gk,tkd->tgd", grid, vertices[triangles]).reshape(-1, 3)
    brute = np.linalg.norm(points[:, None] - dense[None], axis=2).min(axis=1)
    assert (distance <= brute + 1e-12).all()
    assert (brute - distance).max() < 0.06
