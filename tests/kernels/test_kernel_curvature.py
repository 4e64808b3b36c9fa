"""Curvature of a vertex, against NumPy's least squares over the same neighbours; along threads, against the cells' deformations."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from warpflat.kernels.curvature import bend_threads, fit_curvature

from warpflat.core.launch import launch_each


def fitted(place: np.ndarray, neighbors: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Three rounds of fitting normal and second fundamental form."""
    d = neighbors - place
    squared = (d * d).sum(axis=1)
    d, squared = d[squared > 0.0], squared[squared > 0.0]
    if len(d) < 5:
        return np.zeros((3, 3))
    for _ in range(3):
        u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        u /= np.linalg.norm(u)
        w = np.cross(normal, u)
        x, y = d @ u, d @ w
        size = 0.5 / (x * x + y * y)
        rows = np.column_stack([size * x * x, 2 * size * x * y, size * y * y, x / squared, y / squared])
        a, b, c, p, q = np.linalg.lstsq(rows, -(d @ normal) / squared, rcond=None)[0]
        normal = normal + p * u + q * w
        normal /= np.linalg.norm(normal)
    return a * np.outer(u, u) + b * (np.outer(u, w) + np.outer(w, u)) + c * np.outer(w, w)


@pytest.mark.parametrize("begin", [0, 3])
def test_curvature_is_that_of_least_squares(begin: int) -> None:
    rng = np.random.default_rng(0)
    vertices = rng.uniform(-0.1, 0.1, (40, 3))
    vertices[:, 2] = 2.0 * vertices[:, 0] ** 2 - vertices[:, 0] * vertices[:, 1] + 0.002 * rng.normal(size=40)
    vertices[7] = vertices[5]
    lists = [rng.choice(40, size, replace=False) for size in (12, 4, 15, 20, 14, 16, 12)]
    lists[5] = np.append(lists[5], [5, 7]) if begin == 0 else lists[5]
    normals = np.array([0.0, 0.1, 1.0]) + 0.1 * rng.normal(size=(40, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    offset = np.cumsum([0, *map(len, lists)]).astype(np.int32)
    tensors = np.full((40, 3, 3), np.nan)
    given = [vertices, offset, np.concatenate(lists).astype(np.int32), normals, begin]
    launch_each(fit_curvature, len(lists), given, [tensors])
    for i, near in enumerate(lists):
        expected = fitted(vertices[begin + i], vertices[near], normals[begin + i])
        np.testing.assert_allclose(tensors[begin + i], expected, rtol=1e-5, atol=1e-6)
    assert np.abs(tensors[begin]).max() > 0.1
    np.testing.assert_array_equal(tensors[begin + 1], 0.0)
    assert np.isnan(tensors[begin + len(lists) :]).all()


def test_threads_bend_as_the_body_does_along_them() -> None:
    rng = np.random.default_rng(1)
    count = 40
    body, pattern = rng.normal(size=(12, 3)), rng.normal(size=(12, 2))
    corner = np.array([rng.choice(12, 3, replace=False) for _ in range(count)], dtype=np.int32)
    tensor = rng.normal(size=(12, 3, 3))
    tensor += tensor.transpose(0, 2, 1)
    a, b = body[corner[:, 1]] - body[corner[:, 0]], body[corner[:, 2]] - body[corner[:, 0]]
    x = a / np.linalg.norm(a, axis=1)[:, None]
    y = b - (b * x).sum(axis=1)[:, None] * x
    y /= np.linalg.norm(y, axis=1)[:, None]
    laid = np.column_stack([(a * x).sum(axis=1), (b * x).sum(axis=1), (b * y).sum(axis=1)])
    warp, weft = np.array([-0.6, 0.8]), np.array([0.8, 0.6])
    along = np.empty((count, 4))
    given = [pattern, body, corner, laid, tensor, wp.vec2d(*warp), wp.vec2d(*weft)]
    launch_each(bend_threads, count, given, [along])
    mirrored = 0
    for c, (p, q, r) in enumerate(corner):
        bend = (tensor[p] + tensor[q] + tensor[r]) / 3.0
        edges = np.column_stack([pattern[q] - pattern[p], pattern[r] - pattern[p]])
        expected = np.zeros(3)
        if np.linalg.det(edges) > 0.0:
            deformation = np.column_stack([a[c], b[c]]) @ np.linalg.inv(edges)
            one, other = (of / np.linalg.norm(of) for of in (deformation @ warp, deformation @ weft))
            expected = np.array([one @ bend @ one, other @ bend @ other, one @ bend @ other])
        else:
            mirrored += 1
        np.testing.assert_allclose(along[c], [*expected, np.trace(bend)], rtol=1e-9, atol=1e-12)
    assert 0 < mirrored < count
