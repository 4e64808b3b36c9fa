"""The letters of every drawing of a pattern, DejaVu Sans: how wide a text is, and where its lines are broken."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from warpflat.core.arrays import FloatArray

__all__ = ["BOLD", "CAPITALS", "FONT", "Words", "font_file", "text_width", "wrapped"]

FONT, BOLD = "DejaVuSans", "DejaVuSans-Bold"
#: Height of capitals over the font's size.
CAPITALS = 0.729
#: Width over the font's size of letters that the font lacks: other fonts' are no wider than their body.
UNKNOWN = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Words:
    """One line of text, centred on `at` [m]; `height` of its capitals [m], `angle` [rad] counter-clockwise.

    A `tag` names a size on its own line: it takes that line's colour, on a white ground.
    """

    text: str
    at: FloatArray
    height: float
    angle: float = 0.0
    bold: bool = False
    tag: bool = False


def font_file(name: str) -> Path:
    """The file of FONT or BOLD: it knows most of the world's letters, and comes with matplotlib."""
    import matplotlib

    return Path(matplotlib.get_data_path()) / "fonts" / "ttf" / f"{name}.ttf"


def text_width(text: str, height: float, *, bold: bool = False) -> float:
    """Width [m] of one line whose capitals are `height` [m] high."""
    widths = _widths(BOLD if bold else FONT)
    return sum(widths.get(ord(letter), UNKNOWN) for letter in text) * height / CAPITALS


@cache
def _widths(name: str) -> dict[int, float]:
    """Width over the font's size of each letter, by code point."""
    from reportlab.pdfbase.ttfonts import TTFontFile

    return {code: width / 1000 for code, width in TTFontFile(str(font_file(name))).charWidths.items()}


def wrapped(text: str, height: float, width: float, *, bold: bool = False) -> str:
    """The text with its spaces turned into line breaks where a line would be wider [m]; words stay whole."""
    rows: list[str] = []
    for word in text.split():
        longer = f"{rows[-1]} {word}" if rows else word
        if rows and text_width(longer, height, bold=bold) <= width:
            rows[-1] = longer
        else:
            rows.append(word)
    return "\n".join(rows)
