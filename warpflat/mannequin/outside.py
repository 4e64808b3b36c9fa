"""Keeping a form outside its body: what lies inside is pushed out, and what is around it follows smoothly."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.mannequin.closest import Closest
from warpflat.mannequin.layout import Layout
from warpflat.mannequin.normals import vertex_normals

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

    def ways_out(self, points: FloatArray) -> FloatArray:
        """Return for each point (#P by 3) the way to the nearest place of the surface [m]; zero for points outside."""
        ways = np.zeros_like(points)
        # Most points lie clearly outside, off the nearest vertex along its normal: no need to look for their place.
        vertex = self.used[self.tree.query(points)[1]]
        rise = np.einsum("nk,nk->n", points - self.vertices[vertex], self.normals[vertex])
        near = np.flatnonzero(rise < self.near)
        for triangles, closest in self.splits if len(near) else ():
            triangle, weights, _ = closest(points[near])
            corners = triangles[triangle]
            way = np.einsum("nk,nkd->nd", weights, self.vertices[corners]) - points[near]
            outward = np.einsum("nk,nkd->nd", weights, self.normals[corners])
            way[np.einsum("nk,nk->n", way, outward) <= 0.0] = 0.0
            longer = np.linalg.norm(way, axis=1) > np.linalg.norm(ways[near], axis=1)
            ways[near[longer]] = way[longer]
        return ways


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
    # The tube around both legs is no part of the body's surface: it may cut through a leg where it has not moved.
    off = np.abs(vertices - body)[used].max(axis=1) > _DEEP
    moved = used[off | ~np.isin(used, layout.body_faces)]
    if not len(moved):
        return vertices
    out = vertices
    surface = BodySurface(layout, body)
    for _ in range(_ROUNDS):
        ways = surface.ways_out(out[moved])
        depth = np.linalg.norm(ways, axis=1)
        deep = depth > _DEEP
        if not deep.any():
            break
        if out is vertices:
            out = vertices.copy()
        out[used] += _spread(out, layout, used, moved[deep], ways[deep])
    return out


def _spread(vertices: FloatArray, layout: Layout, used: IntArray, pushed: IntArray, ways: FloatArray) -> FloatArray:
    """Return displacements of the vertices `used`: of those `pushed` their ways, of others shares of the ways around."""
    from scipy.spatial import cKDTree

    normals = vertex_normals(vertices, layout.faces)
    depth = np.linalg.norm(ways, axis=1)
    tree = cKDTree(vertices[used])
    amount, direction = np.zeros(len(used)), np.zeros((len(used), 3))
    for vertex, way, deep in zip(pushed, ways, depth, strict=True):
        near = np.array(tree.query_ball_point(vertices[vertex], _REACH))
        away = np.linalg.norm(vertices[used[near]] - vertices[vertex], axis=1) / _REACH
        alike = np.maximum(normals[used[near]] @ normals[vertex], 0.0)
        share = deep * (1.0 - away * away) ** 2 * alike
        amount[near] = np.maximum(amount[near], share)
        direction[near] += share[:, None] * way
    return amount[:, None] * direction / np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-300)
