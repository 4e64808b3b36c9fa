"""Cloth off the body: straight between two levels, and bridged over hollows, along a row and from level to level."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.polyline import arc_lengths

__all__ = ["bridge_row", "bridge_rows", "rule_rows"]


def bridge_row(row: FloatArray) -> FloatArray:
    """Return a closed level row with every vertex that lies in a hollow moved to the straight line across it."""
    from scipy.spatial import ConvexHull

    touch = np.sort(ConvexHull(row[:, [0, 2]]).vertices)
    s = arc_lengths(row, closed=True)
    at = np.append(s[touch], s[-1] + s[touch[0]])
    around = np.vstack([row[touch], row[touch[:1]]])
    places = np.where(s[:-1] < at[0], s[:-1] + s[-1], s[:-1])
    return np.column_stack([np.interp(places, at, around[:, i]) for i in range(3)])


def bridge_rows(out: FloatArray, grid: IntArray, row_of: Mapping[str, int], pair: tuple[str, str]) -> None:
    """Move what lies in a hollow between two levels out to the hull of all rows from the one to the other.

    A skirt hangs like this from the waist over the small of the back to the seat. Where a row stands out, it stays.

    Args:
        out: #V by 3 [m], changed in place.
        grid: rows of the trunk.
        row_of: its levels.
        pair: of levels.
    """
    low, high = sorted(row_of[level] for level in pair)
    ids = grid[low : high + 1]
    rows = out[ids]
    middle = rows.mean(axis=1)
    share = (middle[1:-1, 1] - middle[0, 1]) / (middle[-1, 1] - middle[0, 1])
    inner = rows[1:-1]
    # About one axis for all rows, so that a column of the grid does not bend as the rows' middles do.
    axis = middle[0] + share[:, None] * (middle[-1] - middle[0])
    starts = axis[:, None] * [1.0, 0.0, 1.0] + inner * [0.0, 1.0, 0.0]
    rays = inner - starts
    reach = np.maximum(_hull_reach(rows.reshape(-1, 3), starts, rays), 1.0)
    out[ids[1:-1]] = starts + reach[..., None] * rays


def rule_rows(
    out: FloatArray, grid: IntArray, row_of: Mapping[str, int], pair: tuple[str, str], solid: FloatArray | None
) -> None:
    """Lay the rows between two levels straight.

    Args:
        out: #V by 3 [m], changed in place.
        grid: rows of trunk, arm or leg.
        row_of: its levels.
        pair: of levels.
        solid: #P by 3, the body, over which cloth hangs where it stands out between the levels; None for an arm, whose
            rows share the way evenly whatever its direction.
    """
    for level in pair:
        if level not in row_of:
            raise InputError(f"form: ruled: level {level!r} is unknown: {nearest(level, row_of)}")
    a, b = sorted(row_of[level] for level in pair)
    if a == b:
        raise InputError(f"form: ruled: {pair[0]} and {pair[1]} are the same level")
    ids = grid[a : b + 1]
    first, last = out[ids[0]], out[ids[-1]]
    share = np.linspace(0.0, 1.0, len(ids))
    if solid is not None:
        share = (out[ids, 1].mean(axis=1) - first[:, 1].mean()) / (last[:, 1].mean() - first[:, 1].mean())
    straight = first + share[:, None, None] * (last - first)
    if len(ids) > 2 and solid is not None:
        low, high = sorted((first[:, 1].mean(), last[:, 1].mean()))
        between = solid[(solid[:, 1] > low) & (solid[:, 1] < high)]
        ends = np.concatenate([first, last])
        inner = straight[1:-1]
        middles = inner.mean(axis=1, keepdims=True) * [1.0, 0.0, 1.0] + inner * [0.0, 1.0, 0.0]
        rays = inner - middles
        alone, over = (_hull_reach(points, middles, rays) for points in (ends, np.concatenate([ends, between])))
        # Straight, except where the body pushes the hull out; the hull of the end rows alone is no straight line, so that
        # the body may stand out of the one and not of the other.
        bare = _hull_reach(between, middles, rays)
        pushed = np.maximum(np.where(over > alone * (1.0 + 1e-9), over, bare), 1.0)
        straight[1:-1] = middles + pushed[..., None] * rays
    out[ids] = straight


def _hull_reach(points: FloatArray, starts: FloatArray, rays: FloatArray) -> FloatArray:
    """Return how many of its own lengths each ray, #R by #P by 3, runs from inside the convex hull of `points` to it."""
    from scipy.spatial import ConvexHull

    planes = ConvexHull(points).equations
    normals = np.ascontiguousarray(planes[:, :3].T)
    reach = np.empty(rays.shape[:2])
    for row, (start, ray) in enumerate(zip(starts, rays, strict=True)):  # a row of them at a time stays in the cache
        rate = ray @ normals
        room = -(start @ normals + planes[:, 3])
        np.divide(room, rate, out=room, where=rate > 1e-12)
        room[rate <= 1e-12] = np.inf
        reach[row] = room.min(axis=1)
    return reach
