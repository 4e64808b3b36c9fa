"""The ledger of cuts: the model energy that each candidate would release, in all and per centimetre."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from warpflat.core.activity import report_activity
from warpflat.core.errors import InputError
from warpflat.cutting.candidates import Candidate, Peaks, find_candidates, find_peaks
from warpflat.cutting.cut_piece import cut
from warpflat.cutting.cut_plan import CutPlan
from warpflat.cutting.refine_piece import refine_along
from warpflat.flattening.applied_cut import seam_kind
from warpflat.flattening.edit import relax_cut
from warpflat.flattening.progress import Progress
from warpflat.flattening.result import Flattening
from warpflat.solver.options import RelaxOptions, given_options
from warpflat.surface.cut.dart import dart_measure, fish_eye_measure
from warpflat.surface.paths.edge_paths import path_length

__all__ = [
    "AutoCut",
    "Ledger",
    "LedgerEntry",
    "RankedBy",
    "coarse_options",
    "cut_automatically",
    "evaluate",
    "make_ledger",
]

RankedBy = Literal["per_cm", "released"]

# Coarse options, which are enough to rank candidates: tolerances looser by this factor, and few steps.
_LOOSER = 10.0
_COARSE_STEPS = 600


@dataclass(frozen=True, kw_only=True, eq=False)
class LedgerEntry:
    """A candidate that has been tried.

    Attributes:
        candidate: the cut.
        length: cut [m].
        model_energy_before, model_energy_after: what is minimised, springs and guard [J]; both on the refined mesh, if the cut needs one.
        strain_energy_before, strain_energy_after: strain energy of the cloth as worn [J].
        opening: widest gap of its cracks, at the border or, of a fish-eye dart, in its middle [m].
        angle: of its widest dart [rad]; NaN if it parts the cloth. Negative: its sides overlap.
        length_error, area_error, flipped_faces, pieces: after the cut.
        length_error_before, area_error_before: before it.
        result: the piece with this cut, relaxed coarsely.
    """

    candidate: Candidate
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
    flipped_faces: int
    result: Flattening

    @property
    def released(self) -> float:
        """The model energy released [J]."""
        return self.model_energy_before - self.model_energy_after

    @property
    def per_cm(self) -> float:
        """The model energy released per centimetre cut [J/cm]."""
        return self.released / max(100.0 * self.length, np.finfo(float).tiny)

    @property
    def overlaps(self) -> bool:
        """True if the sides of the widest dart overlap, so that it could not be sewn."""
        return self.angle < 0

    def as_dict(self) -> dict[str, Any]:
        """Return plain data in SI units, but for `released_j_per_cm`."""
        return {
            "name": self.candidate.name,
            "length_m": self.length,
            "model_energy_before_j": self.model_energy_before,
            "model_energy_after_j": self.model_energy_after,
            "strain_energy_before_j": self.strain_energy_before,
            "strain_energy_after_j": self.strain_energy_after,
            "released_j": self.released,
            "released_j_per_cm": self.per_cm,
            "opening_m": self.opening,
            "angle_deg": None if math.isnan(self.angle) else math.degrees(self.angle),
            "length_error": [self.length_error_before, self.length_error],
            "area_error": [self.area_error_before, self.area_error],
            "flipped_faces": self.flipped_faces,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Ledger:
    """The candidates of a piece, the best first.

    Attributes:
        result: the piece before the cut.
        peaks: where its energy is.
        entries: what each cut would do.
        refused: candidates that could not be made, and why.
        notes: what the comparison leaves out, one sentence each.
    """

    result: Flattening
    peaks: Peaks
    entries: tuple[LedgerEntry, ...]
    refused: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "piece": self.result.surface.name,
            "peaks": list(self.peaks.words),
            "entries": [entry.as_dict() for entry in self.entries],
            "refused": [{"name": name, "reason": reason} for name, reason in self.refused],
            "notes": list(self.notes),
        }


def coarse_options(options: RelaxOptions | None = None) -> RelaxOptions:
    """Return options for ranking: tolerances ten times looser, few steps, and no contact."""
    given = given_options(options)
    return replace(
        given,
        energy_tolerance=_LOOSER * given.energy_tolerance,
        residual_tolerance=_LOOSER * given.residual_tolerance,
        max_steps=min(_COARSE_STEPS, given.max_steps),
        gap_mm=0.0,
    )


def make_ledger(
    result: Flattening,
    *,
    relax: RelaxOptions | None = None,
    by: RankedBy = "per_cm",
    candidates: Sequence[Candidate] | None = None,
) -> Ledger:
    """Try all candidates on a flattened piece, each coarsely, and rank them.

    Args:
        result: the piece, cut before or not.
        relax: options of the full relaxation, from which the coarse ones follow.
        by: what the order goes by: energy released per centimetre cut, or in all.
        candidates: to compare; those of :func:`warpflat.cutting.candidates.find_candidates` if not given.

    Raises:
        InputError: there is nothing to cut for, or no candidate can be made.
    """
    peaks = find_peaks(result)
    chosen = find_candidates(result, peaks) if candidates is None else candidates
    entries, refused = [], []
    for number, candidate in enumerate(chosen, 1):
        report_activity(f"cut {number} of {len(chosen)}, {candidate.name}")
        try:
            entries.append(evaluate(result, candidate, relax=coarse_options(relax)))
        except InputError as reason:
            refused.append((candidate.name, str(reason)))
    if not entries:
        raise InputError(f"piece {result.surface.name!r} has no line to cut along: {_why_none(peaks, refused)}")
    entries.sort(key=lambda entry: (entry.flipped_faces > 0, -getattr(entry, by)))
    return Ledger(result=result, peaks=peaks, entries=tuple(entries), refused=tuple(refused))


def _why_none(peaks: Peaks, refused: Sequence[tuple[str, str]]) -> str:
    if refused:
        return f"{refused[0][0]}: {refused[0][1]}"
    return (
        f"none passes near the peak of its energy ({peaks.words[0]}), and no way of any length leads there or inwards from the "
        "border; draw a line through it"
    )


def evaluate(result: Flattening, candidate: Candidate, *, relax: RelaxOptions) -> LedgerEntry:
    """Try one cut: relax with it as the options say, and measure what it has done.

    Raises:
        InputError: the cut is refused; see :func:`warpflat.cutting.cut_piece.cut`.
    """
    before, paths = result, list(candidate.paths)
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
    opening, angle = _widest(after)
    old, new = before.layout_measures, after.layout_measures
    return LedgerEntry(
        candidate=candidate,
        length=path_length(before.surface, paths),
        model_energy_before=before.stages[-1].model_energy_j,
        model_energy_after=after.stages[-1].model_energy_j,
        strain_energy_before=old["strain_energy_j"],
        strain_energy_after=new["strain_energy_j"],
        opening=opening,
        angle=angle,
        length_error=new["length_error"],
        area_error=new["area_error"],
        length_error_before=old["length_error"],
        area_error_before=old["area_error"],
        flipped_faces=new["flipped_faces"],
        result=after,
    )


def _widest(result: Flattening) -> tuple[float, float]:
    """Return opening [m] and angle [rad] of the last cut's widest crack; the angle is NaN if the crack parts the cloth."""
    found = []
    for seam in result.cuts[-1].seams:
        kind = seam_kind(seam)
        if kind == "dart":
            dart = dart_measure(result.positions, seam.left, seam.right)
            found.append((dart.opening, dart.angle))
        elif kind == "fish-eye":
            eye = fish_eye_measure(result.positions, seam.left, seam.right)
            found.append((abs(eye.intake), min(eye.first_angle, eye.last_angle)))
        else:
            gap = np.linalg.norm(result.positions[seam.left] - result.positions[seam.right], axis=1)
            found.append((float(gap.max()), math.nan))
    return max(found, key=lambda one: one[0])


@dataclass(frozen=True, kw_only=True)
class AutoCut:
    """The settings of automatic cutting.

    Attributes:
        max_cuts: at most so many; a mirrored pair counts as one.
        stop_below: a piece of at most this model energy (springs and guard) needs no further cut [J].
        stop_below_strain: so does a piece of which 98 % of the cloth is strained by at most this share along warp and weft, as worn.
        by: what the best cut is: "per_cm", or "released" in all.
    """

    max_cuts: int = 2
    stop_below: float = 0.0
    stop_below_strain: float = 0.0
    by: RankedBy = "released"

    def is_enough(self, result: Flattening) -> bool:
        """Return whether a piece needs no further cut."""
        return (
            result.stages[-1].model_energy_j <= self.stop_below or worn_strain_level(result) <= self.stop_below_strain
        )


def worn_strain_level(result: Flattening) -> float:
    """Return the absolute worn strain along warp or weft that 98 % of the area stays below."""
    from warpflat.core.sums import weighted_percentile

    strain = np.abs(result.worn.strain[:, :2]).max(axis=1)
    return float(weighted_percentile(strain, result.worn.area, 0.98))


def cut_automatically(
    result: Flattening,
    auto: AutoCut,
    *,
    relax: RelaxOptions | None = None,
    callback: Callable[[Progress], bool | None] | None = None,
    fully: bool = True,
) -> tuple[Flattening, tuple[Ledger, ...]]:
    """Cut greedily: try all candidates, make the best that does not overlap, relax, and again until it is enough.

    Args:
        result: the flattened piece.
        auto: when to stop.
        relax: options of the relaxation.
        callback: called as by :func:`warpflat.cutting.cut_piece.cut`.
        fully: relax the chosen cuts fully; False goes on from the coarse trials, for planning.

    Returns:
        The piece, and the ledger of each round.
    """
    ledgers: list[Ledger] = []
    for _ in range(auto.max_cuts):
        if auto.is_enough(result):
            break
        try:
            # Of two cuts that mirror each other, both are made or none.
            candidates = [one for one in find_candidates(result) if not one.has_twin]
            ledger = make_ledger(result, relax=relax, by=auto.by, candidates=candidates)
        except InputError:
            if not ledgers:
                raise
            break
        best = next((entry for entry in ledger.entries if not entry.overlaps), None)
        if best is None or best.released <= 0 or best.flipped_faces:
            break
        ledgers.append(ledger)
        tried = best.result
        if fully:
            tried = relax_cut(
                replace(tried, stages=tried.stages[:-1], history=result.history),
                tried.network.surface,
                tried.positions,
                stage=tried.stages[-1].name,
                cuts=tried.cuts,
                options=given_options(relax),
                callback=callback,
            )
        result = tried
    return result, tuple(ledgers)
