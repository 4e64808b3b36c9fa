"""What the last few cycles of a relaxation say of where its energy is least."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["CycleMemory"]

FloatArray = NDArray[np.float64]

# Least curvature, over what its parts would have apart, of a direction that cycles leave to be followed.
_SOUND = 1e-3


class CycleMemory:
    """The last few cycles: how far they led, and how much the forces fell on the way. In the plane of these ways the energy is known,
    to second order, and least somewhere (locally optimal conjugate gradients; Knyazev 2001).

    A strip beside a crack, say, bent by a coarse level as if it were stiffer or softer than it is, nears its place by the same
    share with each cycle.
    """

    def __init__(self, depth: int) -> None:
        """Of so many cycles."""
        self._depth = depth
        self._ways: list[FloatArray] = []
        self._falls: list[FloatArray] = []

    def lowest(self, begin: FloatArray, force: FloatArray, end: FloatArray, left: FloatArray) -> FloatArray | None:
        """#V by 2, where the energy is least [m]; None where that cannot be told.

        Args:
            begin, end: #V by 2, of the last cycle [m].
            force, left: #V by 2, forces at its begin and end [N].
        """
        self._ways.append((end - begin).ravel())
        self._falls.append((force - left).ravel())
        del self._ways[: -self._depth], self._falls[: -self._depth]
        ways = np.stack(self._ways)
        curvature = ways @ np.stack(self._falls).T
        curvature = 0.5 * (curvature + curvature.T)
        size = np.sqrt(np.abs(np.diag(curvature)))
        if not (size > 0.0).all():
            return None
        values, axes = np.linalg.eigh(curvature / np.outer(size, size))
        sound = values > _SOUND
        share = axes[:, sound] @ ((axes[:, sound].T @ (ways @ left.ravel() / size)) / values[sound]) / size
        return end + (share @ ways).reshape(end.shape)
