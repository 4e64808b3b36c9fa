"""Whole implicit steps: all vertices of a piece at once, by a sparse factor, where cloth is soft in shear and lies on triangles.

Eq. (10) holds each vertex by its own springs. Along a thread of such cloth these are up to a thousand times as stiff as what the
thread may shear against, and between triangles threads run across the edges: neither lines nor coarser meshes carry a vertex' neighbours
along, and steps creep for ten thousands. A whole step solves the implicit equation (Baraff and Witkin 1998) as if its time step were
infinite, with the stiffness J^T J of springs and guard in the present layout; the force across compressed springs, which would push
vertices off a thread, is left out of that, so that each way leads down. Some of the paper's steps after it take what is local: what it
presses in slivers, say.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import warp as wp
from scipy.sparse import csc_array, csr_array, diags_array, vstack
from scipy.sparse.linalg import splu

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.fabric.fabric import grain_axes
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import Outcome
from warpflat.solver.grain_alignment import GrainAlignment
from warpflat.solver.relax import Relaxation, Watch

__all__ = ["GaussNewtonSteps", "gauss_newton_pays", "relax_gauss_newton"]


# K/G from which they pay, on triangles, and the most vertices: a factor's entries grow faster than the mesh.
_SOFT = 35.0
_MOST_VERTICES = 100_000
# A whole step takes as long as so many of the paper's, times the root of the number of vertices.
_WORK = 1.5
# So many of the paper's steps come after each; twice as many after one that led no further than this share of its way, and so on.
_STEPS = 40
_MOST_STEPS = 1_280
_LITTLE_WAY = 0.05
_LEAST_SHARE = 1e-3
# At rest, too, is what forces could release no more of than this share of the energy.
_LITTLE_LEFT = 1e-5
# What holds vertices that nothing else holds, over the mean of the diagonal.
_FLOOR = 1e-9


def gauss_newton_pays(network: SpringNetwork) -> bool:
    """Whether whole steps may take less time than others: with springs of a soft cloth between triangles, nothing sewn."""
    return (
        network.model == "springs"
        and network.seams is None
        and network.fabric.softness >= _SOFT
        and network.vertex_count <= _MOST_VERTICES
        and not network.surface.is_quad.any()
    )


class GaussNewtonSteps:
    """The stiffness of a network of springs between triangles, with its guard, and where forces lead by it."""

    def __init__(self, network: SpringNetwork, upright: Sequence[GrainAlignment]) -> None:
        """Of a network and those of its pieces that are held upright."""
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
        self._chords = np.array([[piece.lower, piece.upper] for piece in upright], dtype=np.int32).reshape(-1, 2)

    def way(self, positions: FloatArray, force: FloatArray) -> FloatArray:
        """#V by 2, where the forces (#V by 2 [N]) in a layout (#V by 2 [m], no cell mirrored) lead [m]."""
        stiffness = self.matrix(positions)
        diagonal = stiffness.diagonal()
        stiffness.setdiag(diagonal + _FLOOR * diagonal.mean())
        factor = splu(stiffness, permc_spec="COLAMD", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        return np.asarray(factor.solve(force.ravel()).reshape(-1, 2))

    def matrix(self, positions: FloatArray) -> csc_array:
        """2 #V by 2 #V, J^T J in a layout (#V by 2 [m]) [N/m]."""
        rows = vstack([*self._of_springs(positions), *self._of_cells(positions), self._of_chords()]) @ self._free
        return csc_array(rows.T @ rows)

    def _rows(self, vertices: IntArray, along: FloatArray) -> csr_array:
        """A row of J for each of some vertices (#R by #K): the sum of their ways along vectors (#R by #K by 2)."""
        columns = 2 * vertices[:, :, None] + np.arange(2, dtype=np.int32)
        offset = np.arange(len(vertices) + 1, dtype=np.int32) * np.int32(2 * vertices.shape[1])
        return csr_array((along.ravel(), columns.ravel(), offset), shape=(len(vertices), 2 * self._count))

    def _of_springs(self, positions: FloatArray) -> list[csr_array]:
        """Along each spring, and across those that are stretched."""
        d = positions[self._ends[:, 1]] - positions[self._ends[:, 0]]
        length = np.sqrt(np.einsum("ij,ij->i", d, d))
        along = d * (np.sqrt(self._stiffness) / length)[:, None]
        stretched = np.flatnonzero(length > self._length)
        across = _turned(along[stretched]) * np.sqrt(1.0 - self._length[stretched] / length[stretched])[:, None]
        return [
            self._rows(ends, np.stack([-way, way], axis=1))
            for ends, way in ((self._ends, along), (self._ends[stretched], across))
        ]

    def _of_cells(self, positions: FloatArray) -> list[csr_array]:
        """Along and across each worn thread, in the cells in which the guard acts on it."""
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

    def _of_chords(self) -> csr_array:
        """That the chords of the pieces' datums stay upright."""
        sideways = np.array([[[-1.0, 0.0], [1.0, 0.0]]]) * np.sqrt(self._stiffness.max())
        return self._rows(self._chords, np.repeat(sideways, len(self._chords), axis=0))


def relax_gauss_newton(
    state: Relaxation,
    *,
    most: float | None = None,
    enough: float | None = None,
    watch: Watch | None = None,
    each_step: Watch | None = None,
) -> Outcome:
    """Whole steps, some of the paper's after each, until the energy and the residual force have come to rest, or by the stiffness in the
    layout next to nothing is left to release, or the step limit is reached.

    Args:
        state: where to start, no cell mirrored; holds the relaxed layout afterwards.
        most: work units that may be taken; the options' `max_steps` if not given.
        enough: it is over, at rest or not, once a whole step takes no more than this share of the energy away; if given.
        watch: called after every whole step and those after it, with the state, its energies and the residual.
        each_step: called after every step, with the energies and the residual of the last look.
    """
    begun, first, start = time.perf_counter(), state.steps, state.work_units
    if not state.looked:
        state.begin()
    most = state.options.max_steps if most is None else most
    whole, near = GaussNewtonSteps(state.network, state.upright), np.zeros(len(state.vertices), dtype=bool)

    def tell(call: Watch | None) -> None:
        if call is not None:
            call(state, state.last.total, float(state.last.residual.max()))

    if not state.last.at_rest.all():
        state.hold_grain()
        state.evaluate_at_rest()
    work, steps, left = _WORK * math.sqrt(state.network.vertex_count), _STEPS, np.full(len(near), np.inf)
    while not (done := state.last.at_rest | near).all() and (room := most - (state.work_units - start)) > 0.0:
        if room > work:
            left, share = _go(state, whole, ~done)
            state.work_units += work
            steps = _STEPS if share > _LITTLE_WAY else min(2 * steps, _MOST_STEPS)
        _smooth(state, min(steps, math.ceil(room)), None if each_step is None else lambda: tell(each_step))
        state.hold_grain()
        state.evaluate_at_rest()
        look = state.look(1.0)
        at_rest = look.at_rest | (left <= _LITTLE_LEFT * look.potential)
        state.last = replace(look, at_rest=at_rest)
        if enough is not None:
            near = look.gain <= enough * look.potential
        tell(watch)
    return state.outcome(first, start, begun=begun)


def _smooth(state: Relaxation, steps: int, each_step: Callable[[], None] | None) -> None:
    state.velocity.zero_()
    state.sweep(steps, each_step)
    state.work_units += steps


def _go(state: Relaxation, whole: GaussNewtonSteps, which: BoolArray) -> tuple[FloatArray, float]:
    """Let these pieces (#P) go where the forces lead, or a half of the way, a quarter ..., so that their energy is not higher.

    Returns:
        #P, what the forces could still release before, by the stiffness there [J]; the least share that was taken of the way.
    """

    def energy() -> FloatArray:
        return np.asarray(state.potentials().sum(axis=1) - state.work_of_load())

    start, force = state.positions(), np.array(state.force.numpy())
    way, before, share = whole.way(start, force), energy(), 1.0
    left = 0.5 * np.array([np.einsum("ij,ij->", way[own], force[own]) for own in state.vertices])
    base, by = (wp.array(values, dtype=wp.vec2d, device=state.network.device) for values in (start, way))
    while True:
        state.move(base, by, share, which)
        which = which & ~(energy() <= before)
        if share == 0.0 or not which.any():
            return left, share
        share = 0.5 * share if share > _LEAST_SHARE else 0.0


def _turned(vectors: FloatArray) -> FloatArray:
    """#N by 2, to the left."""
    return np.stack([-vectors[:, 1], vectors[:, 0]], axis=1)
