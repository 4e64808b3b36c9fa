"""Sewing: all pieces of a garment are relaxed together, so that both sides of every seam become equally long.

Each edge of a seam has its partner on the other side, the same edge of the body: l_1 - r l_2 = 0, with r the wished
ratio (1, or with ease). Constraints on borders and lines (`warpflat.garment.construction.constraints`) are equations of the same
kind. Each equation c = 0 is held by 1/2 k (c + o)^2 with a finite stiffness k. After each round the offset o grows by the
residual c (`warpflat.garment.construction.augmented_lagrangian`), until all residuals are within their tolerances.

**Costs.** The cost of a seam or a constraint, in joules, is half the work of its forces on the way from where the
pieces lay on their own: 1/2 sum k (c + o) c_unsewn. Were the energy quadratic and the equations linear, these would add
up to the energy that all constraints together have cost; `Sewn.cost` is that energy itself.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import warp as wp

from warpflat.core import FloatArray, InputError, IntArray, StepError, range_offsets, report_activity
from warpflat.flat import (
    CONTACT,
    STEPS,
    Flattening,
    Outcome,
    Relaxation,
    RelaxOptions,
    SpringNetwork,
    cut_sides,
    given_options,
    grain_alignments,
    is_injective,
    join_surfaces,
    make_stage,
    overlap_area,
    stiffness_matrix,
)
from warpflat.garment.construction.augmented_lagrangian import ConstrainedOutcome, factor_pays, relax_under_equations
from warpflat.garment.construction.carry import falloff_weights
from warpflat.garment.construction.constraint_equations import (
    ConstraintEquations,
    Correction,
    girth_equations,
    join_equations,
    one_group,
    seam_equations,
    smooth_equations,
    stretch_equations,
)
from warpflat.garment.construction.constraints import (
    Constraint,
    DrawnLine,
    KeptGirth,
    equations_of_constraint,
    find_piece,
)
from warpflat.garment.construction.join_networks import join_networks
from warpflat.garment.construction.sewn import ConstraintResult, Sewn, Stitching

__all__ = ["sew"]


# Stiffness of an equation over the median spring of the cloth: with a factor of all stiffnesses, and for plain steps.
_RELATIVE_STIFFNESS, _STIFFNESS_FOR_STEPS = 100.0, 4.0
# No seam makes a piece so many times as large as it is on its own.
_BLOWN = 10.0


class SewingNetwork:
    """Several pieces as one mesh, each with its own range of vertices.

    Attributes:
        pieces: by name.
        first: by piece, the number of its first vertex.
        surface: all pieces as one mesh.
        alignments: by piece, the chords that keep their direction: one, or one for each part of a piece that has been cut apart.
    """

    def __init__(self, pieces: Mapping[str, Flattening]) -> None:
        """Put the pieces, of one fabric, side by side."""
        self.pieces = pieces
        first = range_offsets([len(piece.positions) for piece in pieces.values()])
        self.first: dict[str, int] = dict(zip(pieces, first.tolist(), strict=False))
        self.surface = join_surfaces([piece.network.surface for piece in pieces.values()])
        self.alignments = {
            name: grain_alignments(piece.network.surface, piece.datum, piece.positions, first=self.first[name])
            for name, piece in pieces.items()
        }

    def numbers(self, name: str, vertices: IntArray) -> IntArray:
        """Return the numbers of a piece's vertices in the joined mesh."""
        return np.asarray(vertices, dtype=np.int32) + np.int32(self.first[name])

    def network(
        self,
        folds: Mapping[str, IntArray],
        equations: ConstraintEquations,
        options: RelaxOptions,
        offsets: Iterable[tuple[IntArray, FloatArray]],
    ) -> SpringNetwork:
        """Return the springs and cells of all pieces as one network on their device, sewn by equations.

        All pieces come to rest together.

        Args:
            folds: by piece, vertices that must lie on one upright line.
            equations: of seams and constraints.
            options: of the relaxation.
            offsets: of some equations, their numbers and the offsets with which they begin [m].
        """
        # A copy: a single piece's own network must not stay sewn.
        network = replace(join_networks([piece.network for piece in self.pieces.values()]))
        if folds:
            network.keep_vertical(np.concatenate([self.numbers(name, ids) for name, ids in folds.items()]))
        if len(equations):
            thread = max(network.fabric.stiffness_warp, network.fabric.stiffness_weft)
            median = float(np.median(network.spring_arrays.listed_stiffness))
            relative = _RELATIVE_STIFFNESS if factor_pays(network, options) else _STIFFNESS_FOR_STEPS
            stiffness = np.where(equations.soft > 0, equations.soft * thread, relative * median)
            begun = np.zeros(len(equations))
            for numbers, known in offsets:
                begun[numbers] = known
            network.sew(
                equations.ends, equations.ratio, stiffness, kind=equations.kind, target=equations.target,
                coefficient=equations.coefficient, offset=begun,
            )  # fmt: skip
        return network

    def fold_results(
        self, state: Relaxation, unsewn: FloatArray, folds: Mapping[str, IntArray]
    ) -> Iterator[ConstraintResult]:
        """Yield folds with their costs, by the forces of the lines that hold them.

        Args:
            state: at rest.
            unsewn: #V by 2, where the pieces lay on their own [m].
            folds: by piece, vertices on one upright line.
        """
        if not folds:
            return
        position, freedom = state.positions(), state.network.bonds.freedom
        saved = freedom.numpy().copy()
        freedom.fill_(wp.vec2d(1.0, 1.0))
        force = state.forces()
        freedom.assign(saved)
        for name, ids in folds.items():
            line = self.numbers(name, ids)
            moved = position[line, 0] - unsewn[line, 0]
            cost, bend = -0.5 * float(force[line, 0] @ (moved - moved.mean())), float(np.ptp(position[line, 0]))
            yield ConstraintResult(name=f"{name} fold", kind="fold", cost=cost, violation=bend)

    def overlaps(self, layout: FloatArray) -> dict[str, float]:
        """Return by name the area that each piece that lies over itself in a layout (#V by 2 [m]) covers more than once [m2]."""
        areas = {
            name: overlap_area(piece.network.surface, layout[rows], cut_sides(piece.cuts))
            for name, piece in self.pieces.items()
            for rows in [slice(self.first[name], self.first[name] + len(piece.positions))]
        }
        return {name: area for name, area in areas.items() if area}

    def blown_up(self, layout: FloatArray) -> list[str]:
        """Return the names of pieces that are many times as large in a layout (#V by 2 [m]) as they are on their own."""
        return [
            name
            for name, piece in self.pieces.items()
            for rows in [slice(self.first[name], self.first[name] + len(piece.positions))]
            if not np.ptp(layout[rows], axis=0).max() <= _BLOWN * np.ptp(piece.positions, axis=0).max()
        ]

    def split(self, state: Relaxation, outcome: Outcome, *, stage_name: str = "sew") -> dict[str, Flattening]:
        """Return each piece with its part of the layout, and in its history the stages of a relaxation with this outcome."""
        first, layout, sewn = outcome.first_steps, state.positions(), {}
        ends = [(stage_name, layout, outcome)]
        if first is not None and outcome.first_layout is not None:
            ends.insert(0, (STEPS, outcome.first_layout, first))
        free = state.network.bonds.freedom.numpy()
        for name, piece in self.pieces.items():
            rows = slice(self.first[name], self.first[name] + len(piece.positions))
            # Nothing but a fold holds a piece in its place: where it has drifted to would be a matter of rounding.
            drift = layout[rows].mean(axis=0) - piece.positions.mean(axis=0)
            layout[rows] -= free[rows].min(axis=0) * drift
            stages = list(piece.stages)
            for stage, place, end in ends:
                energies = Relaxation(piece.network, state.options, start=place[rows]).energies()
                own = replace(end, energies=energies, left=None)
                stages.append(make_stage(stage, piece.network, place[rows], own))
            sewn[name] = replace(piece, positions=layout[rows], stages=tuple(stages), unsewn=piece.unsewn or piece)
        return sewn


def sew(
    pieces: Mapping[str, Flattening],
    seams: Sequence[Stitching] = (),
    *,
    constraints: Sequence[Constraint] = (),
    folds: Mapping[str, IntArray] | None = None,
    options: RelaxOptions | None = None,
    offsets: Mapping[tuple[str, str], FloatArray] | None = None,
) -> Sewn:
    """Relax pieces together under their seams and constraints.

    Args:
        pieces: relaxed one by one, of one fabric.
        seams: which edges are sewn to each other.
        constraints: on borders and lines.
        folds: by piece, vertices that must lie on one upright line, exactly.
        options: of the relaxation.
        offsets: those of an earlier sewing, at whose end the pieces lie.

    Raises:
        InputError: a constraint names what does not exist, or a piece cannot be laid with its fold straight.
        StepError: pieces are crushed so far that they cannot be relaxed together, or their seams drive them apart without end.
    """
    start_time = time.perf_counter()
    options = given_options(options)
    joined = SewingNetwork(pieces)
    folds = folds or {}
    unsewn = np.concatenate([piece.positions for piece in pieces.values()])
    equations, kinds, oriented = _constraint_equations(joined, unsewn, seams, constraints, folds)
    start = np.concatenate([_straighten_fold(piece, folds.get(name)) for name, piece in pieces.items()])
    # By kind and name of every group the numbers of those of its equations that have offsets; begin with those that are known.
    lasting, known = (equations.soft == 0) | (equations.share > 0), offsets or {}
    held = [
        ((kind, name), np.flatnonzero(lasting & (equations.group == number)).astype(np.int32))
        for number, (name, kind) in enumerate(kinds)
    ]
    begun = [(numbers, known[key]) for key, numbers in held if len(known.get(key, ())) == len(numbers)]
    network = joined.network(folds, equations, options, begun)
    # A piece with a guided line needs nothing else to hold it: the line cannot turn.
    alignments = [
        part
        for name, parts in joined.alignments.items()
        if name not in folds and name not in oriented
        for part in parts
    ]
    state = Relaxation(network, options, start=start, alignments=alignments)
    try:
        ended = _relax(state, equations)
    except StepError as error:
        # Stiff beyond all numbers are pieces that have not come to rest on their own.
        stiff = [
            name
            for name, piece in pieces.items()
            if not np.isfinite(stiffness_matrix(piece.network, piece.positions).data).all()
        ]
        raise StepError(f"{', '.join(stiff)}: {error}, before anything is sewn" if stiff else str(error)) from error
    # Springs of seams that contradict each other may drive the pieces apart without end.
    blown = joined.blown_up(state.positions())
    if blown:
        raise StepError(f"{', '.join(blown)}: the seams contradict each other, and drive the cloth apart without end")
    seconds = time.perf_counter() - start_time
    converged = ended.outcome.converged and ended.satisfied
    first = ended.outcome.first_steps
    own_seconds = seconds - (0.0 if first is None else first.seconds)
    sewn = joined.split(state, replace(ended.outcome, converged=converged, seconds=own_seconds))
    overlaps = joined.overlaps(state.positions()) if options.gap_mm else {}
    if overlaps:
        parted = _part(state, start, equations)
        if parted is not None:
            state, ended = parted
            apart = SewingNetwork(sewn).split(state, replace(ended.outcome, converged=True), stage_name=CONTACT)
            sewn, converged, seconds = apart, True, time.perf_counter() - start_time
        for name, overlap in overlaps.items():
            piece, note = sewn[name], f"sewn, the piece lies over itself by {1e6 * overlap:.3g} mm2"
            if piece.stages[-1].name == CONTACT:
                note += f"; contact has parted it, at a price of {1e3 * piece.contact_energy:.3g} mJ"
            else:
                note += ", and contact could not part it: cut it apart there"
            sewn[name] = replace(piece, notes=(*piece.notes, note))
    offsets = dict[tuple[str, str], FloatArray]()
    if state.network.seams is not None:
        offset = state.network.seams.offset.numpy()
        offsets = {key: offset[numbers] for key, numbers in held}
    of_folds = list(joined.fold_results(state, unsewn, folds))
    return Sewn(
        pieces=sewn,
        converged=converged,
        contradictory=ended.contradictory,
        steps=state.steps,
        energy_before=sum(_potential(piece.network, piece.positions) for piece in pieces.values()),
        energy_after=sum(_potential(piece.network, piece.positions) for piece in sewn.values()),
        results=(*_constraint_results(state, equations, kinds, ended.residuals, unsewn), *of_folds),
        seconds=seconds,
        offsets=offsets,
    )


def _constraint_equations(
    joined: SewingNetwork,
    unsewn: FloatArray,
    seams: Sequence[Stitching],
    constraints: Sequence[Constraint],
    folds: Mapping[str, IntArray],
) -> tuple[ConstraintEquations, list[tuple[str, str]], set[str]]:
    """Return the equations of seams and constraints in the numbering of the joined pieces.

    With them come name and kind of each group, and the names of the pieces that are oriented on the cloth, which need no
    other constraint against turning.
    """
    groups: dict[tuple[str, str], list[ConstraintEquations]] = {}
    oriented: set[str] = set()
    on_fold = {name: joined.numbers(name, ids) for name, ids in folds.items()}
    # A drawn line keeps its shape: nothing else need keep it smooth.
    lines = [each for each in constraints if isinstance(each, DrawnLine)]
    drawn = {vertex for each in lines for vertex in joined.numbers(each.piece, each.vertices).tolist()}
    for seam in seams:
        first, second = (joined.numbers(n, ids) for n, ids in zip(seam.pieces, seam.vertices, strict=True))
        sides = zip((first, second), seam.pieces, strict=True)
        smooth = [
            smooth_equations(side, unsewn, on_fold.get(name)) for side, name in sides if not drawn.issuperset(side)
        ]
        if seam.joints is None:
            sewn = seam_equations(first, second, seam.ratio, eased=seam.eased)
        else:
            sewn = stretch_equations(first, second, seam.joints, joined.surface.vertices, unsewn, seam.ratio)
        groups.setdefault((seam.name, "seam"), []).append(one_group(sewn, *smooth))
    equations, kinds = [one_group(*runs) for runs in groups.values()], list(groups)
    for constraint in constraints:
        if isinstance(constraint, KeptGirth):
            parts = [
                girth_equations(joined.numbers(name, edges), constraint.lengths[name], constraint.shares[name], unsewn)
                for name, edges in constraint.edges.items()
            ]
            equations.append(one_group(*parts))
            kinds.append((constraint.name, constraint.kind))
            continue
        own, orients = equations_of_constraint(
            constraint, find_piece(constraint, joined.pieces), folds.get(constraint.piece)
        )
        equations.append(replace(own, ends=joined.numbers(constraint.piece, own.ends)))
        kinds.append((constraint.name, constraint.kind))
        if orients:
            oriented.add(constraint.piece)
    return join_equations(equations), kinds, oriented


def _part(
    together: Relaxation, start: FloatArray, equations: ConstraintEquations
) -> tuple[Relaxation, ConstrainedOutcome] | None:
    """Relax sewn pieces again, with contact, since some have come to rest lying over themselves; None where that fails.

    Args:
        together: the pieces at rest without contact.
        start: #V by 2, the layout before, which must be injective [m].
        equations: of the seams and constraints.
    """
    network, options = together.network, together.options
    if not (factor_pays(network, options) and is_injective(network.surface, start)):
        return None
    seams = network.seams
    offset = None if seams is None else seams.offset.numpy().copy()
    state = Relaxation(network, options, start=start, alignments=together.alignments)
    ended = _relax(state, equations, gap=1e-3 * options.gap_mm)
    if ended.outcome.converged and ended.satisfied and is_injective(network.surface, state.positions()):
        return state, ended
    if seams is not None:
        seams.offset.assign(offset)
    return None


def _relax(state: Relaxation, equations: ConstraintEquations, gap: float = 0.0) -> ConstrainedOutcome:
    """Relax until all is at rest and the equations hold; with contact, if a gap is given [m]."""
    report_activity("sewing")
    corrected = equations.soft == 0

    def on_round(residuals: FloatArray) -> None:
        farthest = np.abs(residuals[corrected]).max(initial=0.0)
        report_activity(f"sewing, step {state.steps}, {1e3 * farthest:.2g} mm amiss")

    return relax_under_equations(state, Correction(equations), equations.violation, on_round=on_round, gap=gap)


def _constraint_results(
    state: Relaxation,
    equations: ConstraintEquations,
    kinds: Sequence[tuple[str, str]],
    residuals: FloatArray,
    unsewn: FloatArray,
) -> list[ConstraintResult]:
    """Return seams and constraints with their costs: half the work of each one's forces since the pieces lay unsewn."""
    seams = state.network.seams
    if seams is None:
        return []
    force = seams.stiffness.numpy() * (seams.offset.numpy() + residuals)
    before = state.network.seam_residuals(wp.array(unsewn, dtype=wp.vec2d, device=state.network.device))
    cost = equations.group_sums(0.5 * force * before)
    largest = np.zeros(len(kinds))
    np.maximum.at(largest, equations.group, np.where(equations.soft > 0, 0.0, np.abs(residuals)))
    summed = np.isfinite(equations.sum_tolerance)
    violation = np.where(summed, np.abs(equations.group_sums(residuals)), largest)
    return [
        ConstraintResult(name=name, kind=kind, cost=float(cost[number]), violation=float(violation[number]))
        for number, (name, kind) in enumerate(kinds)
    ]


def _straighten_fold(piece: Flattening, vertices: IntArray | None) -> FloatArray:
    """Lay some vertices of a piece on one line along the grain, without mirroring a face.

    Each vertex moves sideways by as much as the line bends there. The move fades out across the piece, since it would
    press the faces beside the line otherwise.

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


def _potential(network: SpringNetwork, positions: FloatArray) -> float:
    """Return the potential energy of a layout [J]."""
    return Relaxation(network, RelaxOptions(), start=positions).energies().potential
