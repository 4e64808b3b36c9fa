"""Borders that nearly meet are made to meet: afterwards both sides of a seam have the same vertices.

Two borders run along each other where they keep within a tolerance. Vertices of both that belong together, by their distance, become one
place. A vertex that has none on the other side gets one: it is set into the border edge that it faces.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from warpflat.core import FloatArray, IntArray, arc_lengths
from warpflat.flat import Surface, area_vectors, border_loops, join_labels
from warpflat.pattern import BORDERS_MEET

__all__ = ["SAME_PLACE", "meet_borders"]

#: Points nearer to each other than this [m] are at one place in space.
SAME_PLACE = 1e-5
# Of one border only places that lie within this share of the tolerance can meet, and further apart along it than so many times that far:
# an open wedge stays open.
_OWN, _APART = 0.1, 8.0
# Vertices further from each other than this share of the edges there are no pair: each gets a place on the other side.
_PAIR = 0.45
# A vertex is set into an edge no nearer to its ends than this share of it.
_OFF_ENDS = 0.02


def meet_borders(surfaces: Sequence[Surface], tolerance: float = BORDERS_MEET) -> tuple[list[Surface], list[str]]:
    """Return the surfaces with borders that agree vertex by vertex where they run along each other, and notes on what was done.

    Args:
        surfaces: the pieces of a garment, without feature lines.
        tolerance: largest distance of borders that belong together [m]; 0 leaves all as they are.
    """
    rings = [(number, ring) for number, surface in enumerate(surfaces) for ring in border_loops(surface.faces)]
    if tolerance <= 0.0 or not rings:
        return list(surfaces), []
    borders = _Borders(surfaces, rings, tolerance)
    at_vertex, at_middle = borders.near(0.0), borders.near(0.5)
    # A vertex takes part where one of its edges runs along the other border.
    runs: list[set[int]] = [set() for _ in at_vertex]
    for edge, other in enumerate(borders.after.tolist()):
        along = at_vertex[edge].keys() & at_vertex[other].keys() & at_middle[edge].keys()
        runs[edge] |= along
        runs[other] |= along
    joined, taken = borders.pair(runs)
    points = borders.points
    label = join_labels(len(points), *np.array(joined, dtype=np.int64).reshape(-1, 2).T)
    size = np.bincount(label)
    mean = np.stack([np.bincount(label, points[:, k]) for k in range(3)], axis=1) / size[:, None]
    target = mean[label]
    # What lies at one place stays where it is.
    spread = np.zeros(len(size))
    np.maximum.at(spread, label, np.linalg.norm(points - target, axis=1))
    target = np.where((spread[label] <= SAME_PLACE)[:, None], points, target)
    # A place of its own in the edge that it faces, for each vertex without a partner there.
    inserts = defaultdict[int, dict[int, tuple[float, int]]](dict)
    for one, others in enumerate(runs):
        for border in others:
            _, edge, foot = at_vertex[one].get(border, (0.0, 0, 0.0))
            if border in at_vertex[one] and (one, border) not in taken and _OFF_ENDS < foot < 1.0 - _OFF_ENDS:
                inserts[edge][int(label[one])] = (foot, one)
    made, moved, added, farthest = list[Surface](), 0, 0, 0.0
    for number, surface in enumerate(surfaces):
        mine = np.flatnonzero(borders.owner == number)
        vertices = surface.vertices.copy()
        vertices[borders.vertex[mine]] = target[mine]
        before, after = (area_vectors(points, surface.faces) for points in (surface.vertices, vertices))
        turned = (before * after).sum(axis=1) <= 0.0
        if turned.any():  # a face too small for that
            kept = np.unique(surface.faces[turned])
            vertices[kept[kept >= 0]] = surface.vertices[kept[kept >= 0]]
        step = np.linalg.norm(vertices - surface.vertices, axis=1)
        moved += int((step > 0.0).sum())
        farthest = max(farthest, float(step.max()))
        places = dict[tuple[int, int], list[FloatArray]]()
        for edge in mine.tolist():
            last, ends = 0.0, (int(borders.vertex[edge]), int(borders.vertex[borders.after[edge]]))
            for foot, one in sorted(inserts.get(edge, {}).values()):
                if foot - last > _OFF_ENDS:
                    places.setdefault(ends, []).append(target[one])
                    last = foot
        added += sum(map(len, places.values()))
        made.append(_with_places(surface, vertices, places) if places or step.any() else surface)
    if not moved and not added:
        return made, []
    return made, [
        f"borders within {1e3 * tolerance:g} mm of each other were made to meet: {moved:,} of their vertices moved by at most "
        f"{1e3 * farthest:.2g} mm, {added:,} added"
    ]


class _Borders:
    """The vertices of all borders (#B), loop after loop, and the edge from each to the next.

    Attributes:
        owner, vertex: the surface, and the vertex there.
        loop: the number of its border. after: the next one along it.
        points: #B by 3 [m].
    """

    def __init__(self, surfaces: Sequence[Surface], rings: Sequence[tuple[int, IntArray]], tolerance: float) -> None:
        from scipy.spatial import cKDTree

        self._tolerance = tolerance
        counts = [len(ring) for _, ring in rings]
        begin, count = np.repeat(np.cumsum(counts) - counts, counts), np.repeat(counts, counts)
        self.owner = np.repeat([number for number, _ in rings], counts)
        self.vertex = np.concatenate([ring for _, ring in rings])
        self.loop = np.repeat(np.arange(len(rings)), counts)
        self.after = begin + (np.arange(len(begin)) - begin + 1) % count
        rows = [surfaces[number].vertices[ring] for number, ring in rings]
        self.points = np.concatenate(rows)
        self._way = self.points[self.after] - self.points
        self._length = np.linalg.norm(self._way, axis=1)
        # Where along its border each lies, and how long that is around [m].
        arcs = [arc_lengths(row, closed=True) for row in rows]
        self._at = np.concatenate([arc[:-1] for arc in arcs])
        self._around = np.repeat([arc[-1] for arc in arcs], counts)
        # Places along all edges, no further from each other than the tolerance, find the edges near a point.
        steps = np.minimum(np.maximum(np.ceil(self._length / tolerance), 1), 1000).astype(np.int64)
        self._of = np.repeat(np.arange(len(steps)), steps)
        share = (np.arange(len(self._of)) - np.repeat(np.cumsum(steps) - steps, steps) + 0.5) / steps[self._of]
        self._tree = cKDTree(self.points[self._of] + share[:, None] * self._way[self._of])
        self._reach = tolerance + 0.5 * float((self._length / steps).max())

    def near(self, share: float) -> list[dict[int, tuple[float, int, float]]]:
        """Return for the place at a share of each edge the nearest one of every border that is near: its distance, edge and share."""
        found, length, way = [], self._length, self._way
        places, along = self.points + share * way, self._at + share * length
        for edge, tried in enumerate(self._tree.query_ball_point(places, self._reach)):
            edges = np.unique(self._of[tried])
            gap = np.abs(self._at[edges] + 0.5 * length[edges] - along[edge])
            gap = np.minimum(gap, self._around[edges] - gap) - 0.5 * length[edges]
            to = places[edge] - self.points[edges]
            foot = np.clip(
                (to * way[edges]).sum(axis=1) / np.maximum(length[edges] ** 2, np.finfo(float).tiny), 0.0, 1.0
            )
            away = np.linalg.norm(to - foot[:, None] * way[edges], axis=1)
            own = self.loop[edges] == self.loop[edge]
            away[own & ((away > _OWN * self._tolerance) | (gap <= _APART * away + SAME_PLACE))] = np.inf
            best: dict[int, tuple[float, int, float]] = {}
            for k in np.argsort(-away, kind="stable").tolist():
                if away[k] <= self._tolerance:
                    best[int(self.loop[edges[k]])] = (float(away[k]), int(edges[k]), float(foot[k]))
            found.append(best)
        return found

    def pair(self, runs: Sequence[set[int]]) -> tuple[list[tuple[int, int]], set[tuple[int, int]]]:
        """Return pairs of vertices that belong together, the nearest first, and for each of both the border on which it has a partner.

        Args:
            runs: for each vertex the borders along which it runs.
        """
        from scipy.spatial import cKDTree

        a, b = cKDTree(self.points).query_pairs(self._tolerance, output_type="ndarray").T
        apart = np.abs(self._at[a] - self._at[b])
        apart, away = (
            np.minimum(apart, self._around[a] - apart),
            np.linalg.norm(self.points[a] - self.points[b], axis=1),
        )
        own_border = (away <= _OWN * self._tolerance) & (apart > _APART * away + SAME_PLACE)
        least = self._length.copy()
        least[self.after] = np.minimum(least[self.after], self._length)
        fits = ((self.loop[a] != self.loop[b]) | own_border) & (
            away <= np.maximum(_PAIR * np.minimum(least[a], least[b]), SAME_PLACE)
        )
        a, b, away, loop = a[fits], b[fits], away[fits], self.loop.tolist()
        taken, joined = set[tuple[int, int]](), list[tuple[int, int]]()
        for k in np.argsort(away, kind="stable").tolist():
            one, other = int(a[k]), int(b[k])
            ends = (one, loop[other]), (other, loop[one])
            if loop[other] in runs[one] and loop[one] in runs[other] and taken.isdisjoint(ends):
                taken.update(ends)
                joined.append((one, other))
        return joined, taken


def _with_places(
    surface: Surface, vertices: FloatArray, places: Mapping[tuple[int, int], Sequence[FloatArray]]
) -> Surface:
    """Return a surface with moved vertices (#V by 3 [m]) and new ones at places set into border edges, in their direction."""
    faces = [[corner for corner in face if corner >= 0] for face in surface.faces.tolist()]
    face_at = {(face[k - 1], face[k]): row for row, face in enumerate(faces) for k in range(len(face))}
    extra = np.array([place for row in places.values() for place in row]).reshape(-1, 3)
    first = len(vertices)
    for (tail, head), row in places.items():
        chain = [tail, *range(first, first + len(row)), head]
        first += len(row)
        at = face_at[tail, head]
        face = faces[at]
        turn = face.index(tail)
        rest = [*face[turn:], *face[:turn]][2:]
        # A fan around the corner before the edge; a quad keeps its last part.
        parts = [[chain[k], chain[k + 1], rest[-1]] for k in range(len(chain) - 1)]
        parts[-1] = [chain[-2], head, *rest]
        for k, part in enumerate(parts):
            where = at if k == 0 else len(faces)
            faces[where : where + 1] = [part]
            face_at.update({(part[j - 1], part[j]): where for j in range(len(part))})
    table = np.full((len(faces), 4), -1, dtype=np.int32)
    for number, face in enumerate(faces):
        table[number, : len(face)] = face
    index = len(surface.input_vertices) + np.arange(len(extra))
    return replace(
        surface,
        vertices=np.vstack([vertices, extra]),
        faces=table,
        input_vertices=np.vstack([surface.input_vertices, extra]),
        input_index=np.concatenate([surface.input_index, index]).astype(np.int32),
    )
