"""Errors in the user's input."""

from __future__ import annotations

import difflib
import numbers
from collections.abc import Collection, Iterable, Mapping
from typing import TypeGuard

from warpflat.core.text import list_some, one_line, quote_value

__all__ = [
    "SIGNALS",
    "CannotWriteError",
    "InputError",
    "StepError",
    "expect",
    "expect_callback",
    "expect_each",
    "expect_within",
    "is_number",
    "nearest",
    "system_reason",
]


#: Valid words that a message lists at most.
MOST_LISTED = 40
#: Letters of a word by which the nearest one is found: comparing takes their square.
LONGEST_COMPARED = 200

#: Signals that have asked the program to end. A library may make an error of its own of one, which is no fault of a picture.
SIGNALS: list[int] = []


class InputError(ValueError):
    """Bad input. The message is one line: what is wrong, where, and what would be right.

    The command line prints it and exits with code 2; scripts catch it as a ``ValueError``. Whatever names of the user's the message
    quotes, it stays one line, of bounded length and without control characters.
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(one_line(message))


class CannotWriteError(InputError):
    """A file cannot be written: its place, the disk, or a file of the user's there is what the user must see to."""


class StepError(InputError):
    """A step cannot be taken with what the steps before it have made, which is no mistake of the user's: a run goes on without it."""


def system_reason(error: OSError) -> str:
    """Return what the system says of an error, such as "no space left on device", to be part of a sentence."""
    return (error.strerror or str(error)).lower()


def expect(value: object, kind: type | tuple[type, ...], name: str, right: str) -> None:
    """Check the type of an argument.

    Args:
        value: what was given.
        kind: the type, or several.
        name: of the argument.
        right: what would be right, in words.

    Raises:
        InputError: it is of another type.
    """
    if not isinstance(value, kind):
        raise InputError(f"{name} is of type {type(value).__name__}; it must be {right}")


def expect_each(values: object, kind: type | tuple[type, ...], name: str, right: str) -> None:
    """Check that an argument is a list, and the type of its entries.

    Args:
        values: what was given.
        kind: the type of each, or several.
        name: of the argument.
        right: what each must be, in words.

    Raises:
        InputError: it is no list, or one of its entries is of another type.
    """
    if isinstance(values, (str, bytes)) or not isinstance(values, Collection):
        raise InputError(f"{name} is of type {type(values).__name__}; it must be a list, each of its entries {right}")
    for number, value in enumerate(values):
        expect(value, kind, f"{name}[{number}]", right)


def expect_callback(callback: object) -> None:
    """Check that a callback can be called or is None.

    Raises:
        InputError: it cannot.
    """
    if callback is not None and not callable(callback):
        raise InputError(f"callback is of type {type(callback).__name__}; it must be a function, or None")


def is_number(value: object, *, whole: bool = False) -> TypeGuard[float]:
    """Return whether a value is a number of Python or NumPy, or a whole one if asked; True and False are not."""
    return isinstance(value, numbers.Integral if whole else numbers.Real) and not isinstance(value, bool)


def expect_within(options: object, bounds: Mapping[str, tuple[float, float]], what: str) -> None:
    """Raise InputError unless attributes lie within their bounds; one whose default is a whole number must be one.

    Args:
        options: of a class whose attributes have defaults.
        bounds: by attribute, its least and its largest value.
        what: the word before its name, as "relax".

    Raises:
        InputError: one does not.
    """
    for name, (lowest, highest) in bounds.items():
        value, whole = getattr(options, name), isinstance(getattr(type(options), name), int)
        if not is_number(value, whole=whole) or not lowest <= value <= highest:
            kind = "whole number" if whole else "number"
            raise InputError(f"{what}: {name} = {value!r}; must be a {kind} between {lowest:g} and {highest:g}")


def nearest(word: str, valid: Iterable[str]) -> str:
    """Return the end of a message about an unknown word: the nearest valid one, and the list of valid ones."""
    options = sorted(valid)
    # Somebody who writes EMT_warp means emt_warp.
    plain = {option.lower(): option for option in reversed(options)}
    close = difflib.get_close_matches(word[:LONGEST_COMPARED].lower(), plain, n=1, cutoff=0.5)
    guess = f"did you mean {quote_value(plain[close[0]])}? " if close else ""
    listed = list_some((quote_value(option)[1:-1] for option in options), MOST_LISTED)
    return f"{guess}valid: {listed or 'none'}"
