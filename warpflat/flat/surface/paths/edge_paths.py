"""Shortest paths along mesh edges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.flat.surface.half_edges import half_edges_of, mesh_edges
from warpflat.flat.surface.mesh import Surface, once_per_surface

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

__all__ = ["EdgeGraph", "are_joined", "as_vertex", "path_length"]

# A point given by coordinates must lie this close to the piece: as a share of its diagonal, or in edge lengths.
_NEAR_SHARE = 0.1
_NEAR_EDGES = 2.0


def are_joined(edges: IntArray, a: ArrayLike, b: ArrayLike) -> BoolArray:
    """Return #N, true where a-b (#N each) is among the edges of a mesh, which are sorted (see `mesh_edges`)."""
    low, high = np.minimum(a, b), np.maximum(a, b)
    first, last = (np.searchsorted(edges[:, 0], low, side=side) for side in ("left", "right"))
    joined = np.zeros(np.shape(low), dtype=bool)
    for k in range(int((last - first).max(initial=0))):
        joined |= (first + k < last) & (edges[np.minimum(first + k, len(edges) - 1), 1] == high)
    return joined


class EdgeGraph:
    """The edges of a surface, ready for searches.

    Attributes:
        edges: #E by 2.
        length: #E [m].
        size: #V.
    """

    def __init__(self, surface: Surface) -> None:
        self.edges = half_edges_of(surface).edges
        self.size = len(surface.vertices)
        self.length = _edge_lengths(surface)

    def are_joined(self, a: ArrayLike, b: ArrayLike) -> BoolArray:
        """Return #N, true where an edge a-b (#N each) exists."""
        return are_joined(self.edges, a, b)

    def matrix(self, weight: FloatArray) -> csr_matrix:
        """Return #V by #V, the weight of each edge."""
        from scipy.sparse import coo_matrix

        a, b = self.edges.T
        both = (np.concatenate([a, b]), np.concatenate([b, a]))
        # A weight of zero would be read as "no edge".
        safe = np.maximum(np.concatenate([weight, weight]), np.finfo(float).tiny)
        return coo_matrix((safe, both), shape=(self.size, self.size)).tocsr()

    def path(self, start: int, end: int, weight: FloatArray | None = None) -> IntArray:
        """Return the path of least weight (by default: of least length) from `start` to `end`."""
        return path_in(self.matrix(self.length if weight is None else weight), start, end)


@once_per_surface
def _edge_lengths(surface: Surface) -> FloatArray:
    """Return #E, the lengths of edges [m]."""
    a, b = half_edges_of(surface).edges.T
    length = np.asarray(np.linalg.norm(surface.vertices[b] - surface.vertices[a], axis=1))
    length.flags.writeable = False
    return length


def path_in(matrix: csr_matrix, start: int, end: int) -> IntArray:
    """Return the path of least weight in a matrix of weights, or an empty array if there is none."""
    from scipy.sparse.csgraph import dijkstra

    _, before = dijkstra(matrix, indices=start, return_predecessors=True)
    path = [end]
    while path[-1] != start:
        step = int(before[path[-1]])
        if step < 0:
            return np.empty(0, dtype=np.int32)
        path.append(step)
    return np.array(path[::-1], dtype=np.int32)


def as_vertex(surface: Surface, place: int | ArrayLike, *, as_read: bool = False, among: IntArray | None = None) -> int:
    """Return the vertex that a user names by an index or by a point.

    Args:
        surface: where.
        place: a vertex index, or three coordinates [m], which stand for the nearest vertex.
        as_read: the index counts the vertices of the file (from 0) instead of the surface's.
        among: only these vertices may be meant by a point; an index is taken as it is.

    Raises:
        InputError: if the index does not exist or the point is off the piece.
    """
    if np.ndim(place) == 0:
        if isinstance(place, (bool, np.bool_)) or not isinstance(place, (int, np.integer)):
            raise InputError(f"a place is a vertex index or a point of three numbers [m], got {place!r}")
        index = int(place)
        total = len(surface.input_vertices) if as_read else len(surface.vertices)
        if not 0 <= index < total:
            raise InputError(f"vertex {index} does not exist in {surface.name!r}: valid are 0 to {total - 1}")
        if not as_read:
            return index
        at = np.flatnonzero(surface.input_index == index)
        if len(at) == 0:
            # It was welded or merged away: the vertex now at its place stands for it.
            point = surface.input_vertices[index]
            distance = np.linalg.norm(surface.vertices - point, axis=1)
            if distance.min() > 1e-4 * np.linalg.norm(np.ptp(surface.vertices, axis=0)):
                raise InputError(f"vertex {index} of the input is not part of the piece {surface.name!r}")
            return int(np.argmin(distance))
        return int(at[0])
    point = np.asarray(place, dtype=np.float64)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise InputError(f"a place is a vertex index or a point of three numbers [m], got {place!r}")
    choice = np.arange(len(surface.vertices)) if among is None else among
    distance = np.linalg.norm(surface.vertices[choice] - point, axis=1)
    vertex = int(choice[np.argmin(distance)])
    diagonal = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    ring = mesh_edges(surface.faces[(surface.faces == vertex).any(axis=1)])
    edge = np.linalg.norm(surface.vertices[ring[:, 0]] - surface.vertices[ring[:, 1]], axis=1).max()
    if distance.min() > max(_NEAR_SHARE * diagonal, _NEAR_EDGES * edge):
        x, y, z = surface.vertices[vertex].tolist()
        raise InputError(
            f"the point ({point[0]:g}, {point[1]:g}, {point[2]:g}) is {distance.min():.3g} m off the piece "
            f"{surface.name!r}; its nearest vertex is {int(surface.input_index[vertex]) if as_read else vertex} at "
            f"({x:.4g}, {y:.4g}, {z:.4g})"
        )
    return vertex


def path_length(surface: Surface, paths: Sequence[ArrayLike]) -> float:
    """Return the length of paths along edges (each a row of vertices), summed [m]."""
    return float(sum(polyline_length(surface.vertices[np.asarray(path)]) for path in paths))
