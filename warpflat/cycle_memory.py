"""What the last few cycles of a relaxation say of where its energy is least."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warpflat.sums import products, weighted_rows

__all__ = ["CycleMemory", "Mark"]

FloatArray = NDArray[np.float64]

# Of so many cycles it is remembered where they have led, leaps and all.
_DEPTH = 2
# Least curvature, over what its parts would have apart, of a direction that cycles leave to be followed.
_SOUND = 1e-3


Mark = tuple[FloatArray, FloatArray]
"""#V by 2, a layout [m], and the forces there [N]."""
Way = tuple[NDArray[np.float32], NDArray[np.float32]]
"""#V by 2, a way from one layout to another [m], and how much the forces fell on it [N]. Only directions count: single precision does."""


class CycleMemory:
    """The last few cycles: where they led, and how much the forces fell on the way. In the plane of these ways the energy is known, to
    second order, and least somewhere (locally optimal conjugate gradients; Knyazev 2001).

    A strip beside a crack, say, bent by a coarse level as if it were stiffer or softer than it is, nears its place by the same
    share with each cycle.
    """

    def __init__(self, depth: int = _DEPTH) -> None:
        """Of so many cycles, besides the present one."""
        self._depth = depth
        self._last: Mark | None = None
        self._ways: list[Way] = []
        self._past: list[Way] = []

    def begin(self, mark: Mark) -> None:
        """A cycle begins here; the one before counts to here: its leap is part of it, and holds what cycles before it have told. The mark
        is copied."""
        if self._ways:
            self.come_to(mark)
            self._past.append(_joined(self._ways))
            del self._past[: -self._depth]
        self._keep(mark)
        self._ways = []

    def come_to(self, mark: Mark) -> None:
        """A part of the cycle has led here: each is a way of its own. The mark is copied."""
        assert self._last is not None
        self._ways.append((_difference(mark[0], self._last[0]), _difference(self._last[1], mark[1])))
        self._keep(mark)

    def _keep(self, mark: Mark) -> None:
        """In the room of the last one."""
        if self._last is None:
            self._last = np.array(mark[0]), np.array(mark[1])
        else:
            for kept, values in zip(self._last, mark, strict=True):
                np.copyto(kept, values)

    def lowest(self, room: FloatArray) -> bool:
        """Put the way from where the cycle has come to where the energy is least there, #V by 2 [m]; whether that can be told."""
        assert self._last is not None
        parts = [way for way in (*self._past, *self._ways) if way[0].any()]
        ways, falls = ([part[k].ravel() for part in parts] for k in (0, 1))
        curvature = products(ways, falls)
        curvature = 0.5 * (curvature + curvature.T)
        size = np.sqrt(np.abs(np.diag(curvature)))
        if not len(size) or not (size > 0.0).all():
            return False
        left = self._last[1]
        gain = products(ways, [left.ravel()])[:, 0]
        values, axes = np.linalg.eigh(curvature / np.outer(size, size))
        sound = values > _SOUND
        share = axes[:, sound] @ ((axes[:, sound].T @ (gain / size)) / values[sound]) / size
        weighted_rows(share, ways, room.reshape(-1))
        self._ways = [_joined(self._ways)]
        return True


def _difference(a: FloatArray, b: FloatArray) -> NDArray[np.float32]:
    """a - b, rounded in the end only."""
    return np.subtract(a, b, out=np.empty(a.shape, dtype=np.float32))


def _joined(ways: Sequence[Way]) -> Way:
    """One after the other, in the place of the first."""
    for way in ways[1:]:
        for total, more in zip(ways[0], way, strict=True):
            total += more
    return ways[0]
