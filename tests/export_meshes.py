"""Small surfaces for the exporters' tests, with a pattern, an energy and a cut each of which can be told apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from surface_meshes import quads_between

from warpflat.flat.surface.mesh import Surface


def grid(n: int, m: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """m by n vertex indices, and #F by 4 quads."""
    index = np.arange(n * m, dtype=np.int32).reshape(m, n)
    quads = quads_between(index)
    return index, np.ascontiguousarray(quads)


def surface(vertices: NDArray[np.float64], faces: NDArray[np.int32], name: str = "piece", **lines: object) -> Surface:
    named = {key.replace("_", " "): np.asarray(line, dtype=np.int32) for key, line in lines.items()}
    return Surface(
        vertices=vertices,
        faces=faces,
        lines=named,
        name=name,
    )


def dome(n: int = 9, name: str = "dome") -> Surface:
    """A square patch of a sphere, 0.5 m wide, that faces +Z."""
    x, y = np.meshgrid(np.linspace(-0.25, 0.25, n), np.linspace(-0.25, 0.25, n))
    vertices = np.stack([x, y, np.sqrt(0.45**2 - x**2 - y**2)], axis=-1).reshape(-1, 3)
    index, quads = grid(n, n)
    return surface(vertices, quads, name, centre_front=index[:, n // 2], bust_line=index[n // 2])


def mixed() -> Surface:
    """A quad beside two triangles."""
    vertices = np.array([[0, 0, 0], [1, 0, 0.1], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0.2]], dtype=np.float64) / 3.0
    faces = np.array([[0, 1, 2, 3], [1, 4, 5, -1], [1, 5, 2, -1]], dtype=np.int32)
    return surface(vertices, faces, "mixed")


def cut_up_the_middle(
    whole: Surface, n: int, rows: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], list[list[int]]]:
    """Double the first `rows` vertices of the middle column of an n by n grid.

    Returns the faces in the new numbering, for each pattern vertex its surface vertex, and both sides of the crack.
    """
    faces, middle, count = whole.faces.copy(), n // 2, len(whole.vertices)
    right_of_it = np.arange(len(faces)) % (n - 1) >= middle
    left, right = [], []
    for row in range(rows):
        vertex = row * n + middle
        faces[right_of_it] = np.where(faces[right_of_it] == vertex, count + row, faces[right_of_it])
        left.append(vertex)
        right.append(count + row)
    tip = rows * n + middle
    to_surface = np.concatenate([np.arange(count), left]).astype(np.int32)
    return faces, to_surface, [[*left, tip], [*right, tip]]
