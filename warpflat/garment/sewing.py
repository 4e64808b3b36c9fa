"""Sewing: all pieces of a garment are relaxed together, so that both sides of every seam become equally long.

Each edge of a seam has its partner on the other side, the same edge of the body: l_1 - r l_2 = 0 with r the wished ratio
(1, or with ease). Constraints on borders and lines (`warpflat.garment.constraints`) are equations of the same kind. All are held by
1/2 k (c + o)^2 with a finite stiffness, so that the steps stay cheap; the offset o grows by what is still amiss after each
round (augmented Lagrangian), until nothing is. The minimum is that of the pieces' own energy under the constraints.

**Prices.** What each seam and each constraint costs, in joules: half the work of its forces on the way from where the pieces
lay on their own, 1/2 sum k (c + o) c_alone. Were the energy quadratic and the equations linear, these would add up to the
energy that the constraints together have cost; `Sewn.price` is that energy itself.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp

from warpflat.core.activity import doing
from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.flattening.result import Flattening
from warpflat.garment.constraints import Constraint, equations_of_constraint, piece_of
from warpflat.garment.sewing_network import SewingNetwork
from warpflat.model.constraint_equations import (
    ConstraintEquations,
    join_equations,
    one_group,
    seam_equations,
    smooth_equations,
    stretch_equations,
)
from warpflat.model.network import SpringNetwork
from warpflat.solver.convergence import Outcome
from warpflat.solver.options import RelaxOptions, given_options
from warpflat.solver.relax import relax
from warpflat.solver.relaxation import Relaxation
from warpflat.surface.falloff import falloff_weights

__all__ = ["Held", "SeamPair", "Sewn", "sew"]


# Of a tie's spring over the median spring of the cloth.
_STIFFNESS = 4.0
# Steps of a round at most: what is amiss over a whole seam takes a dozen rounds, whether the cloth has come to rest before the offsets
# grow or only begun to. Every so many rounds they become a quarter longer: offsets that follow a cloth that still swings keep it swinging.
_ROUND = 40
_LONGER = 5
# Ties that contradict each other: in so many rounds what is amiss has come down by less than a tenth.
_PATIENCE = 20


@dataclass(frozen=True, kw_only=True)
class SeamPair:
    """Two chains of vertices that are sewn together, edge by edge or from joint to joint.

    Attributes:
        name: the seam's.
        pieces: names of the two pieces; the same twice where one is sewn to itself.
        vertices: of the two pieces, in corresponding order.
        ratio: wished length of the first side over the second.
        joints: #J by 2, places in the two chains that are sewn to each other; None where all are, one to one.
    """

    name: str
    pieces: tuple[str, str]
    vertices: tuple[IntArray, IntArray]
    ratio: float = 1.0
    joints: IntArray | None = None


@dataclass(frozen=True, kw_only=True)
class Held:
    """A seam or a constraint, as it came out.

    Attributes:
        name: the seam's or the constraint's; "PIECE fold" of a fold.
        kind: "seam", "fold", "straight", "length" or "symmetric".
        price: half the work of its forces: what it costs [J].
        amiss: largest miss of a seam's two lengths, of a line's whole length, of a place [m].
    """

    name: str
    kind: str
    price: float
    amiss: float

    def as_dict(self) -> dict[str, Any]:
        """As in `metrics.json`."""
        return {"name": self.name, "kind": self.kind, "price_j": self.price, "amiss_mm": 1e3 * self.amiss}


@dataclass(frozen=True, kw_only=True)
class Sewn:
    """What sewing gave.

    Attributes:
        pieces: by name, relaxed together.
        converged: whether all came to rest with the seams' sides equal and the constraints kept.
        contradictory: whether it ended since seams and constraints came no nearer to agreeing: more steps do not help.
        steps: approximate implicit steps over all pieces.
        energy_before, energy_after: of all pieces, springs and guard [J].
        held: every seam, fold and constraint with its price, in the order in which they were given.
        seconds: wall clock.
    """

    pieces: Mapping[str, Flattening]
    converged: bool
    contradictory: bool
    steps: int
    energy_before: float
    energy_after: float
    held: tuple[Held, ...]
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """As in `metrics.json`."""
        return {
            "converged": self.converged,
            "contradictory": self.contradictory,
            "steps": self.steps,
            "seconds": self.seconds,
            "energy_before_j": self.energy_before,
            "energy_after_j": self.energy_after,
            "price_j": self.price,
            "largest_difference_mm": 1e3 * self.largest_difference,
        }

    @property
    def price(self) -> float:
        """What all seams, folds and constraints cost together [J]."""
        return self.energy_after - self.energy_before

    @property
    def largest_difference(self) -> float:
        """Of a seam's two sides [m], ease taken out."""
        return max((held.amiss for held in self.held if held.kind == "seam"), default=0.0)

    @property
    def constraints(self) -> tuple[Held, ...]:
        """What is held besides seams."""
        return tuple(held for held in self.held if held.kind != "seam")


def sew(
    pieces: Mapping[str, Flattening],
    seams: Sequence[SeamPair] = (),
    *,
    constraints: Sequence[Constraint] = (),
    folds: Mapping[str, IntArray] | None = None,
    options: RelaxOptions | None = None,
) -> Sewn:
    """Relax pieces together under their seams and constraints.

    Args:
        pieces: relaxed one by one, of one fabric.
        seams: what is sewn to what.
        constraints: on borders and lines.
        folds: by piece, vertices that must lie on one upright line, exactly.
        options: of the relaxation.

    Raises:
        InputError: a constraint names what there is not, or a piece cannot be laid with its fold straight.
    """
    begun = time.perf_counter()
    options = given_options(options)
    whole = SewingNetwork(pieces)
    folds = folds or {}
    alone = np.concatenate([piece.positions for piece in pieces.values()])
    ties, kinds, laid = _ties(whole, alone, seams, constraints, folds)
    start = np.concatenate([_straightened(piece, folds.get(name)) for name, piece in pieces.items()])
    network = whole.network()
    if folds:
        network.keep_vertical(np.concatenate([whole.numbers(name, ids) for name, ids in folds.items()]))
    if len(ties):
        thread = max(network.fabric.stiffness_warp, network.fabric.stiffness_weft)
        median = float(np.median(network.spring_arrays.listed_stiffness))
        hold = np.where(ties.soft > 0, ties.soft * thread, _STIFFNESS * median)
        network.sew(ties.ends, ties.ratio, hold, kind=ties.kind, target=ties.target, lever=ties.lever)
    # A piece with a guided line needs no other hold: the line cannot turn.
    alignments = [piece for name, piece in whole.upright.items() if name not in folds and name not in laid]
    state = Relaxation(network, options, start=start, alignments=alignments)
    outcome, misses, kept, contradictory = _relax_in_rounds(state, ties, options)
    seconds = time.perf_counter() - begun
    converged = outcome.converged and kept
    sewn = whole.split(state, converged=converged, seconds=seconds, residual=outcome.residual)
    return Sewn(
        pieces=sewn,
        converged=converged,
        contradictory=contradictory,
        steps=state.steps,
        energy_before=sum(_energy(piece.network, piece.positions) for piece in pieces.values()),
        energy_after=sum(_energy(piece.network, piece.positions) for piece in sewn.values()),
        held=(*_held(state, ties, kinds, misses, alone), *_held_folds(state, whole, folds, alone)),
        seconds=seconds,
    )


def _ties(
    whole: SewingNetwork,
    alone: FloatArray,
    seams: Sequence[SeamPair],
    constraints: Sequence[Constraint],
    folds: Mapping[str, IntArray],
) -> tuple[ConstraintEquations, list[tuple[str, str]], set[str]]:
    """All ties in the whole's numbering, name and kind of each group, and the pieces that constraints lay on the cloth."""
    ties, kinds, laid = [], [], set()
    on_fold = {name: whole.numbers(name, ids) for name, ids in folds.items()}
    for seam in seams:
        first, second = (whole.numbers(n, ids) for n, ids in zip(seam.pieces, seam.vertices, strict=True))
        sides = zip((first, second), seam.pieces, strict=True)
        smooth = [smooth_equations(side, alone, on_fold.get(name)) for side, name in sides]
        if seam.joints is None:
            held = seam_equations(first, second, seam.ratio)
        else:
            held = stretch_equations(first, second, seam.joints, whole.surface.vertices, alone, seam.ratio)
        ties.append(one_group(held, *smooth))
        kinds.append((seam.name, "seam"))
    for constraint in constraints:
        own, lays = equations_of_constraint(constraint, piece_of(constraint, whole.pieces), folds.get(constraint.piece))
        ties.append(replace(own, ends=whole.numbers(constraint.piece, own.ends)))
        kinds.append((constraint.name, constraint.kind))
        if lays:
            laid.add(constraint.piece)
    return join_equations(ties), kinds, laid


def _relax_in_rounds(
    state: Relaxation, ties: ConstraintEquations, options: RelaxOptions
) -> tuple[Outcome, FloatArray, bool, bool]:
    """Relax, let the offsets grow, and again until all is at rest and the ties agree, twice in a row, since within the tolerances the
    energy still changes; the outcome of the last round, the misses (#P [m]), whether they agree, and whether they contradict each other."""
    seams = state.network.seams
    if seams is None:
        return relax(state), np.zeros(0), True, False
    amiss: list[float] = []
    doing("sewing")
    while True:
        steps = _ROUND + len(amiss) // _LONGER * _ROUND // 4
        state.options = replace(options, max_steps=min(options.max_steps, state.steps + steps))
        outcome, misses = relax(state), _misses(state)
        amiss.append(ties.violation(misses))
        furthest = np.abs(np.where(ties.soft > 0, 0.0, misses)).max(initial=0.0)
        doing(f"sewing, step {state.steps}, {1e3 * furthest:.2g} mm amiss")
        done = outcome.converged and len(amiss) > 1 and max(amiss[-2:]) <= 1.0
        contradictory = not done and _contradict(amiss)
        if done or contradictory or state.steps >= options.max_steps:
            return outcome, misses, amiss[-1] <= 1.0, contradictory
        seams.offset.assign(seams.offset.numpy() + np.where(ties.soft > 0, 0.0, misses))


def _contradict(amiss: Sequence[float]) -> bool:
    """Whether ties no longer come nearer to agreeing, by what was amiss after each round."""
    before, lately = amiss[:-_PATIENCE], amiss[-_PATIENCE:]
    return bool(before) and min(lately) > max(0.9 * min(before), 1.0)


def _held(
    state: Relaxation,
    ties: ConstraintEquations,
    kinds: Sequence[tuple[str, str]],
    misses: FloatArray,
    alone: FloatArray,
) -> list[Held]:
    """Seams and constraints with their prices: half the work of each one's forces since the pieces lay alone."""
    seams = state.network.seams
    if seams is None:
        return []
    pull = seams.stiffness.numpy() * (seams.offset.numpy() + misses)
    price = ties.group_sums(0.5 * pull * _misses(state, alone))
    largest = np.zeros(len(kinds))
    np.maximum.at(largest, ties.group, np.where(ties.soft > 0, 0.0, np.abs(misses)))
    summed = np.isfinite(ties.sum_tolerance)
    amiss = np.where(summed, np.abs(ties.group_sums(misses)), largest)
    return [
        Held(name=name, kind=kind, price=float(price[number]), amiss=float(amiss[number]))
        for number, (name, kind) in enumerate(kinds)
    ]


def _held_folds(
    state: Relaxation, whole: SewingNetwork, folds: Mapping[str, IntArray], alone: FloatArray
) -> list[Held]:
    """Folds with their prices, by the forces with which the lines that hold them push."""
    if not folds:
        return []
    position = state.positions()
    freedom = state.network.bonds.freedom
    kept = freedom.numpy().copy()
    freedom.fill_(wp.vec2d(1.0, 1.0))
    force = state.forces()
    freedom.assign(kept)
    held = []
    for name, ids in folds.items():
        line = whole.numbers(name, ids)
        moved = position[line, 0] - alone[line, 0]
        price = -0.5 * float(force[line, 0] @ (moved - moved.mean()))
        held.append(Held(name=f"{name} fold", kind="fold", price=price, amiss=float(np.ptp(position[line, 0]))))
    return held


def _straightened(piece: Flattening, vertices: IntArray | None) -> FloatArray:
    """The piece's layout with these vertices on one line along the grain and no face mirrored.

    Moved sideways, each by as much as the line bends there; the move fades out across the piece, or it would press the faces beside.

    Raises:
        InputError: neither its pattern nor its development can be laid so.
    """
    if vertices is None:
        return piece.positions
    cells = piece.network.cell_arrays
    for layout in (piece.positions, piece.development.positions):
        x, start = layout[vertices, 0], layout.copy()
        start[:, 0] += falloff_weights(piece.faces, [(vertices, x.mean() - x)], [], len(start))
        start[vertices, 0] = x.mean()
        if (cells.least_shares(start) > 0.01).all():
            return start
    bend = np.ptp(piece.positions[vertices, 0])
    raise InputError(
        f"piece {piece.surface.name!r} cannot be laid with a straight fold: on its own its pattern bends by {1e3 * bend:.0f} mm there, and "
        "straightened some of its faces would be mirrored; cut the whole piece (half = false), or ease the form there"
    )


def _energy(network: SpringNetwork, positions: FloatArray) -> float:
    return Relaxation(network, RelaxOptions(), start=positions).energies().potential


def _misses(state: Relaxation, positions: FloatArray | None = None) -> FloatArray:
    """#P, c of each tie [m], in the present layout or another one."""
    network = state.network
    at = state.position if positions is None else wp.array(positions, dtype=wp.vec2d, device=network.device)
    return network.seam_residuals(at)
