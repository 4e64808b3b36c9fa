"""The springs of a surface: rest lengths measured on it in space, stiffnesses in N/m.

Quads along the grain are springs: each has four structural edges and two diagonals, with stiffnesses from the fabric. Other cloth is
measured cell by cell; the springs along the sides of its cells are the matrix of the paper's step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import warp as wp

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.launch import launch_each
from warpflat.core.sorting import counting_sort
from warpflat.core.sums import dot
from warpflat.flat.fabric.fabric import Fabric, grain_axes
from warpflat.flat.surface.cells import CellArrays, face_creases, first_of_faces
from warpflat.flat.surface.half_edges import half_edges_of
from warpflat.flat.surface.mesh import Surface, once_per_faces, once_per_surface, read_only
from warpflat.flat.surface.triangles import selected_rows, unfold_quad_diagonals
from warpflat.kernels.stiffness import (
    Lattice,
    find_sides,
    list_springs,
    measure_edges,
    weigh_quads,
)

__all__ = [
    "SpringArrays",
    "SpringGeometry",
    "SpringsAround",
    "fourfold_direction",
    "shorten_springs",
    "spring_geometry",
    "springs_along_cells",
    "springs_of",
    "stretch_factor",
    "with_stiffness",
]


# A shear spring stiffens tension too. In a cell so long that nothing would be left for the structural spring, that
# spring keeps this share of its stiffness, the shear springs are weaker, and the cell is sheared as a whole against
# their deficit.
_LEAST_STRUCTURAL_SHARE = 0.05
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
class SpringGeometry:
    """The springs of a surface, each listed at both of its ends, without what depends on the fabric.

    Attributes:
        around: the springs around each vertex.
        listed_length: 2 #S, rest length of each entry [m].
        edge_count: #E; the first springs are the mesh edges.
    """

    around: SpringsAround
    listed_length: FloatArray
    edge_count: int


@dataclass(frozen=True, kw_only=True)
class SpringArrays(SpringGeometry):
    """The springs as the kernels take them.

    Attributes:
        listed_stiffness: 2 #S, stiffness of each entry [N/m].
        shear_deficit: #F by 2, shear stiffness that the springs of long quads lack, as `kernels.cells.Cells.shear`;
            None without such quads.
        hourglass: #F by 4, hourglass weights of quads, as `kernels.cells.Cells.hourglass`; None if no quad needs any.
    """

    listed_stiffness: FloatArray
    shear_deficit: FloatArray | None = None
    hourglass: FloatArray | None = None

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

    def energy_of_strain(self, strain: float) -> float:
        """Return the energy that the springs store if each is strained by so much [J]."""
        # Each spring is listed twice.
        return 0.25 * strain**2 * dot(self.listed_stiffness * self.listed_length, self.listed_length)

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
    """Return the springs of quads along the grain, with rest lengths from space and stiffnesses from the fabric.

    Args:
        surface: of quads.
        fabric: stiffnesses [N/m].
        positions: #V by 2, a layout [m], in which the edges nearer to the warp are found.
        grain_angle: of the warp against +y, degrees.
        wider: #F by 2, intended length of a quad's first edges, and of its others, over that on the body. It determines
            the stiffnesses; rest lengths are still the body's.
    """
    own, quads = spring_geometry(surface), surface.faces
    lattice = Lattice()
    lattice.warp = wp.vec2d(*grain_axes(grain_angle)[0])
    lattice.k_warp, lattice.k_weft = fabric.stiffness_warp, fabric.stiffness_weft
    lattice.shear, lattice.least = fabric.shear_stiffness, _LEAST_STRUCTURAL_SHARE
    halves = half_edges_of(surface)
    of_side, diagonal, deficit, unheld = (
        np.empty(shape) for shape in (halves.edge.shape, len(quads), (len(quads), 2), len(quads))
    )
    # Ones broadcast to all quads, where they are as long as on the body.
    times = np.broadcast_to(np.ones(2), (len(quads), 2)) if wider is None else wider
    times = wp.array(times, dtype=wp.vec2d, device="cpu", copy=False)
    position = np.ascontiguousarray(positions, dtype=np.float64)
    given = [surface.vertices, position, quads, first_of_faces(surface, 4, 3), times, lattice]
    launch_each(weigh_quads, len(quads), given, [of_side, diagonal, deficit, unheld])
    hourglass, unstable = None, np.flatnonzero(unheld)
    if len(unstable):
        hourglass = np.zeros((len(quads), 4))
        hourglass[unstable] = hourglass_weights(surface.vertices[quads[unstable]], unheld[unstable])
    # Every face that a mesh edge has adds to its stiffness.
    at_edges = np.bincount(halves.edge, of_side, minlength=own.edge_count)
    return SpringArrays(
        around=own.around,
        listed_length=own.listed_length,
        listed_stiffness=own.around.listed(np.concatenate([at_edges, diagonal, diagonal])),
        edge_count=own.edge_count,
        shear_deficit=deficit if deficit.any() else None,
        hourglass=hourglass,
    )


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


def fourfold_direction(quads: IntArray, positions: FloatArray, grain_angle: float) -> complex:
    """Return the mean of exp(4i a) over quads (#Q by 4) in a layout (#V by 2 [m]), a the angle of their edges to the grain.

    A grid has this fourfold symmetry. A fourth of its angle is the mean of a; its modulus is 1 where all quads run alike.
    """
    warp, _ = grain_axes(grain_angle)
    # Vectors as complex numbers: a row of these is summed many times as fast as two columns of reals.
    p = np.ascontiguousarray(positions, dtype=np.float64).view(np.complex128)[:, 0]
    along = ((p[quads[:, 1]] - p[quads[:, 0]]) + (p[quads[:, 2]] - p[quads[:, 3]])) * complex(warp[0], -warp[1])
    length = np.abs(along)
    twofold = (np.where(length > 0.0, along, 1.0) / np.where(length > 0.0, length, 1.0)) ** 2
    return complex((twofold * twofold).mean())


@once_per_surface
def spring_geometry(surface: Surface) -> SpringGeometry:
    """Return the springs of a surface without what depends on the fabric; made once for each surface."""
    vertices, around = surface.vertices, _springs_around(surface)
    diagonal, _ = unfold_quad_diagonals(vertices, surface.faces, crease=face_creases(surface))
    edges = half_edges_of(surface).edges
    rest_length = np.empty(around.count)
    rest_length[len(edges) :] = diagonal.T.ravel()
    launch_each(measure_edges, len(edges), [vertices, edges], [rest_length])
    return read_only(SpringGeometry(edge_count=len(edges), around=around, listed_length=around.listed(rest_length)))


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
    along = (positions[springs.ends[:, 1]] - positions[springs.ends[:, 0]]) @ np.column_stack(axes)
    worn = stretch_factor(along, 0.5 * (at_vertex[springs.ends[:, 0]] + at_vertex[springs.ends[:, 1]]))
    return replace(springs, listed_length=springs.listed(springs.rest_length / worn))


def stretch_factor(vectors: FloatArray, times: FloatArray) -> FloatArray:
    """Return how many times longer vectors along warp and weft (#N by 2) become once each component is so many times longer (#N by 2).

    A vector of no length has no direction, and stays as it is: 1.
    """
    length = np.linalg.norm(vectors, axis=1)
    has_length = length > 0.0
    longer = np.linalg.norm(vectors * times, axis=1) / np.where(has_length, length, 1.0)
    return np.asarray(np.where(has_length, longer, 1.0))


def springs_along_cells(springs: SpringGeometry, cells: CellArrays) -> IntArray:
    """Return the springs along each cell's edges 0-1, 1-2, 2-0, 3 #C."""
    around = springs.around
    side = np.empty_like(cells.corner)
    given = [cells.corner, around.offset, around.neighbor, around.entry]
    launch_each(find_sides, len(side), given, [side])
    return side.ravel()


def with_stiffness(springs: SpringGeometry, cells: CellArrays, weights: FloatArray) -> SpringArrays:
    """Return the springs with the sums of the cells' weights (#C by 3, along the edges 0-1, 1-2, 2-0) as k_ij."""
    side = springs_along_cells(springs, cells)
    stiffness = np.bincount(side, weights.ravel(), minlength=springs.around.count).astype(np.float64)
    return SpringArrays(
        around=springs.around,
        listed_length=springs.listed_length,
        listed_stiffness=springs.around.listed(stiffness),
        edge_count=springs.edge_count,
    )
