"""Fabrics: in-plane stiffness, weight and limits of a cloth, each value with its origin."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError, is_number, nearest

__all__ = [
    "DEFAULT_FABRIC",
    "GRADES",
    "SHEAR_BY_STRAIN",
    "SHEAR_OF_WOVENS",
    "Curve",
    "Fabric",
    "Provenance",
    "check_value",
    "fabric_called",
    "grain_axes",
    "value_names",
]

DEFAULT_FABRIC = "isotropic"

GRADES = {
    "A": "read from data or code",
    "B": "web page or book",
    "C": "second-hand",
    "D": "defined, describes no real cloth",
    "E": "estimate",
}

Curve = tuple[tuple[float, float], ...]

# Wide enough for all that is sewn, from tulle to sole leather, and narrow enough to catch a value in another unit.
_RANGES: dict[str, tuple[float, float, str]] = {
    "stiffness_warp": (1.0, 5e6, "N/m"),
    "stiffness_weft": (1.0, 5e6, "N/m"),
    "shear_stiffness": (0.1, 5e6, "N/m"),
    "areal_density": (0.005, 5.0, "kg/m2"),
    "poisson_ratio": (0.0, 0.99, ""),
    "strain_limit": (0.001, 2.0, ""),
    "shear_limit": (0.5, 80.0, "degrees"),
    "compression_factor": (0.001, 1.0, ""),
    "bending": (1e-8, 0.1, "N m"),
}


# Cloth that may be strained by more than this is a knit.
_WOVEN_STRAIN = 0.1
# What cloth is stretched by to see how far it gives [N/m], 100 gf/cm as in FAST's tests.
_HAND = 98.1

# A medium woven creases from about this shear angle on [degrees].
_WOVEN_SHEAR = 15.0


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """The origin of one value of a fabric.

    Attributes:
        source: the measurement or publication.
        grade: a key of `GRADES`.
        unit: the unit the value was given in; the fabric itself holds SI.
        test_load: the load or strain at which it was measured; cloth stiffens 3 to 30 times between 5 and 500 gf/cm, so
            a stiffness says little without it.
        spread: lowest and highest value given (SI), where the source gives a range and the fabric holds its middle.
        at_least: the source gives the value as a lower bound.
    """

    source: str = "not stated"
    grade: str = ""
    unit: str = ""
    test_load: str = ""
    spread: tuple[float, float] | None = None
    at_least: bool = False

    @property
    def is_estimate(self) -> bool:
        """True for a value that nobody measured."""
        return self.grade == "E"


#: Of the limit of shear that nobody gave: of a woven, and of a knit or an isotropic sheet.
SHEAR_OF_WOVENS = Provenance(source="estimate for wovens", grade="E", unit="degrees", test_load="none")
SHEAR_BY_STRAIN = Provenance(
    source="estimate: the shear that lengthens the bias by strain_limit", grade="E", unit="degrees", test_load="none"
)


@dataclass(frozen=True, kw_only=True)
class Fabric:
    """A cloth as the flattening sees it: an orthotropic membrane along straight warp and weft threads.

    A fabric is checked when it is made, so one that exists is one that can be computed with.

    Attributes:
        name: of the fabric in files and messages.
        stiffness_warp: secant tensile stiffness along the warp (load per width / strain) [N/m].
        stiffness_weft: secant tensile stiffness along the weft [N/m].
        shear_stiffness: shear force per width per shear angle [N/m per rad].
        poisson_ratio: weft contraction per warp extension under tension along the warp. Measured values are rare for
            cloth, so 0 unless a source gives one; an isotropic sheet has G = K / (2 (1 + nu)).
        areal_density: mass per area [kg/m2].
        strain_limit: strain a pattern may ask of the cloth, either sign; 0.05 is usual for wovens.
        shear_limit: angle that warp and weft of a pattern may be off the right angle when worn [degrees], either way:
            where creases begin in the flat cloth. From there on it resists as if it locked. Where it is not given, it
            is an estimate: 15 for wovens; for knits and isotropic sheets, which have no straight threads to lock, the
            angle that lengthens the bias by `strain_limit`. An isotropic sheet is judged by its principal strains.
        compression_factor: stiffness under in-plane compression over that under tension. Cloth wrinkles instead of
            being pressed together, so less than 1 is real; 1 keeps springs that act alike both ways.
        bending: bending moment per width per curvature, warp and weft averaged [N m]; only a drape needs it. A medium
            plain weave has 5e-6 to 1e-5.
        curve_warp: (strain, tension [N/m]) points of a J-shaped curve along the warp, both rising from the origin,
            which is not listed; empty where the secant stiffness is all that is known.
        curve_weft: such points along the weft.
        description: one line for people.
        aliases: other names it is found by.
        examples: cloths of the kind that shops sell.
        provenance: for each value (by attribute name) where it comes from.
    """

    name: str
    stiffness_warp: float
    stiffness_weft: float
    shear_stiffness: float
    areal_density: float
    poisson_ratio: float = 0.0
    strain_limit: float = 0.05
    shear_limit: float = None  # type: ignore[assignment]  # never None once made
    compression_factor: float = 1.0
    bending: float = 1e-5
    curve_warp: Curve = ()
    curve_weft: Curve = ()
    description: str = ""
    aliases: tuple[str, ...] = ()
    examples: tuple[str, ...] = ()
    provenance: Mapping[str, Provenance] = field(default_factory=dict, compare=False, repr=False)

    def __post_init__(self) -> None:
        for key in ("curve_warp", "curve_weft"):
            object.__setattr__(self, key, tuple(map(tuple, getattr(self, key))))
        estimated = self.shear_limit is None
        if estimated:
            object.__setattr__(self, "shear_limit", _WOVEN_SHEAR)
        self.validate()
        if estimated:
            origin = SHEAR_OF_WOVENS
            if self.is_knit or self.is_isotropic:
                # Threads that keep their lengths and cross at 90 degrees less g lengthen the bias to sqrt(1 + sin g).
                limit = math.degrees(math.asin(min((1.0 + self.strain_limit) ** 2 - 1.0, 1.0)))
                lowest, highest, _ = _RANGES["shear_limit"]
                object.__setattr__(self, "shear_limit", min(max(limit, lowest), highest))
                origin = SHEAR_BY_STRAIN
            object.__setattr__(self, "provenance", {**self.provenance, "shear_limit": origin})

    def validate(self) -> None:
        """Check the values.

        Raises:
            InputError: a value is missing, no number, outside its range, or contradicts another one; names the value.
        """
        for key in _RANGES:
            check_value(key, getattr(self, key), f"fabric {self.name!r}: {key}")
        softer = min(self.stiffness_warp, self.stiffness_weft)
        if self.shear_stiffness > softer:
            raise InputError(
                f"fabric {self.name!r}: shear_stiffness = {self.shear_stiffness:g} N/m is more than the softer tensile "
                f"stiffness, {softer:g} N/m; cloth has a shear stiffness of 1/100 to 1/2 of it"
            )
        bound = math.sqrt(self.stiffness_warp / self.stiffness_weft)
        if self.poisson_ratio >= bound:
            raise InputError(
                f"fabric {self.name!r}: poisson_ratio = {self.poisson_ratio:g} would let it release energy when "
                f"stretched; must be below sqrt(stiffness_warp / stiffness_weft) = {bound:.3g}"
            )
        for key in ("curve_warp", "curve_weft"):
            previous = (0.0, 0.0)
            for number, point in enumerate(getattr(self, key)):
                if len(point) != 2 or not all(math.isfinite(x) for x in point):
                    raise InputError(
                        f"fabric {self.name!r}: {key}[{number}] = {point}; must be strain and tension [N/m]"
                    )
                if point[0] <= previous[0] or point[1] <= previous[1]:
                    raise InputError(
                        f"fabric {self.name!r}: {key}[{number}] = ({point[0]:g}, {point[1]:g}) does not rise from "
                        f"({previous[0]:g}, {previous[1]:g}); strain and tension must both increase from (0, 0)"
                    )
                previous = (point[0], point[1])

    def allowing(self, shear_limit: float | None) -> Fabric:
        """Return the fabric with the limit of shear that its maker allows [degrees]; itself for None.

        Raises:
            InputError: no limit can be that, or the fabric is an isotropic sheet.
        """
        if shear_limit is None:
            return self
        if self.is_isotropic:
            raise InputError(
                f"a limit of shear says nothing of {self.name}, an isotropic sheet, which has no threads; take a cloth, such "
                "as woven, or leave the limit out"
            )
        asked = Provenance(source="asked for", unit="degrees")
        return replace(self, shear_limit=shear_limit, provenance={**self.provenance, "shear_limit": asked})

    def stretch(self, direction: Literal["warp", "weft"] = "warp") -> float:
        """Return the strain at which the cloth pulls with 98.1 N/m, a hand's pull, along one direction; a share."""
        strains = np.linspace(0.0, 2.0, 4001)
        return float(np.interp(_HAND, self.tension(strains, direction), strains))

    @property
    def is_knit(self) -> bool:
        """True if it stretches as knits do, by its strain limit."""
        return self.strain_limit > _WOVEN_STRAIN

    @property
    def is_isotropic(self) -> bool:
        """True if stiffness is the same in all directions within 0.1 %, as values are given with three or four digits."""
        same = math.isclose(self.stiffness_warp, self.stiffness_weft, rel_tol=1e-3)
        sheared = self.stiffness_warp / (2.0 * (1.0 + self.poisson_ratio))
        return same and math.isclose(self.shear_stiffness, sheared, rel_tol=1e-3) and self.curve_warp == self.curve_weft

    def tension(self, strain: ArrayLike, direction: Literal["warp", "weft"] = "warp") -> FloatArray:
        """Return tension at given strains along one direction, by the curve where there is one.

        Args:
            strain: any shape, elongation over length; negative is compression.
            direction: along which threads.

        Returns:
            Same shape, load per width [N/m]. Straight between the curve's points and on beyond its last two; linear
            with the secant stiffness without a curve, and under compression (times `compression_factor`).
        """
        if direction not in ("warp", "weft"):
            raise InputError(f"direction {direction!r}: {nearest(str(direction), ['warp', 'weft'])}")
        e = np.asarray(strain, dtype=np.float64)
        stiffness: float = getattr(self, f"stiffness_{direction}")
        points: Curve = getattr(self, f"curve_{direction}")
        if not points:
            pulled = stiffness * e
        else:
            xs, ys = np.array([(0.0, 0.0), *points]).T
            slope = (ys[-1] - ys[-2]) / (xs[-1] - xs[-2])
            pulled = np.where(e > xs[-1], ys[-1] + slope * (e - xs[-1]), np.interp(e, xs, ys))
        return np.where(e < 0.0, self.compression_factor * stiffness * e, pulled)


def fabric_called(name: str, library: Mapping[str, Fabric]) -> Fabric:
    """Return a library's fabric of that name or alias; case, spaces and underscores do not matter.

    Who asks by an alias gets the fabric under that name, so that files and messages call it as the user does.

    Raises:
        InputError: there is none; names the nearest.
    """
    wanted = _plain(name)
    for fabric in library.values():
        known = (fabric.name, *fabric.aliases)
        for called in known:
            if wanted == _plain(called):
                return replace(fabric, name=called, aliases=tuple(other for other in known if other != called))
    names = [*library, *(alias for fabric in library.values() for alias in fabric.aliases)]
    raise InputError(f"unknown fabric {name!r}: {nearest(wanted, names)}")


def grain_axes(grain_angle: float) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors of warp and weft in the plane; at 0 degrees the warp is +y (up) and the weft +x."""
    angle = np.deg2rad(grain_angle)
    return np.array([-np.sin(angle), np.cos(angle)]), np.array([np.cos(angle), np.sin(angle)])


def check_value(key: str, value: object, what: str) -> None:
    """Check one number of a fabric.

    Args:
        key: the attribute.
        value: what it is to be.
        what: what messages begin with.

    Raises:
        InputError: it is missing, no number, or out of its range.
    """
    lowest, highest, unit = _RANGES[key]
    valid = f"must lie between {lowest:g} and {highest:g} {unit}".rstrip()
    if value is None:
        raise InputError(f"{what} is missing; {valid}")
    if not is_number(value):
        raise InputError(f"{what} = {value!r} is not a number")
    if not lowest <= value <= highest:  # false for NaN too
        number, hint = float(value), ""
        if key == "areal_density" and 5.0 < number <= 5000.0:
            hint = f" (if that is in g/m2, write {number / 1000.0:g})"
        elif key == "bending" and 0.1 < number <= 1e5:
            hint = f" (if that is in uN m, write {1e-6 * number:g})"
        elif key == "strain_limit" and 2.0 < number <= 200.0:
            hint = f" (if that is in percent, write {number / 100.0:g})"
        elif key == "shear_limit" and 0.0 < number < 0.5:
            hint = f" (if that is in radians, write {math.degrees(number):.3g})"
        raise InputError(f"{what} = {value:g} {unit}".rstrip() + f" is out of range; {valid}{hint}")


def value_names() -> tuple[str, ...]:
    """Return the attributes of a fabric that are measured numbers or curves."""
    return tuple(f.name for f in fields(Fabric) if f.name in _RANGES or f.name.startswith("curve_"))


def _plain(name: str) -> str:
    return "-".join(name.replace("_", " ").replace("-", " ").lower().split())
