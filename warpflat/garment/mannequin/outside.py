"""Keeping a form outside its body: what lies inside is pushed out, and what is around it follows smoothly."""

from __future__ import annotations

import numpy as np

from warpflat.core import FloatArray, IntArray, unit
from warpflat.flat import vertex_normals
from warpflat.garment.mannequin.exact_closest import Closest
from warpflat.garment.mannequin.layout import Layout

__all__ = ["BodySurface", "push_outside"]

# A vertex that lies deeper than this inside the body [m] is pushed out.
_DEEP = 5e-5
# So far [m] the neighbours of a vertex follow it; a push of a millimetre then slants the cloth by two degrees at most.
_REACH = 0.05
# Where two parts of the body meet in a fold, pushing a vertex off one may push it into the other.
_ROUNDS = 6


class BodySurface:
    """The surface of a body, without the tube around both legs.

    Args:
        layout: the grid.
        vertices: #V by 3, the body's [m].
    """

    def __init__(self, layout: Layout, vertices: FloatArray) -> None:
        from scipy.spatial import cKDTree

        faces = layout.body_faces.astype(np.int64)
        # Both diagonals of each quad: the outer one counts, and mirror images stay alike.
        splits = [
            np.concatenate([faces[:, a], faces[:, b]]) for a, b in (([0, 1, 2], [0, 2, 3]), ([1, 2, 3], [1, 3, 0]))
        ]
        self.vertices, self.normals = vertices, vertex_normals(vertices, layout.body_faces)
        self.used = np.unique(faces)
        self.tree = cKDTree(vertices[self.used])
        self.splits = [(triangles, Closest(vertices, triangles)) for triangles in splits]
        self.near = 0.5 * layout.resolution

    def vectors_out(self, points: FloatArray) -> FloatArray:
        """Return for each point (#P by 3) the vector to the nearest place of the surface [m]; zero for points outside."""
        vectors = np.zeros_like(points)
        # Most points lie clearly outside, off the nearest vertex along its normal: no need to look for their place.
        vertex = self.used[self.tree.query(points)[1]]
        rise = np.einsum("nk,nk->n", points - self.vertices[vertex], self.normals[vertex])
        near = np.flatnonzero(rise < self.near)
        for triangles, closest in self.splits if len(near) else ():
            triangle, weights, _ = closest(points[near])
            corners = triangles[triangle]
            vector = np.einsum("nk,nkd->nd", weights, self.vertices[corners]) - points[near]
            outward = np.einsum("nk,nkd->nd", weights, self.normals[corners])
            vector[np.einsum("nk,nk->n", vector, outward) <= 0.0] = 0.0
            longer = np.linalg.norm(vector, axis=1) > np.linalg.norm(vectors[near], axis=1)
            vectors[near[longer]] = vector[longer]
        return vectors


def push_outside(vertices: FloatArray, layout: Layout, body: FloatArray, used: IntArray) -> FloatArray:
    """Return a form's vertices with those inside the body pushed out to its surface.

    Vertices around a pushed one follow, the less the farther away and the more they face elsewhere, so that there is
    no dent.

    Args:
        vertices: #V by 3, the form's [m].
        layout: the grid of both.
        body: #V by 3, the body's [m].
        used: the vertices of the form's pieces.
    """
    from scipy.spatial import cKDTree

    # The tube around both legs is no part of the body's surface: it may cut through a leg where it has not moved.
    off = np.abs(vertices - body)[used].max(axis=1) > _DEEP
    moved = used[off | ~np.isin(used, layout.body_faces)]
    if not len(moved):
        return vertices
    out = vertices
    surface = BodySurface(layout, body)
    for _ in range(_ROUNDS):
        vectors = surface.vectors_out(out[moved])
        depth = np.linalg.norm(vectors, axis=1)
        deep = depth > _DEEP
        if not deep.any():
            break
        if out is vertices:
            out = vertices.copy()
        normals, tree = vertex_normals(out, layout.faces), cKDTree(out[used])
        amount, direction = np.zeros(len(used)), np.zeros((len(used), 3))
        for vertex, vector, pushed in zip(moved[deep], vectors[deep], depth[deep], strict=True):
            near = np.array(tree.query_ball_point(out[vertex], _REACH))
            away = np.linalg.norm(out[used[near]] - out[vertex], axis=1) / _REACH
            alike = np.maximum(normals[used[near]] @ normals[vertex], 0.0)
            share = pushed * (1.0 - away * away) ** 2 * alike
            amount[near] = np.maximum(amount[near], share)
            direction[near] += share[:, None] * vector
        out[used] += amount[:, None] * unit(direction)
    return out
