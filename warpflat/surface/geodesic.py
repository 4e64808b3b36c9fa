"""Distance from a line on the surface, and where on the line the nearest point lies.

The distance d at a vertex v is the least d(p) + |v - p| over the points p of the sides opposite to it, with d linear
along each side (the Hopf-Lax form of the eikonal equation; Bornemann and Rasch 2006). It is exact where the front is
straight, on whatever triangles, hence for a straight line on a surface that can be developed; the heat method is off
by a quarter of an edge and more there. Fast marching (geometry-central's) solves it up to obtuse triangles; from there
policy iteration takes a few steps: with every vertex's p held, the equations are linear; with d known, every p is a
formula.

The station of the nearest point is constant along the way to it: the same linear system carries it. Beyond the ends of
the line, where the nearest point is one end for all, the direction in which the way leaves that end is carried instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.errors import InputError
from warpflat.surface.lines import line_from_curve
from warpflat.surface.mesh import Surface
from warpflat.surface.paths import chain_positions
from warpflat.surface.topology import (
    border_edges,
    components,
    half_edges,
    stable_order,
    triangulate,
    unfold_quad_diagonals,
)
from warpflat.surface.vectors import cross, dot, norm, points_at

__all__ = ["distance_from", "extend_to_border", "signed_distance_and_station"]


def distance_from(surface: Surface, line: ArrayLike) -> NDArray[np.float64]:
    """#V, the distance [m] along the surface from a line.

    Args:
        surface: where.
        line: vertex indices along edges (or a single vertex).
    """
    path = np.asarray(line, dtype=np.int64).ravel()
    if len(path) == 0 or path.min() < 0 or path.max() >= len(surface.vertices):
        raise InputError(f"a line on {surface.name!r} needs vertices from 0 to {len(surface.vertices) - 1}")
    return _Ways(surface, path).distance


def _short_triangles(surface: Surface) -> NDArray[np.int32]:
    """#T by 3, quads split along their shorter diagonal."""
    lengths, quads = unfold_quad_diagonals(surface.vertices, surface.faces)
    other = np.zeros(len(surface.faces), dtype=bool)
    other[quads] = lengths[:, 1] < lengths[:, 0] * (1 - 1e-9)
    return triangulate(surface.faces, other_diagonal=other)[0]


def signed_distance_and_station(
    surface: Surface, line: ArrayLike, *, extend: bool = True
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Coordinates of a first layout: how far each vertex lies from a line, and beside which place of it.

    Where the nearest point of the line is one of its ends and the way to it is not at right angles to the line,
    distance and direction are taken as polar coordinates about that end, so that places beyond an end do not all get
    its station.

    Args:
        surface: where.
        line: vertex indices along edges, not closed.
        extend: carry an end inside of the piece on to the border, straight ahead.

    Returns:
        #V, the signed distance x [m], positive to the right of the line, seen from outside (the side from which faces
        are wound counter-clockwise) with the line running up; #V, the station y [m], the arc length along the line at
        the nearest point of it, 0 at its start, negative before it.

    Raises:
        InputError: if the line is closed.
    """
    path = np.asarray(line, dtype=np.int32)
    if len(path) < 2 or len(np.unique(path)) < len(path):
        raise InputError(f"a datum line on {surface.name!r} must be open and have at least two vertices, each once")
    before = 0
    if extend:
        path, before = extend_to_border(surface, path)
    station = chain_positions(surface.vertices[path])
    station -= station[before]
    ways = _Ways(surface, path.astype(np.int64))
    along = ways.carry(path.astype(np.int64), station)
    known, side, about_ends = _directions_at_line(surface, path)
    columns = ways.carry(known, np.column_stack([side, *about_ends])).T
    x, y = ways.distance * np.sign(columns[0]), along
    for (right, up), end, outwards in ((columns[1:3], station[0], -1.0), (columns[3:], station[-1], 1.0)):
        beyond = outwards * up > 0
        scale = ways.distance / np.where(beyond, np.hypot(right, up), 1.0)
        x, y = np.where(beyond, scale * right, x), np.where(beyond, end + scale * up, y)
    sides = _sides(surface, path)
    return (x if sides is None else sides * np.abs(x)), y


def extend_to_border(surface: Surface, line: NDArray[np.int32]) -> tuple[NDArray[np.int32], int]:
    """The line carried on straight ahead, along edges, from each end that is inside to the border.

    Returns:
        The longer line, and the position of the old line's first vertex in it. An end from which no way leads to the
        border clear of the line stays where it is.
    """
    border = set(np.unique(border_edges(surface.faces)).tolist())
    path = list(map(int, line))
    if path[-1] not in border:
        path += _ahead(surface, path)
    count = len(path)
    if path[0] not in border:
        path = (path[::-1] + _ahead(surface, path[::-1]))[::-1]
    return np.array(path, dtype=np.int32), len(path) - count


def _ahead(surface: Surface, path: list[int]) -> list[int]:
    """The vertices from the end of a path straight on to the border, or none."""
    import potpourri3d

    points = surface.vertices[path]
    length = chain_positions(points)
    # A path along edges wanders: its direction is that of its last fifth.
    back = int(np.searchsorted(length, 0.8 * length[-1]))
    direction = points[-1] - points[min(back, len(path) - 2)]
    size = float(np.linalg.norm(direction))
    reach = 2 * float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    if size == 0:
        return []
    tracer = potpourri3d.GeodesicTracer(surface.vertices, _short_triangles(surface))
    trace = np.asarray(tracer.trace_geodesic_from_vertex(path[-1], direction / size * reach))
    if len(trace) < 2 or not np.isfinite(trace).all():
        return []
    try:
        new = line_from_curve(surface, trace, name="extension").tolist()
    except InputError:
        return []
    border = set(np.unique(border_edges(surface.faces)).tolist())
    stop = next((i for i, vertex in enumerate(new) if vertex in border), -1)
    new = new[: stop + 1]
    return new[1:] if stop > 0 and not set(new[1:]) & set(path) else []


# Policy iteration at least doubles the correct digits each time; more steps than this are never taken.
_MOST_STEPS = 30


class _Ways:
    """The shortest ways to a line: each vertex's distance, and the place on an opposite side where its way passes.

    Attributes:
        distance: #V [m].
        first, second, share: #V, the way from a vertex passes between `first` and `second`, this share of the way
            from the first to the second. Vertices of the line have themselves.
    """

    def __init__(self, surface: Surface, line: NDArray[np.int64]) -> None:
        import potpourri3d

        self.size = len(surface.vertices)
        self.on_line = np.zeros(self.size, dtype=bool)
        self.on_line[line] = True
        triangles = _short_triangles(surface)
        solver = potpourri3d.MeshFastMarchingDistanceSolver(surface.vertices, triangles)
        chain: list[tuple[int, list[float]]] = [(int(vertex), []) for vertex in line]
        distance = np.maximum(np.array(solver.compute_distance([chain]), dtype=np.float64), 0.0)
        distance[line] = 0.0
        self._see_corners(surface.vertices, triangles)
        for _ in range(_MOST_STEPS):
            cost, change = self._choose_ways(distance)
            if change <= 1e-12 * float(distance.max()):
                break
            distance = self._solve(cost)
        self.distance = distance

    def _see_corners(self, vertices: NDArray[np.float64], triangles: NDArray[np.int32]) -> None:
        """Each vertex with each side opposite to it, triangle by triangle: how long that is, and where it lies."""
        at, ahead, behind = (np.roll(triangles, -k, axis=1).T.ravel() for k in range(3))
        order = stable_order(at)
        order = order[~self.on_line[at[order]]]
        self._corner = at[order], ahead[order], behind[order]
        self._first_row = np.flatnonzero(np.diff(self._corner[0], prepend=-1))
        away, before, side = (points_at(vertices, index) for index in self._corner)
        side -= before
        away -= before
        del before, at, ahead, behind, order  # large
        self._side = norm(side)
        self._safe_side = np.where(self._side > 0, self._side, 1.0)
        self._foot = dot(away, side) / self._safe_side
        self._height = norm(cross(away, side)) / self._safe_side

    def _choose_ways(self, distance: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """Set each vertex's way to the best one given the distances.

        Returns:
            #V, the length [m] of each way's first leg; and by how much at most the distances change [m] if those of all other
            vertices are right.
        """
        vertex, a, b = self._corner
        da, db = distance[a], distance[b]
        slope = np.clip((db - da) / self._safe_side, -1 + 1e-15, 1 - 1e-15)
        at = np.clip(self._foot - slope * self._height / np.sqrt(1 - slope**2), 0, self._side)
        share = at / self._safe_side
        leg = np.sqrt((at - self._foot) ** 2 + self._height**2)
        before = da + share * (db - da)
        # A way leads downhill. Where rounding leaves none that does, the lowest will do; on needles two vertices would
        # else lead to each other.
        value = np.where(before < distance[vertex], before + leg, 1e6 * (1.0 + before))
        least = np.minimum.reduceat(value, self._first_row)
        row = np.flatnonzero(value == np.repeat(least, np.diff(self._first_row, append=len(value))))
        row = row[np.diff(vertex[row], prepend=-1) > 0]
        chosen = vertex[row]
        self.first, self.second, self.share = np.arange(self.size), np.arange(self.size), np.zeros(self.size)
        self.first[chosen], self.second[chosen], self.share[chosen] = a[row], b[row], share[row]
        cost = np.zeros(self.size)
        cost[chosen] = leg[row]
        # Nearly triangular in this order, so the factors stay as sparse as the matrix.
        self._order = np.argsort(distance, kind="stable")
        change = float(np.abs(value[row] - distance[chosen]).max(initial=0.0))
        return cost, change

    def _solve(self, right: NDArray[np.float64], also_fixed: NDArray[np.int64] | None = None) -> NDArray[np.float64]:
        """x with x(v) = right(v) + the x where the way of v passes; x = right on the line."""
        from scipy.sparse import csc_matrix
        from scipy.sparse.linalg import splu

        fixed = self.on_line.copy()
        if also_fixed is not None:
            fixed[also_fixed] = True
        rank = np.empty(self.size, dtype=np.int32)
        rank[self._order] = np.arange(self.size, dtype=np.int32)
        # Row by row in the order of distance: 1 for the vertex itself, less its shares of two others if it has a way.
        free = ~fixed[self._order]
        offset = np.concatenate([[0], np.cumsum(np.where(free, 3, 1))]).astype(np.int32)
        at, way = offset[:-1][free], self._order[free]
        entries, columns = np.ones(offset[-1]), np.empty(offset[-1], dtype=np.int32)
        columns[offset[:-1]] = np.arange(self.size)
        columns[at + 1], columns[at + 2] = rank[self.first[way]], rank[self.second[way]]
        entries[at + 1], entries[at + 2] = self.share[way] - 1.0, -self.share[way]
        transposed = csc_matrix((entries, columns, offset), shape=(self.size, self.size))
        # Rows so alike that SuperLU's blocks only cost.
        factors = splu(transposed, permc_spec="NATURAL", panel_size=1, relax=1)
        solution = factors.solve(right[self._order], trans="T")
        return np.asarray(solution[rank])

    def carry(self, known: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """#V (by #K), the values (#N, or #N by #K) of `known` vertices, the line's among them, carried to all others."""
        right = np.zeros((self.size, *values.shape[1:]))
        right[known] = values
        return self._solve(right, also_fixed=known)


def _directions_at_line(
    surface: Surface, path: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.float64], tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """The vertices of the line and those joined to it, and where they lie.

    Returns:
        #N, the vertices; #N, more or less than 0 to the right or left of the line; and for either end of it, #N by 2, right
        and up [m] of it, by the angles of the triangles around it as in the plane. A straight way that passes between two
        of them has the mean of their places. Vertices not joined to that end lie beside their own place of a straight line.
    """
    rings = _rings(surface.vertices, _short_triangles(surface), path)
    beside: dict[int, float] = {}
    place_on_line: dict[int, int] = {}
    around: tuple[dict[int, complex], dict[int, complex]] = ({}, {})
    on_line = set(path.tolist())
    last = len(path) - 1
    for i, centre in enumerate(path.tolist()):
        # Counter-clockwise from the point before lies the right, from the point after the left.
        starts = [(int(path[i - 1]), 1.0)] if i > 0 else []
        starts += [(int(path[i + 1]), -1.0)] if i < last else []
        for start, right in starts:
            for follow, sign in zip(rings[centre], (right, -right), strict=True):
                for vertex, angle in _walk(follow, start, on_line):
                    length = float(np.linalg.norm(surface.vertices[vertex] - surface.vertices[centre]))
                    beside[vertex] = beside.get(vertex, 0.0) + sign * length
                    place_on_line[vertex] = i
                    if i in (0, last):
                        place = length * complex(sign * np.sin(angle), np.cos(angle) * (1.0 if i == 0 else -1.0))
                        near = around[0 if i == 0 else 1]
                        near[vertex] = near.get(vertex, 0j) + place
    known = np.array([*path, *beside], dtype=np.int64)
    side = np.array([*np.zeros(len(path)), *beside.values()])
    station = chain_positions(surface.vertices[path])[[*range(len(path)), *place_on_line.values()]]
    about_ends = []
    for near, end in zip(around, (0, last), strict=True):
        about_end = np.column_stack([side, station - station[end]])
        joined = [k for k, vertex in enumerate(known.tolist()) if vertex in near]
        places = [(near[int(vertex)].real, near[int(vertex)].imag) for vertex in known[joined]]
        about_end[joined] = np.reshape(places, (-1, 2))
        about_ends.append(about_end)
    return known, side, (about_ends[0], about_ends[1])


_Follow = dict[int, tuple[int, float]]


def _rings(
    vertices: NDArray[np.float64], triangles: NDArray[np.int32], centres: NDArray[np.int32]
) -> dict[int, tuple[_Follow, _Follow]]:
    """For each centre the next vertex around it and the angle [rad] to that, counter-clockwise and clockwise.

    Where the ring is closed the angles are scaled to a full turn.
    """
    wanted = np.zeros(len(vertices), dtype=bool)
    wanted[centres] = True
    rings: dict[int, tuple[_Follow, _Follow]] = {int(centre): ({}, {}) for centre in centres}
    for shift in range(3):
        corner = triangles[wanted[triangles[:, shift]]][:, [shift, (shift + 1) % 3, (shift + 2) % 3]]
        u, v = (vertices[corner[:, k]] - vertices[corner[:, 0]] for k in (1, 2))
        angles = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v))
        for (centre, a, b), angle in zip(corner.tolist(), angles.tolist(), strict=True):
            rings[centre][0][a], rings[centre][1][b] = (b, angle), (a, angle)
    for follow in rings.values():
        if set(follow[0]) == set(follow[1]):
            factor = 2 * np.pi / max(sum(angle for _, angle in follow[0].values()), np.finfo(float).tiny)
            for way in follow:
                way.update({a: (b, angle * factor) for a, (b, angle) in way.items()})
    return rings


def _walk(follow: _Follow, start: int, stop: set[int]) -> list[tuple[int, float]]:
    """The vertices after `start` around a centre, up to the border or the line, with the angle passed."""
    passed, here, total = [], start, 0.0
    while here in follow:
        here, step = follow[here]
        total += step
        if here in stop or total > np.pi:
            break
        passed.append((here, total))
    return passed


def _sides(surface: Surface, path: NDArray[np.int32]) -> NDArray[np.float64] | None:
    """#V, -1 to the left of the line and +1 to the right of it; None where the line does not part the surface."""
    he = half_edges(surface.faces)
    position = np.full(len(surface.vertices), -2, dtype=np.int64)
    position[path] = np.arange(len(path))
    step = position[he.head] - position[he.tail]
    on_line = (position[he.tail] >= 0) & (position[he.head] >= 0) & (np.abs(step) == 1)
    # Faces are wound counter-clockwise: a face lies to the left of its own sides.
    side_of_face = np.zeros(len(surface.faces))
    side_of_face[he.face[on_line & (step > 0)]] = -1.0
    side_of_face[he.face[on_line & (step < 0)]] = 1.0
    part = components(surface.faces, barrier=he.edges[np.unique(he.edge[on_line])])
    left, right = (np.isin(part, part[side_of_face == sign]) for sign in (-1.0, 1.0))
    if (left & right).any():
        return None
    face_sign = np.where(left, -1.0, 1.0)
    sign = np.ones(len(surface.vertices))
    sign[he.tail] = face_sign[he.face]
    return sign
