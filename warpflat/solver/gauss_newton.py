"""Gauss-Newton steps: all vertices of a piece at once, by a sparse factorisation, for soft cloth on triangle meshes.

Eq. (10) holds each vertex by its own springs. Along a thread of soft cloth these are up to a thousand times as stiff as
the shear against which the thread may move, and on triangle meshes the threads run across the edges. Then neither line
relaxation nor coarser meshes move a vertex together with its neighbours, and the paper's steps creep for tens of
thousands. A Gauss-Newton step solves the implicit equation (Baraff and Witkin 1998) in the limit of an infinite time
step, with the stiffness J^T J of springs and guard in the present layout. It leaves out the negative stiffness across
compressed springs, so that each direction is one of descent. Some of the paper's steps after it reduce the local
errors, as in slivers.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import warp as wp
from scipy.sparse import csc_array, csr_array, diags_array, vstack

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.sparse import factor_symmetric
from warpflat.fabric.fabric import grain_axes
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import Outcome
from warpflat.solver.grain_alignment import GrainAlignment
from warpflat.solver.relax import Watch
from warpflat.solver.relaxation import Relaxation

__all__ = ["GaussNewtonSteps", "gauss_newton_pays", "relax_gauss_newton"]


# K/G from which Gauss-Newton steps pay on triangles, and the most vertices: a factor's entries grow faster than the
# mesh.
_SOFT = 35.0
_MOST_VERTICES = 100_000
# Work units of a Gauss-Newton step, over the square root of the number of vertices.
_WORK = 1.5
# Smoothing steps of the paper's after each. Their number doubles after a Gauss-Newton step of less than the fraction
# `_SHORT_STEP`.
_STEPS = 40
_MOST_STEPS = 1_280
_SHORT_STEP = 0.05
_LEAST_FRACTION = 1e-3
# A layout also counts as at rest when its forces could release at most this share of its energy.
_NEGLIGIBLE_RELEASE = 1e-5
# Stiffness added to hold vertices that nothing else holds, over the mean of the diagonal.
_REGULARISATION = 1e-9


def gauss_newton_pays(network: SpringNetwork) -> bool:
    """Return whether Gauss-Newton steps may be the fastest: for springs of soft cloth on triangles, nothing sewn."""
    return (
        network.model == "springs"
        and network.seams is None
        and network.fabric.softness >= _SOFT
        and network.vertex_count <= _MOST_VERTICES
        and not network.surface.is_quad.any()
    )


class GaussNewtonSteps:
    """The Gauss-Newton stiffness of a spring network on triangles, with its guard, and its directions of descent."""

    def __init__(self, network: SpringNetwork, alignments: Sequence[GrainAlignment]) -> None:
        """Prepare the steps of a network, some of whose pieces may have their grain held."""
        springs, cells, fabric = network.spring_arrays, network.cell_arrays, network.fabric
        self._count = network.vertex_count
        self._ends, self._length, self._stiffness = springs.ends, springs.rest_length, springs.stiffness
        self._corner, self._edges = cells.corner, cells.edges
        slack, onset = (array.numpy()[cells.face] for array in (network.cells.slack, network.cells.onset))
        self._threads = [
            (np.outer(slack[:, k], axis), stiffness, onset[:, k])
            for k, (axis, stiffness) in enumerate(
                zip(grain_axes(network.grain_angle), (fabric.stiffness_warp, fabric.stiffness_weft), strict=True)
            )
        ]
        self._free = diags_array(network.bonds.freedom.numpy().ravel())
        self._chords = np.array([[each.lower, each.upper] for each in alignments], dtype=np.int32).reshape(-1, 2)
        self._across = np.array([[each.direction[1], -each.direction[0]] for each in alignments]).reshape(-1, 1, 2)

    def direction(self, positions: FloatArray, force: FloatArray) -> FloatArray:
        """Return the full step, #V by 2 [m].

        Args:
            positions: #V by 2, a layout without mirrored cells [m].
            force: #V by 2, the forces there [N].
        """
        stiffness = self.matrix(positions)
        diagonal = stiffness.diagonal()
        stiffness.setdiag(diagonal + _REGULARISATION * diagonal.mean())
        return factor_symmetric(stiffness)(force.ravel()).reshape(-1, 2)

    def matrix(self, positions: FloatArray) -> csc_array:
        """Return J^T J in a layout (#V by 2 [m]), 2 #V by 2 #V [N/m]."""
        rows = vstack([*self._spring_rows(positions), *self._cell_rows(positions), self._chord_rows()]) @ self._free
        return csc_array(rows.T @ rows)

    def _rows(self, vertices: IntArray, gradient: FloatArray) -> csr_array:
        """Return rows of J from their gradients (#R by #K by 2) by the places of some vertices (#R by #K)."""
        columns = 2 * vertices[:, :, None] + np.arange(2, dtype=np.int32)
        offset = np.arange(len(vertices) + 1, dtype=np.int32) * np.int32(2 * vertices.shape[1])
        return csr_array((gradient.ravel(), columns.ravel(), offset), shape=(len(vertices), 2 * self._count))

    def _spring_rows(self, positions: FloatArray) -> list[csr_array]:
        """Return the rows along each spring, and across those that are stretched."""
        d = positions[self._ends[:, 1]] - positions[self._ends[:, 0]]
        length = np.sqrt(np.einsum("ij,ij->i", d, d))
        along = d * (np.sqrt(self._stiffness) / length)[:, None]
        stretched = np.flatnonzero(length > self._length)
        across = _turned(along[stretched]) * np.sqrt(1.0 - self._length[stretched] / length[stretched])[:, None]
        return [
            self._rows(ends, np.stack([-vector, vector], axis=1))
            for ends, vector in ((self._ends, along), (self._ends[stretched], across))
        ]

    def _cell_rows(self, positions: FloatArray) -> list[csr_array]:
        """Return the rows along and across each worn thread, in the cells in which the guard acts on it."""
        p0, p1, p2 = positions[self._corner].transpose(1, 0, 2)
        a, b = p1 - p0, p2 - p0
        det = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        # Rows: the gradients of the barycentric weights of corners 1 and 2.
        gradient = np.stack([_turned(-b), _turned(a)], axis=1) / det[:, None, None]
        rows = []
        for thread, stiffness, onset in self._threads:
            share = np.einsum("cij,cj->ci", gradient, thread)
            worn = np.einsum("cij,cj->ci", self._edges, share)
            stretch = np.sqrt(np.einsum("ij,ij->i", worn, worn))
            acts = np.flatnonzero(stretch > 1.0 + onset)
            corner, share, stretch = self._corner[acts], share[acts], stretch[acts]
            # F e changes by -F u (grad w . e) where a corner moves by u, w its weight.
            deformation = self._edges[acts] @ gradient[acts]
            of_corner = np.column_stack([share.sum(axis=1), -share])
            root = np.sqrt(stiffness * 0.5 * det[acts])
            unit = worn[acts] / stretch[:, None]
            excess = np.sqrt(1.0 - (1.0 + onset[acts]) / stretch)
            for direction, size in ((unit, root), (_turned(unit), root * excess)):
                back = np.einsum("cji,cj->ci", deformation, direction) * size[:, None]
                rows.append(self._rows(corner, of_corner[:, :, None] * back[:, None, :]))
        return rows

    def _chord_rows(self) -> csr_array:
        """Return the rows that keep the directions of the aligned pieces' chords."""
        sideways = self._across * np.array([[-1.0], [1.0]]) * np.sqrt(self._stiffness.max())
        return self._rows(self._chords, sideways)


def relax_gauss_newton(
    state: Relaxation,
    *,
    max_work: float | None = None,
    least_gain: float | None = None,
    watch: Watch | None = None,
    each_step: Watch | None = None,
) -> Outcome:
    """Alternate Gauss-Newton steps and some of the paper's until a piece is at rest, or the step limit is reached.

    A piece is at rest when its energy and its residual force are, or when by the Gauss-Newton stiffness next to nothing
    is left to release.

    Args:
        state: where to start, no cell mirrored; holds the relaxed layout afterwards.
        max_work: limit of the work units; the options' `max_steps` if not given.
        least_gain: stop, at rest or not, once a Gauss-Newton step releases no more than this share of the energy; if
            given.
        watch: called after every Gauss-Newton step and the smoothing after it, with the state, its energies and the
            residual.
        each_step: called after every step, with the energies and the residual of the last check.
    """
    began_at, steps_before, work_before = time.perf_counter(), state.steps, state.work_units
    if not state.has_status:
        state.check_start()
    max_work = state.options.max_steps if max_work is None else max_work
    newton = GaussNewtonSteps(state.network, state.alignments)
    gains_little = np.zeros(len(state.vertex_ranges), dtype=bool)

    def notify(call: Watch | None) -> None:
        if call is not None:
            call(state, state.status.total, state.status.worst_residual)

    if not state.status.at_rest.all():
        state.hold_grain()
        state.evaluate_at_rest()
    work, steps, releasable = _WORK * math.sqrt(state.network.vertex_count), _STEPS, np.full(len(gains_little), np.inf)
    while not (done := state.status.at_rest | gains_little).all():
        work_left = max_work - (state.work_units - work_before)
        if work_left <= 0.0:
            break
        if work_left > work:
            releasable, fraction = _line_search(state, newton, ~done)
            state.work_units += work
            steps = _STEPS if fraction > _SHORT_STEP else min(2 * steps, _MOST_STEPS)
        _smooth(state, min(steps, math.ceil(work_left)), None if each_step is None else lambda: notify(each_step))
        state.hold_grain()
        state.evaluate_at_rest()
        status = state.check_convergence(1.0)
        at_rest = status.at_rest | (releasable <= _NEGLIGIBLE_RELEASE * status.potential)
        state.status = replace(status, at_rest=at_rest)
        if least_gain is not None:
            gains_little = status.gain <= least_gain * status.potential
        notify(watch)
    return state.make_outcome(steps_before, work_before, began_at=began_at)


def _smooth(state: Relaxation, steps: int, each_step: Callable[[], None] | None) -> None:
    state.velocity.zero_()
    state.sweep(steps, each_step)
    state.work_units += steps


def _line_search(state: Relaxation, newton: GaussNewtonSteps, pieces: BoolArray) -> tuple[FloatArray, float]:
    """Move these pieces (#P) by a full step, or by a half, a quarter ... of it, so that their energy does not rise.

    Returns:
        #P, the energy that the forces could still release before, by the Gauss-Newton stiffness [J]; the least fraction
        of the step taken.
    """

    def energy() -> FloatArray:
        return np.asarray(state.potentials().sum(axis=1) - state.work_of_load())

    start, force = state.positions(), np.array(state.force.numpy())
    step, before, fraction = newton.direction(start, force), energy(), 1.0
    releasable = 0.5 * np.array([np.einsum("ij,ij->", step[own], force[own]) for own in state.vertex_ranges])
    base, direction = (wp.array(values, dtype=wp.vec2d, device=state.network.device) for values in (start, step))
    while True:
        state.move_along(base, direction, fraction, pieces)
        pieces = pieces & ~(energy() <= before)
        if fraction == 0.0 or not pieces.any():
            return releasable, fraction
        fraction = 0.5 * fraction if fraction > _LEAST_FRACTION else 0.0


def _turned(vectors: FloatArray) -> FloatArray:
    """Return vectors (#N by 2) turned to the left by a right angle."""
    return np.stack([-vectors[:, 1], vectors[:, 0]], axis=1)
