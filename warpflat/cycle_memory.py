"""What the last few cycles of a relaxation say of where its energy is least."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

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


class CycleMemory:
    """The last few cycles: where they led, and how much the forces fell on the way. In the plane of these ways the energy is known, to
    second order, and least somewhere (locally optimal conjugate gradients; Knyazev 2001).

    A strip beside a crack, say, bent by a coarse level as if it were stiffer or softer than it is, nears its place by the same
    share with each cycle.
    """

    def __init__(self, depth: int = _DEPTH) -> None:
        """Of so many cycles, besides the one that has just ended."""
        self._depth = depth
        self._begin: Mark | None = None
        self._past: list[Mark] = []

    def lowest(self, marks: Sequence[Mark]) -> FloatArray | None:
        """#V by 2, the way from where the last cycle has ended to where the energy is least [m]; None where that cannot be told.

        Args:
            marks: of the last cycle, its begin, where its parts have met, and its end: each part is a way of its own. Of those in
                between nothing is left afterwards.
        """
        begin = marks[0]
        if self._begin is not None:
            # A cycle before counts to where the next began: its leap is part of it, and holds what cycles before it have told.
            self._past.append(_between(self._begin, begin))
            del self._past[: -self._depth]
        self._begin = begin
        parts = [*self._past, _between(begin, marks[1])]
        for first, second in pairwise(marks[1:]):
            # In the place of the first, which nobody needs any more.
            np.subtract(second[0], first[0], out=first[0])
            np.subtract(first[1], second[1], out=first[1])
            parts.append(first)
        parts = [part for part in parts if part[0].any()]
        ways, falls = ([part[k].ravel() for part in parts] for k in (0, 1))
        curvature = products(ways, falls)
        curvature = 0.5 * (curvature + curvature.T)
        size = np.sqrt(np.abs(np.diag(curvature)))
        if not len(size) or not (size > 0.0).all():
            return None
        left = marks[-1][1]
        gain = products(ways, [left.ravel()])[:, 0]
        values, axes = np.linalg.eigh(curvature / np.outer(size, size))
        sound = values > _SOUND
        share = axes[:, sound] @ ((axes[:, sound].T @ (gain / size)) / values[sound]) / size
        return weighted_rows(share, ways).reshape(left.shape)


def _between(first: Mark, second: Mark) -> Mark:
    """The way from one to the other, and how much the forces fell."""
    return second[0] - first[0], first[1] - second[1]
