"""The springs of a surface: rest lengths measured on it in space, stiffnesses in N/m from the fabric.

Each quad has four structural edges and two diagonals; a triangle has its edges (Van Gelder 1998).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import warp as wp

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.launch import launch_each
from warpflat.core.sorting import counting_sort
from warpflat.fabric.fabric import Fabric, grain_axes
from warpflat.kernels.stiffness import (
    Lattice,
    find_sides,
    list_springs,
    measure_edges,
    measure_shear_stiffness,
    weigh_quads,
    weigh_triangles,
)
from warpflat.surface.cells import CellArrays, face_creases, first_of_faces, make_cells
from warpflat.surface.half_edges import half_edges_of
from warpflat.surface.mesh import Surface, once_per_faces, once_per_surface, read_only
from warpflat.surface.triangles import selected_rows, unfold_quad_diagonals

__all__ = [
    "SpringArrays",
    "SpringsAround",
    "isotropic_buckling_stiffness",
    "measure_buckling_stiffness",
    "shorten_springs",
    "spring_geometry",
    "springs_along_cells",
    "springs_of",
    "with_stiffness",
]


# A shear spring stiffens tension too. In a cell so long that nothing would be left for the structural spring, that
# spring keeps this share of its stiffness, the shear springs are weaker, and the cell is sheared as a whole against
# their deficit.
_LEAST_STRUCTURAL_SHARE = 0.05
# On triangles the guard begins at this share of the buckling stiffness: exactly at buckling threads would waver at no
# cost, and a relaxation would creep for ever.
_BUCKLING_SHARE = 0.75
# Edges of quads within the first of these angles of the grain count as threads, beyond the second at their true angle,
# and in between at a growing share of it, so that sizes of one pattern on both sides behave alike. Line relaxation may
# follow edges up to the second angle.
_ALIGNED, _OFF_GRAIN = np.deg2rad([7.5, 15.0])
_QUARTER = np.pi / 2
# A quad whose middle lines enclose an angle with less than this squared sine has no shape to keep.
_LEAST_SINE_SQUARED = 1e-12


@dataclass(frozen=True, kw_only=True)
class SpringsAround:
    """The springs around each vertex, listed vertex by vertex.

    Attributes:
        offset: #V+1, where the entries of each vertex begin.
        neighbor: 2 #S, for each entry the vertex at the far end, by which they are sorted.
        entry: 2 #S, the number of the spring of each entry; mesh edges have the first numbers.
    """

    offset: IntArray
    neighbor: IntArray
    entry: IntArray

    def listed(self, values: FloatArray) -> FloatArray:
        """Return the springs' values (#S) at both of their ends, 2 #S."""
        return np.asarray(values, dtype=np.float64)[self.entry]

    @property
    def count(self) -> int:
        """The number of springs, #S."""
        return len(self.neighbor) // 2


@dataclass(frozen=True, kw_only=True)
class _SpringGeometry:
    """The springs of a surface as in SpringArrays, without what depends on the fabric."""

    edge_count: int
    around: SpringsAround
    listed_length: FloatArray


@dataclass(frozen=True, kw_only=True)
class SpringArrays:
    """The springs as the kernels take them, each listed at both of its ends.

    Attributes:
        around: the springs around each vertex.
        listed_length, listed_stiffness: 2 #S, rest length [m] and stiffness [N/m] of each entry.
        edge_count: #E; the first springs are the mesh edges.
        shear_deficit: #F by 2, shear stiffness that the springs of long quads lack, as `kernels.cells.Cells.shear`;
            None without such quads.
        hourglass: #F by 4, hourglass weights of quads, as `kernels.cells.Cells.hourglass`; None if no quad needs any.
        aligned: whether there are quads whose edges run along the threads.
        shear_excess: shear stiffness of the quads over the fabric's, above 1 where their edges run across the threads;
            1 without quads.
    """

    around: SpringsAround
    listed_length: FloatArray
    listed_stiffness: FloatArray
    edge_count: int
    shear_deficit: FloatArray | None = None
    hourglass: FloatArray | None = None
    aligned: bool = False
    shear_excess: float = 1.0

    # A relaxation needs the lists alone, so the arrays with one entry a spring are made at their first use.

    @property
    def count(self) -> int:
        """The number of springs, #S."""
        return self.around.count

    @cached_property
    def ends(self) -> IntArray:
        """The two ends of each spring, the lower vertex first, #S by 2."""
        offset, neighbor = self.around.offset, self.around.neighbor
        vertex = np.repeat(np.arange(len(offset) - 1, dtype=np.int32), np.diff(offset))
        lower = vertex < neighbor
        ends = np.empty((self.count, 2), dtype=np.int32)
        ends[self.around.entry[lower]] = np.stack([vertex[lower], neighbor[lower]], axis=1)
        return ends

    @cached_property
    def rest_length(self) -> FloatArray:
        """The rest lengths, #S [m]."""
        return self._unlisted(self.listed_length)

    @cached_property
    def stiffness(self) -> FloatArray:
        """The stiffnesses, #S [N/m]."""
        return self._unlisted(self.listed_stiffness)

    def _unlisted(self, listed: FloatArray) -> FloatArray:
        values = np.empty(self.count)
        values[self.around.entry] = listed
        return values

    def listed(self, values: FloatArray) -> FloatArray:
        """Return the springs' values (#S) at both of their ends, 2 #S."""
        return self.around.listed(values)

    @property
    def long_quads(self) -> int:
        """The number of quads with a shear deficit."""
        return 0 if self.shear_deficit is None else int(np.count_nonzero(self.shear_deficit.any(axis=1)))


def springs_of(
    surface: Surface,
    fabric: Fabric,
    positions: FloatArray,
    *,
    grain_angle: float = 0.0,
    wider: FloatArray | None = None,
) -> SpringArrays:
    """Return springs with rest lengths from space and stiffnesses from the fabric.

    Args:
        surface: of quads and/or triangles.
        fabric: stiffnesses [N/m].
        positions: #V by 2, a layout [m]: directions are measured in the plane against the grain, since threads are
            straight in the cloth and not on the body.
        grain_angle: of the warp against +y, degrees.
        wider: #F by 2, intended length of a quad's first edges, and of its others, over that on the body. It determines
            the stiffnesses; rest lengths are still the body's.
    """
    own, faces, is_quad = spring_geometry(surface), surface.faces, surface.is_quad
    warp, _ = grain_axes(grain_angle)
    of_side, diagonal = np.empty(3 * len(faces) + np.count_nonzero(is_quad)), np.empty(0)
    position = np.ascontiguousarray(positions, dtype=np.float64)
    quads: dict[str, Any] = {}
    if not is_quad.all():
        triangles, first = selected_rows(faces, ~is_quad), selected_rows(first_of_faces(surface, 4, 3), ~is_quad)
        # 1/K(theta) of a strip cut at the angle theta from the warp and pulled along itself [m/N] has these coefficients of
        # cos^4, sin^4 and sin^2 cos^2: 1/K_warp, 1/K_weft and 1/G - 2 nu/K_warp.
        cross = 1.0 / fabric.shear_stiffness - 2.0 * fabric.poisson_ratio / fabric.stiffness_warp
        compliance = wp.vec3d(1.0 / fabric.stiffness_warp, 1.0 / fabric.stiffness_weft, cross)
        given = [surface.vertices, position, triangles, first, wp.vec2d(*warp), compliance]
        launch_each(weigh_triangles, len(triangles), given, [of_side])
    if is_quad.any():
        lattice, angle = _lattice(fabric, selected_rows(faces, is_quad), position, warp)
        diagonal, shear_deficit, hourglass = _weigh_quads(surface, position, lattice, wider, of_side)
        quads = {
            "shear_deficit": shear_deficit,
            "hourglass": hourglass,
            "aligned": _off_threads(angle) <= _OFF_GRAIN,
            "shear_excess": lattice.shear / fabric.shear_stiffness,
        }
    # Every face that a mesh edge has adds to its stiffness.
    at_edges = np.bincount(half_edges_of(surface).edge, of_side, minlength=own.edge_count)
    return SpringArrays(
        around=own.around,
        listed_length=own.listed_length,
        listed_stiffness=own.around.listed(np.concatenate([at_edges, diagonal, diagonal])),
        edge_count=own.edge_count,
        **quads,
    )


def _weigh_quads(
    surface: Surface, position: FloatArray, lattice: Lattice, wider: FloatArray | None, of_side: FloatArray
) -> tuple[FloatArray, FloatArray | None, FloatArray | None]:
    """Compute the stiffnesses that quads give to their springs; those along their sides are written to `of_side`.

    Returns:
        #Q, stiffness of the diagonals [N/m]; #F by 2, shear deficits, and #F by 4, hourglass weights, as in
        `SpringArrays`.
    """
    faces, is_quad, shear_deficit, hourglass = surface.faces, surface.is_quad, None, None
    quads, first = selected_rows(faces, is_quad), selected_rows(first_of_faces(surface, 4, 3), is_quad)
    diagonal, deficit, stabilisation = np.empty(len(quads)), np.empty((len(quads), 2)), np.empty(len(quads))
    # Ones broadcast to all quads, where they are as long as on the body.
    times = np.broadcast_to(np.ones(2), (len(quads), 2)) if wider is None else selected_rows(wider, is_quad)
    times = wp.array(times, dtype=wp.vec2d, device="cpu", copy=False)
    given = [surface.vertices, position, quads, first, times, lattice]
    launch_each(weigh_quads, len(quads), given, [of_side, diagonal, deficit, stabilisation])
    # Most quads have none: pages that are not written to take no memory.
    if deficit.any():
        lacking, shear_deficit = deficit.any(axis=1), np.zeros((len(faces), 2))
        shear_deficit[np.flatnonzero(is_quad)[lacking]] = deficit[lacking]
    unstable = np.flatnonzero(stabilisation)
    if len(unstable):
        hourglass = np.zeros((len(faces), 4))
        hourglass[np.flatnonzero(is_quad)[unstable]] = hourglass_weights(
            surface.vertices[quads[unstable]], stabilisation[unstable]
        )
    return diagonal, shear_deficit, hourglass


def hourglass_weights(corners: FloatArray, stiffness: FloatArray) -> FloatArray:
    """Return weights with which a quad stores 1/2 |sum of weight_k p_k|^2 [J], p its corners in the plane.

    They are +1, -1, +1, -1, less the same mode of the quad's shape on the body, so that this shape under any uniform
    strain stores nothing (Flanagan and Belytschko 1981), times the root of the stiffness.

    Args:
        corners: #Q by 4 by 3, on the body [m].
        stiffness: #Q [N/m].

    Returns:
        #Q by 4 [(N/m)^1/2]; zero for a quad whose middle lines enclose next to no angle, which has no shape to keep.
    """
    p0, p1, p2, p3 = np.moveaxis(corners, 1, 0)
    u, v, h = 0.5 * ((p1 - p0) + (p2 - p3)), 0.5 * ((p3 - p0) + (p2 - p1)), (p0 - p1) + (p2 - p3)
    uu, vv, uv, hu, hv = ((a * b).sum(axis=1) for a, b in ((u, u), (v, v), (u, v), (h, u), (h, v)))
    det = uu * vv - uv * uv
    has_shape = det > _LEAST_SINE_SQUARED * uu * vv
    det = np.where(has_shape, det, 1.0)
    along_u, along_v = 0.5 * (hu * vv - hv * uv) / det, 0.5 * (hv * uu - hu * uv) / det
    mode = np.array([[1.0, -1.0, 1.0, -1.0]])
    mode = mode + np.outer(along_u, [1.0, -1.0, -1.0, 1.0]) + np.outer(along_v, [1.0, 1.0, -1.0, -1.0])
    return np.asarray(mode * np.where(has_shape, np.sqrt(stiffness), 0.0)[:, None])


def quad_stiffness(fabric: Fabric, angle: float) -> tuple[float, float, float]:
    """Return K along a quad's first and second edges, and G [N/m], for first edges at `angle` [rad] from the warp.

    Within 7.5 degrees of warp or weft the edges are the threads. From 15 degrees on the crossed lattice gets the
    rotated elasticity. This is an approximation: a crossed lattice has C12 = C66 = G, and no coupling of shear with
    tension. In between it is rotated by a growing share of the angle. An isotropic fabric is not rotated, since C12 =
    C66 = G is not isotropic itself, and a rotation would change the result.
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
    """Return the angle between a direction at `angle` [rad] from the warp and the nearer of warp and weft [rad]."""
    return float(abs(angle - np.round(angle / _QUARTER) * _QUARTER))


def _lattice(fabric: Fabric, quads: IntArray, positions: FloatArray, warp: FloatArray) -> tuple[Lattice, float]:
    """Return the fabric along the quads' edges, and the angle from the warp to their first edges [rad].

    The angle between cells and grain is that of the whole piece (the mean over its cells, taken with the fourfold
    symmetry of a grid).
    """
    # Vectors as complex numbers: a row of these is summed many times as fast as two columns of reals.
    p = positions.view(np.complex128)[:, 0]
    along = ((p[quads[:, 1]] - p[quads[:, 0]]) + (p[quads[:, 2]] - p[quads[:, 3]])) * complex(warp[0], -warp[1])
    length = np.abs(along)
    twofold = (np.where(length > 0.0, along, 1.0) / np.where(length > 0.0, length, 1.0)) ** 2
    mean = complex((twofold * twofold).sum())
    angle = float(np.angle(mean)) / 4.0
    across = np.array([-warp[1], warp[0]])
    lattice = Lattice()
    lattice.direction = wp.vec2d(*(np.cos(angle) * warp + np.sin(angle) * across))
    lattice.along, lattice.across, lattice.shear = quad_stiffness(fabric, angle)
    lattice.least = _LEAST_STRUCTURAL_SHARE
    return lattice, angle


@once_per_surface
def spring_geometry(surface: Surface) -> _SpringGeometry:
    """Return the springs of a surface without what depends on the fabric; made once for each surface."""
    vertices, around = surface.vertices, _springs_around(surface)
    diagonal, _ = unfold_quad_diagonals(vertices, surface.faces, crease=face_creases(surface))
    edges = half_edges_of(surface).edges
    rest_length = np.empty(around.count)
    rest_length[len(edges) :] = diagonal.T.ravel()
    launch_each(measure_edges, len(edges), [vertices, edges], [rest_length])
    return read_only(_SpringGeometry(edge_count=len(edges), around=around, listed_length=around.listed(rest_length)))


@once_per_faces
def _springs_around(surface: Surface) -> SpringsAround:
    """Return the edges and diagonals around each vertex, sorted by their far ends; edges are numbered first."""
    count, corner = len(surface.vertices), selected_rows(surface.faces, surface.faces[:, 3] >= 0)
    ends = np.concatenate([half_edges_of(surface).edges, corner[:, 0::2], corner[:, 1::2]])
    end, offset = counting_sort(ends[:, ::-1].T.ravel(), count)
    neighbor, spring = np.empty(ends.size, dtype=np.int32), np.empty(ends.size, dtype=np.int32)
    launch_each(list_springs, count, [offset, end, ends, len(ends)], [neighbor, spring])
    return read_only(SpringsAround(offset=offset, neighbor=neighbor, entry=spring))


def shorten_springs(
    springs: SpringArrays,
    surface: Surface,
    positions: FloatArray,
    axes: tuple[FloatArray, FloatArray],
    stretch: FloatArray,
) -> SpringArrays:
    """Return the springs of a cloth that is worn stretched, with shorter rest lengths.

    A thread of unit direction u is worn |(s_warp u_warp, s_weft u_weft)| long.

    Args:
        springs: of the cloth as on the body.
        surface: the body.
        positions: #V by 2, a layout for the directions [m].
        axes: unit vectors of warp and weft in the plane.
        stretch: #F by 2, intended length worn over length flat.
    """
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


def springs_along_cells(springs: SpringArrays, cells: CellArrays) -> IntArray:
    """Return the springs along each cell's edges 0-1, 1-2, 2-0, 3 #C."""
    around = springs.around
    side = np.empty_like(cells.corner)
    given = [cells.corner, around.offset, around.neighbor, around.entry]
    launch_each(find_sides, len(side), given, [side])
    return side.ravel()


def with_stiffness(springs: SpringArrays, cells: CellArrays, weights: FloatArray) -> SpringArrays:
    """Return the springs with the sums of the cells' weights (#C by 3, along the edges 0-1, 1-2, 2-0) as k_ij."""
    side = springs_along_cells(springs, cells)
    stiffness = np.bincount(side, weights.ravel(), minlength=springs.count).astype(np.float64)
    return replace(springs, listed_stiffness=springs.listed(stiffness), shear_deficit=None, hourglass=None)


def isotropic_buckling_stiffness(surface: Surface, fabric: Fabric) -> float:
    """Return the result of `measure_buckling_stiffness` for an isotropic sheet, in which any direction may buckle.

    The mean of cos^2 sin^2 over all directions is 1/8, and each triangle gives its three springs k L^2 = K A: 3 K / 8
    on any mesh.
    """
    return np.inf if surface.is_quad.all() else _BUCKLING_SHARE * 3.0 / 8.0 * fabric.stiffness_warp


def measure_buckling_stiffness(
    surface: Surface, springs: SpringArrays, positions: FloatArray, warp: FloatArray
) -> float:
    """Return the shear stiffness with which springs on triangles resist the buckling of threads [N/m].

    It depends on the directions of the edges: split squares have K(45 degrees)/4, so threads kink at that over K, not
    at G/K. Per vertex it is the sum of 1/2 k L^2 cos^2 sin^2 over the vertex's area, infinite beside a quad. The result
    is three quarters of the lower quartile: one value for the piece, and the same on a finer mesh of its kind.

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
    given = [layout, *lists, make_cells(surface).vertex_areas, wp.vec2d(*warp)]
    launch_each(measure_shear_stiffness, count, given, [hold])
    hold[surface.faces[is_quad].ravel()] = np.inf
    return _BUCKLING_SHARE * float(np.partition(hold, count // 4)[count // 4])
