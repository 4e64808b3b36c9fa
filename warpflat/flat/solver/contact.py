"""Contact in the plane: the border of a piece is kept from lying over itself, at the least price in energy.

The model energy is minimised together with a barrier between border vertices and border edges (as in incremental potential contact,
Li et al. 2020, and Smith and Schaefer 2015): b(r) = -k (r - g)^2 ln(r / g) below a gap g, where r is their distance. The gap is
g = d min(1, s / s0), s the way along the border on the body, so that the sides of a notch may meet at its tip.

The minimiser is that of `warpflat.flat.solver.minimise`, to whose metric the stiffness of the contacts is added exactly by Woodbury's
formula. A step is halved until the energy falls and the border is simple. The energy of the guard is infinite where a face is mirrored.
Hence every layout on the way is injective, and the last one is certified.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from warpflat.core.arrays import FloatArray, IndexArray
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.energy import NO_CONTACTS, Contacts, Energy
from warpflat.flat.solver.grain import align_grain, remove_rotation
from warpflat.flat.solver.metric import LaplacianFactor, Metric
from warpflat.flat.solver.minimise import Cloth, Descent
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.solver.stop import Outcome, Remainder, RemainderEstimate
from warpflat.flat.surface.connectivity import border_of
from warpflat.flat.surface.injective import border_edges_of, crack_edges_of, crossings, is_injective, near_edges
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.triangles import corner_means

__all__ = ["Barrier", "open_cracks", "relax_with_contact", "swirl"]

# Two places of the border have the whole gap between them if the way between them along the border is at least this [m],
_FULL_GAP_WAY = 0.025
# and at least so many gaps; less on a shorter way, in proportion.
_FULL_GAP_WAYS = 10.0
# The sides of cracks must not cross, but may lie as close as this share of the gap.
_CRACK_GAP = 0.02
# Stiffness of the barrier, in median stiffnesses of the springs.
_BARRIER_STIFFNESS = 1.0
# Near edges are looked for anew once the border has moved by so many gaps.
_MARGIN = 4.0
# At most so many iterations, and fewer where they times the vertices are more than this: 80 s at 260,000.
_MOST_ITERATIONS = 2_000
_MOST_WORK = 100_000_000
# Sides of closed cracks are drawn apart by this share of the way to the middle of the faces around each vertex; less where that folds.
_OPENINGS = (1e-2, 1e-3, 1e-4)


def open_cracks(surface: Surface, positions: FloatArray) -> FloatArray:
    """Return a layout (#V by 2 [m]) whose cracks gape a little where their sides coincide; as it was if that does not part them."""
    edges, crack = border_edges_of(surface), crack_edges_of(surface)
    sides = np.union1d(edges.tail[crack], edges.head[crack])
    faces, used = surface.faces, surface.faces >= 0
    middle = corner_means(positions, faces)
    face, vertex = np.nonzero(used)[0], faces[used]
    count = np.bincount(vertex, minlength=len(positions))[sides]
    mean = np.stack(
        [np.bincount(vertex, middle[face, k], minlength=len(positions))[sides] / count for k in range(2)], 1
    )
    for share in _OPENINGS:
        opened = positions.copy()
        opened[sides] += share * (mean - opened[sides])
        if is_injective(surface, opened):
            return opened
    return positions


def swirl(positions: FloatArray, turn: float) -> FloatArray:
    """Return a layout (#V by 2 [m]) turned by an angle [rad] in its middle, and by less and less farther out."""
    middle, size = positions.mean(axis=0), np.linalg.norm(np.ptp(positions, axis=0))
    place = (positions - middle) @ np.array([1.0, 1.0j])
    place = place * np.exp(1j * turn * np.exp(-4.0 * np.abs(place / size) ** 2))
    return middle + np.stack([place.real, place.imag], axis=1)


_CROSSED = replace(NO_CONTACTS, energy=np.inf)


class Barrier:
    """The barrier between border vertices and border edges that are near in the plane and far along the border."""

    @classmethod
    def of(cls, network: SpringNetwork, gap: float) -> Barrier:
        """Return the barrier for the border of a network, as stiff as its springs."""
        return cls(network.surface, gap, _BARRIER_STIFFNESS * float(np.median(network.spring_arrays.stiffness)))

    def __init__(self, surface: Surface, gap: float, stiffness: float) -> None:
        self._gap, self._stiffness = gap, stiffness
        self._slope = gap / max(_FULL_GAP_WAY, _FULL_GAP_WAYS * gap)
        self._edges = edges = border_edges_of(surface)
        self._crack = crack_edges_of(surface)
        length = np.linalg.norm(surface.vertices[edges.head] - surface.vertices[edges.tail], axis=1)
        ends = np.concatenate([[0.0], np.cumsum(length)])
        self._length, self._station = length, ends[:-1] - ends[edges.first]
        self._around = ends[edges.first + edges.count] - ends[edges.first]
        self._border = np.full((len(length), 2), np.inf)
        self._near: tuple[IndexArray, IndexArray]

    def __call__(self, positions: FloatArray) -> Contacts:
        """Return the contacts of a layout (#V by 2 [m])."""
        # Pairs of border edges within the gap and some more are looked for anew once the border has moved by that (Verlet).
        edges, margin = self._edges, _MARGIN * self._gap
        border = positions[edges.tail]
        if np.abs(border - self._border).max() > margin:
            self._border, self._near = border, near_edges(edges, positions, self._gap + 2.0 * margin)
        i, j = self._near
        if len(crossings(edges, positions, (i, j))[0]):
            return _CROSSED
        v, e = np.concatenate([i, j]), np.concatenate([j, i])
        apart = (edges.tail[v] != edges.tail[e]) & (edges.tail[v] != edges.head[e])
        v, e = v[apart], e[apart]
        # The gap between vertices and edges grows with the distance between them along the border.
        around, tail = self._around[v], np.abs(self._station[v] - self._station[e])
        head = np.abs(self._station[v] - self._station[e] - self._length[e])
        along = np.minimum(np.minimum(tail, around - tail), np.minimum(head, np.abs(around - head)))
        along = np.where(edges.first[v] == edges.first[e], along, np.inf)
        most = np.where(self._crack[v] & self._crack[e], _CRACK_GAP * self._gap, self._gap)
        gap = np.minimum(most, self._slope * along)
        # Distances of vertices from edges, shares along the edges, and unit vectors away from them.
        vertices = np.stack([edges.tail[v], edges.tail[e], edges.head[e]], axis=1)
        place, start, end = (positions[vertices[:, k]] for k in range(3))
        edge, spoke = end - start, place - start
        squared = np.maximum(np.einsum("ij,ij->i", edge, edge), 1e-300)
        along = np.clip(np.einsum("ij,ij->i", spoke, edge) / squared, 0.0, 1.0)
        away = spoke - along[:, None] * edge
        distance = np.linalg.norm(away, axis=1)
        away = away / np.maximum(distance, 1e-300)[:, None]
        near = distance < gap
        vertices, r, t, away, g = vertices[near], distance[near], along[near], away[near], gap[near]
        if len(r) and not r.min() > 0.0:
            return _CROSSED
        log, short, k = np.log(r / g), r - g, self._stiffness
        share = np.stack([np.ones_like(t), t - 1.0, -t], axis=1)
        return Contacts(
            energy=float((-k * short**2 * log).sum()),
            vertices=vertices,
            jacobian=share[:, :, None] * away[:, None],
            slope=-k * (2 * short * log + short**2 / r),
            bend=-k * (2 * log + 4 * short / r - (short / r) ** 2),
        )


def relax_with_contact(state: Relaxation, gap: float) -> Outcome | None:
    """Minimise the energy of one piece with contact between stretches of its border.

    Args:
        state: one piece in an injective layout, its grain aligned; holds the relaxed layout afterwards.
        gap: between stretches of the border that are far from each other along it [m].

    Returns:
        How it ended; the energies are those of the cloth alone. None if the start is not injective, in which case nothing is done.
    """
    began, start = time.perf_counter(), state.positions()
    align_grain(state.alignments, start)
    energy = Energy(state, Barrier.of(state.network, gap))
    problem = Cloth(energy, Metric(LaplacianFactor(state.network), state.alignments))
    point = problem.at(start)
    if not np.isfinite(point.energy):
        return None
    descent, at_rest = Descent(problem, point), False
    estimate, left = RemainderEstimate(border_of(state.network.surface)), Remainder()
    most = min(_MOST_ITERATIONS, _MOST_WORK // len(start), state.options.max_steps)
    while not at_rest and descent.iterations < most and descent.step():
        left = estimate.add(descent.point.energy, descent.point.positions, descent.fraction)
        at_rest = left.is_small(state.options) or descent.is_at_rest(state.options)
        problem.factor_stiffness(descent)
    # The largest force on a vertex, that of contact included, over the mean force of the springs.
    springs, force = state.network.spring_arrays, -descent.point.gradient
    a, b = (descent.point.positions[springs.ends[:, k]] for k in range(2))
    tension = springs.stiffness * np.abs(np.linalg.norm(b - a, axis=1) - springs.rest_length)
    remove_rotation(state.alignments, descent.point.positions, force, state.network.spring_stiffness.numpy())
    residual = float(np.linalg.norm(force, axis=1).max() / max(tension.mean(), 1e-300))
    end = descent.point.positions.copy()
    align_grain(state.alignments, end)
    state.place(end)
    state.steps += descent.iterations
    state.work_units += descent.work_units
    return Outcome(
        converged=at_rest and is_injective(state.network.surface, end),
        steps=descent.iterations,
        work_units=descent.work_units,
        residual=residual,
        energies=state.energies(),
        seconds=time.perf_counter() - began,
        left=left if np.isfinite(left.outline_mm) else None,
    )
