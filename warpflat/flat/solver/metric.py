"""The metric of L-BFGS: one sparse factor of a stiffness, and stiffnesses of a few rows added by Woodbury's formula.

A metric A stands for the second derivative of the energy; the direction of descent is A^-1 times the force. Two matrices are factored.
`LaplacianFactor`: the Laplacian of the surface times the cloth's stiffness, the same for all layouts (Liu et al. 2017). On surfaces too
large to factor its solution is a V-cycle: damped Jacobi before and after a correction by the Laplacian of the coarser mesh, down to one
that is factored (Briggs, Henson and McCormick, A Multigrid Tutorial); L-BFGS takes as many iterations with it.
`StiffnessFactor`: the Gauss-Newton stiffness J^T J of cloth and equations in one layout, in which stiff seams cost no more
iterations than soft ones.

Rows R are added to it exactly, (A + R^T R)^-1 = A^-1 - A^-1 R^T (I + R A^-1 R^T)^-1 R A^-1: contacts, and the chords of the grain,
which are held as rows of infinite stiffness, without the I.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Protocol

import numpy as np
import warp as wp
from scipy.sparse import coo_array, csc_array, csr_array, diags_array, vstack

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.launch import record
from warpflat.core.sparse import factor_symmetric
from warpflat.core.vectors import turned_left, unit
from warpflat.flat.fabric.fabric import grain_axes
from warpflat.flat.model.network import CellModel, SpringNetwork
from warpflat.flat.solver.collapse import iterate_coarsenings
from warpflat.flat.solver.grain import GrainAlignment
from warpflat.flat.surface.laplacian import factor_pays, held_laplacian, laplacian_solver
from warpflat.flat.surface.mesh import Surface, once_per_surface
from warpflat.kernels.cells import CellForces
from warpflat.kernels.constraints import LENGTHS, LINEAR, STRAIGHT
from warpflat.kernels.membrane import differentiate_membrane

__all__ = [
    "CHEAP",
    "LaplacianFactor",
    "Metric",
    "Solve",
    "StiffnessFactor",
    "cell_forces",
    "cell_stiffness",
    "equation_rows",
    "laplacian_solution",
    "stiffness_matrix",
]

#: A mesh of so many vertices is cheap to factor.
CHEAP = 30_000
# Damping of Jacobi's iteration.
_DAMPING = 0.7

# Rounding of a solution in single precision.
_ROUNDING = 1e-6
# Stiffness added to hold vertices that nothing else holds, over the mean of the diagonal.
_REGULARISATION = 1e-9

Solve = Callable[[FloatArray], FloatArray]


class Factor(Protocol):
    """The inverse of a matrix of 2 #V by 2 #V coordinates."""

    def solve(self, force: FloatArray) -> FloatArray:
        """Return the inverse times forces, #V by 2."""

    def columns(self, vertices: IntArray) -> FloatArray:
        """Return the inverse's columns at some vertices (#N), which `spread` and `between` take."""

    def spread(self, columns: FloatArray, pull: FloatArray) -> FloatArray:
        """Return the inverse times forces `pull` (#N by 2) at those vertices and none elsewhere, #V by 2."""

    def between(self, columns: FloatArray, vertices: IntArray) -> FloatArray:
        """Return the inverse's entries between the coordinates of those vertices, 2 #N by 2 #N."""


@once_per_surface
def laplacian_solution(surface: Surface) -> Solve:
    """Return the solution by the Laplacian (`warpflat.flat.surface.laplacian`), or on a large surface what a V-cycle makes of it.

    Right sides are #V by #N. Both are symmetric, and in single precision.
    """
    step = None if factor_pays(surface) else next(iterate_coarsenings(surface, CHEAP), None)
    if step is None:
        return laplacian_solver(surface)
    coarser, matrix = laplacian_solution(step.surface), csr_array(held_laplacian(surface), dtype=np.float32)
    inverse = (_DAMPING / matrix.diagonal())[:, None]
    up = step.prolongation.astype(np.float32)
    down = csr_array(up.T)

    def cycle(right: FloatArray) -> FloatArray:
        force = right.astype(np.float32)
        x = inverse * force
        x += up @ coarser(down @ (force - matrix @ x)).astype(np.float32)
        x += inverse * (force - matrix @ x)
        return np.ascontiguousarray(x, dtype=np.float64)

    return cycle


class LaplacianFactor:
    """The Laplacian of a surface times the stiffness of its cloth; both coordinates are alike and apart."""

    def __init__(self, network: SpringNetwork) -> None:
        """Factor the Laplacian, once for each surface."""
        fabric = network.fabric
        self._stiffness = max(fabric.stiffness_warp, fabric.stiffness_weft)
        self._solve, self._count = laplacian_solution(network.surface), network.vertex_count
        # The inverse's columns at vertices that have been asked for; most of the border never touches.
        self._column: dict[int, FloatArray] = {}

    def solve(self, force: FloatArray) -> FloatArray:
        """Return the inverse times forces, #V by 2."""
        return self._solve(force) / self._stiffness

    def spread(self, columns: FloatArray, pull: FloatArray) -> FloatArray:
        """Return the inverse times forces at some vertices."""
        return np.ascontiguousarray((pull.T @ columns).T)

    def between(self, columns: FloatArray, vertices: IntArray) -> FloatArray:
        """Return the inverse's entries between some vertices."""
        return np.asarray(np.kron(columns[:, vertices], np.eye(2)), dtype=np.float64)

    def columns(self, vertices: IntArray) -> FloatArray:
        """Return the inverse's columns at some vertices, the same for both coordinates (#N by #V)."""
        new = [vertex for vertex in vertices.tolist() if vertex not in self._column]
        if new:
            unit = np.zeros((self._count, len(new)))
            unit[new, np.arange(len(new))] = 1.0 / self._stiffness
            self._column |= zip(new, self._solve(unit).T, strict=True)
        return np.stack([self._column[vertex] for vertex in vertices.tolist()])


class StiffnessFactor:
    """The Gauss-Newton stiffness of a network and its equations in one layout."""

    def __init__(
        self,
        network: SpringNetwork,
        positions: FloatArray,
        alignments: Sequence[GrainAlignment] = (),
        *,
        dtype: type[np.floating] = np.float64,
        cells: FloatArray | None = None,
    ) -> None:
        """Factor the stiffness in a layout (#V by 2 [m]) without mirrored cells, in a precision; chords of pieces resist being turned.

        Of a membrane `cells` may give the stiffness of each cell (see :func:`cell_stiffness`).
        """
        matrix, free = stiffness_matrix(network, positions, cells), network.bonds.freedom.numpy().ravel()
        if alignments:
            # Each end of a chord is held sideways. A piece that no force moves along has one place and direction then, and the chord
            # couples no far vertices, which would fill the factor.
            chords, across = _chords(alignments)
            ends = np.repeat(across, 2, axis=0)[:, None] * np.sqrt(network.spring_arrays.stiffness.max())
            rows = _rows(network.vertex_count, chords[:, :2].reshape(-1, 1), ends) @ diags_array(free)
            matrix = csc_array(matrix + rows.T @ rows)
        if network.seams is not None:
            rows = equation_rows(network, positions) @ diags_array(free)
            matrix = csc_array(matrix + rows.T @ rows)
        diagonal = matrix.diagonal()
        # So much that a factor in this precision still sees it.
        least = max(_REGULARISATION, 10.0 * float(np.finfo(dtype).eps))
        matrix.setdiag(diagonal + least * diagonal.mean() + (free == 0.0) * diagonal.max())
        self._solve, self._count = factor_symmetric(matrix, dtype=dtype), len(free)
        self._column: dict[int, FloatArray] = {}

    def solve(self, force: FloatArray) -> FloatArray:
        """Return the inverse times forces, #V by 2, or 2 #V by #K."""
        return self._solve(force.reshape(self._count, -1)).reshape(force.shape)

    def spread(self, columns: FloatArray, pull: FloatArray) -> FloatArray:
        """Return the inverse times forces at some vertices."""
        return np.asarray(pull.ravel() @ columns).reshape(-1, 2)

    def between(self, columns: FloatArray, vertices: IntArray) -> FloatArray:
        """Return the inverse's entries between some vertices."""
        return columns[:, _coordinates(vertices)]

    def columns(self, vertices: IntArray) -> FloatArray:
        """Return the inverse's columns at some vertices' coordinates (2 #N by 2 #V)."""
        coordinates = _coordinates(vertices).tolist()
        for coordinate in coordinates:
            if coordinate not in self._column:
                unit = np.zeros(self._count)
                unit[coordinate] = 1.0
                self._column[coordinate] = self._solve(unit)
        return np.stack([self._column[coordinate] for coordinate in coordinates])


def _chords(alignments: Sequence[GrainAlignment]) -> tuple[IntArray, FloatArray]:
    """Return the ends of chords (#A by 3: upper, lower, and lower again) and the directions across them (#A by 2)."""
    ends = np.array([[each.upper, each.lower, each.lower] for each in alignments], dtype=np.int32).reshape(-1, 3)
    return ends, np.array([[each.direction[1], -each.direction[0]] for each in alignments]).reshape(-1, 2)


def _coordinates(vertices: IntArray) -> IntArray:
    return (2 * vertices[:, None] + np.arange(2)).ravel()


class Metric:
    """A factor, the chords of the grain that keep their directions, and the rows of contacts."""

    def __init__(self, factor: Factor, alignments: Sequence[GrainAlignment]) -> None:
        """Hold the chords of some pieces over a factor."""
        self.factor = factor
        self._chords, self._across = _chords(alignments)

    @cached_property
    def _without_contacts(self) -> Solve:
        return self._solver(np.zeros((0, 3), dtype=np.int32), np.zeros((0, 3, 2)))

    def solver(self, vertices: IntArray, jacobian: FloatArray) -> Solve:
        """Return the solution by the factor plus a row R^T R for each contact; it does not move chords sideways.

        Args:
            vertices: #C by 3, of contacts, if any.
            jacobian: #C by 3 by 2, the row's entries [(N/m)^1/2].
        """
        return self._solver(vertices, jacobian) if len(vertices) else self._without_contacts

    def _solver(self, vertices: IntArray, jacobian: FloatArray) -> Solve:
        factor, count = self.factor, len(self._chords)
        chord = np.zeros((count, 3, 2))
        chord[:, 0], chord[:, 1] = self._across, -self._across
        vertices, jacobian = np.concatenate([self._chords, vertices]), np.concatenate([chord, jacobian])
        if len(vertices) == 0:
            return factor.solve
        own, at = np.unique(vertices, return_inverse=True)
        rows = np.zeros((len(vertices), len(own), 2))
        np.add.at(rows, (np.repeat(np.arange(len(vertices)), 3), at.ravel()), jacobian.reshape(-1, 2))
        flat = rows.reshape(len(rows), -1)
        columns = factor.columns(own)
        inner = flat @ factor.between(columns, own) @ flat.T
        contacts = np.arange(count, len(rows))
        inner[contacts, contacts] += 1.0
        # Contacts so stiff that 1 is lost beside them would leave it singular.
        inner[contacts, contacts] *= 1.0 + _ROUNDING

        def solve(force: FloatArray) -> FloatArray:
            step = factor.solve(force)
            pull = np.linalg.solve(inner, flat @ step[own].ravel())
            step = step - factor.spread(columns, (pull @ flat).reshape(-1, 2))
            for (upper, lower, _), across in zip(self._chords, self._across, strict=True):
                # What is left is rounding, which would add up over the steps.
                half = 0.5 * across * (across @ (step[upper] - step[lower]))
                step[upper] -= half
                step[lower] += half
            return step

        return solve


def stiffness_matrix(network: SpringNetwork, positions: FloatArray, known: FloatArray | None = None) -> csc_array:
    """Return the stiffness of a network in a layout (#V by 2 [m]), 2 #V by 2 #V [N/m]: J^T J of springs and guard, and that of cells.

    It leaves out what is negative, as across compressed springs and threads, so that each direction is one of descent. That of a
    membrane's cells may be `known` (see :func:`cell_stiffness`).
    """
    cells, springs, count = network.cell_arrays, network.spring_arrays, network.vertex_count
    size = 2 * count
    free, matrix = diags_array(network.bonds.freedom.numpy().ravel()), csc_array((size, size))
    for part in network.cell_models:
        begin, end = cells.of_face[[part.first, part.first + part.count]]
        if part.model == "springs":
            ends, rest, stiffness = springs.ends, springs.rest_length, springs.stiffness
            if part.count < network.face_count:
                inside = np.zeros(count, dtype=bool)
                inside[cells.faces[part.first : part.first + part.count].ravel()] = True
                own = inside[ends[:, 0]]
                ends, rest, stiffness = ends[own], rest[own], stiffness[own]
            d = positions[ends[:, 1]] - positions[ends[:, 0]]
            length = np.sqrt(np.einsum("ij,ij->i", d, d))
            # Rows are along each spring, and across those that are stretched.
            along = d * (np.sqrt(stiffness) / length)[:, None]
            stretched = np.flatnonzero(length > rest)
            across = turned_left(along[stretched]) * np.sqrt(1.0 - rest[stretched] / length[stretched])[:, None]
            of_springs = [
                _rows(count, of, np.stack([-vector, vector], axis=1))
                for of, vector in ((ends, along), (ends[stretched], across))
            ]
            rows = vstack([*of_springs, *_guard_rows(network, positions, slice(begin, end))]) @ free
            matrix = matrix + rows.T @ rows
        else:
            entries = (cell_stiffness(network, positions, part) if known is None else known)[begin:end]
            place = 2 * cells.corner[begin:end, :, None] + np.arange(2, dtype=np.int32)
            at = (np.broadcast_to(each, entries.shape) for each in (place[:, :, :, None, None], place[:, None, None]))
            summed = csc_array(coo_array((entries.ravel(), tuple(each.ravel() for each in at)), shape=(size, size)))
            matrix = matrix + free @ summed @ free
    return csc_array(matrix)


def cell_stiffness(network: SpringNetwork, positions: FloatArray, part: CellModel) -> FloatArray:
    """Return the stiffness of each cell of a part that is a membrane by the places of its corners, without what is negative.

    Args:
        network: of the piece.
        positions: #V by 2, its layout [m].
        part: of the network's cells; those of others have none.

    Returns:
        #C by 3 by 2 by 3 by 2: corner and coordinate, twice [N/m].
    """
    device, count = network.device, network.cell_count
    second, inverse = wp.zeros(count, wp.mat44d, device), wp.zeros(count, wp.mat22d, device)
    at = wp.array(np.ascontiguousarray(positions), dtype=wp.vec2d, device=device)
    given, made = [at, network.cells, part.parameters], [second, inverse]
    record(differentiate_membrane, dim=part.count, first=part.first, inputs=given, outputs=made, device=device).launch()
    values, vectors = np.linalg.eigh(second.numpy())
    positive = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.transpose(0, 2, 1)
    # Rows: the gradients of the barycentric weights of a cell's corners.
    gradient = inverse.numpy()
    gradient = np.concatenate([-gradient.sum(axis=1, keepdims=True), gradient], axis=1)
    found = np.einsum("cipjq,ckp,clq->ckilj", positive.reshape(-1, 2, 2, 2, 2), gradient, gradient, optimize=True)
    return np.asarray(found, dtype=np.float64)


def cell_forces(network: SpringNetwork, positions: FloatArray, part: CellModel) -> FloatArray:
    """Return the forces with which the cells of a part that is a membrane pull at the corners of their faces in a layout (#V by 2 [m]).

    Returns:
        #F by 4 by 2 [N]; a triangle's fourth corner is not used.
    """
    device, count, forces = network.device, network.face_count, CellForces()
    forces.acting, forces.force = wp.zeros(count, wp.int8, device), wp.zeros(4 * count, wp.vec2d, device)
    at = wp.array(np.ascontiguousarray(positions), dtype=wp.vec2d, device=device)
    given, made = [at, network.cells, part.parameters], [wp.zeros(count, wp.float64, device), forces]
    record(part.potential, dim=part.count, first=part.first, inputs=given, outputs=made, device=device).launch()
    return np.array(forces.force.numpy()).reshape(count, 4, 2)


def _rows(count: int, vertices: IntArray, gradient: FloatArray) -> csr_array:
    """Return rows of J from their gradients (#R by #K by 2) by the places of some of `count` vertices (#R by #K)."""
    columns = 2 * vertices[:, :, None] + np.arange(2, dtype=np.int32)
    offset = np.arange(len(vertices) + 1, dtype=np.int32) * np.int32(2 * vertices.shape[1])
    return csr_array((gradient.ravel(), columns.ravel(), offset), shape=(len(vertices), 2 * count))


def _guard_rows(network: SpringNetwork, positions: FloatArray, part: slice) -> list[csr_array]:
    """Return the rows along and across each worn thread, in those cells of a part in which the guard acts on it."""
    fabric, count = network.fabric, network.vertex_count
    slack = network.cells.slack.numpy()[network.cell_arrays.face[part]]
    corners, edges = network.cell_arrays.corner[part], network.cell_arrays.edges[part]
    p0, p1, p2 = positions[corners].transpose(1, 0, 2)
    a, b = p1 - p0, p2 - p0
    det = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    # Rows: the gradients of the barycentric weights of corners 1 and 2.
    gradient = np.stack([turned_left(-b), turned_left(a)], axis=1) / det[:, None, None]
    rows = []
    axes = zip(grain_axes(network.grain_angle), (fabric.stiffness_warp, fabric.stiffness_weft), strict=True)
    for k, (axis, stiffness) in enumerate(axes):
        onset = float(network.guard.onset[k])
        share = np.einsum("cij,cj->ci", gradient, np.outer(slack[:, k], axis))
        worn = np.einsum("cij,cj->ci", edges, share)
        stretch = np.sqrt(np.einsum("ij,ij->i", worn, worn))
        acts = np.flatnonzero(stretch > 1.0 + onset)
        corner, share, stretch = corners[acts], share[acts], stretch[acts]
        # F e changes by -F u (grad w . e) where a corner moves by u, w its weight.
        deformation = edges[acts] @ gradient[acts]
        of_corner = np.column_stack([share.sum(axis=1), -share])
        # Of a face of no size that is a NaN, which no factor takes.
        with np.errstate(invalid="ignore"):
            root = np.sqrt(stiffness * 0.5 * det[acts])
        unit = worn[acts] / stretch[:, None]
        excess = np.sqrt(1.0 - (1.0 + onset) / stretch)
        for direction, size in ((unit, root), (turned_left(unit), root * excess)):
            back = np.einsum("cji,cj->ci", deformation, direction) * size[:, None]
            rows.append(_rows(count, corner, of_corner[:, :, None] * back[:, None, :]))
    return rows


def equation_rows(network: SpringNetwork, positions: FloatArray) -> csr_array:
    """Return the gradients of a network's equations times the roots of their stiffnesses, #P by 2 #V [(N/m)^1/2]."""
    seams = network.seams
    assert seams is not None
    ends, kind = seams.ends.numpy().reshape(-1, 4), seams.kind.numpy()
    gradient = np.array(seams.coefficient.numpy()).reshape(-1, 4, 2) * (kind == LINEAR)[:, None, None]
    x = positions[ends]
    first, second = unit(x[:, 1] - x[:, 0]), unit(x[:, 3] - x[:, 2])
    ratio = seams.ratio.numpy()[:, None]
    of_lengths = np.stack([-first, first, ratio * second, -ratio * second], axis=1)
    chord = x[:, 2] - x[:, 1]
    u = unit(chord)
    across = np.stack([-u[:, 1], u[:, 0]], axis=1)
    share = np.einsum("ij,ij->i", x[:, 0] - x[:, 1], u) / np.maximum(np.linalg.norm(chord, axis=1), 1e-300)
    of_line = np.stack(
        [across, (share - 1.0)[:, None] * across, -share[:, None] * across, np.zeros_like(across)], axis=1
    )
    gradient = np.where((kind == LENGTHS)[:, None, None], of_lengths, gradient)
    gradient = np.where((kind == STRAIGHT)[:, None, None], of_line, gradient)
    gradient *= np.sqrt(seams.stiffness.numpy())[:, None, None]
    columns = 2 * ends[:, :, None] + np.arange(2)
    rows = csr_array(
        (gradient.ravel(), columns.ravel(), 8 * np.arange(len(ends) + 1)), shape=(len(ends), 2 * len(positions))
    )
    rows.sum_duplicates()
    return rows
