"""The pages of a printed pattern that say what to cut, how much cloth it takes, and how it is sewn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core import FloatArray, energy_words, without_side
from warpflat.pattern.drafting.cut_list import cut_list
from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.drafting.finished import finished_lengths
from warpflat.pattern.drafting.label import CAPITALS, allowances_of, cutting_words, printed_size, wrap_text
from warpflat.pattern.drafting.marker import WIDTHS, cloth_needed
from warpflat.pattern.drafting.measures import cloth_words, length_words
from warpflat.pattern.drafting.piece_parts import FoundSeam
from warpflat.pattern.drafting.sewing_order import SewingStep, notions, sewing_steps, sewn_seams, tools
from warpflat.pattern.drafting.sewing_tasks import piece_titles, techniques
from warpflat.pattern.drafting.words import listed, translate, translate_name
from warpflat.pattern.drafting.worn import Worn
from warpflat.pattern.export.pdf_pen import POINT, draw_line, page_footer, write

if TYPE_CHECKING:
    from warpflat.pattern.export.pdf_tiling import Paper

__all__ = ["guide_pages"]


#: Size of a thumbnail [m], and how many stand in a row at most.
THUMBNAIL, IN_ROW = (0.026, 0.034), 7
#: Sizes whose measures stand beside each other at most.
SIZES_IN_ROW = 5
#: The pictures of a step: their height and width in all [m], and how many there are at most.
STEP_HEIGHT, STEP_WIDTH, STEP_PIECES = 0.013, 0.048, 4
#: Why a garment does not fit, by its verdict.
FAILING = {
    "held": "This garment does not fit: its cloth is stretched or sheared beyond what it bears.",
    "pressing": "This garment does not fit: it presses on the body.",
    "too large": "This garment does not fit: it is larger than it was drafted.",
    "misfit": "This garment does not fit: draped, it does not lie where it was drafted.",
    "not at rest": "Whether this garment fits is not known: its drape has not come to rest.",
}
#: Size of the drawing of a technique [m], and of the box in which its strokes are given; by style their colour, width [pt] and dashes.
TECHNIQUE, BOX = np.array([0.0176, 0.011]), np.array([48.0, 30.0])
STROKES = {
    "cloth": ("#000000", 0.9, ()),
    "other": ("#1f5fa8", 0.9, ()),
    "fold": ("#000000", 0.5, (2, 1.2)),
    "stitch": ("#b8460b", 1.0, (1.5, 1)),
}
#: Sizes of type [pt] and distance of lines [m].
HEADING, TEXT, LINE = 11.0, 8.0, 0.0046


class _Page:
    """A page that is filled from the top; a new one begins where there is no room left."""

    def __init__(self, canvas: Any, garment: DraftedGarment, paper: Paper) -> None:
        self.canvas, self.garment, self.paper = canvas, garment, paper
        self.left, self.width = paper.margin + 0.005, paper.width - 2 * paper.margin - 0.010
        self.y = paper.height - paper.margin - 0.004

    def length(self, length: float, *, signed: bool = False) -> str:
        """Return a length [m] in words, in the units of the pattern."""
        sign = "" if not signed else "+" if length >= 0 else "-"
        return sign + length_words(abs(length), self.garment.pattern.units)

    def need(self, height: float) -> bool:
        """Begin a new page if less than `height` [m] is left; return whether one began."""
        full = self.y - height < self.paper.margin + 0.004
        if full:
            self.end()
        return full

    def end(self) -> None:
        """End the page."""
        page_footer(self.canvas, self.garment.name, self.paper, translate("cutting and sewing"))
        self.canvas.showPage()
        self.y = self.paper.height - self.paper.margin - 0.004

    def heading(self, text: str, follows: float) -> None:
        """Write a heading that stays with what follows it [m]."""
        self.need(0.010 + follows)
        self.y -= 0.008
        self.text(self.left, text, HEADING, bold=True)
        self.y -= 0.0030

    def text(self, x: float, text: str, size: float = TEXT, *, bold: bool = False, width: float = 1.0) -> None:
        """Write a text at the present height, smaller if it is wider than `width` [m]."""
        write(self.canvas, x, self.y, text, size, bold=bold, width=width)

    def paragraph(self, text: str, *, indent: float = 0.0, lead: str = "") -> None:
        """Write a text in as many lines as it takes, with a word before the first."""
        rows = wrap_text(text, TEXT * CAPITALS / POINT, self.width - indent).split("\n")
        self.need(LINE * len(rows))
        for number, row in enumerate(rows):
            self.y -= LINE
            if number == 0 and lead:
                self.text(self.left, lead, bold=True)
            self.text(self.left + indent, row)

    def table(self, head: Sequence[str], rows: Sequence[Sequence[str]], shares: Sequence[float]) -> None:
        """Write rows in columns of the given shares of the width."""
        starts = self.left + self.width * np.concatenate([[0.0], np.cumsum(shares)[:-1]])
        self._row(head, starts, shares, bold=True)
        for row in rows:
            # A page that begins within a table begins with its head.
            if self.need(LINE):
                self._row(head, starts, shares, bold=True)
            self._row(row, starts, shares)

    def _row(self, cells: Sequence[str], starts: FloatArray, shares: Sequence[float], *, bold: bool = False) -> None:
        self.y -= LINE
        for x, share, cell in zip(starts, shares, cells, strict=True):
            self.text(float(x), cell, bold=bold, width=share * self.width - 0.002)


def guide_pages(canvas: Any, whole: DraftedGarment, printed: DraftedGarment, paper: Paper) -> None:
    """Draw the pages on cutting and sewing.

    Args:
        canvas: reportlab's.
        whole: the garment with whole pieces.
        printed: the garment as it is printed, with halves on the fold.
        paper: of the pages.
    """
    page = _Page(canvas, whole, paper)
    pattern, size = whole.pattern, whole.sample
    pieces = printed.pieces[size]
    if pattern.worn is not None:
        _worn(page, pattern.worn, size, [each for each in printed.pieces if each in pattern.worn.measures])
    lengths = finished_lengths(whole, size)
    if lengths:
        words = ", ".join(f"{what} {page.length(length)}" for what, length in lengths.items())
        page.paragraph(words, indent=0.030, lead=translate("Finished"))
    page.heading(translate("You need"), 3 * LINE)
    steps = sewing_steps(whole, size)
    page.paragraph(", ".join(notions(steps)), indent=0.030, lead=translate("Notions"))
    page.paragraph(tools(whole, steps), indent=0.030, lead=translate("Tools"))
    _cloth(page, whole)
    _pieces_to_cut(page, pieces)
    edges = ((edge.kind, edge.width) for piece in pieces for edge in piece.edges)
    allowances = [
        translate(f"{kind}s {{width}}", width=listed(widths))
        for kind, widths in allowances_of(edges, pattern.units).items()
    ]
    told = "Allowances are included: {allowances}." if allowances else "No allowances are included."
    grain = translate("Lay every grain arrow along the selvedge.")
    page.paragraph(f"{translate(told, allowances=', '.join(allowances))} {grain}")
    cloths = cut_list(pieces)
    if len(cloths) > 1:
        page.heading(translate("From each cloth"), (1 + len(cloths)) * LINE)
        for cloth, entries in cloths.items():
            cut = []
            for entry in entries:
                how = " on fold" if entry.on_fold else ", {mirrored} mirrored" if entry.mirrored else ""
                values = {"title": entry.title, "count": entry.quantity, "mirrored": entry.mirrored}
                cut.append(translate(f"{{title}} {{count}}{how}", **values))
            page.paragraph("; ".join(cut), indent=0.030, lead=translate_name(cloth))
    if steps:
        page.heading(translate("Sewing order"), 3 * LINE + STEP_HEIGHT)
        page.paragraph(
            translate(
                "Right sides together. Letters stand beside the notches, and on edges without any; notches with the same letter meet."
            )
            + " "
            + translate("Press each seam when it is sewn, and neaten edges that stay open inside.")
        )
    for number, sewing in enumerate(steps, 1):
        _step(page, number, sewing, [(p, sewing.sewn[p.name]) for p in whole.pieces[size] if p.name in sewing.sewn])
    if seams := sewn_seams(steps):
        page.heading(translate("Seams") + (f", {printed_size(size)}" if len(whole.pieces) > 1 else ""), 3 * LINE)
        rows = []
        for seam in seams:
            first, second = (page.length(length / 1000) for length in seam.length_mm)
            name = seam.name + (f" ({seam.count} x)" if seam.count > 1 else "")
            rows.append([seam.letter, name, seam.sides[0], first, seam.sides[1], second])
        head = ["", *(translate(word) for word in ("seam", "piece", "length", "sewn to", "length"))]
        page.table(head, rows, (0.05, 0.27, 0.24, 0.1, 0.24, 0.1))
    if pattern.found_seams:
        _prices(page, pattern.found_seams)
    notes = dict.fromkeys(f"{piece.piece.printed_name}: {note}." for piece in pieces for note in piece.notes)
    if notes:
        page.heading(translate("Notes"), 3 * LINE)
    for note in notes:
        page.paragraph(note)
    page.end()


def _pieces_to_cut(page: _Page, pieces: Sequence[DraftedPiece]) -> None:
    """Draw the pieces, small, with what to cut of each."""
    titles = piece_titles([piece.piece for piece in pieces])
    page.heading(translate("Cut"), THUMBNAIL[1] + 0.02)
    highest = max(float(np.ptp(piece.cut_line, axis=0).max()) for piece in pieces)
    scale = min(THUMBNAIL[1] / highest, 0.06)
    in_row = -(-len(pieces) // -(-len(pieces) // IN_ROW))
    step = page.width / max(in_row, 5)
    for start in range(0, len(pieces), in_row):
        page.need(THUMBNAIL[1] + 4 * LINE)
        top = page.y - 0.002
        for number, piece in enumerate(pieces[start : start + in_row]):
            left = page.left + number * step
            _thumbnail(page.canvas, piece, np.array([left + 0.5 * step, top - THUMBNAIL[1] / 2]), scale)
            cloths = piece.piece.cloths
            how = cutting_words(piece.piece, cloths[piece.piece.fabric])
            page.y = top - THUMBNAIL[1] - LINE
            named = f"{start + number + 1}  {titles[piece.name]}", how, " / ".join(map(translate_name, cloths))
            for k, line in enumerate(named):
                page.text(left + 0.001, line, 7.5, bold=k == 0, width=step - 0.002)
                page.y -= 0.0038


def _worn(page: _Page, worn: Worn, size: str, sizes: Sequence[str]) -> None:
    """Draw the garment from the front and the back, with its measures and the openings that it needs beside it.

    Of several sizes the measures of each stand below, to choose one by.
    """
    top, high = page.y - 0.012, 0.088
    rings = [ring for row in worn.views.values() for each in row for ring in each.outlines]
    if rings:
        points = np.concatenate(rings)
        low, extent = points[:, 1].min(), np.ptp(points[:, 1])
        widths = {side: np.concatenate([r for p in row for r in p.outlines])[:, 0] for side, row in worn.views.items()}
        scale = min(high / extent, 0.042 / max(float(np.ptp(x)) for x in widths.values()))
        for number, (side, row) in enumerate(worn.views.items()):
            middle = np.array([page.left + 0.024 + 0.047 * number, top - high / 2])
            centre = np.array([(widths[side].min() + widths[side].max()) / 2, low + extent / 2])
            for piece in row:
                page.canvas.setLineJoin(1)
                for lines, fill, width in ((piece.outlines, True, 0.7), (piece.lines, False, 0.45)):
                    for line in lines:
                        page.canvas.setFillColor("#ffffff")
                        page.canvas.setStrokeColor("#000000")
                        placed = middle + scale * (line - centre)
                        draw_line(page.canvas, placed, width=width, closed=fill, filled=fill)
            page.y = float(middle[1]) - scale * extent / 2 - 0.005
            page.text(float(middle[0]) - 0.010, translate(f"from the {side}"))
    page.y = top + 0.004
    left, page.left, page.width = page.left, page.left + 0.100, page.width - 0.100
    measures = worn.measures.get(size, ())
    missed = any(measure.misses for measure in measures)
    if measures:
        page.text(page.left, translate("Measures") + (f", {printed_size(size)}" if size else ""), HEADING, bold=True)
        page.y -= 0.003
        rows = [
            [
                translate_name(measure.name),
                page.length(measure.body),
                page.length(measure.finished),
                page.length(measure.ease, signed=True),
                *(
                    [page.length(measure.asked, signed=True) if measure.misses and measure.asked is not None else ""]
                    * missed
                ),
            ]
            for measure in measures
        ]
        titles = ("body", "finished", "ease", *(["asked for"] * missed))
        page.table(["", *map(translate, titles)], rows, (0.28, *(0.72 / len(titles) for _ in titles)))
    page.y -= 0.006
    for kind in worn.failing:
        page.paragraph(translate(FAILING[kind]))
    if worn.needed:
        page.paragraph(translate("Too small to put on without an opening:"))
        for need in worn.needed:
            page.paragraph(
                translate(
                    "{ring}: {length} around, {girth} must pass ({over}); open it {depth} deep.",
                    ring=translate_name(need.ring),
                    length=page.length(need.length),
                    girth=page.length(need.girth),
                    over=translate_name(need.over),
                    depth=page.length(need.depth),
                )
            )
    elif measures:
        page.paragraph(translate("It can be put on: every edge and level passes what of the body goes through it."))
    page.left, page.width = left, page.width + 0.100
    page.y = min(page.y, top - high - 0.006)
    if len(sizes) > 1 and measures:
        page.heading(translate("Choose your size: body / finished"), (2 + len(measures)) * LINE)
        for start in range(0, len(sizes), SIZES_IN_ROW):
            columns = [{each.name: each for each in worn.measures[one]} for one in sizes[start : start + SIZES_IN_ROW]]
            rows = [
                [
                    translate_name(name),
                    *(
                        f"{page.length(each[name].body)} / {page.length(each[name].finished)}" if name in each else ""
                        for each in columns
                    ),
                ]
                for name in (measure.name for measure in measures)
            ]
            heads = ["", *sizes[start : start + SIZES_IN_ROW]]
            page.table(heads, rows, (0.15, *[0.85 / SIZES_IN_ROW] * len(columns)))


def _prices(page: _Page, found: Sequence[FoundSeam]) -> None:
    """Write what each seam that was found releases, left and right together, for how much sewing."""
    groups: dict[str, list[FoundSeam]] = {}
    for seam in found:
        groups.setdefault(without_side(seam.name), []).append(seam)
    prices = {name: sum(seam.released or 0.0 for seam in own) for name, own in groups.items()}
    rows = []
    for name in sorted(groups, key=lambda one: -prices[one]):
        own, length = groups[name], sum(seam.length for seam in groups[name])
        tried = any(seam.released is not None for seam in own)
        rows.append(
            [
                translate_name(name) + (f" ({len(own)} x)" if len(own) > 1 else ""),
                page.length(length),
                energy_words(prices[name]) if tried else translate(own[0].needed or "not tried"),
                f"{energy_words(prices[name] / max(100.0 * length, 1e-9))}/cm" if tried else "",
            ]
        )
    page.heading(translate("What each seam is for"), 3 * LINE)
    page.paragraph(
        translate("The strain energy that a seam takes from the cloth, for its length on the garment as it is worn.")
    )
    page.table(["", *map(translate, ("length as worn", "releases", "per length"))], rows, (0.34, 0.16, 0.34, 0.16))


def _step(page: _Page, number: int, sewing: SewingStep, pieces: Sequence[tuple[DraftedPiece, frozenset[str]]]) -> None:
    """Write a step with small pictures: how it is sewn, and of its pieces, what is sewn in colour."""
    shown = pieces[:STEP_PIECES]
    width = page.width - 0.010 - STEP_WIDTH - TECHNIQUE[0]
    rows = wrap_text(sewing.words, TEXT * CAPITALS / POINT, width).split("\n")
    height = max(LINE * len(rows), STEP_HEIGHT) + 0.0012
    page.need(height)
    top = page.y
    for row_number, row in enumerate(rows):
        page.y -= LINE
        if row_number == 0:
            page.text(page.left, str(number), bold=True)
        page.text(page.left + 0.006, row)
    corner = np.array([page.left + page.width - STEP_WIDTH - TECHNIQUE[0] - 0.002, top - 0.5 * (height + TECHNIQUE[1])])
    for stroke in techniques()[sewing.technique]["drawing"]:
        style, *numbers = stroke.split(" ")
        colour, line_width, dashes = STROKES[style]
        page.canvas.setStrokeColor(colour)
        page.canvas.setDash(list(dashes))
        points = corner + np.array(numbers, dtype=float).reshape(-1, 2) * TECHNIQUE / BOX
        draw_line(page.canvas, points, width=line_width)
    page.canvas.setDash([])
    if shown:
        room = STEP_WIDTH / STEP_PIECES
        largest = np.max([np.ptp(piece.cut_line, axis=0) for piece, _ in shown], axis=0)
        scale = min((STEP_HEIGHT - 0.002) / largest[1], (room - 0.002) / largest[0])
        for k, (piece, sewn) in enumerate(shown):
            x = page.left + page.width - room * (len(shown) - k - 0.5)
            _thumbnail(page.canvas, piece, np.array([x, top - height / 2]), float(scale), sewn)
    page.y = top - height


def _thumbnail(
    canvas: Any, piece: DraftedPiece, centre: FloatArray, scale: float, sewn: frozenset[str] | None = None
) -> None:
    """Draw one piece, small, about a centre [m]; the fold in dashes; with `sewn`, these edges in colour in place of the grain."""
    low, high = piece.cut_line.min(axis=0), piece.cut_line.max(axis=0)
    canvas.setStrokeColor("#000000")
    canvas.setDash([])

    def draw(points: FloatArray, width: float, *, closed: bool) -> None:
        draw_line(canvas, centre + scale * (points - (low + high) / 2), width=width, closed=closed)

    draw(piece.cut_line, 0.7 if sewn is None else 0.4, closed=True)
    if sewn is None:
        draw(piece.grain, 0.4, closed=False)
    for dart in piece.darts:
        for leg in (dart.dart.left, dart.dart.right):
            draw(piece.drawn_line(piece.edge(leg)), 0.4, closed=False)
    for line in piece.fisheyes.values():
        draw(line, 0.4, closed=True)
    canvas.setStrokeColor("#b8460b")
    for name, line in ({edge.name: piece.drawn_line(edge) for edge in piece.edges} | dict(piece.fisheyes)).items():
        if sewn and name in sewn:
            draw(line, 1.5, closed=name in piece.fisheyes)
    canvas.setDash([2, 1.2])
    for edge in piece.fold_edges:
        draw(edge.line, 1.4, closed=False)
    canvas.setDash([])


def _cloth(page: _Page, whole: DraftedGarment) -> None:
    """Write how much cloth each size takes at the usual widths."""
    page.heading(translate("Cloth needed"), 3 * LINE)
    units = whole.pattern.units
    head = ["", *(translate("{width} wide", width=cloth_words(width, units, of_width=True)) for width in WIDTHS)]
    needed = cloth_needed(whole)
    fabrics = dict.fromkeys(fabric for cloths in needed.values() for fabric in cloths)
    rows = []
    for fabric, size in ((fabric, size) for fabric in fabrics for size in needed if fabric in needed[size]):
        lengths = needed[size][fabric]
        words = [translate("too narrow") if length is None else cloth_words(length, units) for length in lengths]
        rows.append(
            [", ".join(part for part in (translate_name(fabric), printed_size(size) if size else "") if part), *words]
        )
    page.table(head, rows, (0.34, 0.22, 0.22, 0.22))
    for name, cloth in ({} if whole.pattern.worn is None else whole.pattern.worn.cloths).items():
        told = translate(
            f"a {cloth.kind} cloth of {{weight}} g/m2, which a hand's pull stretches by {{along}} % along and {{across}} % across",
            weight=round(1000 * cloth.weight),
            along=round(100 * cloth.stretch[0]),
            across=round(100 * cloth.stretch[1]),
        )
        if cloth.examples:
            told += translate(
                ", such as {examples}", examples=listed([translate_name(each) for each in cloth.examples])
            )
        page.paragraph(told, indent=0.030, lead=translate_name(name))
    page.paragraph(
        translate("Pieces laid flat on one layer, both ways up the grain. Take more for nap, prints and shrinkage.")
    )
