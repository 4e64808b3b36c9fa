"""Patterns as PDF in true size: tiled on A4 or US Letter for home printers, whole on A0 for copy shops.

Every tile repeats a strip of its neighbours. Thin lines with half diamonds show where the next sheet goes; rows are
letters from the top, columns numbers from the left. The first page has test squares, an overview and instructions. The
file asks the printer not to scale.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.atomic_files import atomic_path
from warpflat.core.errors import InputError, nearest
from warpflat.export.pdf_legend import draw_legend, legend_page
from warpflat.export.pdf_tiling import LEGEND_SIZE, SIZE_COLOURS, SIZE_DASHES, Paper, Tiling, make_tiling
from warpflat.export.svg import OF_SIZE, STYLE
from warpflat.pattern.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.drawing import Stroke, draw_nest
from warpflat.pattern.layout import Sheet, lay_out, nests, occupied_points
from warpflat.pattern.lettering import BOLD, CAPITALS, FONT, Words, font_file

if TYPE_CHECKING:
    from reportlab.pdfgen.canvas import Canvas

__all__ = ["PAPERS", "write_pdf"]


#: Points per metre: a PDF's unit is 1/72 inch.
POINT = 72 / 0.0254


PAPERS = {
    "A4": Paper(name="A4", width=0.210, height=0.297, margin=0.010, overlap=0.010),
    "Letter": Paper(name="US Letter", width=0.2159, height=0.2794, margin=0.010, overlap=0.010),
    "A0": Paper(name="A0", width=0.841, height=1.189, margin=0.015, overlap=0.010),
}


def write_pdf(
    garment: DraftedGarment,
    path: str | os.PathLike[str],
    *,
    paper: str = "A4",
    sizes: Sequence[str] | None = None,
) -> Tiling:
    """Write the pattern for a printer.

    Args:
        garment: drafted.
        path: of the file.
        paper: "A4", "Letter" (tiled, with a first page of instructions) or "A0" (whole pieces wherever they fit).
        sizes: those to print; several lie upon each other as a nest, told apart by dashes and colour; None prints all.

    Returns:
        Which tiles were printed: tiles without any part of a piece are left out.

    Raises:
        InputError: unknown paper or size.
    """
    from reportlab.pdfgen.canvas import Canvas

    if paper not in PAPERS:
        raise InputError(f"unknown paper {paper!r}; {nearest(paper, PAPERS)}")
    chosen = tuple(garment.pieces) if sizes is None else tuple(sizes)
    for size in chosen:
        garment.garment.piece(next(iter(garment.pieces.values()))[0].name, size)
    groups = [tuple(p for p in nest if p.size in chosen) for nest in nests(garment)]
    kind = PAPERS[paper]
    sheet, tiling = _arranged(groups, kind)
    stream = BytesIO()
    canvas = Canvas(stream, pagesize=(kind.width * POINT, kind.height * POINT), invariant=1)
    _register_fonts()
    canvas.setTitle(f"{garment.name}, {' / '.join(chosen)}")
    canvas.setCreator("warpflat")
    canvas.setViewerPreference("PrintScaling", "None")
    _sheet_form(canvas, sheet, garment, chosen, kind)
    if kind.tiled:
        legend_page(canvas, garment, chosen, sheet, tiling)
    for row, column in tiling.tiles:
        _tile(canvas, tiling, row, column, garment.name.replace("_", " "))
    canvas.save()
    with atomic_path(path) as temporary:
        Path(temporary).write_bytes(stream.getvalue())
    return tiling


def _arranged(groups: list[tuple[DraftedPiece, ...]], paper: Paper) -> tuple[Sheet, Tiling]:
    """Return the layout that needs the fewest pages, over sheets of one to eight tiles' width."""
    step = paper.step
    widest = max(float(np.ptp(occupied_points(group)[:, 0])) for group in groups)
    best: tuple[Sheet, Tiling] | None = None
    for columns in range(1, 9 if paper.tiled else 2):
        width = columns * step[0] + paper.overlap
        if width < widest + 0.01 and columns < 8 and paper.tiled:
            continue
        if paper.tiled:
            sheet = lay_out(groups, width=width, gap=0.005)
        else:
            sheet = lay_out(groups, width=width, gap=0.016, page_height=float(step[1]), reserved=LEGEND_SIZE)
        tiling = make_tiling(sheet, paper)
        if best is None or _cost(tiling) < _cost(best[1]):
            best = sheet, tiling
    if best is None:
        raise InputError(f"a piece is {widest * 1000:.0f} mm wide, more than eight columns of {paper.name}")
    return best


def _cost(tiling: Tiling) -> float:
    """Return the number of pages, and a little for a long strip of them, which is hard to glue and to lay out."""
    return len(tiling.tiles) + 0.2 * (tiling.rows + tiling.columns)


def _register_fonts() -> None:
    """Register the fonts, which are embedded."""
    from reportlab.pdfbase import pdfmetrics
    from reportlab.pdfbase.ttfonts import TTFont

    for name in (FONT, BOLD):
        pdfmetrics.registerFont(TTFont(name, str(font_file(name))))


def _sheet_form(canvas: Canvas, sheet: Sheet, garment: DraftedGarment, sizes: Sequence[str], paper: Paper) -> None:
    """Draw the whole sheet once, as a form; every page shows its part of it."""
    border = 0.05
    low, high = np.array([-border, -3.0]), sheet.size + 3.0
    canvas.beginForm("sheet", *(low * POINT), *(high * POINT))
    for placed in sheet.placed:
        for index, drawing in enumerate(draw_nest(placed.pieces)):
            nested = len(placed.pieces) > 1
            for stroke in (stroke for stroke in drawing.strokes if not stroke.hidden):
                _stroke(canvas, stroke, placed.offset, index if nested else None)
            for words in drawing.words:
                _words(
                    canvas, words, placed.offset, SIZE_COLOURS[index % len(SIZE_COLOURS)] if words.tag else "#000000"
                )
    if sheet.reserved is not None:
        draw_legend(canvas, sheet.reserved, garment, sizes, paper.name)
    canvas.endForm()


def _stroke(canvas: Any, stroke: Stroke, offset: FloatArray, size_index: int | None) -> None:
    """Draw one line."""
    colour, width, dashes = STYLE[stroke.role]
    if size_index is not None:
        colour = SIZE_COLOURS[size_index % len(SIZE_COLOURS)] if stroke.role in OF_SIZE else colour
        dashes = SIZE_DASHES[size_index % len(SIZE_DASHES)] if stroke.role == "cut" else dashes
    canvas.setStrokeColor(colour)
    canvas.setLineWidth(width / 1000 * POINT)
    canvas.setDash([d / 1000 * POINT for d in dashes])
    canvas.setLineJoin(1)
    path = canvas.beginPath()
    if stroke.curve is not None:
        control = (stroke.curve.bezier + offset) * POINT
        path.moveTo(*control[0, 0])
        for segment in control:
            path.curveTo(*segment[1], *segment[2], *segment[3])
    else:
        points = (stroke.points + offset) * POINT
        path.moveTo(*points[0])
        for point in points[1:]:
            path.lineTo(*point)
        if stroke.closed:
            path.close()
    canvas.drawPath(path)


def _words(canvas: Any, words: Words, offset: FloatArray, colour: str) -> None:
    """Draw one line of text."""
    font, size = (BOLD if words.bold else FONT), words.height / CAPITALS * POINT
    canvas.saveState()
    canvas.translate(*((words.at + offset) * POINT))
    canvas.rotate(float(np.degrees(words.angle)))
    if words.tag:
        half = canvas.stringWidth(words.text, font, size) / 2 + 2
        canvas.setFillColor("#ffffff")
        canvas.rect(-half, -words.height * POINT * 0.75, 2 * half, words.height * POINT * 1.5, stroke=0, fill=1)
    canvas.setFillColor(colour)
    canvas.setFont(font, size)
    canvas.drawCentredString(0, -words.height / 2 * POINT, words.text)
    canvas.restoreState()


def _tile(canvas: Any, tiling: Tiling, row: int, column: int, title: str) -> None:
    """Draw one page."""
    paper = tiling.paper
    inner = np.array([paper.width, paper.height]) - 2 * paper.margin
    corner = tiling.corner(row, column)
    canvas.saveState()
    window = canvas.beginPath()
    window.rect(paper.margin * POINT, paper.margin * POINT, *(inner * POINT))
    canvas.clipPath(window, stroke=0, fill=0)
    canvas.translate(*((paper.margin - corner) * POINT))
    canvas.doForm("sheet")
    canvas.restoreState()
    if tiling.joined:
        _joining_marks(canvas, tiling, row, column)
    canvas.setFillColor("#555555")
    canvas.setFont(FONT, 7)
    page = f"{title}  -  sheet {tiling.name(row, column)}  -  {paper.name}, print at 100 %"
    canvas.drawCentredString(paper.width / 2 * POINT, (paper.margin - 0.0055) * POINT, page)
    canvas.showPage()


def _joining_marks(canvas: Any, tiling: Tiling, row: int, column: int) -> None:
    """Draw thin lines where sheets meet, a half diamond with its number in the middle of each, a cross at each corner.

    The right and lower strips lie under the neighbours: a sheet is cut along its left and upper line and laid upon the
    lines of the sheets that are already there.
    """
    paper = tiling.paper
    low = np.array([paper.margin, paper.margin])
    high = low + paper.step
    canvas.setDash([])
    canvas.setLineWidth(0.3)
    canvas.setStrokeColor("#888888")
    neighbours = {
        "left": (row, column - 1),
        "right": (row, column + 1),
        "bottom": (row + 1, column),
        "top": (row - 1, column),
    }
    bottom, top = low[1] + paper.overlap, high[1] + paper.overlap
    middle_x, middle_y = (low[0] + high[0]) / 2, (bottom + top) / 2
    lines = {
        "left": ((low[0], bottom), (low[0], top), (low[0], middle_y)),
        "right": ((high[0], bottom), (high[0], top), (high[0], middle_y)),
        "bottom": ((low[0], bottom), (high[0], bottom), (middle_x, bottom)),
        "top": ((low[0], top), (high[0], top), (middle_x, top)),
    }
    for side, (start, end, middle) in lines.items():
        canvas.line(*(np.array(start) * POINT), *(np.array(end) * POINT))
        r, c = neighbours[side]
        if 0 <= r < tiling.rows and 0 <= c < tiling.columns and (r, c) in tiling.tiles:
            _diamond(canvas, np.array(middle), tiling, (row, column), (r, c))
    for x in (low[0], high[0]):
        for y in (bottom, top):
            for dx, dy in ((0.004, 0.0), (0.0, 0.004)):
                canvas.line(*(np.array([x - dx, y - dy]) * POINT), *(np.array([x + dx, y + dy]) * POINT))
    canvas.setFillColor("#bbbbbb")
    canvas.setFont(BOLD, 26)
    canvas.drawString((low[0] + 0.006) * POINT, (top - 0.014) * POINT, tiling.name(row, column))


def _diamond(canvas: Any, at: FloatArray, tiling: Tiling, here: tuple[int, int], there: tuple[int, int]) -> None:
    """Draw the diamond in which two sheets meet, with their names."""
    first, second = sorted((here, there))
    size = 0.004
    path = canvas.beginPath()
    path.moveTo(*((at + np.array([size, 0])) * POINT))
    for dx, dy in ((0, size), (-size, 0), (0, -size)):
        path.lineTo(*((at + np.array([dx, dy])) * POINT))
    path.close()
    canvas.drawPath(path)
    canvas.setFillColor("#888888")
    canvas.setFont(FONT, 6)
    text = f"{tiling.name(*first)} | {tiling.name(*second)}"
    shift = np.array([0.006, 0.001]) if first[0] != second[0] else np.array([-0.004, 0.006])
    canvas.drawString(*((at + shift) * POINT), text)
