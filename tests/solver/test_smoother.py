"""Steps that smooth: their polynomial, and what they leave of a rough way."""

from __future__ import annotations

import numpy as np
import pytest
from devices import DEVICE

from warpflat.fabric.library import as_fabric
from warpflat.model.network import SpringNetwork
from warpflat.solver.options import RelaxOptions
from warpflat.solver.relax import relax
from warpflat.solver.relaxation import Relaxation
from warpflat.solver.smoother import chebyshev_coefficients
from warpflat.surface.shapes import make_shape


@pytest.mark.parametrize("steps", [1, 2, 3, 4, 7])
def test_what_is_left_is_the_chebyshev_polynomial_of_the_fourth_kind(steps: int) -> None:
    eigenvalue = np.linspace(1e-3, 1.0, 500)
    way, left = np.zeros_like(eigenvalue), np.ones_like(eigenvalue)
    for number in range(steps):
        viscosity, carried, push = chebyshev_coefficients(number)
        assert viscosity == 0.0
        way = carried * way - push * eigenvalue * left
        left = left + way
    angle = 2.0 * np.arcsin(np.sqrt(eigenvalue))
    np.testing.assert_allclose(left, np.sin((steps + 0.5) * angle) / ((2 * steps + 1) * np.sin(angle / 2)), atol=1e-12)
    assert (np.sqrt(eigenvalue) * np.abs(left)).max() <= 1.0 / (2 * steps + 1) + 1e-12


@pytest.fixture(scope="module")
def at_rest() -> tuple[SpringNetwork, np.ndarray]:
    surface = make_shape("dome", resolution=13)
    network = SpringNetwork.build(surface, as_fabric("isotropic"), surface.vertices[:, :2], device=DEVICE)
    state = Relaxation(
        network, RelaxOptions(energy_tolerance=1e-10, residual_tolerance=1e-6), start=surface.vertices[:, :2]
    )
    relax(state)
    return network, state.positions()


def energy_left(network: SpringNetwork, rest: np.ndarray, go: str, steps: int) -> float:
    """Of a small random way from rest, the share that is left after some steps."""
    rough = np.random.default_rng(1).normal(scale=1e-5, size=rest.shape)
    least = Relaxation(network, RelaxOptions(), start=rest).potentials().sum()
    state = Relaxation(network, RelaxOptions(), start=rest + rough)
    before = state.potentials().sum() - least
    getattr(state, go)(steps)
    return float((state.potentials().sum() - least) / before)


@pytest.mark.parametrize("steps", [1, 2, 3])
def test_a_few_steps_leave_less_of_what_is_rough_than_as_many_that_swing(at_rest, steps: int) -> None:
    network, rest = at_rest
    assert energy_left(network, rest, "smooth", steps) < 0.7 * energy_left(network, rest, "sweep", steps)


def test_looking_at_all_cells_less_often_changes_nothing_where_none_acts(at_rest) -> None:
    network, rest = at_rest
    layouts = []
    for check_interval in (1, 3):
        state = Relaxation(network, RelaxOptions(), start=1.001 * rest)
        state.smooth(6, check_interval=check_interval)
        layouts.append(state.positions())
    np.testing.assert_allclose(layouts[0], layouts[1], atol=1e-14)


def test_steps_after_it_are_the_papers_again(at_rest) -> None:
    network, rest = at_rest
    state, other = (Relaxation(network, RelaxOptions(), start=1.01 * rest) for _ in range(2))
    state.smooth(2)
    other.position.assign(state.position)
    for relaxation in (state, other):
        relaxation.evaluate_at_rest()
        relaxation.sweep(3)
    np.testing.assert_array_equal(state.positions(), other.positions())
