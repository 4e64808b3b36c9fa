"""The energy that is minimised: a sum of terms, each with its value and gradient in one layout.

Springs and their guard, or the membrane, and the equations of seams are evaluated by kernels (`warpflat.flat.model.network`,
`warpflat.kernels`); the barrier of contact is `warpflat.flat.solver.contact`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.flat.solver.steps import Relaxation

__all__ = ["NO_CONTACTS", "Contacts", "Energy", "Point"]


@dataclass(frozen=True, kw_only=True)
class Contacts:
    """The contacts of a layout.

    Attributes:
        energy: of the barrier [J]; infinite where the border is not simple.
        vertices: #C by 3, a vertex and the two ends of the edge near it.
        jacobian: #C by 3 by 2, derivative of the distance by the places of these vertices.
        slope, bend: #C, first and second derivative of the barrier by the distance [N], [N/m].
    """

    energy: float
    vertices: IntArray
    jacobian: FloatArray
    slope: FloatArray
    bend: FloatArray

    def add_gradient(self, gradient: FloatArray) -> None:
        """Add the gradient of the barrier to #V by 2 [N], in place."""
        np.add.at(gradient, self.vertices.ravel(), (self.slope[:, None, None] * self.jacobian).reshape(-1, 2))

    @property
    def rows(self) -> FloatArray:
        """The rows J of the barrier's stiffness J^T J where it is convex, #C by 3 by 2 [(N/m)^1/2]."""
        return np.asarray(np.sqrt(np.maximum(self.bend, 0.0))[:, None, None] * self.jacobian)


NO_CONTACTS = Contacts(
    energy=0.0,
    vertices=np.empty((0, 3), dtype=np.int32),
    jacobian=np.empty((0, 3, 2)),
    slope=np.empty(0),
    bend=np.empty(0),
)


@dataclass(frozen=True, kw_only=True)
class Point:
    """A layout (#V by 2 [m]), the energy there [J], infinite where it is not allowed, its gradient (#V by 2 [N]), and its contacts."""

    positions: FloatArray
    energy: float
    gradient: FloatArray
    touch: Contacts = field(default=NO_CONTACTS)


class Energy:
    """The sum of cloth (springs and guard, or membrane), seams, and the barrier of contact if there is one."""

    def __init__(self, state: Relaxation, barrier: Callable[[FloatArray], Contacts] | None = None) -> None:
        """Measure in the arrays of a state, whose layout follows."""
        self.state, self._barrier = state, barrier

    @property
    def has_contact(self) -> bool:
        """Whether there is a barrier of contact."""
        return self._barrier is not None

    def at(self, positions: FloatArray) -> Point:
        """Evaluate a layout (#V by 2 [m])."""
        # The cloth is not evaluated where the border crosses itself.
        touch = NO_CONTACTS if self._barrier is None else self._barrier(positions)
        if not np.isfinite(touch.energy):
            return Point(positions=positions, energy=np.inf, gradient=np.zeros_like(positions), touch=touch)
        self.state.place(positions)
        cloth, force = self.state.evaluate()
        seams = self.state.network.seam_energy(self.state.position) if np.isfinite(cloth) else 0.0
        gradient = -force
        touch.add_gradient(gradient)
        return Point(positions=positions, energy=cloth + seams + touch.energy, gradient=gradient, touch=touch)
