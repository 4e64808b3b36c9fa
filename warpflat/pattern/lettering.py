"""The letters of every drawing of a pattern, DejaVu Sans: the width of a text, and its line breaks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from warpflat.core.arrays import FloatArray

if TYPE_CHECKING:
    from reportlab.pdfbase.ttfonts import TTFont

__all__ = ["BOLD", "CAPITALS", "FONT", "Words", "embedded_font", "font_file", "text_width", "wrap_text"]

FONT, BOLD = "DejaVuSans", "DejaVuSans-Bold"
#: Height of capitals over the font's size.
CAPITALS = 0.729
#: Width over the font's size of letters that the font lacks: in other fonts they are no wider than their body.
UNKNOWN = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Words:
    """One line of text.

    Attributes:
        text: what it says.
        at: its centre [m].
        height: of its capitals [m].
        angle: [rad] counter-clockwise.
        bold: in bold letters.
        tag: names a size on that size's own line: in the line's colour, on a white ground.
    """

    text: str
    at: FloatArray
    height: float
    angle: float = 0.0
    bold: bool = False
    tag: bool = False


def font_file(name: str) -> Path:
    """Return the file of FONT or BOLD, which has most of the world's letters and comes with matplotlib."""
    found = find_spec("matplotlib")  # importing it takes longer than writing a pattern
    assert found is not None
    assert found.origin is not None
    return Path(found.origin).parent / "mpl-data" / "fonts" / "ttf" / f"{name}.ttf"


@cache
def embedded_font(name: str) -> TTFont:
    """Return FONT or BOLD for PDF files."""
    from reportlab.pdfbase.ttfonts import TTFont

    return TTFont(name, str(font_file(name)))


def text_width(text: str, height: float, *, bold: bool = False) -> float:
    """Return the width [m] of one line whose capitals are `height` [m] high."""
    widths = _widths(BOLD if bold else FONT)
    return sum(widths.get(ord(letter), UNKNOWN) for letter in text) * height / CAPITALS


@cache
def _widths(name: str) -> dict[int, float]:
    """Return the width of each letter over the font's size, by code point."""
    return {code: width / 1000 for code, width in embedded_font(name).face.charWidths.items()}


def wrap_text(text: str, height: float, width: float, *, bold: bool = False) -> str:
    """Turn spaces of a text into line breaks where a line would be wider than `width` [m]; words stay whole."""
    rows: list[str] = []
    for word in text.split():
        longer = f"{rows[-1]} {word}" if rows else word
        if rows and text_width(longer, height, bold=bold) <= width:
            rows[-1] = longer
        else:
            rows.append(word)
    return "\n".join(rows)
