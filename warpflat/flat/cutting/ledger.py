"""The ledger of cuts: what those that promise most would release, in all and per centimetre, each on trial."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar, get_args

import numpy as np

from warpflat.core.activity import report_activity
from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.polyline import polyline_length
from warpflat.core.short_repr import short_repr
from warpflat.flat.cutting.candidates import Candidate, find_candidates, peaks_in_words
from warpflat.flat.cutting.crack import Price
from warpflat.flat.cutting.cut_piece import cut
from warpflat.flat.cutting.cut_plan import CutPlan
from warpflat.flat.cutting.ranked_by import RankedBy
from warpflat.flat.cutting.refine_piece import refine_along
from warpflat.flat.flattening.applied_cut import measure_crack
from warpflat.flat.flattening.edit import relax_cut
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.solver.options import RelaxOptions, coarse_options

__all__ = [
    "LEAST_MOUTH",
    "TRIED",
    "Ledger",
    "LedgerEntry",
    "best_of_few",
    "evaluate",
    "make_ledger",
]


# So many cuts are tried for a ledger.
_LISTED = 8
#: So many cuts, of those that promise most, are tried for a choice.
TRIED = 3
#: A dart that takes in less is not sewn but eased in [m].
LEAST_MOUTH = 5e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class LedgerEntry:
    """A cut that has been tried on a mesh, or a dart or a seam on a form.

    Attributes:
        name: what it is called.
        pieces: that it changes, by name.
        paths: where it runs in space, each #P by 3 [m]; of a form's cut its mirror image, too.
        length: cut [m].
        model_energy_before, model_energy_after: what is minimised, springs and guard, of these pieces [J]; both on the refined mesh, if
            the cut needs one.
        strain_energy_before, strain_energy_after: strain energy of the cloth as worn [J].
        opening: widest gap of its cracks, at the border or, of a fish-eye dart, in its middle [m]; NaN of a form's seam.
        angle: of its widest dart [rad]; NaN if it parts the cloth. Negative: its sides overlap.
        length_error, area_error, flipped_faces: after the cut; the errors are the largest of these pieces.
        length_error_before, area_error_before: before it.
        outside_before, outside_after: share of the cloth that is strained beyond the cloth's limit.
        candidate, result: of a mesh: the path, and the piece with this cut, relaxed coarsely.
        cut: of a form: its table in `[[cuts]]`.
    """

    __repr__ = short_repr

    name: str
    pieces: tuple[str, ...]
    paths: tuple[FloatArray, ...]
    length: float
    model_energy_before: float
    model_energy_after: float
    strain_energy_before: float
    strain_energy_after: float
    opening: float
    angle: float
    length_error: float
    area_error: float
    length_error_before: float
    area_error_before: float
    outside_before: float
    outside_after: float
    flipped_faces: int
    candidate: Candidate | None = None
    result: Flattening | None = None
    cut: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def measure(
        cls,
        name: str,
        before: Sequence[Flattening],
        after: Sequence[Flattening],
        *,
        paths: Sequence[FloatArray],
        cracks: Sequence[tuple[Flattening, IntArray, IntArray]],
        **of_source: Any,
    ) -> LedgerEntry:
        """Measure a trial.

        Args:
            name: of the cut.
            before, after: the pieces that it changes, and what has become of them.
            paths: see the attributes.
            cracks: each the piece in which it lies and the vertices along its two sides.
            of_source: `candidate`, `result`, `cut`.
        """
        widest = math.nan, math.nan
        for piece, left, right in cracks:
            found = measure_crack(piece.positions, left, right)
            opening = found.get("widest_m", found["opening_m"])
            if math.isnan(widest[0]) or opening > widest[0]:
                widest = opening, math.radians(found.get("angle_deg", math.nan))
        old, new = ([piece.layout_measures for piece in pieces] for pieces in (before, after))
        return cls(
            name=name,
            pieces=tuple(piece.surface.name for piece in before),
            paths=tuple(paths),
            length=sum(polyline_length(path) for path in paths),
            model_energy_before=sum(piece.stages[-1].model_energy_j for piece in before),
            model_energy_after=sum(piece.stages[-1].model_energy_j for piece in after),
            strain_energy_before=sum(each["strain_energy_j"] for each in old),
            strain_energy_after=sum(each["strain_energy_j"] for each in new),
            opening=widest[0],
            angle=widest[1],
            length_error=max(each["length_error"] for each in new),
            area_error=max(each["area_error"] for each in new),
            length_error_before=max(each["length_error"] for each in old),
            area_error_before=max(each["area_error"] for each in old),
            outside_before=_share_outside(before),
            outside_after=_share_outside(after),
            flipped_faces=sum(each["flipped_faces"] for each in new),
            **of_source,
        )

    @property
    def released(self) -> float:
        """The model energy released [J]."""
        return self.model_energy_before - self.model_energy_after

    @property
    def per_cm(self) -> float:
        """The model energy released per centimetre cut [J/cm]."""
        return self.released / max(100.0 * self.length, np.finfo(float).tiny)

    @property
    def mouth(self) -> float | None:
        """How wide its widest dart opens [m], negative where the legs overlap; None of a seam."""
        return None if math.isnan(self.angle) else math.copysign(self.opening, self.angle)

    @property
    def can_be_sewn(self) -> bool:
        """Whether it opens by 5 mm or more, and leaves no flipped face."""
        return not self.flipped_faces and (self.mouth is None or self.mouth >= LEAST_MOUTH)

    @property
    def helps(self) -> bool:
        """Whether it can be sewn and releases energy."""
        return self.can_be_sewn and self.released > 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return plain data in SI units, but for `released_j_per_cm`."""
        return {
            "name": self.name,
            **({"cut": dict(self.cut)} if self.cut else {}),
            "pieces": list(self.pieces),
            "length_m": self.length,
            "model_energy_before_j": self.model_energy_before,
            "model_energy_after_j": self.model_energy_after,
            "strain_energy_before_j": self.strain_energy_before,
            "strain_energy_after_j": self.strain_energy_after,
            "released_j": self.released,
            "released_j_per_cm": self.per_cm,
            "opening_m": None if math.isnan(self.opening) else self.opening,
            "mouth_m": self.mouth,
            "angle_deg": None if math.isnan(self.angle) else math.degrees(self.angle),
            "length_error": [self.length_error_before, self.length_error],
            "area_error": [self.area_error_before, self.area_error],
            "outside_before": self.outside_before,
            "outside_after": self.outside_after,
            "flipped_faces": self.flipped_faces,
        }


def _share_outside(pieces: Sequence[Flattening]) -> float:
    """Return the share of the cloth of some pieces that is strained beyond its limit."""
    areas = [float(piece.fit.area.sum()) for piece in pieces]
    return sum(piece.fit.outside * area for piece, area in zip(pieces, areas, strict=True)) / sum(areas)


@dataclass(frozen=True, kw_only=True, eq=False)
class Ledger:
    """The cuts that a garment could have next, the best first.

    Attributes:
        name: of the piece, or of the form.
        pieces: before the cut.
        peaks: where their energy is, in words.
        entries: what each cut would do.
        refused: cuts that could not be made, and why.
        notes: what the comparison leaves out, one sentence each.
    """

    __repr__ = short_repr

    name: str
    pieces: tuple[Flattening, ...]
    peaks: tuple[str, ...]
    entries: tuple[LedgerEntry, ...]
    refused: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()

    def entry(self, number: int) -> LedgerEntry:
        """Return the entry of a number (from 1).

        Raises:
            InputError: there is no such number.
        """
        if not 1 <= number <= len(self.entries):
            raise InputError(f"there is no candidate {number}; valid: 1 to {len(self.entries)}")
        return self.entries[number - 1]

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "piece": self.name,
            "peaks": list(self.peaks),
            "entries": [entry.as_dict() for entry in self.entries],
            "refused": [{"name": name, "reason": reason} for name, reason in self.refused],
            "notes": list(self.notes),
        }


Cut = TypeVar("Cut")


def best_of_few(
    cuts: Sequence[tuple[str, Price, Cut]],
    evaluate: Callable[[Cut], LedgerEntry],
    *,
    by: RankedBy,
    listed: bool = True,
) -> tuple[tuple[LedgerEntry, ...], tuple[tuple[str, str], ...]]:
    """Try the cuts that promise most; return what each would do, the best first, and those that are refused, and why.

    Args:
        cuts: the name and the price of each.
        evaluate: tries one.
        by: what the order goes by: energy released per centimetre cut, or in all.
        listed: eight are tried, to be compared; else three, of which one is chosen.

    Raises:
        InputError: `by` is unknown.
    """
    if by not in get_args(RankedBy):
        raise InputError(f"by = {by!r} is unknown; {nearest(str(by), get_args(RankedBy))}")
    most = _LISTED if listed else TRIED

    def promise(cost: Price) -> tuple[bool, float]:
        return not cost.opens, -(cost.per_metre if by == "per_cm" else cost.released)

    entries, refused = list[LedgerEntry](), list[tuple[str, str]]()
    for name, _, one in sorted(cuts, key=lambda cut: promise(cut[1])):
        report_activity(f"cut {len(entries) + 1} of {min(most, len(cuts))}, {name}")
        try:
            entries.append(evaluate(one))
        except InputError as reason:
            refused.append((name, str(reason)))
        if len(entries) == most:
            break
    entries.sort(key=lambda entry: (not entry.can_be_sewn, -getattr(entry, by)))
    return tuple(entries), tuple(refused)


def make_ledger(
    result: Flattening,
    *,
    relax: RelaxOptions | None = None,
    by: RankedBy = "per_cm",
    candidates: Sequence[Candidate] | None = None,
    listed: bool = True,
) -> Ledger:
    """Try the candidates on a flattened piece that promise most, each coarsely, and rank them.

    Args:
        result: the piece, cut before or not.
        relax: options of the full relaxation, from which the coarse ones follow.
        by: what the order goes by: energy released per centimetre cut, or in all.
        candidates: to compare; those of :func:`warpflat.flat.cutting.candidates.find_candidates` if not given.
        listed: see :func:`best_of_few`.

    Raises:
        InputError: `by` is unknown, there is nothing to cut for, or no candidate can be made.
    """
    words = peaks_in_words(result)
    peak = f" ({words[0]})" if words else ""
    chosen = find_candidates(result) if candidates is None else candidates
    coarse = coarse_options(relax)
    cuts = [(one.name, one.price, one) for one in chosen]
    entries, refused = best_of_few(cuts, lambda one: evaluate(result, one, relax=coarse), by=by, listed=listed)
    if not entries:
        why = (
            f"{refused[0][0]}: {refused[0][1]}" if refused
            else f"none passes near the peak of its energy{peak}, and no way of any length leads there or inwards from "
            "the border; draw a line through it"
        )  # fmt: skip
        raise InputError(f"piece {result.surface.name!r} has no line to cut along: {why}")
    return Ledger(name=result.surface.name, pieces=(result,), peaks=words, entries=entries, refused=refused)


def evaluate(result: Flattening, candidate: Candidate, *, relax: RelaxOptions) -> LedgerEntry:
    """Try one cut: relax with it as the options say, and measure what it has done.

    Raises:
        InputError: the cut is refused; see :func:`warpflat.flat.cutting.cut_piece.cut`.
    """
    before, paths = result, list(candidate.paths if not candidate.drawn else ())
    names = [
        candidate.name if number == 0 else f"{candidate.name} {number + 1}" for number in range(len(candidate.drawn))
    ]
    for name, drawn in zip(names, candidate.drawn, strict=True):
        before, _ = refine_along(before, name, drawn)
    if names:
        # Paths drawn first are refined by those drawn later: the lines know.
        paths += [before.surface.lines[name] for name in names]
        surface = before.network.surface
        before = relax_cut(before, surface, before.positions, stage="refine", cuts=before.cuts, options=relax)
    after = cut(before, CutPlan(name=candidate.name, paths=tuple(paths)), relax=relax)
    return LedgerEntry.measure(
        candidate.name,
        [before],
        [after],
        paths=[before.surface.vertices[path] for path in paths],
        cracks=[(after, seam.left, seam.right) for seam in after.cuts[-1].seams],
        candidate=candidate,
        result=after,
    )
