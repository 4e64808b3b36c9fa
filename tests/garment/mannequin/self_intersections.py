"""Checks of a surface that it passes through itself nowhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import BoolArray, FloatArray, IntArray

__all__ = ["self_intersections"]


def self_intersections(vertices: FloatArray, faces: IntArray) -> NDArray[np.int64]:
    """Pairs of quads that cut through each other.

    Quads count as two triangles; triangles that share a vertex (or a place, along a cut) are not compared.

    Args:
        vertices: #V by 3.
        faces: #F by 4.

    Returns:
        #P by 2, face indices.
    """
    from scipy.spatial import cKDTree

    # A doubled vertex is one place: both sides of a cut touch there without passing through each other.
    _, place = np.unique(vertices, axis=0, return_inverse=True)
    triangles = np.ravel(place)[np.concatenate([faces[:, :3], faces[:, [0, 2, 3]]])].astype(np.int64)
    face = np.tile(np.arange(len(faces)), 2)
    corners = vertices[np.concatenate([faces[:, :3], faces[:, [0, 2, 3]]])]
    middles = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    pairs = cKDTree(middles).query_pairs(2.0 * float(radius.max()), output_type="ndarray")
    if not len(pairs):
        return np.zeros((0, 2), np.int64)
    low, high = corners.min(axis=1), corners.max(axis=1)
    a, b = pairs.T
    near = (low[a] <= high[b]).all(axis=1) & (low[b] <= high[a]).all(axis=1)
    a, b = a[near], b[near]
    apart = ~(triangles[a][:, :, None] == triangles[b][:, None, :]).any(axis=(1, 2))
    a, b = a[apart], b[apart]
    hit = np.zeros(len(a), bool)
    for first, second in ((a, b), (b, a)):
        for k in range(3):
            hit |= _pierces(corners[first, k], corners[first, (k + 1) % 3], corners[second])
    found = np.unique(np.sort(np.column_stack([face[a[hit]], face[b[hit]]]), axis=1), axis=0)
    return np.asarray(found, np.int64)


def _pierces(start: FloatArray, end: FloatArray, triangle: FloatArray) -> BoolArray:
    """Whether each segment passes through its triangle (Moeller and Trumbore 1997)."""
    e1, e2 = triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0]
    d = end - start
    p = np.cross(d, e2)
    det = np.einsum("ij,ij->i", e1, p)
    safe = np.abs(det) > 1e-18
    inverse = np.where(safe, 1.0 / np.where(safe, det, 1.0), 0.0)
    s = start - triangle[:, 0]
    u = np.einsum("ij,ij->i", s, p) * inverse
    q = np.cross(s, e1)
    v = np.einsum("ij,ij->i", d, q) * inverse
    t = np.einsum("ij,ij->i", e2, q) * inverse
    return np.asarray(safe & (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1))
