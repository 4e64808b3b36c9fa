"""Printed words in other languages: one table for names of pieces, edges and seams, and for what the pages say.

English is what the code says. A table gives other words for whole phrases, with the same places in braces, and for names: the
longest run of a name's words that the table has is replaced, then the next. What the table lacks stays English.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import resources

from warpflat.core import read_toml

__all__ = ["as_sentence", "language_words", "letters_of", "listed", "printed_in", "translate", "translate_name"]

_EMPTY: Mapping[str, str] = {}
_table: ContextVar[Mapping[str, str]] = ContextVar("words", default=_EMPTY)


@functools.cache
def language_words(language: str) -> Mapping[str, str]:
    """Return the table of a language, ``"en"`` or ``"de"``: what is printed, by the English phrase or name."""
    if language == "en":
        return _EMPTY
    with resources.as_file(resources.files("warpflat.pattern.drafting") / f"data/words_{language}.toml") as path:
        tables = read_toml(path)
    return {**tables["names"], **tables["phrases"]}


@contextmanager
def printed_in(words: Mapping[str, str]) -> Iterator[None]:
    """Print in the words of a table within this context."""
    token = _table.set(words)
    try:
        yield
    finally:
        _table.reset(token)


def translate(phrase: str, **values: object) -> str:
    """Return a phrase in the present words, with its values in their places."""
    try:
        return _table.get().get(phrase, phrase).format(**values)
    except (LookupError, ValueError):
        # A translation with other places in braces than the phrase has.
        return phrase.format(**values)


def as_sentence(words: str) -> str:
    """Return words with a capital at their beginning."""
    return words[0].upper() + words[1:]


def translate_name(name: str) -> str:
    """Return the name of a piece, an edge or a seam in the present words."""
    table = _table.get()
    if not table:
        return name
    words, found = name.replace("_", " ").split(" "), list[str]()
    while words:
        count = next((k for k in range(len(words), 0, -1) if " ".join(words[:k]) in table), 0)
        found.append(table[" ".join(words[:count])] if count else words[0])
        words = words[max(count, 1) :]
    return " ".join(found)


def listed(names: Sequence[str]) -> str:
    """Return one or more names as a list in the present words: "a, b and c"."""
    both = f" {translate('and')} "
    return both.join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]


def letters_of(number: int) -> str:
    """Return A, B, ... Z, AA, AB, ... for 0, 1, ..."""
    letters, number = "", number + 1
    while number:
        number, digit = divmod(number - 1, 26)
        letters = chr(ord("A") + digit) + letters
    return letters
