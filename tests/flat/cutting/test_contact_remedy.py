"""The cut that spares a piece its contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from devices import DEVICE
from surface_meshes import quads_between

from warpflat.flat.cutting.cut_piece import cut
from warpflat.flat.cutting.cut_plan import CutPlan
from warpflat.flat.cutting.remedies import advise, contact_note, cut_between_contacts
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.surface.repair.validate import make_surface


@pytest.fixture(scope="module")
def strip() -> Flattening:
    """A flat ring of more than a turn, on a ramp."""
    angle, radius = np.meshgrid(2.2 * np.pi * np.linspace(0, 1, 31), np.linspace(0.2, 0.1, 5), indexing="ij")
    faces = quads_between(angle.shape, turned=True)
    place = np.stack([radius * np.cos(angle), 0.015 * angle, radius * np.sin(angle)], axis=-1)
    return flatten(make_surface(place.reshape(-1, 3), faces, name="strip"), device=DEVICE)


def test_a_contact_that_costs_much_gets_a_note_with_the_cut_that_restores_it(strip: Flattening):
    path = cut_between_contacts(strip)
    assert path is not None
    # Across the strip, some way from its ends.
    assert len(path) == 5
    assert path.min() > 5 * 7
    assert path.max() < 5 * 24
    advised = advise(strip)
    told = [note for note in advised.notes if "contact" in note]
    assert ["the piece lies over itself" in note for note in told] == [True, False]
    assert told[1].startswith("contact costs more than 5 % of the energy; a cut of 10.0 cm from vertex")
    parted = cut(advised, CutPlan(name="across", paths=(path,)))
    assert parted.overlap == 0.0
    assert parted.notes == tuple(note for note in strip.notes if "contact" not in note)
    assert parted.converged
    assert parted.stages[-1].model_energy_j < 0.5 * strip.stages[-1].model_energy_j


def test_a_contact_that_costs_less_than_the_share_gets_none(strip: Flattening):
    assert contact_note(replace(strip, options=replace(strip.options, contact_share=1e6))) is None
    flat = replace(strip, stages=strip.stages[:-1])
    assert contact_note(flat) is None
    # Nor does one that is not to be felt, of a piece that lies flat almost without energy.
    *begun, free, parted = strip.stages
    light = replace(free, model_energy_j=1e-12), replace(parted, model_energy_j=1e-9)
    assert contact_note(replace(strip, stages=(*begun, *light))) is None
