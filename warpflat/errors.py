"""What goes wrong because of the user's input."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = ["InputError", "nearest"]


class InputError(ValueError):
    """Bad input. The message is one line: what is wrong, where, and what would be right.

    The command line prints it and exits with code 2; scripts catch it as a ``ValueError``.
    """


def nearest(word: str, valid: Iterable[str]) -> str:
    """The end of a message about an unknown `word`: the nearest valid one, then all of them."""
    options = sorted(valid)
    # Somebody who writes EMT_warp means emt_warp.
    plain = {option.lower(): option for option in reversed(options)}
    close = difflib.get_close_matches(word.lower(), plain, n=1, cutoff=0.5)
    guess = f"did you mean {plain[close[0]]!r}? " if close else ""
    return f"{guess}valid: {', '.join(options) if options else 'none'}"
