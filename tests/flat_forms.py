"""Forms on a body with long edges, each flattened once in a process, whoever asks; nobody changes one."""

from __future__ import annotations

import functools
from dataclasses import replace

from bodies import body_of_size

from warpflat.app.scene.openings import straight_stands
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.openings import Opening, part_at_centres
from warpflat.garment.mannequin.forms import shipped_form

__all__ = ["flat_form"]


@functools.cache
def flat_form(name: str, *openings: Opening, half: bool = False) -> Garment:
    """A shipped form, sewn, with openings at which it is parted, unless it is a half; edges of stands are straight."""
    mannequin, form = body_of_size(30.0), shipped_form(name)
    built = mannequin.form(form if half else part_at_centres(mannequin.layout, form, openings), half=half)
    straight = straight_stands(built, openings)
    garment = flatten_form(mannequin, built, fabric="woven", sewn=True, curves_mm=0.0, constraints=straight)
    return replace(garment, openings=openings)
