"""A scan's mesh repaired: parts turned outward, noise smoothed; and its holes, over which the body model's skin is taken."""

from __future__ import annotations

import contextlib

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from warpflat.core import FloatArray, InputError, polyline_length
from warpflat.flat import (
    area_vectors,
    border_edges,
    chain_lines,
    components,
    half_edges,
    mesh_edges,
    orient,
    vertex_normals,
)
from warpflat.garment.mannequin.sampled import neighbour_mean

__all__ = ["find_holes", "smooth_noise", "turned_outward"]

# Skin around a hole faces one way; around the open end of a limb it faces all ways. Borders up to so long, as a share of the
# scan's greatest extent, are holes if the mean unit normal beside them is so long. The second is a face that is torn all over.
_HOLES = ((0.30, 0.15), (0.80, 0.25))
# A scan is noisy if its vertices waver off the skin by more than this share of their distance: smooth meshes of bodies by
# 0.03, those with 2 mm of noise on each coordinate by 0.18.
_WAVERS = 0.08
# A part tells which way it is wound if it has this share of the surface, and this volume for the 3/2 power of its area; a ball has 0.094.
_PART, _BULKY = 0.01, 0.004
# Taubin's shares of a step towards the neighbours' mean and of the step back, and how many of both.
_SHRINK, _GROW, _STEPS = 0.50, -0.53, 10


def turned_outward(points: FloatArray, triangles: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Return triangles that all face outward, and how many of them did not.

    A part hangs together over edges of two triangles. Its own signed volume tells how it is wound; parts that are flat or small follow the
    most. One inside the others is the inner side of a wall, and stays.

    Args:
        points: #P by 3, any unit.
        triangles: #T by 3.
    """
    faces = np.pad(triangles, ((0, 0), (0, 1)), constant_values=-1)
    # Torn scans may be one-sided somewhere: then each face is taken as it is wound.
    with contextlib.suppress(InputError):
        faces = orient(faces)[0].astype(np.int64)
    edges = half_edges(faces)
    part = components(edges, barrier=edges.edges[edges.count > 2])
    corners, vectors = points[faces[:, :3]], area_vectors(points, faces[:, :3])
    area = np.linalg.norm(vectors, axis=1)
    areas = np.maximum(np.bincount(part, area), 1e-300)
    middle = np.stack([np.bincount(part, area * along) for along in corners.mean(axis=1).T], axis=1) / areas[:, None]
    volume = np.bincount(part, np.einsum("ta,ta->t", vectors, corners[:, 0] - middle[part]) / 3.0)
    inward = volume < 0.0
    told = (areas > _PART * areas.sum()) & (np.abs(volume) > _BULKY * areas**1.5)
    for one in np.flatnonzero(told & inward & (areas < areas.max())):
        around = corners[part != one] - corners[part == one][0].mean(axis=0)
        inward[one] = abs(_winding_number(around)) < 0.5
    inward[~told] = areas[told & inward].sum() > 0.5 * areas[told].sum()
    turned = np.where(inward[part][:, None], faces[:, 2::-1], faces[:, :3]).astype(np.int64)
    # A triangle that is turned has its corners in the other order.
    first = np.argmax(turned == triangles[:, :1], axis=1)
    after = turned[np.arange(len(turned)), (first + 1) % 3]
    return turned, int((after != triangles[:, 1]).sum())


def _winding_number(corners: FloatArray) -> float:
    """Return how often triangles (#T by 3 by 3) go around the origin (Van Oosterom and Strackee 1983)."""
    a, b, c = corners.transpose(1, 0, 2)
    la, lb, lc = np.linalg.norm(corners, axis=2).T
    dots = [np.einsum("ta,ta->t", *pair) for pair in ((a, b), (b, c), (c, a))]
    below = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return float(np.arctan2(np.einsum("ta,ta->t", a, np.cross(b, c)), below).sum() / (2.0 * np.pi))


def find_holes(points: FloatArray, triangles: NDArray[np.int64]) -> list[tuple[float, FloatArray]]:
    """Return the border length and the middle of each hole of a welded mesh; the open ends of limbs and long borders are none.

    Args:
        points: #P by 3, any unit.
        triangles: #T by 3.
    """
    normal, span, holes = vertex_normals(points, triangles), float(np.ptp(points, axis=0).max()), []
    for loop in chain_lines(border_edges(triangles).tolist()):
        length, one_way = polyline_length(points[loop]), float(np.linalg.norm(normal[loop[1:]].mean(axis=0)))
        if loop[0] == loop[-1] and any(length <= longest * span and one_way >= least for longest, least in _HOLES):
            holes.append((length, points[loop[1:]].mean(axis=0)))
    return holes


def smooth_noise(points: FloatArray, triangles: NDArray[np.int64]) -> tuple[FloatArray, float]:
    """Return vertices without noise, which neither shrink nor lose their shape, and how far they wavered.

    Args:
        points: #P by 3, any unit.
        triangles: #T by 3.

    Returns:
        Vertices; the median distance along the normal by which noise moved them, 0 if they were left as they are.

    Source: Taubin, "A signal processing approach to fair surface design", 1995.
    """
    mean = neighbour_mean(mesh_edges(triangles), len(points))
    row, column = mean.nonzero()
    beside = np.linalg.norm(points[row] - points[column], axis=1)
    distance = np.bincount(row, beside * mean.data, minlength=len(points))
    # A curved skin stands off its neighbours' mean, too, but evenly: what differs from the neighbours is noise.
    off = ((points - mean @ points) * vertex_normals(points, triangles)).sum(axis=1)
    wavers = np.abs(off - mean @ off)
    if np.median(wavers / distance) < _WAVERS:
        return points, 0.0
    even = _even(points, mean)
    # Twicing: what was smoothed away is smoothed and added back, which returns most of what was shape.
    return even + _even(points - even, mean), float(np.median(wavers))


def _even(values: FloatArray, mean: csr_array) -> FloatArray:
    """Return values smoothed by Taubin's steps, `mean` the matrix of the neighbours' mean."""
    for _ in range(_STEPS):
        for share in (_SHRINK, _GROW):
            values = values + share * (mean @ values - values)
    return values
