"""Search directions and their forces, kept for `warpflat.solver.multigrid.acceleration`: on the host, or on a CUDA device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import warp as wp

from warpflat.core.arrays import FloatArray
from warpflat.core.launch import launch_each
from warpflat.core.sums import products, weighted_rows
from warpflat.kernels.reduce import add_share, subtract
from warpflat.solver.convergence import Vectors

__all__ = ["DeviceDirectionSpace", "DirectionSpace", "HostDirectionSpace", "make_direction_space"]

"""#V by 2, of NumPy or on a device."""


class DirectionSpace(Protocol):
    """What is done with vectors that are all of one kind."""

    def keep(self, values: Vectors, room: Vectors | None) -> Vectors:
        """A copy, in this room if there is any."""

    def difference(self, a: Vectors, b: Vectors) -> Vectors:
        """a - b, to be used as a way or as what is measured along one."""

    def join(self, way: Vectors, other: Vectors) -> None:
        """Let a way go on by another."""

    def moves(self, way: Vectors) -> bool:
        """Whether it leads anywhere."""

    def products(self, ways: Sequence[Vectors], by: Vectors) -> FloatArray:
        """#W, scalar products of each of them with one."""

    def put(self, share: FloatArray, ways: Sequence[Vectors], room: Vectors) -> None:
        """Make the room their sum, each times its share (#W)."""


class HostDirectionSpace:
    """On the host: ways in single precision, since only their direction counts."""

    def keep(self, values: Vectors, room: Vectors | None) -> Vectors:
        if room is None:
            return np.array(values)
        np.copyto(room, values)
        return room

    def difference(self, a: Vectors, b: Vectors) -> Vectors:
        # Rounded in the end only.
        return np.subtract(a, b, out=np.empty(a.shape, dtype=np.float32))

    def join(self, way: Vectors, other: Vectors) -> None:
        way += other

    def moves(self, way: Vectors) -> bool:
        return bool(way.any())

    def products(self, ways: Sequence[Vectors], by: Vectors) -> FloatArray:
        return products([way.ravel() for way in ways], [by.ravel()])[:, 0]

    def put(self, share: FloatArray, ways: Sequence[Vectors], room: Vectors) -> None:
        weighted_rows(share, [way.ravel() for way in ways], room.reshape(-1))


class DeviceDirectionSpace:
    """On a device."""

    def __init__(self, count: int, device: wp.Device) -> None:
        """Of so many vertices."""
        self._device, self._count = device, count

    def keep(self, values: Vectors, room: Vectors | None) -> Vectors:
        room = wp.empty(self._count, dtype=wp.vec2d, device=self._device) if room is None else room
        wp.copy(room, values)
        return room

    def difference(self, a: Vectors, b: Vectors) -> Vectors:
        found = wp.empty(self._count, dtype=wp.vec2d, device=self._device)
        launch_each(subtract, self._count, [a, b], [found], device=self._device)
        return found

    def join(self, way: Vectors, other: Vectors) -> None:
        launch_each(add_share, self._count, [1.0, other], [way], device=self._device)

    def moves(self, way: Vectors) -> bool:
        return bool(wp.utils.array_inner(way, way) > 0.0)

    def products(self, ways: Sequence[Vectors], by: Vectors) -> FloatArray:
        return np.array([wp.utils.array_inner(way, by) for way in ways])

    def put(self, share: FloatArray, ways: Sequence[Vectors], room: Vectors) -> None:
        room.zero_()
        for part, way in zip(share.tolist(), ways, strict=True):
            launch_each(add_share, self._count, [part, way], [room], device=self._device)


def make_direction_space(values: Vectors) -> DirectionSpace:
    """For vectors of this kind, and as many."""
    return DeviceDirectionSpace(len(values), values.device) if isinstance(values, wp.array) else HostDirectionSpace()
