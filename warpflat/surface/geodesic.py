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
from warpflat.surface.topology import border_edges, components, half_edges, triangulate, unfold_quad_diagonals

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
    known, vectors = _directions_at_line(surface, path)
    right, up = (ways.carry(known, component) for component in vectors.T)
    size = np.hypot(right, up)
    right, up = (np.where(size > 0, part / np.where(size > 0, size, 1.0), 0.0) for part in (right, up))
    sides = _sides(surface, path)
    if sides is not None:
        right = sides * np.abs(right)
    return ways.distance * right, along + ways.distance * up


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
        corner = np.concatenate([triangles[:, [i, (i + 1) % 3, (i + 2) % 3]] for i in range(3)]).astype(np.int64)
        corner = corner[~self.on_line[corner[:, 0]]]
        corner = corner[np.argsort(corner[:, 0], kind="stable")]
        self._corner = corner
        self._first_row = np.flatnonzero(np.diff(corner[:, 0], prepend=-1))
        p = surface.vertices[corner]
        side, away = p[:, 2] - p[:, 1], p[:, 0] - p[:, 1]
        self._side = np.linalg.norm(side, axis=1)
        safe = np.where(self._side > 0, self._side, 1.0)
        self._foot = np.einsum("ij,ij->i", away, side) / safe
        self._height = np.linalg.norm(np.cross(away, side), axis=1) / safe
        for _ in range(_MOST_STEPS):
            cost = self._choose_ways(distance)
            better = self._solve(cost)
            change = float(np.abs(better - distance).max())
            distance = better
            if change <= 1e-12 * float(distance.max()):
                break
        self.distance = distance

    def _choose_ways(self, distance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Set each vertex's way to the best one given the distances; #V, the length [m] of its first leg."""
        da, db = distance[self._corner[:, 1]], distance[self._corner[:, 2]]
        safe = np.where(self._side > 0, self._side, 1.0)
        slope = np.clip((db - da) / safe, -1 + 1e-15, 1 - 1e-15)
        at = np.clip(self._foot - slope * self._height / np.sqrt(1 - slope**2), 0, self._side)
        share = at / safe
        leg = np.hypot(at - self._foot, self._height)
        vertex = self._corner[:, 0]
        before = (1 - share) * da + share * db
        # A way leads downhill. Where rounding leaves none that does, the lowest will do; on needles two vertices would
        # else lead to each other.
        value = np.where(before < distance[vertex], before + leg, 1e6 * (1.0 + before))
        least = np.minimum.reduceat(value, self._first_row)
        row = np.flatnonzero(value == np.repeat(least, np.diff(np.append(self._first_row, len(value)))))
        chosen, which = np.unique(vertex[row], return_index=True)
        row = row[which]
        self.first, self.second, self.share = np.arange(self.size), np.arange(self.size), np.zeros(self.size)
        self.first[chosen], self.second[chosen] = self._corner[row, 1], self._corner[row, 2]
        self.share[chosen] = share[row]
        cost = np.zeros(self.size)
        cost[chosen] = leg[row]
        # Nearly triangular in this order, so the factors stay as sparse as the matrix.
        self._order = np.argsort(distance, kind="stable")
        return cost

    def _solve(self, right: NDArray[np.float64], also_fixed: NDArray[np.int64] | None = None) -> NDArray[np.float64]:
        """x with x(v) = right(v) + the x where the way of v passes; x = right on the line."""
        from scipy.sparse import coo_matrix, identity
        from scipy.sparse.linalg import splu

        fixed = self.on_line.copy()
        if also_fixed is not None:
            fixed[also_fixed] = True
        free = np.flatnonzero(~fixed)
        rank = np.empty(self.size, dtype=np.int64)
        rank[self._order] = np.arange(self.size)
        weights = np.concatenate([1 - self.share[free], self.share[free]])
        rows = np.tile(rank[free], 2)
        columns = rank[np.concatenate([self.first[free], self.second[free]])]
        matrix = identity(self.size, format="csc") - coo_matrix(
            (weights, (rows, columns)), shape=(self.size, self.size)
        )
        solution = splu(matrix.tocsc(), permc_spec="NATURAL").solve(right[self._order])
        return np.asarray(solution[rank])

    def carry(self, known: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """#V, the values of `known` vertices (those of the line among them) carried to all others along the ways."""
        right = np.zeros(self.size)
        right[known] = values
        return self._solve(right, also_fixed=known)


def _directions_at_line(surface: Surface, path: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The vertices of the line and those joined to it, and for each the direction (right, up) in which it lies.

    Beside the line that is right or left; about an end it is the direction on the surface, by the angles of the
    triangles around the end, as far as it lies beyond the right angle. The line's own vertices have (0, 0).
    """
    rings = _rings(surface.vertices, _short_triangles(surface), path)
    beside: dict[int, complex] = {}
    beyond: dict[int, complex] = {}
    on_line = set(path.tolist())
    last = len(path) - 1
    for i, centre in enumerate(path.tolist()):
        # Counter-clockwise from the point before lies the right, from the point after the left.
        starts = [(int(path[i - 1]), 1.0)] if i > 0 else []
        starts += [(int(path[i + 1]), -1.0)] if i < last else []
        for start, right in starts:
            for follow, sign in zip(rings[centre], (right, -right), strict=True):
                for vertex, angle in _walk(follow, start, on_line):
                    if i in (0, last) and angle > np.pi / 2:
                        up = -np.cos(angle) if i == last else np.cos(angle)
                        beyond[vertex] = beyond.get(vertex, 0j) + complex(sign * np.sin(angle), up)
                    else:
                        beside[vertex] = beside.get(vertex, 0j) + sign
    found = {**beside, **beyond}
    vectors = np.array([(value.real, value.imag) for value in found.values()]).reshape(-1, 2)
    known = np.concatenate([path.astype(np.int64), np.fromiter(found, dtype=np.int64, count=len(found))])
    return known, np.concatenate([np.zeros((len(path), 2)), vectors])


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
