"""Words of messages, and names of files."""

from __future__ import annotations

import unicodedata

__all__ = ["MADE_TO_MEASURE", "counted", "plain_letters", "size_words"]

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


def plain_letters(text: str) -> str:
    """The text with its letters' accents dropped: "Ärmel" becomes "Armel"."""
    apart = unicodedata.normalize("NFKD", text.translate(_LETTERS))
    return "".join(letter for letter in apart if not unicodedata.combining(letter))
