"""A vertex that lies far from all others: a number lost its point, or was damaged."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray

__all__ = ["stray_vertex", "stray_words"]

# A stray vertex lies this many times further from the middle than nine of ten vertices.
_FAR = 50.0


def stray_vertex(points: FloatArray) -> int | None:
    """Return the one of #P by 3 finite points that lies farthest from their middle, if that is far beyond nine of ten others."""
    distance = np.abs(points - np.median(points, axis=0)).max(axis=1)
    farthest = int(np.argmax(distance))
    return farthest if distance[farthest] > _FAR * np.quantile(distance, 0.9, method="lower") else None


def stray_words(vertex: int, place: FloatArray) -> str:
    """Return the message about a stray vertex at a place (3 coordinates)."""
    x, y, z = place.tolist()
    return (
        f"vertex {vertex} (counted from 0) lies at ({x:.10g}, {y:.10g}, {z:.10g}), far from all others; move it to its place, or delete it "
        "with its faces"
    )
