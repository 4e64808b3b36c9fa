"""Small meshes and the checks that any finished surface must pass."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from warpflat.flat.surface.connectivity import components, non_manifold_vertices, orient
from warpflat.flat.surface.half_edges import border_edges, half_edges, mesh_edges
from warpflat.flat.surface.mesh import Surface

Place = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


def plane(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([u, v, np.zeros_like(u)], axis=-1)


def cylinder(u: NDArray[np.float64], v: NDArray[np.float64], radius: float = 0.2) -> NDArray[np.float64]:
    """Half a cylinder about Y, seen from +Z: u runs to the right over pi * radius, v up over 0.5."""
    angle = np.pi * (u - 0.5)
    return np.stack([radius * np.sin(angle), 0.5 * v, radius * np.cos(angle)], axis=-1)


def sphere(u: NDArray[np.float64], v: NDArray[np.float64], radius: float = 0.2) -> NDArray[np.float64]:
    """A patch of 1.2 by 1.2 rad about +Z."""
    a, b = 1.2 * (u - 0.5), 1.2 * (v - 0.5)
    return radius * np.stack([np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b)], axis=-1)


def quads_between(index: NDArray[np.int64] | tuple[int, int], *, turned: bool = False) -> NDArray[np.int32]:
    """Quads between the rows and columns of a table of vertices, counter-clockwise where columns run along +X and rows along +Y.

    Args:
        index: numbers of the vertices, or how many rows and columns there are, numbered row by row.
        turned: clockwise instead.
    """
    i = np.arange(index[0] * index[1]).reshape(index) if isinstance(index, tuple) else index
    corners = [i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]]
    if turned:
        corners = [corners[k] for k in (0, 3, 2, 1)]
    return np.stack(corners, axis=-1).reshape(-1, 4).astype(np.int32)


def grid(columns: int, rows: int, place: Place = plane) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Vertices row by row from below, and quads wound counter-clockwise as seen from +Z."""
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    return place(u.ravel(), v.ravel()), quads_between((rows, columns))


def rings(columns: int, rows: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Vertices around +Y ring by ring from below, with a radius of 1 m and a height of 2 m, and quads."""
    i = np.arange(columns * rows, dtype=np.int32).reshape(rows, columns)
    quads = np.stack([i[:-1], np.roll(i[:-1], -1, 1), np.roll(i[1:], -1, 1), i[1:]], axis=-1).reshape(-1, 4)
    angle = np.tile(2 * np.pi * np.arange(columns) / columns, rows)
    return np.stack([np.sin(angle), np.repeat(np.linspace(0, 2, rows), columns), np.cos(angle)], axis=-1), quads


def scattered(
    count: int, place: Place, seed: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int32]]:
    """Irregular triangles with a straight column of edges at u = 0.5; the last array is that column from below."""
    from scipy.spatial import Delaunay

    b = np.linspace(0, 1, int(np.sqrt(count)))
    inner = np.random.default_rng(seed).random((count, 2))
    inner = inner[(np.abs(inner[:, 0] - 0.5) > 0.6 / len(b)) & (np.abs(inner - 0.5).max(axis=1) < 0.5 - 0.3 / len(b))]
    zero, one, half = np.zeros_like(b), np.ones_like(b), np.full_like(b, 0.5)
    sides = [np.stack(p, axis=1) for p in ((zero, b), (one, b), (half, b))]
    ends = [np.stack(p, axis=1)[1:-1] for p in ((b, zero), (b, one))]
    points = np.unique(np.concatenate([inner, *sides, *ends]).round(12), axis=0)
    triangles = Delaunay(points).simplices
    area = np.linalg.det(points[triangles[:, 1:]] - points[triangles[:, :1]])
    triangles = triangles[np.abs(area) > 1e-9].astype(np.int32)
    column = np.flatnonzero(points[:, 0] == 0.5)
    column = column[np.argsort(points[column, 1])].astype(np.int32)
    return place(points[:, 0], points[:, 1]), triangles, column


def broken_invariants(surface: Surface) -> list[str]:
    """What the rest of the package relies on and a surface does not keep."""
    faces, vertices, he = surface.faces, surface.vertices, half_edges(surface.faces)
    edges = {tuple(edge) for edge in mesh_edges(faces).tolist()}
    steps = [tuple(sorted(step)) for line in surface.lines.values() for step in pairwise(line.tolist())]
    holds = {
        "faces are #F by 4 of 32 bits": faces.dtype == np.int32 and faces.shape[1] == 4,
        "vertices are finite and of 64 bits": vertices.dtype == np.float64 and np.isfinite(vertices).all(),
        "faces use every vertex": np.array_equal(np.unique(faces[faces >= 0]), np.arange(len(vertices))),
        "it is a manifold": half_edges(faces).count.max() <= 2 and len(non_manifold_vertices(faces)) == 0,
        "it is one part": components(faces).max() == 0,
        "it has a border": len(border_edges(faces)) > 0,
        "faces are wound alike": orient(faces)[1] == 0,
        "no two half-edges are one": len(np.unique(np.stack([he.tail, he.head], axis=1), axis=0)) == len(he.tail),
        "vertices are those of the input": np.array_equal(vertices, surface.input_vertices[surface.input_index]),
        "lines run along edges": all(step in edges for step in steps),
    }
    return [what for what, is_so in holds.items() if not is_so]
