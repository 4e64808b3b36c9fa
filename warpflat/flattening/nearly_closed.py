"""Pieces that are nearly closed, such as a sphere with a small hole: what their border cannot hold flat, and the cut that would help."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from warpflat.surface.connectivity import border_of
from warpflat.surface.half_edges import half_edges_of
from warpflat.surface.mesh import Surface
from warpflat.surface.triangles import triangulate

__all__ = ["nearly_closed_notes"]

# In the plane the square of a border is at least 4 pi times its area; half of that is a hemisphere's.
_LEAST_SHARE = 0.5


def nearly_closed_notes(surface: Surface) -> list[str]:
    """Return a note on a piece whose border is too short for its area, naming the cut that would make a pattern of it.

    The cut runs along edges from the border to the vertex farthest from it. Without it the piece is flattened all the same, but
    the cloth would have to stretch by a multiple.
    """
    he = half_edges_of(surface)
    length = np.linalg.norm(surface.vertices[he.edges[:, 1]] - surface.vertices[he.edges[:, 0]], axis=1)
    border = float(length[he.count == 1].sum())
    a, b, c = surface.vertices[triangulate(surface.faces)[0]].transpose(1, 0, 2)
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    if border == 0.0 or border**2 >= _LEAST_SHARE * 4.0 * np.pi * area:
        return []
    count = len(surface.vertices)
    graph = csr_array((length, he.edges.T), shape=(count, count))
    away, _, source = dijkstra(
        graph, directed=False, indices=border_of(surface), min_only=True, return_predecessors=True
    )
    away = np.where(np.isfinite(away), away, -1.0)
    tip = int(away.argmax())
    first, last = (int(surface.input_index[vertex]) for vertex in (source[tip], tip))
    return [
        f"the piece is nearly closed: its border of {100 * border:.1f} cm is too short to lie flat around {1e4 * area:.0f} cm2; a cut "
        f"of {100 * away[tip]:.1f} cm from vertex {first} to vertex {last} would make a pattern of it"
    ]
