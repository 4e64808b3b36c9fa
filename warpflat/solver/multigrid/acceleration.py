"""What the last few cycles of a relaxation say of where its energy is least."""

from __future__ import annotations

import numpy as np

from warpflat.solver.convergence import Mark, Vectors
from warpflat.solver.multigrid.direction_space import DirectionSpace, make_direction_space

__all__ = ["SubspaceAcceleration"]


# Of so many cycles it is remembered where they have led, leaps and all.
_DEPTH = 2
# Least curvature, over what its parts would have apart, of a direction that cycles leave to be followed.
_SOUND = 1e-3


"""#V by 2, a layout [m], and the forces there [N], where they are."""


class SubspaceAcceleration:
    """The last few cycles: where they led, and how much the forces fell along each way on each other. In the plane of these ways the energy
    is known, to second order, and least somewhere (locally optimal conjugate gradients; Knyazev 2001).

    Of a layout that is crushed to a point the forces are beyond all numbers, and so is what is worked out of them; `lowest` sees it.

    A strip beside a crack, say, bent by a coarse level as if it were stiffer or softer than it is, nears its place by the same
    share with each cycle.

    Attributes:
        past: how many cycles before the present one are remembered.
    """

    def __init__(self, depth: int = _DEPTH) -> None:
        """Of so many cycles, besides the present one."""
        self._depth = depth
        self._last: Mark | None = None
        self._algebra: DirectionSpace
        # Ways of cycles before, each as one, and then those of the present cycle's parts; of all of them the curvature, the fall of the
        # forces on one of them along another [N m].
        self._ways: list[Vectors] = []
        self.past = 0
        self._curvature = np.zeros((0, 0))

    @np.errstate(over="ignore", invalid="ignore")
    def begin(self, mark: Mark) -> None:
        """A cycle begins here; the one before counts to here: its leap is part of it, and holds what cycles before it have told. The mark
        is copied."""
        if len(self._ways) > self.past:
            self.come_to(mark)
            self._join()
            del self._ways[: -self._depth]
            self.past = len(self._ways)
            self._curvature = self._curvature[-self.past :, -self.past :]
        self._keep(mark)

    @np.errstate(over="ignore", invalid="ignore")
    def come_to(self, mark: Mark) -> None:
        """A part of the cycle has led here: each is a way of its own. The mark is copied."""
        assert self._last is not None
        fall = self._algebra.difference(self._last[1], mark[1])
        self._ways.append(self._algebra.difference(mark[0], self._last[0]))
        # How the forces fell on earlier ways along this one is the same as long as they fall in proportion.
        along, count = self._algebra.products(self._ways, fall), len(self._ways)
        curvature = np.empty((count, count))
        curvature[:-1, :-1] = self._curvature
        curvature[-1], curvature[:, -1] = along, along
        self._curvature = curvature
        self._keep(mark)

    def _join(self) -> None:
        """Make the parts of the present cycle one."""
        parts = len(self._ways) - self.past
        for way in self._ways[self.past + 1 :]:
            self._algebra.join(self._ways[self.past], way)
        del self._ways[self.past + 1 :]
        joined = np.zeros((self.past + 1, self.past + parts))
        joined[:-1, : self.past] = np.eye(self.past)
        joined[-1, self.past :] = 1.0
        self._curvature = joined @ self._curvature @ joined.T

    def _keep(self, mark: Mark) -> None:
        """In the room of the last one."""
        if self._last is None:
            self._algebra = make_direction_space(mark[0])
        layout, forces = self._last or (None, None)
        self._last = self._algebra.keep(mark[0], layout), self._algebra.keep(mark[1], forces)

    @np.errstate(over="ignore", invalid="ignore")
    def lowest(self, room: Vectors) -> bool:
        """Put the way from where the cycle has come to where the energy is least there, #V by 2 [m]; whether that can be told."""
        assert self._last is not None
        moved = [number for number, way in enumerate(self._ways) if self._algebra.moves(way)]
        ways, curvature = [self._ways[number] for number in moved], self._curvature[np.ix_(moved, moved)]
        size = np.sqrt(np.abs(np.diag(curvature)))
        if not len(size) or not (size > 0.0).all() or not np.isfinite(curvature).all():
            return False
        gain = self._algebra.products(ways, self._last[1])
        values, axes = np.linalg.eigh(curvature / np.outer(size, size))
        sound = values > _SOUND
        share = axes[:, sound] @ ((axes[:, sound].T @ (gain / size)) / values[sound]) / size
        self._algebra.put(share, ways, room)
        self._join()
        return True
