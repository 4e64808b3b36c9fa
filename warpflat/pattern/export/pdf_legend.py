"""The first page of a printed pattern: test squares, instructions, meaning of the lines, overview of the sheets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import FloatArray
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.label import FONT, printed_size
from warpflat.pattern.drafting.measures import INCH
from warpflat.pattern.drafting.placement import fit_label
from warpflat.pattern.drafting.sewing_tasks import piece_titles
from warpflat.pattern.drafting.words import as_sentence, translate
from warpflat.pattern.export.pdf_pen import POINT, draw_line, draw_words, page_footer, write
from warpflat.pattern.export.pdf_tiling import LEGEND_SIZE, SIZE_DASHES
from warpflat.pattern.export.svg import SIZE_COLOURS, STYLE

if TYPE_CHECKING:
    from warpflat.pattern.export.pdf_tiling import Tiling

__all__ = ["TEST_INCHES", "TEST_MM", "draw_legend", "legend_page"]


#: Sides of the test squares [m].
TEST_MM, TEST_INCHES = 0.050, INCH
#: Height of capitals [m] of the names in the overview.
NAME_HEIGHT = 0.00155

_KEY = (
    ("cut", "cutting line"),
    ("sew", "sewing line"),
    ("hem", "hem line"),
    ("fold", "fold of the cloth"),
    ("dart", "dart leg"),
    ("dart_fold", "fold of a dart"),
    ("internal", "level or line of the body"),
    ("grain", "grain: along the warp"),
    ("drill", "point to mark: dart, button, pocket"),
    ("notch", "notch: clip; letter of its seam"),
)


def draw_legend(canvas: Any, at: FloatArray, garment: DraftedGarment, paper: str) -> None:
    """Draw title, both test squares, the request not to scale, and the key, in a block whose lower left is `at` [m]."""
    x, top, sizes = float(at[0]), float(at[1]) + LEGEND_SIZE[1], list(garment.pieces)
    _text(canvas, x, top - 0.008, garment.name.replace("_", " "), 18, bold=True)
    if any(sizes):
        _text(canvas, x, top - 0.016, as_sentence(printed_size(*sizes)), 11)
    _text(canvas, x, top - 0.025, translate("Print at 100 % (actual size). Do not fit to the page."), 10, bold=True)
    _text(
        canvas,
        x,
        top - 0.031,
        translate("Paper: {paper}. Measure both squares before you cut anything.", paper=paper),
        8,
    )
    _square(canvas, x + 0.001, top - 0.037 - TEST_MM, TEST_MM, "5 cm")
    _square(canvas, x + 0.058, top - 0.037 - TEST_INCHES, TEST_INCHES, translate("1 inch"))
    y = top - 0.037
    for role, meaning in _KEY:
        y -= 0.0052
        _sample(canvas, x + 0.117, y, *STYLE[role])
        if role == "grain":
            for tip, back in ((0.117, 0.003), (0.136, -0.003)):
                for up in (0.001, -0.001):
                    canvas.line((x + tip) * POINT, y * POINT, (x + tip + back) * POINT, (y + up) * POINT)
        if role == "drill":
            canvas.circle((x + 0.1265) * POINT, y * POINT, 0.002 * POINT)
            canvas.line((x + 0.1265) * POINT, (y - 0.003) * POINT, (x + 0.1265) * POINT, (y + 0.003) * POINT)
        _text(canvas, x + 0.139, y - 0.0009, translate(meaning), 7)
    if len(sizes) > 1:
        for index, size in enumerate(sizes):
            column, row = divmod(index, 4)
            y = top - 0.097 - 0.006 * row
            dashes = SIZE_DASHES[index % len(SIZE_DASHES)]
            _sample(canvas, x + 0.001 + 0.045 * column, y, SIZE_COLOURS[index % len(SIZE_COLOURS)], 0.5, dashes)
            _text(canvas, x + 0.023 + 0.045 * column, y - 0.0012, printed_size(size), 8)


def legend_page(canvas: Any, garment: DraftedGarment, tiling: Tiling) -> None:
    """Draw the first page of a tiled pattern, and end the page."""
    import shapely

    paper, sheet = tiling.paper, tiling.sheet
    low = np.array([paper.margin + 0.005, paper.height - paper.margin - LEGEND_SIZE[1] - 0.002])
    draw_legend(canvas, low, garment, paper.name)
    # Unused room for the sizes' lines is not left empty.
    y = float(low[1]) - 0.004 + (0.026 if len(garment.pieces) == 1 else 0.0)
    lines = [
        translate(
            "Cut each sheet along its left and upper line. Lay it on the lines of its left and upper neighbours, so that"
        ),
        translate(
            "the half diamonds meet, and glue. {sheets} sheets; empty ones are left out.", sheets=len(tiling.tiles)
        ),
    ]
    if len(tiling.tiles) == 1:
        lines = [translate("One sheet holds all pieces; nothing is glued.")]
    for words in lines:
        _text(canvas, float(low[0]), y, words, 7.5)
        y -= 0.0042
    # All sheets and pieces, small.
    width = LEGEND_SIZE[0]
    step, overlap = paper.step, paper.overlap
    total = np.array([tiling.columns * step[0] + overlap, tiling.rows * step[1] + overlap])
    scale = float(min(width / total[0], (y - paper.margin - 0.010) / total[1]))
    left = float(low[0]) + (width - scale * total[0]) / 2
    origin = np.array([left, (paper.margin + 0.004) + scale * (total[1] - float(sheet.size[1]))])
    canvas.setDash([])
    for row, column in tiling.tiles:
        corner = tiling.corner(row, column) + np.array([0.0, overlap])
        canvas.setStrokeColor("#999999")
        canvas.setLineWidth(0.4)
        canvas.rect(*((origin + scale * corner) * POINT), *(scale * step * POINT))
        canvas.setFillColor("#999999")
        canvas.setFont(FONT, 7)
        name_at = origin + scale * (corner + np.array([0.006, step[1]])) - np.array([0.0, 0.003])
        canvas.drawString(*(name_at * POINT), tiling.name(row, column))
    canvas.setStrokeColor("#000000")
    canvas.setLineWidth(0.6)
    names = piece_titles([p.pieces[0].piece for p in sheet.placed])
    for number, placed in enumerate(sheet.placed, 1):
        for piece in placed.pieces:
            for line in (piece.cut_line, *(cutout.cut_line for cutout in piece.cutouts.values())):
                draw_line(canvas, origin + scale * placed.on_sheet(line), closed=True)
        # The middle size has its name in its drawing, or its number in the list above where there is no room.
        middle = placed.pieces[len(placed.pieces) // 2]
        holes = [shapely.Polygon(placed.on_sheet(cutout.cut_line)).buffer(0) for cutout in middle.cutouts.values()]
        cloth = shapely.Polygon(placed.on_sheet(middle.cut_line)).buffer(-0.0005 / scale)
        cloth = cloth.difference(shapely.union_all(holes))
        labels = (
            fit_label(cloth, [(text, NAME_HEIGHT / scale)], least=least)
            for text, least in ((names[middle.name], 0.7), (str(number), 0.5))
        )
        label = next((each for each in labels if each is not None), None)
        for written in () if label is None else label.words():
            small = replace(written, height=written.height * scale, bold=False)
            draw_words(canvas, small, np.column_stack([scale * np.eye(2), origin]))
    page_footer(canvas, garment.name, paper, translate("print this page first and measure both squares"))
    canvas.showPage()


def _square(canvas: Any, x: float, y: float, side: float, text: str) -> None:
    """Draw a test square."""
    canvas.setDash([])
    canvas.setLineWidth(0.4)
    canvas.setStrokeColor("#000000")
    canvas.rect(x * POINT, y * POINT, side * POINT, side * POINT)
    canvas.setFillColor("#000000")
    canvas.setFont(FONT, 9)
    canvas.drawCentredString((x + side / 2) * POINT, (y + side / 2) * POINT, text)


def _sample(canvas: Any, x: float, y: float, colour: str, width: float, dashes: Sequence[float]) -> None:
    """Draw a short line in the style of its kind."""
    canvas.setStrokeColor(colour)
    canvas.setLineWidth(width / 1000 * POINT)
    canvas.setDash([d / 1000 * POINT for d in dashes])
    canvas.line(x * POINT, y * POINT, (x + 0.019) * POINT, y * POINT)
    canvas.setDash([])


def _text(canvas: Any, x: float, y: float, text: str, size: float, *, bold: bool = False) -> None:
    """Write a text, smaller where it would be wider than the legend."""
    write(canvas, x, y, text, size, bold=bold, width=LEGEND_SIZE[0])
