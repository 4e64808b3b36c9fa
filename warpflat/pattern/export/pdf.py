"""Patterns as PDF in true size: tiled on A4 or US Letter for home printers, whole on A0 for copy shops.

Every tile repeats a strip of its neighbours. Thin lines with half diamonds show where the next sheet goes; rows are
letters from the top, columns numbers from the left. The first page has test squares, an overview and instructions. The
file asks the printer not to scale.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from warpflat.core import FloatArray, InputError, nearest
from warpflat.pattern.drafting.draft import nest_label, relabelled
from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.drafting.drawing import Drawing, OnPaper, Stroke, draw_nest
from warpflat.pattern.drafting.half_pieces import halved
from warpflat.pattern.drafting.label import BOLD, CAPITALS, FONT, embedded_font, text_width
from warpflat.pattern.drafting.layout import Placed, Sheet, covered_rings, lay_out, nests
from warpflat.pattern.drafting.polygons import mapped, upright
from warpflat.pattern.drafting.sewing_order import seam_letters
from warpflat.pattern.drafting.tile_nesting import nest_on_tiles
from warpflat.pattern.drafting.words import printed_in, translate
from warpflat.pattern.export.pdf_guide import guide_pages
from warpflat.pattern.export.pdf_legend import draw_legend, legend_page
from warpflat.pattern.export.pdf_pen import POINT, draw_line, draw_words, page_footer
from warpflat.pattern.export.pdf_tiling import LEGEND_SIZE, SIZE_DASHES, Paper, Tiling, make_tiling
from warpflat.pattern.export.svg import OF_SIZE, SIZE_COLOURS, STYLE
from warpflat.pattern.files.output import atomic_path, optional_file

__all__ = ["PAPERS", "draw_sheet", "sheet_names", "too_many_sheets", "write_pdf"]


PAPERS = {
    "A4": Paper(name="A4", width=0.210, height=0.297, margin=0.010, overlap=0.010),
    "Letter": Paper(name="US Letter", width=0.2159, height=0.2794, margin=0.010, overlap=0.010),
    "A0": Paper(name="A0", width=0.841, height=1.189, margin=0.015, overlap=0.010),
    # The page of a projector is as large as all pieces need.
    "Projector": Paper(
        name="Projector", width=1.0, height=1.0, margin=0.010, overlap=0.0, endless=True, line_width=2.0
    ),
}
#: Width [m] of the page of a projector: that of a cutting table.
PROJECTED_WIDTH = 0.9
#: Size [pt] of a sheet's name, its distance [m] from the sheet's joints, and the least one from lines and words.
SHEET_NAME, NAME_INSIDE, NAME_CLEAR = 26, 0.006, 0.0015
#: A strip slants if the box around it is so many times as large as the strip.
SLANTING = 3.0
# A label beside its piece that a joint of two sheets would cut is moved by up to so much, in such steps [m].
_REACH, _STEP = 0.06, 0.004
# Nobody glues more sheets than these together.
MOST_SHEETS = 1000
#: Roles whose strokes lie on the layer of their size in a nest.
OF_LAYER = (*OF_SIZE, "dart_fold", "drill", "cutout")


def write_pdf(
    garment: DraftedGarment,
    path: str | os.PathLike[str],
    *,
    paper: str = "A4",
    sizes: Sequence[str] | None = None,
) -> Tiling:
    """Write the pattern for a printer; pieces that are their own mirror images lie half on the fold.

    Args:
        garment: drafted.
        path: of the file.
        paper: "A4", "Letter" (tiled), "A0" (whole pieces wherever they fit) or
            "Projector" (everything on one page, in wide lines). The first pages of the latter two are A4.
        sizes: those to print; several lie upon each other as a nest, told apart by dashes and colour, each on a layer
            of its own that readers can hide; None prints all.

    Returns:
        Which tiles were printed: tiles without any part of a piece are left out. A guide that cannot be drawn is left out, too.

    Raises:
        InputError: unknown paper or size.
    """
    with printed_in(garment.pattern.words):
        if paper not in PAPERS:
            raise InputError(f"unknown paper {paper!r}; {nearest(paper, PAPERS)}")
        whole = garment.of_sizes(sizes)
        printed = halved(whole)
        if fault := too_many_sheets(printed, paper):
            raise InputError(f"{path}: {fault}")
        tiling, drawings = draw_sheet(printed, paper)
        content, guided = b"", list[str]()
        with optional_file(path, guided, part="the guide"):
            content = _pages(whole, printed, tiling, drawings, guide=True)
        if not guided:
            content = _pages(whole, printed, tiling, drawings, guide=False)
        with atomic_path(path) as temporary:
            Path(temporary).write_bytes(content)
        return tiling


def draw_sheet(printed: DraftedGarment, paper: str) -> tuple[Tiling, list[tuple[Drawing, ...]]]:
    """Lay the pieces of a garment, in all its sizes, on sheets of a paper, and draw them there.

    Args:
        printed: the garment with halves on the fold.
        paper: a key of `PAPERS`.

    Returns:
        The tiling, and what is drawn of each `Placed` of its sheet, in the coordinates of its pieces.
    """
    import shapely

    # A layout that needs few pages.
    groups, kind = nests(printed), PAPERS[paper]
    if kind.tiled:
        # Pieces, turned where that helps, on the tiles of a grid, of which they take few.
        shapes = []
        for group in groups:
            rings = covered_rings(group)
            shape = shapely.union_all([shapely.Polygon(ring) for ring in rings])
            # A label beside its piece belongs to it, with all between.
            shapes.append(shape if len(rings) == len(group) else shape.convex_hull)
        placed = list[Placed]()
        turned, size = nest_on_tiles(shapes, step=kind.step, overlap=kind.overlap, gap=0.004)
        for group, shape, laid in zip(groups, shapes, turned, strict=True):
            quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
            turn = np.linalg.matrix_power(quarter, laid.quarters)
            low = (shapely.get_coordinates(shape) @ turn.T).min(axis=0)
            placed.append(Placed(pieces=group, matrix=np.column_stack([turn, laid.corner - low])))
        sheet = Sheet(placed=tuple(placed), size=size)
    elif kind.endless:
        widest = max(float(np.ptp(np.concatenate(covered_rings(group))[:, 0])) for group in groups)
        sheet = lay_out(groups, width=max(PROJECTED_WIDTH, widest + 0.05), gap=0.016, reserved=LEGEND_SIZE)
        wide, high = sheet.size + 2 * kind.margin + kind.overlap
        kind = replace(kind, width=float(wide), height=float(high))
    elif (packed := _on_pages(groups, kind)) is not None:
        sheet = packed
    else:  # a piece is larger than the paper
        width = kind.step[0] + kind.overlap
        sheet = lay_out(groups, width=width, gap=0.016, page_height=float(kind.step[1]), reserved=LEGEND_SIZE)
    tiling = make_tiling(sheet, kind)
    # Labels move to where no joint of two sheets crosses them, where there is room for that.
    placed = []
    for place in sheet.placed:
        joints = [place.on_piece(joint) for joint in tiling.joints]
        pieces = tuple(relabelled(piece, printed.name, joints) for piece in place.pieces) if joints else place.pieces
        if any(piece.label.leader is not None for piece in pieces):
            pieces = place.pieces
            if joints and all(piece.label.leader is not None for piece in pieces):
                others = [each for each in sheet.placed if each is not place]
                pieces = _beside_on_one_sheet(place, others, tiling)
        upwards = []
        for piece in pieces:
            # A label that would stand on its head on the sheet is turned round.
            angle = float(np.degrees(piece.label.angle + np.arctan2(place.matrix[1, 0], place.matrix[0, 0])))
            if not -89.5 < (angle + 180.0) % 360.0 - 180.0 < 90.5:
                piece = replace(piece, label=replace(piece.label, angle=piece.label.angle + np.pi))
            upwards.append(piece)
        placed.append(replace(place, pieces=tuple(upwards)))
    tiling, letters = replace(tiling, sheet=replace(sheet, placed=tuple(placed))), seam_letters(printed)
    sewn: dict[tuple[str, str], list[str]] = {}
    for seam in printed.pattern.seams:
        for side in seam.stretches:
            sewn.setdefault(side.place, []).append(seam.name)
    drawings = []
    for place in placed:
        joints = [place.on_piece(joint) for joint in tiling.joints]
        outside = shapely.transform(tiling.outside, place.on_piece)
        shown = OnPaper(joints=joints, outside=outside, letters=letters, sewn=sewn)
        drawings.append(draw_nest(place.pieces, shown))
    return tiling, drawings


def _beside_on_one_sheet(place: Placed, others: Sequence[Placed], tiling: Tiling) -> tuple[DraftedPiece, ...]:
    """Return the pieces of a place with their label, which stands beside them, moved to where one sheet shows each of its rows."""
    import shapely

    windows = [tiling.window(tile) for tile in tiling.tiles]
    taken = [shapely.Polygon(place.on_sheet(piece.cut_line)) for piece in place.pieces]
    around = [each.on_sheet(np.concatenate(covered_rings(each.pieces))) for each in others]
    taken += [shapely.convex_hull(shapely.MultiPoint(points)) for points in around]
    cloth, label = shapely.union_all(taken), nest_label(place.pieces)
    steps = np.arange(-_REACH, _REACH + 1e-9, _STEP)
    shifts = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    for shift in shifts[np.argsort(np.linalg.norm(shifts, axis=1), kind="stable")]:
        moved = replace(label, at=label.at + shift)
        rows = [shapely.Polygon(place.on_sheet(row.box())) for row in moved.words()]
        if all(any(window.covers(row) for window in windows) for row in rows) and (
            not shift.any() or not shapely.Polygon(place.on_sheet(moved.box)).intersects(cloth)
        ):
            break
    else:
        return place.pieces
    # The leader begins where the label stands, and ends on the cloth where it did.
    labels = [
        replace(own, at=own.at + shift, leader=None if own.leader is None else own.leader + np.outer([1.0, 0.0], shift))
        for own in (piece.label for piece in place.pieces)
    ]
    return tuple(replace(piece, label=own) for piece, own in zip(place.pieces, labels, strict=True))


def too_many_sheets(garment: DraftedGarment, paper: str) -> str:
    """Return why nobody would print a pattern on sheets of this paper, "" where one would: cloth of a wrong unit takes thousands.

    The garment may have its whole pieces: of those that are printed as halves on the fold half counts.
    """
    if paper not in PAPERS or not PAPERS[paper].tiled:
        return ""
    import shapely

    step = float(np.prod(PAPERS[paper].step))

    def sheets_of(drafted: DraftedGarment) -> float:
        return sum(shapely.Polygon(piece.cut_line).area for piece in drafted) / step

    sheets = sheets_of(garment)
    sheets = sheets_of(halved(garment)) if sheets > MOST_SHEETS else sheets
    return f"it would take some {sheets:,.0f} sheets; check the units, or take A0 paper" if sheets > MOST_SHEETS else ""


def _pages(
    whole: DraftedGarment,
    printed: DraftedGarment,
    tiling: Tiling,
    drawings: Sequence[tuple[Drawing, ...]],
    *,
    guide: bool,
) -> bytes:
    """Return the pages of the pattern, after those of legend and guide if these are wanted.

    Args:
        whole, printed: the garment, and as it is printed, with pieces on the fold.
        tiling, drawings: of the pieces (see :func:`draw_sheet`).
        guide: whether the legend and the guide come first.
    """
    from reportlab import rl_config
    from reportlab.pdfbase import pdfmetrics
    from reportlab.pdfbase.pdfdoc import PDFArray, PDFDictionary, PDFName, PDFResourceDictionary, PDFString, xObjectName
    from reportlab.pdfgen.canvas import Canvas

    kind, stream = tiling.paper, BytesIO()
    # Streams in bytes: as text they are a quarter longer, and take as long to write as all strokes.
    rl_config.useA85 = 0
    canvas = Canvas(stream, pagesize=(kind.width * POINT, kind.height * POINT), invariant=1)
    for name in (FONT, BOLD):
        pdfmetrics.registerFont(embedded_font(name))
    canvas.setTitle(f"{whole.name}, {' / '.join(whole.pieces)}")
    canvas.setCreator("warpflat")
    canvas.setViewerPreference("PrintScaling", "None")
    _sheet_form(canvas, printed, tiling, drawings)
    # Words are drawn on the sheets that show them whole; on all, if none does.
    forms = _word_forms(canvas, tiling, drawings, list(printed.pieces))
    if guide:
        if kind.tiled:
            legend_page(canvas, printed, tiling)
        # What is read at the machine is small, whatever the pattern is printed on.
        small = kind if kind.tiled else PAPERS["A4"]
        canvas.setPageSize((small.width * POINT, small.height * POINT))
        guide_pages(canvas, whole, printed, small)
        canvas.setPageSize((kind.width * POINT, kind.height * POINT))
    names = sheet_names(tiling, drawings) if tiling.joined else {}
    inner = np.array([kind.width, kind.height]) - 2 * kind.margin
    for tile in tiling.tiles:
        corner, title = tiling.corner(*tile), tiling.name(*tile)
        canvas.saveState()
        window = canvas.beginPath()
        window.rect(kind.margin * POINT, kind.margin * POINT, *(inner * POINT))
        canvas.clipPath(window, stroke=0, fill=0)
        canvas.translate(*((kind.margin - corner) * POINT))
        canvas.doForm("sheet")
        canvas.doForm(forms[tile])
        canvas.restoreState()
        if tile in names:
            _joining_marks(canvas, tiling, *tile)
            canvas.setFillColor("#bbbbbb")
            canvas.setFont(BOLD, SHEET_NAME)
            canvas.drawString(*((names[tile] - corner + kind.margin) * POINT), title)
        page_footer(canvas, whole.name, kind, translate("sheet {name}", name=title))
        canvas.showPage()
    if len(whole.pieces) > 1:
        # Layers, one a size, are optional content that readers list and can hide.
        document = canvas._doc
        groups = {
            f"size{k}": document.Reference(PDFDictionary({"Type": PDFName("OCG"), "Name": PDFString(f"Size {size}")}))
            for k, size in enumerate(whole.pieces)
        }
        for name in ("sheet", *forms.values()):
            form = document.idToObject[xObjectName(name)]
            form.Resources = PDFResourceDictionary(Properties=groups)
            form.Resources.basicFonts()
        order, catalog = PDFArray(list(groups.values())), document.Catalog
        catalog.OCProperties = PDFDictionary(
            {"OCGs": order, "D": PDFDictionary({"Order": order, "ON": order, "Name": PDFString("Sizes")})}
        )
        catalog.__NoDefault__ = [*catalog.__NoDefault__, "OCProperties"]
    canvas.save()
    return stream.getvalue()


def _sheet_form(canvas: Any, printed: DraftedGarment, tiling: Tiling, drawings: Sequence[tuple[Drawing, ...]]) -> None:
    """Draw the whole sheet once, as a form; every page shows its part of it. What is of one size is on that size's layer."""
    border, sheet, widen = 0.05, tiling.sheet, tiling.paper.line_width
    low, high = np.array([-border, -3.0]), sheet.size + 3.0
    canvas.beginForm("sheet", *(low * POINT), *(high * POINT))
    for placed, sizes in zip(sheet.placed, drawings, strict=True):
        nested = len(placed.pieces) > 1
        for drawing in sizes:
            index = list(printed.pieces).index(drawing.piece.size)
            shown = [stroke for stroke in drawing.strokes if not stroke.hidden]
            of_size = [stroke for stroke in shown if nested and stroke.role in OF_LAYER]
            for stroke in (stroke for stroke in shown if not (nested and stroke.role in OF_LAYER)):
                _stroke(canvas, stroke, placed.matrix, index if nested else None, widen)
            if nested:
                canvas._code.append(f"/OC /size{index} BDC")
            for stroke in of_size:
                _stroke(canvas, stroke, placed.matrix, index, widen)
            if nested:
                canvas._code.append("EMC")
    if sheet.reserved is not None:
        draw_legend(canvas, sheet.reserved, printed, tiling.paper.name)
    canvas.endForm()


def _word_forms(
    canvas: Any, tiling: Tiling, drawings: Sequence[tuple[Drawing, ...]], sizes: Sequence[str]
) -> dict[tuple[int, int], str]:
    """Draw the words of each sheet as a form, and return the names of the forms by row and column."""
    written = []
    for placed, of_piece in zip(tiling.sheet.placed, drawings, strict=True):
        for drawing in of_piece:
            index = sizes.index(drawing.piece.size)
            layer = f"size{index}" if len(placed.pieces) > 1 else ""
            written += [(words, placed, layer if words.tag else "", index) for words in drawing.words]
    boxes = np.array([placed.on_sheet(words.box()) for words, placed, _, _ in written]).reshape(-1, 4, 2)
    low, high = boxes.min(axis=1), boxes.max(axis=1)
    inner = np.array([tiling.paper.width, tiling.paper.height]) - 2 * tiling.paper.margin
    corners = {tile: tiling.corner(*tile) for tile in tiling.tiles}
    whole = {tile: ((low >= corner) & (high <= corner + inner)).all(axis=1) for tile, corner in corners.items()}
    nowhere = ~np.any(list(whole.values()), axis=0)
    names = {}
    for tile in tiling.tiles:
        names[tile] = f"words{tile[0]}_{tile[1]}"
        canvas.beginForm(names[tile], *((corners[tile] - 0.05) * POINT), *((corners[tile] + inner + 0.05) * POINT))
        for k in np.flatnonzero(whole[tile] | nowhere).tolist():
            words, placed, layer, index = written[k]
            colour = SIZE_COLOURS[index % len(SIZE_COLOURS)] if words.tag else "#000000"
            canvas._code += [f"/OC /{layer} BDC"] if layer else []
            draw_words(canvas, words, placed.matrix, colour)
            canvas._code += ["EMC"] if layer else []
        canvas.endForm()
    return names


def sheet_names(tiling: Tiling, drawings: Sequence[tuple[Drawing, ...]]) -> dict[tuple[int, int], FloatArray]:
    """Return where the name of each tile is written: its lower left on the sheet [m], clear of lines and words if there is room.

    The upper left is preferred, then the other corners, then the place with the most room.
    """
    import shapely

    lines, words = [], []
    for placed, sizes in zip(tiling.sheet.placed, drawings, strict=True):
        for drawing in sizes:
            lines += [shapely.LineString(placed.on_sheet(each.path)) for each in drawing.strokes if not each.hidden]
            words += [shapely.Polygon(placed.on_sheet(each.box())) for each in drawing.words]
    taken = shapely.STRtree([*lines, *words])
    height, found = SHEET_NAME * CAPITALS / POINT, {}
    for tile in tiling.tiles:
        width = text_width(tiling.name(*tile), height, bold=True)
        size = np.array([width, height])
        low = tiling.corner(*tile) + np.array([0.0, tiling.paper.overlap])
        room = tiling.paper.step - size - 2 * NAME_INSIDE
        shares = [(0.0, 1.0), (1.0, 1.0), (0.0, 0.0), (1.0, 0.0)]
        shares += [(x / 8, y / 12) for y in range(12, -1, -1) for x in range(9)]
        places = low + NAME_INSIDE + room * np.array(shares)
        # A corner is clear nearly always.
        for tried in (places[:4], places):
            boxes = shapely.box(*tried.T, *(tried + size).T)
            apart = shapely.distance(boxes, taken.geometries[taken.nearest(boxes)])
            clear = np.flatnonzero(apart > NAME_CLEAR)
            if len(clear):
                break
        found[tile] = tried[int(clear[0]) if len(clear) else int(apart.argmax())]
    return found


def _on_pages(groups: Sequence[tuple[DraftedPiece, ...]], paper: Paper) -> Sheet | None:
    """Lay pieces and the legend on few pages, the largest first: each where its box lies clear of the pieces that are there.

    A strip that slants, as a binding on the bias does, is stood upright. None where a piece has no room on a page.
    """
    import shapely

    gap, step = 0.012, paper.step
    turns, boxes, shapes = [], [], []
    for group in groups:
        rings = covered_rings(group)
        points = np.concatenate(rings)
        around = shapely.MultiPoint(points).minimum_rotated_rectangle
        turn = np.eye(2)
        if around.geom_type == "Polygon" and float(np.prod(np.ptp(points, axis=0))) > SLANTING * around.area:
            sides = np.diff(np.asarray(around.exterior.coords), axis=0)[:2]
            along = max(sides, key=lambda side: float(np.linalg.norm(side)))
            turn = upright(along if along[1] >= 0 else -along)
        turns.append(turn)
        boxes.append(np.stack([(points @ turn.T).min(axis=0), (points @ turn.T).max(axis=0)]))
        shapes.append(shapely.union_all([shapely.Polygon(ring @ turn.T) for ring in rings]))
    legend = len(groups)
    boxes.append(np.array([(0.0, 0.0), LEGEND_SIZE]))
    shapes.append(shapely.box(0.0, 0.0, *LEGEND_SIZE))
    pages: list[Any] = []
    places: dict[int, tuple[int, FloatArray]] = {}
    for number in sorted(range(len(boxes)), key=lambda k: (k == legend, -float(np.prod(np.ptp(boxes[k], axis=0))), k)):
        extent = np.ptp(boxes[number], axis=0)
        room = step - extent - 2 * gap
        if (room < 0.0).any():
            return None
        # From the upper left, down and then to the right.
        shares = np.array([(x / 40, 1.0 - y / 40) for x in range(41) for y in range(41)])
        corners = gap + shares * room
        around = shapely.box(*(corners - gap).T, *(corners + extent + gap).T)
        for page in range(len(pages) + 1):
            if page == len(pages):
                pages.append(shapely.Polygon())
            free = np.flatnonzero(shapely.disjoint(around, pages[page]))
            if len(free):
                break
        corner = corners[free[0]]
        places[number] = (page, corner)
        shift = corner - boxes[number][0]
        pages[page] = pages[page].union(shapely.transform(shapes[number], lambda points, shift=shift: points + shift))
    size = np.array([step[0], len(pages) * step[1]]) + paper.overlap
    corners_on_sheet = {
        number: corner + np.array([0.0, (len(pages) - page - 1) * step[1] + paper.overlap])
        for number, (page, corner) in places.items()
    }
    placed = []
    for number, group in enumerate(groups):
        matrix = np.column_stack([turns[number], corners_on_sheet[number] - boxes[number][0]])
        placed.append(Placed(pieces=tuple(group), matrix=matrix))
    return Sheet(placed=tuple(placed), size=size, reserved=corners_on_sheet[legend])


def _stroke(canvas: Any, stroke: Stroke, matrix: FloatArray, size_index: int | None, widen: float = 1.0) -> None:
    """Draw one line under a 2 by 3 matrix."""
    colour, width, dashes = STYLE[stroke.role]
    if size_index is not None:
        colour = SIZE_COLOURS[size_index % len(SIZE_COLOURS)] if stroke.role in OF_SIZE else colour
        dashes = SIZE_DASHES[size_index % len(SIZE_DASHES)] if stroke.role == "cut" else dashes
    canvas.setStrokeColor(colour)
    canvas.setLineWidth(widen * width / 1000 * POINT)
    canvas.setDash([widen * d / 1000 * POINT for d in dashes])
    canvas.setLineJoin(1)
    if stroke.curve is None:
        draw_line(canvas, mapped(stroke.points, matrix), closed=stroke.closed)
        return
    path, control = canvas.beginPath(), stroke.curve.transformed(matrix).bezier * POINT
    path.moveTo(*control[0, 0])
    for segment in control:
        path.curveTo(*segment[1], *segment[2], *segment[3])
    canvas.drawPath(path)


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
            # The diamond in which two sheets meet, with their names.
            at = np.array(middle)
            first, second = sorted([(row, column), (r, c)])
            size = 0.004
            draw_line(canvas, at + size * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]]), closed=True)
            canvas.setFillColor("#888888")
            canvas.setFont(FONT, 6)
            text = f"{tiling.name(*first)} | {tiling.name(*second)}"
            shift = np.array([0.006, 0.001]) if first[0] != second[0] else np.array([-0.004, 0.006])
            canvas.drawString(*((at + shift) * POINT), text)
    for x in (low[0], high[0]):
        for y in (bottom, top):
            for dx, dy in ((0.004, 0.0), (0.0, 0.004)):
                canvas.line(*(np.array([x - dx, y - dy]) * POINT), *(np.array([x + dx, y + dy]) * POINT))
