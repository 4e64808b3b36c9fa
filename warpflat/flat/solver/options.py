"""The options of a relaxation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

from warpflat.core.errors import InputError, expect, expect_within, nearest

__all__ = ["SOLVERS", "RelaxOptions", "Solver", "coarse_options", "given_options"]

Solver = Literal["auto", "paper"]
SOLVERS: tuple[Solver, ...] = ("auto", "paper")
# Coarse options: tolerances looser by this factor, and few steps.
_LOOSER, _COARSE_STEPS = 10.0, 600


@dataclass(frozen=True, kw_only=True)
class RelaxOptions:
    """Options of a relaxation: the time step, the tolerances, the solver, the gap.

    Attributes:
        time_step: h of eqs. (4) to (10) [s]. The minimum does not depend on it; the number of steps to it stops falling above 1e-3.
        first_steps_gain: a relaxation begins with the paper's steps. They end once a step changes the energy by no more than this share,
            epsilon of eq. (11). With 1 there are none.
        energy_left, outline_left_mm: L-BFGS, with or without contact, ends when by estimate
            (`warpflat.flat.solver.stop`) at most this share of the energy is still to be released, and no point of the outline will move by
            more than so many millimetres. With 0, or where one of the tolerances below is stricter than its default, it ends by the
            tolerances alone.
        energy_tolerance: eq. (11): relative change of the energy per step.
        residual_tolerance: largest force on a vertex over the mean force of the springs.
        max_steps: a state that has taken so many steps is not stepped further, and reports `converged = False`. An iteration of L-BFGS
            counts by its work, in steps.
        check_every: steps between two convergence checks.
        kinetic_damping: set velocities to zero when the forces begin to brake the motion.
        solver: "auto", the paper's steps while they gain, then L-BFGS over one factor, from coarse to fine on meshes too large to factor;
            or "paper", the paper's steps alone.
        gap_mm: a flat piece that would lie over itself is parted by contact (`warpflat.flat.solver.contact`), which acts where its border
            comes nearer to itself than this [mm]; 0 leaves the piece as it lies.
        contact_share: where contact costs more than this share of the model energy, it also starts from its layout swirled, and a note
            names the cut that would restore it.
    """

    time_step: float = 0.01
    first_steps_gain: float = 0.05
    energy_left: float = 1e-3
    outline_left_mm: float = 0.2
    energy_tolerance: float = 1e-6
    residual_tolerance: float = 5e-3
    max_steps: int = 20_000
    check_every: int = 10
    kinetic_damping: bool = True
    solver: Solver = "auto"
    gap_mm: float = 0.5
    contact_share: float = 0.05

    #: Least and largest value of each.
    BOUNDS: ClassVar[Mapping[str, tuple[float, float]]] = {
        "time_step": (1e-9, 1e9), "first_steps_gain": (0, 1), "energy_left": (0, 1), "outline_left_mm": (0, 1e3),
        "energy_tolerance": (0, 1), "residual_tolerance": (1e-12, 1e3), "max_steps": (1, 10**9), "check_every": (1, 10**6),
        "gap_mm": (0, 1e3), "contact_share": (0, 1e6),
    }  # fmt: skip

    def validate(self) -> None:
        """Raise InputError, with its name, for a value out of its bounds."""
        expect_within(self, self.BOUNDS, "relax")
        if not isinstance(self.kinetic_damping, bool):
            raise InputError(f"relax: kinetic_damping = {self.kinetic_damping!r} is neither True nor False")
        if self.solver not in SOLVERS:
            raise InputError(f"relax: solver {self.solver!r} is unknown; {nearest(str(self.solver), SOLVERS)}")


def given_options(options: RelaxOptions | None) -> RelaxOptions:
    """Return valid options: those given, or the defaults.

    Raises:
        InputError: they are no RelaxOptions, or a value is out of its bounds.
    """
    if options is None:
        return RelaxOptions()
    expect(options, RelaxOptions, "relax", "a RelaxOptions, such as RelaxOptions(max_steps=5000)")
    options.validate()
    return options


def coarse_options(options: RelaxOptions | None = None) -> RelaxOptions:
    """Return options that are enough to rank cuts: tolerances ten times looser, few steps, and no contact."""
    given = given_options(options)
    return replace(
        given,
        energy_tolerance=_LOOSER * given.energy_tolerance,
        residual_tolerance=_LOOSER * given.residual_tolerance,
        max_steps=min(_COARSE_STEPS, given.max_steps),
        gap_mm=0.0,
    )
