"""Bands (long, narrow pieces) and the line through their middle, also where they curl.

A waistband or a binding goes around the body, so a plane may cut it crosswise only.
"""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import IntArray
from warpflat.core.vectors import unit
from warpflat.flat.surface.connectivity import border_loops
from warpflat.flat.surface.half_edges import half_edges_of
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.normals import flat_areas
from warpflat.flat.surface.paths.edge_paths import EdgeGraph, path_length
from warpflat.flat.surface.paths.geodesic import distance_from
from warpflat.flat.surface.triangles import corner_triangles

__all__ = ["NARROW_BAND", "line_along_band"]


# A line is short against its piece below this share of the way between the places of the border that are furthest apart.
_SHORT = 0.5
#: That way is at least this many widths long in a band. A front with a deep neckline, whose centre line is as short, is no band.
NARROW_BAND = 6.0
# And its area is at least this share of that way times its greatest width: a body with two long straps is no band.
_EVEN = 0.5
# Where the border turns by more than this, an end of the band has a corner (cosine).
_CORNER = np.cos(np.radians(36.0))
# The cost of a step is its length over the sum of its distance to the border and this share of the width.
_ROOM = 0.1


def line_along_band(surface: Surface, line: IntArray) -> IntArray | None:
    """Return the line through the middle of a band, along edges, from the border at one end to the border at the other.

    Args:
        surface: one piece.
        line: vertex indices along edges; only a line that is short against the piece is replaced.

    Returns:
        Vertex indices, in either direction; None where the given line is long enough, or the piece is no band: too wide, or a
        ring, which has no ends.
    """
    from scipy.sparse.csgraph import dijkstra

    # No place is further from another than half of the border is long.
    length, graph = path_length(surface, [line]), EdgeGraph(surface)
    on_border = half_edges_of(surface).count == 1
    triangles, _, share = corner_triangles(surface.faces)
    area = float(share @ flat_areas(surface.vertices, triangles))
    around = float(graph.length[on_border].sum())
    # Nor, then, is it many widths long, the area being that way times the mean width.
    if 4 * length >= around or around**2 < 4 * NARROW_BAND * area:
        return None
    loops = border_loops(surface.faces, surface.vertices)
    one = _furthest(surface, loops[0], int(line[0]))[0]
    other, reach = _furthest(surface, loops[0], one)
    room = distance_from(surface, np.unique(graph.edges[on_border]))
    greatest, mean = 2 * float(room.max()), area / reach
    # Of a strip one face wide, all vertices are on the border.
    width = max(greatest, mean)
    ring = len(loops) > 1 and path_length(surface, [np.append(loops[1], loops[1][0])]) > reach
    if length >= _SHORT * reach or reach < NARROW_BAND * width or mean < _EVEN * greatest or ring:
        return None
    weight = graph.length / (room[graph.edges].mean(axis=1) + _ROOM * width)
    # The border vertices of either end: those from its tip to corners at most two widths away.
    ends = []
    for tip in (one, other):
        ends.append([tip])
        at = int(np.flatnonzero(loops[0] == tip)[0])
        for loop in (np.roll(loops[0], -at), np.roll(loops[0][::-1], at + 1)):
            step = np.diff(surface.vertices[np.append(loop, loop[0])], axis=0)
            size, ahead = np.linalg.norm(step, axis=1), unit(step)
            corner = np.einsum("ij,ij->i", ahead[:-1], ahead[1:]) < _CORNER
            near = np.flatnonzero(corner & (np.cumsum(size)[:-1] <= 2 * width))
            if len(near):
                ends[-1] += loop[1 : near[0] + 2].tolist()
    cost, before, _ = dijkstra(graph.matrix(weight), indices=ends[0], return_predecessors=True, min_only=True)
    path = [int(ends[1][cost[ends[1]].argmin()])]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return np.array(path, dtype=np.int32)


def _furthest(surface: Surface, border: IntArray, place: int) -> tuple[int, float]:
    """Return the vertex of the border furthest from a vertex, and its distance [m]."""
    away = distance_from(surface, [place])[border]
    return int(border[away.argmax()]), float(away.max())
