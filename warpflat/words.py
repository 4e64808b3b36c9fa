"""Words of messages, and names of files."""

from __future__ import annotations

import unicodedata

__all__ = ["MADE_TO_MEASURE", "counted", "plain_letters", "shown", "size_words"]

#: Letters of the user's own words in a message, at most.
LONGEST_SHOWN = 60

#: The size of what is made to somebody's own measures; after a size's name where these replace some of the size's.
MADE_TO_MEASURE = "made to measure"

#: Letters that are no letter with an accent.
_LETTERS = str.maketrans(
    {"ß": "ss", "æ": "ae", "Æ": "Ae", "œ": "oe", "Œ": "Oe", "ø": "o", "Ø": "O", "ł": "l", "Ł": "L", "đ": "d", "Đ": "D"}
    | {"ð": "d", "Ð": "D", "þ": "th", "Þ": "Th", "ı": "i"}
)


def counted(number: int, what: str) -> str:
    """ "1 piece", "2 pieces", "1,200 pieces"."""
    return f"{number:,} {what}" + ("" if number == 1 else "s")


def size_words(size: str) -> str:
    """ "size EU 38", "size EU 38 made to measure", "made to measure"."""
    return size if size == MADE_TO_MEASURE else f"size {size}"


def shown(value: object) -> str:
    """A value of the user as messages quote it: in one line, control characters escaped, the middle left out of a long one."""
    try:
        return _shortened(repr(value), LONGEST_SHOWN)
    except (ValueError, RecursionError):
        return "a value too long to be shown"  # a number of thousands of digits, thousands of lists in each other


def _shortened(text: str, most: int) -> str:
    half = (most - 3) // 2
    return text if len(text) <= most else f"{text[:half]}...{text[-half:]}"


def plain_letters(text: str) -> str:
    """The text with its letters' accents dropped: "Ärmel" becomes "Armel"."""
    apart = unicodedata.normalize("NFKD", text.translate(_LETTERS))
    return "".join(letter for letter in apart if not unicodedata.combining(letter))
