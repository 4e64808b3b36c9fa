"""Coefficients of the approximate implicit step, as the paper's and as a smoother for multigrid cycles.

Without viscosity the step of eq. (10) is a preconditioned push P F by the forces F on the vertices, P = (I + N) D^-1.
All eigenvalues e of P A, with A the stiffness of the springs, lie between 0 and 1. With viscosity the velocities
oscillate, and sqrt(e) times the error falls to 0.21 after four steps from rest, and no further after eight. When the
momentum and the push follow a Chebyshev polynomial of the fourth kind instead, sqrt(e) times the error falls to 1 / (2
k + 1) after k steps, the least that k pushes can reach. This bounds the convergence rate of a cycle (Lottes, Optimal
polynomial smoothers for multigrid V-cycles, Numerical Linear Algebra with Applications 30, 2023).
"""

from __future__ import annotations

__all__ = ["IMPLICIT_STEP", "IMPLICIT_STEP_AT_REST", "SmootherCoefficients", "chebyshev_coefficients"]

SmootherCoefficients = tuple[float, float, float]
"""Factors of the viscosity (0 or 1), of the velocity (momentum) and of its change (step); see `kernels.implicit`."""

IMPLICIT_STEP: SmootherCoefficients = (1.0, 1.0, 1.0)
"""The paper's step."""

IMPLICIT_STEP_AT_REST: SmootherCoefficients = (0.0, 1.0, 1.0)
"""The paper's step from zero velocities, where the viscosity is zero."""


def chebyshev_coefficients(step: int) -> SmootherCoefficients:
    """Return the coefficients of the fourth-kind Chebyshev smoother (Lottes 2023).

    Args:
        step: index of the smoothing step, 0 for the first one from rest.

    Returns:
        viscosity factor 0, momentum (2k - 1) / (2k + 3), step factor (8k + 4) / (2k + 3) with k = `step`.
    """
    momentum = max(2 * step - 1, 0) / (2 * step + 3)
    return 0.0, momentum, (8 * step + 4) / (2 * step + 3)
