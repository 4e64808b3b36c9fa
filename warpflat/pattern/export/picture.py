"""`picture.png`: a garment on its mannequin, then its patterns; other pieces on the body and in the plane, coloured by strain energy."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from warpflat.core import FloatArray, IntArray, report_activity
from warpflat.flat import Surface, join_surfaces
from warpflat.pattern.drafting.placement import LabelRoom, Spot
from warpflat.pattern.drafting.polygons import rotation
from warpflat.pattern.export.colours import DRAFTED_CLOTH, SMALLEST_SCALE, Scale, energy_scale
from warpflat.pattern.export.dressed import Body, dress
from warpflat.pattern.export.figure import GRAIN, GREY, INK, LABEL_SIZE, MARGIN, PAGE_WIDTH, Pen, write_figure
from warpflat.pattern.export.geometry import face_areas, polylines_of
from warpflat.pattern.export.labels import draw_lines
from warpflat.pattern.export.letters import all_letters, is_drawn, titles
from warpflat.pattern.export.packing import pack_boxes, pack_rows
from warpflat.pattern.export.views import SIDES, DrawnView, Facets, View, draw_row, row_size

__all__ = ["DraftedOutline", "PicturePiece", "draw_figure", "write_picture"]

# All lengths in inches, all sizes of letters in points. Above all there is a strip with the scales of length and colour.
_STRIP, _SCALE_BAR, _BAR_HEIGHT, _WORDS_SIZE = 0.66, 2.3, 0.17, 9.5
_NOTE, _PLAIN, _SHORTEST_BAR = 2.0, 0.5, 1.2  # room right of the colour bar: for what it leaves out, or for nothing
_ROOM = PAGE_WIDTH - 2 * MARGIN
_NARROWEST_PAGE = 8.8
# A piece: room for names beside, below and above its views, for the heading of a view, and for a line of its captions.
_BESIDE, _FOOT, _NAMED, _HEADING, _LINE = 0.2, 0.22, 0.18, 0.4, 0.15
_BETWEEN, _TITLE_SIZE = "  ·  ", 10.5
_LONGEST_NAME = 5.4  # two of them have room side by side
_SMALLEST_PATTERN, _NARROWEST = 2.0, 1.6
_STACKED = 2.6  # width of two views side by side over their height, from which they stand one below the other
_TALLEST_PIECE = 8.0  # half as much again if its views are stacked
_TALLEST, _TALLEST_WORN = 15.0, 24.0  # all pieces, and with the garment on its body
_SCALES = 0.95 ** np.arange(54)
_REORDERED = 0.02  # how much more of the page pieces must cover to stand otherwise than in rows, in their own order
_SHORTEST_GRAIN = 0.28  # half its length
# The garment on its body: scales that are tried, its greatest height, the room above, below and between its views.
_BAND_SCALES, _BAND_TALLEST, _BAND_HEAD, _BAND_FOOT, _BAND_GAP = (1.0, 0.9, 0.8, 0.7), 9.0, 0.26, 0.30, 0.25
# It lies on the mannequin: it is drawn this much nearer to the eye, and drafted pieces, such as patches, over it [m].
_NEARER, _OVER = 0.012, 0.004
# Drafted outlines: their colour, their heading, room for a name above each, and gaps between them.
_CLOTH, _ROWS_HEADING, _NAME, _GAP, _NAME_SIZE = (0.95, 0.94, 0.91), 0.36, 0.20, 0.22, 8.0


@dataclass(frozen=True, kw_only=True, eq=False)
class PicturePiece:
    """One piece of the picture.

    Attributes:
        name: the piece's.
        surface: in space [m].
        faces: #F by 4, the surface's faces in the pattern's numbering.
        positions: #P by 2, the pattern [m].
        face_energy_density: #F [J/m2].
        lines: feature lines in the pattern's numbering; each a vertex-index array or a list of them.
        surface_lines: feature lines in the surface's numbering; the surface's own if not given.
        datum: the name of the line from which the piece was developed, which is the grain; None if it is not known.
        grain_angle: of the grain against the datum, degrees, anticlockwise.
        captions: key measures to print under the name, such as ``{"strain energy": "12.3 mJ", "fabric": "poplin"}``.
    """

    name: str
    surface: Surface
    faces: IntArray
    positions: FloatArray
    face_energy_density: FloatArray
    lines: Mapping[str, Any] = field(default_factory=dict)
    surface_lines: Mapping[str, Any] | None = None
    datum: str | None = None
    grain_angle: float = 0.0
    captions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class DraftedOutline:
    """A drafted piece.

    Attributes:
        name: that is written above it.
        points: #P by 2 [m], its sewing line, closed, the first point not repeated.
        worn: its copies where they are worn; none of what lies within the garment.
    """

    name: str
    points: FloatArray
    worn: Sequence[Surface] = ()


def write_picture(
    path: str | os.PathLike[str],
    pieces: Sequence[PicturePiece],
    *,
    scale: float | None = None,
    body: Body | None = None,
    drafted: Sequence[DraftedOutline] = (),
) -> None:
    """Draw every piece on the body and as pattern, at one scale of length and one of energy; atomically.

    Args:
        path: the file, ``*.png``.
        pieces: what is drawn.
        scale: upper end of the colours [J/m2]; if not given, 98 % of the area of all pieces lies below it.
        body: on which all pieces are shown together first, from the front, the side and the back. If not given, each piece is
            shown in space beside its pattern.
        drafted: pieces without a surface, as collars and waistbands: grey on the body, and their outlines below the others.

    Raises:
        InputError: the file cannot be written.
        ValueError: there is no piece.
    """
    report_activity(f"drawing {os.path.basename(path)}")
    write_figure(path, draw_figure(pieces, scale=scale, body=body, drafted=drafted))


@all_letters()
def draw_figure(
    pieces: Sequence[PicturePiece],
    *,
    scale: float | None = None,
    body: Body | None = None,
    drafted: Sequence[DraftedOutline] = (),
) -> Figure:
    """Return the Matplotlib figure that :func:`write_picture` saves, of the size that it needs; see there for the arguments.

    Raises:
        ValueError: there is no piece.
    """
    if not pieces:
        raise ValueError("a picture needs at least one piece")
    names = titles([piece.name for piece in pieces], is_drawn)
    density = np.concatenate([np.asarray(piece.face_energy_density, dtype=np.float64) for piece in pieces])
    areas = np.concatenate([face_areas(piece.surface.vertices, piece.surface.faces) for piece in pieces])
    colours = Scale(high=energy_scale(density, areas) if scale is None else scale)
    cells = list[_Cell]()
    for piece in pieces:
        faces = np.asarray(piece.faces, dtype=np.int32)
        in_plane, views = Facets.of(faces), dict[str, View]()
        if body is None:
            in_space = piece.surface.lines if piece.surface_lines is None else piece.surface_lines
            on_body = in_plane if np.array_equal(faces, piece.surface.faces) else Facets.of(piece.surface.faces)
            views["on the body"] = View.of_surface(piece.surface, on_body, polylines_of(in_space))
        positions = np.asarray(piece.positions, dtype=np.float64)
        views["pattern" if body is None else ""] = View.of_pattern(positions, in_plane, polylines_of(piece.lines))
        shades = colours.rgb(np.asarray(piece.face_energy_density, dtype=np.float64))
        cell = _Cell(
            name=names[piece.name], captions=dict(piece.captions), colours=shades, views=views,
            datum=piece.datum, grain_angle=piece.grain_angle,
        )  # fmt: skip
        wide, tall = cell.extent
        cell.stacked = body is None and float(wide) > _STACKED * float(tall)
        cells.append(cell)
    if len(cells) == 1 and body is None:
        cells[0].narrowest = _NARROWEST_PAGE - 2 * MARGIN
    pen = Pen(PAGE_WIDTH, 4.0)
    # The first caption that is the same in all cells stands left of the colour bar, if there is room for it.
    shared = ""
    for key, value in list(cells[0].captions.items()) if len(cells) > 1 else ():
        caption = f"{key} {value}"
        fits = pen.measure(caption, LABEL_SIZE)[0] < _SCALE_BAR - 0.1
        if fits and all(cell.captions.get(key) == value for cell in cells):
            for cell in cells:
                del cell.captions[key]
            shared = caption
            break
    band = None if body is None else _Band(body, pieces, drafted, colours)
    width, height, page_scale = _lay_out(pen, cells, band)
    foot = _draw_drafted(pen, drafted, width - 2 * MARGIN, page_scale) if drafted else 0.0
    pen.resize(width, height + _STRIP + foot)
    pen.scale_bar(MARGIN, pen.height - 0.27, page_scale)
    pen.write(MARGIN, pen.height - 0.48, shared, LABEL_SIZE, color=GREY)
    # The scale of the colours goes up to the right margin, the share of the area above its end beside it.
    left, top, above = MARGIN + _SCALE_BAR, pen.height - 0.24, density > colours.high
    if colours.high <= SMALLEST_SCALE and not above.any():
        words = "strain energy density: none, the cloth lies flat without strain"
        pen.write(left, top, pen.shorten(words, _WORDS_SIZE, pen.width - left - MARGIN), _WORDS_SIZE)
    else:
        right = pen.width - (_NOTE if above.any() else _PLAIN)
        words = pen.shorten("strain energy density [J/m²]", _WORDS_SIZE, right - left - 0.15 - _SHORTEST_BAR)
        pen.write(left, top, words, _WORDS_SIZE)
        left += pen.measure(words, _WORDS_SIZE)[0] + 0.15
        extend = "max" if above.any() else "neither"
        bar = pen.colour_bar(colours, left, top - 0.5 * _BAR_HEIGHT, right - left, _BAR_HEIGHT, extend=extend)
        bar.formatter.set_powerlimits((-3, 4))
        bar.ax.locator_params("x", nbins=int(np.clip((right - left) / 0.45, 1, 9)), steps=[1, 2, 2.5, 5, 10])
        total = float(areas.sum())
        if above.any() and total > 0.0:
            part = float(areas[above].sum()) / total
            percent = f"{100 * part:.1f} %" if part >= 0.001 else "under 0.1 %"
            text = f"clipped: {percent} of the area\nis above, up to {density.max():.3g} J/m²"
            pen.write(right + 0.12, top, text, LABEL_SIZE, color=GREY, linespacing=1.35)
    top = pen.height - _STRIP
    if band is not None:
        band.draw(pen, MARGIN, top)
    for cell in cells:
        _draw_cell(pen, cell, top, page_scale)
    return pen.figure


@dataclass(kw_only=True, eq=False)
class _Cell:
    """One piece on the page: its name, captions, views, and its place from `left` to the right and from `top` down [in].

    Views that are `stacked` stand one below the other. It is `narrowest` at least.
    """

    name: str
    captions: dict[str, str]
    colours: FloatArray
    views: dict[str, View]
    datum: str | None
    grain_angle: float
    narrowest: float = _NARROWEST
    stacked: bool = False
    caption_lines: list[str] = field(default_factory=list)
    inches_per_metre: float = 1.0
    left: float = 0.0
    top: float = 0.0
    width: float = 0.0
    height: float = 0.0

    @property
    def pattern(self) -> View:
        """The flat one of its views."""
        return list(self.views.values())[-1]

    @property
    def rows(self) -> list[dict[str, View]]:
        """The views that stand side by side, row by row."""
        return [{title: view} for title, view in self.views.items()] if self.stacked else [self.views]

    @property
    def extent(self) -> FloatArray:
        """Width and height of all views together [m]."""
        sizes = np.array([view.size[:2] for view in self.views.values()])
        across, down = (
            (sizes.max(axis=0), sizes.sum(axis=0)) if self.stacked else (sizes.sum(axis=0), sizes.max(axis=0))
        )
        return np.array([max(float(across[0]), 1e-9), max(float(down[1]), 1e-9)])

    @property
    def beside(self) -> float:
        """Room for names at both sides of all views side by side [in]."""
        return 2 * _BESIDE * len(self.rows[0])

    @property
    def largest_scale(self) -> float:
        """The largest scale on a page [in/m]."""
        tallest = _TALLEST_PIECE * (1.5 if self.stacked else 1.0)
        return float(min((_ROOM - self.beside) / self.extent[0], tallest / self.extent[1]))

    def fit(self, pen: Pen, scale: float) -> None:
        """Choose scale [in/m], size and captions; a piece that would become too small to read is drawn larger."""
        widest = (_ROOM - self.beside) / float(self.extent[0])
        readable = _SMALLEST_PATTERN / max(float(self.pattern.size[:2].max()), 1e-9)
        self.inches_per_metre = max(scale, min(widest, readable))
        self.name = pen.shorten(self.name, _TITLE_SIZE, _LONGEST_NAME, "bold")
        named = pen.measure(self.name, _TITLE_SIZE, "bold")[0] + 0.15
        wide, high = self.inches_per_metre * self.extent
        self.width = max(float(wide) + self.beside, self.narrowest, named)
        # The captions are lines that end within the cell.
        width, height = self.pattern.size[:2]
        factor, word = (100, "cm") if max(width, height) >= 0.00999 else (1000, "mm")
        self.caption_lines, room = list[str](), 0.0
        for key, value in {"pattern": f"{factor * width:.1f} × {factor * height:.1f} {word}", **self.captions}.items():
            entry = pen.shorten(f"{key} {value}", LABEL_SIZE, self.width - 0.1)
            taken = pen.measure(entry, LABEL_SIZE)[0]
            gap = pen.measure(_BETWEEN, LABEL_SIZE)[0]
            if self.caption_lines and gap + taken < room:
                self.caption_lines[-1] += _BETWEEN + entry
                room -= gap + taken
            else:
                self.caption_lines.append(entry)
                room = self.width - 0.1 - taken
        self.height = self.head + float(high) + len(self.rows) * _FOOT + (len(self.rows) - 1) * _HEADING

    @property
    def words(self) -> float:
        """How far name and captions reach down [in]."""
        return 0.28 + _LINE * len(self.caption_lines)

    @property
    def head(self) -> float:
        """How far the views are below the upper edge [in]."""
        return self.words + (_HEADING if len(self.views) > 1 else _NAMED)


class _Band:
    """The garment on its mannequin, seen from three sides, across the page."""

    def __init__(
        self, body: Body, pieces: Sequence[PicturePiece], drafted: Sequence[DraftedOutline], scale: Scale
    ) -> None:
        flattened, others = [piece.surface for piece in pieces], [surface for each in drafted for surface in each.worn]
        worn = join_surfaces([*flattened, *others])
        points, facets, skin = dress(body, worn.vertices, worn.faces)
        self._views = View.around(points, facets)
        for view in self._views.values():
            cloth = view.points[: len(worn.vertices), 2]
            cloth += _NEARER
            cloth[sum(len(surface.vertices) for surface in flattened) :] += _OVER
        density = np.concatenate([np.asarray(piece.face_energy_density, dtype=np.float64) for piece in pieces])
        plain = np.tile(DRAFTED_CLOTH, (len(worn.faces) - len(density), 1))
        self._colours = np.concatenate([scale.rgb(density), plain, skin])
        # What the body shows of drafted pieces, and which lie within the garment.
        within = dict.fromkeys(each.name.partition(", ")[0] for each in drafted if not each.worn)
        words = ["grey: drafted for its edges, laid by its seams"] if others else []
        self._words = "; ".join([*words, *([f"not shown on the body: {', '.join(within)}"] if within else [])])
        self._width, self._tallest = row_size(self._views)
        self.area = sum(view.area for view in self._views.values())
        self._gaps = len(SIDES) * _BAND_GAP
        self.largest_scale = min((_ROOM - self._gaps) / self._width, _BAND_TALLEST / self._tallest)
        self.scale, self.room = self.largest_scale, 0.0

    def size(self, scale: float) -> tuple[float, float]:
        """Return width and height [in] at a scale [in/m]."""
        return min(self._width * scale + self._gaps, _ROOM), _BAND_HEAD + self._tallest * scale + _BAND_FOOT

    def draw(self, pen: Pen, left: float, top: float) -> None:
        """Draw the views at the chosen scale across the chosen room, with their upper left corner at (`left`, `top`) [in]."""
        gap = (self.room - self._width * self.scale) / len(SIDES)
        bottom = top - _BAND_HEAD - self._tallest * self.scale
        draw_row(
            pen, self._views, [self._colours] * len(SIDES),
            left=left + 0.5 * gap, bottom=bottom, inches_per_metre=self.scale, gap=gap,
        )  # fmt: skip
        pen.write(left, bottom - 0.16, self._words, _NAME_SIZE, color=GREY)


def _lay_out(pen: Pen, cells: Sequence[_Cell], band: _Band | None) -> tuple[float, float, float]:
    """Choose the scale and the place of each piece, from the upper left corner; return width and height of the page, and the scale [in/m].

    All pieces have the same scale, so that they can be compared; only one that would become too small to read is
    drawn larger. A garment on its body comes first, at a scale of its own. The scales are those that leave least of the page empty.
    """
    tallest = _TALLEST if band is None else _TALLEST_WORN
    own_order = list(range(len(cells)))
    by_height = sorted(own_order, key=lambda k: -float(cells[k].extent[1]))
    found = []
    for stacked in (False, True) if len(cells) == 1 and len(cells[0].views) > 1 else (None,):
        if stacked is not None:  # one piece alone
            cells[0].stacked = stacked
        for scale in (
            min(cell.largest_scale for cell in cells) * _SCALES[: 1 if band is None and len(cells) == 1 else None]
        ):
            for cell in cells:
                cell.fit(pen, scale)
            covered = sum(cell.inches_per_metre**2 * view.area for cell in cells for view in cell.views.values())
            for share in _BAND_SCALES if band is not None else (0.0,):
                large = 0.0 if band is None else share * band.largest_scale
                shown = covered + (0.0 if band is None else band.area * large**2)
                first = [] if band is None else [band.size(large)]
                for order, pack in ((own_order, pack_rows), (by_height, pack_boxes)):
                    places, wide, tall = pack([*first, *((cells[k].width, cells[k].height) for k in order)], _ROOM)
                    wide = max(wide, _NARROWEST_PAGE - 2 * MARGIN)
                    empty = _REORDERED * (order is by_height) - shown / ((wide + 2 * MARGIN) * (tall + _STRIP))
                    found.append((max(0.0, tall - tallest), empty, stacked, scale, large, order, places, wide, tall))
    _, _, stacked, scale, large, order, places, wide, tall = min(found, key=lambda each: each[:2])
    if band is not None:
        # Gaps fill the width unless pieces stand beside it.
        own_width, own_height = band.size(large)
        band.scale, band.room = large, own_width if any(top < own_height for _, top in places[1:]) else wide
        places = places[1:]
    for k, (left, top) in zip(order, places, strict=True):
        cells[k].stacked = cells[k].stacked if stacked is None else stacked
        cells[k].fit(pen, scale)
        cells[k].left, cells[k].top = MARGIN + left, top
    return wide + 2 * MARGIN, tall, float(scale)


def _draw_cell(pen: Pen, cell: _Cell, top: float, page_scale: float) -> None:
    """Draw a piece.

    Args:
        pen: of the page.
        cell: with its place.
        top: where the cells begin [in].
        page_scale: of lengths, that of most pieces [in/m].
    """
    top -= cell.top
    pen.write(cell.left, top - 0.13, cell.name, _TITLE_SIZE, fontweight="bold")
    for index, text in enumerate(cell.caption_lines):
        pen.write(cell.left, top - 0.32 - _LINE * index, text, LABEL_SIZE, color=GREY)
    size, shown, bottom = cell.inches_per_metre, list[DrawnView](), top - cell.head
    for row in cell.rows:
        sizes = size * np.array([view.size[:2] for view in row.values()])
        bottom -= float(sizes[:, 1].max())
        gap = (cell.width - float(sizes[:, 0].sum())) / len(row)
        left, colours = cell.left + 0.5 * gap, [cell.colours] * len(row)
        shown += draw_row(pen, row, colours, left=left, bottom=bottom, inches_per_metre=size, gap=gap, above=0.26)
        bottom -= _FOOT + _HEADING
    room = LabelRoom()
    room.take_box(cell.left, top - cell.words, cell.left + cell.width, top)
    for drawn, words in zip(shown, cell.views, strict=True):
        x, y, half = 0.5 * (drawn.box[0] + drawn.box[2]), drawn.box[3], 0.5 * pen.measure(words, 9)[0]
        room.take_box(x - half, y + 0.18, x + half, y + 0.34)
    floor, start = top - cell.height + 0.02, cell.left
    if size != page_scale:
        end = pen.scale_bar(cell.left, floor, size)
        room.take_box(cell.left, floor, end, floor + 0.08)
        start = end + 0.15
    datum = cell.pattern.lines.get(cell.datum, [None])[0] if cell.datum is not None else None
    has_grain = datum is None or _grain(pen, room, shown[-1], datum, cell.grain_angle)
    unnamed: dict[str, None] = {}
    # Left, bottom, right and upper edge of the room for the names of each view [in].
    right, boxes = cell.left + cell.width, [view.box for view in shown]
    if cell.stacked:
        pages = [(cell.left, max(box[1] - _FOOT, floor), right, box[3] + 0.2) for box in boxes]
    else:
        sides = pairwise([cell.left, *(0.5 * (a[2] + b[0]) for a, b in pairwise(boxes)), right])
        pages = [(begin, floor, end, box[3] + 0.2) for (begin, end), box in zip(sides, boxes, strict=True)]
    for drawn, page in zip(shown, pages, strict=True):
        others = [other for other in shown if other is not drawn]
        unnamed |= dict.fromkeys(draw_lines(pen, room, drawn, cell.datum, page, others))
    if not has_grain and datum is not None and not _grain(pen, room, shown[-1], datum, cell.grain_angle, pages[-1]):
        unnamed["grain"] = None
    # Which names had no room stands at the foot, between names that stand there; their number where there is little room.
    all_names = ", ".join(unnamed)
    texts = (
        f"not labelled for want of room: {all_names}",
        pen.shorten(f"not labelled: {all_names}", 7, right - start - 0.1),
        f"not labelled: {len(unnamed)}",
    )
    for text in texts if unnamed else ():
        width, height = pen.measure(text, 7)
        places = np.arange(start, right - width - 0.1 + 1e-6, 0.1) + 0.5 * width
        spots = [Spot(x=x, y=floor + 0.04, angle=0.0) for x in places.tolist()]
        if spot := room.place(spots, width, height, (start - 0.1, floor - 0.1, right + 0.1, floor + 0.3)):
            pen.write(spot.x, spot.y, text, 7, color=GREY, ha="center")
            break


def _grain(
    pen: Pen,
    room: LabelRoom,
    drawn: DrawnView,
    datum: IntArray,
    grain_angle: float,
    page: tuple[float, float, float, float] | None = None,
) -> bool:
    """Draw a grain arrow, turned by `grain_angle` degrees from the datum line; return False if there is no room.

    It lies on the pattern, or beside it where a `page` is given, within which it stays [in].
    """
    line = drawn.to_page(drawn.view.points[datum])
    along = line[-1] - line[0]
    length = float(np.linalg.norm(along))
    if not length > 0.0:
        return True
    along = rotation(np.radians(grain_angle)) @ (along / length)
    along *= 1.0 if along[1] >= 0 else -1.0
    across = np.array([along[1], -along[0]])
    text_width, text_height = pen.measure("grain", LABEL_SIZE)
    if page is None:
        place = _grain_inside(drawn, 0.5 * (line[0] + line[-1]), along, across, length, text_height)
    else:
        angle = float(np.arctan2(along[1], along[0]))
        left, bottom, right, top = drawn.box
        spots = [
            Spot(x=x, y=bottom + share * (top - bottom), angle=angle)
            for x in (right + 0.25, left - 0.2, right + 0.45, right + 0.9)
            for share in (0.5, 0.25, 0.75, 0.1, 0.9)
        ]
        free = room.place(spots, 0.8, 0.35, page)
        place = None if free is None else (np.array([free.x - 0.05, free.y]), 0.35)
    if place is None:
        return False
    centre, half = place
    ends = np.array([centre - half * along, centre + half * along])
    pen.arrow(ends, width=1.3, colour=GRAIN, head=5.5, halo=True)
    room.take_line(ends, 0.12)
    middle = centre + across * (0.5 * text_height + 0.07)
    angle = float(np.degrees(np.arctan2(along[1], along[0])))
    options = {"ha": "center", "rotation": angle, "rotation_mode": "anchor", "color": GRAIN}
    pen.write(float(middle[0]), float(middle[1]), "grain", LABEL_SIZE, halo=True, **options)
    room.take_line(middle + np.array([[-0.5], [0.5]]) * text_width * along, text_height)
    return True


def _grain_inside(
    drawn: DrawnView,
    middle: FloatArray,
    along: FloatArray,
    across: FloatArray,
    length: float,
    text_height: float,
) -> tuple[FloatArray, float] | None:
    """Return the middle of the arrow and half its length [in], where it lies on the cloth; None if nowhere."""
    left, bottom, right, top = drawn.box
    width = abs(float(across[0])) * (right - left) + abs(float(across[1])) * (top - bottom)
    for half in (0.2 * length, 0.12 * length, _SHORTEST_GRAIN):
        for shift in (0.0, 0.15, -0.15, 0.3, -0.3):
            for aside in (0.12, -0.12, 0.2, -0.2, 0.3, -0.3, 0.42, -0.42):
                centre = middle + shift * length * along + aside * width * across
                run = centre + np.linspace(-half, half, 15)[:, None] * along
                margin = 0.10
                edges = np.concatenate([run - margin * across, run + (margin + text_height) * across])
                if half >= _SHORTEST_GRAIN and drawn.covers(edges).all():
                    return centre, half
    return None


def _draw_drafted(pen: Pen, pieces: Sequence[DraftedOutline], width: float, page_scale: float) -> float:
    """Draw drafted outlines in rows at the foot of a page, longer side across; return how high they reach [in].

    Where the longest does not fit into the width [in] at the page's scale [in/m], all are drawn smaller.
    """
    outlines = []
    for piece in pieces:
        wide, high = np.ptp(piece.points, axis=0)
        points = piece.points if wide >= high else np.column_stack([piece.points[:, 1], -piece.points[:, 0]])
        outlines.append(points - [points[:, 0].min(), points[:, 1].max()])
    scale = min(page_scale, (width - _GAP) / max(float(np.ptp(points[:, 0])) for points in outlines))
    sizes = list[tuple[float, float]]()
    for piece, points in zip(pieces, outlines, strict=True):
        wide, high = (scale * np.ptp(points, axis=0)).tolist()
        # A name that is wider than the page is shortened where it is written.
        sizes.append((min(max(wide, pen.measure(piece.name, _NAME_SIZE)[0]) + _GAP, width), high + _NAME + _GAP))
    places, _, tall = pack_rows(sizes, width)
    heading, top = "drafted for the edges that they are sewn to", tall + _ROWS_HEADING
    pen.write(MARGIN, top - 0.14, heading, _WORDS_SIZE, color=GREY, fontstyle="italic")
    if scale < page_scale * (1.0 - 1e-9):
        pen.scale_bar(MARGIN + pen.measure(heading, _WORDS_SIZE)[0] + 0.25, top - 0.17, scale)
    for piece, points, (across, down) in zip(pieces, outlines, places, strict=True):
        pen.write(MARGIN + across, tall - down - 0.5 * _NAME, piece.name, _NAME_SIZE)
        corner = np.array([MARGIN + across, tall - down - _NAME])
        pen.polygon(corner + scale * points, facecolor=_CLOTH, edgecolor=INK, linewidth=0.8, zorder=3)
    return top
