"""Lengths in words, in millimetres, centimetres or inches, as they stand on patterns."""

from __future__ import annotations

import re
from math import ceil
from typing import Literal, get_args

from warpflat.pattern.drafting.words import translate

__all__ = ["INCH", "UNITS", "Units", "cloth_words", "length_words", "name_in_units"]

#: Units of a pattern's words.
Units = Literal["mm", "cm", "in"]
UNITS = get_args(Units)
INCH = 0.0254
YARD = 0.9144
#: A length is written as sixteenths of an inch if they are as near as this [m], or as a fiftieth of it: an allowance is not rounded.
FRACTION = 0.0002


def length_words(length: float, units: str = "cm") -> str:
    """Return a length [m] in words: "10 mm", "1 cm", "35.5 cm", "3/8 in", "0.39 in", "13 15/16 in"."""
    if units == "mm":
        return _number(f"{round(1000 * length, 1):g}") + " mm"
    if units == "cm":
        # Allowances are given to half a millimetre.
        return _number(f"{round(100 * length, 2 if length < 0.1 else 1):g}") + " cm"
    whole, sixteenths = divmod(round(length / INCH * 16), 16)
    if abs((whole + sixteenths / 16) * INCH - length) > max(FRACTION, 0.02 * length):
        return _number(f"{length / INCH:.2f}") + " in"
    return f"{_with_fraction(whole, sixteenths, 16)} in"


def cloth_words(length: float, units: str = "cm", *, of_width: bool = False) -> str:
    """Return a length of cloth [m] as it is bought: up to the next 5 cm or eighth of a yard; a width is rounded."""
    if units != "in":
        return (
            f"{round(100 * length)} cm" if of_width else _number(f"{5 * ceil(length / 0.05 - 1e-9) / 100:.2f}") + " m"
        )
    if of_width:
        return f"{round(length / INCH)} in"
    whole, eighths = divmod(ceil(length / YARD * 8 - 1e-9), 8)
    return f"{_with_fraction(whole, eighths, 8)} yd"


def name_in_units(name: str, units: str) -> str:
    """Return the name of a line, such as "invisible zip 200 mm", with the length at its end in the units of a pattern."""
    return re.sub(r"\b(\d+(?:\.\d+)?) mm$", lambda found: length_words(float(found[1]) / 1e3, units), name)


def _number(digits: str) -> str:
    """Return a number with the decimal mark of the present words."""
    return digits.replace(".", translate("."))


def _with_fraction(whole: int, parts: int, of: int) -> str:
    while parts and parts % 2 == 0:
        parts, of = parts // 2, of // 2
    if not parts:
        return str(whole)
    return f"{whole} {parts}/{of}" if whole else f"{parts}/{of}"
