"""Acceleration of a cycle: minimisation of the energy over the subspace of the corrections of the last few cycles."""

from __future__ import annotations

import numpy as np

from warpflat.solver.convergence import Iterate, Vectors
from warpflat.solver.multigrid.direction_space import DirectionSpace, make_direction_space

__all__ = ["SubspaceAcceleration"]


# Past cycles whose corrections, accelerated steps included, are directions of the subspace.
_DEPTH = 2
# Least curvature of a direction of the subspace, over that of its parts on their own; others are left out.
_LEAST_CURVATURE = 1e-3


class SubspaceAcceleration:
    """Minimisation over the corrections of the present cycle and of those before.

    The forces at the iterates tell the curvature of the energy in the space of the corrections between them. There the
    energy is known to second order, and so is its minimum (locally optimal conjugate gradients; Knyazev 2001). This
    accelerates what converges by the same factor in each cycle, such as a strip beside a crack whose stiffness against
    bending the coarse level gets wrong.

    A layout that is crushed to a point may have forces that overflow; `minimise_in_subspace` then reports no minimum.

    Attributes:
        past: number of past cycles in the subspace.
    """

    def __init__(self, depth: int = _DEPTH) -> None:
        """Keep the corrections of `depth` cycles besides the present one."""
        self._depth = depth
        self._last: Iterate | None = None
        self._algebra: DirectionSpace
        # The correction of each past cycle, then those of the present cycle's parts; and the curvature of the energy
        # along each pair: minus the change of the forces along one, times the other [N m].
        self._directions: list[Vectors] = []
        self._curvature = np.zeros((0, 0))
        self.past = 0

    @np.errstate(over="ignore", invalid="ignore")
    def begin_cycle(self, iterate: Iterate) -> None:
        """Begin a cycle at an iterate, which is copied.

        All corrections since the last beginning, accelerated step included, become one direction.
        """
        if len(self._directions) > self.past:
            self.add_iterate(iterate)
            self._merge_present_cycle()
            del self._directions[: -self._depth]
            self.past = len(self._directions)
            self._curvature = self._curvature[-self.past :, -self.past :]
        self._set_last(iterate)

    @np.errstate(over="ignore", invalid="ignore")
    def add_iterate(self, iterate: Iterate) -> None:
        """Add the correction from the last iterate to this one as a direction; the iterate is copied."""
        assert self._last is not None
        force_drop = self._algebra.difference(self._last[1], iterate[1])
        self._directions.append(self._algebra.difference(iterate[0], self._last[0]))
        # The curvature is symmetric as far as the forces are linear.
        row, count = self._algebra.products(self._directions, force_drop), len(self._directions)
        curvature = np.empty((count, count))
        curvature[:-1, :-1] = self._curvature
        curvature[-1], curvature[:, -1] = row, row
        self._curvature = curvature
        self._set_last(iterate)

    @np.errstate(over="ignore", invalid="ignore")
    def minimise_in_subspace(self, out: Vectors) -> bool:
        """Compute the step from the last iterate to the minimum in the subspace.

        Args:
            out: #V by 2, gets the step [m].

        Returns:
            Whether there is a minimum.
        """
        assert self._last is not None
        moving = [k for k, direction in enumerate(self._directions) if self._algebra.is_nonzero(direction)]
        directions, curvature = [self._directions[k] for k in moving], self._curvature[np.ix_(moving, moving)]
        scale = np.sqrt(np.abs(np.diag(curvature)))
        if not len(scale) or not (scale > 0.0).all() or not np.isfinite(curvature).all():
            return False
        slope = self._algebra.products(directions, self._last[1])
        values, axes = np.linalg.eigh(curvature / np.outer(scale, scale))
        curved = values > _LEAST_CURVATURE
        weights = axes[:, curved] @ ((axes[:, curved].T @ (slope / scale)) / values[curved]) / scale
        self._algebra.combine(weights, directions, out)
        self._merge_present_cycle()
        return True

    def _merge_present_cycle(self) -> None:
        """Merge the directions of the present cycle's parts into one."""
        parts = len(self._directions) - self.past
        for direction in self._directions[self.past + 1 :]:
            self._algebra.add_to(self._directions[self.past], direction)
        del self._directions[self.past + 1 :]
        merge = np.zeros((self.past + 1, self.past + parts))
        merge[:-1, : self.past] = np.eye(self.past)
        merge[-1, self.past :] = 1.0
        self._curvature = merge @ self._curvature @ merge.T

    def _set_last(self, iterate: Iterate) -> None:
        """Copy an iterate into the memory of the last one."""
        if self._last is None:
            self._algebra = make_direction_space(iterate[0])
        layout, forces = self._last or (None, None)
        self._last = self._algebra.copy(iterate[0], layout), self._algebra.copy(iterate[1], forces)
