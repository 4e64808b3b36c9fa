"""The energy of sewn cloth on a body, and one sparse factor of its stiffness as the metric of a minimisation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import warp as wp
from scipy.sparse import bsr_array, csc_array

from warpflat.core import (
    BoolArray,
    FloatArray,
    IntArray,
    Sequence,
    factor_symmetric,
    launch_each,
    range_offsets,
    record,
)
from warpflat.flat import Fabric, Point, Solve, make_cloth
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.layers import APART, Layers
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.sewn_cloth import SewnCloth
from warpflat.kernels.drape import Bending, Contact, Motion, evaluate_cloth, evaluate_curvature, gather_drape, mat32d
from warpflat.kernels.drape_contact import anchor_friction, carry_contact, find_planes, load_contact
from warpflat.kernels.drape_layers import press_layers
from warpflat.kernels.drape_stiffness import stiffen_cloth, stiffen_contact
from warpflat.kernels.membrane_cell import Cloth

__all__ = ["DrapeEnergy"]

# Fictitious mass over the sum of the stiffness around a vertex. A quarter is the limit of stability at small strains;
# at 1 wrinkled cloth on a bodice keeps chattering, at 2 it comes to rest.
_MASS_SCALE = 2.0
# Stiffness of the body's skin and of friction that holds, over the mass: at a vertex of a woven some 15 and 40 N/m. The body carries what
# presses at no depth; these only hold back what changes. A skin that is stiffer across than the cloth ends each step where some vertex
# comes to lie on it; by softer friction cloth slides farther before it is held.
_SKIN, _GRIP = 5e-4, 1.2e-3
# Where the contact leads and the depth does not fall from round to round, the skin becomes so many times as stiff.
_STIFFER = 4.0
# A vertex that nothing holds moves by its weight over this stiffness, so that no step of the minimisation is longer [m]
_LONGEST_STEP = 0.05
# and no step of dynamic relaxation longer than this [m].
_LONGEST_EXPLICIT_STEP = 1e-3
_REACH = 0.15  # [m]
# Where a vertex passes from one side of a groove to the other, the groove is filled as far as a ball does not enter whose radius is this
# share of an edge. With half an edge cloth that is tight over the crotch did not come to rest.
_BALL = 0.25
# A metric for far steps: least share of the tensile stiffness under compression, and a tension that is added in all directions [N/m].
# Steps by a softer one are too long where cloth becomes taut, and across cloth without tension.
_FAR_COMPRESSION, _FAR_PULL = 0.3, 4.0


class DrapeEnergy:
    """Energy of membrane, bending, weight, contact with body and layers, and friction, with its arrays on a device.

    Attributes:
        layers: what of the cloth lies beside its vertices.
        motion: state of the vertices on the device.
        contact: the body's planes on the device.
        device: where they are.
        forces_of: inputs of kernels that gather the forces at vertices: offset, entry, cells' forces, bending, moment.
        evaluate_cells: launches of the cells' forces and the moments.
        planes: launches that find the body's planes, none without a body.
        weight: #V [N].
        is_held: whether any vertex is.
    """

    def __init__(self, cloth: SewnCloth, body: Body | None, options: DrapeOptions, held: BoolArray) -> None:
        """Build the cells, the bending and the pattern of the stiffness; the contact is that of `load_contact`."""
        self.device = device = wp.get_device("cpu") if body is None else body.device
        self._count = count = len(cloth.designed)
        self.is_held = bool(held.any())
        self._start, self._longest = cloth.designed, np.inf
        self._ground = float(cloth.designed[:, 1].mean())
        corner, _, gradient, area = cloth.cells()
        laplacian, stiffness = cloth.laplacian()
        self._pattern = _BlockPattern(corner, count)
        fabric, vertex_area = cloth.fabric, cloth.vertex_areas()
        self._law = law = _law(fabric, options.compression, device)
        self._far_law = _law(fabric, max(options.compression, _FAR_COMPRESSION), device)
        # Of the shortest waves on the mesh, two edges long, bending holds as much as this tension.
        self._near_pull = fabric.bending * np.pi**2 / float(vertex_area.mean())
        self.weight = fabric.areal_density * options.gravity * vertex_area
        self.motion = Motion()
        self.motion.position, self.motion.velocity = self._zeros(wp.vec3d), self._zeros(wp.vec3d)
        self.motion.weight, self.motion.fixed = (
            self._on(self.weight, wp.float64),
            self._on(held.astype(np.int8), wp.int8),
        )
        mass = _MASS_SCALE * _gershgorin_bounds(cloth)
        self.motion.mass = self._on(mass, wp.float64)
        self.contact = contact = Contact()
        contact.centre, contact.normal, contact.rubbed, contact.anchor = (self._zeros(wp.vec3d) for _ in range(4))
        contact.pressed, contact.most, contact.depth, contact.ball = (self._zeros(wp.float64) for _ in range(4))
        contact.friction, contact.longest_step = options.friction, _LONGEST_EXPLICIT_STEP
        contact.skin, contact.grip = (self._on(each * mass, wp.float64) for each in (_SKIN, _GRIP))
        bending = Bending()
        bending.offset, bending.neighbor = self._on(laplacian.indptr, wp.int32), self._on(laplacian.indices, wp.int32)
        bending.weight, bending.stiffness = self._on(laplacian.data, wp.float64), self._on(stiffness, wp.float64)
        # After the forces of the cells come those between layers, on each vertex and the triangles before and behind it.
        moment, force = self._zeros(wp.vec3d), wp.zeros(3 * len(corner) + 8 * count, wp.vec3d, device)
        offset, entry = wp.zeros(count + 1, wp.int32, device), wp.zeros(len(force), wp.int32, device)
        self._corner, self.layers = corner, Layers(cloth, device)
        self._list_forces(offset, entry)
        x, at = self.motion.position, {"device": device}
        self._cells = [
            x,
            self._on(corner, wp.vec3i),
            self._on(gradient, mat32d),
            self._on(area, wp.float64),
            law,
        ]
        self._cell_energy, self._energy = wp.zeros(len(corner) + 2 * count, wp.float64, device), self._zeros(wp.float64)
        self._force = self._zeros(wp.vec3d)
        self.forces_of = [offset, entry, force, bending, moment]
        outputs = [force, self._cell_energy]
        self.evaluate_cells = [
            record(evaluate_cloth, dim=len(corner), inputs=self._cells, outputs=outputs, least=512, **at),
            record(evaluate_curvature, dim=count, inputs=[x, bending], outputs=[moment], least=512, **at),
            record(
                press_layers,
                dim=2 * count,
                inputs=[x, *self.layers.beside, APART, len(corner)],
                outputs=outputs,
                least=512,
                **at,
            ),
        ]
        inputs = [self.motion, self._ground, self.contact, *self.forces_of]
        outputs = [self._force, self._energy]
        gather = record(gather_drape, dim=count, inputs=inputs, outputs=outputs, least=256, **at)
        self._evaluate = Sequence([*self.evaluate_cells, gather])
        self.planes = []
        if body is not None:
            ball = _BALL * cloth.mean_edge
            query = [wp.uint64(body.mesh.id), body.normals, x, _REACH, ball]
            outputs = [contact.centre, contact.normal, contact.ball]
            self.planes = [record(find_planes, dim=count, inputs=query, outputs=outputs, least=256, turns=4, **at)]
        self._renew = Sequence([*self.planes, *self.evaluate_cells])
        self._keep = body
        self._solve: Solve | None = None

    def _list_forces(self, offset: wp.array, entry: wp.array) -> None:
        """List where the forces on each vertex are: offset (#V+1) and entry are written."""
        layered = np.column_stack([np.repeat(np.arange(self._count), 2), self.layers.corner])
        on = np.concatenate([self._corner.ravel(), layered.ravel()])
        offset.assign(range_offsets(np.bincount(on, minlength=self._count)).astype(np.int32))
        entry.assign(np.argsort(on, kind="stable").astype(np.int32))

    def renew_layers(self) -> None:
        """Look for the layers of cloth beside each vertex."""
        if self.layers.renew(self.motion.position.numpy()):
            self._list_forces(*self.forces_of[:2])

    def _on(self, values: object, dtype: object) -> wp.array:
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=self.device)

    def _zeros(self, dtype: type) -> wp.array:
        return wp.zeros(self._count, dtype, self.device)

    def load_contact(self) -> None:
        """Set the forces of body and friction by those on the cloth where dynamic relaxation has left it."""
        self._renew.launch()
        self._each(load_contact, [self.motion, self.contact, *self.forces_of])
        self._each(anchor_friction, [self.motion, self.contact])

    def carry_contact(self, positions: FloatArray, *, stiffer: bool) -> None:
        """Take over the forces of body and friction at #V by 3 places [m], lay the cloth on its planes, and find the planes anew.

        With `stiffer` the skin becomes stiffer where cloth still presses as deep into it.
        """
        self.motion.position.assign(positions)
        self._each(carry_contact, [self.motion, self.contact, _STIFFER if stiffer else 1.0])
        self._renew.launch()
        self._each(anchor_friction, [self.motion, self.contact])

    def _each(self, kernel: wp.Kernel, inputs: list[object]) -> None:
        launch_each(kernel, self._count, inputs, [], device=self.device, least=512)

    def bound(self, start: FloatArray, longest: float) -> None:
        """Let no vertex go farther than a length [m] from #V by 3 places [m]: the energy is infinite beyond."""
        self._start, self._longest = start, longest

    def at(self, positions: FloatArray) -> Point:
        """Evaluate the cloth at #V by 3 places [m]."""
        if np.abs(positions - self._start).max() > self._longest:
            return Point(positions=positions, energy=np.inf, gradient=np.zeros_like(positions))
        self.motion.position.assign(positions)
        self._evaluate.launch()
        energy = float(self._cell_energy.numpy().sum() + self._energy.numpy().sum())
        return Point(positions=positions, energy=energy, gradient=-self._force.numpy())

    def mean_force(self, point: Point) -> float:
        """Return the mean force that is left at a vertex, over its mean weight; infinite beyond the bound."""
        if not np.isfinite(point.energy):
            return np.inf
        return float(np.linalg.norm(point.gradient, axis=1).mean() / self.weight.mean())

    def factor(self, positions: FloatArray, *, near: bool) -> None:
        """Factor the stiffness of the cloth somewhere, from where on it is the metric.

        Args:
            positions: #V by 3, where the cloth is [m].
            near: whether rest is near; else the metric is stiffer.
        """
        # Single precision takes two thirds of the time.
        factor = factor_symmetric(self.stiffness(positions, near=near), dtype=np.float32)
        self._solve = lambda force: factor(force.ravel()).reshape(-1, 3)

    def stiffness(self, positions: FloatArray, *, near: bool = True) -> csc_array:
        """Return the stiffness of cloth, body and friction somewhere, 3 #V by 3 #V [N/m], without what is negative.

        Bending enters as a tension only: as it is, it would treble the entries of the factor.
        """
        vertices, least = self._zeros(wp.mat33d), float(self.weight.mean()) / _LONGEST_STEP
        cells = self._cell_stiffness(positions, *((self._law, self._near_pull) if near else (self._far_law, _FAR_PULL)))
        inputs = [self.motion, self.contact, least]
        launch_each(stiffen_contact, self._count, inputs, [vertices], device=self.device, least=512)
        between = self.layers.stiffness(positions)
        whole = self._pattern.matrix(cells, vertices.numpy())
        return csc_array(whole + between) if between.nnz else whole

    def cell_stiffness(self, positions: FloatArray) -> FloatArray:
        """Return the stiffness of each cell somewhere by its corners, #C by 3 by 3 corners by 3 by 3 coordinates [N/m]."""
        return self._cell_stiffness(positions, self._law, 0.0).reshape(-1, 3, 3, 3, 3)

    def _cell_stiffness(self, positions: FloatArray, law: Cloth, pull: float) -> FloatArray:
        self.motion.position.assign(positions)
        count = len(self._corner)
        cells = wp.zeros(9 * count, wp.mat33d, self.device)
        launch_each(stiffen_cloth, count, [*self._cells[:-1], law, pull], [cells], device=self.device, least=512)
        return cells.numpy().copy()

    def solver(self, point: Point) -> Solve:
        """Return the solution by the last factor."""
        assert self._solve is not None
        return self._solve


def _gershgorin_bounds(cloth: SewnCloth) -> FloatArray:
    """Return #V, bounds of the sums of the stiffness around each vertex [N/m], by Gershgorin's discs."""
    fabric, (corner, _, gradient, area), (laplacian, stiffness) = cloth.fabric, cloth.cells(), cloth.laplacian()
    size = np.abs(gradient)
    total = size.sum(axis=1, keepdims=True)
    steepest = []
    for direction in ("warp", "weft"):
        points = np.array([(0.0, 0.0), *getattr(fabric, f"curve_{direction}")])
        slopes = np.diff(points[:, 1]) / np.diff(points[:, 0])
        steepest.append(max(getattr(fabric, f"stiffness_{direction}"), *slopes.tolist(), 0.0))
    share = 1.0 / (1.0 - fabric.poisson_ratio**2 * fabric.stiffness_weft / fabric.stiffness_warp)
    k = share * (1.0 + fabric.poisson_ratio) * np.array(steepest) + 2.0 * fabric.shear_stiffness
    per_corner = (size * total) @ k
    per_corner += fabric.shear_stiffness * (size * total[:, :, ::-1]).sum(axis=2)
    sums = np.bincount(corner.ravel(), (per_corner * area[:, None]).ravel(), minlength=len(cloth.designed))
    entries = abs(laplacian)
    return np.asarray(sums + entries @ (stiffness * entries.sum(axis=1)))


def _law(fabric: Fabric, compression: float, device: wp.Device) -> Cloth:
    """Return the membrane's law with at most a share of the tensile stiffness under compression."""
    soft = replace(fabric, compression_factor=min(fabric.compression_factor, compression))
    return make_cloth(soft, (np.array([0.0, 1.0]), np.array([1.0, 0.0])), device)


class _BlockPattern:
    """Where the blocks of cells and vertices go in a symmetric matrix of 3 by 3 blocks."""

    def __init__(self, corner: IntArray, count: int) -> None:
        diagonal = np.arange(count)
        rows = np.concatenate([np.repeat(corner, 3, axis=1).ravel(), diagonal])
        columns = np.concatenate([np.tile(corner, (1, 3)).ravel(), diagonal])
        key = rows.astype(np.int64) * count + columns
        self._order = np.argsort(key, kind="stable")
        places, self._begin = np.unique(key[self._order], return_index=True)
        self._columns = (places % count).astype(np.int32)
        self._offset = np.searchsorted(places // count, np.arange(count + 1)).astype(np.int32)
        self._size = 3 * count

    def matrix(self, cells: FloatArray, vertices: FloatArray) -> csc_array:
        """Return the sum of the blocks of cells (9 #C by 3 by 3) and of vertices (#V by 3 by 3)."""
        values = np.concatenate([cells.reshape(-1, 9), vertices.reshape(-1, 9)])
        blocks = np.add.reduceat(values[self._order], self._begin, axis=0).reshape(-1, 3, 3)
        rows = bsr_array((blocks, self._columns, self._offset), shape=(self._size, self._size)).tocsr()
        # It is symmetric.
        return csc_array((rows.data, rows.indices, rows.indptr), shape=rows.shape)
