"""Development: the first, unrelaxed layout of a piece, from a datum line (paper, section IV.B).

The first way that leaves no face mirrored: a flat piece as it lies, along the profiles of a quad grid, by geodesic distance from
the datum line, and, where both fold too much to be mended, a harmonic map onto a disk, which cannot. Cracks are closed for
profiles and distances, where that helps.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.polyline import arc_lengths
from warpflat.flat.flattening.harmonic_layout import harmonic_layout, refuse_tubes
from warpflat.flat.solver.collapse import Coarsening, iterate_coarsenings
from warpflat.flat.surface.cells import LEAST_AREA, CellArrays, make_cells
from warpflat.flat.surface.connectivity import (
    border_of,
    coincident_vertices,
    euler_characteristic,
    non_manifold_vertices,
)
from warpflat.flat.surface.half_edges import half_edges, half_edges_of, opposite_half_edges
from warpflat.flat.surface.injective import winds_twice
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.normals import area_vectors
from warpflat.flat.surface.paths.geodesic import signed_distance_and_station
from warpflat.flat.surface.triangles import corner_triangles, triangulate
from warpflat.flat.surface.untangle import signed_cell_areas, untangle
from warpflat.flat.surface.vectors import norm, points_at

__all__ = [
    "Development",
    "close_cracks",
    "develop",
    "flat_layout",
    "geodesic_layout",
    "profile_layout",
    "turn_upright",
]


# A piece is flat if it leaves its plane by no more than this share of its size, the rounding of single precision.
_FLAT = 1e-5
_FEW_VERTICES = 100
_GOLDEN = 0.6180339887498949
# A development is repaired rather than given up if at most this share of its faces is mirrored.
_FEW = 0.1
# Repairing at most this many faces, or this share of them, does not change the directions of the whole.
_MENDED = 5
_MENDED_SHARE = 1e-3
# A layout with a larger share of mirrored cells is repaired only after smoother ones have been tried.
_SOON_TURNED_BACK = 5e-3
# The layout of a piece with more vertices than this is also smoothed by coarser meshes.
_LARGE = 5000


@dataclass(frozen=True, kw_only=True)
class Development:
    """A first layout without mirrored faces.

    Attributes:
        positions: #V by 2 [m], the datum along +y.
        method: "flat", "profiles", "geodesic", "conformal" or "harmonic"; "coarse" where it is the layout of a coarser mesh, "given" where
            it is the user's.
        as_rigid: whether it is what as-rigid iterations have made of that (`warpflat.flat.flattening.start`).
        mended: whether it says little of directions: many faces had to be turned back, or it is no development.
        notes: why a way was not taken, one sentence each.
    """

    positions: FloatArray
    method: str
    as_rigid: bool = False
    mended: bool = False
    notes: tuple[str, ...] = ()

    @property
    def start(self) -> str:
        """The layout from which the piece is relaxed, as text."""
        if self.method == "given":
            return "the layout given"
        if self.method == "coarse":
            return "the layout of a coarser mesh"
        layout = "a conformal map" if self.method == "conformal" else f"the {self.method} development"
        return f"{'as-rigid iterations from ' if self.as_rigid else ''}{layout}"


def develop(surface: Surface, datum: IntArray) -> Development:
    """Develop a surface from its datum line.

    Args:
        surface: one piece.
        datum: vertex indices along edges; laid along +y at its arc lengths.

    Raises:
        InputError: the surface is a closed tube (two borders around it), which no layout in the plane can be.
    """
    notes: list[str] = []
    cells = make_cells(surface)
    flat = flat_layout(surface, datum)
    if flat is not None and len(_mirrored(cells, flat)) == 0:
        return Development(positions=flat, method="flat")
    methods = (("profiles", profile_layout), ("geodesic", geodesic_layout))
    closed = close_cracks(surface, datum)
    if closed is not None:
        whole, index = closed
        for method, layout in methods:
            positions = layout(whole, index[datum])
            if positions is not None and len(_mirrored(cells, positions[index])) == 0:
                notes.append("developed with its cracks closed")
                return Development(positions=positions[index], method=method, notes=tuple(notes))
    for method, layout in methods:
        positions = layout(surface, datum)
        if positions is None:
            continue
        mirrored = _mirrored(cells, positions)
        if len(mirrored) == 0:
            return Development(positions=positions, method=method, notes=tuple(notes))
        folded = len(np.unique(cells.face[mirrored]))
        notes.append(f"the {method} development mirrors or crushes {folded:,} of {len(surface.faces):,} faces")
        if folded > _FEW * len(surface.faces):
            continue
        for start, mirrored in _starts(surface, cells, positions):
            mended, left = untangle(surface, start, least_area=LEAST_AREA, suspects=mirrored)
            if left == 0 and not winds_twice(surface, cells, mended):
                smoothed = "" if start is positions else "smoothed by a coarser mesh and "
                notes.append(f"they were {smoothed}turned back, with a few faces around them")
                turned = len(np.unique(cells.face[mirrored]))
                much = turned > max(_MENDED, _MENDED_SHARE * len(surface.faces))
                return Development(positions=mended, method=method, mended=much, notes=tuple(notes))
    refuse_tubes(surface)
    positions = turn_upright(harmonic_layout(surface), datum)
    notes.append("started from a harmonic map onto a disk instead, which cannot fold")
    return Development(positions=positions, method="harmonic", mended=True, notes=tuple(notes))


def _starts(
    surface: Surface, cells: CellArrays, positions: FloatArray
) -> Iterator[tuple[FloatArray, NDArray[np.int64]]]:
    """A layout and its smoother ones with the cells that are mirrored in them, those with few first: many take long to turn back, and
    often cannot be."""
    many = []
    for start in _smoother(surface, positions):
        mirrored = _mirrored(cells, start)
        if len(mirrored) <= max(_MENDED, _SOON_TURNED_BACK * len(cells.laid)):
            yield start, mirrored
        else:
            many.append((start, mirrored))
    yield from many


def _smoother(surface: Surface, positions: FloatArray) -> Iterator[FloatArray]:
    """Yield a layout, and for a large piece smoother ones that interpolate it from coarser and coarser meshes.

    From neighbour to neighbour stations waver, by a larger share of an edge the finer the mesh is; that may fold many small faces.
    """
    yield positions
    if len(surface.vertices) > _LARGE:
        kept, steps = positions, list[Coarsening]()
        for step in iterate_coarsenings(surface):
            kept = kept[step.kept]
            steps.insert(0, step)
            smooth = kept
            for way_up in steps:
                smooth = way_up.prolongation @ smooth
            yield smooth


def close_cracks(surface: Surface, datum: IntArray) -> tuple[Surface, IntArray] | None:
    """Return the surface with border vertices at one place merged, and for each vertex its number there.

    None where there is no crack, and where what is closed is none but a seam: it would make a tube of a piece, or parts touch
    that do not belong together.
    """
    place = coincident_vertices(surface.vertices, surface.faces, border=border_of(surface))
    here = np.arange(len(place))
    moves = place != here
    if not moves.any() or len(np.unique(place[datum])) < len(datum):
        return None
    joined = np.zeros(len(place), dtype=bool)
    joined[place[moves]] = joined[moves] = True
    # Elsewhere nothing changes, so faces around these tell everything.
    before = surface.faces[joined[surface.faces].any(axis=1)]
    after = np.where(before >= 0, place[before], -1).astype(np.int32)
    he = half_edges(after)
    runs_once = len(np.unique(he.tail * np.int64(len(place)) + he.head)) == len(he.tail)
    if not runs_once or joined[non_manifold_vertices(after)].any():
        return None
    if euler_characteristic(after) < euler_characteristic(before):
        return None
    kept = here[~moves]
    number = np.empty(len(place), dtype=np.int32)
    number[kept] = np.arange(len(kept))
    index = number[place]
    whole = replace(
        surface,
        vertices=surface.vertices[kept],
        faces=np.where(surface.faces >= 0, index[surface.faces], np.int32(-1)),
        lines={},
        input_index=surface.input_index[kept],
    )
    return whole, index


def _mirrored(cells: CellArrays, positions: FloatArray) -> NDArray[np.int64]:
    """Return the cells that are mirrored or nearly collapsed."""
    if (cells.least_shares(positions) > LEAST_AREA).all():
        return np.empty(0, dtype=np.int64)
    corner, _, weight = corner_triangles(cells.faces)
    return np.flatnonzero(signed_cell_areas(corner, positions) * weight <= LEAST_AREA * cells.area)


def flat_layout(surface: Surface, datum: IntArray) -> FloatArray | None:
    """Return the layout (#V by 2 [m]) of a piece that is flat already, the datum's chord upwards; None if it is not flat."""
    # Most do not, and a few of their vertices tell: by golden sections of their number, since every so many are one row or column.
    some = surface.vertices[(np.arange(_FEW_VERTICES) * _GOLDEN % 1.0 * len(surface.vertices)).astype(int)]
    away = some - some.mean(axis=0)
    strays = np.sqrt(max(np.linalg.eigvalsh(away.T @ away)[0], 0.0))
    if strays > np.sqrt(_FEW_VERTICES) * 4 * _FLAT * np.linalg.norm(np.ptp(some, axis=0)):
        return None
    triangles, _ = triangulate(surface.faces)
    facing = area_vectors(surface.vertices, triangles).sum(axis=0)
    away = surface.vertices - surface.vertices.mean(axis=0)
    if (
        np.ptp(away @ facing) > _FLAT * np.linalg.norm(np.ptp(away, axis=0)) * np.linalg.norm(facing)
        or not facing.any()
    ):
        return None
    right = np.cross(np.eye(3)[np.abs(facing).argmin()], facing)
    axes = np.column_stack([right, np.cross(facing, right)])
    return turn_upright(away @ (axes / np.linalg.norm(axes, axis=0)), datum)


def profile_layout(surface: Surface, datum: IntArray) -> FloatArray | None:
    """Lay out a piece of bricks: the datum straight at its arc lengths, and each profile to both sides, parallel.

    The profiles are the grid lines of a quad mesh that cross the datum; a vertex lies at its arc length along its profile,
    beside the place of the datum where that starts.

    Returns:
        #V by 2 [m], or None where the mesh is no grid of quads that the datum's profiles cover.
    """
    if not surface.is_quad.all() or datum[0] == datum[-1]:
        return None
    station = arc_lengths(surface.vertices[datum])
    positions = np.full((len(surface.vertices), 2), np.nan)
    positions[datum] = np.column_stack([np.zeros(len(datum)), station])
    # The grid lines to the left of the datum, and to the left of it as it runs back; -1 where the grid has ended.
    start = np.stack([datum, datum[::-1]])
    he = half_edges_of(surface)
    here = np.arange(len(he.tail))
    # The last entry is where there is none, -1.
    twin, tail, head = (np.append(index, -1) for index in (opposite_half_edges(he), he.tail, he.head))
    some = np.empty(len(he.edges), dtype=np.int64)
    some[he.edge] = here
    size = np.int64(len(surface.vertices))
    keys = he.edges[:, 0] * size + he.edges[:, 1]

    def along(a: NDArray[np.integer], b: NDArray[np.integer]) -> NDArray[np.int64]:
        wanted = np.minimum(a, b) * size + np.maximum(a, b)
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        h = some[place]
        return np.where((a < 0) | (b < 0) | (keys[place] != wanted), -1, np.where(tail[h] == a, h, twin[h]))

    rows = [start]
    edge, left = along(start[:, :-1], start[:, 1:]), len(surface.vertices)
    # No more lines than there are vertices for: where profiles meet again, or go around a tube, they would have no end.
    while left > 0:
        # Of the four sides of a quad, numbered in a row, the one opposite.
        ahead = np.where(edge >= 0, edge ^ 2, -1)
        over_tail, over_head = head[ahead], tail[ahead]
        following = np.empty_like(start)
        following[:, :1], following[:, -1:] = over_tail[:, :1], over_head[:, -1:]
        following[:, 1:-1] = np.where(over_head[:, :-1] >= 0, over_head[:, :-1], over_tail[:, 1:])
        clash = (over_tail[:, 1:] != following[:, 1:-1]) & (over_tail[:, 1:] >= 0)
        following[clash.any(axis=1)] = -1
        reached = int(np.count_nonzero(following >= 0))
        if reached == 0:
            break
        rows.append(following)
        left -= reached
        edge = twin[ahead]
        if (edge < 0).any():
            # Past a hole the line goes on.
            edge = along(following[:, :-1], following[:, 1:])
    lines = np.stack(rows)
    stations = np.stack([station, station[::-1]])
    p = points_at(surface.vertices, lines)
    on = lines[1:] >= 0
    across = np.cumsum(np.where(on, norm(p[:, 1:] - p[:, :-1]), 0.0), axis=0) * np.array([[-1.0], [1.0]])
    positions[lines[1:][on]] = np.column_stack([across[on], np.broadcast_to(stations, across.shape)[on]])
    whole = len(datum) + np.count_nonzero(on) == len(positions)
    return positions if whole and not np.isnan(positions).any() else None


def geodesic_layout(surface: Surface, datum: IntArray) -> FloatArray | None:
    """Lay out any mesh (#V by 2 [m]): x is the signed geodesic distance from the datum, y the arc length of the nearest datum point."""
    positions = np.column_stack(signed_distance_and_station(surface, datum))
    return positions if np.isfinite(positions).all() else None


def turn_upright(positions: FloatArray, datum: IntArray) -> FloatArray:
    """Turn a layout so that the datum's chord points up, and shift its first point to the origin."""
    chord = positions[datum[-1]] - positions[datum[0]]
    length = float(np.hypot(*chord))
    c, s = (chord[1] / length, chord[0] / length) if length > 0 else (1.0, 0.0)
    return (positions - positions[datum[0]]) @ np.array([[c, -s], [s, c]]).T
