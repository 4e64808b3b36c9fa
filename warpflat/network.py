"""SpringNetwork: a surface and a fabric as the arrays of a mass-spring model on a device.

**Springs.** Each quad has four structural edges and two diagonals; a triangle has its edges (Van Gelder 1998). Rest
lengths are measured on the surface in space, stiffnesses in N/m come from the fabric.

**Threads stay straight.** Edge springs alone have minima that no cloth has. A compressed spring pushes its ends
sideways, k (1 - L/l) < 0, so a thread compressed by more than G/K kinks between its neighbours at the scale of the mesh,
and faces fold over, at *lower* spring energy than any unfolded layout. In cloth the threads are straight in the plane
and it is the body that stretches them, so the network adds, per cell, what such a thread stores beyond the strain at
which the springs lose their hold,

    a [1/2 K_warp <|F e_warp| - 1 - G/K_warp>^2 + 1/2 K_weft <|F e_weft| - 1 - G/K_weft>^2],    <x> = max(x, 0),

with F from the plane to the surface and a the flat area. It is zero below the onset, it makes the energy convex against
kinks (its sideways stiffness outweighs the springs' loss), and it grows without bound as a cell collapses, so that no
face can be mirrored. Its share is reported as `guard_energy_j`.

**Or a membrane.** With `model = "membrane"` the cloth is measured as worn, cell by cell (`warpflat.kernels.membrane`):
exact on any mesh, and without a guard. The springs then pull at nothing; their k_ij, set so that they bound the membrane's
stiffness, stay the matrix of the approximate implicit step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpflat.fabric import Fabric
from warpflat.kernels.cells import Cells, ThreadGuard, compute_guard_energy, evaluate_guard, find_least_shares
from warpflat.kernels.implicit import Bonds
from warpflat.kernels.membrane import Cloth, compute_membrane_energy, evaluate_membrane
from warpflat.kernels.seams import Seams
from warpflat.kernels.springs import Springs
from warpflat.kernels.stiffness import (
    Lattice,
    add_stiffness,
    find_directions,
    find_sides,
    list_springs,
    measure_edges,
    measure_hold,
    weigh_quads,
    weigh_triangles,
)
from warpflat.kernels.surface_cells import add_areas
from warpflat.launching import launch_each
from warpflat.membrane import Model, check_model, cloth_of, step_matrix
from warpflat.surface.mesh import Surface, once_per_faces, once_per_surface, read_only
from warpflat.surface.topology import (
    corner_triangles,
    half_edges_of,
    order_by,
    rows_of,
    unfold_quad_diagonals,
)
from warpflat.surface.unfold import corners_around, lay_cells, quad_creases

__all__ = ["SpringNetwork", "cells_of", "grain_axes", "springs_of"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

# A shear spring stiffens tension too; where a cell is so long that nothing is left for the structural spring, it keeps this share.
_LEAST_STRUCTURAL_SHARE = 0.05
# Eq. (10) cuts a Neumann series off after its second term, and leaves a mode in which the two ends of one spring that
# outweighs all others move against each other (the short side of a needle) without any correction; this share of the
# stiffest spring, added to the sum around a vertex, restores it. On a regular grid it costs a few per cent of the steps.
_PAIR_SHARE = 0.5
# Where springs between triangles have just lost their hold, threads waver at no cost, and a relaxation creeps for ever; the
# guard begins at this share of it.
_HOLD_SHARE = 0.75
# Quad cells that lie within this angle of the grain carry the threads along their edges.
_ALIGNED = np.deg2rad(15.0)


def grain_axes(grain_angle: float) -> tuple[FloatArray, FloatArray]:
    """Unit vectors of warp and weft in the plane; at 0 degrees the warp is +y (up) and the weft +x."""
    angle = np.deg2rad(grain_angle)
    return np.array([-np.sin(angle), np.cos(angle)]), np.array([np.cos(angle), np.sin(angle)])


def quad_stiffness(fabric: Fabric, angle: float) -> tuple[float, float, float]:
    """K along a quad's first edges, along its second ones, and G [N/m], for first edges at `angle` [rad] from the warp.

    Within 15 degrees of warp or weft the edges are the threads. Further off, the crossed lattice gets the rotated
    elasticity; a crossed lattice has C12 = C66 = G, and no coupling of shear with tension, so there it is an
    approximation.
    """
    quarter = np.pi / 2
    nearest = np.round(angle / quarter)
    if abs(angle - nearest * quarter) <= _ALIGNED:
        if int(nearest) % 2:
            return fabric.stiffness_weft, fabric.stiffness_warp, fabric.shear_stiffness
        return fabric.stiffness_warp, fabric.stiffness_weft, fabric.shear_stiffness
    c, s = np.cos(angle), np.sin(angle)
    warp, weft, shear = fabric.stiffness_warp, fabric.stiffness_weft, fabric.shear_stiffness
    both = 6.0 * shear * s**2 * c**2
    along = warp * c**4 + weft * s**4 + both
    across = warp * s**4 + weft * c**4 + both
    turned = (warp + weft - 2.0 * shear) * s**2 * c**2 + shear * (c**2 - s**2) ** 2
    return float(along), float(across), float(turned)


@dataclass(frozen=True, kw_only=True)
class ByVertex:
    """Lists of what is around each vertex: `offset` #V+1, where the entries of each vertex begin, and what is there."""

    offset: IntArray
    entry: IntArray


@dataclass(frozen=True, kw_only=True)
class SpringsAround(ByVertex):
    """The springs around each vertex, and for each entry the vertex at the far end, by which they are sorted."""

    neighbor: IntArray


@dataclass(frozen=True, kw_only=True)
class _Unweighed:
    """Of a surface's springs what no fabric changes: as in SpringArrays."""

    ends: IntArray
    rest_length: FloatArray
    edge_count: int
    around: SpringsAround


@dataclass(frozen=True, kw_only=True)
class SpringArrays:
    """The springs once each: `ends` #S by 2, `rest_length` #S [m], `stiffness` #S [N/m]; the first #E are the mesh edges. Which of them
    are `around` each vertex."""

    ends: IntArray
    rest_length: FloatArray
    stiffness: FloatArray
    edge_count: int
    around: SpringsAround
    clamped_cells: int = 0


@dataclass(frozen=True, kw_only=True)
class CellArrays:
    """The cells, face by face (see `kernels.cells`).

    Attributes:
        faces: #F by 4, -1 in the last column of a triangle.
        first: #F, the first of each face's cells.
        laid: #C by 3, the cells laid flat [m].
        around: the faces' corners around each vertex, 4 times the face plus the corner.
    """

    faces: IntArray
    first: IntArray
    laid: FloatArray
    around: ByVertex

    @cached_property
    def of_face(self) -> IntArray:
        """#F+1, where the cells of each face begin."""
        return np.append(self.first, np.int32(len(self.laid)))

    @cached_property
    def _corners(self) -> tuple[IntArray, IntArray, FloatArray]:
        return corner_triangles(self.faces)

    @property
    def corner(self) -> IntArray:
        """#C by 3, the cells' vertices."""
        return self._corners[0]

    @property
    def face(self) -> IntArray:
        """#C, the face of each."""
        return self._corners[1]

    @property
    def weight(self) -> FloatArray:
        """#C, 1 for a triangle, 1/2 for each of a quad's four corner triangles."""
        return self._corners[2]

    @cached_property
    def edges(self) -> FloatArray:
        """#C by 2 by 2, the edges of the laid cells from corner 0 to corners 1 and 2, as columns [m]."""
        edges = np.zeros((len(self.laid), 2, 2))
        edges[:, 0, 0], edges[:, 0, 1], edges[:, 1, 1] = self.laid.T
        return edges

    @cached_property
    def area(self) -> FloatArray:
        """#C, weighted areas on the body [m2]."""
        return np.asarray(0.5 * self.weight * self.laid[:, 0] * self.laid[:, 2])

    @cached_property
    def vertex_areas(self) -> FloatArray:
        """#V [m2], a third of each cell's share of the cloth at each of its corners."""
        around, total = self.around, np.empty(len(self.around.offset) - 1)
        given = [self.faces, self.first, self.laid, around.offset, around.entry]
        launch_each(add_areas, len(total), given, [total])
        return total

    def least_shares(self, positions: FloatArray) -> FloatArray:
        """#F, signed area in a layout (#V by 2 [m]) over that on the body, the least of each face's cells."""
        share = np.empty(len(self.faces))
        given = [np.ascontiguousarray(positions, dtype=np.float64), self.faces, self.first, self.laid]
        launch_each(find_least_shares, len(share), given, [share])
        return share


@once_per_surface
def _creases_of(surface: Surface) -> NDArray[np.int8]:
    if not surface.is_quad.any():
        return quad_creases(surface.vertices, surface.faces)
    around = _corners_of(surface)
    return quad_creases(
        surface.vertices, surface.faces, sides=half_edges_of(surface), around=(around.offset, around.entry)
    )


@once_per_surface
def cells_of(surface: Surface) -> CellArrays:
    """The surface's cells, each laid flat; the four of a creased quad come from the one quad that it unfolds into."""
    faces, first = surface.faces, _first_of(surface, 4, 1)
    laid = lay_cells(surface.vertices, faces, _creases_of(surface), first)
    return read_only(CellArrays(faces=faces, first=first, laid=laid, around=_corners_of(surface)))


@once_per_faces
def _corners_of(surface: Surface) -> ByVertex:
    """The faces' corners around each vertex, 4 times the face plus the corner."""
    offset, entry = corners_around(surface.faces, len(surface.vertices))
    return read_only(ByVertex(offset=offset, entry=entry))


def _first_of(surface: Surface, of_quad: int, of_triangle: int) -> IntArray:
    """#F, the first of each face's cells or sides, where a quad and a triangle have so many."""
    counts = np.where(surface.is_quad, np.int32(of_quad), np.int32(of_triangle))
    return np.cumsum(counts, dtype=np.int32) - counts


def _corners_at(corner: IntArray, count: int) -> ByVertex:
    """Of triples or other tuples of vertices, where each vertex is among them, counted through."""
    entry, offset = order_by(corner.ravel(), count)
    return read_only(ByVertex(offset=offset, entry=entry))


@once_per_surface
def _unweighed(surface: Surface) -> _Unweighed:
    vertices, edge_count = surface.vertices, len(half_edges_of(surface).edges)
    diagonal, _ = unfold_quad_diagonals(vertices, surface.faces, crease=_creases_of(surface))
    ends, around = _ends_of(surface)
    rest_length = np.empty(len(ends))
    rest_length[edge_count:] = diagonal.T.ravel()
    launch_each(measure_edges, edge_count, [vertices, ends], [rest_length])
    return read_only(
        _Unweighed(
            ends=ends,
            rest_length=rest_length,
            edge_count=edge_count,
            around=around,
        )
    )


@once_per_faces
def _ends_of(surface: Surface) -> tuple[IntArray, SpringsAround]:
    """#S by 2, the ends of the springs, edges first, then diagonals; and the springs around each vertex."""
    corner = rows_of(surface.faces, surface.is_quad)
    ends = np.concatenate([half_edges_of(surface).edges, corner[:, 0::2], corner[:, 1::2]])
    return ends, _springs_at(ends, len(surface.vertices))


def _springs_at(ends: IntArray, count: int) -> SpringsAround:
    end, offset = order_by(ends[:, ::-1].T.ravel(), count)
    neighbor, spring = np.empty(ends.size, dtype=np.int32), np.empty(ends.size, dtype=np.int32)
    launch_each(list_springs, count, [offset, end, ends, len(ends)], [neighbor, spring])
    return read_only(SpringsAround(offset=offset, entry=spring, neighbor=neighbor))


def springs_of(surface: Surface, fabric: Fabric, positions: FloatArray, *, grain_angle: float = 0.0) -> SpringArrays:
    """Springs with rest lengths from space and stiffnesses from the fabric.

    Args:
        surface: of quads and/or triangles.
        fabric: stiffnesses [N/m].
        positions: #V by 2, a layout [m]: directions are measured in the plane against the grain, since threads are
            straight in the cloth and not on the body.
        grain_angle: of the warp against +y, degrees.
    """
    own, faces, is_quad = _unweighed(surface), surface.faces, surface.is_quad
    warp, _ = grain_axes(grain_angle)
    first = _first_of(surface, 4, 3)
    sides = half_edges_of(surface).edge
    of_side, stiffness = np.empty(len(sides)), np.empty(len(own.ends))
    position, clamped = np.ascontiguousarray(positions, dtype=np.float64), 0
    if not is_quad.all():
        triangles = rows_of(faces, ~is_quad)
        given = [surface.vertices, position, triangles, rows_of(first, ~is_quad), wp.vec2d(*warp), _compliance(fabric)]
        launch_each(weigh_triangles, len(triangles), given, [of_side])
    if is_quad.any():
        quads = rows_of(faces, is_quad)
        diagonal, over = np.empty(len(quads)), np.empty(len(quads), dtype=np.int8)
        given = [surface.vertices, position, quads, rows_of(first, is_quad), _lattice(fabric, quads, position, warp)]
        launch_each(weigh_quads, len(quads), given, [of_side, diagonal, over])
        stiffness[own.edge_count :] = np.concatenate([diagonal, diagonal])
        clamped = int(np.count_nonzero(over))
    stiffness[: own.edge_count] = np.bincount(sides, of_side, minlength=own.edge_count)
    return SpringArrays(
        ends=own.ends,
        rest_length=own.rest_length,
        stiffness=stiffness,
        edge_count=own.edge_count,
        around=own.around,
        clamped_cells=clamped,
    )


def _compliance(fabric: Fabric) -> wp.vec3d:
    """1/K [m/N] of a strip of the cloth cut at an angle from the warp and pulled along itself, as coefficients of cos^4, sin^4 and
    sin^2 cos^2: 1/K_warp, 1/K_weft and 1/G - 2 nu/K_warp."""
    cross = 1.0 / fabric.shear_stiffness - 2.0 * fabric.poisson_ratio / fabric.stiffness_warp
    return wp.vec3d(1.0 / fabric.stiffness_warp, 1.0 / fabric.stiffness_weft, cross)


def _lattice(fabric: Fabric, quads: IntArray, positions: FloatArray, warp: FloatArray) -> Lattice:
    """The fabric along the quads' edges.

    The angle between cells and grain is that of the whole piece (the mean over its cells, taken with the fourfold
    symmetry of a grid).
    """
    fourfold = np.empty((len(quads), 2))
    launch_each(find_directions, len(quads), [positions, quads, wp.vec2d(*warp)], [fourfold])
    cosine, sine = fourfold.sum(axis=0)
    lattice = Lattice()
    lattice.warp = wp.vec2d(*warp)
    lattice.angle = float(np.arctan2(sine, cosine)) / 4.0
    lattice.along, lattice.across, lattice.shear = quad_stiffness(fabric, lattice.angle)
    lattice.least = _LEAST_STRUCTURAL_SHARE
    return lattice


def _shortened(
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
    return replace(springs, rest_length=springs.rest_length / np.where(worn > 0.0, worn, 1.0))


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
    stiffness = np.bincount(side, weights.ravel(), minlength=len(springs.ends)).astype(np.float64)
    return replace(springs, stiffness=stiffness, clamped_cells=0)


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
    lists = [around.offset, around.neighbor, around.entry]
    given = [layout, *lists, springs.rest_length, springs.stiffness, cells_of(surface).vertex_areas, wp.vec2d(*warp)]
    launch_each(measure_hold, count, given, [hold])
    hold[surface.faces[is_quad].ravel()] = np.inf
    return _HOLD_SHARE * float(np.partition(hold, count // 4)[count // 4])


@dataclass(kw_only=True)
class SpringNetwork:
    """The mass-spring model of one piece on a device.

    Attributes:
        surface, fabric, grain_angle: what it was made from.
        spring_arrays, cell_arrays: the same on the host, springs and cells once each.
        model: "springs", with their guard, or "membrane".
        stretch: #F by 2, length worn over length flat that is meant along warp and weft; None where none is.
        held: #C by 3, what the k_ij hold of each cell's corners [N/m], for a membrane.
        shear_hold: shear stiffness of the springs that keeps threads straight [N/m], one for all or #F; the fabric's where that is less.
        parts: the networks of which this one was joined, to be relaxed side by side (see `warpflat.joined`); none of any other.
        springs, cells, guard, cloth: what the kernels take.
        mass: #V [kg]. spring_stiffness: #V, sum of k_ij around each vertex, and a half of the stiffest [N/m].
        device: Warp device.
    """

    surface: Surface
    fabric: Fabric
    grain_angle: float
    spring_arrays: SpringArrays
    cell_arrays: CellArrays
    device: wp.Device
    model: Model = "springs"
    stretch: FloatArray | None = None
    held: FloatArray | None = None
    shear_hold: float | FloatArray = np.inf
    parts: Sequence[SpringNetwork] = ()
    springs: Springs = field(init=False)
    cells: Cells = field(init=False)
    guard: ThreadGuard = field(init=False)
    cloth: Cloth | None = field(init=False, default=None)
    seams: Seams | None = field(init=False, default=None)
    bonds: Bonds = field(init=False)
    mass: wp.array = field(init=False)
    spring_stiffness: wp.array = field(init=False)

    @classmethod
    def build(
        cls,
        surface: Surface,
        fabric: Fabric,
        positions: FloatArray,
        *,
        grain_angle: float = 0.0,
        device: str | wp.Device | None = None,
        model: Model = "springs",
        stretch: FloatArray | None = None,
        hold: float | None = None,
    ) -> SpringNetwork:
        """Network for the surface, with directions measured in the layout `positions` (#V by 2 [m]).

        Args:
            surface, fabric: what it is of.
            positions: #V by 2, a layout [m].
            grain_angle: of the warp against +y, degrees.
            device: Warp device.
            model: "springs" or "membrane".
            stretch: #F by 2, length worn over length flat that is meant along warp and weft. Springs and cells then are at
                rest in a pattern that is so much smaller.
            hold: `shear_hold`, if it is not to be measured.

        Raises:
            InputError: an unknown model.
        """
        check_model(model)
        springs, cells = springs_of(surface, fabric, positions, grain_angle=grain_angle), cells_of(surface)
        if stretch is not None:
            springs = _shortened(springs, surface, positions, grain_axes(grain_angle), stretch)
        held = None
        if model == "membrane":
            meant = np.ones((len(cells.laid), 2)) if stretch is None else stretch[cells.face]
            weights, held = step_matrix(
                fabric, grain_axes(grain_angle), cells.corner, cells.edges, cells.area, positions, meant
            )
            springs, hold = with_stiffness(springs, cells, weights), np.inf
        elif hold is None:
            hold = shear_hold(surface, springs, positions, grain_axes(grain_angle)[0])
        return cls(
            surface=surface,
            fabric=fabric,
            grain_angle=grain_angle,
            spring_arrays=springs,
            cell_arrays=cells,
            device=wp.get_device(device),
            model=model,
            stretch=stretch,
            held=held,
            shear_hold=hold,
        )

    def __post_init__(self) -> None:
        s, c, device, count = self.spring_arrays, self.cell_arrays, self.device, self.vertex_count
        at, corners = s.around, c.around
        springs = Springs()
        springs.offset = _on(device, at.offset, wp.int32)
        springs.neighbor = _on(device, at.neighbor, wp.int32)
        springs.index = _on(device, at.entry, wp.int32)
        springs.rest_length = _on(device, s.rest_length, wp.float64)
        # Those of a membrane follow its layout (`weigh`); the arrays keep those that it was made with.
        springs.stiffness = _on(device, s.stiffness.copy() if self.model == "membrane" else s.stiffness, wp.float64)
        springs.pull = 1.0 if self.model == "springs" else 0.0
        self.springs = springs
        self.spring_stiffness = wp.empty(count, dtype=wp.float64, device=device)
        self._add_stiffness()

        self.mass = _on(device, self.fabric.areal_density * c.vertex_areas, wp.float64)
        cells = Cells()
        cells.face = _on(device, c.faces, wp.vec4i)
        cells.first = _on(device, c.first, wp.int32)
        cells.laid = _on(device, c.laid, wp.vec3d)
        cells.offset = _on(device, corners.offset, wp.int32)
        cells.slot = _on(device, corners.entry, wp.int32)
        slack = np.broadcast_to(np.ones(2), (self.face_count, 2)) if self.stretch is None else 1.0 / self.stretch
        cells.slack = _on(device, slack, wp.vec2d)
        fabric = self.fabric
        hold = np.minimum(fabric.shear_stiffness, self.shear_hold)
        onset = np.stack([hold / fabric.stiffness_warp, hold / fabric.stiffness_weft], axis=-1)
        cells.onset = _on(device, np.broadcast_to(onset, (self.face_count, 2)), wp.vec2d)
        self.cells = cells
        self.bonds = Bonds()
        self.bonds.offset = wp.zeros(count + 1, dtype=wp.int32, device=device)
        self.bonds.slot = wp.zeros(0, dtype=wp.int32, device=device)
        self.bonds.freedom = wp.array(np.ones((count, 2)), dtype=wp.vec2d, device=device)

        warp, weft = grain_axes(self.grain_angle)
        guard = ThreadGuard()
        guard.warp, guard.weft = wp.vec2d(*warp), wp.vec2d(*weft)
        guard.stiffness_warp, guard.stiffness_weft = fabric.stiffness_warp, fabric.stiffness_weft
        self.guard = guard
        if self.held is not None:
            # What exceeds the stretch that is meant is small, and measured with the secant stiffness.
            self.cloth = cloth_of(fabric, (warp, weft), device, curves=self.stretch is None, held=self.held.ravel())

    def weigh(self, stiffness: FloatArray) -> None:
        """Give the springs (#S) of a membrane these k_ij [N/m]; `spring_arrays` keeps those that it was made with."""
        assert self.cloth is not None
        self.springs.stiffness.assign(stiffness)
        self._add_stiffness()

    def _add_stiffness(self) -> None:
        given = [self.springs.offset, self.springs.index, self.springs.stiffness, _PAIR_SHARE]
        launch_each(add_stiffness, self.vertex_count, given, [self.spring_stiffness], device=self.device)

    @property
    def cell_model(self) -> tuple[wp.Kernel, wp.Kernel, ThreadGuard | Cloth]:
        """Kernels of the forces and of the energy on the cells, and their parameters."""
        if self.cloth is None:
            return evaluate_guard, compute_guard_energy, self.guard
        return evaluate_membrane, compute_membrane_energy, self.cloth

    @property
    def pieces(self) -> Sequence[SpringNetwork]:
        """Of each piece that is relaxed on its own its network: the parts of a joined one, otherwise this one."""
        return self.parts or (self,)

    @property
    def vertex_count(self) -> int:
        """#V."""
        return len(self.surface.vertices)

    @property
    def cell_count(self) -> int:
        """#C."""
        return len(self.cell_arrays.laid)

    @property
    def face_count(self) -> int:
        """#F."""
        return len(self.cell_arrays.faces)

    @property
    def seam_count(self) -> int:
        """#P, pairs of edges that are sewn together."""
        return 0 if self.seams is None else len(self.seams.ends)

    def sew(
        self,
        ends: IntArray,
        ratio: FloatArray,
        stiffness: FloatArray,
        *,
        kind: IntArray | None = None,
        target: FloatArray | None = None,
        lever: FloatArray | None = None,
    ) -> None:
        """Hold lengths and places to one another (see `kernels.seams`); by default, sew pairs of edges together.

        Args:
            ends: #P by 4, vertices of the first edge, then of the second.
            ratio: #P, wished length of the first over the second.
            stiffness: #P [N/m].
            kind: #P, of `kernels.seams`.
            target: #P [m].
            lever: #P by 4 by 2.
        """
        count, device = len(ends), self.device
        seams = Seams()
        seams.ends = wp.array(ends, dtype=wp.vec4i, device=device)
        seams.kind = wp.array(np.zeros(count, dtype=np.int32) if kind is None else kind, dtype=wp.int32, device=device)
        seams.ratio = wp.array(ratio, dtype=wp.float64, device=device)
        seams.target = wp.array(np.zeros(count) if target is None else target, dtype=wp.float64, device=device)
        levers = np.zeros((4 * count, 2)) if lever is None else lever.reshape(-1, 2)
        seams.lever = wp.array(levers, dtype=wp.vec2d, device=device)
        seams.stiffness = wp.array(stiffness, dtype=wp.float64, device=device)
        seams.offset = wp.zeros(count, dtype=wp.float64, device=device)
        self.seams = seams
        at = _corners_at(ends, self.vertex_count)
        self.bonds.offset = _on(device, at.offset, wp.int32)
        self.bonds.slot = _on(device, at.entry, wp.int32)

    def guide(self, vertices: IntArray) -> None:
        """Let these vertices move up and down only, as on a fold or a straight centre front."""
        freedom = np.ones((self.vertex_count, 2))
        freedom[vertices, 0] = 0.0
        self.bonds.freedom = wp.array(freedom, dtype=wp.vec2d, device=self.device)

    @property
    def spring_count(self) -> int:
        """#S."""
        return len(self.spring_arrays.ends)


def _on(device: wp.Device, values: NDArray[np.generic], dtype: type) -> wp.array:
    """The values on the device; on the CPU these very ones, one number for all rows included."""
    there = values if device.is_cpu else np.ascontiguousarray(values)
    return wp.array(there, dtype=dtype, device=device, copy=False)
