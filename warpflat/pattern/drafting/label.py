"""The text on a pattern: its letters, DejaVu Sans, and what the label of a piece says."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray
from warpflat.pattern.drafting.measures import length_words
from warpflat.pattern.drafting.names import size_words
from warpflat.pattern.drafting.pieces import Piece
from warpflat.pattern.drafting.polygons import rotation
from warpflat.pattern.drafting.words import as_sentence, translate

if TYPE_CHECKING:
    from reportlab.pdfbase.ttfonts import TTFont

__all__ = [
    "BOLD",
    "CAPITALS",
    "FONT",
    "LEADING",
    "TAILS",
    "TEXT",
    "TITLE",
    "Label",
    "Words",
    "allowances_of",
    "box_around",
    "cutting_words",
    "embedded_font",
    "label_lines",
    "printed_size",
    "text_width",
    "wrap_text",
]


FONT, BOLD = "DejaVuSans", "DejaVuSans-Bold"
#: Height of capitals over the font's size.
CAPITALS = 0.729
#: Height of capitals [m]: the piece's name, the other lines; and the distance of lines as a multiple of it.
TITLE, TEXT, LEADING = 0.007, 0.0045, 1.55
#: Height of letters with tails below, over that of capitals.
TAILS = 1.6


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

    def box(self) -> FloatArray:
        """Return the corners of what it covers, 4 by 2 [m]; tails below the line count."""
        return box_around(self.at, text_width(self.text, self.height, bold=self.bold), self.height * TAILS, self.angle)


def box_around(at: FloatArray, width: float, height: float, angle: float = 0.0) -> FloatArray:
    """Return the corners of a box around its centre, turned by an angle [rad], counter-clockwise from the lower left, 4 by 2."""
    corners = np.array([width, height]) / 2 * [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    return np.asarray(at + corners @ rotation(angle).T)


@cache
def embedded_font(name: str) -> TTFont:
    """Return FONT or BOLD for PDF files."""
    from reportlab.pdfbase.ttfonts import TTFont

    # The fonts have most of the world's letters and come with matplotlib; importing that takes longer than writing a pattern.
    found = find_spec("matplotlib")
    assert found is not None
    assert found.origin is not None
    return TTFont(name, str(Path(found.origin).parent / "mpl-data" / "fonts" / "ttf" / f"{name}.ttf"))


def text_width(text: str, height: float, *, bold: bool = False) -> float:
    """Return the width [m] of one line whose capitals are `height` [m] high."""
    # In thousandths of the font's size; letters that the font lacks are, in other fonts, no wider than their body.
    widths = embedded_font(BOLD if bold else FONT).face.charWidths
    return sum(widths.get(ord(letter), 1000) / 1000 for letter in text) * height / CAPITALS


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


@dataclass(frozen=True, kw_only=True, eq=False)
class Label:
    """Lines of text, centred.

    Attributes:
        at: the centre [m].
        lines: (text, height of capitals [m]) from top to bottom, the first in bold; a line break parts the rows of a
            line.
        angle: [rad] counter-clockwise.
        leader: 2 by 2 [m], from a label beside its piece to the cloth; None where the label stands on the piece.
    """

    at: FloatArray
    lines: tuple[tuple[str, float], ...]
    angle: float = 0.0
    leader: FloatArray | None = None

    @property
    def rows(self) -> list[tuple[str, float, bool]]:
        """(text, height of capitals [m], whether it is bold) from top to bottom."""
        return [(row, height, k == 0) for k, (text, height) in enumerate(self.lines) for row in text.split("\n")]

    @property
    def height(self) -> float:
        """Height of the whole block [m], at right angles to its lines."""
        return sum(height * LEADING for _, height, _ in self.rows)

    @property
    def width(self) -> float:
        """Width of the widest row [m]."""
        return max(text_width(text, height, bold=bold) for text, height, bold in self.rows)

    @property
    def box(self) -> FloatArray:
        """Corners of the block, 4 by 2 [m]."""
        return box_around(self.at, self.width, self.height, self.angle)

    def words(self) -> list[Words]:
        """Return each row at its place."""
        words, y = [], self.height / 2
        for text, height, bold in self.rows:
            y -= height * LEADING
            at = self.at + rotation(self.angle) @ [0.0, y + height * LEADING / 2]
            words.append(Words(text=text, at=at, height=height, angle=self.angle, bold=bold))
        return words

    def scaled(self, factor: float) -> Label:
        """Return the label in another size, about its centre."""
        return replace(self, lines=tuple((text, height * factor) for text, height in self.lines))


def label_lines(piece: Piece, garment: str) -> tuple[str, ...]:
    """Return what a label says: name, size, how to cut the piece, cloth, included allowances, garment."""
    lines = [piece.printed_name.upper()]
    if piece.size:
        lines.append(as_sentence(printed_size(piece.size)))
    cloths = piece.cloths.items()
    lines += [cutting_words(piece, count) + (f" - {cloth}" if cloth else "") for cloth, count in cloths]
    allowances = []
    for kind, values in allowances_of(((edge.kind, edge.width) for edge in piece.edges), piece.units).items():
        # The unit once: "6/10 mm".
        numbers = [value.removesuffix(f" {piece.units}") for value in values]
        widths = f"{'/'.join(numbers) if piece.units != 'in' else ', '.join(numbers)} {piece.units}"
        allowances.append(translate(f"{kind} {{widths}}", widths=widths))
    if allowances:
        lines.append(translate("Includes {allowances}", allowances=", ".join(allowances)))
    title = garment.replace("_", " ")
    if title.upper() != lines[0]:
        lines.append(title)
    return tuple(lines)


def allowances_of(edges: Iterable[tuple[str, float]], units: str) -> dict[str, list[str]]:
    """Return the different allowances of seams and of hems among edges, of which each gives its kind and its width [m], in words.

    The legs of a dart that is cut away are sewn as a seam, and what is turned in has as much.
    """
    widths: dict[str, set[float]] = {"seam": set(), "hem": set()}
    for kind, width in edges:
        if kind in ("seam", "hem", "dart", "cut") and width > 0:
            widths["hem" if kind == "hem" else "seam"].add(round(width, 4))
    return {kind: [length_words(width, units) for width in sorted(row)] for kind, row in widths.items() if row}


def cutting_words(piece: Piece, count: int) -> str:
    """Return how often a piece is cut from a cloth, and how."""
    if piece.on_fold:
        return translate("Cut {count} on fold", count=count)
    if mirrored := sum(piece.turned_over(count)):
        return translate("Cut {count}, {mirrored} mirrored", count=count, mirrored=mirrored)
    return translate("Cut {count}", count=count)


def printed_size(*sizes: str) -> str:
    """Return the words for a size, or for several, as they are printed."""
    if len(sizes) > 1:
        return translate("sizes {sizes}", sizes=", ".join(sizes))
    (size,) = sizes
    return translate("size {size}", size=size) if size_words(size) != size else translate(size)
