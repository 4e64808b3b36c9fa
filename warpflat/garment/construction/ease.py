"""Ease and gathers: from the names of seams to the ratio of the two lengths of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, InputError, IntArray, arc_lengths, nearest
from warpflat.flat import Fabric
from warpflat.garment.construction.details import SeamTable
from warpflat.garment.construction.form_plan import plan_form
from warpflat.garment.construction.fullness import FullEdge
from warpflat.garment.construction.sewn import Stitching

if TYPE_CHECKING:
    from warpflat.garment.mannequin.forms import FormResult
    from warpflat.garment.mannequin.pieces import FormPiece
    from warpflat.pattern import Seam, SeamSide

__all__ = ["CAP_PART", "SeamRatios", "cap_wishes", "measure_ease", "seam_ratios"]


#: A sleeve's cap is eased in between its notches, at these shares of the armhole from underarm to underarm; below them cap
#: and armhole are equally long.
CAP_PART = (0.2, 0.8)
# What a woven cap has more than its armhole unless something else is asked: 16 mm on a child, 25 on EU 38, 30 on a heavy
# man, of the 15 to 40 mm that pattern books give (Aldrich; Armstrong). A knit's cap has as much as its armhole.
_WOVEN_CAP = 0.055


@dataclass(frozen=True, kw_only=True, eq=False)
class SeamRatios:
    """Wishes for the seams of a form, worked out.

    Attributes:
        ease: by seam of the pattern, how much longer its second side is, as a share of the first.
        ratios: for each of the form's seams, and each of its runs, the wished length of its first side over its second, one for the run or
            one for each of its mesh edges.
        full: by piece, its edges with more cloth than the body needs.
        eased: by seam of the pattern, the shares of its length between which it is eased, if not all along.
    """

    ease: Mapping[str, float]
    ratios: tuple[tuple[float | FloatArray, ...], ...]
    full: Mapping[str, tuple[FullEdge, ...]]
    eased: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def stitching(self, form: FormResult) -> list[Stitching]:
        """Return the seams of the form, run by run, as they are to be sewn."""
        return [
            Stitching(
                name=seam.name, pieces=seam.pieces, vertices=run.vertices, ratio=ratio,
                sides=(f"{seam.pieces[0]}.{seam.edges[0]}", f"{seam.pieces[1]}.{seam.edges[1]}"),
            )
            for seam, ratios in zip(form.seams, self.ratios, strict=True)
            for run, ratio in zip(seam.runs, ratios, strict=True)
        ]  # fmt: skip


def seam_ratios(form: FormResult, wishes: Sequence[SeamTable]) -> SeamRatios:
    """Look up wishes in a form: the ratio of lengths of each of its seams, and the edges with fullness.

    A pattern's seam may be several of the form's (a sleeve's cap lies at the front and at the back): all get the same
    ratio.

    Raises:
        InputError: there is no such seam (names the nearest), it is named twice, or `longer` is not one of its sides.
    """
    plan = plan_form(form)
    by_name = {seam.name: seam for seam in plan.seams}
    also = {seam.name: plan.of_form[i][0].name for i, seam in enumerate(form.seams)}
    ratios: list[list[float | FloatArray]] = [[1.0] * len(seam.runs) for seam in form.seams]
    ease: dict[str, float] = {}
    full: dict[str, list[FullEdge]] = {}
    eased: dict[str, tuple[float, float]] = {}
    caps = {name: seam for name, seam in by_name.items() if _is_cap(form, seam)}
    for wish in wishes:
        # The pattern's name of the seam that a wish is about; the form's names are accepted too.
        name = wish.name if wish.name in by_name else also.get(wish.name, "")
        if not name:
            raise InputError(f"there is no seam {wish.name!r}; {nearest(wish.name, by_name)}")
        if name in ease:
            raise InputError(f"seam {name!r} is named twice; give its fullness or gather once")
        # The second side is the longer one if nothing else is said.
        longer = 1
        if wish.longer is not None:
            of_wish = by_name[name]
            named = [{part for side in sides for part in (side.piece, str(side))} for sides in of_wish.sides]
            found = [number for number in (0, 1) if wish.longer in named[number]]
            if not found:
                raise InputError(
                    f"seam {of_wish.name!r}: {wish.longer!r} is not one of its sides; {nearest(wish.longer, named[0] | named[1])}"
                )
            if len(found) == 2:
                stretches = {str(side) for side in of_wish.stretches}
                raise InputError(
                    f"seam {of_wish.name!r}: both sides are of {wish.longer!r}; name the edge: {', '.join(sorted(stretches))}"
                )
            longer = found[0]
        ease[name] = wish.ease_if(longer)
        for number, (seam, first_side) in enumerate(plan.of_form):
            if seam.name != name:
                continue
            side, here = 0 if longer == first_side else 1, form.seams[number]
            ratios[number] = [wish.factor if side == 0 else 1.0 / wish.factor] * len(here.runs)
            if wish.factor == 1.0:
                continue  # as long as on the body: nothing to ease in
            if name in caps and longer == 1 and not wish.gathered:
                eased[name] = _along_seam(
                    caps[name].sides[1][0], _cap_part(form.pieces[here.pieces[side]], here.runs[0].edges[side])
                )
                # By what factors the mesh edges of each run of a cap's seam are longer than the armhole's, and where
                # it is full.
                factors, edges = list[FloatArray](), list[FullEdge]()
                piece = form.pieces[here.pieces[side]]
                for run in here.runs:
                    cap, row = piece.edges[run.edges[side]], run.vertices[side]
                    shares, (first, last) = _shares(piece, cap), run.spans[side]
                    part = _part(shares, _cap_part(piece, run.edges[side]))
                    share = shares[first : last + 1][:: -1 if side == 1 and run.against else 1]
                    factors.append(_factors(share, wish.factor, part))
                    upper = row[(share >= part[0]) & (share <= part[1])]
                    # What of an armhole lies in a lower piece, below a yoke, may hardly reach there.
                    if len(upper) > 1:
                        edges.append(FullEdge(vertices=upper, factor=_upper_factor(wish.factor, part), gathered=False))
                ratios[number] = [each if side == 0 else 1.0 / each for each in factors]
                if edges:
                    full.setdefault(here.pieces[side], []).extend(edges)
                continue
            full.setdefault(here.pieces[side], []).extend(
                FullEdge(vertices=run.vertices[side], factor=wish.factor, gathered=wish.gathered) for run in here.runs
            )
    return SeamRatios(
        ease=ease, ratios=tuple(map(tuple, ratios)), full={name: tuple(edges) for name, edges in full.items()}, eased=eased,
    )  # fmt: skip


def cap_wishes(form: FormResult, fabric: Fabric, wishes: Sequence[SeamTable] = ()) -> list[SeamTable]:
    """Return wishes for the sleeves' caps that none of `wishes` is about, as the cloth needs them: none for a knit.

    Raises:
        InputError: as :func:`seam_ratios`, to which `wishes` must be right.
    """
    asked = seam_ratios(form, wishes).ease
    if fabric.is_knit:
        return []
    caps = [seam.name for seam in plan_form(form).seams if _is_cap(form, seam) and seam.name not in asked]
    return [SeamTable(name=name, fullness=_WOVEN_CAP) for name in caps]


def _is_cap(form: FormResult, seam: Seam) -> bool:
    """Return whether a seam's second side is the cap of a sleeve: one edge along an armhole, in a piece cut open under the arm."""
    if len(seam.sides[1]) != 1:
        return False
    (cap,) = seam.sides[1]
    hole, _, side = cap.edge.partition(" ")
    return hole == "armhole" and f"underarm {side}" in form.pieces[cap.piece].edges


def _shares(piece: FormPiece, row: IntArray) -> FloatArray:
    """Return the shares of a row's length on the body at which its vertices lie."""
    arc = arc_lengths(piece.surface.vertices[row])
    return np.asarray(arc / arc[-1])


def _cap_part(piece: FormPiece, edge: str) -> tuple[float, float]:
    """Return the shares of a cap's length between which it is eased in; of one that is parted over the arm, those of its half."""
    over = piece.edges.get(edge.replace("armhole", "overarm"))
    if over is None:
        return CAP_PART
    at_end = piece.edges[edge][-1] in (over[0], over[-1])
    return (2.0 * CAP_PART[0], 1.0) if at_end else (0.0, 1.0 - 2.0 * CAP_PART[0])


def _along_seam(cap: SeamSide, part: tuple[float, float]) -> tuple[float, float]:
    """Return shares along a cap as shares along its seam, which may run the other way."""
    return (1.0 - part[1], 1.0 - part[0]) if cap.reversed else part


def _part(shares: FloatArray, wanted: tuple[float, float]) -> tuple[float, float]:
    """Return the shares of the vertices of a cap that are nearest to those wanted: within a mesh edge the ease is even."""
    first, last = (float(shares[np.abs(shares - share).argmin()]) for share in wanted)
    return first, last


def _upper_factor(factor: float, part: tuple[float, float]) -> float:
    return 1.0 + (factor - 1.0) / (part[1] - part[0])


def _factors(share: FloatArray, factor: float, part: tuple[float, float]) -> FloatArray:
    """Return by what factor each edge of a cap is longer than the armhole's, from the shares at which its vertices lie."""
    low, high = np.minimum(share[1:], share[:-1]), np.maximum(share[1:], share[:-1])
    within = np.maximum(np.minimum(high, part[1]) - np.maximum(low, part[0]), 0.0) / (high - low)
    return np.asarray(1.0 + (_upper_factor(factor, part) - 1.0) * within)


def measure_ease(
    form: FormResult, wished: SeamRatios, positions: Mapping[str, FloatArray]
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """Return the ease of a form's seams by the pattern's names, and where along a cap it lies, as shares of the armhole.

    Cap and armhole are not flattened by the same share everywhere, so that both are measured on the flat cap.

    Args:
        form: in space.
        wished: of its seams.
        positions: of the flat pieces, each #V by 2 [m].
    """
    ease, eased = dict(wished.ease), dict[str, tuple[float, float]]()
    for seam in plan_form(form).seams if wished.eased else ():
        if seam.name not in wished.eased:
            continue
        (cap,) = seam.sides[1]
        row = form.pieces[cap.piece].edges[cap.edge]
        share = _shares(form.pieces[cap.piece], row)
        part, lengths = (
            _part(share, _cap_part(form.pieces[cap.piece], cap.edge)),
            np.diff(arc_lengths(positions[cap.piece][row])),
        )
        armhole = np.concatenate([[0.0], np.cumsum(lengths / _factors(share, 1.0 + wished.ease[seam.name], part))])
        first, last = np.interp(part, share, armhole / armhole[-1])
        eased[seam.name] = _along_seam(cap, (float(first), float(last)))
        ease[seam.name] = float(lengths.sum() / armhole[-1] - 1.0)
    return ease, eased
