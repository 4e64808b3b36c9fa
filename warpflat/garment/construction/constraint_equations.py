"""Seams and constraints as equations on vertices, in the arrays that `kernels.constraints` takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core import FloatArray, IntArray, arc_lengths, segment_lengths, unit
from warpflat.kernels.constraints import LENGTHS, LINEAR, STRAIGHT

__all__ = [
    "ConstraintEquations",
    "Correction",
    "girth_equations",
    "join_equations",
    "length_equations",
    "level_equations",
    "mirror_equations",
    "one_group",
    "seam_equations",
    "shape_equations",
    "smooth_equations",
    "straight_equations",
    "stretch_equations",
]


# Tolerances of an edge's length, and of the sum along a line [m].
_EDGE_TOLERANCE = 2e-5
_SUM_TOLERANCE = 1e-4
# Tolerance of a girth around several pieces [m].
_GIRTH_TOLERANCE = 5e-4
# Tolerance of a vertex's distance from its line or from its mirror image [m].
_PLACE_TOLERANCE = 5e-5
# Waves up to this length [m] are kept out of a line of prescribed lengths, by springs of this stiffness over the
# stiffer thread's where two edges are as long as a wave.
WAVE, SMOOTH = 0.04, 0.3
# Stiffness of equations that hold together, over the stiffer thread's.
_SHARED = 1.0
# Stiffness of the edges of a seam that is eased, over the stiffer thread's.
_EASED = 0.3
# The part of an offset by which the mean residual of equations that hold together falls, where the cloth's stiffness is not factored.
_RESPONSE = 0.3


@dataclass(frozen=True, kw_only=True, eq=False)
class ConstraintEquations:
    """Equations c(x) = 0 of one seam or constraint, or of several (see `kernels.constraints` for the first five).

    Attributes:
        ends: #P by 4. kind: #P. ratio: #P. target: #P [m]. coefficient: #P by 4 by 2.
        tolerance: #P, tolerance of |c| [m].
        soft: #P, for equations that are only springs, their stiffness over that of the stiffer thread: their residuals
            are neither corrected nor counted; 0 for all others.
        share: #P, above 0 for equations that only hold together: the sum of their residuals times their shares is zero. They
            are soft, and one force acts in all of a group.
        group: #P, the seam or constraint that an equation belongs to.
        sum_tolerance: #groups, tolerance of the absolute sum of its c [m]; infinite where sums mean nothing.
    """

    ends: IntArray
    kind: IntArray
    ratio: FloatArray
    target: FloatArray
    coefficient: FloatArray
    tolerance: FloatArray
    soft: FloatArray
    share: FloatArray
    group: IntArray
    sum_tolerance: FloatArray = field(default_factory=lambda: np.array([np.inf]))

    def __len__(self) -> int:
        """Return the number of equations, #P."""
        return len(self.ends)

    def group_sums(self, residuals: FloatArray) -> FloatArray:
        """Return the sum of the residuals (#P [m]) of each group, #groups [m]."""
        counted = np.where(self.soft > 0, self.share * residuals, residuals)
        return np.bincount(self.group, counted, minlength=len(self.sum_tolerance)).astype(np.float64)

    def violation(self, residuals: FloatArray) -> float:
        """Return the largest residual or sum over its tolerance; up to 1 the equations hold."""
        own, sums = np.abs(residuals) / self.tolerance, np.abs(self.group_sums(residuals)) / self.sum_tolerance
        return float(max(own.max(initial=0.0), sums.max(initial=0.0)))


Response = Callable[[FloatArray], FloatArray]
"""Returns by how much residuals change where offsets grow by given lengths, each #P by #K [m]."""


class Correction:
    """The growth of the offsets from round to round (augmented Lagrangian).

    An equation's offset grows by its residual. Those of equations that hold together grow alike, by so much that all their sums would be
    zero by the cloth's stiffness (Newton's method: seams of one piece push each other). A row that is pressed gives way by
    waving, which that stiffness does not know: where the sums have come to miss by more, all later steps are half as long. Without the
    stiffness each is corrected alone.
    """

    def __init__(self, equations: ConstraintEquations) -> None:
        self._equations = equations
        self._fraction, self._missed = 1.0, np.inf

    def __call__(self, residuals: FloatArray, respond: Response | None = None) -> FloatArray:
        """Return by how much the offsets grow (#P [m])."""
        equations = self._equations
        grown, joint = np.where(equations.soft > 0, 0.0, residuals), equations.share > 0
        if joint.any():
            groups, of = np.unique(equations.group[joint], return_inverse=True)
            sums = equations.group_sums(residuals)[groups]
            response = -_RESPONSE * np.diag(np.bincount(of, equations.share[joint]))
            if respond is not None:
                each = np.zeros((len(equations), len(groups)))
                each[joint, of] = 1.0
                response = np.stack([equations.group_sums(change)[groups] for change in respond(each).T], axis=1)
            missed = float((np.abs(sums) / equations.sum_tolerance[groups]).max())
            if missed > self._missed:
                self._fraction *= 0.5
            self._missed = missed
            grown[joint] = self._fraction * np.linalg.lstsq(response, -sums, rcond=1e-6)[0][of]
        return grown


def one_group(*equations: ConstraintEquations) -> ConstraintEquations:
    """Join the equations of one seam or constraint."""
    joined = join_equations(equations)
    return replace(joined, group=np.zeros_like(joined.group), sum_tolerance=equations[0].sum_tolerance)


def join_equations(equations: Sequence[ConstraintEquations]) -> ConstraintEquations:
    """Join the equations of several seams and constraints, a group each."""
    if not equations:
        return _equations(np.zeros((0, 4)), LENGTHS, tolerance=_EDGE_TOLERANCE, sum_tolerance=None)
    return ConstraintEquations(
        ends=np.concatenate([each.ends for each in equations]),
        kind=np.concatenate([each.kind for each in equations]),
        ratio=np.concatenate([each.ratio for each in equations]),
        target=np.concatenate([each.target for each in equations]),
        coefficient=np.concatenate([each.coefficient for each in equations]),
        tolerance=np.concatenate([each.tolerance for each in equations]),
        soft=np.concatenate([each.soft for each in equations]),
        share=np.concatenate([each.share for each in equations]),
        group=np.concatenate([np.full(len(each), number, dtype=np.int32) for number, each in enumerate(equations)]),
        sum_tolerance=np.concatenate([each.sum_tolerance for each in equations]),
    )


def seam_equations(
    first: IntArray, second: IntArray, ratio: float | FloatArray = 1.0, *, eased: bool = False
) -> ConstraintEquations:
    """Return equations that make each edge of the first row `ratio` times as long as its partner of the second.

    Eased, only all edges together are, exactly; each is drawn to it softly, so that what one side has more here it has less nearby.
    """
    ends = np.column_stack([first[:-1], first[1:], second[:-1], second[1:]])
    if eased:
        together = _equations(ends, LENGTHS, ratio=ratio, tolerance=np.inf, sum_tolerance=_EDGE_TOLERANCE)
        return replace(together, soft=np.full(len(ends), _EASED), share=np.ones(len(ends)))
    return _equations(ends, LENGTHS, ratio=ratio, tolerance=_EDGE_TOLERANCE, sum_tolerance=_SUM_TOLERANCE)


def stretch_equations(
    first: IntArray,
    second: IntArray,
    joints: IntArray,
    body: FloatArray,
    positions: FloatArray,
    ratio: float | FloatArray = 1.0,
) -> ConstraintEquations:
    """Return equations that sew two rows by their lengths on the body, the first `ratio` times as long as the second.

    The rows have different vertices. Between two joints both rows stretch evenly from where they lie. The two vertices
    of a joint need not lie at the same share of the length: between two joints of the first row, the second row is
    taken between the same shares.

    Args:
        first, second: vertices.
        joints: #J by 2, places in both rows that belong together, their ends among them.
        body: #V by 3 [m].
        positions: #V by 2, the layout before it is sewn [m].
        ratio: of the whole lengths, first over second.
    """
    rows = (first, second)
    shares = [arc / arc[-1] for arc in (arc_lengths(body[row]) for row in rows)]
    arcs = [arc_lengths(positions[row]) for row in rows]
    steps = [np.diff(arc) for arc in arcs]
    equations = []
    for side, row in enumerate(rows):
        inner = np.setdiff1d(np.arange(1, len(row) - 1), joints[:, side])
        ends = np.column_stack([row[inner - 1], row[inner], row[inner], row[inner + 1]])
        equations.append(
            _equations(ends, LENGTHS, ratio=steps[side][inner - 1] / steps[side][inner], tolerance=_EDGE_TOLERANCE)
        )
    i, j = joints[:-1].T
    ends = np.column_stack([first[i], first[i + 1], second[j], second[j + 1]])
    there = np.diff(np.interp(shares[0][joints[:, 0]], shares[1], arcs[1]))
    share = [steps[side][places] / np.diff(arcs[side][joints[:, side]]) for side, places in ((0, i), (1, j))]
    own = np.diff(arcs[1][joints[:, 1]])
    between = _equations(ends, LENGTHS, ratio=ratio * there / own * share[0] / share[1], tolerance=_EDGE_TOLERANCE)
    return replace(one_group(*equations, between), sum_tolerance=np.array([_SUM_TOLERANCE]))


def length_equations(line: IntArray, lengths: FloatArray) -> ConstraintEquations:
    """Return equations that give the edges of a row of vertices their lengths [m]."""
    ends = np.column_stack([line[:-1], line[1:], line[:-1], line[1:]])
    return _equations(ends, LENGTHS, ratio=0.0, target=lengths, tolerance=_EDGE_TOLERANCE, sum_tolerance=_SUM_TOLERANCE)


def girth_equations(
    edges: IntArray, lengths: FloatArray, shares: FloatArray, positions: FloatArray
) -> ConstraintEquations:
    """Return equations by which edges have a given length together, each counted by its share.

    The length is measured along the edges' present directions: rows that must become longer would find it in waves.

    Args:
        edges: #E by 2, vertices.
        lengths: #E [m], lengths with which they have it.
        shares: #E.
        positions: #V by 2, where the directions are taken [m].
    """
    along = unit(positions[edges[:, 1]] - positions[edges[:, 0]])
    coefficient = np.zeros((len(edges), 4, 2))
    coefficient[:, 0], coefficient[:, 1] = -along, along
    ends, sums = np.column_stack([edges, edges]), _GIRTH_TOLERANCE
    equations = _equations(ends, LINEAR, target=lengths, coefficient=coefficient, tolerance=np.inf, sum_tolerance=sums)
    return replace(equations, soft=_SHARED * shares, share=shares)


def straight_equations(line: IntArray) -> ConstraintEquations:
    """Return equations that put every inner vertex of a row on the straight line between its ends."""
    inner = line[1:-1]
    ends = np.column_stack([inner, np.full(len(inner), line[0]), np.full(len(inner), line[-1]), inner])
    return _equations(ends, STRAIGHT, tolerance=_PLACE_TOLERANCE)


def shape_equations(line: IntArray, shape: FloatArray) -> ConstraintEquations:
    """Return equations that give a row of vertices the shape of a drawn line, wherever that lies on the cloth.

    The middle vertex keeps its distance from the chord between the ends, the middle of each half its distance from the half's
    chord, and so on. Vertices may slide along the line: the lengths between them are free.

    Args:
        line: vertices.
        shape: #line by 2, where they lie on the drawn line [m].
    """
    # An odd number of edges is halved so that a row and its mirror image, which may run the other way, have the same equations.
    triples, spans = [], [(0, len(line) - 1, int(shape[0, 1] < shape[-1, 1]))]
    for first, last, longer in spans:
        if last - first > 1:
            middle = (first + last + longer) // 2
            triples.append((middle, first, last, middle))
            spans += [(first, middle, 0), (middle, last, 1)]
    places = np.array(triples, dtype=np.int32).reshape(-1, 4)
    here, before, after = (shape[places[:, k]] for k in range(3))
    chord, away = after - before, here - before
    distance = (chord[:, 0] * away[:, 1] - chord[:, 1] * away[:, 0]) / np.linalg.norm(chord, axis=1)
    return _equations(line[places], STRAIGHT, target=distance, tolerance=_PLACE_TOLERANCE)


def smooth_equations(line: IntArray, positions: FloatArray, fold: IntArray | None = None) -> ConstraintEquations:
    """Return springs that hold every inner vertex of a row at its present distance from chords of the row around it.

    Where equations ask for more length than the cloth gives, a row of vertices would find it in waves, at the price of
    a little shear. A wave changes the distance from a chord of its own length by its whole height; a smoother curve
    changes it by a share of the square of the chord. Threads that must become longer push a row into waves, with a
    force that grows as the waves become shorter. So the chords span two edges, four, eight and so on up to `WAVE`. The
    stiffness of their springs is proportional to the threads' stiffness and to the inverse square of the span, for any
    mesh size and shear stiffness.

    Args:
        line: vertices.
        positions: #V by 2, where the distances are taken [m].
        fold: vertices on an upright fold, if there is one. A row that ends there continues beyond it as its mirror
            image, and each half has half of the springs at the end.
    """
    step = float(segment_lengths(positions[line]).mean())
    springs, reach = [], 1
    while reach == 1 or (2 * reach * step <= WAVE and 2 * reach < len(line)):
        soft = SMOOTH * WAVE / (2 * step) / reach**2
        # Each vertex keeps its distance from the chord of those `reach` edges before and after.
        here, before, after = line[reach:-reach], line[: -2 * reach], line[2 * reach :]
        chord, away = positions[after] - positions[before], positions[here] - positions[before]
        cross = chord[:, 0] * away[:, 1] - chord[:, 1] * away[:, 0]
        distance = cross / np.maximum(np.linalg.norm(chord, axis=1), np.finfo(np.float64).tiny)
        held = _equations(np.column_stack([here, before, after, here]), STRAIGHT, target=distance, tolerance=np.inf)
        springs.append(replace(held, soft=np.full(len(here), soft)))
        if fold is not None:
            # Ends on a fold keep their distance from the chord between the vertex `reach` edges before and its mirror image.
            rows = [(row[reach], row[0]) for row in (line, line[::-1]) if row[0] in fold and row[reach] not in fold]
            ends = np.array([(before, end, end, end) for before, end in rows], dtype=np.int32).reshape(-1, 4)
            coefficient = np.zeros((len(rows), 4, 2))
            coefficient[:, 0, 1], coefficient[:, 1, 1] = -1.0, 1.0
            target = np.einsum("pjk,pjk->p", coefficient, positions[ends])
            held = _equations(ends, LINEAR, target=target, coefficient=coefficient, tolerance=np.inf)
            springs.append(replace(held, soft=np.full(len(rows), soft / 2)))
        reach *= 2
    return one_group(*springs)


def level_equations(line: IntArray, across: FloatArray) -> ConstraintEquations:
    """Return the equation that puts both ends of a row at the same place along the unit vector `across`."""
    ends = np.array([[line[0], line[-1], line[0], line[0]]])
    coefficient = np.zeros((1, 4, 2))
    coefficient[0, 0], coefficient[0, 1] = -across, across
    return _equations(ends, LINEAR, coefficient=coefficient, tolerance=_PLACE_TOLERANCE)


def mirror_equations(pairs: IntArray, axis: IntArray, across: FloatArray, place: float) -> ConstraintEquations:
    """Return equations that make pairs of vertices mirror images, and put the axis's vertices on the axis.

    Args:
        pairs: #Q by 2, vertices. axis: #A, vertices.
        across: unit vector at right angles to the axis.
        place: position of the axis along `across` [m].
    """
    along = np.array([-across[1], across[0]])
    first, second = pairs[:, 0], pairs[:, 1]
    both = np.column_stack([first, second, first, first])
    own = np.column_stack([axis, axis, axis, axis])
    coefficient = np.zeros((2 * len(pairs) + len(axis), 4, 2))
    count = len(pairs)
    coefficient[:count, 0] = coefficient[:count, 1] = across
    coefficient[count : 2 * count, 0], coefficient[count : 2 * count, 1] = along, -along
    coefficient[2 * count :, 0] = across
    target = np.concatenate([np.full(count, 2.0 * place), np.zeros(count), np.full(len(axis), place)])
    return _equations(
        np.concatenate([both, both, own]), LINEAR, target=target, coefficient=coefficient, tolerance=_PLACE_TOLERANCE
    )


def _equations(
    ends: ArrayLike,
    kind: int,
    *,
    ratio: FloatArray | float = 0.0,
    target: FloatArray | float = 0.0,
    coefficient: FloatArray | None = None,
    tolerance: float,
    sum_tolerance: float | None = np.inf,
) -> ConstraintEquations:
    rows = np.asarray(ends, dtype=np.int32).reshape(-1, 4)
    count = len(rows)
    return ConstraintEquations(
        ends=rows,
        kind=np.full(count, int(kind), dtype=np.int32),
        ratio=np.broadcast_to(np.asarray(ratio, dtype=np.float64), (count,)).copy(),
        target=np.broadcast_to(np.asarray(target, dtype=np.float64), (count,)).copy(),
        coefficient=np.zeros((count, 4, 2)) if coefficient is None else coefficient,
        tolerance=np.full(count, tolerance),
        soft=np.zeros(count),
        share=np.zeros(count),
        group=np.zeros(count, dtype=np.int32),
        sum_tolerance=np.zeros(0) if sum_tolerance is None else np.array([sum_tolerance]),
    )
