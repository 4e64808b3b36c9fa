"""Pieces held upright: turned so that their chord points up, without turning, and with the load that balances their torque."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.flat.solver.grain import GrainAlignment, hold_grain, remove_rotation


def two_pieces() -> tuple[list[GrainAlignment], dict[str, np.ndarray]]:
    rng = np.random.default_rng(2)
    arrays = {name: rng.normal(size=(11, 2)) for name in ("position", "velocity", "force")}
    pieces = [
        GrainAlignment(lower=1, upper=4, vertices=slice(0, 6)),
        GrainAlignment(lower=9, upper=7, vertices=np.array([10, 7, 6, 9, 8], dtype=np.int32), direction=(0.6, -0.8)),
    ]
    return pieces, arrays | {"weight": rng.uniform(0.5, 2.0, 11)}


def held(pieces: list[GrainAlignment], given: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and load, with a load before that is not part of the force of the cloth."""
    position, velocity, load = given["position"].copy(), given["velocity"].copy(), np.full((11, 2), 0.3)
    hold_grain(pieces, position, velocity, load, given["force"] + load, given["weight"])
    return position, velocity, load


def without_turning(
    pieces: list[GrainAlignment], position: np.ndarray, force: np.ndarray, weight: np.ndarray
) -> np.ndarray:
    left = force.copy()
    remove_rotation(pieces, position, left, weight)
    return left


def turning(position: np.ndarray, vectors: np.ndarray, weight: np.ndarray) -> float:
    """Sum of arm x vector about the weighted mean."""
    arm = position - weight @ position / weight.sum()
    return float((arm[:, 0] * vectors[:, 1] - arm[:, 1] * vectors[:, 0]).sum())


def test_a_piece_is_turned_as_a_whole_and_its_chord_points_in_its_direction():
    pieces, given = two_pieces()
    position, _, _ = held(pieces, given)
    for piece in pieces:
        chord = position[piece.upper] - position[piece.lower]
        np.testing.assert_allclose(chord / np.linalg.norm(chord), piece.direction, atol=1e-12)
        before, after = given["position"][piece.vertices], position[piece.vertices]
        np.testing.assert_allclose(after.mean(axis=0), before.mean(axis=0), atol=1e-12)
        np.testing.assert_allclose(
            np.linalg.norm(after[:, None] - after, axis=2), np.linalg.norm(before[:, None] - before, axis=2), atol=1e-12
        )


def test_the_load_balances_the_torque_and_velocities_turn_nothing():
    pieces, given = two_pieces()
    position, velocity, load = held(pieces, given)
    for piece in pieces:
        here = piece.vertices
        c, s = np.linalg.lstsq(
            np.column_stack([given["position"][here] - given["position"][here].mean(axis=0)]),
            position[here] - position[here].mean(axis=0),
            rcond=None,
        )[0][0]
        turned = given["force"][here] @ np.array([[c, s], [-s, c]])
        weight = given["weight"][here]
        assert abs(turning(position[here], turned, weight)) > 0.1
        assert turning(position[here], turned + load[here], weight) == pytest.approx(0.0, abs=1e-12)
        np.testing.assert_allclose(load[here].sum(axis=0), 0.0, atol=1e-12)
        assert turning(position[here], weight[:, None] * velocity[here], weight) == pytest.approx(0.0, abs=1e-12)


def test_forces_without_turning_are_left_as_they_are_otherwise():
    pieces, given = two_pieces()
    position, force, weight = given["position"], given["force"], given["weight"]
    left = without_turning(pieces[:1], position, force, weight)
    np.testing.assert_array_equal(left[6:], force[6:])
    assert turning(position[:6], left[:6], weight[:6]) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(left.sum(axis=0), force.sum(axis=0), atol=1e-12)
    np.testing.assert_allclose(without_turning(pieces[:1], position, left, weight), left, atol=1e-12)
