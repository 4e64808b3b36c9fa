"""Fabric files: the format of ``data/fabrics.toml``, of a user's own library, and of a scene's ``[fabric]`` table."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Mapping
from dataclasses import fields, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from warpflat.core.errors import InputError, nearest
from warpflat.core.toml_file import Table, check_table, read_toml
from warpflat.flat.fabric.fabric import SHEAR_BY_STRAIN, SHEAR_OF_WOVENS, Curve, Fabric, Provenance, fabric_called
from warpflat.flat.fabric.instruments import (
    FAST_LOADS,
    GF_PER_CM,
    KES_BENDING_UNIT,
    KES_SHEAR_UNIT,
    bending_from_fast,
    curve_from_fast,
    curve_from_kes,
    shear_stiffness_from_fast,
    shear_stiffness_from_kes,
    stiffness_from_extension,
)

__all__ = ["FabricTable", "fabric_from_table", "read_fabrics", "read_shipped_fabrics"]

_TENSILE = {"N/m": 1.0, "gf/cm": GF_PER_CM, "N/cm": 100.0, "lbf/in": 175.12683524647636}
_UNITS: dict[str, dict[str, float]] = {
    "stiffness_warp": _TENSILE,
    "stiffness_weft": _TENSILE,
    "shear_stiffness": {"N/m": 1.0, "N/m per rad": 1.0, "gf/(cm deg)": KES_SHEAR_UNIT},
    "areal_density": {"kg/m2": 1.0, "g/m2": 1e-3, "mg/cm2": 1e-2, "oz/yd2": 0.0339057474748},
    "poisson_ratio": {"1": 1.0},
    "strain_limit": {"1": 1.0, "percent": 0.01},
    "shear_limit": {"degrees": 1.0, "rad": math.degrees(1.0)},
    "compression_factor": {"1": 1.0, "percent": 0.01},
    "bending": {"N m": 1.0, "uN m": 1e-6, "gf cm2/cm": KES_BENDING_UNIT},
}

# A stretch of linearly varying secant stiffness, a parabola of tension, is cut where its tangent has grown or fallen by this ratio.
_PER_POINT = 1.2
# A tangent counts as at least this share of the stiffest secant.
_FLATTEST = 1e-3

Grade = Literal["A", "B", "C", "D", "E"]
#: Values of a fabric by attribute, each with its origin.
Given = dict[str, tuple[Any, Provenance]]
_Pair = Annotated[list[float], Field(min_length=2, max_length=2)]


class _Origin(Table):
    source: str = "not stated"
    grade: Grade | None = None
    test_load: str = ""
    note: str = ""


class ValueTable(_Origin):
    """One number with its unit and where it comes from."""

    value: float
    unit: str
    spread: _Pair | None = None
    at_least: bool = False


class CurveTable(_Origin):
    """A J-shaped curve: points of strain and tension, or secant stiffnesses at strains, linear in between."""

    points: list[_Pair] | None = Field(default=None, min_length=1)
    secants: list[_Pair] | None = Field(default=None, min_length=2)
    unit: str = "N/m"

    @model_validator(mode="after")
    def _one_of_two(self) -> CurveTable:
        if (self.points is None) == (self.secants is None):
            raise ValueError("give either points = [[strain, tension], ...] or secants = [[strain, stiffness], ...]")
        strains, stiffnesses = zip(*self.secants or [[0.0, 1.0]], strict=True)
        if strains[0] < 0.0 or any(b <= a for a, b in itertools.pairwise(strains)) or min(stiffnesses) <= 0.0:
            raise ValueError(
                "secants = [[strain, stiffness], ...] begin at a strain of 0 or more, rise, and are above 0"
            )
        return self

    def tensions(self, factor: float) -> Curve:
        """Return its points with tensions in N/m, by the factor of its unit; secants change evenly from strain to strain."""
        found = [(strain, tension * factor) for strain, tension in self.points or ()]
        if self.secants and self.secants[0][0] > 0.0:
            e0, k0 = self.secants[0]
            found.append((e0, k0 * factor * e0))
        for (e0, k0), (e1, k1) in itertools.pairwise(self.secants or []):
            slope = (k1 - k0) / (e1 - e0)
            first, last = np.maximum([k0 + slope * e0, k1 + slope * e1], _FLATTEST * max(k0, k1))
            count = max(math.ceil(abs(math.log(last / first)) / math.log(_PER_POINT)), 1)
            tangents = np.geomspace(first, last, count + 1)[1:]
            shares = (tangents - first) / (last - first) if count > 1 else np.ones(1)
            strains = (e0 + shares * (e1 - e0)).tolist()
            found += [(e, (k0 + slope * (e - e0)) * factor * e) for e in strains]
        return tuple(found)


class KesTable(Table):
    """Readings of KES-F: EMT [%], LT, the maximum load [gf/cm], shear G [gf/(cm deg)], bending B [gf cm2/cm], weight W [mg/cm2]."""

    emt_warp: float = Field(gt=0)
    emt_weft: float = Field(gt=0)
    lt_warp: float | None = Field(default=None, gt=0, le=1)
    lt_weft: float | None = Field(default=None, gt=0, le=1)
    max_load: float = Field(default=500.0, gt=0)
    g: float | None = Field(default=None, gt=0)
    b: float | None = Field(default=None, gt=0)
    w: float | None = Field(default=None, gt=0)
    source: str = "KES-F readings"
    grade: Grade | None = None

    def values(self) -> Given:
        """Return the values of a fabric that follow from the readings, each with its origin."""
        given, load = Given(), self.max_load * GF_PER_CM
        origin = Provenance(source=self.source, grade=self.grade or "")
        for direction in ("warp", "weft"):
            emt, linearity = getattr(self, f"emt_{direction}"), getattr(self, f"lt_{direction}")
            at_load = replace(origin, unit="percent at load", test_load=f"{load:.0f} N/m")
            given[f"stiffness_{direction}"] = stiffness_from_extension(emt, load), at_load
            if linearity is not None:
                source = f"{self.source}; power law that meets EMT and LT"
                of_curve = replace(origin, source=source, unit="N/m", test_load=f"up to {load:.0f} N/m")
                given[f"curve_{direction}"] = curve_from_kes(emt, linearity, load), of_curve
        if self.g is not None:
            given["shear_stiffness"] = shear_stiffness_from_kes(self.g), replace(origin, unit="gf/(cm deg)")
        if self.b is not None:
            given["bending"] = self.b * KES_BENDING_UNIT, replace(origin, unit="gf cm2/cm")
        if self.w is not None:
            given["areal_density"] = self.w * 0.01, replace(origin, unit="mg/cm2")
        return given


class FastTable(Table):
    """Readings of FAST: extensions E5, E20, E100 [%] along warp and weft, bias extension EB5 [%], bending length C [mm], W [g/m2]."""

    e5_warp: float | None = Field(default=None, gt=0)
    e5_weft: float | None = Field(default=None, gt=0)
    e20_warp: float | None = Field(default=None, gt=0)
    e20_weft: float | None = Field(default=None, gt=0)
    e100_warp: float = Field(gt=0)
    e100_weft: float = Field(gt=0)
    eb5: float | None = Field(default=None, gt=0)
    c: float | None = Field(default=None, gt=0)
    w: float | None = Field(default=None, gt=0)
    source: str = "FAST readings"
    grade: Grade | None = None

    def values(self) -> Given:
        """Return the values of a fabric that follow from the readings, each with its origin."""
        given, origin = Given(), Provenance(source=self.source, grade=self.grade or "")
        for direction in ("warp", "weft"):
            e5, e20, e100 = (getattr(self, f"{key}_{direction}") for key in ("e5", "e20", "e100"))
            at_load = replace(origin, unit="percent at load", test_load="98.1 N/m")
            given[f"stiffness_{direction}"] = stiffness_from_extension(e100, FAST_LOADS["e100"]), at_load
            if e5 is not None and e20 is not None:
                of_curve = replace(origin, unit="N/m", test_load="4.9, 19.6 and 98.1 N/m")
                given[f"curve_{direction}"] = curve_from_fast(e5, e20, e100), of_curve
        if self.eb5 is not None:
            of_eb5 = replace(origin, unit="percent", test_load="EB5")
            given["shear_stiffness"] = shear_stiffness_from_fast(self.eb5), of_eb5
        if self.c is not None and self.w is not None:
            of_c = replace(origin, unit="mm", test_load="bending length")
            given["bending"] = bending_from_fast(self.c, self.w), of_c
        if self.w is not None:
            given["areal_density"] = self.w * 1e-3, replace(origin, unit="g/m2")
        return given

    @model_validator(mode="after")
    def _weight_of_bending(self) -> FastTable:
        if self.c is not None and self.w is None:
            raise ValueError("c, the bending length, gives a bending rigidity only with the weight: give w [g/m2], too")
        return self


Quantity = Annotated[
    Annotated[float, Tag("number")] | Annotated[ValueTable, Tag("table")],
    Discriminator(lambda value: "table" if isinstance(value, (dict, ValueTable)) else "number"),
]


class FabricTable(Table):
    """One fabric. A plain number is in SI; what is not given comes from the readings, then from `base`."""

    base: str | None = None
    description: str = ""
    aliases: list[str] = Field(default_factory=list)
    examples: list[str] = Field(default_factory=list)
    stiffness_warp: Quantity | None = None
    stiffness_weft: Quantity | None = None
    shear_stiffness: Quantity | None = None
    areal_density: Quantity | None = None
    poisson_ratio: Quantity | None = None
    strain_limit: Quantity | None = None
    shear_limit: Quantity | None = None
    compression_factor: Quantity | None = None
    bending: Quantity | None = None
    curve_warp: CurveTable | None = None
    curve_weft: CurveTable | None = None
    kes: KesTable | None = None
    fast: FastTable | None = None

    @model_validator(mode="after")
    def _one_instrument(self) -> FabricTable:
        if self.kes is not None and self.fast is not None:
            raise ValueError("give the readings of one instrument, [kes] or [fast], not both")
        return self


@functools.lru_cache(maxsize=1)
def _shipped() -> tuple[Fabric, ...]:
    with resources.as_file(resources.files("warpflat.flat.fabric") / "data/fabrics.toml") as path:
        return tuple(read_fabrics(path).values())


def read_shipped_fabrics() -> dict[str, Fabric]:
    """Return the package's own library, by name."""
    return {fabric.name: fabric for fabric in _shipped()}


def read_fabrics(path: Path, library: Mapping[str, Fabric] | None = None) -> dict[str, Fabric]:
    """Return the fabrics of a file, by name.

    Args:
        path: a TOML file with one table per fabric, and optionally ``[sources]``: short key = full text.
        library: where a `base` is looked up, besides the fabrics before it in the same file.

    Raises:
        InputError: unreadable, an unknown key, an impossible value; one line with file, fabric and key.
    """
    data = read_toml(path)
    sources = data.pop("sources", {})
    if not isinstance(sources, dict) or not all(isinstance(text, str) for text in sources.values()):
        raise InputError(f'{path}: sources: must be a table of texts, such as smith = "Smith 2001, table 3"')
    if not data:
        raise InputError(f"{path}: has no fabric; write a table such as [my-cloth] with stiffness_warp = 2000")
    known = dict(library or {})
    found: dict[str, Fabric] = {}
    for name, entry in data.items():
        if not isinstance(entry, dict):
            hint = nearest(name, FabricTable.model_fields)
            raise InputError(f"{path}: {name}: stands outside a fabric's table; begin one with [name] ({hint})")
        table = check_table(FabricTable, entry, f"{path}: {name}")
        found[name] = known[name] = fabric_from_table(name, table, where=str(path), library=known, sources=sources)
    return found


def fabric_from_table(
    name: str,
    table: FabricTable,
    *,
    where: str,
    library: Mapping[str, Fabric] | None = None,
    sources: Mapping[str, str] | None = None,
) -> Fabric:
    """Return the fabric that a checked table describes.

    Args:
        name: of the fabric.
        table: its table.
        where: the file, the beginning of messages.
        library: where its `base` is looked up (the shipped library without one).
        sources: full texts of the sources that values name by a short key.

    Raises:
        InputError: an unknown base or unit, a missing value, an impossible one.
    """
    try:
        values: dict[str, Any] = {}
        origins: dict[str, Provenance] = {}
        if table.base is not None:
            try:
                base = fabric_called(table.base, read_shipped_fabrics() if library is None else library)
            except InputError as error:
                raise InputError(f"fabric {name!r}: base: {error}") from None
            values = {f.name: getattr(base, f.name) for f in fields(Fabric) if f.name not in ("name", "aliases")}
            origins = dict(values.pop("provenance"))
        # Readings replace what comes from the base, and values that the table gives itself replace readings.
        given = Given()
        for instrument in (table.kes, table.fast):
            given |= {} if instrument is None else instrument.values()
        for key, units in _UNITS.items():
            value: float | ValueTable | None = getattr(table, key)
            if isinstance(value, ValueTable):
                factor = _factor(name, key, value.unit, units)
                spread = (value.spread[0] * factor, value.spread[1] * factor) if value.spread else None
                origin = replace(_provenance(value, value.unit, sources or {}), spread=spread, at_least=value.at_least)
                given[key] = value.value * factor, origin
            elif value is not None:
                given[key] = value, Provenance(unit=next(iter(units)))
        for key in ("curve_warp", "curve_weft"):
            curve: CurveTable | None = getattr(table, key)
            if curve is not None:
                factor = _factor(name, key, curve.unit, _TENSILE)
                given[key] = curve.tensions(factor), _provenance(curve, curve.unit, sources or {})
            elif getattr(table, key.replace("curve", "stiffness")) is not None:
                # A curve of readings would contradict the table's own stiffness.
                given.pop(key, None)
        # A curve of the base would contradict a stiffness that is given here.
        for direction in ("warp", "weft"):
            if f"stiffness_{direction}" in given:
                values.pop(f"curve_{direction}", None)
                origins.pop(f"curve_{direction}", None)
        # So might an estimate of its limit of shear: it is estimated anew.
        if origins.get("shear_limit") in (SHEAR_BY_STRAIN, SHEAR_OF_WOVENS):
            del values["shear_limit"], origins["shear_limit"]
        values.update((key, value) for key, (value, _) in given.items())
        origins.update((key, origin) for key, (_, origin) in given.items())
        for key in ("stiffness_warp", "stiffness_weft", "shear_stiffness", "areal_density"):
            if key not in values:
                given_as = f"{key} = 2000.0 (N/m), a [kes] or [fast] table with readings,"
                if not key.startswith("stiffness"):
                    example = {"shear_stiffness": "26.0 (N/m per rad)", "areal_density": "0.168 (kg/m2)"}[key]
                    reading = {"shear_stiffness": "kes.g or fast.eb5", "areal_density": "kes.w or fast.w"}[key]
                    given_as = f"{key} = {example}, the reading {reading},"
                raise InputError(f"fabric {name!r}: {key} is missing; write {given_as} or base = another fabric")
        values["description"] = table.description or values.get("description", "")
        values["examples"] = tuple(table.examples) or values.get("examples", ())
        return Fabric(name=name, aliases=tuple(table.aliases), provenance=origins, **values)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _provenance(origin: _Origin, unit: str, sources: Mapping[str, str]) -> Provenance:
    source = sources.get(origin.source, origin.source)
    return Provenance(
        source=f"{source}; {origin.note}" if origin.note else source,
        grade=origin.grade or "",
        unit=unit,
        test_load=origin.test_load,
    )


def _factor(name: str, key: str, unit: str, units: Mapping[str, float]) -> float:
    if unit not in units:
        raise InputError(f"fabric {name!r}: {key}: unknown unit {unit!r}; {nearest(unit, units)}")
    return units[unit]
