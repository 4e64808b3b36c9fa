"""Normals of the mannequin's quads."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray

__all__ = ["face_normals", "vertex_normals"]


def face_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return #F by 3, unit normals of quads; zero for a quad without area."""
    corner = vertices[faces]
    area = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    return area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300)


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return #V by 3, unit normals, each the sum of its quads' area vectors; zero where these cancel."""
    corner = vertices[faces]
    area = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    out = np.zeros_like(vertices)
    for k in range(4):
        np.add.at(out, faces[:, k], area)
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300)
