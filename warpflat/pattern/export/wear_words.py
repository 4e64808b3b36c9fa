"""An entry `wear` of `metrics.json` in words: ranges of strain and pressure, and limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["RANGES", "STRAINS", "limit_words", "pressure_words", "strain_words"]

#: The meaning of ranges of strain and pressure.
RANGES = "5 to 95 % of the cloth [all of it]"

#: The strains of an entry `wear`: its key, the word for it, the factor to the unit shown, and that unit.
STRAINS = (
    ("strain_warp", "warp", 100.0, "%"),
    ("strain_weft", "weft", 100.0, "%"),
    ("shear", "shear", 1.0, "degrees"),
)


def strain_words(wear: Mapping[str, Any]) -> list[str]:
    """Return the ranges of strain and shear of an entry `wear`, such as "weft -0.6 to +8.6 % [-2.7 to +20.3]" (see `RANGES`)."""
    found = []
    for key, word, factor, unit in STRAINS:
        low, least, most, high = (factor * wear[key][at] for at in ("min", "p05", "p95", "max"))
        found.append(f"{word} {least:+.1f} to {most:+.1f} {unit} [{low:+.1f} to {high:+.1f}]")
    return found


def limit_words(wear: Mapping[str, Any]) -> str:
    """Return the limits of an entry `wear`, such as "5 % and 15 degrees"."""
    shear = "" if wear["shear_limit"] is None else f" and {wear['shear_limit']:.3g} degrees"
    return f"{100 * wear['strain_limit']:.3g} %{shear}"


def pressure_words(wear: Mapping[str, Any]) -> str:
    """Return the range of the pressure of an entry `wear` as text; nothing if the cloth does not press."""
    pressure = wear["pressure"]
    if pressure["max"] < 1.0:
        return ""
    return f"pressure {pressure['p05']:,.0f} to {pressure['p95']:,.0f} Pa [up to {pressure['max']:,.0f}]"
