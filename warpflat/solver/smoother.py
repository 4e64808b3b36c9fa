"""Steps that smooth: what is rough in a layout goes in few of them, what is not is left to coarser levels.

The approximate implicit step, eq. (10), without viscosity, is a push P F of the forces F on the vertices, P = (I + N) D^-1. Of P A, with A
the stiffness of the springs, all eigenvalues e lie between 0 and 1. With viscosity velocities swing: times sqrt(e), .21 of some
way is left after four steps from rest, and after eight. Velocities that are carried on and pushed by the shares of a Chebyshev polynomial
of the fourth kind leave 1 / (2 k + 1) of any way after k steps, weighed so: as little as k pushes can, and what a cycle is bound by
(Lottes, Optimal polynomial smoothers for multigrid V-cycles, Numerical Linear Algebra with Applications 30, 2023).
"""

from __future__ import annotations

__all__ = ["STEADY", "STILL", "smoother_coefficients"]

SmootherCoefficients = tuple[float, float, float]

STEADY: SmootherCoefficients = (1.0, 1.0, 1.0)
"""The paper's: with viscosity, and with all of the velocity and of the push (`kernels.implicit`)."""

STILL: SmootherCoefficients = (0.0, 1.0, 1.0)
"""The same at rest, where there is no viscosity to be had."""


def smoother_coefficients(number: int) -> SmootherCoefficients:
    """Of the smoothing step after so many from rest: without viscosity, the share of the velocity that is carried on, that of the push."""
    carried = max(2 * number - 1, 0) / (2 * number + 3)
    return 0.0, carried, (8 * number + 4) / (2 * number + 3)
