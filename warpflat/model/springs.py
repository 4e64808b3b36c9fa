"""The springs of a surface: rest lengths measured on it in space, stiffnesses in N/m from the fabric.

Each quad has four structural edges and two diagonals; a triangle has its edges (Van Gelder 1998).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
import warp as wp

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.launch import launch_each
from warpflat.core.sorting import counting_sort
from warpflat.fabric.fabric import Fabric, grain_axes
from warpflat.kernels.stiffness import (
    Lattice,
    find_directions,
    find_sides,
    list_springs,
    measure_edges,
    measure_hold,
    pick_values,
    weigh_quads,
    weigh_triangles,
    weigh_waves,
)
from warpflat.surface.cells import CellArrays, cells_of, creases_of, first_of_faces
from warpflat.surface.half_edges import half_edges, half_edges_of
from warpflat.surface.mesh import Surface, once_per_faces, once_per_surface, read_only
from warpflat.surface.row_major_grid import RowMajorGrid, row_major_grid
from warpflat.surface.triangles import selected_rows, unfold_quad_diagonals

__all__ = [
    "SpringArrays",
    "SpringsAround",
    "shear_hold",
    "shortened",
    "springs_of",
    "springs_of_sides",
    "unweighed_springs",
    "with_stiffness",
]


# A shear spring stiffens tension too; a cell so long that nothing would be left for the structural spring keeps this share of it, has
# weaker shear springs, and is sheared as a whole against what they lack.
_LEAST_STRUCTURAL_SHARE = 0.05
# Where springs between triangles have just lost their hold, threads waver at no cost, and a relaxation creeps for ever; the
# guard begins at this share of it.
_HOLD_SHARE = 0.75
# Edges of quads within the first of these angles of the grain are taken for the threads, beyond the second for what they are, and between
# the two for more and more of it, so that sizes of one pattern that lie on both sides are of one cloth. Up to the second a step may
# go along them.
_ALIGNED, _OFF_GRAIN = np.deg2rad([7.5, 15.0])
_QUARTER = np.pi / 2


@dataclass(frozen=True, kw_only=True)
class SpringsAround:
    """The springs around each vertex.

    Attributes:
        offset: #V+1, where the entries of each vertex begin.
        neighbor: 2 #S, for each entry the vertex at the far end, by which they are sorted.
        numbering: what makes their numbers, or of a grid whose numbers tell them, that: they are asked for when a network is made, and
            seldom later.
    """

    offset: IntArray
    neighbor: IntArray
    numbering: Callable[[], IntArray] | RowMajorGrid

    @property
    def entry(self) -> IntArray:
        """2 #S, the springs' numbers, mesh edges first."""
        return self.numbering.springs_around(self.offset) if isinstance(self.numbering, RowMajorGrid) else self._kept

    @cached_property
    def _kept(self) -> IntArray:
        assert not isinstance(self.numbering, RowMajorGrid)
        return self.numbering()

    def forget_numbers(self) -> None:
        """Make them again when they are next asked for."""
        vars(self).pop("_kept", None)

    def listed(self, values: FloatArray) -> FloatArray:
        """2 #S, the springs' values (#S) at both of their ends."""
        if isinstance(self.numbering, RowMajorGrid):
            return self.numbering.listed(self.offset, values)
        listed = np.empty(len(self.neighbor))
        given = [self._kept, np.ascontiguousarray(values, dtype=np.float64)]
        launch_each(pick_values, len(listed), given, [listed])
        return listed

    @property
    def count(self) -> int:
        """#S."""
        return len(self.neighbor) // 2


@dataclass(frozen=True, kw_only=True)
class _Unweighed:
    """Of a surface's springs what no fabric changes, as in SpringArrays."""

    edge_count: int
    around: SpringsAround
    listed_length: FloatArray


@dataclass(frozen=True, kw_only=True)
class SpringArrays:
    """The springs as the kernels want them, each listed at both of its ends.

    Attributes:
        around: which springs there are around each vertex.
        listed_length, listed_stiffness: 2 #S, rest length [m] and stiffness [N/m] of each entry.
        edge_count: #E; the first springs are the mesh edges.
        lack: #F by 2, what the springs of long quads lack in shear, as `kernels.cells.Cells` has it; None where there are none.
        wave: #F by 4, what else holds quads against waves, likewise.
        aligned: whether there are quads, and their edges carry the threads.
        shear_excess: how many times as stiff in shear as the cloth the quads are whose edges lie across its threads; 1 without quads.
    """

    around: SpringsAround
    listed_length: FloatArray
    listed_stiffness: FloatArray
    edge_count: int
    lack: FloatArray | None = None
    wave: FloatArray | None = None
    aligned: bool = False
    shear_excess: float = 1.0

    # Once each: lists are all that a relaxation needs, so these are made when they are asked for.

    @property
    def count(self) -> int:
        """#S."""
        return self.around.count

    @cached_property
    def ends(self) -> IntArray:
        """#S by 2, the lower vertex first."""
        offset, neighbor = self.around.offset, self.around.neighbor
        vertex = np.repeat(np.arange(len(offset) - 1, dtype=np.int32), np.diff(offset))
        lower = vertex < neighbor
        ends = np.empty((self.count, 2), dtype=np.int32)
        ends[self.around.entry[lower]] = np.stack([vertex[lower], neighbor[lower]], axis=1)
        return ends

    @cached_property
    def rest_length(self) -> FloatArray:
        """#S [m]."""
        return self._once(self.listed_length)

    @cached_property
    def stiffness(self) -> FloatArray:
        """#S [N/m]."""
        return self._once(self.listed_stiffness)

    def _once(self, listed: FloatArray) -> FloatArray:
        values = np.empty(self.count)
        values[self.around.entry] = listed
        return values

    def listed(self, values: FloatArray) -> FloatArray:
        """2 #S, the springs' values (#S) at both of their ends."""
        return self.around.listed(values)

    @property
    def long_quads(self) -> int:
        """How many quads lack something in shear."""
        return 0 if self.lack is None else int(np.count_nonzero(self.lack.any(axis=1)))


def springs_of(
    surface: Surface,
    fabric: Fabric,
    positions: FloatArray,
    *,
    grain_angle: float = 0.0,
    wider: FloatArray | None = None,
) -> SpringArrays:
    """Springs with rest lengths from space and stiffnesses from the fabric.

    Args:
        surface: of quads and/or triangles.
        fabric: stiffnesses [N/m].
        positions: #V by 2, a layout [m]: directions are measured in the plane against the grain, since threads are
            straight in the cloth and not on the body.
        grain_angle: of the warp against +y, degrees.
        wider: #F by 2, how many times as long as on the body a quad's first edges and its others are meant to be: its stiffnesses are those
            of such a quad. Rest lengths are the body's all the same.
    """
    own, faces, is_quad = unweighed_springs(surface), surface.faces, surface.is_quad
    warp, _ = grain_axes(grain_angle)
    first = first_of_faces(surface, 4, 3)
    of_side, diagonal = np.empty(3 * len(faces) + np.count_nonzero(is_quad)), np.empty(0)
    position, lack, wave = np.ascontiguousarray(positions, dtype=np.float64), None, None
    aligned, shear_excess = False, 1.0
    if not is_quad.all():
        triangles = selected_rows(faces, ~is_quad)
        given = [
            surface.vertices,
            position,
            triangles,
            selected_rows(first, ~is_quad),
            wp.vec2d(*warp),
            _compliance(fabric),
        ]
        launch_each(weigh_triangles, len(triangles), given, [of_side])
    if is_quad.any():
        quads = selected_rows(faces, is_quad)
        diagonal, short, hold = np.empty(len(quads)), np.empty((len(quads), 2)), np.empty(len(quads))
        lattice, angle = _lattice(fabric, quads, position, warp)
        aligned = _off_threads(angle) <= _OFF_GRAIN
        shear_excess = lattice.shear / fabric.shear_stiffness
        # One number for all, where they are as on the body.
        times = np.broadcast_to(np.ones(2), (len(quads), 2)) if wider is None else selected_rows(wider, is_quad)
        given = [
            surface.vertices,
            position,
            quads,
            selected_rows(first, is_quad),
            wp.array(times, dtype=wp.vec2d, device="cpu", copy=False),
            lattice,
        ]
        launch_each(weigh_quads, len(quads), given, [of_side, diagonal, short, hold])
        # Most have none: what is not written to takes no memory.
        if short.any():
            lacks, lack = short.any(axis=1), np.zeros((len(faces), 2))
            lack[np.flatnonzero(is_quad)[lacks]] = short[lacks]
        held = np.flatnonzero(hold)
        if len(held):
            weights, wave = np.empty((len(held), 4)), np.zeros((len(faces), 4))
            launch_each(weigh_waves, len(held), [surface.vertices, quads[held], hold[held]], [weights])
            wave[np.flatnonzero(is_quad)[held]] = weights
    return SpringArrays(
        around=own.around,
        listed_length=own.listed_length,
        listed_stiffness=_listed_stiffness(surface, own, of_side, diagonal),
        edge_count=own.edge_count,
        lack=lack,
        wave=wave,
        aligned=aligned,
        shear_excess=shear_excess,
    )


def _listed_stiffness(surface: Surface, own: _Unweighed, of_side: FloatArray, diagonal: FloatArray) -> FloatArray:
    """2 #S [N/m], from what faces give to the springs along their sides (#H) and, quads, to both diagonals (#Q)."""
    numbered = row_major_grid(surface)
    if numbered is not None:
        return numbered.listed_stiffness(own.around.offset, of_side, diagonal)
    at_edges = np.bincount(half_edges_of(surface).edge, of_side, minlength=own.edge_count)
    return own.around.listed(np.concatenate([at_edges, diagonal, diagonal]))


def quad_stiffness(fabric: Fabric, angle: float) -> tuple[float, float, float]:
    """K along a quad's first edges, along its second ones, and G [N/m], for first edges at `angle` [rad] from the warp.

    Within 7.5 degrees of warp or weft the edges are the threads. From 15 degrees on the crossed lattice gets the rotated
    elasticity; a crossed lattice has C12 = C66 = G, and no coupling of shear with tension, so there it is an
    approximation. Between the two it is rotated by a growing share of the angle. In an isotropic fabric no direction is another
    one, and nothing is rotated: C12 = C66 = G is not isotropic itself, and would be felt.
    """
    nearest = np.round(angle / _QUARTER) * _QUARTER
    off = 0.0 if fabric.is_isotropic else _off_threads(angle)
    share = np.clip((off - _ALIGNED) / (_OFF_GRAIN - _ALIGNED), 0.0, 1.0)
    if share == 0.0:
        if int(np.round(angle / _QUARTER)) % 2:
            return fabric.stiffness_weft, fabric.stiffness_warp, fabric.shear_stiffness
        return fabric.stiffness_warp, fabric.stiffness_weft, fabric.shear_stiffness
    turned_by = nearest + share**2 * (3.0 - 2.0 * share) * (angle - nearest)
    c, s = np.cos(turned_by), np.sin(turned_by)
    warp, weft, shear = fabric.stiffness_warp, fabric.stiffness_weft, fabric.shear_stiffness
    both = 6.0 * shear * s**2 * c**2
    along = warp * c**4 + weft * s**4 + both
    across = warp * s**4 + weft * c**4 + both
    turned = (warp + weft - 2.0 * shear) * s**2 * c**2 + shear * (c**2 - s**2) ** 2
    return float(along), float(across), float(turned)


def _off_threads(angle: float) -> float:
    """How far a direction at `angle` [rad] from the warp is from the nearer of warp and weft [rad]."""
    return float(abs(angle - np.round(angle / _QUARTER) * _QUARTER))


def _compliance(fabric: Fabric) -> wp.vec3d:
    """1/K [m/N] of a strip of the cloth cut at an angle from the warp and pulled along itself, as coefficients of cos^4, sin^4 and
    sin^2 cos^2: 1/K_warp, 1/K_weft and 1/G - 2 nu/K_warp."""
    cross = 1.0 / fabric.shear_stiffness - 2.0 * fabric.poisson_ratio / fabric.stiffness_warp
    return wp.vec3d(1.0 / fabric.stiffness_warp, 1.0 / fabric.stiffness_weft, cross)


def _lattice(fabric: Fabric, quads: IntArray, positions: FloatArray, warp: FloatArray) -> tuple[Lattice, float]:
    """The fabric along the quads' edges, and the angle from the warp to the first of these [rad].

    The angle between cells and grain is that of the whole piece (the mean over its cells, taken with the fourfold
    symmetry of a grid).
    """
    fourfold = np.empty((len(quads), 2))
    launch_each(find_directions, len(quads), [positions, quads, wp.vec2d(*warp)], [fourfold])
    # As complex numbers, of which one row is summed many times as fast as two columns are.
    mean = complex(fourfold.view(np.complex128).sum())
    angle = float(np.angle(mean)) / 4.0
    across = np.array([-warp[1], warp[0]])
    lattice = Lattice()
    lattice.direction = wp.vec2d(*(np.cos(angle) * warp + np.sin(angle) * across))
    lattice.along, lattice.across, lattice.shear = quad_stiffness(fabric, angle)
    lattice.least = _LEAST_STRUCTURAL_SHARE
    return lattice, angle


@once_per_surface
def unweighed_springs(surface: Surface) -> _Unweighed:
    """What no fabric changes of a surface's springs, worked out once."""
    vertices, around, numbered = surface.vertices, _springs_around(surface), row_major_grid(surface)
    diagonal, _ = unfold_quad_diagonals(vertices, surface.faces, crease=creases_of(surface))
    if numbered is not None:
        lengths = numbered.listed_lengths(around.offset, vertices, diagonal)
        return read_only(_Unweighed(edge_count=numbered.edge_count, around=around, listed_length=lengths))
    edges = half_edges_of(surface).edges
    rest_length = np.empty(around.count)
    rest_length[len(edges) :] = diagonal.T.ravel()
    launch_each(measure_edges, len(edges), [vertices, edges], [rest_length])
    return read_only(_Unweighed(edge_count=len(edges), around=around, listed_length=around.listed(rest_length)))


@once_per_faces
def _springs_around(surface: Surface) -> SpringsAround:
    """The springs around each vertex, edges first, then diagonals."""
    numbered = row_major_grid(surface)
    if numbered is not None:
        offset, neighbor = numbered.neighbors_around()
        return read_only(SpringsAround(offset=offset, neighbor=neighbor, numbering=numbered))
    faces, count = surface.faces, len(surface.vertices)
    offset, neighbor, spring = _sorted_springs(half_edges_of(surface).edges, faces, count)
    around = SpringsAround(offset=offset, neighbor=neighbor, numbering=partial(_numbers, faces, count))
    vars(around)["_kept"] = spring
    return read_only(around)


def _numbers(faces: IntArray, count: int) -> IntArray:
    return _sorted_springs(half_edges(faces).edges, faces, count)[2]


def _sorted_springs(edges: IntArray, faces: IntArray, count: int) -> tuple[IntArray, IntArray, IntArray]:
    """Edges, then diagonals, around so many vertices: #V+1, where each vertex's begin; 2 #S each, the vertices at the far ends, and the
    springs' numbers."""
    corner = selected_rows(faces, faces[:, 3] >= 0)
    ends = np.concatenate([edges, corner[:, 0::2], corner[:, 1::2]])
    end, offset = counting_sort(ends[:, ::-1].T.ravel(), count)
    neighbor, spring = np.empty(ends.size, dtype=np.int32), np.empty(ends.size, dtype=np.int32)
    launch_each(list_springs, count, [offset, end, ends, len(ends)], [neighbor, spring])
    return offset, neighbor, spring


def shortened(
    springs: SpringArrays,
    surface: Surface,
    positions: FloatArray,
    axes: tuple[FloatArray, FloatArray],
    stretch: FloatArray,
) -> SpringArrays:
    """The springs of a cloth that is worn stretched: a thread of unit direction u is |(s_warp u_warp, s_weft u_weft)| long."""
    used = surface.faces >= 0
    at = surface.faces[used]
    faces = np.bincount(at, minlength=len(surface.vertices))
    at_vertex = np.stack(
        [
            np.bincount(at, np.broadcast_to(stretch[:, k, None], used.shape)[used], minlength=len(faces)) / faces
            for k in range(2)
        ],
        axis=1,
    )
    d = positions[springs.ends[:, 1]] - positions[springs.ends[:, 0]]
    length = np.linalg.norm(d, axis=1)
    u = np.stack([d @ axes[0], d @ axes[1]], axis=1) / np.where(length > 0.0, length, 1.0)[:, None]
    worn = np.linalg.norm(u * 0.5 * (at_vertex[springs.ends[:, 0]] + at_vertex[springs.ends[:, 1]]), axis=1)
    return replace(springs, listed_length=springs.listed(springs.rest_length / np.where(worn > 0.0, worn, 1.0)))


def springs_of_sides(springs: SpringArrays, cells: CellArrays) -> IntArray:
    """3 #C, the spring along each cell's edges 0-1, 1-2, 2-0."""
    around = springs.around
    side = np.empty_like(cells.corner)
    given = [cells.corner, around.offset, around.neighbor, around.entry]
    launch_each(find_sides, len(side), given, [side])
    return side.ravel()


def with_stiffness(springs: SpringArrays, cells: CellArrays, weights: FloatArray) -> SpringArrays:
    """The springs with the sums of the cells' weights (#C by 3, along the edges 0-1, 1-2, 2-0) as k_ij."""
    side = springs_of_sides(springs, cells)
    stiffness = np.bincount(side, weights.ravel(), minlength=springs.count).astype(np.float64)
    return replace(springs, listed_stiffness=springs.listed(stiffness), lack=None, wave=None)


def shear_hold(surface: Surface, springs: SpringArrays, positions: FloatArray, warp: FloatArray) -> float:
    """Shear stiffness [N/m] that the springs between triangles really have against warp and weft.

    They shear as their directions happen to lie: split squares have K(45 degrees)/4, and threads between them kink at
    that over K, not at G/K. Taken per vertex, sum of 1/2 k L^2 cos^2 sin^2 over its share of the area, infinite beside a quad,
    and of these three quarters of the lower quartile: one value for the piece, and the same on a finer mesh of its kind.

    Args:
        surface, springs: of the piece.
        positions: #V by 2, a layout [m].
        warp: unit vector in the plane.
    """
    is_quad = surface.is_quad
    if is_quad.all():
        return np.inf
    around, count = springs.around, len(surface.vertices)
    hold = np.empty(count)
    layout = np.ascontiguousarray(positions, dtype=np.float64)
    lists = [around.offset, around.neighbor, springs.listed_length, springs.listed_stiffness]
    given = [layout, *lists, cells_of(surface).vertex_areas, wp.vec2d(*warp)]
    launch_each(measure_hold, count, given, [hold])
    hold[surface.faces[is_quad].ravel()] = np.inf
    return _HOLD_SHARE * float(np.partition(hold, count // 4)[count // 4])
