"""Words of messages, and names of files."""

from __future__ import annotations

import re
import unicodedata

__all__ = ["checked_name", "counted", "plain_letters"]

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


def checked_name(name: str, others: str = " _.-") -> str:
    """The name, if files may be called so.

    Raises:
        ValueError: it has letters beyond A to Z, a to z, 0 to 9 and `others`, or does not begin with one of the former.
    """
    if re.fullmatch(rf"[A-Za-z0-9][A-Za-z0-9{re.escape(others)}]*", name):
        return name
    better = re.sub(rf"[^A-Za-z0-9{re.escape(others)}]+", "_", plain_letters(name)).strip(others)
    hint = f"; {better!r} would do" if better else ""
    raise ValueError(
        f"{name!r} cannot name files: it must begin with one of a to z, A to Z, 0 to 9, and may have besides them only "
        f"{'spaces and ' if ' ' in others else ''}{' '.join(others.strip())}{hint}"
    )
