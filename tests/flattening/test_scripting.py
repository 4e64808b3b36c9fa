"""What a script does with a running relaxation: stop it, step it by hand, look at its result."""

from __future__ import annotations

import numpy as np
import pytest

import warpflat
from warpflat.core.errors import InputError
from warpflat.flattening.progress import Progress

SHAPE = warpflat.make_shape("dome", resolution=17)


@pytest.mark.parametrize("solver", ["auto", "paper"])
def test_a_callback_that_returns_true_stops_the_run_and_keeps_the_result(solver: str) -> None:
    seen: list[Progress] = []
    layouts: list[np.ndarray] = []

    def stop(progress: Progress) -> bool:
        seen.append(progress)
        layouts.append(progress.positions())
        return progress.step >= 4

    options = warpflat.RelaxOptions(solver=solver)
    result = warpflat.flatten(SHAPE, fabric="woven", relax=options, callback=stop)
    assert [progress.step >= 4 for progress in seen].index(True) == len(seen) - 1, "it is not called again"
    np.testing.assert_array_equal(result.positions, layouts[-1])
    assert not result.converged
    assert "the callback stopped the relaxation" in " ".join(result.messages)
    rest = warpflat.flatten(SHAPE, fabric="woven", relax=options)
    developed, stopped = result.stages
    assert rest.stages[-1].model_energy_j < stopped.model_energy_j < developed.model_energy_j
    assert rest.converged


def test_steps_by_hand_come_to_the_same_rest() -> None:
    shape = warpflat.make_shape("dome", resolution=9)
    steps = list(warpflat.relaxation(shape, fabric="woven", energy_every=5))
    assert [state.step for state in steps] == list(range(len(steps)))
    assert all((state.model_energy_j is None) == bool(state.step % 5) for state in steps)
    assert steps[-1].converged
    result = warpflat.flatten(shape, fabric="woven", relax=warpflat.RelaxOptions(solver="paper"))
    assert steps[-1].model_energy_j == pytest.approx(result.stages[-1].model_energy_j, rel=1e-3)
    with pytest.raises(ValueError, match="read-only"):
        steps[0].positions[0] = 0.0
    with pytest.raises(InputError, match="energy_every = 0"):
        warpflat.relaxation(shape, energy_every=0)


def test_a_result_shows_itself_in_a_few_lines_and_as_a_picture() -> None:
    result = warpflat.flatten(warpflat.make_shape("dome", resolution=9), fabric="woven")
    assert len(repr(result).splitlines()) <= 3
    assert "81 vertices" in repr(result)
    assert len(repr(result.surface)) < 200
    assert result._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="read-only"):
        result.positions[0] = 0.0
