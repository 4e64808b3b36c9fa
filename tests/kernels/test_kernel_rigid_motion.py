"""How pieces turn, against NumPy's complex numbers."""

from __future__ import annotations

import numpy as np
import warp as wp
from devices import DEVICE
from small_networks import vec2
from warpflat.kernels.implicit import count_braked, stop_braked
from warpflat.kernels.rigid_motion import MOMENTS, Turn, largest_force_of_blocks, sum_moments, turn_pieces

from warpflat.core.launch import launch_each

COUNT = 30
BEGIN = np.array([0, 12, 13, 30], dtype=np.int32)
PIECE = np.repeat([0, -1, 1], [13, 5, 12]).astype(np.int32)


def double(values: np.ndarray) -> wp.array:
    return wp.array(np.ascontiguousarray(values), dtype=wp.float64, device=DEVICE)


def whole(values: np.ndarray) -> wp.array:
    return wp.array(values, dtype=wp.int32, device=DEVICE)


def vectors(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(count, 2))


def number(values: np.ndarray) -> np.ndarray:
    return values @ [1.0, 1.0j]


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (number(a).conj() * number(b)).imag


def test_moments_of_blocks():
    x, v, f, load = (vectors(COUNT, seed) for seed in range(4))
    weight = np.random.default_rng(5).uniform(1.0, 2.0, COUNT)
    got = double(np.full(3 * MOMENTS, np.nan))
    given = [*map(vec2, (x, v, f, load)), double(weight), whole(BEGIN)]
    launch_each(sum_moments, 3, given, [got], device=DEVICE)
    w = weight[:, None]
    columns = [w, w * x, (w * x * x).sum(axis=1), x, f - load, cross(x, f - load), w * v, cross(x, w * v)]
    wished = np.add.reduceat(np.column_stack(columns), BEGIN[:-1])
    assert wished.shape == (3, MOMENTS)
    np.testing.assert_allclose(got.numpy().reshape(3, -1), wished, rtol=1e-12, atol=1e-13)


def turn_of_two() -> tuple[Turn, np.ndarray]:
    turn, by = Turn(), np.exp([0.4j, -1.1j])
    turn.centre, turn.middle = vec2(vectors(2, 7)), vec2(vectors(2, 8))
    turn.by = vec2(np.column_stack([by.real, by.imag]))
    turn.spin, turn.torque = double(np.array([0.3, -0.2])), double(np.array([0.05, 0.6]))
    return turn, by


def test_pieces_turn_and_are_held():
    turn, by = turn_of_two()
    x, v, load = (vectors(COUNT, seed) for seed in range(3))
    weight = np.random.default_rng(5).uniform(1.0, 2.0, COUNT)
    got = vec2(x), vec2(v), vec2(load)
    launch_each(turn_pieces, COUNT, [double(weight), whole(PIECE), turn], got, device=DEVICE)
    held = PIECE >= 0
    p = PIECE[held]
    centre, middle = number(turn.centre.numpy())[p], number(turn.middle.numpy())[p]
    arm = 1.0j * (number(x)[held] - middle)
    wished = [number(values).copy() for values in (x, v, load)]
    wished[0][held] = centre + by[p] * (wished[0][held] - centre)
    wished[1][held] = by[p] * (wished[1][held] - turn.spin.numpy()[p] * arm)
    wished[2][held] = -turn.torque.numpy()[p] * weight[held] * arm * by[p]
    for made, values in zip(got, wished, strict=True):
        np.testing.assert_allclose(number(made.numpy()), values, rtol=0.0, atol=1e-13)


def test_the_strongest_force_but_for_turning():
    turn, _ = turn_of_two()
    x, f, load = (vectors(COUNT, seed) for seed in range(3))
    weight = np.random.default_rng(5).uniform(1.0, 2.0, COUNT)
    got = double(np.full(3, np.nan))
    given = [*map(vec2, (x, f, load)), double(weight), whole(PIECE), turn, whole(BEGIN)]
    launch_each(largest_force_of_blocks, 3, given, [got], device=DEVICE)
    arm = 1.0j * (number(x) - number(turn.middle.numpy())[PIECE])
    force = number(f - load) - np.where(PIECE >= 0, turn.torque.numpy()[PIECE] * weight * arm, 0.0)
    np.testing.assert_allclose(got.numpy(), -np.maximum.reduceat(abs(force) ** 2, BEGIN[:-1]), rtol=1e-13)


def test_braked_pieces_stop_and_are_counted():
    piece, power = np.repeat([0, 1, 2], 10).astype(np.int32), np.array([0.1, -1e-12, 0.0])
    mass, k = np.random.default_rng(5).uniform(1.0, 2.0, (2, COUNT))
    force, *before = (vectors(COUNT, seed) for seed in range(4))
    got = [vec2(values) for values in before]
    given = [whole(piece), double(power), double(mass), vec2(force), double(k), 0.1]
    launch_each(stop_braked, COUNT, given, got, device=DEVICE)
    braked = (piece == 1)[:, None]
    there = [np.zeros((COUNT, 2)), force, force * (0.1 / (mass + 0.01 * k))[:, None]]
    for made, values, stopped in zip(got, before, there, strict=True):
        np.testing.assert_allclose(made.numpy(), np.where(braked, stopped, values), rtol=1e-14)
    count = whole(np.array([4, 5, 6]))
    launch_each(count_braked, 3, [double(power)], [count], device=DEVICE)
    assert count.numpy().tolist() == [4, 6, 6]
