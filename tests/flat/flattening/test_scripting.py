"""What a script does with a running relaxation: stop it, step it by hand, look at its result."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest

import warpflat
from warpflat.core.errors import InputError
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.solver.steps import Relaxation

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


def test_what_was_stopped_is_not_at_rest_even_where_it_is_flat() -> None:
    sheet = warpflat.make_shape("cylinder", resolution=5)
    assert warpflat.flatten(sheet, fabric="woven", datum="centre").converged
    assert not warpflat.flatten(sheet, fabric="woven", datum="centre", callback=lambda _: True).converged


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


def test_the_last_step_is_judged_by_the_steps_since_the_one_before(monkeypatch: pytest.MonkeyPatch) -> None:
    counts, check = [], Relaxation.check_convergence

    def counted(self: Relaxation, count: int) -> object:
        counts.append(count)
        return check(self, count)

    monkeypatch.setattr(Relaxation, "check_convergence", counted)
    options = warpflat.RelaxOptions(max_steps=12)
    steps = list(warpflat.relaxation(warpflat.make_shape("dome", resolution=9), relax=options, energy_every=5))
    assert len(steps) == 13
    assert counts == [5, 5, 2]


def test_a_force_of_ones_own_is_balanced_by_the_cloth() -> None:
    shape = warpflat.make_shape("dome", resolution=9)

    def widest(pull: float) -> tuple[float, warpflat.RelaxationStep]:
        def force(layout: np.ndarray) -> np.ndarray:
            # To the line x = 0, and around the middle, which only turns the piece and is left out.
            x, y = (layout - layout.mean(axis=0)).T
            return np.column_stack([-pull * x - 0.01 * y, 0.01 * x])

        *_, last = warpflat.relaxation(shape, fabric="woven", energy_every=25, force=force)
        return float(np.ptp(last.positions[:, 0])), last

    free, alone = widest(0.0)
    narrow, pulled = widest(0.5)
    *_, plain = warpflat.relaxation(shape, fabric="woven", energy_every=25)
    assert alone.converged
    assert pulled.converged
    assert alone.model_energy_j == pytest.approx(plain.model_energy_j, rel=1e-3)
    assert narrow < free - 1e-3
    # The work of the pull is what the cloth has stored: it is at a minimum of both energies.
    both = [
        state.model_energy_j + 0.25 * ((state.positions[:, 0] - state.positions[:, 0].mean()) ** 2).sum()
        for state in (alone, pulled)
    ]
    assert both[1] < both[0]
    with pytest.raises(InputError, match=r"force: gave an array of shape \(2,\); should be \(81, 2\)"):
        list(warpflat.relaxation(shape, force=lambda layout: [0.0, 1.0]))


def test_a_result_shows_itself_in_a_few_lines_and_as_a_picture() -> None:
    result = warpflat.flatten(warpflat.make_shape("dome", resolution=9), fabric="woven")
    assert len(repr(result).splitlines()) <= 3
    assert "81 vertices" in repr(result)
    assert len(repr(result.surface)) < 200
    assert len(repr(result.network)) < 400
    stream = BytesIO()
    warpflat.plot(result).savefig(stream, format="png")
    assert stream.getvalue().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="read-only"):
        result.positions[0] = 0.0
