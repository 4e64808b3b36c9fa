"""The approximate implicit step against eqs. (4)-(10) written out in NumPy, and what stops it short."""

from __future__ import annotations

import numpy as np
import pytest
from small_networks import Launched, corner_vertices, shaken, small_network
from warpflat.kernels.cells import ACTING, ALL

SHARE = 0.4


def spring_sums(network, values):
    """#V by 2, sum over the springs of each vertex of k_ij times the far end's value."""
    s = network.spring_arrays
    total = np.zeros_like(values)
    np.add.at(total, s.ends[:, 0], s.stiffness[:, None] * values[s.ends[:, 1]])
    np.add.at(total, s.ends[:, 1], s.stiffness[:, None] * values[s.ends[:, 0]])
    return total


def spring_forces(network, positions):
    s = network.spring_arrays
    d = positions[s.ends[:, 1]] - positions[s.ends[:, 0]]
    pull = (s.stiffness * (1.0 - s.rest_length / np.linalg.norm(d, axis=1)))[:, None] * d
    force = np.zeros_like(positions)
    np.add.at(force, s.ends[:, 0], pull)
    np.add.at(force, s.ends[:, 1], -pull)
    return force


@pytest.mark.parametrize("time_step", [1e-4, 1e-2, 1e4])
@pytest.mark.parametrize("scale", [1.2, 0.8], ids=["guard at rest", "guard acting"])
def test_a_step_is_equations_4_to_10(scale: float, time_step: float):
    network = small_network()
    rng = np.random.default_rng(4)
    positions = shaken(network, scale=scale)
    velocities = rng.normal(scale=1e-3 / time_step, size=positions.shape)
    at = Launched(network, positions, velocities, time_step).evaluate_guard().gather_forces()
    acting = np.repeat(at["face_acting"], 4).astype(bool)
    assert acting.all() == (scale < 1)

    h, m = time_step, network.mass.numpy()[:, None]
    slots, corner = (values[acting[corner_vertices(network)[0]]] for values in corner_vertices(network))
    ends, k_ij = network.spring_arrays.ends, network.spring_arrays.stiffness
    force, viscosity, stiffness = spring_forces(network, positions), np.zeros_like(positions), np.zeros((len(m), 1))
    np.add.at(force, corner, at["face_force"][slots])
    np.add.at(viscosity, corner, at["face_viscosity"][slots])
    np.add.at(stiffness, corner, at["face_stiffness"][slots, None])
    np.add.at(stiffness, ends.ravel(), np.repeat(k_ij, 2)[:, None])
    viscosity += h * (spring_sums(network, velocities) - velocities * spring_sums(network, np.ones_like(positions)))
    # a half of the stiffest spring is added to the sum around a vertex (warpflat.flat.model.network)
    stiffest = np.zeros((len(m), 1))
    np.maximum.at(stiffest, ends.ravel(), np.repeat(k_ij, 2)[:, None])
    stiffness += 0.5 * stiffest

    driving = force + viscosity
    guess = driving * h / (m + h**2 * stiffness)
    change = (driving * h + h**2 * spring_sums(network, guess)) / (m + h**2 * stiffness)
    close = {"rtol": 1e-9, "atol": 1e-9 * np.abs(driving).max()}
    np.testing.assert_allclose(at["force"], force, **close)
    np.testing.assert_allclose(at["driving_force"], driving, **close)
    np.testing.assert_allclose(at["stiffness"], stiffness[:, 0], rtol=1e-12)
    np.testing.assert_allclose(at["first_guess"], guess, rtol=1e-8, atol=1e-9 * np.abs(guess).max())
    np.testing.assert_allclose(at["power"], (force * velocities).sum(axis=1) / stiffness[:, 0], rtol=1e-8, atol=1e-12)

    new = velocities + change
    distance = h * np.linalg.norm(new, axis=1)
    new *= np.minimum(1.0, at["reach"] / np.maximum(distance, 1e-300))[:, None]
    at.advance()
    np.testing.assert_allclose(at["velocity"], new, rtol=1e-7, atol=1e-8 * np.abs(new).max())
    np.testing.assert_allclose(at["position"], positions + h * new, rtol=1e-9, atol=1e-11)


def test_reach_is_a_share_of_the_least_height_around():
    network = small_network()
    positions = shaken(network, scale=1.0)
    at = Launched(network, positions).evaluate_guard().gather_forces()
    for vertex in range(network.vertex_count):
        around = (network.surface.faces == vertex).any(axis=1)
        assert at["reach"][vertex] == pytest.approx(SHARE * at["face_clearance"][around].min(), rel=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_no_velocity_can_mirror_a_cell(seed: int):
    network = small_network()
    velocities = np.random.default_rng(seed).normal(scale=1e3, size=(network.vertex_count, 2))
    at = Launched(network, shaken(network, scale=1.0), velocities, 0.1)
    for _ in range(20):
        before = at["position"]
        at.evaluate_guard().gather_forces().advance()
        moved = np.linalg.norm(at["position"] - before, axis=1)
        assert (moved <= at["reach"] * (1 + 1e-9) + 1e-15).all()
        at.evaluate_guard()
        assert (at["face_clearance"] > 0).all()
        assert np.isfinite(at.guard_energy()).all()
        at.arrays["velocity"].assign(velocities)
    assert moved.max() > 0


def test_between_two_looks_only_acting_cells_are_evaluated_and_nothing_leaves_its_reach():
    network = small_network()
    velocities = np.random.default_rng(3).normal(scale=1e3, size=(network.vertex_count, 2))
    at = Launched(network, shaken(network, scale=1.02), velocities, 0.1).evaluate_guard().gather_forces()
    idle = at["face_acting"] == 0
    assert idle.any()
    assert not idle.all()
    reach, anchor, clearance = at["reach"], at["anchor"], at["face_clearance"]
    assert np.array_equal(anchor, at["position"])
    at.scope = ACTING
    for _ in range(5):
        at.advance()
        away = np.linalg.norm(at["position"] - anchor, axis=1)
        assert (away <= reach * (1 + 1e-9)).all()
        at.arrays["velocity"].assign(velocities)
        at.evaluate_guard().gather_forces()
        assert np.array_equal(at["face_clearance"][idle], clearance[idle])
        assert np.array_equal(at["anchor"], anchor)
        assert np.array_equal(at["reach"], reach)
    assert away.max() > 0.5 * reach.max()
    at.scope = ALL
    assert (at.evaluate_guard()["face_clearance"] > 0).all()


def test_two_looks_at_one_layout_give_the_same_forces():
    network = small_network()
    at = Launched(network, shaken(network, scale=0.8)).evaluate_guard().gather_forces()
    whole = {name: at[name] for name in ("force", "driving_force", "stiffness", "first_guess")}
    at.scope = ACTING
    at.evaluate_guard().gather_forces()
    for name, values in whole.items():
        assert np.array_equal(at[name], values), name


def test_stopping_gives_what_forces_at_rest_are():
    network = small_network()
    velocities = np.random.default_rng(8).normal(size=(network.vertex_count, 2))
    moving = Launched(network, shaken(network, scale=0.8), velocities).evaluate_guard().gather_forces()
    assert np.abs(moving["driving_force"] - moving["force"]).max() > 0
    moving.stop()
    still = Launched(network, shaken(network, scale=0.8)).evaluate_guard().gather_forces()
    for name in ("velocity", "force", "driving_force", "first_guess", "stiffness"):
        np.testing.assert_allclose(moving[name], still[name], rtol=1e-12, atol=1e-12, err_msg=name)


def test_a_vertex_of_a_mirrored_cell_stays():
    network = small_network()
    positions = shaken(network, scale=1.0, noise=0.0)
    positions[0] = [0.15, 0.3]
    at = Launched(network, positions).evaluate_guard().gather_forces().advance()
    corners = network.surface.faces[at["face_clearance"] == 0]
    lost = np.unique(corners[corners >= 0])
    assert 0 in lost
    assert np.array_equal(at["position"][lost], positions[lost])
    assert np.isfinite(at["position"]).all()


def test_momentum_is_kept_by_forces():
    """Springs and guard push in pairs: whatever the state, forces and viscosity add up to nothing."""
    network = small_network()
    velocities = np.random.default_rng(9).normal(size=(network.vertex_count, 2))
    at = Launched(network, shaken(network, scale=0.8), velocities, 0.02).evaluate_guard().gather_forces()
    for name in ("force", "driving_force"):
        np.testing.assert_allclose(at[name].sum(axis=0), 0.0, atol=1e-10 * np.abs(at[name]).max())


def test_pieces_of_a_launch_equal_the_whole():
    network = small_network()
    velocities = np.random.default_rng(2).normal(size=(network.vertex_count, 2))
    whole, parts = (
        Launched(network, shaken(network, scale=0.8), velocities, pieces=pieces)
        .evaluate_guard()
        .gather_forces()
        .advance()
        for pieces in (1, 2)
    )
    for name in whole.arrays:
        assert np.array_equal(whole[name], parts[name]), name


@pytest.mark.parametrize("coefficients", [(0.0, 0.0, 4.0 / 3.0), (0.0, 0.2, 2.4), (1.0, 1.0, 1.0)])
def test_velocity_and_its_change_have_their_factors(coefficients: tuple[float, float, float]):
    network = small_network()
    velocities = np.random.default_rng(7).normal(scale=1e-3, size=(network.vertex_count, 2))
    at = (
        Launched(network, shaken(network, scale=1.2), velocities, 0.02, coefficients=coefficients)
        .evaluate_guard()
        .gather_forces()
    )
    viscosity, carried, push = coefficients
    h, m, stiffness = 0.02, network.mass.numpy()[:, None], at["stiffness"][:, None]
    viscous = spring_sums(network, velocities) - velocities * spring_sums(network, np.ones_like(velocities))
    driving = at["force"] + viscosity * h * viscous
    # Without viscosity it is the force, and not written.
    written = driving if viscosity else np.zeros_like(driving)
    np.testing.assert_allclose(at["driving_force"], written, rtol=1e-9, atol=1e-9 * np.abs(driving).max())
    guess = driving * h / (m + h**2 * stiffness)
    change = (driving * h + h**2 * spring_sums(network, guess)) / (m + h**2 * stiffness)
    new = carried * velocities + push * change
    new *= np.minimum(1.0, at["reach"] / np.maximum(h * np.linalg.norm(new, axis=1), 1e-300))[:, None]
    np.testing.assert_allclose(at.advance()["velocity"], new, rtol=1e-7, atol=1e-8 * np.abs(new).max())
