"""Ties: forces against the energy's finite difference, viscosity against the force's change along the velocity."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from devices import DEVICE
from numpy.typing import NDArray
from warpflat.kernels.constraints import LENGTHS, LINEAR, STRAIGHT, Seams, compute_seam_residuals, evaluate_seams

POSITIONS = np.array([[0.0, 0.0], [0.11, 0.02], [0.5, 0.1], [0.52, 0.19], [0.1, 0.12]])
# Two seams, one with ease; an edge of a fixed length; a vertex on a line through two others; a mirror image; one vertex alone.
ENDS = np.array([[0, 1, 2, 3], [1, 4, 2, 3], [2, 4, 2, 4], [4, 0, 3, 4], [1, 3, 1, 1], [2, 2, 2, 2]], dtype=np.int32)
KIND = np.array([LENGTHS, LENGTHS, LENGTHS, STRAIGHT, LINEAR, LINEAR], dtype=np.int32)
RATIO = np.array([1.0, 1.2, 0.0, 0.0, 0.0, 0.0])
TARGET = np.array([0.0, 0.0, 0.37, 0.001, 0.6, 0.45])
STIFFNESS = np.array([300.0, 500.0, 200.0, 400.0, 250.0, 350.0])
OFFSET = np.array([0.0, 0.004, -0.001, 0.002, 0.003, -0.002])
LEVER = np.zeros((6, 4, 2))
LEVER[4, :2] = [0.8, 0.6]
LEVER[5, 0] = [0.6, -0.8]
COUNT = len(ENDS)


def seams() -> Seams:
    made = Seams()
    made.ends = wp.array(ENDS, dtype=wp.vec4i, device=DEVICE)
    made.kind = wp.array(KIND, dtype=wp.int32, device=DEVICE)
    made.ratio = wp.array(RATIO, dtype=wp.float64, device=DEVICE)
    made.target = wp.array(TARGET, dtype=wp.float64, device=DEVICE)
    made.coefficient = wp.array(LEVER.reshape(-1, 2), dtype=wp.vec2d, device=DEVICE)
    made.stiffness = wp.array(STIFFNESS, dtype=wp.float64, device=DEVICE)
    made.offset = wp.array(OFFSET, dtype=wp.float64, device=DEVICE)
    return made


def misses(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    x = positions[ENDS]
    lengths = [np.linalg.norm(x[:, k + 1] - x[:, k], axis=1) for k in (0, 2)]
    chord, away = x[:, 2] - x[:, 1], x[:, 0] - x[:, 1]
    cross = (chord[:, 0] * away[:, 1] - chord[:, 1] * away[:, 0]) / np.maximum(np.linalg.norm(chord, axis=1), 1e-300)
    linear = np.einsum("pjk,pjk->p", LEVER, x)
    of_kind = {LENGTHS: lengths[0] - RATIO * lengths[1], STRAIGHT: cross, LINEAR: linear}
    return np.array([of_kind[kind][p] for p, kind in enumerate(KIND.tolist())]) - TARGET


def energy(positions: NDArray[np.float64]) -> float:
    return float((0.5 * STIFFNESS * (misses(positions) + OFFSET) ** 2).sum())


def launch(positions: NDArray[np.float64], velocities: NDArray[np.float64], time_step: float = 0.01):
    force, viscosity = (wp.zeros(4 * COUNT, dtype=wp.vec2d, device=DEVICE) for _ in range(2))
    stiffness = wp.zeros(4 * COUNT, dtype=wp.float64, device=DEVICE)
    at, moving = (wp.array(a, dtype=wp.vec2d, device=DEVICE) for a in (positions, velocities))
    wp.launch(
        evaluate_seams,
        dim=COUNT,
        inputs=[at, moving, seams(), time_step, 0],
        outputs=[force, viscosity, stiffness],
        device=DEVICE,
    )

    def gathered(slots: NDArray[np.float64]) -> NDArray[np.float64]:
        total = np.zeros((len(positions), *slots.shape[1:]))
        np.add.at(total, ENDS.ravel(), slots)
        return total

    return gathered(force.numpy()), gathered(viscosity.numpy()), stiffness.numpy().reshape(-1, 4)


def test_forces_are_minus_the_gradient_of_the_energy():
    force, _, _ = launch(POSITIONS, np.zeros_like(POSITIONS))
    for vertex in range(len(POSITIONS)):
        for axis in range(2):
            moved = [POSITIONS.copy(), POSITIONS.copy()]
            moved[0][vertex, axis] += 1e-7
            moved[1][vertex, axis] -= 1e-7
            slope = (energy(moved[0]) - energy(moved[1])) / 2e-7
            assert force[vertex, axis] == pytest.approx(-slope, rel=1e-6, abs=1e-6)


def test_viscosity_is_h_times_k_times_the_rate_of_the_miss():
    velocities = np.random.default_rng(0).normal(size=POSITIONS.shape)
    _, viscosity, _ = launch(POSITIONS, velocities, time_step=0.5)
    rate = (misses(POSITIONS + 1e-7 * velocities) - misses(POSITIONS - 1e-7 * velocities)) / 2e-7
    power = float((viscosity * velocities).sum())
    assert power == pytest.approx(-0.5 * float((STIFFNESS * rate**2).sum()), rel=1e-6)


def test_a_layout_that_moves_as_a_whole_feels_only_what_ties_it_to_a_place():
    _, viscosity, _ = launch(POSITIONS, np.tile([3.0, -2.0], (len(POSITIONS), 1)), time_step=0.5)
    pulled = 0.5 * STIFFNESS[4:] * np.array([2 * (0.8 * 3.0 - 0.6 * 2.0), 0.6 * 3.0 + 0.8 * 2.0])
    expected = np.zeros_like(POSITIONS)
    expected[[1, 3]] = -pulled[0] * np.array([0.8, 0.6])
    expected[2] = -pulled[1] * np.array([0.6, -0.8])
    np.testing.assert_allclose(viscosity, expected, atol=1e-12)


def test_the_stiffness_bounds_the_curvature_when_all_ends_move():
    """Gauss-Newton part of the energy's second derivative, against the diagonal of the step."""
    _, _, stiffness = launch(POSITIONS, np.zeros_like(POSITIONS))
    rows = np.zeros((COUNT, POSITIONS.size))
    for k in range(POSITIONS.size):
        moved = [POSITIONS.copy().ravel(), POSITIONS.copy().ravel()]
        moved[0][k] += 1e-7
        moved[1][k] -= 1e-7
        rows[:, k] = (misses(moved[0].reshape(-1, 2)) - misses(moved[1].reshape(-1, 2))) / 2e-7
    at_vertex = np.bincount(ENDS.ravel(), stiffness.ravel())
    scaled = rows / np.sqrt(np.repeat(at_vertex, 2))
    assert np.linalg.eigvalsh(scaled.T @ np.diag(STIFFNESS) @ scaled).max() < 2.0
    # An end that takes no part, or is a vertex that does already, has no gradient.
    size = np.linalg.norm(rows.reshape(COUNT, -1, 2), axis=2)
    for p in range(COUNT):
        found = np.bincount(ENDS[p], stiffness[p], minlength=len(POSITIONS))
        np.testing.assert_allclose(found, 0.75 * STIFFNESS[p] * size[p] * size[p].sum(), rtol=1e-6)


def test_misses_and_edges_of_no_length():
    found = wp.zeros(COUNT, dtype=wp.float64, device=DEVICE)
    wp.launch(
        compute_seam_residuals,
        dim=COUNT,
        inputs=[wp.array(POSITIONS, dtype=wp.vec2d, device=DEVICE), seams(), 0],
        outputs=[found],
        device=DEVICE,
    )
    np.testing.assert_allclose(found.numpy(), misses(POSITIONS))
    force, _, _ = launch(np.zeros_like(POSITIONS), np.zeros_like(POSITIONS))
    assert np.isfinite(force).all()
