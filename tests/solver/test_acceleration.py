"""What cycles say of where a quadratic energy is least, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from warpflat.solver.convergence import Mark
from warpflat.solver.multigrid.acceleration import SubspaceAcceleration

FloatArray = NDArray[np.float64]


class Bowl:
    """1/2 (x - x0)^T A (x - x0) of twelve numbers, six vertices."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        root = rng.normal(size=(12, 12))
        self.matrix, self.lowest = root @ root.T + np.eye(12), rng.normal(size=12)

    def mark(self, place: FloatArray) -> Mark:
        return place.reshape(-1, 2), (self.matrix @ (self.lowest - place)).reshape(-1, 2)

    def least_along(self, begin: FloatArray, ways: FloatArray) -> FloatArray:
        """Where the energy is least in the plane of the ways (rows) through a place."""
        curvature = ways @ self.matrix @ ways.T
        return begin + np.linalg.solve(curvature, ways @ self.matrix @ (self.lowest - begin)) @ ways


@pytest.mark.parametrize("seed", range(3))
def test_the_energy_is_least_where_the_parts_of_a_cycle_say(seed: int) -> None:
    bowl, rng = Bowl(seed), np.random.default_rng(10 + seed)
    ways, place = rng.normal(size=(3, 12)), np.zeros(12)
    memory = SubspaceAcceleration()
    memory.begin(bowl.mark(place))
    for way in ways:
        place = place + way
        memory.come_to(bowl.mark(place))
    room = np.empty((6, 2))
    assert memory.lowest(room)
    np.testing.assert_allclose(place + room.ravel(), bowl.least_along(place, ways), atol=1e-5)


@pytest.mark.parametrize("depth", [1, 2])
def test_cycles_before_count_as_one_way_each_and_older_ones_are_forgotten(depth: int) -> None:
    bowl, rng = Bowl(7), np.random.default_rng(8)
    memory, place, cycles = SubspaceAcceleration(depth), np.zeros(12), []
    for _ in range(4):
        begin = place
        memory.begin(bowl.mark(place))
        parts = rng.normal(size=(2, 12))
        for part in parts:
            place = place + part
            memory.come_to(bowl.mark(place))
        room = np.empty((6, 2))
        assert memory.lowest(room)
        ways = np.vstack([*cycles[len(cycles) - depth :], parts])
        np.testing.assert_allclose(place + room.ravel(), bowl.least_along(place, ways), atol=1e-4)
        # The leap is part of the cycle.
        place = place + 0.5 * room.ravel()
        cycles.append(place - begin)


def test_marks_are_copied_and_a_way_that_leads_nowhere_tells_nothing() -> None:
    bowl = Bowl(3)
    memory, mark = SubspaceAcceleration(), bowl.mark(np.zeros(12))
    memory.begin(mark)
    memory.come_to(mark)
    assert not memory.lowest(np.empty((6, 2)))
    memory.begin(mark)
    mark[0][:], mark[1][:] = np.nan, np.nan
    memory.come_to(bowl.mark(np.ones(12)))
    room = np.empty((6, 2))
    assert memory.lowest(room)
    assert np.isfinite(room).all()
