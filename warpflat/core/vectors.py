"""Rows of vectors: unit, turned and reflected ones, and points that are laid upon others."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray, IntArray

__all__ = ["AXES", "laid_upon", "reflected", "turn_between", "turned_left", "unit"]

# A vector shorter than this has no direction, and stays as short.
_SHORTEST = 1e-300
#: Directions by name, as "+x".
AXES = {sign + letter: (1.0 if sign == "+" else -1.0) * np.eye(3)[k] for k, letter in enumerate("xyz") for sign in "+-"}


def unit(vectors: FloatArray) -> FloatArray:
    """Return vectors (... by #D) with length 1; those of no length stay 0."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), _SHORTEST))


def turned_left(vectors: FloatArray) -> FloatArray:
    """Return vectors (#N by 2) turned to the left by a right angle."""
    return np.stack([-vectors[:, 1], vectors[:, 0]], axis=1)


def turn_between(a: FloatArray, b: FloatArray) -> float:
    """Return the angle [rad] by which a vector in the plane turns to another one, to the left positive."""
    return float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))


def reflected(points: FloatArray, normal: FloatArray, offset: float = 0.0) -> FloatArray:
    """Return the mirror images of points (... by #D [m]) in the plane normal . x = offset [m]; of directions without an offset."""
    return np.asarray(points - 2.0 * (points @ normal - offset)[..., None] * normal)


def laid_upon(target: FloatArray, points: FloatArray, rows: slice | BoolArray | IntArray = slice(None)) -> FloatArray:
    """Return points turned and shifted, not mirrored, to lie as near to their targets as they can.

    Source: Kabsch, "A solution for the best rotation to relate two sets of vectors", 1976.

    Args:
        target: #T by #D [m].
        points: #P by #D [m].
        rows: those of the points that have a target, all if not given.
    """
    known = points[rows]
    middle, aim = known.mean(axis=0), target.mean(axis=0)
    u, _, v = np.linalg.svd((known - middle).T @ (target - aim))
    u[:, -1] *= np.sign(np.linalg.det(u @ v))
    return np.asarray((points - middle) @ (u @ v) + aim)
