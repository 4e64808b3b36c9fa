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

from dataclasses import dataclass, field, replace

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpflat.fabric import Fabric
from warpflat.kernels.cells import Cells, ThreadGuard, compute_guard_energy, evaluate_guard
from warpflat.kernels.implicit import Bonds
from warpflat.kernels.membrane import Cloth, compute_membrane_energy, evaluate_membrane
from warpflat.kernels.seams import Seams
from warpflat.kernels.springs import Springs
from warpflat.membrane import Model, check_model, cloth_of, step_matrix
from warpflat.surface.mesh import Surface, once_per_surface
from warpflat.surface.topology import corner_triangles, half_edges, stable_order, unfold_quad_diagonals
from warpflat.surface.unfold import lay_quads_flat, quad_creases
from warpflat.surface.vectors import cross, dot, norm, points_at

__all__ = ["SpringNetwork", "cells_of", "grain_axes", "springs_of", "vertex_masses"]

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


def thread_stiffness(fabric: Fabric, angle: FloatArray) -> FloatArray:
    """Stiffness [N/m] of a strip of the cloth cut at `angle` [rad] from the warp and pulled along itself.

    1/K = cos^4/K_warp + sin^4/K_weft + sin^2 cos^2 (1/G - 2 nu/K_warp).
    """
    c2, s2 = np.cos(angle) ** 2, np.sin(angle) ** 2
    cross = 1.0 / fabric.shear_stiffness - 2.0 * fabric.poisson_ratio / fabric.stiffness_warp
    return 1.0 / (c2 * c2 / fabric.stiffness_warp + s2 * s2 / fabric.stiffness_weft + s2 * c2 * cross)


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
class SpringArrays:
    """The springs once each: `ends` #S by 2, `rest_length` #S [m], `stiffness` #S [N/m]; the first #E are the mesh edges."""

    ends: IntArray
    rest_length: FloatArray
    stiffness: FloatArray
    edge_count: int
    clamped_cells: int = 0


@dataclass(frozen=True, kw_only=True)
class CellArrays:
    """The cells: `corner` #C by 3, `face` #C, `edges` #C by 2 by 2 [m] (see `kernels.cells`), `area` #C weighted [m2]."""

    corner: IntArray
    face: IntArray
    weight: FloatArray
    edges: FloatArray
    area: FloatArray


@once_per_surface
def _creases_of(surface: Surface) -> tuple[NDArray[np.int8], IntArray]:
    return quad_creases(surface.vertices, surface.faces)


@once_per_surface
def cells_of(surface: Surface) -> CellArrays:
    """The surface's cells, each laid flat; the four of a creased quad come from the one quad that it unfolds into."""
    corner, face, weight = corner_triangles(surface.faces)
    p = points_at(surface.vertices, corner.T)
    flat, creased, _ = lay_quads_flat(surface.vertices, surface.faces, creases=_creases_of(surface))
    is_creased = np.zeros(len(surface.faces), dtype=bool)
    is_creased[creased] = True
    around = np.flatnonzero(is_creased[face])
    laid = flat[:, [[3, 0, 1], [0, 1, 2], [1, 2, 3], [2, 3, 0]]].reshape(-1, 3, 2)
    p[:2, :, around] = laid.T
    p[2, :, around] = 0.0
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    length, twice = norm(a), norm(cross(a, b))
    safe = np.where(length > 0, length, 1.0)
    edges = np.zeros((len(corner), 2, 2))
    edges[:, 0, 0] = length
    edges[:, 0, 1] = dot(a, b) / safe
    edges[:, 1, 1] = twice / safe
    return CellArrays(corner=corner, face=face, weight=weight, edges=edges, area=0.5 * weight * twice)


def springs_of(surface: Surface, fabric: Fabric, positions: FloatArray, *, grain_angle: float = 0.0) -> SpringArrays:
    """Springs with rest lengths from space and stiffnesses from the fabric.

    Args:
        surface: of quads and/or triangles.
        fabric: stiffnesses [N/m].
        positions: #V by 2, a layout [m]: directions are measured in the plane against the grain, since threads are
            straight in the cloth and not on the body.
        grain_angle: of the warp against +y, degrees.
    """
    he = half_edges(surface.faces)
    edges, vertices = he.edges, surface.vertices
    length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    warp, _ = grain_axes(grain_angle)
    stiffness = np.zeros(len(edges))

    is_quad = surface.faces[he.face, 3] >= 0
    triangles = np.flatnonzero(~surface.is_quad)
    if len(triangles):
        p = vertices[surface.faces[triangles, :3]]
        area = np.zeros(len(surface.faces))
        area[triangles] = 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
        beside = np.bincount(he.edge[~is_quad], area[he.face[~is_quad]], minlength=len(edges))
        d = positions[edges[:, 1]] - positions[edges[:, 0]]
        angle = np.arctan2(warp[0] * d[:, 1] - warp[1] * d[:, 0], d @ warp)
        stiffness += thread_stiffness(fabric, angle) * beside / np.where(length > 0, length, 1.0) ** 2

    quads = np.flatnonzero(surface.is_quad)
    ends = [edges]
    rest = [length]
    stiff = [stiffness]
    clamped = 0
    if len(quads):
        corner = surface.faces[quads]
        sides = np.linalg.norm(vertices[np.roll(corner, -1, axis=1)] - vertices[corner], axis=2)
        ha, hb = 0.5 * (sides[:, 0] + sides[:, 2]), 0.5 * (sides[:, 1] + sides[:, 3])
        ka, kb, shear = _cell_stiffness(fabric, corner, positions, warp)
        ratio = hb / ha
        half_a = 0.5 * np.maximum(ka - shear / ratio**2, _LEAST_STRUCTURAL_SHARE * ka) * ratio
        half_b = 0.5 * np.maximum(kb - shear * ratio**2, _LEAST_STRUCTURAL_SHARE * kb) / ratio
        least = 1.0 - _LEAST_STRUCTURAL_SHARE
        clamped = int(((shear / ratio**2 > least * ka) | (shear * ratio**2 > least * kb)).sum())
        row = np.full(len(surface.faces), -1)
        row[quads] = np.arange(len(quads))
        of_quad = np.flatnonzero(is_quad)
        share = np.where(he.slot[of_quad] % 2 == 0, half_a[row[he.face[of_quad]]], half_b[row[he.face[of_quad]]])
        stiffness += np.bincount(he.edge[of_quad], share, minlength=len(edges))
        diagonal, _ = unfold_quad_diagonals(vertices, surface.faces)
        creased, _ = _creases_of(surface)
        for k in (0, 1):
            # A crease is straight itself.
            along = corner[creased == k][:, [k, k + 2]]
            diagonal[creased == k, k] = np.linalg.norm(vertices[along[:, 1]] - vertices[along[:, 0]], axis=1)
        k = shear * (ha**2 + hb**2) / (2.0 * ha * hb)
        ends += [corner[:, [0, 2]], corner[:, [1, 3]]]
        rest += [diagonal[:, 0], diagonal[:, 1]]
        stiff += [k, k]
    return SpringArrays(
        ends=np.concatenate(ends).astype(np.int32),
        rest_length=np.concatenate(rest),
        stiffness=np.concatenate(stiff),
        edge_count=len(edges),
        clamped_cells=clamped,
    )


def _cell_stiffness(
    fabric: Fabric, corner: IntArray, positions: FloatArray, warp: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """K along edges 0-1 and 2-3, K along edges 1-2 and 3-0, and G, per quad.

    The angle between cells and grain is that of the whole piece (the mean over its cells, taken with the fourfold
    symmetry of a grid), and which pair of edges is nearer to the warp is each cell's own.
    """
    p = positions[corner]
    first = (p[:, 1] - p[:, 0]) + (p[:, 2] - p[:, 3])
    angle = np.arctan2(warp[0] * first[:, 1] - warp[1] * first[:, 0], first @ warp)
    mean = np.angle(np.exp(4j * angle).sum()) / 4.0
    along, across, shear = quad_stiffness(fabric, float(mean))
    swapped = np.round((angle - mean) / (np.pi / 2)).astype(int) % 2 == 1
    return np.where(swapped, across, along), np.where(swapped, along, across), np.full(len(corner), shear)


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


def springs_of_sides(springs: SpringArrays, cells: CellArrays) -> NDArray[np.int64]:
    """3 #C, the spring along each cell's edges 0-1, 1-2, 2-0."""
    size = np.int64(springs.ends.max()) + 1
    keys = np.sort(springs.ends, axis=1).astype(np.int64) @ np.array([size, 1])
    order = np.argsort(keys)
    sides = np.sort(np.stack([cells.corner, np.roll(cells.corner, -1, axis=1)], axis=-1), axis=-1).astype(np.int64)
    return np.asarray(order[np.searchsorted(keys[order], (sides @ np.array([size, 1])).ravel())])


def with_stiffness(springs: SpringArrays, cells: CellArrays, weights: FloatArray) -> SpringArrays:
    """The springs with the sums of the cells' weights (#C by 3, along the edges 0-1, 1-2, 2-0) as k_ij."""
    side = springs_of_sides(springs, cells)
    stiffness = np.bincount(side, weights.ravel(), minlength=len(springs.ends)).astype(np.float64)
    return replace(springs, stiffness=stiffness, clamped_cells=0)


def stiffness_around(ends: IntArray, stiffness: FloatArray, count: int) -> FloatArray:
    """#V, the sum of the k_ij around each vertex, and a half of the stiffest [N/m]; of springs `ends` (#S by 2)."""
    at, twice = ends.T.ravel(), np.tile(stiffness, 2)
    stiffest = np.zeros(count)
    np.maximum.at(stiffest, at, twice)
    return np.asarray(np.bincount(at, twice, minlength=count) + _PAIR_SHARE * stiffest)


def vertex_masses(cells: CellArrays, fabric: Fabric, vertex_count: int) -> FloatArray:
    """#V [kg], a third of each cell's share of the cloth at each of its corners."""
    share = np.repeat(fabric.areal_density * cells.area / 3.0, 3)
    return np.bincount(cells.corner.ravel(), share, minlength=vertex_count).astype(np.float64)


def shear_hold(
    surface: Surface, springs: SpringArrays, cells: CellArrays, positions: FloatArray, warp: FloatArray
) -> float:
    """Shear stiffness [N/m] that the springs between triangles really have against warp and weft.

    They shear as their directions happen to lie: split squares have K(45 degrees)/4, and threads between them kink at
    that over K, not at G/K. Taken per vertex, sum of 1/2 k L^2 cos^2 sin^2 over its share of the area, infinite beside a quad,
    and of these three quarters of the lower quartile: one value for the piece, and the same on a finer mesh of its kind.

    Args:
        surface, springs, cells: of the piece.
        positions: #V by 2, a layout [m].
        warp: unit vector in the plane.
    """
    d = positions[springs.ends[:, 1]] - positions[springs.ends[:, 0]]
    along, across = d @ warp, d @ np.array([warp[1], -warp[0]])
    length2 = np.maximum(along**2 + across**2, np.finfo(np.float64).tiny)
    half = 0.5 * springs.stiffness * springs.rest_length**2 * (along * across / length2) ** 2
    count = len(surface.vertices)
    held = np.bincount(springs.ends[:, 0], half, count) + np.bincount(springs.ends[:, 1], half, count)
    hold = held / np.bincount(cells.corner.ravel(), np.repeat(cells.area / 3.0, 3), count)
    hold[surface.faces[surface.is_quad].ravel()] = np.inf
    return _HOLD_SHARE * float(np.sort(hold)[count // 4])


@dataclass(kw_only=True)
class SpringNetwork:
    """The mass-spring model of one piece on a device.

    Attributes:
        surface, fabric, grain_angle: what it was made from.
        spring_arrays, cell_arrays: the same on the host, springs and cells once each.
        model: "springs", with their guard, or "membrane".
        stretch: #F by 2, length worn over length flat that is meant along warp and weft; None where none is.
        held: #C by 3, what the k_ij hold of each cell's corners [N/m], for a membrane.
        shear_hold: shear stiffness of the springs that keeps threads straight [N/m]; the fabric's where that is less.
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
    shear_hold: float = np.inf
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

        Raises:
            InputError: an unknown model.
        """
        check_model(model)
        springs, cells = springs_of(surface, fabric, positions, grain_angle=grain_angle), cells_of(surface)
        if stretch is not None:
            springs = _shortened(springs, surface, positions, grain_axes(grain_angle), stretch)
        held, hold = None, np.inf
        if model == "springs":
            hold = shear_hold(surface, springs, cells, positions, grain_axes(grain_angle)[0])
        else:
            meant = np.ones((len(cells.corner), 2)) if stretch is None else stretch[cells.face]
            weights, held = step_matrix(
                fabric, grain_axes(grain_angle), cells.corner, cells.edges, cells.area, positions, meant
            )
            springs = with_stiffness(springs, cells, weights)
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
        count, s, c = len(self.surface.vertices), self.spring_arrays, self.cell_arrays
        here = np.concatenate([s.ends[:, 0], s.ends[:, 1]])
        there = np.concatenate([s.ends[:, 1], s.ends[:, 0]])
        order, offset = _by_vertex(here, there, count)
        both = np.tile(np.arange(len(s.ends)), 2)[order]
        device = self.device
        springs = Springs()
        springs.offset = wp.array(offset, dtype=wp.int32, device=device)
        springs.neighbor = wp.array(there[order], dtype=wp.int32, device=device)
        springs.rest_length = wp.array(s.rest_length[both], dtype=wp.float64, device=device)
        springs.stiffness = wp.array(s.stiffness[both], dtype=wp.float64, device=device)
        springs.pull = 1.0 if self.model == "springs" else 0.0
        self.springs = springs
        around = stiffness_around(s.ends, s.stiffness, count)
        self.spring_stiffness = wp.array(around, dtype=wp.float64, device=device)
        self.mass = wp.array(vertex_masses(c, self.fabric, count), dtype=wp.float64, device=device)

        slot, cell_offset = _by_vertex(c.corner.ravel(), np.zeros(c.corner.size, dtype=np.int32), count)
        cells = Cells()
        cells.corner = wp.array(c.corner, dtype=wp.vec3i, device=device)
        cells.edges = wp.array(c.edges, dtype=wp.mat22d, device=device)
        cells.weight = wp.array(c.weight, dtype=wp.float64, device=device)
        cells.offset = wp.array(cell_offset, dtype=wp.int32, device=device)
        cells.slot = wp.array(slot.astype(np.int32), dtype=wp.int32, device=device)
        slack = np.ones((len(c.corner), 2)) if self.stretch is None else 1.0 / self.stretch[c.face]
        cells.slack = wp.array(slack, dtype=wp.vec2d, device=device)
        self.cells = cells
        self.bonds = Bonds()
        self.bonds.offset = wp.zeros(count + 1, dtype=wp.int32, device=device)
        self.bonds.slot = wp.zeros(0, dtype=wp.int32, device=device)
        self.bonds.freedom = wp.array(np.ones((count, 2)), dtype=wp.vec2d, device=device)

        warp, weft = grain_axes(self.grain_angle)
        fabric = self.fabric
        guard = ThreadGuard()
        guard.warp, guard.weft = wp.vec2d(*warp), wp.vec2d(*weft)
        guard.stiffness_warp, guard.stiffness_weft = fabric.stiffness_warp, fabric.stiffness_weft
        hold = min(fabric.shear_stiffness, self.shear_hold)
        guard.onset_warp, guard.onset_weft = hold / fabric.stiffness_warp, hold / fabric.stiffness_weft
        self.guard = guard
        if self.held is not None:
            # What exceeds the stretch that is meant is small, and measured with the secant stiffness.
            self.cloth = cloth_of(fabric, (warp, weft), device, curves=self.stretch is None, held=self.held.ravel())

    @property
    def cell_model(self) -> tuple[wp.Kernel, wp.Kernel, ThreadGuard | Cloth]:
        """Kernels of the forces and of the energy on the cells, and their parameters."""
        if self.cloth is None:
            return evaluate_guard, compute_guard_energy, self.guard
        return evaluate_membrane, compute_membrane_energy, self.cloth

    @property
    def vertex_count(self) -> int:
        """#V."""
        return len(self.surface.vertices)

    @property
    def cell_count(self) -> int:
        """#C."""
        return len(self.cell_arrays.corner)

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
        slot, offset = _by_vertex(ends.ravel(), np.zeros(ends.size, dtype=np.int32), self.vertex_count)
        self.bonds.offset = wp.array(offset, dtype=wp.int32, device=device)
        self.bonds.slot = wp.array(slot.astype(np.int32), dtype=wp.int32, device=device)

    def guide(self, vertices: IntArray) -> None:
        """Let these vertices move up and down only, as on a fold or a straight centre front."""
        freedom = np.ones((self.vertex_count, 2))
        freedom[vertices, 0] = 0.0
        self.bonds.freedom = wp.array(freedom, dtype=wp.vec2d, device=self.device)

    @property
    def spring_count(self) -> int:
        """#S."""
        return len(self.spring_arrays.ends)


def _by_vertex(
    vertex: NDArray[np.integer], then_by: NDArray[np.integer], count: int
) -> tuple[NDArray[np.int64], IntArray]:
    """Order that sorts entries by vertex, and #count+1, where each vertex's begin."""
    order = stable_order(vertex * (np.int64(then_by.max(initial=0)) + 1) + then_by)
    offset = np.zeros(count + 1, dtype=np.int32)
    np.cumsum(np.bincount(vertex, minlength=count), out=offset[1:])
    return order, offset
