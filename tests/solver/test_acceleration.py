"""What cycles say of where a quadratic energy is least, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from warpflat.solver.convergence import Iterate
from warpflat.solver.multigrid.acceleration import SubspaceAcceleration

FloatArray = NDArray[np.float64]


class Bowl:
    """1/2 (x - x0)^T A (x - x0) of twelve numbers, six vertices."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        root = rng.normal(size=(12, 12))
        self.matrix, self.lowest = root @ root.T + np.eye(12), rng.normal(size=12)

    def iterate(self, place: FloatArray) -> Iterate:
        return place.reshape(-1, 2), (self.matrix @ (self.lowest - place)).reshape(-1, 2)

    def least_along(self, begin: FloatArray, directions: FloatArray) -> FloatArray:
        """Where the energy is least in the plane of the directions (rows) through a place."""
        curvature = directions @ self.matrix @ directions.T
        return begin + np.linalg.solve(curvature, directions @ self.matrix @ (self.lowest - begin)) @ directions


@pytest.mark.parametrize("seed", range(3))
def test_the_energy_is_least_where_the_parts_of_a_cycle_say(seed: int) -> None:
    bowl, rng = Bowl(seed), np.random.default_rng(10 + seed)
    directions, place = rng.normal(size=(3, 12)), np.zeros(12)
    memory = SubspaceAcceleration()
    memory.begin_cycle(bowl.iterate(place))
    for direction in directions:
        place = place + direction
        memory.add_iterate(bowl.iterate(place))
    out = np.empty((6, 2))
    assert memory.minimise_in_subspace(out)
    np.testing.assert_allclose(place + out.ravel(), bowl.least_along(place, directions), atol=1e-5)


@pytest.mark.parametrize("depth", [1, 2])
def test_cycles_before_count_as_one_way_each_and_older_ones_are_forgotten(depth: int) -> None:
    bowl, rng = Bowl(7), np.random.default_rng(8)
    memory, place, cycles = SubspaceAcceleration(depth), np.zeros(12), []
    for _ in range(4):
        begin = place
        memory.begin_cycle(bowl.iterate(place))
        parts = rng.normal(size=(2, 12))
        for part in parts:
            place = place + part
            memory.add_iterate(bowl.iterate(place))
        out = np.empty((6, 2))
        assert memory.minimise_in_subspace(out)
        directions = np.vstack([*cycles[len(cycles) - depth :], parts])
        np.testing.assert_allclose(place + out.ravel(), bowl.least_along(place, directions), atol=1e-4)
        # The leap is part of the cycle.
        place = place + 0.5 * out.ravel()
        cycles.append(place - begin)


def test_iterates_are_copied_and_a_zero_direction_gives_no_minimum() -> None:
    bowl = Bowl(3)
    memory, iterate = SubspaceAcceleration(), bowl.iterate(np.zeros(12))
    memory.begin_cycle(iterate)
    memory.add_iterate(iterate)
    assert not memory.minimise_in_subspace(np.empty((6, 2)))
    memory.begin_cycle(iterate)
    iterate[0][:], iterate[1][:] = np.nan, np.nan
    memory.add_iterate(bowl.iterate(np.ones(12)))
    out = np.empty((6, 2))
    assert memory.minimise_in_subspace(out)
    assert np.isfinite(out).all()
