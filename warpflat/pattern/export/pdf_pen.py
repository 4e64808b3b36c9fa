"""Lines and words on a page of a PDF, in metres from its lower left; drawn by reportlab."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import FloatArray
from warpflat.pattern.drafting.label import BOLD, CAPITALS, FONT, Words, text_width
from warpflat.pattern.drafting.measures import INCH
from warpflat.pattern.drafting.polygons import mapped
from warpflat.pattern.drafting.words import translate

if TYPE_CHECKING:
    from warpflat.pattern.export.pdf_tiling import Paper

__all__ = ["POINT", "draw_line", "draw_words", "page_footer", "write"]

#: Points per metre.
POINT = 72 / INCH


def draw_line(
    canvas: Any, points: FloatArray, *, width: float | None = None, closed: bool = False, filled: bool = False
) -> None:
    """Draw a polyline.

    Args:
        canvas: reportlab's, with its colours and dashes.
        points: #P by 2 [m].
        width: [pt]; that of the canvas if not given.
        closed: whether the last point joins the first.
        filled: whether what it encloses has the canvas' fill colour.
    """
    if width is not None:
        canvas.setLineWidth(width)
    first, *others = points * POINT
    path = canvas.beginPath()
    path.moveTo(*first)
    for point in others:
        path.lineTo(*point)
    if closed:
        path.close()
    canvas.drawPath(path, stroke=1, fill=int(filled))


def write(canvas: Any, x: float, y: float, text: str, size: float, *, bold: bool = False, width: float = 1.0) -> None:
    """Write a black text at a size [pt] from a place [m] on, smaller where it would be wider than `width` [m]."""
    wide = text_width(text, size * CAPITALS / POINT, bold=bold)
    canvas.setFillColor("#000000")
    canvas.setFont(BOLD if bold else FONT, size * min(1.0, width / max(wide, 1e-9)))
    canvas.drawString(x * POINT, y * POINT, text)


def draw_words(canvas: Any, words: Words, matrix: FloatArray, colour: str = "#000000") -> None:
    """Draw one line of text, centred, under a 2 by 3 matrix, never upside down; a tag on a white ground."""
    font, size = (BOLD if words.bold else FONT), words.height / CAPITALS * POINT
    angle = float(np.degrees(words.angle + np.arctan2(matrix[1, 0], matrix[0, 0])))
    angle = (angle + 89.5) % 180.0 - 89.5
    canvas.saveState()
    canvas.translate(*(mapped(words.at, matrix) * POINT))
    canvas.rotate(angle)
    if words.tag:
        half = canvas.stringWidth(words.text, font, size) / 2 + 2
        canvas.setFillColor("#ffffff")
        canvas.rect(-half, -words.height * POINT * 0.75, 2 * half, words.height * POINT * 1.5, stroke=0, fill=1)
    canvas.setFillColor(colour)
    canvas.setFont(font, size)
    canvas.drawCentredString(0, -words.height / 2 * POINT, words.text)
    canvas.restoreState()


def page_footer(canvas: Any, name: str, paper: Paper, words: str) -> None:
    """Write what a page is of at its foot."""
    canvas.setFillColor("#555555")
    canvas.setFont(FONT, 7)
    line = f"{name.replace('_', ' ')}  -  {words}  -  {translate('{paper}, print at 100 %', paper=paper.name)}"
    canvas.drawCentredString(paper.width / 2 * POINT, (paper.margin - 0.0055) * POINT, line)
