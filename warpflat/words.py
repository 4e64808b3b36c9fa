"""Words of messages, and names of files."""

from __future__ import annotations

import unicodedata

__all__ = ["counted", "plain_letters"]

#: Letters that are no letter with an accent.
_LETTERS = str.maketrans(
    {"ß": "ss", "æ": "ae", "Æ": "Ae", "œ": "oe", "Œ": "Oe", "ø": "o", "Ø": "O", "ł": "l", "Ł": "L", "đ": "d", "Đ": "D"}
    | {"ð": "d", "Ð": "D", "þ": "th", "Þ": "Th", "ı": "i"}
)


def counted(number: int, what: str) -> str:
    """ "1 piece", "2 pieces", "1,200 pieces"."""
    return f"{number:,} {what}" + ("" if number == 1 else "s")


def plain_letters(text: str) -> str:
    """The text with its letters' accents dropped: "Ärmel" becomes "Armel"."""
    apart = unicodedata.normalize("NFKD", text.translate(_LETTERS))
    return "".join(letter for letter in apart if not unicodedata.combining(letter))
