"""Garments that are pulled on: their neckline and the ease of other rings grow until what must pass through them does."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from warpflat.core import InputError, without_side
from warpflat.garment.construction.details import FinishingTable, OpeningTable
from warpflat.garment.construction.openings import opened_rings, sized_opening
from warpflat.garment.construction.rings import measure_rings
from warpflat.garment.mannequin.forms import FormResult
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.neckline import Neckline

__all__ = ["wide_enough"]

# Flat pieces are shorter than their edges on the form by up to this share.
_MARGIN = 0.015
# A neckline grows, and the form is built again, so many times at most.
_ROUNDS = 5


def wide_enough(
    mannequin: Mannequin,
    form: FormResult,
    *,
    strain_limit: float,
    openings: Sequence[OpeningTable],
    finishing: Sequence[FinishingTable],
) -> FormResult:
    """Return a form whose rings pass over what they must at the cloth's limit, with notes on what has grown for that.

    A ring that cannot grow so far stays as wide as it got; the garment's rings say which opening it needs.

    Args:
        mannequin: the body.
        form: on it.
        strain_limit: of the cloth.
        openings, finishing: of the garment; openings and plackets count.
    """
    from warpflat.garment.construction.girths import pattern_girths  # with it the springs are loaded

    passed: dict[str, tuple[str, float]] = {}
    asked = form.recipe
    neck = (asked.neckline or Neckline()).in_cm(mannequin.layout, mannequin.vertices)
    wider, ease = 0.0, dict(asked.ease)
    for _ in range(_ROUNDS):
        on_form = {name: piece.surface.vertices for name, piece in form.pieces.items()}
        sized = [sized_opening(form, opening, on_form) for opening in openings]
        short = dict[str, float]()
        for ring in measure_rings(
            mannequin, form, on_form, strain_limit=strain_limit, girths=pattern_girths(mannequin, form, on_form),
            opened=opened_rings(mannequin, form, on_form, sized, finishing),
        ):  # fmt: skip
            if ring.girth is None:
                continue
            missing = (1.0 + _MARGIN) * (ring.girth - ring.opened) / (1.0 + strain_limit) - ring.length
            # Both limbs have one ease.
            line = without_side(ring.name)
            if missing > 0.0 and (line == "neck" or line in (form.ease if line == ring.name else asked.ease)):
                short[line] = max(missing, short.get(line, 0.0))
                passed[line] = ring.over, ring.girth
        if not short:
            break
        for line, missing in short.items():
            if line == "neck":
                # A closed line becomes longer by 2 pi times what it moves outwards by.
                wider += 100.0 * missing / (2.0 * math.pi)
            else:
                ease[line] = ease.get(line, 0.0) + 100.0 * missing
        grown = replace(
            neck, side_cm=neck.side_cm + wider, front_cm=neck.front_cm + wider, back_cm=neck.back_cm + wider
        )
        try:
            form = mannequin.form(
                replace(asked, neckline=grown if wider else asked.neckline, ease=ease), half=form.half
            )
        except InputError:
            # Beyond the shoulder, or so deep that it folds.
            break
    words = dict[str, str]()
    if form.recipe.neckline != asked.neckline:
        words["neck"] = f"the neckline lies {10.0 * wider:.0f} mm farther out"
    for level, cm in form.recipe.ease.items():
        if cm != asked.ease.get(level):
            words[level] = f"{level} has {cm - asked.ease.get(level, 0.0):.1f} cm more of ease"
    notes = [
        f"pulled on: {text} than asked, so that it passes over the {passed[line][0]} of {100.0 * passed[line][1]:.1f} cm"
        for line, text in words.items()
    ]
    return replace(form, notes=tuple(notes))
