"""Triangles to pixels with hidden surfaces behind: a scan converter in NumPy, whose cost hardly grows with the mesh.

Drawing libraries draw polygons one by one, which takes tens of seconds for a million faces. Here all rows of all
triangles are intersected at once; triangles that cover no sample are dropped first, and those are the most of a fine
mesh. Colours and light are looked up afterwards, once per pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    span = np.repeat(np.arange(len(width)), width)
    column = first[span] + np.arange(len(span)) - np.repeat(np.cumsum(width) - width, width)
    owner = which[span]
    safe = np.where(area != 0, area, 1.0)
    rise, run = b - a, c - a
    slope_x = (rise[:, 2] * run[:, 1] - run[:, 2] * rise[:, 1]) / safe
    slope_y = (run[:, 2] * rise[:, 0] - rise[:, 2] * run[:, 0]) / safe
    depth = a[owner, 2] + slope_x[owner] * (column - a[owner, 0]) + slope_y[owner] * (row[span] - a[owner, 1])
    # Seen edge-on, a plane's depth runs away between its corners.
    low, high = (np.minimum(np.minimum(a, b), c)[:, 2], np.maximum(np.maximum(a, b), c)[:, 2])
    depth = np.clip(depth, low[owner], high[owner])
    pixel = row[span] * columns + column
    nearer = depth >= front.depth[pixel]
    pixel, depth, owner = pixel[nearer], depth[nearer], owner[nearer]
    order = np.argsort(depth, kind="stable")
    # Of repeated indices NumPy keeps the last assignment: the nearest.
    front.depth[pixel[order]] = depth[order]
    front.triangle[pixel[order]] = index[owner[order]]


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
    samples: Samples, points: NDArray[np.float64], triangles: NDArray[np.int32], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """#R by #C by 3, values at the vertices (#V by 3) blended over the triangles in front; 0 where there is none."""
    rows, columns = np.nonzero(samples.triangle >= 0)
    corners = triangles[samples.triangle[rows, columns]]
    a, b, c = (points[corners[:, k], :2] for k in range(3))
    x, y = columns + 0.5 - a[:, 0], rows + 0.5 - a[:, 1]
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    area = ux * vy - uy * vx
    safe = np.where(area != 0, area, 1.0)
    second = np.clip((x * vy - y * vx) / safe, 0.0, 1.0)[:, None]
    third = np.clip((ux * y - uy * x) / safe, 0.0, 1.0)[:, None]
    result = np.zeros((*samples.triangle.shape, values.shape[1]))
    first = np.clip(1.0 - second - third, 0.0, 1.0)
    result[rows, columns] = (
        values[corners[:, 0]] * first + values[corners[:, 1]] * second + values[corners[:, 2]] * third
    )
    return result


def reduce_samples(colours: NDArray[np.float64], covered: NDArray[np.bool_], per_pixel: int) -> NDArray[np.float64]:
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
