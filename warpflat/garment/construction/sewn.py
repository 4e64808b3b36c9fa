"""Seams to be sewn, and what has come of sewing: lengths, costs, and whether the cloth came to rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from warpflat.core import FloatArray, IntArray, polyline_length
from warpflat.flat import Flattening

__all__ = ["ConstraintResult", "MeasuredSeam", "Sewn", "Stitching"]


@dataclass(frozen=True, kw_only=True)
class Stitching:
    """Two chains of vertices that are sewn together, edge by edge or from joint to joint.

    Attributes:
        name: the seam's; pairs of one name are one seam, as where darts interrupt it.
        pieces: names of the two pieces; the same twice where one is sewn to itself.
        vertices: of the two pieces, in corresponding order.
        ratio: wished length of the first side over the second, for all edges or for each.
        joints: #J by 2, places in the two chains that are sewn to each other; None where all are, one to one.
        eased: whether the edges of both sides are equal in sum, not each to its partner.
        sides: what the two chains are called among the garment's seams, "piece.edge" twice; None of a dart, which is none of them.
    """

    name: str
    pieces: tuple[str, str]
    vertices: tuple[IntArray, IntArray]
    ratio: float | FloatArray = 1.0
    joints: IntArray | None = None
    eased: bool = False
    sides: tuple[str, str] | None = None

    def as_laid(self, pieces: Mapping[str, Flattening]) -> Stitching:
        """Return it eased to what its two sides measure in the layouts of their pieces."""
        one, other = (
            polyline_length(pieces[piece].positions[row]) for piece, row in zip(self.pieces, self.vertices, strict=True)
        )
        return replace(self, ratio=one / other, eased=True)


@dataclass(frozen=True, kw_only=True)
class MeasuredSeam:
    """A seam, measured.

    Attributes:
        name: after the feature line, or the cut.
        sides: "piece.edge" twice.
        length_3d: length of the curve in space that both sides come from [m].
        lengths: of its two sides in the pattern [m].
        ease: by how much the second side is meant to be longer, as a share of the first; as in `pattern.json`.
        cost: half the work of the seam's forces [J], the energy that matching its sides costs; None if they were not
            matched.
    """

    name: str
    sides: tuple[str, str]
    length_3d: float
    lengths: tuple[float, float]
    ease: float = 0.0
    cost: float | None = None

    @property
    def difference(self) -> float:
        """Excess length of the second side over that of the first and its ease [m]."""
        return self.lengths[1] - self.lengths[0] * (1.0 + self.ease)

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of `metrics.json`."""
        return {
            "name": self.name,
            "sides": list(self.sides),
            "length_mm": [1e3 * length for length in self.lengths],
            "length_3d_mm": 1e3 * self.length_3d,
            "difference_mm": 1e3 * self.difference,
            "ease": self.ease,
            "price_j": self.cost,
        }


@dataclass(frozen=True, kw_only=True)
class ConstraintResult:
    """A seam or a constraint after sewing.

    Attributes:
        name: the seam's or the constraint's; "PIECE fold" of a fold.
        kind: "seam", "fold", "straight", "length", "symmetric", "mouth", "girth" or "curve".
        cost: half the work of its forces [J].
        violation: largest error of a seam's two lengths, of a line's whole length, or of a place [m].
    """

    name: str
    kind: str
    cost: float
    violation: float

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of `metrics.json`."""
        return {"name": self.name, "kind": self.kind, "price_j": self.cost, "amiss_mm": 1e3 * self.violation}


@dataclass(frozen=True, kw_only=True)
class Sewn:
    """Pieces relaxed together.

    Attributes:
        pieces: by name.
        converged: whether all came to rest with the seams' sides equal and the constraints kept.
        contradictory: whether it ended because seams and constraints came no nearer to agreeing: more steps do not
            help.
        steps: approximate implicit steps over all pieces.
        energy_before, energy_after: of all pieces, springs and guard [J].
        results: every seam, fold and constraint with its cost, in the order in which they were given.
        seconds: wall clock.
        offsets: by kind and name of what is held, the offsets of its equations at the end [m].
        drawing_cost: what lines drawn afterwards have cost [J].
    """

    pieces: Mapping[str, Flattening]
    converged: bool
    contradictory: bool
    steps: int
    energy_before: float
    energy_after: float
    results: tuple[ConstraintResult, ...]
    seconds: float
    offsets: Mapping[tuple[str, str], FloatArray] = field(default_factory=dict, repr=False)
    drawing_cost: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of `metrics.json`."""
        return {
            "converged": self.converged,
            "contradictory": self.contradictory,
            "steps": self.steps,
            "seconds": self.seconds,
            "energy_before_j": self.energy_before,
            "energy_after_j": self.energy_after,
            "price_j": self.cost,
            "largest_difference_mm": 1e3 * self.largest_difference,
        }

    def followed_by(self, later: Sewn) -> Sewn:
        """Return the pieces as they lie after they were relaxed again, under more constraints.

        What was held the first time keeps its cost from there; drawn lines are reported with the curves.
        """
        amiss = {(each.kind, each.name): each.violation for each in later.results}
        before = {(each.kind, each.name) for each in self.results}
        added = [each for each in later.results if (each.kind, each.name) not in before and each.kind != "curve"]
        draws = any(each.kind == "curve" for each in later.results)
        return replace(
            later,
            steps=self.steps + later.steps,
            energy_before=self.energy_before,
            results=(*(replace(each, violation=amiss[each.kind, each.name]) for each in self.results), *added),
            seconds=self.seconds + later.seconds,
            drawing_cost=self.drawing_cost + (later.energy_after - self.energy_after if draws else 0.0),
        )

    @property
    def cost(self) -> float:
        """Energy that all seams, folds and constraints cost together, without drawn lines [J]."""
        return self.energy_after - self.energy_before - self.drawing_cost

    @property
    def largest_difference(self) -> float:
        """Largest difference between a seam's two sides, besides ease [m]."""
        return max((result.violation for result in self.results if result.kind == "seam"), default=0.0)

    @property
    def constraints(self) -> tuple[ConstraintResult, ...]:
        """Results of constraints and folds, without seams."""
        return tuple(result for result in self.results if result.kind != "seam")
