"""The buffers of a step and the launches over them.

Buffers are allocated once. A launch is recorded at its first use, over ranges for all cores: a recorded launch costs a
fifth of a fresh one.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.launch import Launch, record
from warpflat.core.launch import Sequence as LaunchSequence
from warpflat.core.sums import range_offsets
from warpflat.kernels.cells import ACTING, ALL, CellForces
from warpflat.kernels.constraints import evaluate_seams
from warpflat.kernels.implicit import (
    BondForces,
    VertexForces,
    advance,
    compute_kinetic_energy,
    gather_forces,
    gather_potential,
    stop,
)
from warpflat.kernels.line_solve import move_along_lines, solve_lines
from warpflat.kernels.springs import compute_spring_energy, compute_spring_tension
from warpflat.model.network import SpringNetwork
from warpflat.solver.smoother import IMPLICIT_STEP, SmootherCoefficients

__all__ = ["StepBuffers"]


# Lines of a lattice that are worth a thread of their own; each has about as many vertices.
_LEAST_LINES = 64
# The guard takes several times as long as the check of a cell, and acts in some places of a piece only. So each thread
# takes this many ranges, spread over the piece.
_TURNS = 4


class StepBuffers:
    """The state of a network and the results of a step's kernels, on the network's device.

    Attributes:
        position: #V vec2d [m]. velocity: #V vec2d [m/s]. force: #V vec2d, of the last evaluated state [N]. load: #V
            vec2d, constant forces [N].
        guarded, power, driving_force, first_guess, stiffness, anchor, reach: #V, as `kernels.implicit` has them.
        coefficients: 1 vec3d, factors of viscosity, velocity and velocity change, as `kernels.implicit` has them.
        face_acting, face_clearance, face_force, face_viscosity, face_stiffness: #F and 4 #F, as `kernels.cells` has
            them.
        vertex_energy, face_energy: #V and #F, as last measured [J]. vertex_tension: #V, |tension| of the springs to
            later vertices [N]. rest_force: #V vec2d, forces at rest, without the load [N]. These share the memory of
            `power`, `face_stiffness` and `driving_force`: each is read as soon as it is written.
    """

    def __init__(self, network: SpringNetwork, time_step: float, start: FloatArray) -> None:
        """Allocate the buffers of a network at rest in a layout.

        Args:
            network: the model.
            time_step: h [s].
            start: #V by 2, the layout [m].
        """
        self.network, self.time_step = network, time_step
        n, f, device = network.vertex_count, network.face_count, network.device
        net_seams = network.seam_count
        self.position = wp.array(np.ascontiguousarray(start), dtype=wp.vec2d, device=device)
        self.velocity = wp.zeros(n, dtype=wp.vec2d, device=device)
        self.force = wp.zeros(n, dtype=wp.vec2d, device=device)
        self.load = wp.zeros(n, dtype=wp.vec2d, device=device)
        self.first_guess = wp.zeros(n, dtype=wp.vec2d, device=device)
        self.power = wp.zeros(n, dtype=wp.float64, device=device)
        self.stiffness = wp.zeros(n, dtype=wp.float64, device=device)
        self.anchor = wp.zeros(n, dtype=wp.vec2d, device=device)
        self.reach = wp.zeros(n, dtype=wp.float64, device=device)
        self.guarded = wp.zeros(n, dtype=wp.int8, device=device)
        self.face_acting = wp.zeros(f, dtype=wp.int8, device=device)
        # Written and read only with viscosity, and for faces only where cells act: pages that are never touched take no
        # memory.
        self.driving_force = wp.empty(n, dtype=wp.vec2d, device=device)
        self.face_force = wp.empty(4 * f, dtype=wp.vec2d, device=device)
        self.face_viscosity = wp.empty(4 * f, dtype=wp.vec2d, device=device)
        self.face_stiffness = wp.empty(4 * f, dtype=wp.float64, device=device)
        self.face_clearance = wp.zeros(f, dtype=wp.float64, device=device)
        self.seam_force = wp.zeros(4 * net_seams, dtype=wp.vec2d, device=device)
        self.seam_viscosity = wp.zeros(4 * net_seams, dtype=wp.vec2d, device=device)
        self.seam_stiffness = wp.zeros(4 * net_seams, dtype=wp.float64, device=device)
        self.coefficients = wp.array(np.array([IMPLICIT_STEP]), dtype=wp.vec3d, device=device)
        self.vertex_energy = self.vertex_tension = self.power
        self.face_energy, self.rest_force = self.face_stiffness[:f], self.driving_force
        self._views: dict[int, NDArray[Any]] = {}

    def on_host(self, array: wp.array) -> NDArray[Any]:
        """Return the values of a buffer; on the CPU a view of the buffer itself, kept to save the call of Warp."""
        view = self._views.get(id(array))
        if view is None:
            view = array.numpy()
            if self.network.device.is_cpu:
                self._views[id(array)] = view
        return view

    def set_coefficients(self, coefficients: SmootherCoefficients) -> None:
        """Set the coefficients of the next steps."""
        values = self.on_host(self.coefficients)
        values[0] = coefficients
        if not self.network.device.is_cpu:
            self.coefficients.assign(values)

    @cached_property
    def _cell_forces(self) -> CellForces:
        made = CellForces()
        made.acting, made.clearance = self.face_acting, self.face_clearance
        made.force, made.viscosity, made.stiffness = self.face_force, self.face_viscosity, self.face_stiffness
        return made

    @cached_property
    def _bond_forces(self) -> BondForces:
        made = BondForces()
        made.force, made.viscosity, made.stiffness = self.seam_force, self.seam_viscosity, self.seam_stiffness
        return made

    @cached_property
    def _vertex_forces(self) -> VertexForces:
        made = VertexForces()
        made.force, made.power, made.driving_force = self.force, self.power, self.driving_force
        made.first_guess, made.stiffness = self.first_guess, self.stiffness
        made.anchor, made.reach, made.guarded = self.anchor, self.reach, self.guarded
        return made

    def _cells(self, scope: int) -> Launch:
        """Record the forces of the cells in a scope (`kernels.cells`)."""
        net = self.network
        model = net.cell_model
        at = [self.position, self.velocity, net.cells, model.parameters]
        return record(
            model.step,
            dim=net.face_count,
            inputs=[*at, self.time_step, self.coefficients, scope],
            outputs=[self._cell_forces],
            device=net.device,
            turns=_TURNS,
        )

    @cached_property
    def _seams(self) -> list[Launch]:
        net = self.network
        if net.seams is None:
            return []
        return [
            record(
                evaluate_seams,
                dim=net.seam_count,
                inputs=[self.position, self.velocity, net.seams, self.time_step],
                outputs=[self.seam_force, self.seam_viscosity, self.seam_stiffness],
                device=net.device,
            )
        ]

    def _gather(self, scope: int) -> Launch:
        """Record the forces on the vertices, after the cells were evaluated in a scope."""
        net = self.network
        return record(
            gather_forces,
            dim=net.vertex_count,
            inputs=[
                self.position,
                self.velocity,
                net.mass,
                net.spring_stiffness,
                net.springs,
                net.cells,
                self._cell_forces,
                net.bonds,
                self._bond_forces,
                self.load,
                self.time_step,
                self.coefficients,
                scope,
            ],
            outputs=[self._vertex_forces],
            device=net.device,
            turns=_TURNS,
        )

    @cached_property
    def evaluate(self) -> LaunchSequence:
        """The forces, after a check of all faces."""
        return LaunchSequence([self._cells(ALL), *self._seams, self._gather(ALL)])

    @cached_property
    def evaluate_potential(self) -> LaunchSequence:
        """The energies of springs and cells, into `vertex_energy` and `face_energy`, and the forces at rest, into `rest_force`."""
        net = self.network
        cells = record(
            net.cell_model.potential,
            dim=net.face_count,
            inputs=[self.position, net.cells, net.cell_model.parameters],
            outputs=[self.face_energy, self._cell_forces],
            device=net.device,
            turns=_TURNS,
        )
        gather = record(
            gather_potential,
            dim=net.vertex_count,
            inputs=[self.position, net.springs, net.cells, self._cell_forces, net.bonds, self._bond_forces],
            outputs=[self.vertex_energy, self.rest_force],
            device=net.device,
            turns=_TURNS,
        )
        return LaunchSequence([cells, *self._seams, gather])

    @cached_property
    def _gather_guarded(self) -> Launch:
        return self._gather(ACTING)

    @cached_property
    def evaluate_guarded(self) -> LaunchSequence:
        """The forces, with the guard only where it acted at the last check."""
        return LaunchSequence([self._cells(ACTING), *self._seams, self._gather_guarded])

    @cached_property
    def evaluate_unguarded(self) -> LaunchSequence:
        """The forces where the guard acted nowhere at the last check."""
        return LaunchSequence([*self._seams, self._gather_guarded])

    @cached_property
    def advance(self) -> Launch:
        """Velocities and positions after the step, from the evaluated forces."""
        net = self.network
        return record(
            advance,
            dim=net.vertex_count,
            inputs=[
                net.mass,
                net.springs,
                net.bonds,
                self._vertex_forces,
                self.time_step,
                self.coefficients,
            ],
            outputs=[self.position, self.velocity],
            device=net.device,
        )

    @cached_property
    def line_step(self) -> LaunchSequence | None:
        """A line relaxation step from the forces; overwrites `first_guess` and `driving_force`. None without lines."""
        net = self.network
        if net.lines is None:
            return None
        displacements = [self.first_guess, self.driving_force]
        solve = record(
            solve_lines,
            dim=len(net.lines.offset) - 1,
            inputs=[
                self.position,
                self.force,
                net.mass,
                net.springs,
                net.cells,
                self.face_acting,
                self.face_stiffness,
                self.guarded,
                net.lines,
                self.time_step,
            ],
            outputs=displacements,
            device=net.device,
            least=_LEAST_LINES,
        )
        move = record(
            move_along_lines,
            dim=net.vertex_count,
            inputs=[*displacements, self.reach, net.bonds.freedom],
            outputs=[self.position],
            device=net.device,
        )
        return LaunchSequence([solve, move])

    @cached_property
    def _pieces(self) -> list[slice]:
        ends = range_offsets([net.vertex_count for net in self.network.pieces]).tolist()
        return [slice(*pair) for pair in pairwise(ends)]

    @cached_property
    def stop(self) -> list[Launch]:
        """Velocities of single pieces, set to zero."""
        return [
            record(
                stop,
                dim=own.stop - own.start,
                inputs=[self.network.mass[own], self.force[own], self.stiffness[own], self.time_step],
                outputs=[self.velocity[own], self.driving_force[own], self.first_guess[own]],
                device=self.network.device,
            )
            for own in self._pieces
        ]

    @cached_property
    def measure_tension(self) -> Launch:
        """The tensions of the springs, into `vertex_tension`."""
        return record(
            compute_spring_tension,
            dim=self.network.vertex_count,
            inputs=[self.position, self.network.springs],
            outputs=[self.vertex_tension],
            device=self.network.device,
        )

    @cached_property
    def measure_potential(self) -> LaunchSequence:
        """The energies of springs and cells, into `vertex_energy` and `face_energy`."""
        net = self.network
        springs = record(
            compute_spring_energy,
            dim=net.vertex_count,
            inputs=[self.position, net.springs],
            outputs=[self.vertex_energy],
            device=net.device,
        )
        cells = record(
            net.cell_model.energy,
            dim=net.face_count,
            inputs=[self.position, net.cells, net.cell_model.parameters],
            outputs=[self.face_energy],
            device=net.device,
        )
        return LaunchSequence([springs, cells])

    @cached_property
    def measure_motion(self) -> Launch:
        """The kinetic energies, into `vertex_energy`."""
        return record(
            compute_kinetic_energy,
            dim=self.network.vertex_count,
            inputs=[self.network.mass, self.velocity],
            outputs=[self.vertex_energy],
            device=self.network.device,
        )
