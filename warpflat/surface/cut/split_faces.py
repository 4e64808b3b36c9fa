"""Faces split along a path, so that the path becomes a row of mesh edges and a cut along it is straight."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.surface.cut.refine import Refinement
from warpflat.surface.half_edges import border_edges
from warpflat.surface.mesh import Surface
from warpflat.surface.paths.trace import Place, SurfacePath, describe_place, path_triangles

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
    places = _snap_places(surface, path, max(snap, _ROUNDING))
    refined = Refinement(surface.vertices, triangles, {v for place in places for v in place}, max(snap, _ROUNDING))
    chain = refined.insert_path(places, closed=path.closed)
    refined.improve()
    return _result(surface, refined, face_of, np.array(chain, dtype=np.int32))


def _snap_places(surface: Surface, path: SurfacePath, snap: float) -> list[Place]:
    """Move the places of a path that are near a vertex or edge onto it, and take out the detours that this closes."""
    border = _on_border(surface)
    places: list[Place] = []
    points: list[int] = []
    last = len(path.points) - 1
    for index in range(len(path.points)):
        exact = path.place(index)
        free = _without_small(exact, snap, set())
        is_end = index in (0, last) and not path.closed
        place = free if is_end else _without_small(exact, snap, border)
        if places and free == places[-1]:
            # Beside a border vertex that the path has reached already, moving onto it parts nothing.
            continue
        while is_end and len(places) > 1 and _without_small(places[-1], snap, set()) == place:
            del places[-1], points[-1]
        if place not in places:
            places.append(place)
            points.append(index)
            continue
        back = places.index(place)
        if path.closed and back == 0 and index > len(path.points) / 2:
            continue
        _check_detour(surface, path, points[back], index, place)
        del places[back + 1 :], points[back + 1 :]
    if len(places) < (3 if path.closed else 2):
        raise InputError(f"the path at {describe_place(places[0])} is too short: it lies within one snapping distance")
    return places


def _on_border(surface: Surface) -> set[tuple[int, ...]]:
    """Return the edges and the vertices of the border, as sorted tuples."""
    edges = border_edges(surface.faces)
    return {tuple(sorted(edge)) for edge in edges.tolist()} | {(v,) for v in edges.ravel().tolist()}


def _check_detour(surface: Surface, path: SurfacePath, first: int, last: int, place: Place) -> None:
    """See that a path which comes back to a place has stayed within an edge's length of it in between.

    Raises:
        InputError: it crosses itself there.
    """
    detour = path.points[first : last + 1]
    longest = max(_edge_length(surface, path.support[i]) for i in range(first, last + 1))
    if np.linalg.norm(detour - detour[0], axis=1).max() > longest:
        raise InputError(f"the path crosses itself at {describe_place(place)}; draw it so that it does not")


def _edge_length(surface: Surface, support: IntArray) -> float:
    corners = surface.vertices[support[support >= 0]]
    return float(np.linalg.norm(corners - corners[0], axis=1).max())


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


def _result(surface: Surface, refined: Refinement, face_of: IntArray, chain: IntArray) -> SplitSurface:
    """Put the divided faces, the lines through them and the maps back to the old surface together."""
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
    new = replace(
        surface,
        vertices=np.concatenate([surface.vertices, added]),
        faces=np.ascontiguousarray(faces[order]),
        lines={name: _refined_line(line, refined) for name, line in surface.lines.items()},
        input_vertices=np.concatenate([surface.input_vertices, added]),
        input_index=np.concatenate(
            [surface.input_index, len(surface.input_vertices) + np.arange(len(added), dtype=np.int32)]
        ).astype(np.int32),
    )
    return SplitSurface(
        surface=new, path=chain, vertex_support=support, vertex_weights=weights, face_origin=face_origin[order]
    )


def _refined_line(line: IntArray, refined: Refinement) -> IntArray:
    """Return a feature line with the new vertices on its edges inserted."""
    vertices = line[:1].tolist()
    for a, b in zip(line[:-1].tolist(), line[1:].tolist(), strict=True):
        vertices += [*refined.vertices_between(a, b), b]
    return np.array(vertices, dtype=np.int32)
