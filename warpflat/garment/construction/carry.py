"""A garment carried from one body to another, whose meshes have the same vertices.

Each point of the cloth moves as the skin under it does: along the skin it stretches with it, off the skin it keeps its distance. "Under
it" are the nearest vertices of the skin that face as the cloth does, weighted, the more of them the farther the cloth hangs off, so that
folds do not tear. The move is then smoothed over the cloth, where it hangs far off by what its neighbours do; so it keeps its own shape.
Borders that lie in a plane stay in one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray, IntArray, factor_symmetric
from warpflat.flat import (
    Surface,
    area_vectors,
    border_loops,
    cotangent_matrix,
    harmonic_values,
    triangulate,
    vertex_normals,
)

__all__ = ["carry", "carry_points", "falloff_weights", "skin_frames", "skin_under"]

# The nearest vertices of the skin that are asked, and over what distance they share [m, and as a share of the cloth's distance].
_ASKED, _SHARED, _MORE = 96, 0.008, 0.5
# Cloth and skin face the same way where their normals' product is larger than this; a vertex that does not counts as so much farther.
_ALIKE, _BEHIND = 0.2, 0.06
# The move is smoothed over this length, and cloth so far off the skin counts half [m].
_SMOOTH, _OFF = 0.03, 0.04
# A border lies in a plane if it leaves it by no more than this [m, and as a share of its size].
_FLAT, _FLAT_SHARE = 0.004, 0.01


def skin_frames(before: FloatArray, after: FloatArray, triangles: NDArray[np.int64]) -> FloatArray:
    """Return how the skin around each vertex turns and stretches, #V by 3 by 3; normals turn and keep their length.

    Args:
        before, after: #V by 3 [m].
        triangles: #T by 3.
    """
    count = len(before)
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    tail, head = np.concatenate([ends, ends[:, ::-1]]).T
    one, two = (points[head] - points[tail] for points in (before, after))
    outer = np.zeros((2, count, 3, 3))
    for number, (left, right) in enumerate(((two, one), (one, one))):
        product = (left[:, :, None] * right[:, None, :]).reshape(-1, 9)
        outer[number] = np.stack([np.bincount(tail, column, minlength=count) for column in product.T], axis=1).reshape(
            -1, 3, 3
        )
    normals = [vertex_normals(points, triangles) for points in (before, after)]
    # Normals weigh as much as the edges do along the skin.
    size = np.maximum(np.trace(outer[1], axis1=1, axis2=2), 1e-18)[:, None, None]
    outer[0] += size * normals[1][:, :, None] * normals[0][:, None, :]
    outer[1] += size * normals[0][:, :, None] * normals[0][:, None, :] + 1e-9 * size * np.eye(3)
    return np.asarray(outer[0] @ np.linalg.inv(outer[1]))


def skin_under(
    points: FloatArray, normals: FloatArray, skin: FloatArray, triangles: NDArray[np.int64]
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Return the vertices of a skin under each point of cloth (#P by #K), their weights, and the distance of the nearest one (#P [m]).

    Args:
        points, normals: #P by 3 [m], and how the cloth faces there, outward.
        skin: #V by 3 [m]. triangles: #T by 3, of the skin that may be asked.
    """
    from scipy.spatial import cKDTree

    used = np.unique(triangles)
    facing = vertex_normals(skin, triangles)
    asked = min(_ASKED, len(used))
    far, near = cKDTree(skin[used]).query(points, k=asked)
    near = used[near.reshape(len(points), asked)]
    far = far.reshape(len(points), asked)
    away = far + _BEHIND * (np.einsum("pka,pa->pk", facing[near], normals) < _ALIKE)
    least = away.min(axis=1, keepdims=True)
    weight = np.exp(-0.5 * (away**2 - least**2) / (_SHARED + _MORE * least) ** 2)
    return near, weight / weight.sum(axis=1, keepdims=True), far.min(axis=1)


def carry_points(
    points: FloatArray,
    normals: FloatArray,
    before: FloatArray,
    after: FloatArray,
    triangles: NDArray[np.int64],
) -> tuple[FloatArray, FloatArray]:
    """Return the places to which points on or off a skin go with it, #P by 3 [m], and their distances from it before, #P [m].

    Args:
        points, normals: #P by 3 [m], and how the cloth faces there, outward.
        before, after: #V by 3 [m], the skin on either body.
        triangles: #T by 3, of the skin that may be asked.
    """
    frames = skin_frames(before, after, triangles)
    near, weight, far = skin_under(points, normals, before, triangles)
    off = points[:, None] - before[near]
    moved = after[near] + np.einsum("pkab,pkb->pka", frames[near], off)
    return np.einsum("pk,pka->pa", weight, moved), far


def carry(surface: Surface, before: FloatArray, after: FloatArray, triangles: NDArray[np.int64]) -> FloatArray:
    """Return the places of a garment's vertices on another body, #V by 3 [m].

    Args:
        surface: the garment on the one body, its normals outward.
        before, after: #V by 3 [m], the skin of either body.
        triangles: #T by 3, of the skin that cloth may lie over.
    """
    from scipy.sparse import diags_array

    corners = triangulate(surface.faces)[0].astype(np.int64)
    normals = vertex_normals(surface.vertices, corners)
    moved, far = carry_points(surface.vertices, normals, before, after, triangles)
    # Least squares of the move against a smooth one; second differences, so that a move that grows evenly is smooth.
    stiff = cotangent_matrix(surface)
    area = np.linalg.norm(area_vectors(surface.vertices, corners), axis=1)
    mass = np.maximum(np.bincount(corners.ravel(), np.repeat(area / 3.0, 3), minlength=len(moved)), 1e-12)
    trust = mass / (1.0 + (far / _OFF) ** 2)
    system = diags_array(trust) + _SMOOTH**4 * (stiff @ diags_array(1.0 / mass) @ stiff)
    # Smoothness bends what grows evenly at borders, so the even part of the move is taken out before.
    given = np.column_stack([surface.vertices, np.ones(len(moved))])
    even = given @ np.linalg.lstsq(trust[:, None] ** 0.5 * given, trust[:, None] ** 0.5 * moved, rcond=None)[0]
    carried = even + factor_symmetric(system.tocsc())(trust[:, None] * (moved - even))
    # Borders that lay in a plane lie in one again; what lies between borders follows.
    loops = border_loops(surface.faces, surface.vertices)
    moves = [np.zeros((len(loop), 3)) for loop in loops]
    for loop, move in zip(loops, moves, strict=True):
        was, now = (points[loop] - points[loop].mean(axis=0) for points in (surface.vertices, carried))
        if len(loop) > 7 and np.abs(was @ _plane(was)).max() < max(
            _FLAT, _FLAT_SHARE * float(np.ptp(was, axis=0).max())
        ):
            move -= (now @ _plane(now))[:, None] * _plane(now)
    if not any(move.any() for move in moves):
        return carried
    columns = [
        falloff_weights(
            surface.faces, [(loop, move[:, k]) for loop, move in zip(loops, moves, strict=True)], [], len(carried)
        )
        for k in range(3)
    ]
    return carried + np.column_stack(columns)


def _plane(points: FloatArray) -> FloatArray:
    """Return the normal of the plane nearest to points around the origin, #P by 3."""
    return np.linalg.svd(points, full_matrices=False)[2][-1]


def falloff_weights(
    faces: IntArray, given: Sequence[tuple[IntArray, FloatArray]], stops: Sequence[IntArray], count: int
) -> FloatArray:
    """Interpolate values given at some vertices over a mesh.

    Args:
        faces: #F by 4, -1 last in a triangle.
        given: rows of vertices with a value for each.
        stops: rows of vertices with 0.
        count: #V.

    Returns:
        #V, the values given, and harmonic in between.
    """
    value, known = np.zeros(count), np.zeros(count, dtype=bool)
    for stop in stops:
        known[stop] = True
    for vertices, values in given:
        value[vertices], known[vertices] = values, True
    return harmonic_values(faces, value, known)
