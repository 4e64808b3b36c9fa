"""Tubes: surfaces with a border that runs around them, such as sleeves and skirts. None lies flat before it is cut open."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import IntArray
from warpflat.flat.surface.connectivity import border_loops, components
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.triangles import triangulate

__all__ = ["inner_borders", "tube_borders"]


def tube_borders(surface: Surface) -> list[IntArray]:
    """Return the borders around which the surface is a tube, each a row of vertices; the longest of a connected part is none of them.

    A flat ring turns once around at each of its borders, a tube at neither.
    """
    return [loop for loop, turn in inner_borders(surface) if turn > -np.pi]


def inner_borders(surface: Surface) -> list[tuple[IntArray, float]]:
    """Return all borders but the longest of each connected part, each with the angle by which it turns [rad]: -2 pi in a flat ring."""
    loops = border_loops(surface.faces, surface.vertices)
    if len(loops) < 2:
        return []
    part = np.zeros(len(surface.vertices), dtype=np.int32)
    part[surface.faces] = components(surface.faces)[:, None]
    longest: dict[int, int] = {}
    for number, loop in enumerate(loops):
        longest.setdefault(int(part[loop[0]]), number)
    # The sum of the triangles' angles at each vertex [rad].
    triangles, _ = triangulate(surface.faces)
    angle = np.zeros(len(surface.vertices))
    for k in range(3):
        i, j, o = triangles[:, k], triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3]
        u, v = surface.vertices[j] - surface.vertices[i], surface.vertices[o] - surface.vertices[i]
        sine = np.linalg.norm(np.cross(u, v), axis=1)
        angle += np.bincount(i, np.arctan2(sine, np.einsum("ij,ij->i", u, v)), minlength=len(angle))
    return [
        (loop, float((np.pi - angle[loop]).sum()))
        for number, loop in enumerate(loops)
        if number not in longest.values()
    ]
