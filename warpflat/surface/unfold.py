"""Bent quads laid flat.

Four points in space do not say along which diagonal their quad is creased: both ways of splitting it can be unfolded, into
different flat quads. The mesh around tells. Along a crease, as along a ruling of a cylinder, the surface is straight, so its
normal does not turn; across it does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.surface.topology import places_of
from warpflat.surface.vectors import cross, dot, norm, points_at

__all__ = ["lay_quads_flat", "quad_creases"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

# Diagonals that pass each other within this share of their length belong to a flat quad, creased or not.
_FLAT = 1e-9
# A diagonal is the crease if the surface is curved along it less than this share of what it is along the other one.
_STRAIGHTER = 0.5
# Turns below this [rad] tell nothing.
_NO_TURN = 1e-7


def quad_creases(vertices: FloatArray, faces: IntArray) -> tuple[NDArray[np.int8], IntArray]:
    """Along which diagonal each quad is creased.

    Args:
        vertices: #V by 3, positions [m]. Vertices at the same place count as one, so that a cut changes nothing.
        faces: #F by 4, -1 in the last column of a triangle.

    Returns:
        #Q, 0 for the diagonal of corners 0-2, 1 for 1-3, and -1 where the quad is flat, not convex, or twisted, with neither
        diagonal straighter on the surface than the other; and #Q, the face of each row. Where the mesh around tells
        nothing, as beside a quad without neighbours, it is the longer one: a rectangle's diagonals are equal until it is
        creased, and then the other one is shorter.
    """
    index = np.flatnonzero(faces[:, 3] >= 0).astype(np.int32)
    crease = np.full(len(index), -1, dtype=np.int8)
    if len(index) == 0:
        return crease, index
    corner = points_at(vertices, faces[index].T)
    d02, d13 = corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]
    l02, l13 = norm(d02), norm(d13)
    normal = cross(d02, d13)
    side = [corner[:, (i + 1) % 4] - corner[:, i] for i in range(4)]
    bent = np.abs(dot(side[0], normal)) > _FLAT * norm(normal) * np.maximum(l02, l13)
    for i in range(4):
        bent &= dot(cross(side[i], side[(i + 1) % 4]), normal) > 0.0
    if not bent.any():
        return crease, index

    along = np.take(_normals(vertices, faces, index, normal), faces[index].T, axis=1)
    turn = np.stack(
        [
            np.abs(dot(along[:, k + 2] - along[:, k], diagonal)) / np.maximum(length, np.finfo(float).tiny)
            for k, diagonal, length in ((0, d02, l02), (1, d13, l13))
        ],
        axis=1,
    )
    lengths = np.stack([l02, l13], axis=1)
    told = turn.max(axis=1) > _NO_TURN
    curvature = turn / np.maximum(lengths, np.finfo(float).tiny)
    measure = np.where(told[:, None], curvature, lengths[:, ::-1])
    share = np.where(told, _STRAIGHTER, 1.0 - 1e-6)
    for k in (0, 1):
        crease[bent & (measure[:, k] < share * measure[:, 1 - k])] = k
    return crease, index


def _normals(vertices: FloatArray, faces: IntArray, index: IntArray, of_quads: FloatArray) -> FloatArray:
    """3 by #V, the surface's unit normal at each vertex: the mean of those of its faces by area, on both sides of a crack."""
    place = places_of(vertices, faces)
    a, b, c = (points_at(vertices, faces[:, k]) for k in range(3))
    of_face = cross(b - a, c - a)
    # Of a creased quad this is at right angles to both diagonals.
    of_face[:, index] = of_quads
    total = np.zeros((3, len(vertices)))
    for k in range(4):
        there = slice(None) if k < 3 else index
        at = place[faces[there, k]]
        total += [np.bincount(at, row[there], minlength=len(vertices)) for row in of_face]
    return np.asarray((total / np.maximum(norm(total), np.finfo(float).tiny))[:, place])


def lay_quads_flat(
    vertices: FloatArray, faces: IntArray, *, creases: tuple[NDArray[np.int8], IntArray] | None = None
) -> tuple[FloatArray, IntArray, NDArray[np.int8]]:
    """The quads that are creased along a diagonal, each unfolded about it into the plane; what can be developed keeps its size.

    Args:
        vertices: #V by 3, positions [m].
        faces: #F by 4, -1 in the last column of a triangle.
        creases: what `quad_creases` says of them, if that is known.

    Returns:
        #K by 4 by 2, corners in the plane, anticlockwise [m]; #K, the face of each; #K, its crease as `quad_creases` has it.
    """
    crease, index = quad_creases(vertices, faces) if creases is None else creases
    chosen = crease >= 0
    crease, index = crease[chosen], index[chosen]
    turned = np.arange(4)[None] + crease[:, None].astype(np.int64)
    rolled = np.take_along_axis(faces[index].astype(np.int64), turned % 4, axis=1)
    corner = vertices[rolled]
    hinge = corner[:, 2] - corner[:, 0]
    length = np.linalg.norm(hinge, axis=1)
    flat = np.zeros((len(index), 4, 2))
    flat[:, 2, 0] = length
    for k, side in ((1, -1.0), (3, 1.0)):
        out = corner[:, k] - corner[:, 0]
        flat[:, k, 0] = np.einsum("ij,ij->i", out, hinge) / length
        flat[:, k, 1] = side * np.linalg.norm(np.cross(hinge, out), axis=1) / length
    unrolled = np.empty_like(flat)
    np.put_along_axis(unrolled, (turned % 4)[..., None], flat, axis=1)
    return unrolled, index, crease
