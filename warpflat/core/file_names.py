"""Checks of names that become names of files, on every system."""

from __future__ import annotations

import re
import unicodedata

from warpflat.core.errors import InputError
from warpflat.core.text import control_in, quote_value

__all__ = [
    "check_file_name",
    "check_label",
    "make_file_name",
    "plain_label",
    "same_file",
]

# Hidden beginnings, separators and drives lead elsewhere; the others Windows refuses.
_FORBIDDEN = '/\\:*?"<>|'
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)
# File systems take 255; there is room left for what is added, as ".marker.svg" and the temporary name's digits.
_MOST_BYTES = 200


def check_file_name(name: str) -> str:
    """Return a name if a file can have it on any system.

    Raises:
        InputError: it is no text, empty, too long, leads to another folder, or is refused by some system.
    """
    reason = ""
    if not isinstance(name, str):
        reason = "it is no text"
    elif not name.strip():
        reason = "it is empty"
    elif forbidden := next(filter(_is_forbidden, name), ""):
        reason = f"it has {forbidden!r} in it"
    elif name.startswith("."):
        reason = "it begins with a dot, and would be hidden"
    elif _is_device(name):
        reason = "Windows keeps it for a device"
    elif (length := len(name.encode())) > _MOST_BYTES:
        reason = f"it takes {length} bytes, {_MOST_BYTES} are the most"
    if reason:
        raise InputError(
            f"{quote_value(name)} cannot name a file: {reason}; letters of any language, digits, spaces, - and _ can"
        )
    return name


def check_label(label: str, what: str) -> str:
    """Return the name of a line, an edge or a size if it is text in one line, which every format can hold.

    Raises:
        InputError: it is no text, empty, or has a control character in it; `what` says of what it is the name.
    """
    if not isinstance(label, str) or not label.strip():
        raise InputError(f"{what}: {quote_value(label)} is no name; a name is a text that is not empty")
    if letter := control_in(label):
        raise InputError(
            f"{what}: the name {quote_value(label)} has the control character {letter!r} in it; leave it out"
        )
    return label


def plain_label(label: str) -> str:
    """Return the name of a line read from a file, with "_" for control characters."""
    return "".join("_" if control_in(letter) else letter for letter in label)


def make_file_name(name: str) -> str:
    """Return a name that was not chosen for a file, such as that of a node in a scene, changed so that a file can have it."""
    plain = "".join("_" if _is_forbidden(letter) else letter for letter in name).strip().lstrip(".")
    short = plain.encode()[:_MOST_BYTES].decode(errors="ignore")
    return f"_{short}" if _is_device(short) else short or "piece"


def same_file(name: str) -> str:
    """Return a key that is equal for names of one file on Windows or macOS, where capitals and composition do not count."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def _is_device(name: str) -> bool:
    return bool(_DEVICES.fullmatch(name.split(".")[0].strip()))


def _is_forbidden(letter: str) -> bool:
    return letter in _FORBIDDEN or bool(control_in(letter))
