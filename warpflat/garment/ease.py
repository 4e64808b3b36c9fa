"""Ease and gathers: from the names of seams to the ratio of the two lengths of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from warpflat.core.errors import InputError, nearest
from warpflat.garment.form_plan import plan_form
from warpflat.garment.fullness import FullEdge

if TYPE_CHECKING:
    from warpflat.mannequin.forms import FormResult
    from warpflat.pattern.pieces import Seam

__all__ = ["SeamRatios", "SeamWish", "seam_ratios"]


@dataclass(frozen=True, kw_only=True)
class SeamWish:
    """A wish for one side of a seam to be longer than the other.

    Attributes:
        name: the seam's, as in the pattern.
        factor: length of the longer side over that of the other: 1.02 for an ease of 2 %.
        gathered: the fullness falls on through the piece; otherwise it is eased in near the seam.
        longer: the piece that is longer, or "piece.edge"; the seam's second side if not given.
    """

    name: str
    factor: float
    gathered: bool = False
    longer: str | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class SeamRatios:
    """Wishes for the seams of a form, worked out.

    Attributes:
        ease: by seam of the pattern, how much longer its second side is, as a share of the first.
        ratios: for each of the form's seams the wished length of its first side over its second.
        full: by piece, its edges with more cloth than the body needs.
    """

    ease: Mapping[str, float]
    ratios: tuple[float, ...]
    full: Mapping[str, tuple[FullEdge, ...]]


def seam_ratios(form: FormResult, wishes: Sequence[SeamWish]) -> SeamRatios:
    """Look up wishes in a form: the ratio of lengths of each of its seams, and the edges with fullness.

    A pattern's seam may be several of the form's (a sleeve's cap lies at the front and at the back): all get the same
    ratio.

    Raises:
        InputError: there is no such seam (names the nearest), it is named twice, a factor below 1, or `longer` is not
            one of its sides.
    """
    plan = plan_form(form)
    by_name = {seam.name: seam for seam in plan.seams}
    also = {seam.name: plan.of_form[i][0].name for i, seam in enumerate(form.seams)}
    ratios = [1.0] * len(form.seams)
    ease: dict[str, float] = {}
    full: dict[str, list[FullEdge]] = {}
    for wish in wishes:
        name = _seam_name(wish, by_name, also, ease)
        longer = _longer_side(by_name[name], wish.longer)
        ease[name] = wish.factor - 1.0 if longer == 1 else 1.0 / wish.factor - 1.0
        for number, (seam, first_side) in enumerate(plan.of_form):
            if seam.name != name:
                continue
            side = 0 if longer == first_side else 1
            ratios[number] = wish.factor if side == 0 else 1.0 / wish.factor
            if wish.factor == 1.0:
                continue  # as long as on the body: nothing to ease in
            here = form.seams[number]
            full.setdefault(here.pieces[side], []).extend(
                FullEdge(vertices=run.vertices[side], factor=wish.factor, gathered=wish.gathered) for run in here.runs
            )
    return SeamRatios(ease=ease, ratios=tuple(ratios), full={name: tuple(edges) for name, edges in full.items()})


def _seam_name(
    wish: SeamWish, by_name: Mapping[str, Seam], form_names: Mapping[str, str], done: Mapping[str, float]
) -> str:
    """Return the pattern's name of the seam that a wish is about; the form's names are accepted too."""
    name = wish.name if wish.name in by_name else form_names.get(wish.name, "")
    if not name:
        raise InputError(f"there is no seam {wish.name!r}; {nearest(wish.name, by_name)}")
    if name in done:
        raise InputError(f"seam {name!r} is named twice; give its fullness or gather once")
    if not 1.0 <= wish.factor <= 5.0:
        raise InputError(f"seam {name!r}: one side is {wish.factor:g} times as long as the other; must be 1 to 5")
    return name


def _longer_side(seam: Seam, longer: str | None) -> int:
    """Return which side of a seam (0 or 1) is longer; the second if nothing else is said."""
    if longer is None:
        return 1
    named = [{part for side in sides for part in (side.piece, str(side))} for sides in seam.sides]
    found = [number for number in (0, 1) if longer in named[number]]
    if not found:
        raise InputError(
            f"seam {seam.name!r}: {longer!r} is not one of its sides; {nearest(longer, named[0] | named[1])}"
        )
    if len(found) == 2:
        edges = {str(side) for sides in seam.sides for side in sides}
        raise InputError(f"seam {seam.name!r}: both sides are of {longer!r}; name the edge: {', '.join(sorted(edges))}")
    return found[0]
