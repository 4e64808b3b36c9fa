"""Text of messages."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Container, Iterable

__all__ = [
    "area_words",
    "control_in",
    "energy_words",
    "find_unused_name",
    "format_count",
    "list_some",
    "one_line",
    "other_side",
    "quote_value",
    "without_side",
]

#: Letters of a message, of one of its words (a path may be one), and of the user's own words in it, at most.
LONGEST_LINE, LONGEST_WORD, LONGEST_SHOWN = 1500, 300, 60


def format_count(number: int, what: str) -> str:
    """Return a number with its noun: "1 piece", "2 pieces", "1,200 pieces"."""
    return f"{number:,} {what}" + ("" if number == 1 else "s")


def list_some(entries: Iterable[object], most: int = 8) -> str:
    """Return the first of a list and the number of the others: "3, 4, 9 and 12 more"."""
    row = list(entries)
    shown = ", ".join(map(str, row[:most]))
    return shown if len(row) <= most else f"{shown} and {len(row) - most:,} more"


def area_words(area: float) -> str:
    """Return an area [m2] in words: "1,207 cm2", "2.4 cm2"."""
    return f"{1e4 * area:,.0f} cm2" if 1e4 * area >= 10.0 else f"{1e4 * area:.2g} cm2"


def without_side(name: str) -> str:
    """Return a name without its side, left or right: the shoulder of "shoulder left"; underscores become spaces."""
    words = name.replace("_", " ").split(" ")
    return " ".join(word for word in words if word not in ("left", "right")) or name


def other_side(name: str) -> str:
    """Return a name with left and right exchanged."""
    swapped = {"left": "right", "right": "left"}
    return "".join(swapped.get(word, word) for word in re.split("([ _])", name))


def control_in(text: str, allowed: str = "") -> str:
    """Return the first control character of a text that is not `allowed`, or nothing.

    These are the ones that no line of text holds: what XML forbids, what breaks a line, and what turns the direction of writing, so
    that a name is not what it looks like.
    """
    if text.isprintable():  # as nearly all are
        return ""
    return next((letter for letter in text if _is_control(letter) and letter not in allowed), "")


def _is_control(letter: str) -> bool:
    if letter.isascii():
        return not letter.isprintable()
    if "\u202a" <= letter <= "\u202e" or "\u2066" <= letter <= "\u2069" or ord(letter) & 0xFFFE == 0xFFFE:
        return True
    return unicodedata.category(letter) in ("Cc", "Cs", "Zl", "Zp")


def energy_words(joules: float) -> str:
    """Return an energy in J, or in mJ if it is below one; what is below a microjoule is rounding."""
    if abs(joules) < 1e-6:
        return "0 mJ"
    number, unit = (joules, "J") if abs(joules) >= 1.0 else (1e3 * joules, "mJ")
    # Not 1e+02 for 104.
    return f"{float(f'{number:.3g}'):,.15g} {unit}"


def quote_value(value: object) -> str:
    """Return a value as messages quote it: in one line, control characters escaped, a long one without its middle."""
    try:
        return _shortened(repr(value), LONGEST_SHOWN)
    except (ValueError, RecursionError):
        return "a value too long to be shown"  # a number of thousands of digits, thousands of lists in each other


def one_line(text: str) -> str:
    """Return a message in one line, control characters escaped, very long parts without their middle."""
    line = " ".join(part.strip() for part in text.splitlines())
    plain = "".join(repr(letter)[1:-1] if _is_control(letter) else letter for letter in line)
    words = re.sub(rf"\S{{{LONGEST_WORD + 1},}}", lambda word: _shortened(word[0], LONGEST_WORD), plain)
    return _shortened(words, LONGEST_LINE)


def _shortened(text: str, most: int) -> str:
    half = (most - 3) // 2
    return text if len(text) <= most else f"{text[:half]}...{text[-half:]}"


def find_unused_name(name: str, taken: Container[str], *, joint: str = " ") -> str:
    """Return the name itself if it is not in `taken`, else "name 2" or the first number after that which is free, joined so."""
    number = 2
    while f"{name}{joint}{number}" in taken:
        number += 1
    return f"{name}{joint}{number}" if name in taken else name
