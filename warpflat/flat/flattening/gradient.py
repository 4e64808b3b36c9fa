"""Derivatives of a relaxed pattern, by the adjoint at the minimum of its energy.

At the minimum the forces F(x, p) of the cloth vanish, but for the two that keep the chord of the datum upright. So a scalar s(x) of the
pattern changes with a parameter p by ds/dp = mu . dF/dp. The adjoint mu solves H mu = ds/dx, with the stiffness H = -dF/dx, for layouts
whose chord stays upright and whose mean stays in place (Giles and Pierce 2000, An introduction to the adjoint approach to design). That is
one sparse solve, whatever the number of parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.sparse import block_array, coo_array, csc_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.polyline import polyline_length
from warpflat.core.short_repr import short_repr
from warpflat.flat.flattening.progress import CONTACT
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.springs import spring_geometry, springs_of
from warpflat.flat.solver.energy import Energy
from warpflat.flat.solver.minimise import line_search
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.cells import make_cells

__all__ = ["Gradient", "gradient"]

Scalar = Callable[[FloatArray], tuple[float, FloatArray]]

# Newton steps from the pattern, which is at rest within its tolerance, to the exact minimum.
_MOST_STEPS = 50
# The largest move of a Newton step that ends them, over the mean length of the springs.
_NEGLIGIBLE = 1e-9
# Rounding of an energy, as a share.
_ROUNDING = 1e-13
# Displacement of central differences, over the mean length of the springs. A larger one steps over the onset of the guard in too many
# cells.
_DIFFERENCE = 1e-7


@dataclass(frozen=True, kw_only=True, eq=False)
class Gradient:
    """A scalar of a pattern at the minimum of its energy, and its derivatives.

    Attributes:
        value: the scalar.
        positions: #P by 2, the pattern at its exact minimum [m].
        network: the model; `network.spring_arrays.ends` are the springs' vertices.
        adjoint: #P by 2, mu: what a force on each vertex changes of the scalar [per N].
        vertex_origin: #P, for each vertex of the pattern the vertex of the surface.
    """

    __repr__ = short_repr

    value: float
    positions: FloatArray
    network: SpringNetwork
    adjoint: FloatArray
    vertex_origin: IntArray = field(repr=False)

    @cached_property
    def rest_lengths(self) -> FloatArray:
        """The derivative by the rest length of each spring, #S [per m].

        Raises:
            InputError: the model is a membrane.
        """
        length, change = self._springs()
        return self.network.spring_arrays.stiffness * change / length

    @cached_property
    def stiffness(self) -> FloatArray:
        """The derivative by the stiffness of each spring, #S [per N/m].

        Raises:
            InputError: the model is a membrane.
        """
        length, change = self._springs()
        return (self.network.spring_arrays.rest_length / length - 1.0) * change

    def _springs(self) -> tuple[FloatArray, FloatArray]:
        """Return the length of each spring, and its vector times the difference of the adjoint at its ends, #S."""
        if self.network.model == "membrane":
            raise InputError("a piece that is measured cell by cell has no springs: differentiate by its vertices")
        near, far = self.network.spring_arrays.ends.T
        edge, adjoint = self.positions[far] - self.positions[near], self.adjoint[far] - self.adjoint[near]
        return np.linalg.norm(edge, axis=1), np.einsum("ij,ij->i", edge, adjoint)

    @cached_property
    def vertices(self) -> FloatArray:
        """The derivative by the vertices of the surface in space, #V by 3 [per m].

        Rest lengths, stiffnesses and the shapes of faces follow the vertices. The directions in which springs run over the cloth are held.
        """
        around, step = _Neighbours(self.network), _difference(self.network)
        found = np.zeros((int(self.vertex_origin.max()) + 1, 3))
        for group in around.groups:
            for axis in range(3):
                change = np.zeros(len(self.positions))
                for side in (step, -step):
                    vertices = self.network.surface.vertices.copy()
                    vertices[group, axis] += side
                    moved = _with_vertices(self.network, vertices, self.positions)
                    force = np.array(Relaxation(moved, RelaxOptions(), start=self.positions).forces())
                    change += np.einsum("ij,ij->i", self.adjoint, force) / (2.0 * side)
                np.add.at(found[:, axis], self.vertex_origin[group], (around.matrix @ change)[group])
        return found


def gradient(pattern: Flattening, of: str | Sequence[int] | Scalar) -> Gradient:
    """Differentiate a scalar of a relaxed pattern by rest lengths, stiffnesses and the vertices of its surface.

    The pattern is first brought to the exact minimum by Newton steps. The stiffness is that of springs and guard together, by central
    differences of their forces over groups of vertices that do not meet (Curtis, Powell and Reid 1974).

    >>> sensitivity = warpflat.gradient(pattern, "bust")       # the length of a feature line
    >>> sensitivity.value, sensitivity.rest_lengths, sensitivity.vertices

    Args:
        pattern: one piece, not sewn.
        of: "area"; the name of a feature line, or the vertices of a polyline, for its length [m]; or a function of the pattern (#P by 2
            [m]) that returns a number and its derivative by the pattern, #P by 2.

    Raises:
        InputError: the piece is sewn, held apart by contact or in several parts, its line is unknown, or Newton steps do not converge.
    """
    network = pattern.network
    if pattern.unsewn is not None or network.seams is not None or (network.bonds.freedom.numpy() == 0.0).any():
        raise InputError(f"piece {pattern.surface.name!r} is sewn: a gradient needs it alone; use its `unsewn`")
    if pattern.stages[-1].name == CONTACT:
        raise InputError(f"piece {pattern.surface.name!r} touches itself: no gradient; cut it, or give it gap_mm = 0")
    around = _Neighbours(network)
    if connected_components(around.matrix, directed=False)[0] > 1:
        raise InputError(f"piece {pattern.surface.name!r} is in several parts: no gradient; use `warpflat.separate`")
    scalar, chord = _scalar(pattern, of), (int(pattern.datum[0]), int(pattern.datum[-1]))
    start = np.array(pattern.positions)
    start[chord[1], 0] = start[chord[0], 0]
    energy = Energy(Relaxation(network, RelaxOptions(), start=start))
    enough = _NEGLIGIBLE * float(network.spring_arrays.rest_length.mean())
    point = energy.at(start)
    positions: FloatArray | None = None
    for _ in range(_MOST_STEPS):
        step = _solve(_stiffness(network, point.positions, around), chord, -point.gradient)
        if abs(step).max() <= enough:
            positions = np.asarray(point.positions + step)
            break
        # Close to rest the energy falls by less than its rounding.
        whole = energy.at(point.positions + step)
        found = None if whole.energy <= (1.0 + _ROUNDING) * point.energy else line_search(energy.at, point, step)[0]
        point = found or whole
        if not np.isfinite(point.energy):
            break
    if positions is None:
        raise InputError(
            f"piece {pattern.surface.name!r} is not near enough to a minimum for a gradient ({_MOST_STEPS} Newton steps left a step of "
            f"{1e3 * abs(step).max():.2g} mm): flatten it with a smaller energy_tolerance"
        )
    value, slope = scalar(positions)
    adjoint = _solve(_stiffness(network, positions, around), chord, np.asarray(slope, dtype=np.float64))
    return Gradient(
        value=float(value),
        positions=positions,
        network=network,
        adjoint=adjoint,
        vertex_origin=pattern.vertex_origin,
    )


def _scalar(pattern: Flattening, of: str | Sequence[int] | Scalar) -> Scalar:
    """Return what gives an area, a length or a user's scalar with its derivative."""
    if callable(of):
        return of

    def area(positions: FloatArray) -> tuple[float, FloatArray]:
        faces = np.where(pattern.faces >= 0, pattern.faces, pattern.faces[:, [2]])
        slope, corners = np.zeros_like(positions), positions[faces]
        across = np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1)
        np.add.at(slope, faces, 0.5 * np.stack([across[..., 1], -across[..., 0]], axis=-1))
        return 0.5 * float(np.einsum("ij,ij->", slope, positions)), slope

    def length(positions: FloatArray) -> tuple[float, FloatArray]:
        slope, edge = np.zeros_like(positions), np.diff(positions[line], axis=0)
        unit = edge / np.linalg.norm(edge, axis=1)[:, None]
        np.add.at(slope, line[1:], unit)
        np.add.at(slope, line[:-1], -unit)
        return polyline_length(positions[line]), slope

    if isinstance(of, str) and of == "area":
        return area
    if isinstance(of, str):
        lines = pattern.network.surface.lines
        if of not in lines:
            raise InputError(f"unknown line {of!r}; {nearest(of, ['area', *lines])}")
        of = lines[of].tolist()
    line = np.asarray(of, dtype=np.int32)
    if line.ndim != 1 or len(line) < 2 or line.min() < 0 or line.max() >= len(pattern.positions):
        raise InputError(f"a polyline needs at least two vertices from 0 to {len(pattern.positions) - 1}")
    return length


class _Neighbours:
    """The vertices whose forces each vertex changes.

    Attributes:
        matrix: #P by #P, 1 where two vertices share a face or are the same.
        groups: all vertices, in groups of which no two change the force on one vertex.
    """

    def __init__(self, network: SpringNetwork) -> None:
        faces, count = network.surface.faces, network.vertex_count
        corner = np.where(faces >= 0, faces, faces[:, [2]])
        near, far = np.repeat(corner, 4, axis=1).ravel(), np.tile(corner, (1, 4)).ravel()
        matrix = csr_array(coo_array((np.ones(len(near)), (near, far)), shape=(count, count)))
        matrix.data[:] = 1.0
        self.matrix = matrix
        # A greedy colouring of the graph of vertices that share a neighbour; a group is a colour.
        conflicts, colour = csr_array(matrix @ matrix), np.full(count, -1)
        for vertex, (begin, end) in enumerate(zip(conflicts.indptr, conflicts.indptr[1:], strict=False)):
            taken = set(colour[conflicts.indices[begin:end]].tolist())
            colour[vertex] = next(number for number in range(len(taken) + 1) if number not in taken)
        self.groups = [np.flatnonzero(colour == number).astype(np.int32) for number in range(int(colour.max()) + 1)]


def _difference(network: SpringNetwork) -> float:
    return _DIFFERENCE * float(network.spring_arrays.rest_length.mean())


def _with_vertices(network: SpringNetwork, vertices: FloatArray, positions: FloatArray) -> SpringNetwork:
    """Return the network of a surface whose vertices have moved; an intended stretch is kept.

    The springs' stiffnesses change as those do whose directions are measured in `positions` (#P by 2 [m]).
    """
    surface = replace(network.surface, vertices=vertices)
    springs = network.spring_arrays
    shortened = springs.listed_length / spring_geometry(network.surface).listed_length
    changed = replace(springs, listed_length=spring_geometry(surface).listed_length * shortened)
    if network.model == "springs":
        before, after = (
            springs_of(each, network.fabric, positions, grain_angle=network.grain_angle)
            for each in (network.surface, surface)
        )
        changed = replace(
            changed,
            listed_stiffness=springs.listed_stiffness + after.listed_stiffness - before.listed_stiffness,
            shear_deficit=_moved(springs.shear_deficit, before.shear_deficit, after.shear_deficit),
            hourglass=_moved(springs.hourglass, before.hourglass, after.hourglass),
        )
    return replace(network, surface=surface, spring_arrays=changed, cell_arrays=make_cells(surface))


def _moved(values: FloatArray | None, before: FloatArray | None, after: FloatArray | None) -> FloatArray | None:
    """Return values changed by what `after` differs from `before`; None stands for noughts."""
    if before is None and after is None:
        return values
    return np.asarray(
        sum(sign * each for sign, each in ((1.0, values), (1.0, after), (-1.0, before)) if each is not None)
    )


def _stiffness(network: SpringNetwork, positions: FloatArray, around: _Neighbours) -> csc_array:
    """Return -dF/dx, 2 #P by 2 #P [N/m], symmetric."""
    state = Relaxation(network, RelaxOptions(), start=positions)
    step, rows, columns, values = _difference(network), [], [], []
    pairs = around.matrix.tocsc()
    for group in around.groups:
        count = np.diff(pairs.indptr)[group]
        column = np.repeat(group, count)
        row = np.concatenate([pairs.indices[pairs.indptr[vertex] : pairs.indptr[vertex + 1]] for vertex in group])
        for axis in range(2):
            change = np.zeros_like(positions)
            for side in (step, -step):
                moved = positions.copy()
                moved[group, axis] += side
                state.position.assign(moved)
                change -= state.forces() / (2.0 * side)
            for of in range(2):
                rows.append(2 * row + of)
                columns.append(2 * column + axis)
                values.append(change[row, of])
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    matrix = csc_array(coo_array(entries, shape=(positions.size, positions.size)))
    return csc_array(0.5 * (matrix + matrix.T))


def _solve(stiffness: csc_array, chord: tuple[int, int], right: FloatArray) -> FloatArray:
    """Solve for displacements (#P by 2) that leave the chord upright and the mean in place."""
    count, (lower, upper) = len(right), chord
    constraints = np.zeros((3, count, 2))
    constraints[0, lower, 0], constraints[0, upper, 0] = -1.0, 1.0
    constraints[1, :, 0] = constraints[2, :, 1] = 1.0 / count
    # At the size of the stiffness, so that pivots compare.
    rows = csr_array(constraints.reshape(3, -1)) * float(abs(stiffness.diagonal()).mean())
    matrix = csc_array(block_array([[stiffness, rows.T], [rows, None]]))
    found = splu(matrix).solve(np.concatenate([right.ravel(), np.zeros(3)]))
    return np.asarray(found[:-3]).reshape(-1, 2)
