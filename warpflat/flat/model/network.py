"""SpringNetwork: a surface and a fabric as the arrays of a mass-spring model on a device.

**Cells** (`warpflat.flat.surface.cells`) have their shape from the surface, and the cloth is measured in them as worn
(`warpflat.kernels.membrane`): exact on any mesh. The springs along their sides then have no force. Their k_ij bound the
membrane's stiffness, and are the matrix of the approximate implicit step.

**Springs** (`warpflat.flat.model.springs`) are the cloth of quads along the grain. They have their rest lengths from the
surface in space and their stiffnesses from the fabric.

**Threads stay straight.** Edge springs alone have minima that no cloth has. A compressed spring pushes its ends
sideways, k (1 - L/l) < 0, so a thread compressed by more than G/K kinks between its neighbours at the scale of the
mesh, and faces fold over, at *lower* spring energy than any unfolded layout. In cloth the threads are straight in the
plane, and the body stretches them. So the network adds, per cell, the energy of such a thread beyond the strain at
which the springs buckle,

    a [1/2 K_warp <|F e_warp| - 1 - G/K_warp>^2 + 1/2 K_weft <|F e_weft| - 1 - G/K_weft>^2],    <x> = max(x, 0),

with F from the plane to the surface and a the flat area. This guard is zero below its onset. It makes the energy convex
against kinks, since its sideways stiffness outweighs the springs' negative one. It grows without bound as a cell
collapses, so that no face can be mirrored. Its energy is reported as `guard_energy_j`. In an isotropic fabric, whose
grain is only a direction on the table, the principal directions of F take the place of the threads, here and in the
membrane, and nothing depends on the grain.

**Long quads are sheared as a whole.** Along a quad much longer than wide, shear springs with all of G would be stiffer
than the fabric, and would hold no vertex against its four neighbours. Theirs are weaker (`SpringArrays.shear_deficit`),
and their cells add a 1/2 G' (F s . F t)^2 for the deficit G', s along the quad and t across; it counts among the
guard's energy. Where the structural springs left are too weak to hold a vertex against its four neighbours, quads have
hourglass stiffness (`SpringArrays.hourglass`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.launch import launch_each
from warpflat.core.short_repr import short_repr
from warpflat.core.sorting import counting_sort
from warpflat.flat.fabric.fabric import Fabric, grain_axes
from warpflat.flat.model.membrane import Model, choose_model, make_cloth, step_matrix
from warpflat.flat.model.springs import SpringArrays, shorten_springs, spring_geometry, springs_of, with_stiffness
from warpflat.flat.surface.cells import CellArrays, make_cells
from warpflat.flat.surface.mesh import Surface
from warpflat.kernels.cells import Cells
from warpflat.kernels.constraints import Seams, compute_seam_residuals
from warpflat.kernels.guard import ThreadGuard, compute_guard_energy, evaluate_guard, evaluate_guard_potential
from warpflat.kernels.implicit import Bonds
from warpflat.kernels.membrane import compute_membrane_energy, evaluate_membrane, evaluate_membrane_potential
from warpflat.kernels.membrane_cell import Cloth
from warpflat.kernels.springs import Springs
from warpflat.kernels.stiffness import sum_stiffness

__all__ = ["CellModel", "SpringNetwork"]


# Eq. (10) truncates a Neumann series after its second term. Where one spring outweighs all others (the short side of a
# needle), the mode in which its two ends move against each other would get no correction. This share of the stiffest
# spring, added to the sum around a vertex, restores it. On a regular grid it costs a few per cent of the steps.
_PAIR_SHARE = 0.5


@dataclass(frozen=True)
class CellModel:
    """What acts in the cells of some faces, from the first on, so many: the guard of springs, or the membrane.

    Kernels: what a step takes, the energy, and energy and forces at once; and their parameters.
    """

    model: Model
    first: int
    count: int
    step: wp.Kernel
    energy: wp.Kernel
    potential: wp.Kernel
    parameters: ThreadGuard | Cloth


@dataclass(kw_only=True)
class SpringNetwork:
    """The mass-spring model of one piece on a device.

    Attributes:
        surface, fabric, grain_angle: what it was made from.
        spring_arrays, cell_arrays: the springs and cells on the host.
        device: Warp device.
        model: "springs", with their guard, or "membrane"; of pieces beside each other "membrane" where any is one.
        stretch: #F by 2, intended length worn over length flat along warp and weft; None if none is intended.
        held_stiffness: #C by 3, stiffness of the k_ij at each cell's corners [N/m], for a membrane.
        parts: of pieces beside each other the model and the number of faces of each; of one piece its own.
        springs, cells, guard, cloth, seams, bonds: the structs that the kernels take.
    """

    __repr__ = short_repr

    surface: Surface
    fabric: Fabric
    grain_angle: float
    spring_arrays: SpringArrays
    cell_arrays: CellArrays
    device: wp.Device
    model: Model = "springs"
    stretch: FloatArray | None = None
    held_stiffness: FloatArray | None = None
    parts: tuple[tuple[Model, int], ...] = ()
    springs: Springs = field(init=False)
    cells: Cells = field(init=False)
    guard: ThreadGuard = field(init=False)
    cloth: Cloth | None = field(init=False, default=None)
    seams: Seams | None = field(init=False, default=None)
    bonds: Bonds = field(init=False)

    def __reduce__(self) -> tuple[Any, ...]:
        """Let another process have it, which makes the structs anew, sewn and held upright as they are."""
        given = {each.name: getattr(self, each.name) for each in fields(self) if each.init and each.name != "device"}
        names = ("ends", "ratio", "stiffness", "kind", "target", "coefficient", "offset")
        sewn = None if self.seams is None else {name: getattr(self.seams, name).numpy() for name in names}
        upright = np.flatnonzero(self.bonds.freedom.numpy()[:, 0] == 0.0)
        return _make_network, (self.device.alias, given, sewn, upright)

    @classmethod
    def build(
        cls,
        surface: Surface,
        fabric: Fabric,
        positions: FloatArray,
        *,
        grain_angle: float = 0.0,
        device: str | wp.Device | None = None,
        model: Model | None = None,
        stretch: FloatArray | None = None,
    ) -> SpringNetwork:
        """Make the network of a surface.

        Args:
            surface, fabric: the cloth on the body.
            positions: #V by 2, the layout in which the directions of springs are measured [m].
            grain_angle: of the warp against +y, degrees.
            device: Warp device.
            model: "springs", of quads only, or "membrane"; if not given, by mesh and grain (`choose_model`).
            stretch: #F by 2, intended length worn over length flat along warp and weft. Springs and cells are then at
                rest in a pattern that is smaller by this factor.
        """
        model = model or choose_model("auto", surface, fabric, positions, grain_angle=grain_angle)
        cells, axes, held = make_cells(surface), grain_axes(grain_angle), None
        if model == "membrane":
            intended = np.ones((len(cells.laid), 2)) if stretch is None else stretch[cells.face]
            weights, held = step_matrix(fabric, axes, cells.corner, cells.edges, cells.area, positions, intended)
            springs = with_stiffness(spring_geometry(surface), cells, weights)
        else:
            springs = springs_of(surface, fabric, positions, grain_angle=grain_angle)
        if stretch is not None:
            # Quads keep the stiffness of their shape on the body: with that of their flat shape, domes and saddles in knits and woven
            # cloth lay farther from where the membrane has them.
            springs = shorten_springs(springs, surface, positions, axes, stretch)
        return cls(
            surface=surface,
            fabric=fabric,
            grain_angle=grain_angle,
            spring_arrays=springs,
            cell_arrays=cells,
            device=wp.get_device(device),
            model=model,
            stretch=stretch,
            held_stiffness=held,
        )

    def __post_init__(self) -> None:
        s, c, device, count = self.spring_arrays, self.cell_arrays, self.device, self.vertex_count
        at, corners = s.around, c.around
        springs = Springs()
        springs.offset = _on(device, at.offset, wp.int32)
        springs.neighbor = _on(device, at.neighbor, wp.int32)
        springs.rest_length = _on(device, s.listed_length, wp.float64)
        # At these vertices the springs are the cloth.
        active: NDArray[np.int8] = np.broadcast_to(np.int8(self.model == "springs"), count)
        if len({model for model, _ in self.parts}) > 1:
            active, models = np.zeros(count, dtype=np.int8), [model == "springs" for model, _ in self.parts]
            of_springs = c.faces[np.repeat(models, [number for _, number in self.parts])]
            active[of_springs[of_springs >= 0]] = 1
        springs.active = _on(device, active, wp.int8)
        self.springs = springs
        # Those of a membrane change with its layout.
        k_ij = s.listed_stiffness if self.model == "springs" else s.listed_stiffness.copy()
        self.springs.stiffness = _on(self.device, k_ij, wp.float64)

        cells = Cells()
        cells.face = _on(device, c.faces, wp.vec4i)
        cells.first = _on(device, c.first, wp.int32)
        cells.laid = _on(device, c.laid, wp.vec3d)
        cells.offset = _on(device, corners.offset, wp.int32)
        cells.slot = _on(device, corners.entry, wp.int32)
        fabric, faces = self.fabric, self.face_count
        same = partial(_constant, device.alias)
        cells.slack = same(wp.vec2d, 1.0, faces) if self.stretch is None else _on(device, 1.0 / self.stretch, wp.vec2d)
        cells.shear = same(wp.vec2d, 0.0, faces) if s.shear_deficit is None else _on(device, s.shear_deficit, wp.vec2d)
        cells.hourglass = same(wp.vec4d, 0.0, faces) if s.hourglass is None else _on(device, s.hourglass, wp.vec4d)
        self.cells = cells
        self.bonds = Bonds()
        self.bonds.offset = same(wp.int32, 0, count + 1)
        self.bonds.slot = same(wp.int32, 0, 0)
        self.bonds.freedom = same(wp.vec2d, 1.0, count)

        warp, weft = grain_axes(self.grain_angle)
        guard = ThreadGuard()
        guard.warp, guard.weft = wp.vec2d(*warp), wp.vec2d(*weft)
        guard.stiffness_warp, guard.stiffness_weft = fabric.stiffness_warp, fabric.stiffness_weft
        guard.onset = wp.vec2d(
            fabric.shear_stiffness / fabric.stiffness_warp, fabric.shear_stiffness / fabric.stiffness_weft
        )
        guard.isotropic = int(fabric.is_isotropic)
        self.guard = guard
        if self.held_stiffness is not None:
            # Strain beyond an intended stretch is small, and measured with the secant stiffness.
            held = self.held_stiffness.ravel()
            self.cloth = make_cloth(fabric, (warp, weft), device, curves=self.stretch is None, held=held)

    def update_stiffness(self, stiffness: FloatArray) -> None:
        """Set the k_ij of a membrane (#S [N/m]) on the device; `spring_arrays` keeps those of the beginning."""
        self.springs.stiffness.assign(self.spring_arrays.listed(stiffness))
        if "spring_stiffness" in vars(self):
            self._sum_stiffness(self.spring_stiffness)

    def _sum_stiffness(self, around: wp.array) -> None:
        given = [self.springs.offset, self.springs.stiffness, _PAIR_SHARE]
        launch_each(sum_stiffness, self.vertex_count, given, [around], device=self.device)

    # Needed for steps only: a network that is only measured, or a part of a joined one, never makes them.

    @cached_property
    def mass(self) -> wp.array:
        """The mass of each vertex, #V [kg]."""
        return _on(self.device, self.fabric.areal_density * self.cell_arrays.vertex_areas, wp.float64)

    @cached_property
    def spring_stiffness(self) -> wp.array:
        """The sum of the k_ij around each vertex, plus half of the stiffest, #V [N/m]."""
        around = wp.empty(self.vertex_count, dtype=wp.float64, device=self.device)
        self._sum_stiffness(around)
        return around

    @cached_property
    def cell_models(self) -> tuple[CellModel, ...]:
        """What acts in the cells, one for each run of faces of one model."""
        found, first = list[CellModel](), 0
        for model, count in self.parts or ((self.model, self.face_count),):
            if found and found[-1].model == model:
                found[-1] = replace(found[-1], count=found[-1].count + count)
            elif model == "springs":
                kernels = evaluate_guard, compute_guard_energy, evaluate_guard_potential
                found.append(CellModel(model, first, count, *kernels, self.guard))
            else:
                assert self.cloth is not None
                kernels = evaluate_membrane, compute_membrane_energy, evaluate_membrane_potential
                found.append(CellModel(model, first, count, *kernels, self.cloth))
            first += count
        return tuple(found)

    @property
    def vertex_count(self) -> int:
        """The number of vertices, #V."""
        return len(self.surface.vertices)

    @property
    def cell_count(self) -> int:
        """The number of cells, #C."""
        return len(self.cell_arrays.laid)

    @property
    def face_count(self) -> int:
        """The number of faces, #F."""
        return len(self.cell_arrays.faces)

    @property
    def seam_count(self) -> int:
        """The number of seam and constraint equations, #P."""
        return 0 if self.seams is None else len(self.seams.ends)

    def sew(
        self,
        ends: IntArray,
        ratio: FloatArray,
        stiffness: FloatArray,
        *,
        kind: IntArray | None = None,
        target: FloatArray | None = None,
        coefficient: FloatArray | None = None,
        offset: FloatArray | None = None,
    ) -> None:
        """Add seam and constraint equations (see `kernels.constraints`); by default, sew pairs of edges together.

        Args:
            ends: #P by 4, vertices of the first edge, then of the second.
            ratio: #P, intended length of the first over the second.
            stiffness: #P [N/m].
            kind: #P, as in `kernels.constraints`.
            target: #P [m].
            coefficient: #P by 4 by 2.
            offset: #P, with which they begin [m].
        """
        count, device = len(ends), self.device
        seams = Seams()
        seams.ends = wp.array(ends, dtype=wp.vec4i, device=device)
        seams.kind = wp.array(np.zeros(count, dtype=np.int32) if kind is None else kind, dtype=wp.int32, device=device)
        seams.ratio = wp.array(ratio, dtype=wp.float64, device=device)
        seams.target = wp.array(np.zeros(count) if target is None else target, dtype=wp.float64, device=device)
        coefficients = np.zeros((4 * count, 2)) if coefficient is None else coefficient.reshape(-1, 2)
        seams.coefficient = wp.array(coefficients, dtype=wp.vec2d, device=device)
        seams.stiffness = wp.array(stiffness, dtype=wp.float64, device=device)
        seams.offset = wp.array(np.zeros(count) if offset is None else offset, dtype=wp.float64, device=device)
        self.seams = seams
        slot, first = counting_sort(np.ascontiguousarray(ends, dtype=np.int32).ravel(), self.vertex_count)
        self.bonds.offset = _on(device, first, wp.int32)
        self.bonds.slot = _on(device, slot, wp.int32)

    def seam_residuals(self, position: wp.array) -> FloatArray:
        """Return c of each equation in a layout (#V vec2d [m]), #P [m]."""
        residual = wp.zeros(self.seam_count, dtype=wp.float64, device=self.device)
        if self.seams is not None:
            launch_each(compute_seam_residuals, self.seam_count, [position, self.seams], [residual], device=self.device)
        return np.array(residual.numpy(), dtype=np.float64)

    def seam_energy(self, position: wp.array) -> float:
        """Return the energy of all equations, 1/2 k (c + offset)^2, in a layout (#V vec2d [m]) [J]."""
        if self.seams is None:
            return 0.0
        residual = self.seam_residuals(position) + self.seams.offset.numpy()
        return 0.5 * float(self.seams.stiffness.numpy() @ residual**2)

    def keep_vertical(self, vertices: IntArray) -> None:
        """Restrict vertices to motion along y, as on a fold or a straight centre front."""
        freedom = np.ones((self.vertex_count, 2))
        freedom[vertices, 0] = 0.0
        self.bonds.freedom = wp.array(freedom, dtype=wp.vec2d, device=self.device)

    @property
    def spring_count(self) -> int:
        """The number of springs, #S."""
        return self.spring_arrays.count


def _make_network(device: str, given: dict[str, Any], sewn: dict[str, Any] | None, upright: IntArray) -> SpringNetwork:
    network = SpringNetwork(device=wp.get_device(device), **given)
    if sewn is not None:
        network.sew(**sewn)
    if len(upright):
        network.keep_vertical(upright)
    return network


def _on(device: wp.Device, values: NDArray[np.generic], dtype: type) -> wp.array:
    """Return the values on the device; on the CPU in the same memory. A value broadcast to all rows is stored once."""
    if device.is_cpu:
        return wp.array(values, dtype=dtype, device=device, copy=False)
    if len(values) and values.strides[0] == 0:
        return _repeated(wp.array(np.ascontiguousarray(values[:1]), dtype=dtype, device=device), len(values))
    return wp.array(np.ascontiguousarray(values), dtype=dtype, device=device, copy=False)


@lru_cache
def _row(device: str, dtype: Any, value: float) -> wp.array:
    return wp.full(1, value=value, dtype=dtype, device=device)


def _constant(device: str, dtype: Any, value: float, count: int) -> wp.array:
    """Return a read-only array of `count` equal values."""
    return _repeated(_row(device, dtype, value), count)


def _repeated(row: wp.array, count: int) -> wp.array:
    """Return an array of `count` rows that all share the memory of one."""
    rows = wp.array(ptr=row.ptr, dtype=row.dtype, shape=(count,), strides=(0,), device=row.device)
    rows._ref = row  # keeps the memory alive, as slices do
    return rows
