"""Names of plain letters, of scenes and cuts: they are typed in a shell, and are part of other names."""

from __future__ import annotations

import re

from warpflat.core import quote_value
from warpflat.pattern import plain_letters

__all__ = ["plain_name", "with_plain_letters"]


def with_plain_letters(name: str, others: str = "_.-") -> str:
    """Return a name of plain letters that is like another one: "Ärmel (1)" becomes "Armel_1"; it may be empty."""
    return re.sub(rf"[^A-Za-z0-9{re.escape(others)}]+", "_", plain_letters(name)).strip(others)


def plain_name(name: str, others: str = " _.-") -> str:
    """Return the name of a scene or cut if it has plain letters only, since it is typed in a shell and part of other names.

    Raises:
        ValueError: it has letters beyond A to Z, a to z, 0 to 9 and `others`, or does not begin with one of the former.
    """
    if re.fullmatch(rf"[A-Za-z0-9][A-Za-z0-9{re.escape(others)}]*", name):
        return name
    better = with_plain_letters(name, others)
    hint = f"; {quote_value(better)} would do" if better else ""
    raise ValueError(
        f"{quote_value(name)} cannot name files: it must begin with one of a to z, A to Z, 0 to 9, and may have besides them only "
        f"{'spaces and ' if ' ' in others else ''}{' '.join(others.strip())}{hint}"
    )
