"""Letters of every script: the fonts of pictures, and the title of a piece whose name no font can write."""

from __future__ import annotations

import functools
import unicodedata
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager

__all__ = ["all_letters", "is_drawn", "note_on_names", "plain_letters", "titles"]

# Fonts that come with common systems; matplotlib's own font knows Latin, Greek, Cyrillic, Arabic, Hebrew and some more.
_FONTS_OF_OTHER_SCRIPTS = (
    "Noto Sans CJK SC", "Noto Sans CJK JP", "Noto Sans SC", "Source Han Sans SC", "WenQuanYi Micro Hei", "WenQuanYi Zen Hei",
    "Droid Sans Fallback", "Noto Sans Devanagari", "Noto Sans Bengali", "Noto Sans Thai", "Microsoft YaHei", "SimHei", "Yu Gothic",
    "MS Gothic", "Malgun Gothic", "Nirmala UI", "Leelawadee UI", "PingFang SC", "Hiragino Sans GB", "Hiragino Sans",
    "Apple SD Gothic Neo", "Arial Unicode MS", "Nanum Gothic", "NanumGothic", "Unifont",
)  # fmt: skip

#: Letters that are no letter with an accent.
_LETTERS = str.maketrans(
    {"ß": "ss", "æ": "ae", "Æ": "Ae", "œ": "oe", "Œ": "Oe", "ø": "o", "Ø": "O", "ł": "l", "Ł": "L", "đ": "d", "Đ": "D"}
    | {"ð": "d", "Ð": "D", "þ": "th", "Þ": "Th", "ı": "i"}
)


@contextmanager
def all_letters() -> Iterator[None]:
    """Draw with whatever fonts are installed; a letter that none of them has is a box, without a warning for each.

    No name is read as a formula, whatever dollar signs it has.
    """
    import matplotlib

    with matplotlib.rc_context({"font.family": _families(), "text.parse_math": False}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r"Glyph \d+ ")
        yield


def is_drawn(text: str) -> bool:
    """Return whether pictures have all letters of a text."""
    return text.isascii() or {ord(letter) for letter in text} <= _known(_families())


def titles(names: Sequence[str], is_written: Callable[[str], bool]) -> dict[str, str]:
    """Return what is written for each name: itself, or "piece", "piece 2" and so on if it cannot be written."""
    unused = (title for title in ("piece", *(f"piece {n}" for n in range(2, 2 * len(names) + 2))) if title not in names)
    return {name: name if is_written(name) else next(unused) for name in names}


def note_on_names(names: Iterable[str]) -> tuple[str, ...]:
    """Return a sentence on the pieces that pictures cannot name, or none."""
    renamed = [f"{name!r} is {title!r}" for name, title in titles(list(names), is_drawn).items() if title != name]
    return (f"no installed font can write all names: in pictures {', '.join(renamed)}",) if renamed else ()


def _families() -> tuple[str, ...]:
    """Return the installed font families that are used, in order of preference."""
    import matplotlib
    from matplotlib.font_manager import fontManager

    first = matplotlib.rcParams["font.family"]
    installed = {font.name for font in fontManager.ttflist}
    return tuple(dict.fromkeys([*first, *(name for name in _FONTS_OF_OTHER_SCRIPTS if name in installed)]))


@functools.cache
def _known(families: tuple[str, ...]) -> frozenset[int]:
    """Return the code points that these fonts have."""
    from matplotlib.font_manager import FontProperties, findfont, get_font

    files = [findfont(FontProperties(family=[family])) for family in families]
    return frozenset().union(*(get_font(file).get_charmap() for file in files))


def plain_letters(text: str) -> str:
    """Return a text without the accents of its letters: "Ärmel" becomes "Armel"."""
    apart = unicodedata.normalize("NFKD", text.translate(_LETTERS))
    return "".join(letter for letter in apart if not unicodedata.combining(letter))
