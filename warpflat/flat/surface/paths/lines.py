"""Feature lines: paths along mesh edges, found from vertices, end points, planes or curves.

Every function returns vertex indices of the surface, int32, along mesh edges; a closed line repeats its first vertex.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.file_names import check_label
from warpflat.core.polyline import arc_lengths, polyline_length, segment_lengths
from warpflat.core.text import quote_value
from warpflat.flat.surface.half_edges import half_edges_of
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.edge_paths import EdgeGraph, are_joined, as_vertex, path_in

__all__ = ["line_between", "line_from_curve", "line_from_indices", "line_on_plane", "with_lines"]

# The cost per length of a path that leaves the plane or curve it should follow grows by this factor times the squared distance in
# edge lengths.
_FOLLOW = 2.0
# A weight too small to lengthen a path: it only chooses among paths of one length, as on a grid.
_TIE = 1e-4
# Points of a curve this close to a vertex, in edge lengths, are on it.
_ON_VERTEX = 0.2
# A curve further than this from the piece, in edge lengths, is not on it.
_OFF_PIECE = 2.0


def line_from_indices(surface: Surface, indices: ArrayLike, *, as_read: bool = False) -> IntArray:
    """Check a line given vertex by vertex, and return it.

    Args:
        surface: the surface.
        indices: vertex indices in order.
        as_read: indices count the vertices of the file (from 0) instead of the surface's.

    Raises:
        InputError: if a vertex does not exist, or where two in a row are not joined by an edge.
    """
    given = np.asarray(indices)
    if given.ndim != 1 or len(given) < 2 or not np.issubdtype(given.dtype, np.integer):
        raise InputError(f"a line is a list of at least two vertex indices, got {indices!r}")
    if as_read or given.min() < 0 or given.max() >= len(surface.vertices):
        line = np.array([as_vertex(surface, int(i), as_read=as_read) for i in given], dtype=np.int32)
    else:
        line = given.astype(np.int32)
    same = np.concatenate([[False], line[1:] == line[:-1]])
    line, given = line[~same], given[~same]
    if len(line) < 2:
        raise InputError("a line needs at least two different vertices")
    broken = np.flatnonzero(~are_joined(half_edges_of(surface).edges, line[:-1], line[1:]))
    if len(broken):
        a, b = given[broken[0]], given[broken[0] + 1]
        raise InputError(
            f"the line breaks between vertices {a} and {b} of {surface.name!r} (counted from 0): no edge joins them; "
            "list every vertex along the edges, or give its two ends as a shortest path"
        )
    return line


def line_between(surface: Surface, start: int | ArrayLike, end: int | ArrayLike, *, as_read: bool = False) -> IntArray:
    """Return the shortest path along edges between two places; of several of one length, the one closest to the straight line.

    Args:
        surface: the surface.
        start, end: a vertex index, or a point [m] that stands for the nearest vertex.
        as_read: indices count the vertices of the file (from 0) instead of the surface's.
    """
    a, b = (as_vertex(surface, place, as_read=as_read) for place in (start, end))
    if a == b:
        named = int(surface.input_index[a]) if as_read else a
        raise InputError(f"both ends of the line are vertex {named} of {surface.name!r}: it has no length")
    graph = EdgeGraph(surface)
    p = surface.vertices
    chord = p[b] - p[a]
    reach = max(float(np.linalg.norm(chord)), float(np.finfo(float).tiny))
    off = np.linalg.norm(np.cross(p - p[a], chord / reach), axis=1) / reach
    return graph.path(a, b, graph.length * (1 + _TIE * off[graph.edges].mean(axis=1)))


def line_on_plane(surface: Surface, point: ArrayLike, normal: ArrayLike) -> IntArray:
    """Return the chain of edges that follows the section with a plane most closely.

    Of several sections the longest counts. One that runs from border to border gives an open line, one that runs around
    the surface a closed line. Its direction is that in which the plane's normal lies to the right, seen from outside.

    Args:
        surface: the surface.
        point: a point of the plane [m].
        normal: the plane's normal, any length.

    Raises:
        InputError: if the plane misses the piece.
    """
    from scipy.sparse import coo_matrix

    base, direction = np.asarray(point, dtype=np.float64), np.asarray(normal, dtype=np.float64)
    if base.shape != (3,) or direction.shape != (3,) or not np.isfinite([base, direction]).all():
        raise InputError(f"a plane is a point and a normal of three numbers each, got {point!r} and {normal!r}")
    size = float(np.linalg.norm(direction))
    if size == 0:
        raise InputError("the plane's normal has no length")
    height = (surface.vertices - base) @ (direction / size)
    height[np.abs(height) < 1e-9 * np.linalg.norm(np.ptp(surface.vertices, axis=0))] = 0.0
    above = height >= 0
    if above.all():
        above = height > 0
    if above.all() or not above.any():
        reach = (surface.vertices @ (direction / size)).tolist()
        raise InputError(
            f"the plane does not cut the piece {surface.name!r}: along its normal the piece spans {min(reach):.4g} to "
            f"{max(reach):.4g} m and the plane lies at {float(base @ direction) / size:.4g} m"
        )
    # The edges that the longest section crosses, in order; the arc length at each [m]; and whether it is closed.
    he = half_edges_of(surface)
    up = above[he.tail] & ~above[he.head]
    down = ~above[he.tail] & above[he.head]
    a, b = surface.vertices[he.edges[:, 0]], surface.vertices[he.edges[:, 1]]
    ha, hb = height[he.edges[:, 0]], height[he.edges[:, 1]]
    share = ha / np.where(ha == hb, 1.0, ha - hb)
    place = a + np.clip(share, 0, 1)[:, None] * (b - a)
    # Going around a face, the section enters where the side drops below the plane and leaves where it rises next:
    # the side above lies to the left.
    follow: dict[int, int] = {}
    entries = np.flatnonzero(up)
    for h in entries.tolist():
        at = int(he.next[h])
        while not down[at]:
            at = int(he.next[at])
        follow[int(he.edge[h])] = int(he.edge[at])
    starts = set(follow) - set(follow.values())
    best: tuple[float, list[int], bool] = (-1.0, [], False)
    for seed in [*sorted(starts), *sorted(follow)]:
        if seed not in follow:
            continue
        chain = [seed]
        while chain[-1] in follow:
            chain.append(follow.pop(chain[-1]))
        closed = chain[0] == chain[-1] and seed not in starts
        length = polyline_length(place[chain])
        if length > best[0]:
            best = (length, chain, closed)
    _, chain, closed = best
    crossing, station = np.array(chain, dtype=np.int64), arc_lengths(place[chain])
    graph = EdgeGraph(surface)
    band = np.zeros(graph.size, dtype=bool)
    band[graph.edges[crossing]] = True
    inside = band[graph.edges[:, 0]] & band[graph.edges[:, 1]]
    mean = float(graph.length[inside].mean())
    off = np.abs(height)[graph.edges].mean(axis=1) / mean
    weight = graph.length * (1 + _FOLLOW * off**2)
    if closed:
        # A closed path goes around once with the section, on two copies of the graph.
        turn = np.zeros(graph.size)
        turn[graph.edges[crossing]] = (station / max(station[-1], np.finfo(float).tiny))[:, None]
        turn[graph.edges[crossing[0]]] = 0.0
        rows = np.flatnonzero(inside)
        a, b = np.concatenate([graph.edges[rows], graph.edges[rows][:, ::-1]]).T.astype(np.int64)
        cost = np.maximum(np.tile(weight[rows], 2), np.finfo(float).tiny)
        step = turn[b] - turn[a]
        forward, backward = step < -0.5, step > 0.5
        same = ~forward & ~backward
        first = np.concatenate([a[same], a[same] + graph.size, a[forward], a[backward] + graph.size])
        second = np.concatenate([b[same], b[same] + graph.size, b[forward] + graph.size, b[backward]])
        costs = np.concatenate([cost[same], cost[same], cost[forward], cost[backward]])
        matrix = coo_matrix((costs, (first, second)), shape=(2 * graph.size, 2 * graph.size)).tocsr()
        band = np.unique(graph.edges[rows])
        start = int(band[np.argmin(np.abs(height[band]))])
        path = path_in(matrix, start, start + graph.size)
        line = (path % graph.size).astype(np.int32)
    else:
        ends = [edge[np.argmin(np.abs(height[edge]))] for edge in graph.edges[crossing[[0, -1]]]]
        if ends[0] == ends[1]:
            raise InputError(f"the plane only touches the piece {surface.name!r} at vertex {ends[0]}: move it inwards")
        weight = np.where(inside, weight, weight * 1e6)
        line = graph.path(int(ends[0]), int(ends[1]), weight)
    return line[::-1].copy()


def line_from_curve(surface: Surface, points: ArrayLike, *, name: str = "line") -> IntArray:
    """Return the path along edges that follows a drawn curve most closely.

    Points that lie on vertices are kept; between them the path is drawn to the curve.

    Args:
        surface: the surface.
        points: #P by 3, a polyline [m] near the surface; closed if it repeats its first point.
        name: what messages call it.

    Raises:
        InputError: if the curve is not near the piece.
    """
    from scipy.spatial import cKDTree

    curve = np.asarray(points, dtype=np.float64)
    if curve.ndim != 2 or curve.shape[1] != 3 or len(curve) < 2 or not np.isfinite(curve).all():
        raise InputError(f"curve {quote_value(name)} must be at least two points of three finite numbers [m]")
    graph = EdgeGraph(surface)
    edge = float(graph.length.mean())
    tree = cKDTree(surface.vertices)
    distance, vertex = tree.query(curve)
    if distance.max() > _OFF_PIECE * max(edge, float(graph.length.max())):
        far = int(np.argmax(distance))
        raise InputError(
            f"curve {quote_value(name)} does not lie on the piece {surface.name!r}: its point {far} is {distance[far]:.3g} m off"
        )
    on = distance <= _ON_VERTEX * edge
    on[[0, -1]] = True
    anchors = np.flatnonzero(on)
    line = [int(vertex[anchors[0]])]
    for i, j in zip(anchors[:-1].tolist(), anchors[1:].tolist(), strict=True):
        start, end = line[-1], int(vertex[j])
        if start == end and j - i == 1:
            continue
        if j - i == 1 and graph.are_joined(start, end):
            line.append(end)
            continue
        line += _path_along(surface, graph, curve[i : j + 1], start, end, edge)
    # Steps that are taken straight back fall away.
    out: list[int] = []
    for vertex in line:
        if len(out) > 1 and out[-2] == vertex:
            out.pop()
        elif not out or out[-1] != vertex:
            out.append(vertex)
    line = out
    if len(line) < 2:
        raise InputError(f"curve {quote_value(name)} is shorter than the edges of {surface.name!r} around it")
    return np.array(line, dtype=np.int32)


def _path_along(surface: Surface, graph: EdgeGraph, curve: FloatArray, start: int, end: int, edge: float) -> list[int]:
    """Return the vertices after `start` on the path to `end` that follows a stretch of a curve."""
    from scipy.spatial import cKDTree

    if start == end:
        middle = len(curve) // 2
        _, via = cKDTree(surface.vertices).query(curve[middle])
        if int(via) == start:
            return []
        out = _path_along(surface, graph, curve[: middle + 1], start, int(via), edge)
        return out + _path_along(surface, graph, curve[middle:], int(via), end, edge)
    steps = np.maximum(np.ceil(segment_lengths(curve) / (0.25 * edge)).astype(int), 1)
    fine = [np.linspace(p, q, n, endpoint=False) for p, q, n in zip(curve[:-1], curve[1:], steps, strict=True)]
    off, _ = cKDTree(np.concatenate([*fine, curve[-1:]])).query(surface.vertices[graph.edges].mean(axis=1))
    weight = graph.length * (1 + _FOLLOW * (off / edge) ** 2)
    return graph.path(start, end, weight).tolist()[1:]


def with_lines(surface: Surface, lines: Mapping[str, ArrayLike]) -> Surface:
    """Return the surface with further feature lines; a line of the same name is replaced.

    Raises:
        InputError: if a line does not run along edges, or its name cannot be written.
    """
    checked = dict(surface.lines)
    for name, line in lines.items():
        check_label(name, "lines")
        try:
            checked[name] = line_from_indices(surface, line)
        except InputError as error:
            raise InputError(f"line {quote_value(name)}: {error}") from error
    return replace(surface, lines=checked)
