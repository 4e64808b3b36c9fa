"""The paper's steps with which every relaxation begins: what they release, when they end, and that the minimum is the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from devices import DEVICE

from warpflat.core.errors import InputError
from warpflat.flat.cutting.cut_piece import cut
from warpflat.flat.cutting.cut_plan import CutPlan
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.surface.shapes import make_shape
from warpflat.garment.construction.constraints import FixedLength
from warpflat.garment.construction.sewing import sew

WITHOUT = RelaxOptions(first_steps_gain=1.0)


def bodice(relax: RelaxOptions | None = None, resolution: int = 33, fabric: str = "isotropic") -> Flattening:
    surface = make_shape("bodice", resolution=resolution)
    return flatten(surface, datum="centre", fabric=fabric, device=DEVICE, relax=relax)


@pytest.mark.parametrize("fabric", ["isotropic", "woven"])
def test_a_few_release_most_and_the_end_is_the_same(fabric: str):
    with_steps, without = bodice(fabric=fabric), bodice(WITHOUT, fabric=fabric)
    assert [stage.name for stage in with_steps.stages] == ["develop", "steps", "relax"]
    assert [stage.name for stage in without.stages] == ["develop", "relax"]
    start, steps, end = (stage.model_energy_j for stage in with_steps.stages)
    assert (start - steps) / (start - end) > 0.7
    assert 3 <= with_steps.stages[1].steps <= 10
    assert with_steps.stages[1].converged
    assert with_steps.flipped_faces == 0
    assert end == pytest.approx(without.stages[-1].model_energy_j, rel=1e-5)
    np.testing.assert_allclose(with_steps.positions, without.positions, atol=2e-4)


def test_they_go_on_longer_the_less_they_may_gain():
    """Epsilon of eq. (11)."""
    counts = [bodice(RelaxOptions(first_steps_gain=gain), 57).stages[1].steps for gain in (0.2, 0.04, 0.0)]
    assert counts == sorted(counts)
    assert counts[0] == 3 < counts[-1] == 10


def test_where_they_gain_nothing_they_end_after_a_few_and_are_taken_back():
    flat = bodice(RelaxOptions(energy_tolerance=1e-9, residual_tolerance=1e-4))
    again = flatten(
        flat.surface, datum="centre", fabric="isotropic", device=DEVICE, start=flat.positions, relax=RelaxOptions()
    )
    assert again.stages[1].name == "steps"
    assert again.stages[1].steps == 3
    assert again.stages[1].model_energy_j <= again.stages[0].model_energy_j * (1.0 + 1e-12)


def test_when_a_cut_opens_and_when_pieces_are_sewn():
    flat = bodice(resolution=17)
    path = np.arange(17 * 17, dtype=np.int32).reshape(17, 17)[:10, 4]
    opened = cut(flat, CutPlan(name="dart", paths=(path,)))
    assert [stage.name for stage in opened.stages] == ["develop", "steps", "relax", "steps", "cut:dart"]
    before, steps, after = (stage.model_energy_j for stage in opened.stages[2:])
    assert after <= steps <= before * (1.0 + 1e-3)
    sewn = sew({"bodice": flat}, constraints=[FixedLength(piece="bodice", line="bottom", length=0.5)])
    assert [stage.name for stage in sewn.pieces["bodice"].stages[-2:]] == ["steps", "sew"]


def test_a_callback_hears_of_both():
    heard: list[str] = []

    def hear(progress: Progress) -> None:
        heard.append(progress.stage)

    flatten(make_shape("bodice", resolution=17), datum="centre", device=DEVICE, callback=hear)
    assert list(dict.fromkeys(heard)) == ["develop", "steps", "relax"]


def test_a_stop_during_the_steps_keeps_their_layout():
    flat = flatten(
        make_shape("bodice", resolution=17), datum="centre", device=DEVICE, callback=lambda now: now.step == 3
    )
    assert not flat.converged
    assert any("stopped" in note for note in flat.notes)


@pytest.mark.parametrize("gain", [-0.1, 1.5, float("nan"), "little"])
def test_a_gain_out_of_its_bounds_is_refused(gain: object):
    with pytest.raises(InputError, match="first_steps_gain"):
        replace(RelaxOptions(), first_steps_gain=gain).validate()  # type: ignore[arg-type]


def test_a_solver_that_there_is_not_is_refused():
    with pytest.raises(InputError, match="solver 'plain' is unknown; valid: auto, paper"):
        RelaxOptions(solver="plain").validate()  # type: ignore[arg-type]
