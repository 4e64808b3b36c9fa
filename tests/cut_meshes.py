"""Small meshes that the tests of cutting share."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from surface_meshes import quads_between

from warpflat.flat.surface.connectivity import euler_characteristic, non_manifold_vertices
from warpflat.flat.surface.cut.cut_mesh import Cut
from warpflat.flat.surface.half_edges import border_edges, half_edges
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.trace import path_triangles


def surface(vertices: NDArray, faces: NDArray, lines: Mapping[str, list[int]] | None = None) -> Surface:
    vertices = np.asarray(vertices, dtype=float)
    return Surface(
        vertices=vertices,
        faces=np.asarray(faces, dtype=np.int32),
        lines={name: np.asarray(line, dtype=np.int32) for name, line in (lines or {}).items()},
        name="front",
    )


def grid(columns: int, rows: int, *, wrap: bool = False, kinds: NDArray | None = None) -> NDArray[np.int32]:
    """Faces over columns * rows vertices, vertex = row * columns + column, wound to face +Z.

    `kinds`, one per cell: 0 a quad, 1 and 2 two triangles along either diagonal. `wrap` joins the last column to the
    first.
    """
    index = np.arange(columns * rows).reshape(rows, columns)
    if wrap:
        index = np.column_stack([index, index[:, 0]])
    cells = quads_between(index)
    kinds = np.zeros(len(cells), dtype=int) if kinds is None else kinds
    faces = []
    for (a, b, c, d), kind in zip(cells.tolist(), kinds.tolist(), strict=True):
        faces += {0: [(a, b, c, d)], 1: [(a, b, c, -1), (a, c, d, -1)], 2: [(a, b, d, -1), (b, c, d, -1)]}[kind]
    return np.array(faces, dtype=np.int32).reshape(-1, 4)


def flat(columns: int, rows: int, *, step: float = 0.1) -> NDArray[np.float64]:
    y, x = np.meshgrid(np.arange(rows) * step, np.arange(columns) * step, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(columns * rows)])


def dome(n: int, *, kinds: NDArray | None = None) -> Surface:
    """A cap of a sphere of 0.45 m over 0.5 m by 0.5 m, n by n vertices."""
    points = flat(n, n, step=0.5 / (n - 1)) - [0.25, 0.25, 0.0]
    points[:, 2] = np.sqrt(0.45**2 - points[:, 0] ** 2 - points[:, 1] ** 2)
    return surface(points, grid(n, n, kinds=kinds))


def cylinder(around: int, rows: int, *, radius: float = 0.1, height: float = 0.3, triangles: bool = False) -> Surface:
    """A tube about the Z axis, open at both ends, seen from outside; row r runs from 0 at the bottom."""
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    points = np.concatenate([np.column_stack([ring, np.full(around, z)]) for z in np.linspace(0, height, rows)])
    kinds = np.ones(around * (rows - 1), dtype=int) if triangles else None
    return surface(points, grid(around, rows, wrap=True, kinds=kinds))


def cone(around: int, rows: int) -> Surface:
    """A cone with its apex at the last vertex; row r of rings from the rim upwards."""
    angle = 2 * np.pi * np.arange(around) / around
    rings = [
        np.column_stack([s * 0.2 * np.cos(angle), s * 0.2 * np.sin(angle), np.full(around, 0.3 * (1 - s))])
        for s in np.linspace(1, 1 / rows, rows)
    ]
    points = np.concatenate([*rings, [[0.0, 0.0, 0.3]]])
    last = (rows - 1) * around + np.arange(around)
    caps = np.column_stack([last, np.roll(last, -1), np.full(around, len(points) - 1), np.full(around, -1)])
    return surface(points, np.concatenate([grid(around, rows, wrap=True), caps]))


def edge_set(faces: NDArray) -> set[tuple[int, int]]:
    return {(a, b) for a, b in half_edges(faces).edges.tolist()}


def glue(cut: Cut) -> NDArray[np.int32]:
    """The faces before the cut (#F by 4), bit for bit: every copy of a vertex becomes the old vertex again."""
    faces = cut.faces.copy()
    used = faces >= 0
    faces[used] = cut.vertex_origin[faces[used]]
    return faces


def triangle_areas(mesh):
    triangles, face = path_triangles(mesh)
    a, b, c = (mesh.vertices[triangles[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1), face


def border_length(mesh):
    ends = mesh.vertices[border_edges(mesh.faces)]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()


def broken_by_split(mesh, result):
    """What holds of every split, and not of this one: the same surface, no hanging vertex, correct maps, lines along edges."""
    new, count = result.surface, len(mesh.vertices)
    blend = np.einsum("nk,nkd->nd", result.vertex_weights, mesh.vertices[result.vertex_support])
    area_before, face_before = triangle_areas(mesh)
    area_after, face_after = triangle_areas(new)
    whole = np.bincount(face_before, weights=area_before)
    parts = np.bincount(result.face_origin[face_after], weights=area_after)
    edges = edge_set(new.faces)
    steps = [tuple(sorted(step)) for line in [result.path, *new.lines.values()] for step in pairwise(line.tolist())]
    holds = {
        "given vertices stay": np.array_equal(new.vertices[:count], mesh.vertices),
        "weights give the new vertices": np.allclose(new.vertices, blend, rtol=0.0, atol=1e-12),
        "the input gives the vertices": np.array_equal(new.input_vertices[new.input_index], new.vertices),
        "parts fill their faces": np.allclose(parts, whole, rtol=1e-10, atol=1e-12 * whole.max()),
        "it is a manifold": half_edges(new.faces).count.max() <= 2 and len(non_manifold_vertices(new.faces)) == 0,
        # A vertex hanging on an edge would be a slit, and hence border.
        "the border is as long": border_length(new) == pytest.approx(border_length(mesh), rel=1e-12),
        "it is no other surface": euler_characteristic(new.faces) == euler_characteristic(mesh.faces),
        "faces use every vertex": np.array_equal(np.unique(new.faces[new.faces >= 0]), np.arange(len(new.vertices))),
        "lines run along edges": edges.issuperset(steps),
    }
    return [what for what, is_so in holds.items() if not is_so]
