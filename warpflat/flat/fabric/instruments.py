"""Values of a fabric in SI units from the readings of the two usual instruments, KES-F and FAST."""

from __future__ import annotations

import math

from warpflat.core.errors import InputError

__all__ = [
    "FAST_LOADS",
    "GF_PER_CM",
    "KES_BENDING_UNIT",
    "KES_SHEAR_UNIT",
    "bending_from_fast",
    "curve_from_fast",
    "curve_from_kes",
    "shear_stiffness_from_fast",
    "shear_stiffness_from_kes",
    "stiffness_from_extension",
]

GF_PER_CM = 0.980665
"""One gram-force per centimetre [N/m]."""

KES_SHEAR_UNIT = GF_PER_CM * 180.0 / math.pi
"""One gf/(cm degree) [N/m per rad]: 56.19."""

KES_BENDING_UNIT = 1e-4 * GF_PER_CM
"""One gf cm2/cm of KES bending's B [N m]: 98.07e-6."""

FAST_LOADS = {"e5": 5 * GF_PER_CM, "e20": 20 * GF_PER_CM, "e100": 100 * GF_PER_CM}
"""Loads of FAST-2's three extensions [N/m]: 4.9, 19.6, 98.1."""


def stiffness_from_extension(extension: float, load: float) -> float:
    """Return secant stiffness [N/m] from an extension [percent] under a load [N/m].

    KES tensile's EMT is taken at 500 gf/cm (490 N/m), FAST's E100 at 98.1 N/m.

    Raises:
        InputError: an extension or load that is not above zero.
    """
    return _positive("load", load) / (_positive("extension", extension) / 100.0)


def shear_stiffness_from_kes(g: float) -> float:
    """Return shear stiffness [N/m per rad] from KES shear's G [gf/(cm degree)].

    Raises:
        InputError: a reading that is not above zero.
    """
    return _positive("g", g) * KES_SHEAR_UNIT


def shear_stiffness_from_fast(eb5: float) -> float:
    """Return shear stiffness [N/m per rad] from FAST-2's bias extension EB5 [percent]: G = 123 / EB5.

    Raises:
        InputError: a reading that is not above zero.
    """
    return 123.0 / _positive("eb5", eb5)


def bending_from_fast(c: float, w: float) -> float:
    """Return bending rigidity [N m] from FAST-2's bending length [mm] and the weight [g/m2]: B = g W c^3.

    Raises:
        InputError: a reading that is not above zero.
    """
    return 9.80665 * 1e-3 * _positive("w", w) * (1e-3 * _positive("c", c)) ** 3


def curve_from_kes(emt: float, linearity: float, load: float) -> tuple[tuple[float, float], ...]:
    """Return a J-shaped curve that meets a KES tensile test's extension and energy.

    LT is the energy under the loading curve over that of a straight line, 1/2 load EMT. Of the curves through the
    origin and (EMT, load), the power law T = load (e / EMT)^p has LT = 2 / (p + 1).

    Args:
        emt: extension at the maximum load [percent].
        linearity: LT, above 0, at most 1 (a straight line).
        load: the maximum load [N/m].

    Returns:
        (strain, tension [N/m]) at 5, 20, 50 and 100 percent of the load.

    Raises:
        InputError: a reading out of range.
    """
    if not 0.0 < linearity <= 1.0:
        raise InputError(f"lt = {linearity:g}; KES's linearity lies between 0 and 1")
    power = 2.0 / linearity - 1.0
    top = _positive("emt", emt) / 100.0
    return tuple((top * part ** (1.0 / power), part * _positive("load", load)) for part in (0.05, 0.2, 0.5, 1.0))


def curve_from_fast(e5: float, e20: float, e100: float) -> tuple[tuple[float, float], ...]:
    """Return the curve through FAST-2's three extensions [percent]: (strain, tension [N/m]) at 4.9, 19.6 and 98.1 N/m."""
    readings = {"e5": e5, "e20": e20, "e100": e100}
    return tuple((_positive(key, value) / 100.0, FAST_LOADS[key]) for key, value in readings.items())


def _positive(name: str, value: float) -> float:
    if not (value > 0.0 and math.isfinite(value)):
        raise InputError(f"{name} = {value:g}; must be above zero")
    return value
