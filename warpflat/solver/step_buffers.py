"""The buffers of a step and the launches over them.

Buffers are allocated once. A launch is recorded when it is first asked for, over ranges for all cores: a recorded one costs a fifth of
a fresh one.
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
from warpflat.kernels.constraints import evaluate_seams
from warpflat.kernels.implicit import advance, compute_kinetic_energy, gather_forces, stop
from warpflat.kernels.line_solve import go_along_lines, solve_lines
from warpflat.kernels.springs import compute_spring_energy, compute_spring_pull
from warpflat.model.network import SpringNetwork
from warpflat.solver.smoother import STEADY

__all__ = ["StepBuffers"]


# So many lines of a lattice are worth a thread of their own: they have about as many vertices each.
_LEAST_LINES = 64
# The guard takes several times as long as a look at a cell, and acts in some places of a piece only: each thread takes so many ranges,
# spread over all.
_TURNS = 4


class StepBuffers:
    """State of a network and what the kernels of a step leave behind; on the network's device.

    Attributes:
        position: #V vec2d [m]. velocity: #V vec2d [m/s]. force: #V vec2d, of the last evaluated state [N]. load: #V vec2d, constant
            forces [N].
        guarded, power, driving_force, first_guess, stiffness, anchor, reach: #V, as `kernels.implicit` has them.
        pace: 1 vec3d, how steps go on from one another, as `kernels.implicit` has it.
        face_acting, face_clearance, face_force, face_viscosity, face_stiffness: #F and 4 #F, as `kernels.cells` has them.
        vertex_energy, face_energy: #V and #F, as last measured [J]. vertex_pull: #V, what each spring to a later one pulls with [N].
            Those of vertices are where `power` is, those of faces where `face_stiffness` is: each is read as soon as it is written.
        evaluate: the forces; all faces are looked at. evaluate_on, evaluate_unguarded: the same with those faces only that act, and with
            none. advance: the places after them. along_lines: the places after a step along the lines of a lattice, once forces have been
            evaluated; its ways take the place of `first_guess` and `driving_force`. stop: of each piece, the velocities. measure,
            measure_motion: energies. measure_pull: what springs pull with.
    """

    def __init__(self, network: SpringNetwork, time_step: float, start: FloatArray) -> None:
        """Of a network at rest at a layout (#V by 2 [m]), stepped by so much [s]."""
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
        # Written and read only with viscosity, and of faces only where cells act: elsewhere no memory stands behind them.
        self.driving_force = wp.empty(n, dtype=wp.vec2d, device=device)
        self.face_force = wp.empty(4 * f, dtype=wp.vec2d, device=device)
        self.face_viscosity = wp.empty(4 * f, dtype=wp.vec2d, device=device)
        self.face_stiffness = wp.empty(4 * f, dtype=wp.float64, device=device)
        self.face_clearance = wp.zeros(f, dtype=wp.float64, device=device)
        self.seam_force = wp.zeros(4 * net_seams, dtype=wp.vec2d, device=device)
        self.seam_viscosity = wp.zeros(4 * net_seams, dtype=wp.vec2d, device=device)
        self.seam_stiffness = wp.zeros(4 * net_seams, dtype=wp.float64, device=device)
        self.pace = wp.array(np.array([STEADY]), dtype=wp.vec3d, device=device)
        self.vertex_energy = self.vertex_pull = self.power
        self.face_energy = self.face_stiffness[:f]
        self._views: dict[int, NDArray[Any]] = {}

    def on_host(self, array: wp.array) -> NDArray[Any]:
        """The values of one of the buffers that each step asks for; on the CPU the buffer itself, without the way through Warp."""
        view = self._views.get(id(array))
        if view is None:
            view = array.numpy()
            if self.network.device.is_cpu:
                self._views[id(array)] = view
        return view

    def go_at(self, pace: tuple[float, float, float]) -> None:
        """Let the next steps go at this pace."""
        values = self.on_host(self.pace)
        values[0] = pace
        if not self.network.device.is_cpu:
            self.pace.assign(values)

    def _cells(self, watch: int) -> Launch:
        """Forces on the cells, of all faces (1) or of those that act (0)."""
        net = self.network
        kernel, _, parameters = net.cell_model
        return record(
            kernel,
            dim=net.face_count,
            inputs=[self.position, self.velocity, net.cells, parameters, self.time_step, self.pace, watch],
            outputs=[
                self.face_acting,
                self.face_clearance,
                self.face_force,
                self.face_viscosity,
                self.face_stiffness,
            ],
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

    def _gather(self, watch: int) -> Launch:
        """Forces on the vertices, once all faces have been evaluated (1) or those that act (0)."""
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
                self.face_acting,
                self.face_clearance,
                self.face_force,
                self.face_viscosity,
                self.face_stiffness,
                net.bonds,
                self.seam_force,
                self.seam_viscosity,
                self.seam_stiffness,
                self.load,
                self.time_step,
                self.pace,
                watch,
            ],
            outputs=[
                self.force,
                self.power,
                self.driving_force,
                self.first_guess,
                self.stiffness,
                self.anchor,
                self.reach,
                self.guarded,
            ],
            device=net.device,
            turns=_TURNS,
        )

    @cached_property
    def evaluate(self) -> LaunchSequence:
        return LaunchSequence([self._cells(1), *self._seams, self._gather(1)])

    @cached_property
    def _gather_on(self) -> Launch:
        return self._gather(0)

    @cached_property
    def evaluate_on(self) -> LaunchSequence:
        return LaunchSequence([self._cells(0), *self._seams, self._gather_on])

    @cached_property
    def evaluate_unguarded(self) -> LaunchSequence:
        return LaunchSequence([*self._seams, self._gather_on])

    @cached_property
    def advance(self) -> Launch:
        net = self.network
        return record(
            advance,
            dim=net.vertex_count,
            inputs=[
                net.mass,
                net.springs,
                net.bonds,
                self.force,
                self.driving_force,
                self.first_guess,
                self.stiffness,
                self.anchor,
                self.reach,
                self.time_step,
                self.pace,
            ],
            outputs=[self.position, self.velocity],
            device=net.device,
        )

    @cached_property
    def along_lines(self) -> LaunchSequence | None:
        """None of a network without lines."""
        net = self.network
        if net.lines is None:
            return None
        ways = [self.first_guess, self.driving_force]
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
            outputs=ways,
            device=net.device,
            least=_LEAST_LINES,
        )
        go = record(
            go_along_lines,
            dim=net.vertex_count,
            inputs=[*ways, self.reach, net.bonds.freedom],
            outputs=[self.position],
            device=net.device,
        )
        return LaunchSequence([solve, go])

    @cached_property
    def _pieces(self) -> list[slice]:
        ends = range_offsets([net.vertex_count for net in self.network.pieces]).tolist()
        return [slice(*pair) for pair in pairwise(ends)]

    @cached_property
    def stop(self) -> list[Launch]:
        """Of each piece."""
        return [
            record(
                stop,
                dim=here.stop - here.start,
                inputs=[self.network.mass[here], self.force[here], self.stiffness[here], self.time_step],
                outputs=[self.velocity[here], self.driving_force[here], self.first_guess[here]],
                device=self.network.device,
            )
            for here in self._pieces
        ]

    @cached_property
    def measure_pull(self) -> Launch:
        return record(
            compute_spring_pull,
            dim=self.network.vertex_count,
            inputs=[self.position, self.network.springs],
            outputs=[self.vertex_pull],
            device=self.network.device,
        )

    @cached_property
    def measure(self) -> LaunchSequence:
        net = self.network
        springs = record(
            compute_spring_energy,
            dim=net.vertex_count,
            inputs=[self.position, net.springs],
            outputs=[self.vertex_energy],
            device=net.device,
        )
        _, kernel, parameters = net.cell_model
        cells = record(
            kernel,
            dim=net.face_count,
            inputs=[self.position, net.cells, parameters],
            outputs=[self.face_energy],
            device=net.device,
        )
        return LaunchSequence([springs, cells])

    @cached_property
    def measure_motion(self) -> Launch:
        return record(
            compute_kinetic_energy,
            dim=self.network.vertex_count,
            inputs=[self.network.mass, self.velocity],
            outputs=[self.vertex_energy],
            device=self.network.device,
        )
