"""Forms on a body with long edges, each flattened once in a process, whoever asks; nobody changes one. And their patterns."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from bodies import body_of_size

from warpflat.garment.construction.constraints import straight_stands
from warpflat.garment.construction.details import FinishingTable, OpeningTable
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.openings import part_at_centres
from warpflat.garment.construction.to_pattern import pattern_of_garment
from warpflat.garment.mannequin.forms import shipped_form
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.pieces import Pattern

__all__ = ["flat_form", "pattern_of", "whole_draft"]


@functools.cache
def flat_form(name: str, *openings: OpeningTable, half: bool = False) -> Garment:
    """A shipped form, sewn, with openings at which it is parted, unless it is a half; edges of stands are straight."""
    mannequin, form = body_of_size(30.0), shipped_form(name)
    built = mannequin.form(form if half else part_at_centres(mannequin.layout, form, openings), half=half)
    straight = straight_stands(built, openings)
    garment = flatten_form(mannequin, built, fabric="woven", sewn=True, curves_mm=0.0, constraints=straight)
    return replace(garment, openings=openings)


def pattern_of(
    garment: Garment, *finishing: FinishingTable, openings: Sequence[OpeningTable] | None = None, **options: Any
) -> Pattern:
    """The pattern of a garment that is finished so, with other openings than its own if some are given."""
    openings = garment.openings if openings is None else openings
    return pattern_of_garment(
        {"": replace(garment, finishing=finishing or garment.finishing, openings=openings)}, name="garment", **options
    )[0]


@functools.lru_cache(maxsize=1)
def whole_draft(pattern: Pattern) -> DraftedGarment:
    """The pattern as it is drafted; both sides of all of its seams match."""
    drafted = draft_garment(pattern)
    assert all(seam.matches for seam in drafted.seams)
    return drafted
