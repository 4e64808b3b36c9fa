"""The certificate that a layout is injective: no place of the plane is covered twice.

A layout covers each place as often as its border winds around it, provided that no face is mirrored. So it is injective if its border is
simple, if no face is mirrored, and if the faces go once around every inner vertex. Components lie in the plane independently: each
is certified on its own. All tests are exact up to the rounding of double precision.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray, IndexArray, IntArray
from warpflat.flat.surface.cells import CellArrays, make_cells
from warpflat.flat.surface.connectivity import border_of, coincident_vertices, components_of
from warpflat.flat.surface.half_edges import half_edges_of
from warpflat.flat.surface.mesh import Surface, once_per_faces, once_per_surface
from warpflat.flat.surface.triangles import corner_triangles

__all__ = [
    "BorderEdges",
    "border_edges_of",
    "certify",
    "crack_edges_of",
    "is_injective",
    "is_wound_once",
    "near_edges",
    "overlap_area",
    "winds_twice",
]

# The direction in which a line sweeps across border edges: aslant, since sides of pieces are upright or level.
_SWEEP = np.array([0.83, 0.56])
# Two edges lie on both sides of one cut if at least this share of the border between them belongs to its sides.
_CUT_SHARE = 0.5
# A smaller overlap, as a share of the area, may be a rounding error.
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class BorderEdges:
    """The edges of a surface's border, loop after loop, in the direction in which the faces run.

    Attributes:
        tail, head: #B, the ends of each edge; each border vertex is the tail of one edge.
        first, count: #B, where the loop of each edge begins, and how many edges it has.
        component: #B, the connected component of each edge.
    """

    tail: IntArray
    head: IntArray
    first: IntArray
    count: IntArray
    component: IntArray


@once_per_faces
def border_edges_of(surface: Surface) -> BorderEdges:
    """Return the edges of a surface's border, computed once per array of faces."""
    sides = half_edges_of(surface)
    alone = np.flatnonzero(sides.count[sides.edge] == 1)
    side = dict(zip(sides.tail[alone].tolist(), alone.tolist(), strict=True))
    order: list[int] = []
    counts: list[int] = []
    while side:
        seed = next(iter(side))
        here, before = seed, len(order)
        while here in side:
            order.append(side.pop(here))
            here = int(sides.head[order[-1]])
        counts.append(len(order) - before)
    count = np.repeat(counts, counts).astype(np.int32)
    begin = np.cumsum(counts) - counts
    return BorderEdges(
        tail=sides.tail[order],
        head=sides.head[order],
        first=np.repeat(begin, counts).astype(np.int32),
        count=count,
        component=components_of(surface)[sides.face[order]],
    )


@once_per_surface
def crack_edges_of(surface: Surface) -> BoolArray:
    """Return #B, whether a border edge is a side of a crack: on the body another border edge runs along it the other way."""
    edges = border_edges_of(surface)
    place = coincident_vertices(surface.vertices, surface.faces, border=np.unique(edges.tail))
    ends = place[edges.tail] * np.int64(len(place)) + place[edges.head]
    return np.isin(ends, place[edges.head] * np.int64(len(place)) + place[edges.tail])


def near_edges(edges: BorderEdges, positions: FloatArray, reach: float) -> tuple[IndexArray, IndexArray]:
    """Return pairs i < j of border edges of one component whose bounding boxes come within `reach` [m] of each other."""
    a, b = positions[edges.tail], positions[edges.head]
    low, high = np.minimum(a, b) - 0.5 * reach, np.maximum(a, b) + 0.5 * reach
    # A line sweeps across the boxes.
    begin = low @ _SWEEP
    order = np.argsort(begin, kind="stable")
    passed = np.searchsorted(begin[order], (high @ _SWEEP)[order], side="right")
    at = np.arange(len(order))
    count = passed - at - 1
    i = np.repeat(at, count)
    j = i + 1 + np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    i, j = order[i], order[j]
    meet = _boxes_meet(low[i], high[i], low[j], high[j])
    i, j = i[meet], j[meet]
    alike = edges.component[i] == edges.component[j]
    i, j = i[alike], j[alike]
    return np.minimum(i, j), np.maximum(i, j)


def _boxes_meet(low_a: FloatArray, high_a: FloatArray, low_b: FloatArray, high_b: FloatArray) -> BoolArray:
    return np.asarray(((low_a <= high_b) & (low_b <= high_a)).all(axis=-1))


def crossings(
    edges: BorderEdges, positions: FloatArray, near: tuple[IndexArray, IndexArray] | None = None
) -> tuple[IndexArray, IndexArray]:
    """Return pairs of border edges of one component that cross or touch, and pairs of neighbours that lie on each other.

    Args:
        edges: the border.
        positions: #V by 2 [m].
        near: pairs among which to look, of `near_edges`.
    """
    i, j = near_edges(edges, positions, 0.0) if near is None else near
    apart = (edges.head[i] != edges.tail[j]) & (edges.head[j] != edges.tail[i])
    i, j = i[apart], j[apart]
    a, b, c, d = (positions[end] for end in (edges.tail[i], edges.head[i], edges.tail[j], edges.head[j]))
    meet = (_side(a, b, c) * _side(a, b, d) <= 0) & (_side(c, d, a) * _side(c, d, b) <= 0)
    # Edges on one line touch only where their boxes do.
    meet &= _boxes_meet(np.minimum(a, b), np.maximum(a, b), np.minimum(c, d), np.maximum(c, d))
    i, j = i[meet], j[meet]
    at = np.arange(len(edges.tail))
    after = edges.first + (at - edges.first + 1) % edges.count
    a, b, c = (positions[end] for end in (edges.tail, edges.head, edges.head[after]))
    back = np.flatnonzero((_side(a, b, c) == 0) & (np.einsum("ij,ij->i", b - a, c - b) < 0))
    return np.concatenate([i, back]), np.concatenate([j, after[back]])


def _side(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return the sign of each c's side of the line from a to b, #N: 1 to the left."""
    return np.asarray(np.sign((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])))


def _no_face_is_mirrored(surface: Surface, positions: FloatArray) -> bool:
    return bool(make_cells(surface).least_shares(positions).min() > 0.0)


def is_wound_once(surface: Surface, positions: FloatArray) -> bool:
    """Return whether the faces go once around each inner vertex, where no face is mirrored.

    Around such a vertex, once is one corner through which a ray to the right passes.
    """
    faces, is_quad = surface.faces, surface.is_quad
    some, few = is_quad.any(), not is_quad.all()
    passed = []
    for polygons in ([faces[is_quad] if few else faces] if some else []) + ([faces[~is_quad, :3]] if few else []):
        y = positions[:, 1][polygons]
        for k in range(polygons.shape[1]):
            after = (k + 1) % polygons.shape[1]
            passed.append(polygons[(y[:, after] < y[:, k]) & (y[:, k - 1] >= y[:, k]), k])
    count = np.bincount(np.concatenate(passed), minlength=len(positions))
    count[border_edges_of(surface).tail] = 0
    return bool(count.max() <= 1)


def is_injective(surface: Surface, positions: FloatArray) -> bool:
    """Return whether a layout (#V by 2 [m]) covers no place twice: its border is simple, no face is mirrored, no vertex wound twice."""
    edges = border_edges_of(surface)
    return (
        len(crossings(edges, positions)[0]) == 0
        and _no_face_is_mirrored(surface, positions)
        and is_wound_once(surface, positions)
    )


def certify(surface: Surface, positions: FloatArray, cut_sides: IntArray) -> bool:
    """Return whether a layout is injective but for cuts whose sides touch or lie over each other.

    Such a cut is no dart, as its measure says (`warpflat.flat.surface.cut.dart`): it needs more cloth, not less.

    Args:
        surface: the piece, cut.
        positions: #V by 2 [m].
        cut_sides: the vertices on the sides of the cuts that have been made.
    """
    edges = border_edges_of(surface)
    i, j = crossings(edges, positions)
    if len(i):
        # Each pair of edges that cross must lie on both sides of one cut, or at its mouth.
        of_cut = crack_edges_of(surface) & np.isin(edges.tail, cut_sides) & np.isin(edges.head, cut_sides)
        sums = np.concatenate([[0], np.cumsum(of_cut)])
        low, high = np.minimum(i, j), np.maximum(i, j)
        first, count = edges.first[low], edges.count[low]
        inside, between = sums[high + 1] - sums[low], high + 1 - low
        outside = sums[first + count] - sums[first] - (sums[high] - sums[low + 1])
        shares = np.maximum(inside / between, outside / np.maximum(count - between + 2, 1))
        if not ((first == edges.first[high]) & (shares >= _CUT_SHARE)).all():
            return False
    return _no_face_is_mirrored(surface, positions) and is_wound_once(surface, positions)


def overlap_area(surface: Surface, positions: FloatArray, cut_sides: IntArray) -> float:
    """Return the area that a layout covers more than once [m2]: 0 if it is certified, or if parts of it only touch.

    See `certify` for the arguments.
    """
    import shapely

    if certify(surface, positions, cut_sides):
        return 0.0

    component, total, overlap = components_of(surface), 0.0, 0.0
    edges, folded = border_edges_of(surface), not _no_face_is_mirrored(surface, positions)
    for number in range(int(component.max()) + 1):
        faces = surface.faces[component == number]
        cells = shapely.polygons(positions[np.where(faces < 0, faces[:, :1], faces)])
        area = float(shapely.area(cells).sum())
        total += area
        if folded:
            cells = cells[shapely.is_valid(cells)]
            overlap += float(shapely.area(cells).sum()) - float(shapely.union_all(cells).area)
        else:
            here = edges.component == number
            # The area around which the border winds more than once, as often as it does so again [m2].
            tail = positions[edges.tail[here]]
            head = positions[edges.head[here]]
            parts = shapely.get_parts(
                shapely.polygonize([shapely.union_all(shapely.linestrings(np.stack([tail, head], axis=1)))])
            )
            x, y = shapely.get_coordinates(shapely.point_on_surface(parts)).T[:, :, None]
            along = head - tail
            left = along[:, 0] * (y - tail[:, 1]) > along[:, 1] * (x - tail[:, 0])
            upwards, downwards = (tail[:, 1] <= y) & (y < head[:, 1]), (head[:, 1] <= y) & (y < tail[:, 1])
            winding = (upwards & left).sum(axis=1) - (downwards & ~left).sum(axis=1)
            overlap += float(shapely.area(parts) @ np.maximum(winding - 1, 0))
    return overlap if overlap > _ROUNDING * total else 0.0


def winds_twice(surface: Surface, cells: CellArrays, positions: FloatArray) -> bool:
    """Return whether the faces wind more than once around an inner vertex, or by more than a full turn around a border vertex.

    Every cell may be the right way up and the layout be a staircase all the same. A quad's corner is one of its four cells.
    """
    corner, _, weight = corner_triangles(cells.faces)
    # Around an inner vertex, once is one corner through which a ray to the right passes.
    in_question = np.zeros(len(positions), dtype=bool)
    in_question[border_of(surface)] = True
    y, triangle = np.take(positions[:, 1], corner.T), weight == 1.0
    passed = np.zeros(len(positions), dtype=np.int64)
    for k in range(3):
        passes = (y[k - 2] < y[k]) & (y[k - 1] >= y[k])
        passed += np.bincount(corner[passes if k == 1 else passes & triangle, k], minlength=len(passed))
    in_question |= passed > 1
    turn = np.zeros(len(positions))
    for k in range(3):
        rows = np.flatnonzero(in_question[corner[:, k]] if k == 1 else in_question[corner[:, k]] & triangle)
        p = positions[np.roll(corner[rows], -k, axis=1)]
        u, v = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
        angle = np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], np.einsum("ij,ij->i", u, v))
        turn += np.bincount(corner[rows, k], angle, minlength=len(turn))
    return bool((turn > 2 * np.pi + 1e-6).any())
