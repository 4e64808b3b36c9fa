"""What sizes, darts, edges and their lines are called."""

from __future__ import annotations

import re
from collections.abc import Container

from warpflat.core import without_side

__all__ = ["MADE_TO_MEASURE", "dart_words", "line_name", "name_without_number", "size_words", "unnumbered"]

#: The size of what is made to somebody's own measures; after a size's name where these replace some of the size's.
MADE_TO_MEASURE = "made to measure"


def size_words(size: str) -> str:
    """Return the words for a size: "size EU 38", "size EU 38 made to measure", "made to measure"."""
    return size if size == MADE_TO_MEASURE else f"size {size}"


def dart_words(name: str) -> str:
    """Return what a dart is called: "waist dart left", "dart bust"; the word is said once."""
    return name if "dart" in without_side(name).split(" ") else f"dart {name}"


def line_name(name: str) -> str:
    """Return what the line of an edge is called, without side and number: the neck of "neck left 2"."""
    return unnumbered(without_side(name))


def unnumbered(name: str) -> str:
    """Return a name without its number, which tells it from others of its kind: the waist of "waist 2", the side of "side.1"."""
    return re.sub(r"([ .]\d+)+$", "", name)


def name_without_number(name: str, names: Container[str]) -> str:
    """Return "waist" for "waist 2" where `names` has a "waist", of which that is a further stretch; else the name itself."""
    line, _, number = name.rpartition(" ")
    return line if number.isdigit() and line in names else name
