"""Linear algebra of search directions for `warpflat.solver.multigrid.acceleration`, on the host or on a CUDA device."""

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


class DirectionSpace(Protocol):
    """Operations on vectors (#V by 2) that all lie on the host, or all on one device."""

    def copy(self, values: Vectors, out: Vectors | None) -> Vectors:
        """Return a copy, written to `out` if given."""

    def difference(self, a: Vectors, b: Vectors) -> Vectors:
        """Return a - b as a new vector."""

    def add_to(self, direction: Vectors, other: Vectors) -> None:
        """Add another direction to a direction in place."""

    def is_nonzero(self, direction: Vectors) -> bool:
        """Return whether a direction has an entry other than zero."""

    def products(self, directions: Sequence[Vectors], vector: Vectors) -> FloatArray:
        """Return the scalar product of each direction with a vector, #D."""

    def combine(self, weights: FloatArray, directions: Sequence[Vectors], out: Vectors) -> None:
        """Write the sum of the directions, each times its weight (#D), to `out`."""


class HostDirectionSpace:
    """Operations on NumPy arrays; differences are in single precision, since only their direction counts."""

    def copy(self, values: Vectors, out: Vectors | None) -> Vectors:
        if out is None:
            return np.array(values)
        np.copyto(out, values)
        return out

    def difference(self, a: Vectors, b: Vectors) -> Vectors:
        # Subtracted in double precision, and rounded then.
        return np.subtract(a, b, out=np.empty(a.shape, dtype=np.float32))

    def add_to(self, direction: Vectors, other: Vectors) -> None:
        direction += other

    def is_nonzero(self, direction: Vectors) -> bool:
        return bool(direction.any())

    def products(self, directions: Sequence[Vectors], vector: Vectors) -> FloatArray:
        return products([direction.ravel() for direction in directions], [vector.ravel()])[:, 0]

    def combine(self, weights: FloatArray, directions: Sequence[Vectors], out: Vectors) -> None:
        weighted_rows(weights, [direction.ravel() for direction in directions], out.reshape(-1))


class DeviceDirectionSpace:
    """Operations on Warp arrays of vec2d."""

    def __init__(self, count: int, device: wp.Device) -> None:
        """Prepare operations on vectors of `count` entries."""
        self._device, self._count = device, count

    def copy(self, values: Vectors, out: Vectors | None) -> Vectors:
        out = wp.empty(self._count, dtype=wp.vec2d, device=self._device) if out is None else out
        wp.copy(out, values)
        return out

    def difference(self, a: Vectors, b: Vectors) -> Vectors:
        result = wp.empty(self._count, dtype=wp.vec2d, device=self._device)
        launch_each(subtract, self._count, [a, b], [result], device=self._device)
        return result

    def add_to(self, direction: Vectors, other: Vectors) -> None:
        launch_each(add_share, self._count, [1.0, other], [direction], device=self._device)

    def is_nonzero(self, direction: Vectors) -> bool:
        return bool(wp.utils.array_inner(direction, direction) > 0.0)

    def products(self, directions: Sequence[Vectors], vector: Vectors) -> FloatArray:
        return np.array([wp.utils.array_inner(direction, vector) for direction in directions])

    def combine(self, weights: FloatArray, directions: Sequence[Vectors], out: Vectors) -> None:
        out.zero_()
        for weight, direction in zip(weights.tolist(), directions, strict=True):
            launch_each(add_share, self._count, [weight, direction], [out], device=self._device)


def make_direction_space(values: Vectors) -> DirectionSpace:
    """Return the operations on vectors of the kind and length of `values`."""
    return DeviceDirectionSpace(len(values), values.device) if isinstance(values, wp.array) else HostDirectionSpace()
