"""Edges that pierce their mesh: the kernel against every pair of edge and triangle in NumPy."""

from __future__ import annotations

import numpy as np
import warp as wp
from devices import DEVICE
from warpflat.kernels.pierced import find_pierced


def pierces(a: np.ndarray, b: np.ndarray, triangle: np.ndarray) -> bool:
    """Whether a segment meets a triangle, by the barycentric coordinates of its place in the triangle's plane."""
    try:
        t, u, v = np.linalg.solve(
            np.column_stack([a - b, triangle[1] - triangle[0], triangle[2] - triangle[0]]), a - triangle[0]
        )
    except np.linalg.LinAlgError:
        return False
    return bool(0.02 < t < 0.98 and u >= 0.0 and v >= 0.0 and u + v <= 1.0)


def test_edges_that_pierce_are_those_of_every_pair():
    """A crumpled sheet of random places: some edges meet several triangles, among them those of their own ends."""
    rng = np.random.default_rng(3)
    points = rng.uniform(size=(40, 3))
    triangles = np.array([rng.choice(40, 3, replace=False) for _ in range(50)], dtype=np.int32)
    edges = np.unique(
        np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1), axis=0
    )
    asked = [
        any(not {i, j} & set(t.tolist()) and pierces(points[i], points[j], points[t]) for t in triangles)
        for i, j in edges.tolist()
    ]
    mesh = wp.Mesh(
        points=wp.array(points.astype(np.float32), dtype=wp.vec3, device=DEVICE),
        indices=wp.array(triangles.ravel(), dtype=wp.int32, device=DEVICE),
    )
    found = wp.zeros(len(edges), dtype=wp.int32, device=DEVICE)
    given = wp.array(edges.astype(np.int32), dtype=wp.vec2i, device=DEVICE)
    wp.launch(find_pierced, len(edges), inputs=[mesh.id, given, 0], outputs=[found], device=DEVICE)
    assert 5 < sum(asked) < len(edges) - 5
    assert np.count_nonzero(found.numpy().astype(bool) != np.array(asked)) == 0
