"""Distance from a line on the surface, and where on the line the nearest point lies.

The distance d at a vertex v is the least d(p) + |v - p| over the points p of the sides opposite to it, with d linear
along each side (the Hopf-Lax form of the eikonal equation; Bornemann and Rasch 2006). It is exact where the front is
straight, on whatever triangles, hence for a straight line on a surface that can be developed; the heat method is off
by a quarter of an edge and more there. Distances are found from above, starting from those along edges: in the order of
these, each vertex takes the best p among its opposite sides and, if that shortens its distance, marks its neighbours for
another look. With every vertex's p fixed the equations are linear, and triangular unless paths run in circles.

The station of the nearest point is constant along the path to it, so the same linear system propagates it. Beyond the ends
of the line, where the nearest point is one end for all, the direction in which the path leaves that end is propagated instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.compile import launch_quietly
from warpflat.core.errors import InputError
from warpflat.core.launch import launch_each
from warpflat.core.polyline import arc_lengths
from warpflat.core.sorting import counting_sort
from warpflat.flat.surface.connectivity import border_of, components
from warpflat.flat.surface.half_edges import half_edges_of
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.lines import line_from_curve
from warpflat.flat.surface.triangles import triangulate, unfold_quad_diagonals
from warpflat.flat.surface.vectors import cross, dot, norm, points_at
from warpflat.kernels.geodesic import CROWD, carry_along, find_ways, go_around, see_sides

__all__ = ["distance_from", "extend_to_border", "signed_distance_and_station"]


def distance_from(surface: Surface, line: ArrayLike) -> FloatArray:
    """Return #V, the distance [m] along the surface from a line.

    Args:
        surface: the surface.
        line: vertex indices along edges (or a single vertex).
    """
    path = np.asarray(line, dtype=np.int64).ravel()
    if len(path) == 0 or path.min() < 0 or path.max() >= len(surface.vertices):
        raise InputError(f"a line on {surface.name!r} needs vertices from 0 to {len(surface.vertices) - 1}")
    return _GeodesicField(surface, _short_triangles(surface), path).distance


def _short_triangles(surface: Surface, *, distinct: bool = False) -> IntArray:
    """Return the faces as triangles (#T by 3), quads split along their shorter diagonal; `distinct` as of :func:`triangulate`."""
    if not surface.is_quad.any():
        return np.ascontiguousarray(surface.faces[:, :3])
    lengths, quads = unfold_quad_diagonals(surface.vertices, surface.faces)
    other = np.zeros(len(surface.faces), dtype=bool)
    other[quads] = lengths[:, 1] < lengths[:, 0] * (1 - 1e-9)
    return triangulate(surface.faces, other_diagonal=other, distinct=distinct)[0]


def signed_distance_and_station(
    surface: Surface, line: ArrayLike, *, extend: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Return coordinates of a first layout: each vertex's distance from a line, and the station of its nearest point on it.

    Where the nearest point of the line is one of its ends and the path to it is not at right angles to the line,
    distance and direction are taken as polar coordinates about that end, so that vertices beyond an end do not all get
    its station.

    Args:
        surface: the surface.
        line: vertex indices along edges, not closed.
        extend: true to extend an end inside the piece straight ahead to the border.

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
    station = arc_lengths(surface.vertices[path])
    station -= station[before]
    triangles = _short_triangles(surface)
    field = _GeodesicField(surface, triangles, path.astype(np.int64))
    along = field.propagate(path.astype(np.int64), station)
    known, side, about_ends = _directions_at_line(surface, triangles, path)
    columns = field.propagate(known, np.column_stack([side, *about_ends])).T
    x, y = field.distance * np.sign(columns[0]), along
    for (right, up), end, outwards in ((columns[1:3], station[0], -1.0), (columns[3:], station[-1], 1.0)):
        beyond = outwards * up > 0
        scale = field.distance / np.where(beyond, np.hypot(right, up), 1.0)
        x, y = np.where(beyond, scale * right, x), np.where(beyond, end + scale * up, y)
    # A path may end on the line itself, which has no side.
    lost = columns[0] == 0
    lost[path] = False
    if lost.any():
        he = half_edges_of(surface)
        position = np.full(len(surface.vertices), -2, dtype=np.int64)
        position[path] = np.arange(len(path))
        step = position[he.head] - position[he.tail]
        on_line = (position[he.tail] >= 0) & (position[he.head] >= 0) & (np.abs(step) == 1)
        # Faces are wound counter-clockwise: a face lies to the left of its own sides.
        side_of_face = np.zeros(len(surface.faces))
        side_of_face[he.face[on_line & (step > 0)]] = -1.0
        side_of_face[he.face[on_line & (step < 0)]] = 1.0
        part = components(surface.faces, barrier=he.edges[np.unique(he.edge[on_line])])
        left_of, right_of = (np.isin(part, part[side_of_face == sign]) for sign in (-1.0, 1.0))
        # Where the line does not part the surface, what lies to its left lies to its right, too.
        if not (left_of & right_of).any():
            sign = np.ones(len(surface.vertices))
            sign[he.tail] = np.where(left_of, -1.0, 1.0)[he.face]
            x = sign * np.abs(x)
    return x, y


def extend_to_border(surface: Surface, line: IntArray) -> tuple[IntArray, int]:
    """Extend a line straight ahead, along edges, from each end that is inside to the border.

    Returns:
        The longer line, and the position of the old line's first vertex in it. An end from which no path leads to the
        border clear of the line stays where it is.
    """
    border = _on_border(surface)
    path = list(map(int, line))
    if path[-1] not in border:
        path += _ahead(surface, path)
    count = len(path)
    if path[0] not in border:
        path = (path[::-1] + _ahead(surface, path[::-1]))[::-1]
    return np.array(path, dtype=np.int32), len(path) - count


def _on_border(surface: Surface) -> set[int]:
    return set(border_of(surface).tolist())


# Faces around a vertex lie on each other if their normals, by angles, add up to less than this share of these.
_FOLDED = 1e-6


def _ahead(surface: Surface, path: list[int]) -> list[int]:
    """Return the vertices from the end of a path straight on to the border, or none."""
    import potpourri3d

    points = surface.vertices[path]
    length = arc_lengths(points)
    # A path along edges wanders: its direction is that of its last fifth.
    back = int(np.searchsorted(length, 0.8 * length[-1]))
    direction = points[-1] - points[min(back, len(path) - 2)]
    size = float(np.linalg.norm(direction))
    reach = 2 * float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    triangles = _short_triangles(surface, distinct=True)
    rows, at = np.nonzero(triangles == path[-1])
    one, two = (surface.vertices[triangles[rows, (at + k) % 3]] - points[-1] for k in (1, 2))
    normal = cross(one.T, two.T)
    sine = norm(normal)
    angle = np.arctan2(sine, dot(one.T, two.T))
    facing = norm((normal * (angle / np.maximum(sine, np.finfo(float).tiny))).sum(axis=1))
    # Where cloth is folded flat the vertex has no tangent plane, in which the path is straight; the library crashes there.
    if size == 0 or facing <= _FOLDED * angle.sum():
        return []
    try:
        tracer = potpourri3d.GeodesicTracer(surface.vertices, triangles)
        trace = np.asarray(tracer.trace_geodesic_from_vertex(path[-1], direction / size * reach))
    except RuntimeError:  # of the library: the triangles are no manifold
        return []
    if len(trace) < 2 or not np.isfinite(trace).all():
        return []
    try:
        new = line_from_curve(surface, trace, name="extension").tolist()
    except InputError:
        return []
    border = _on_border(surface)
    stop = next((i for i, vertex in enumerate(new) if vertex in border), -1)
    new = new[: stop + 1]
    return new[1:] if stop > 0 and not set(new[1:]) & set(path) else []


# Rounds over all vertices; a mesh of needles may take that many, any other a few.
_MOST_ROUNDS = 200
# Share of all vertices, back in their order, within which a shorter distance is passed on at once, and for so many times all vertices:
# where faces are slender that would go on and on, and sweeps take a tenth of it.
_REACH, _AT_ONCE = 0.1, 2.0
# Changes below this share of the largest distance, or of the largest value propagated, are rounding.
_ROUNDING = 1e-14


class _GeodesicField:
    """The shortest paths to a line: each vertex's distance, and the point on an opposite side through which its path passes.

    Attributes:
        distance: #V [m].
    """

    def __init__(self, surface: Surface, triangles: IntArray, line: NDArray[np.int64]) -> None:
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import connected_components, dijkstra

        # Paths along edges are no shorter, and nearly in the right order: inside this class vertices are numbered by their lengths.
        edges, size = half_edges_of(surface).edges, len(surface.vertices)
        ends = points_at(surface.vertices, edges.T)
        # A length of zero would be read as "no edge".
        length = np.maximum(norm(ends[:, 1] - ends[:, 0]), np.finfo(float).tiny)
        # Edges are sorted by their first vertex.
        offset = np.searchsorted(edges[:, 0], np.arange(size + 1)).astype(np.int32)
        # Copies: SciPy 1.12 takes no read-only arrays here.
        graph = csr_array((length, edges[:, 1].copy(), offset), shape=(size, size))
        along_edges = np.asarray(dijkstra(graph, directed=False, indices=line.copy(), min_only=True))
        order = np.argsort(along_edges, kind="stable").astype(np.int32)
        self._here = np.arange(len(order), dtype=np.int32)
        self._rank = np.empty_like(order)
        self._rank[order] = self._here
        distance = along_edges[order]
        tolerance = _ROUNDING * float(distance[np.isfinite(distance)][-1])
        self._on_line = np.zeros(len(order), dtype=np.int32)
        self._on_line[self._rank[line]] = 1
        corner = self._rank[triangles]
        slot, offset = counting_sort(corner.ravel(), len(order))
        ends, seen = np.empty((corner.size, 2), dtype=np.int32), np.empty((corner.size, 3))
        launch_each(see_sides, corner.size, [surface.vertices[order], corner, slot], [ends, seen])
        waiting, shortened = 1 + self._on_line, np.empty(1, dtype=np.int32)
        crowd = np.add.reduceat(1 - self._on_line, self._here[::CROWD], dtype=np.int32)
        self._paths = self._here.copy(), self._here.copy(), np.zeros(len(order)), np.zeros(len(order))
        for sweep in range(_MOST_ROUNDS):
            shortened[0] = 0
            at_once = int(_AT_ONCE * len(order)) if sweep == 0 else 0
            launch_quietly(
                find_ways,
                dim=1,
                inputs=[offset, ends, seen, int(_REACH * len(order)), at_once, tolerance],
                outputs=[distance, waiting, crowd, *self._paths, shortened],
                device="cpu",
            )
            if shortened[0] == 0:
                break
        # These arrays are the largest, and are not needed any more.
        del corner, slot, offset, ends, seen
        # The vertices stand in an order, each after those that its path leads to, as far as paths run in no circles.
        first, second, share, _ = self._paths
        count = len(self._here)
        ends = np.stack(
            [np.where(share < 1, first, self._here), np.where(share > 0, second, self._here)], axis=1
        ).ravel()
        offset = np.arange(0, len(ends) + 1, 2, dtype=np.int32)
        graph = csr_array((np.ones(len(ends), dtype=np.int8), ends, offset), shape=(count, count))
        # Strongly connected components are numbered in such an order. Only the number of rounds depends on it.
        parts, label = connected_components(graph, connection="strong")
        self._straight = parts == count and bool((label[ends].reshape(-1, 2) <= label[:, None]).all())
        self._order = counting_sort(label, parts)[0]
        self.distance = self._solve(self._on_line, distance[:, None], grows=1.0)[self._rank, 0]

    def _solve(self, fixed: IntArray, value: FloatArray, *, grows: float) -> FloatArray:
        """Solve for values along the paths.

        Args:
            fixed: #V, 1 for vertices that keep their values.
            value: #V by #K, start values, which are overwritten.
            grows: factor of the length of the path's leg that is added to the value where it passes the opposite side.

        Returns:
            #V by #K.
        """
        change = np.empty(value.shape[1])
        for _ in range(_MOST_ROUNDS):
            change[:] = 0.0
            launch_quietly(
                carry_along,
                dim=1,
                inputs=[*self._paths, self._order, fixed, grows],
                outputs=[value, change],
                device="cpu",
            )
            if self._straight or not (change > _ROUNDING * np.abs(value).max(axis=0)).any():
                break
        return value

    def propagate(self, known: NDArray[np.int64], values: FloatArray) -> FloatArray:
        """Propagate values (#N, or #N by #K) of `known` vertices, which include the line, to all others: #V (by #K)."""
        fixed, at = self._on_line.copy(), self._rank[known]
        fixed[at] = 1
        start = np.zeros((len(fixed), *values.shape[1:]))
        start[at] = values
        return self._solve(fixed, start.reshape(len(fixed), -1), grows=0.0).reshape(start.shape)[self._rank]


def _directions_at_line(
    surface: Surface, triangles: IntArray, path: IntArray
) -> tuple[NDArray[np.int64], FloatArray, tuple[FloatArray, FloatArray]]:
    """Find the vertices of the line and those joined to it, and their positions relative to it.

    Returns:
        #N, the vertices; #N, more or less than 0 to the right or left of the line; and for either end of it, #N by 2, right
        and up [m] of it, by the angles of the triangles around it as in the plane. A straight way that passes between two
        of them has the mean of their places. Vertices not joined to that end lie beside their own place of a straight line.
    """
    # The triangles around each vertex of the line: their other two vertices, anticlockwise, how far these are, and the angle between.
    vertices = surface.vertices
    place = np.full(len(vertices), -1, dtype=np.int32)
    place[path] = np.arange(len(path), dtype=np.int32)
    near = triangles[(place[triangles] >= 0).any(axis=1)]
    corner = np.concatenate([np.roll(near, -shift, axis=1) for shift in range(3)])
    corner = corner[place[corner[:, 0]] >= 0]
    order, offset = counting_sort(place[corner[:, 0]], len(path))
    corner = corner[order]
    u, v = (points_at(vertices, corner[:, k]) - points_at(vertices, corner[:, 0]) for k in (1, 2))
    angle, away = np.arctan2(norm(cross(u, v)), dot(u, v)), np.stack([norm(u), norm(v)], axis=1)
    sides = np.ascontiguousarray(corner[:, 1:])
    on_path = np.zeros(len(vertices), dtype=np.int8)
    on_path[path] = 1
    # Each triangle may be passed from both neighbours on the line, either way.
    room, count = 4 * len(sides), np.empty(1, dtype=np.int32)
    visited, at, lies = np.empty(room, dtype=np.int32), np.empty(room, dtype=np.int32), np.empty((room, 3))
    given, made = [path, on_path, offset, sides, angle, away], [visited, at, lies, count]
    launch_quietly(go_around, dim=1, inputs=given, outputs=made, device="cpu")
    visited, at, (right, passed, far) = visited[: count[0]], at[: count[0]], lies[: count[0]].T
    beside, number = np.unique(visited, return_inverse=True)
    known = np.concatenate([path, beside]).astype(np.int64)
    side = np.concatenate([np.zeros(len(path)), np.bincount(number, right * far, minlength=len(beside))])
    nearest = np.arange(len(known))
    nearest[len(path) + number] = at
    station = arc_lengths(vertices[path])[nearest]
    about_ends = []
    for end, up in ((0, 1.0), (len(path) - 1, -1.0)):
        about_end = np.column_stack([side, station - station[end]])
        here = at == end
        around, of = np.unique(number[here], return_inverse=True)
        places = far[here] * right[here] * np.sin(passed[here]), far[here] * up * np.cos(passed[here])
        about_end[len(path) + around] = np.stack([np.bincount(of, place, minlength=len(around)) for place in places], 1)
        about_ends.append(about_end)
    return known, side, (about_ends[0], about_ends[1])
