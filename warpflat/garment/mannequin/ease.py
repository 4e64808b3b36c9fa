"""Wearing ease by level: presets, and what a scene or a form says of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from warpflat.core import InputError, is_number, nearest, quote_value
from warpflat.garment.mannequin.layout import EASED_LEVELS

__all__ = ["EASE_PRESETS", "EASE_RANGE", "ease_from"]

#: Least and greatest ease [cm].
EASE_RANGE = -30.0, 400.0


def _preset(bust: float, underbust: float, waist: float, hip: float, biceps: float) -> dict[str, float]:
    """Return the ease of all levels; the abdomen has the hip's, as what hangs from there, and the elbow the biceps'."""
    trunk = {
        "bust": bust,
        "underbust": underbust,
        "waist": waist,
        "abdomen": hip,
        "hip": hip,
        "thigh": hip,
        "knee": hip,
    }
    return {**trunk, "biceps": biceps, "elbow": biceps, "leg_thigh": hip}


#: Ease by preset and level [cm]. `close` is the usual wearing ease of a close block: bust 4 to 6, waist 2 to 3, hip 2 to 4,
#: biceps 4 to 5. The bust of the others lies in the ranges of the pattern companies' ease chart (McCall's, Butterick, Vogue):
#: semi-fitted 10.5 to 12.5, loose 13 to 20; their other levels are chosen, so that the garment hangs from the bust.
EASE_PRESETS: Mapping[str, Mapping[str, float]] = {
    "moulage": _preset(0.0, 0.0, 0.0, 0.0, 0.0),
    "close": _preset(5.0, 4.0, 2.5, 3.0, 4.5),
    "semi-fitted": _preset(11.0, 11.0, 10.0, 8.0, 7.0),
    "loose": _preset(17.0, 19.0, 20.0, 14.0, 10.0),
}


def ease_from(value: Any, where: str, *, base: Mapping[str, float] | None = None) -> dict[str, float]:
    """Read the ease of a form or a scene.

    Args:
        value: a preset's name, or a table of levels [cm], in which ``preset`` may give the others.
        where: what messages begin with.
        base: ease by level that holds for levels that are not named, unless there is a preset.

    Raises:
        InputError: an unknown preset or level, or a value that is no number in the valid range.
    """
    table = {"preset": value} if isinstance(value, str) else value
    if not isinstance(table, Mapping):
        raise InputError(f"{where}: ease = {quote_value(value)}: a preset or a table of levels is needed")
    found = dict(base or {})
    if "preset" in table:
        name = table["preset"]
        if name not in EASE_PRESETS:
            raise InputError(f"{where}: ease {quote_value(name)} is unknown: {nearest(str(name), EASE_PRESETS)}")
        found = dict(EASE_PRESETS[name])
    for level, ease in table.items():
        if level == "preset":
            continue
        if level not in EASED_LEVELS:
            raise InputError(
                f"{where}: ease: level {quote_value(level)} is unknown: {nearest(level, [*EASED_LEVELS, 'preset'])}"
            )
        if not is_number(ease) or not EASE_RANGE[0] <= ease <= EASE_RANGE[1]:
            raise InputError(
                f"{where}: ease: {level} = {quote_value(ease)}: a number from {EASE_RANGE[0]:g} to {EASE_RANGE[1]:g} cm is needed"
            )
        found[level] = float(ease)
    return found
