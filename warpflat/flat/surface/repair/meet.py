"""Borders that nearly meet are made to meet: afterwards both sides of a seam have the same vertices.

Two borders run along each other where they keep within a tolerance. Vertices of both that belong together, by their distance, become one
place. A vertex that has none on the other side gets one: it is set into the border edge that it faces.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.polyline import arc_lengths
from warpflat.flat.surface.border_seams import SAME_PLACE
from warpflat.flat.surface.connectivity import border_loops, join_labels
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.sheets import face_vectors

__all__ = ["MEET", "meet_borders"]

#: Borders that run along each other within this distance [m] are meant to meet.
MEET = 1e-3
# Of one border only places that lie within this share of the tolerance can meet, and further apart along it than so many times that far:
# an open wedge stays open.
_OWN, _APART = 0.1, 8.0
# Vertices further from each other than this share of the edges there are no pair: each gets a place on the other side.
_PAIR = 0.45
# A vertex is set into an edge no nearer to its ends than this share of it.
_OFF_ENDS = 0.02


def meet_borders(surfaces: Sequence[Surface], tolerance: float = MEET) -> tuple[list[Surface], list[str]]:
    """Return the surfaces with borders that agree vertex by vertex where they run along each other, and notes on what was done.

    Args:
        surfaces: the pieces of a garment, without feature lines.
        tolerance: largest distance of borders that belong together [m]; 0 leaves all as they are.
    """
    from scipy.spatial import cKDTree

    if tolerance <= 0.0:
        return list(surfaces), []
    owner, vertex, loop, follow, arc, around = (
        list[int](),
        list[int](),
        list[int](),
        list[int](),
        list[float](),
        list[float](),
    )
    for number, surface in enumerate(surfaces):
        for ring in border_loops(surface.faces):
            first, count = len(vertex), len(ring)
            lengths = arc_lengths(surface.vertices[np.append(ring, ring[0])])
            loop += [loop[-1] + 1 if loop else 0] * count
            owner += [number] * count
            vertex += ring.tolist()
            follow += [first + (k + 1) % count for k in range(count)]
            arc += lengths[:-1].tolist()
            around += [float(lengths[-1])] * count
    if not vertex:
        return list(surfaces), []
    points = np.array([surfaces[s].vertices[v] for s, v in zip(owner, vertex, strict=True)])
    of_loop, after = np.array(loop), np.array(follow)
    start, way = points, points[after] - points
    length = np.linalg.norm(way, axis=1)
    at, whole = np.array(arc), np.array(around)
    # Places along all edges, no further from each other than the tolerance, find the edges near a point.
    count = np.minimum(np.maximum(np.ceil(length / tolerance), 1), 1000).astype(np.int64)
    of = np.repeat(np.arange(len(points)), count)
    share = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[of]
    tree = cKDTree(start[of] + share[:, None] * way[of])
    reach = tolerance + 0.5 * float((length / count).max())

    def near(
        places: FloatArray, own: NDArray[np.int64], along: FloatArray
    ) -> list[dict[int, tuple[float, int, float]]]:
        """Return for each place the nearest place of every border within the tolerance: distance, edge, share of it."""
        found = []
        for place, edge, here, tried in zip(places, own, along, tree.query_ball_point(places, reach), strict=True):
            edges = np.unique(of[tried])
            gap = np.abs(at[edges] + 0.5 * length[edges] - here)
            gap = np.minimum(gap, whole[edges] - gap) - 0.5 * length[edges]
            to = place - start[edges]
            foot = np.clip(
                (to * way[edges]).sum(axis=1) / np.maximum(length[edges] ** 2, np.finfo(float).tiny), 0.0, 1.0
            )
            away = np.linalg.norm(to - foot[:, None] * way[edges], axis=1)
            own_border = of_loop[edges] == of_loop[edge]
            away[own_border & ((away > _OWN * tolerance) | (gap <= _APART * away + SAME_PLACE))] = np.inf
            best: dict[int, tuple[float, int, float]] = {}
            for k in np.argsort(-away, kind="stable").tolist():
                if away[k] <= tolerance:
                    best[int(of_loop[edges[k]])] = (float(away[k]), int(edges[k]), float(foot[k]))
            found.append(best)
        return found

    rows = np.arange(len(points))
    at_vertex = near(points, rows, at)
    at_middle = near(start + 0.5 * way, rows, at + 0.5 * length)
    # A vertex takes part where one of its edges runs along the other border.
    runs: list[set[int]] = [set() for _ in vertex]
    for edge, other in enumerate(follow):
        along = at_vertex[edge].keys() & at_vertex[other].keys() & at_middle[edge].keys()
        runs[edge] |= along
        runs[other] |= along
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    a, b = pairs.T
    apart = np.abs(at[a] - at[b])
    apart, away = np.minimum(apart, whole[a] - apart), np.linalg.norm(points[a] - points[b], axis=1)
    own_border = (away <= _OWN * tolerance) & (apart > _APART * away + SAME_PLACE)
    least = length.copy()
    least[after] = np.minimum(least[after], length)
    fits = ((of_loop[a] != of_loop[b]) | own_border) & (
        away <= np.maximum(_PAIR * np.minimum(least[a], least[b]), SAME_PLACE)
    )
    a, b = a[fits], b[fits]
    taken = set[tuple[int, int]]()
    joined = list[tuple[int, int]]()
    for k in np.argsort(np.linalg.norm(points[a] - points[b], axis=1), kind="stable").tolist():
        one, other = int(a[k]), int(b[k])
        ends = (one, loop[other]), (other, loop[one])
        if loop[other] in runs[one] and loop[one] in runs[other] and taken.isdisjoint(ends):
            taken.update(ends)
            joined.append((one, other))
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
    for one, borders in enumerate(runs):
        for border in borders:
            _, edge, foot = at_vertex[one].get(border, (0.0, 0, 0.0))
            if border in at_vertex[one] and (one, border) not in taken and _OFF_ENDS < foot < 1.0 - _OFF_ENDS:
                inserts[edge][int(label[one])] = (foot, one)
    made, moved, added = list[Surface](), 0, 0
    farthest = 0.0
    for number, surface in enumerate(surfaces):
        mine = [k for k, of_surface in enumerate(owner) if of_surface == number]
        ids = np.array([vertex[k] for k in mine])
        vertices = surface.vertices.copy()
        vertices[ids] = target[mine]
        turned = (face_vectors(surface.vertices, surface.faces) * face_vectors(vertices, surface.faces)).sum(
            axis=1
        ) <= 0.0
        if turned.any():  # a face too small for that
            kept = np.unique(surface.faces[turned])
            vertices[kept[kept >= 0]] = surface.vertices[kept[kept >= 0]]
        step = np.linalg.norm(vertices - surface.vertices, axis=1)
        moved += int((step > 0.0).sum())
        farthest = max(farthest, float(step.max()))
        faces = [[corner for corner in face if corner >= 0] for face in surface.faces.tolist()]
        face_at = {(face[k - 1], face[k]): row for row, face in enumerate(faces) for k in range(len(face))}
        places = list[FloatArray]()
        for edge in mine:
            new, last = list[int](), 0.0
            for foot, one in sorted(inserts.get(edge, {}).values()):
                if foot - last > _OFF_ENDS:
                    new.append(len(vertices) + len(places))
                    places.append(target[one])
                    last = foot
            if not new:
                continue
            tail, head = vertex[edge], vertex[follow[edge]]
            row = face_at[tail, head]
            face = faces[row]
            turn = face.index(tail)
            rest = [*face[turn:], *face[:turn]][2:]
            # A fan around the corner before the edge; a quad keeps its last part.
            chain = [tail, *new, head]
            parts = [[chain[k], chain[k + 1], rest[-1]] for k in range(len(chain) - 1)]
            parts[-1] = [chain[-2], head, *rest]
            for k, part in enumerate(parts):
                where = row if k == 0 else len(faces)
                faces[where : where + 1] = [part]
                face_at.update({(part[j - 1], part[j]): where for j in range(len(part))})
        added += len(places)
        if not places and not step.any():
            made.append(surface)
            continue
        table = np.full((len(faces), 4), -1, dtype=np.int32)
        for row, face in enumerate(faces):
            table[row, : len(face)] = face
        extra = np.array(places).reshape(-1, 3)
        index = len(surface.input_vertices) + np.arange(len(places))
        made.append(
            replace(
                surface,
                vertices=np.vstack([vertices, extra]),
                faces=table,
                input_vertices=np.vstack([surface.input_vertices, extra]),
                input_index=np.concatenate([surface.input_index, index]).astype(np.int32),
            )
        )
    if not moved and not added:
        return made, []
    return made, [
        f"borders within {1e3 * tolerance:g} mm of each other were made to meet: {moved:,} of their vertices moved by at most "
        f"{1e3 * farthest:.2g} mm, {added:,} added"
    ]
