"""Faces split along a path, so that the path becomes a row of mesh edges and a cut along it is straight."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.flat.surface.half_edges import border_edges
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.trace import Place, SurfacePath, describe_place, path_triangles

__all__ = ["SplitSurface", "split_faces_along"]


_ROUNDING = 1e-6
"""Share of an edge below which a crossing is at the vertex, whatever `snap` says: no triangle thinner than that."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SplitSurface:
    """A surface with a path worked into its edges, and the maps back to the surface before it.

    Attributes:
        surface: the new surface; the old vertices keep their numbers, the new ones follow. New vertices are appended
            to `input_vertices` too.
        path: #P, the vertices along the path, each joined to the next by an edge; a closed path repeats its first.
        vertex_support: #W by 3, for each new-numbered vertex the old vertices it lies between, -1 where fewer than 3.
        vertex_weights: #W by 3, their weights, summing to 1.
        face_origin: #G, the old face that each new face is (a part of).
    """

    surface: Surface
    path: IntArray
    vertex_support: IntArray
    vertex_weights: FloatArray
    face_origin: IntArray


def split_faces_along(surface: Surface, path: SurfacePath, *, snap: float = 0.1) -> SplitSurface:
    """Split the faces that a path runs through, so that it follows edges of the mesh.

    Vertices of the surface stay where they are, and all new ones lie on its triangles: area and shape are conserved.
    A face the path does not run through stays as it is, quads included; a quad it runs through, or on whose edge it
    ends, becomes triangles. No vertex is left hanging on an edge.

    Args:
        surface: the surface.
        path: on that surface.
        snap: a crossing nearer to an end of its edge than this share of the edge's length is moved to that vertex, so
            that no slivers appear; the path strays from its line by no more than that. Only the ends of a path are
            moved onto the border: a crossing moved there would part the cloth.

    Raises:
        InputError: if the path crosses itself, or is shorter than the snapping distance.
    """
    if not 0.0 <= snap < 0.5:
        raise InputError(f"snap is a share of an edge's length, from 0 to below 0.5, got {snap:g}")
    triangles, face_of = path_triangles(surface)
    share = max(snap, _ROUNDING)
    places = _snapped(surface, path, share)
    refined = Refinement(surface.vertices, triangles, {v for place in places for v in place}, share)
    chain = np.array(refined.insert_path(places, closed=path.closed), dtype=np.int32)
    refined.improve()
    old = len(surface.vertices)
    count = old + len(refined.new_places)
    support = np.full((count, 3), -1, dtype=np.int32)
    weights = np.zeros((count, 3))
    support[:old, 0] = np.arange(old)
    weights[:old, 0] = 1.0
    for row, place in enumerate(refined.new_places, start=old):
        support[row, : len(place)] = list(place)
        weights[row, : len(place)] = list(place.values())
    added = np.array(refined.positions, dtype=float).reshape(-1, 3)

    parts = refined.parts()
    bases = [base for base, children in parts.items() if len(children) > 1]
    for a, b in pairwise(chain.tolist()):
        beside = refined.triangles_beside(a, b)
        if len(beside) == 2 and face_of[beside[0]] == face_of[beside[1]]:
            # Inside one face: a part's own edge, or the diagonal of a quad that nothing else divides.
            bases += beside
    divided = np.unique(face_of[np.array(bases, dtype=np.int64)])
    rows: list[tuple[int, int, int, int]] = []
    origin: list[int] = []
    # The other half of a divided quad may be whole itself: it becomes a triangle all the same.
    for base in np.flatnonzero(np.isin(face_of, divided)).tolist():
        for a, b, c in parts.get(base, [tuple(refined.triangles[base].tolist())]):
            rows.append((a, b, c, -1))
            origin.append(int(face_of[base]))
    whole = np.setdiff1d(np.arange(len(surface.faces)), divided)
    faces = np.concatenate([surface.faces[whole], np.array(rows, dtype=np.int32).reshape(-1, 4)])
    face_origin = np.concatenate([whole, np.array(origin, dtype=np.int64)]).astype(np.int32)
    order = np.argsort(face_origin, kind="stable")
    # The new vertices on the edges of a feature line are part of it.
    lines = {
        name: np.array(
            [line[0], *(v for a, b in pairwise(line.tolist()) for v in (*refined.vertices_between(a, b), b))],
            dtype=np.int32,
        )
        for name, line in surface.lines.items()
    }
    new = replace(
        surface,
        vertices=np.concatenate([surface.vertices, added]),
        faces=np.ascontiguousarray(faces[order]),
        lines=lines,
        input_vertices=np.concatenate([surface.input_vertices, added]),
        input_index=np.concatenate(
            [surface.input_index, len(surface.input_vertices) + np.arange(len(added), dtype=np.int32)]
        ).astype(np.int32),
    )
    return SplitSurface(
        surface=new, path=chain, vertex_support=support, vertex_weights=weights, face_origin=face_origin[order]
    )


def _snapped(surface: Surface, path: SurfacePath, share: float) -> list[Place]:
    """Return the places of a path, those near a vertex or an edge moved onto it; the detours that this closes are taken out."""
    edges = border_edges(surface.faces)
    border = {tuple(sorted(edge)) for edge in edges.tolist()} | {(v,) for v in edges.ravel().tolist()}
    places: list[Place] = []
    points: list[int] = []
    last = len(path.points) - 1
    for index in range(len(path.points)):
        exact = path.place(index)
        free = _without_small(exact, share, set())
        is_end = index in (0, last) and not path.closed
        place = free if is_end else _without_small(exact, share, border)
        if places and free == places[-1]:
            # Beside a border vertex that the path has reached already, moving onto it parts nothing.
            continue
        while is_end and len(places) > 1 and _without_small(places[-1], share, set()) == place:
            del places[-1], points[-1]
        if place not in places:
            places.append(place)
            points.append(index)
            continue
        back = places.index(place)
        if path.closed and back == 0 and index > len(path.points) / 2:
            continue
        # A path that comes back to a place must have stayed within an edge's length of it.
        first = points[back]
        detour = path.points[first : index + 1]
        crossed = [surface.vertices[support[support >= 0]] for support in path.support[first : index + 1]]
        longest = max(float(np.linalg.norm(corners - corners[0], axis=1).max()) for corners in crossed)
        if np.linalg.norm(detour - detour[0], axis=1).max() > longest:
            raise InputError(f"the path crosses itself at {describe_place(place)}; draw it so that it does not")
        del places[back + 1 :], points[back + 1 :]
    if len(places) < (3 if path.closed else 2):
        raise InputError(f"the path at {describe_place(places[0])} is too short: it lies within one snapping distance")
    return places


def _without_small(place: Place, snap: float, border: set[tuple[int, ...]]) -> Place:
    """Return the place moved off the vertices of small weight, but not from the inside onto the border."""
    while len(place) > 1:
        least = min(place, key=lambda v: place[v])
        rest = {v: w / (1.0 - place[least]) for v, w in place.items() if v != least}
        onto_border = tuple(sorted(rest)) in border and tuple(sorted(place)) not in border
        if place[least] >= (_ROUNDING if onto_border else snap):
            break
        place = rest if len(rest) > 1 else dict.fromkeys(rest, 1.0)
    return place


_Triangle = tuple[int, int, int]


class Refinement:
    """The triangles around some vertices, open to being divided.

    Every triangle knows the undivided one ("base") it is a part of and every vertex its place on the undivided mesh, so
    all divisions happen in the plane of a base triangle and conserve its shape.

    Attributes:
        triangles: #T by 3, the undivided mesh.
        new_places: for each new vertex its place; it is numbered #V and on.
        positions: for each new vertex its position [m].
    """

    def __init__(self, vertices: FloatArray, triangles: IntArray, around: Iterable[int], snap: float) -> None:
        """Open the triangles around some vertices.

        Args:
            vertices: #V by 3, positions [m].
            triangles: #T by 3, consistently wound.
            around: vertices whose triangles may be divided.
            snap: share of an edge's length within which a crossing is moved to a vertex.
        """
        self.triangles = triangles
        self.new_places: list[Place] = []
        self.positions: list[list[float]] = []
        self._vertices = vertices
        self._snap = snap
        near = np.flatnonzero(np.isin(triangles, list(around)).any(axis=1))
        self._corner: dict[int, _Triangle] = {
            t: (a, b, c) for t, (a, b, c) in zip(near.tolist(), triangles[near].tolist(), strict=True)
        }
        self._base = {t: t for t in self._corner}
        self._children: dict[int, list[int]] = {t: [t] for t in self._corner}
        self._base_of = {frozenset(c): t for t, c in self._corner.items()}
        self._half = {edge: t for t, c in self._corner.items() for edge in _rim(c)}
        self._on_edge: dict[tuple[int, int], list[tuple[float, int]]] = {}
        self._drawn: set[tuple[int, int]] = set()
        self._next_id = len(triangles)

    def insert_path(self, places: Sequence[Place], *, closed: bool) -> list[int]:
        """Divide triangles until the places are vertices and each is joined to the next by edges.

        Returns:
            The vertices along the path; a closed one repeats its first.

        Raises:
            InputError: if the path crosses itself.
        """
        chain = [self._vertex_at(places[0])]
        for place in places[1:]:
            self._extend(chain, self._vertex_at(place))
        if closed:
            self._extend(chain, chain[0])
        body = chain[:-1] if closed else chain
        again = next((v for i, v in enumerate(body) if v in body[:i]), None) if len(set(body)) < len(body) else None
        if again is not None:
            raise _crosses(self.place(again))
        return chain

    def improve(self) -> None:
        """Flip diagonals inside base triangles where that widens the smallest angle; edges of inserted paths stay."""
        for base, children in self._children.items():
            for _ in range(3 * len(children)):
                flipped = [self._flip(edge, base) for t in list(children) for edge in _rim(self._corner[t])]
                if not any(flipped):
                    break

    def parts(self) -> dict[int, list[_Triangle]]:
        """Return, for each base triangle that may be divided, the triangles it now consists of."""
        return {base: [self._corner[t] for t in children] for base, children in self._children.items()}

    def place(self, vertex: int) -> Place:
        """Return the place of an old or new vertex on the undivided mesh."""
        old = len(self._vertices)
        return {vertex: 1.0} if vertex < old else self.new_places[vertex - old]

    def vertices_between(self, a: int, b: int) -> list[int]:
        """Return the new vertices on an edge of the undivided mesh, in order from a to b."""
        inside = [vertex for _, vertex in self._on_edge.get((min(a, b), max(a, b)), [])]
        return inside if a < b else inside[::-1]

    def triangles_beside(self, a: int, b: int) -> list[int]:
        """Return the base triangles on both sides of an edge; one on the border."""
        found = (self._half.get((a, b)), self._half.get((b, a)))
        return [self._base[t] for t in found if t is not None]

    def _new_vertex(self, place: Place) -> int:
        self.new_places.append(place)
        corners = [(weight, self._vertices[v].tolist()) for v, weight in place.items()]
        self.positions.append([sum(weight * x[axis] for weight, x in corners) for axis in range(3)])
        return len(self._vertices) + len(self.new_places) - 1

    def _position(self, vertex: int) -> list[float]:
        old = len(self._vertices)
        return self._vertices[vertex].tolist() if vertex < old else self.positions[vertex - old]

    def _vertex_at(self, place: Place) -> int:
        if len(place) == 1:
            return next(iter(place))
        if len(place) == 3:
            # Inside a base triangle a place near a vertex or an edge is moved onto it.
            base = self._base_of[frozenset(place)]
            point = self._flat(place, base)
            best: tuple[float, int, list[float]] = (-math.inf, -1, [])
            for t in self._children[base]:
                a, b, c = (self._flat(self.place(v), base) for v in self._corner[t])
                whole = _twice_area(a, b, c)
                if whole > 0:
                    shares = [
                        _twice_area(point, b, c) / whole,
                        _twice_area(a, point, c) / whole,
                        _twice_area(a, b, point) / whole,
                    ]
                    best = max(best, (min(shares), t, shares))
            _, t, shares = best
            corner = self._corner[t]
            if max(shares) > 1.0 - self._snap:
                return corner[shares.index(max(shares))]
            for slot in range(3):
                u, v = corner[(slot + 1) % 3], corner[(slot + 2) % 3]
                on_rim = len(self.place(u).keys() | self.place(v).keys()) <= 2
                if shares[slot] < self._snap and not on_rim:
                    share = shares[(slot + 2) % 3] / (1.0 - shares[slot])
                    return self._split_at(u, v, share)
            x = self._new_vertex(place)
            self._replace(t, [(u, v, x) for u, v in _rim(corner)])
            return x
        low, high = sorted(place)
        stations = self._on_edge.setdefault((low, high), [])
        share = place[high]
        for station, vertex in stations:
            if abs(station - share) < self._snap:
                return vertex
        rank = sum(station < share for station, _ in stations)
        u = stations[rank - 1][1] if rank else low
        v = stations[rank][1] if rank < len(stations) else high
        vertex = self._new_vertex({low: 1.0 - share, high: share})
        self._split_edge(u, v, vertex)
        stations.insert(rank, (share, vertex))
        return vertex

    def _split_at(self, u: int, v: int, share: float) -> int:
        mixed: Place = {}
        for vertex, part in ((u, 1.0 - share), (v, share)):
            for old, weight in self.place(vertex).items():
                mixed[old] = mixed.get(old, 0.0) + part * weight
        x = self._new_vertex(mixed)
        self._split_edge(u, v, x)
        return x

    def _split_edge(self, u: int, v: int, x: int) -> None:
        if (u, v) in self._drawn:
            raise _crosses(self.place(x))
        for tail, head in ((u, v), (v, u)):
            t = self._half.get((tail, head))
            if t is not None:
                apex = next(c for c in self._corner[t] if c not in (tail, head))
                self._replace(t, [(tail, x, apex), (x, head, apex)])

    def _replace(self, triangle: int, parts: Sequence[_Triangle]) -> None:
        """Replace a triangle by its parts, of which the first takes over its number."""
        base = self._base[triangle]
        for edge in _rim(self._corner[triangle]):
            self._half.pop(edge, None)
        for index, part in enumerate(parts):
            t = triangle if index == 0 else self._next_id
            if index:
                self._next_id += 1
                self._base[t] = base
                self._children[base].append(t)
            self._corner[t] = part
            self._half.update(dict.fromkeys(_rim(part), t))

    def _extend(self, chain: list[int], goal: int) -> None:
        """Extend the chain along edges to a vertex of the same base triangle, dividing the triangles in between."""
        seen = len(chain)
        while chain[-1] != goal:
            here = chain[-1]
            if (here, goal) in self._half or (goal, here) in self._half:
                step = [goal]
            else:
                ends = self.place(here).keys() | self.place(goal).keys()
                if len(ends) <= 2:
                    low, high = sorted(ends)
                    row = [low, *self.vertices_between(low, high), high]
                    i, j = row.index(here), row.index(goal)
                    step = row[i + 1 : j + 1] if i < j else row[j:i][::-1]
                else:
                    step = [self._towards(here, goal, ends)]
            for vertex in step:
                self._drawn |= {(chain[-1], vertex), (vertex, chain[-1])}
                chain.append(vertex)
            if len(chain) - seen > len(self._corner):
                raise _crosses(self.place(here))

    def _towards(self, here: int, goal: int, ends: Iterable[int]) -> int:
        """Return the next vertex on the straight path inside one base triangle, splitting the edge that it crosses."""
        inside = set(ends)
        for base in {self._base[t] for t, corner in self._corner.items() if here in corner}:
            if not inside <= set(self.triangles[base].tolist()):
                continue
            p, q = self._flat(self.place(here), base), self._flat(self.place(goal), base)
            for t in self._children[base]:
                if here not in self._corner[t]:
                    continue
                slot = self._corner[t].index(here)
                u, v = self._corner[t][(slot + 1) % 3], self._corner[t][(slot + 2) % 3]
                right = -_twice_area(p, q, self._flat(self.place(u), base))
                left = _twice_area(p, q, self._flat(self.place(v), base))
                if right < 0 or left < 0 or right + left <= 0:
                    continue
                share = right / (right + left)
                if share < self._snap:
                    return u
                return v if share > 1.0 - self._snap else self._split_at(u, v, share)
        raise _crosses(self.place(here))

    def _flat(self, place: Place, base: int) -> tuple[float, float]:
        """Return coordinates in the plane of a base triangle, whose corners are (0, 0), (1, 0) and (0, 1)."""
        _, b, c = self.triangles[base].tolist()
        return place.get(b, 0.0), place.get(c, 0.0)

    def _flip(self, edge: tuple[int, int], base: int) -> bool:
        """Replace a diagonal by the other one of its two triangles if that widens their smallest angle."""
        one, two = self._half.get(edge), self._half.get(edge[::-1])
        if one is None or two is None or self._base[one] != base or self._base[two] != base or edge in self._drawn:
            return False
        # The two triangles on both sides of an edge as they are once the edge is flipped.
        u, v = edge
        left = next(c for c in self._corner[one] if c not in edge)
        right = next(c for c in self._corner[two] if c not in edge)
        parts = (left, u, right), (right, v, left)
        if any(_twice_area(*(self._flat(self.place(v), base) for v in part)) <= 1e-9 for part in parts):
            return False
        before = min(self._smallest_angle(self._corner[one]), self._smallest_angle(self._corner[two]))
        if min(self._smallest_angle(part) for part in parts) <= before + 1e-6:
            return False
        for old in (one, two):
            for side in _rim(self._corner[old]):
                self._half.pop(side, None)
        for t, part in zip((one, two), parts, strict=True):
            self._corner[t] = part
            self._half.update(dict.fromkeys(_rim(part), t))
        return True

    def _smallest_angle(self, corner: _Triangle) -> float:
        sides = sorted(math.dist(self._position(a), self._position(b)) for a, b in _rim(corner))
        if sides[0] <= 0:
            return 0.0
        cosine = (sides[1] ** 2 + sides[2] ** 2 - sides[0] ** 2) / (2 * sides[1] * sides[2])
        return math.acos(min(1.0, max(-1.0, cosine)))


def _rim(corner: _Triangle) -> tuple[tuple[int, int], tuple[int, int], tuple[int, int]]:
    a, b, c = corner
    return (a, b), (b, c), (c, a)


def _twice_area(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return twice the signed area of a triangle in the plane, positive if it is counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _crosses(place: Place) -> InputError:
    named = ", ".join(str(v) for v in sorted(place))
    return InputError(f"the path crosses itself near vertex {named}; draw it so that it does not")
