"""Spring forces, viscosity and energy against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from small_networks import Launched, shaken, small_network


def test_energy_is_half_k_stretch_squared_of_every_spring_once():
    network = small_network()
    positions = shaken(network, scale=1.1)
    s = network.spring_arrays
    length = np.linalg.norm(positions[s.ends[:, 1]] - positions[s.ends[:, 0]], axis=1)
    by_hand = 0.5 * s.stiffness * (length - s.rest_length) ** 2
    per_vertex = Launched(network, positions).spring_energy()
    assert per_vertex.sum() == pytest.approx(by_hand.sum(), rel=1e-12)
    at_lower = np.bincount(s.ends.min(axis=1), by_hand, minlength=network.vertex_count)
    np.testing.assert_allclose(per_vertex, at_lower, rtol=1e-12)


def test_tension_is_k_times_stretch_of_every_spring_once():
    network = small_network()
    positions = shaken(network, scale=1.1)
    s = network.spring_arrays
    length = np.linalg.norm(positions[s.ends[:, 1]] - positions[s.ends[:, 0]], axis=1)
    assert Launched(network, positions).spring_tension().sum() == pytest.approx(
        (s.stiffness * np.abs(length - s.rest_length)).sum(), rel=1e-12
    )


@pytest.mark.parametrize("scale", [0.8, 1.0, 1.3])
def test_forces_are_minus_the_gradient_of_the_energy(scale: float):
    network = small_network()
    positions = shaken(network, scale=scale)
    # No cell is evaluated, so none acts: what is gathered are the springs' forces alone.
    force = Launched(network, positions).gather_forces()["force"]
    step = 1e-6
    for vertex in range(network.vertex_count):
        for axis in (0, 1):
            energy = []
            for side in (step, -step):
                moved = positions.copy()
                moved[vertex, axis] += side
                energy.append(Launched(network, moved).spring_energy().sum())
            assert force[vertex, axis] == pytest.approx(
                -(energy[0] - energy[1]) / (2 * step), abs=1e-6 * np.abs(force).max()
            )
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * np.abs(force).max())


@pytest.mark.parametrize("time_step", [1e-4, 1.0, 1e4])
def test_viscosity_is_h_times_stiffness_times_velocity_difference(time_step: float):
    """Eq. (7): h sum_j k_ij (v_j - v_i)."""
    network = small_network()
    velocities = np.random.default_rng(5).normal(size=(network.vertex_count, 2))
    at = Launched(network, shaken(network, scale=0.97), velocities, time_step).gather_forces()
    by_hand = np.zeros_like(velocities)
    s = network.spring_arrays
    for (i, j), k in zip(s.ends, s.stiffness, strict=True):
        by_hand[i] += time_step * k * (velocities[j] - velocities[i])
        by_hand[j] += time_step * k * (velocities[i] - velocities[j])
    np.testing.assert_allclose(at["driving_force"] - at["force"], by_hand, rtol=1e-9, atol=1e-9 * np.abs(by_hand).max())


def test_a_spring_of_no_length_pushes_nowhere():
    network = small_network()
    positions = shaken(network, scale=1.0)
    positions[4] = positions[1]
    at = Launched(network, positions)
    force, energy = at.gather_forces()["force"], at.spring_energy()
    assert np.isfinite(force).all()
    s = network.spring_arrays
    touching = ((s.ends == 1) | (s.ends == 4)).all(axis=1)
    assert touching.sum() == 1
    others = np.zeros(2)
    for (i, j), k, rest in zip(s.ends[~touching], s.stiffness[~touching], s.rest_length[~touching], strict=True):
        if 4 in (i, j):
            d = positions[i + j - 4] - positions[4]
            length = np.linalg.norm(d)
            others += k * (1.0 - rest / length) * d
    np.testing.assert_allclose(force[4], others, rtol=1e-12)
    length = np.linalg.norm(positions[s.ends[:, 1]] - positions[s.ends[:, 0]], axis=1)
    assert energy.sum() == pytest.approx((0.5 * s.stiffness * (length - s.rest_length) ** 2).sum(), rel=1e-12)


def test_pieces_of_a_launch_equal_the_whole():
    network = small_network()
    positions = shaken(network, scale=1.2)
    whole, parts = Launched(network, positions), Launched(network, positions, pieces=3)
    assert np.array_equal(whole.spring_energy(), parts.spring_energy())
