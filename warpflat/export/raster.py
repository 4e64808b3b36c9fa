"""Triangles to pixels with hidden surfaces behind: a scan converter in NumPy, whose cost hardly grows with the mesh.

Drawing libraries draw polygons one by one, which takes tens of seconds for a million faces. Here all rows of all
triangles are intersected at once; triangles that cover no sample are dropped first, and those are the most of a fine
mesh. Colours and light are looked up afterwards, once per pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Samples", "interpolate", "rasterise", "reduce_samples"]

_SPANS_AT_ONCE = 1_000_000


@dataclass(frozen=True, kw_only=True)
class Samples:
    """What is in front at each sample of an image, row 0 at the top.

    Attributes:
        triangle: #R by #C, index of the triangle, -1 where there is none.
        depth: #R by #C, its depth (greater is nearer), -inf where there is none.
    """

    triangle: NDArray[np.int32]
    depth: NDArray[np.float64]


def rasterise(points: NDArray[np.float64], triangles: NDArray[np.int32], shape: tuple[int, int]) -> Samples:
    """The nearest triangle at the centre of each sample.

    Args:
        points: #V by 3: column, row (from the top; a sample's centre lies at a half) and depth, greater is nearer.
        triangles: #T by 3, of either winding; those without area cover nothing.
        shape: rows and columns of samples.
    """
    rows, columns = shape
    front = Samples(triangle=np.full(rows * columns, -1, dtype=np.int32), depth=np.full(rows * columns, -np.inf))
    top, bottom = _centres_within(points[:, 1], triangles, rows)
    left, right = _centres_within(points[:, 0], triangles, columns)
    crossed = np.flatnonzero((bottom >= top) & (right >= left))
    heights = (bottom - top + 1)[crossed]
    ends = np.cumsum(heights)
    start = 0
    while start < len(crossed):
        limit = (ends[start - 1] if start else 0) + _SPANS_AT_ONCE
        stop = max(start + 1, int(np.searchsorted(ends, limit, side="right")))
        part = crossed[start:stop]
        _fill(front, points, triangles[part], part, top[part], heights[start:stop], columns)
        start = stop
    return Samples(triangle=front.triangle.reshape(shape), depth=front.depth.reshape(shape))


def _centres_within(
    place: NDArray[np.float64], triangles: NDArray[np.int32], count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """#T and #T, the first and the last of `count` samples whose centres lie between the corners, along one axis."""
    a, b, c = (place[triangles[:, corner]] for corner in range(3))
    first = np.ceil(np.clip(np.minimum(np.minimum(a, b), c) - 0.5, 0, count)).astype(np.int64)
    last = np.floor(np.clip(np.maximum(np.maximum(a, b), c) - 0.5, -1, count - 1)).astype(np.int64)
    return first, last


def _fill(
    front: Samples,
    points: NDArray[np.float64],
    triangles: NDArray[np.int32],
    index: NDArray[np.int64],
    top: NDArray[np.int64],
    heights: NDArray[np.int64],
    columns: int,
) -> None:
    a, b, c = (points[triangles[:, k]] - (0.5, 0.5, 0.0) for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    which = np.repeat(np.arange(len(index)), heights)
    row = np.repeat(top - np.cumsum(heights) + heights, heights) + np.arange(len(which))
    left, right = _spans(a, b, c, np.sign(area), which, row)
    first = np.ceil(np.clip(left, 0, columns)).astype(np.int64)
    width = np.floor(np.clip(right, -1, columns - 1)).astype(np.int64) - first + 1
    covers = (width > 0) & (area[which] != 0)
    which, row, first, width = which[covers], row[covers], first[covers], width[covers]
    safe = np.where(area != 0, area, 1.0)
    rise, run = b - a, c - a
    slope_x = ((rise[:, 2] * run[:, 1] - run[:, 2] * rise[:, 1]) / safe)[which]
    slope_y = (run[:, 2] * rise[:, 0] - rise[:, 2] * run[:, 0]) / safe
    # Seen edge-on, a plane's depth runs away between its corners.
    low, high = (np.minimum(np.minimum(a, b), c)[which, 2], np.maximum(np.maximum(a, b), c)[which, 2])
    begin = a[which, 2] + slope_x * (first - a[which, 0]) + slope_y[which] * (row - a[which, 1])
    end = np.clip(begin + slope_x * (width - 1), low, high)
    begin = np.clip(begin, low, high)
    slope = (end - begin) / np.maximum(width - 1, 1)
    # From here on an entry per sample, many more than spans.
    starts = np.cumsum(width) - width
    count = np.arange(int(width.sum()), dtype=np.int32)
    pixel = count + np.repeat((row * columns + first - starts).astype(np.int32), width)
    depth = np.repeat(slope, width) * (count - np.repeat(starts.astype(np.int32), width)) + np.repeat(begin, width)
    owner = np.repeat(index[which].astype(np.int32), width)
    nearer = depth >= front.depth[pixel]
    if not nearer.all():
        pixel, depth, owner, count = pixel[nearer], depth[nearer], owner[nearer], count[: int(nearer.sum())]
    _put_nearest(front, pixel, depth, owner, count)


def _put_nearest(
    front: Samples,
    pixel: NDArray[np.int32],
    depth: NDArray[np.float64],
    owner: NDArray[np.int32],
    count: NDArray[np.int32],
) -> None:
    """Set pixels to the nearest of those given for each; of equally near ones to the last."""
    last = np.empty(front.depth.shape, dtype=np.int32)
    last[pixel] = count
    lost = last[pixel] != count
    front.depth[pixel], front.triangle[pixel] = depth, owner
    if lost.any():
        several = np.zeros(front.depth.shape, dtype=bool)
        several[pixel[lost]] = True
        entries = np.flatnonzero(several[pixel])
        # Of repeated indices NumPy keeps the last assignment: the nearest.
        entries = entries[np.argsort(depth[entries], kind="stable")]
        front.depth[pixel[entries]], front.triangle[pixel[entries]] = depth[entries], owner[entries]


def _spans(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    c: NDArray[np.float64],
    sign: NDArray[np.float64],
    which: NDArray[np.int64],
    row: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where each row enters and leaves its triangle: the part of it inside all three edges."""
    left, right = np.full(len(row), -np.inf), np.full(len(row), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        across = -(end[:, 1] - start[:, 1]) * sign
        along = (end[:, 0] - start[:, 0]) * sign
        level = across[which]
        inside = along[which] * (row - start[which, 1])
        bound = start[which, 0] - inside / np.where(level != 0, level, 1.0)
        left = np.where(level > 0, np.maximum(left, bound), left)
        right = np.where(level < 0, np.minimum(right, bound), right)
        right = np.where((level == 0) & (inside < 0), -np.inf, right)
    return left, right


def interpolate(
    triangle: NDArray[np.int32],
    spots: NDArray[np.float64],
    points: NDArray[np.float64],
    triangles: NDArray[np.int32],
    values: NDArray[Any],
) -> NDArray[Any]:
    """#S by #K, values at the vertices (#V by #K) blended over triangles at spots inside them.

    Args:
        triangle: #S, the triangle of each spot.
        spots: #S by 2, column and row.
        points: #V by 2 or more: column and row.
        triangles: #T by 3.
        values: #V by #K; the result has their precision.
    """
    a, b, c = (points[triangles[:, k], :2] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    area = ux * vy - uy * vx
    safe = np.where(area != 0, area, 1.0)
    # Per triangle what would else be worked out again at each of its spots.
    plane = np.column_stack([a, vy / safe, -vx / safe, -uy / safe, ux / safe])[triangle]
    x, y = spots[:, 0] - plane[:, 0], spots[:, 1] - plane[:, 1]
    second = np.clip(plane[:, 2] * x + plane[:, 3] * y, 0.0, 1.0).astype(values.dtype)[:, None]
    third = np.clip(plane[:, 4] * x + plane[:, 5] * y, 0.0, 1.0).astype(values.dtype)[:, None]
    corner = values[triangles[triangle].T]
    return np.asarray(corner[0] * np.maximum(1.0 - second - third, 0.0) + corner[1] * second + corner[2] * third)


def reduce_samples(colours: NDArray[Any], covered: NDArray[np.bool_], per_pixel: int) -> NDArray[Any]:
    """RGBA pixels from `per_pixel` squared samples each: their mean colour, and as opacity the covered share.

    Args:
        colours: #R by #C by 3; rows and columns are multiples of `per_pixel`.
        covered: #R by #C.
    """
    rows, columns = covered.shape[0] // per_pixel, covered.shape[1] // per_pixel
    blocks = (rows, per_pixel, columns, per_pixel)
    share = covered.reshape(blocks).mean(axis=(1, 3))
    summed = (colours * covered[..., None]).reshape(*blocks, 3).mean(axis=(1, 3))
    return np.concatenate([summed / np.where(share > 0, share, 1.0)[..., None], share[..., None]], axis=-1)
