"""The page of `picture.png`: pieces in cells that are packed on it, each with its views, grain and labels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.export.colours import energy_colours
from warpflat.export.labels import LabelRoom, Spot
from warpflat.export.picture_lines import draw_lines
from warpflat.export.picture_packing import pack_boxes, pack_rows
from warpflat.export.picture_pen import DPI, GRAIN, GREY, LABEL_SIZE, PAGE_WIDTH, Pen
from warpflat.export.picture_scale import STRIP, draw_scale_bar
from warpflat.export.picture_views import DrawnView, View

__all__ = ["CAPTIONS_ALONE", "MARGIN", "Cell", "draw_cell", "lay_out"]

MARGIN = 0.25  # [in], as all that follows
_BESIDE = 0.28  # either side of a view, for names
_HEADING = 0.32  # above a view, for words and names
_FOOT = 0.24  # below a view, for names
_SMALLEST_PATTERN, _NARROWEST, _NARROWEST_PAGE = 2.0, 1.6, 8.5
_TALLEST_PIECE, _TALLEST = (
    8.0,
    15.0,
)  # what a piece, half as much again if its views are stacked, and all cells may take
_SCALES = 0.97 ** np.arange(90)
_REORDERED = 0.02  # how much more of the page pieces must cover to stand otherwise than in rows, in their own order
_BETWEEN, _CAPTION_SIZE, _TITLE_SIZE = "  ·  ", 7.5, 11.5  # [pt]
_STACKED = 2.6  # width of two views side by side over their height, from which they stand one below the other
CAPTIONS_ALONE = 3.6  # wide, left of the colour bar
_SHORTEST_GRAIN = 0.28  # half its length


@dataclass(kw_only=True, eq=False)
class Cell:
    """One piece on the page: its name, captions, views, and its place from `left` to the right and from `top` down [in].

    The name of one that is `alone` on its page stands beside the colour bar, above the cell. Views that are `stacked` stand one below
    the other.
    """

    name: str
    captions: Mapping[str, str]
    density: FloatArray
    on_body: View
    pattern: View
    datum: str | None
    grain_angle: float = 0.0
    shows_body: bool = True
    alone: bool = False
    stacked: bool = False
    caption_lines: list[str] = field(default_factory=list)
    inches_per_metre: float = 1.0
    left: float = 0.0
    top: float = 0.0
    width: float = 0.0

    @property
    def areas(self) -> FloatArray:
        """#F, the areas of the faces on the body [m2]."""
        facets, vectors = self.on_body.facets, self.on_body.vectors
        lengths = np.zeros(len(facets.triangles)) if vectors is None else np.linalg.norm(vectors, axis=1)
        summed = np.bincount(facets.face_of_triangle, weights=lengths, minlength=len(facets.faces))
        return summed.astype(np.float64)

    @property
    def views(self) -> list[View]:
        """The views that are shown, from the left."""
        return [self.on_body, self.pattern] if self.shows_body else [self.pattern]

    @property
    def extent(self) -> FloatArray:
        """Width and height of all views together [m]."""
        sizes = np.array([view.size[:2] for view in self.views])
        along = 1 if self.stacked else 0
        extent = sizes.max(axis=0)
        extent[along] = sizes[:, along].sum()
        return np.asarray(extent)

    @property
    def columns(self) -> int:
        """Number of views side by side."""
        return 1 if self.stacked else len(self.views)

    @property
    def head(self) -> float:
        """Room for the name, the captions and the words or names above the views."""
        words = _HEADING if self.shows_body else 0.16
        return words if self.alone else 0.28 + 0.15 * len(self.caption_lines) + words

    @property
    def height(self) -> float:
        """Height of the cell [in]."""
        between = (_HEADING + _FOOT) * (len(self.views) - self.columns)
        return self.head + self.inches_per_metre * float(self.extent[1]) + between + _FOOT

    def stack_if_wide(self) -> None:
        """Choose whether the two views stand side by side."""
        width, height = self.extent
        self.stacked = len(self.views) > 1 and float(width) > _STACKED * float(height)

    def fit(self, pen: Pen, scale: float) -> None:
        """Choose scale [in/m], width and captions; a piece that would become too small to read is drawn larger."""
        beside = 2 * _BESIDE * self.columns
        widest = (PAGE_WIDTH - 2 * MARGIN - beside) / max(float(self.extent[0]), 1e-9)
        readable = _SMALLEST_PATTERN / max(float(self.pattern.size[:2].max()), 1e-9)
        self.inches_per_metre = max(scale, min(widest, readable))
        named = pen.measure(self.name, _TITLE_SIZE, "bold")[0] + 0.15
        self.width = max(self.inches_per_metre * float(self.extent[0]) + beside, _NARROWEST, named)
        self.caption_lines = _wrapped(pen, self)


def lay_out(pen: Pen, cells: Sequence[Cell]) -> tuple[float, float, float]:
    """Choose the scale and the place of each piece, from the upper left corner; return width and height of the page, and the scale [in/m].

    All pieces have the same scale, so that they can be compared; only one that would become too small to read is
    drawn larger. The scale is the one that leaves least of the page empty.
    """
    room = PAGE_WIDTH - 2 * MARGIN
    limits = [
        min(
            (room - 2 * _BESIDE * cell.columns) / max(float(cell.extent[0]), 1e-9),
            _TALLEST_PIECE * (1.5 if cell.stacked else 1.0) / max(float(cell.extent[1]), 1e-9),
        )
        for cell in cells
    ]
    own_order = list(range(len(cells)))
    by_height = sorted(range(len(cells)), key=lambda k: -float(cells[k].extent[1]))
    found = []
    for scale in min(limits) * _SCALES:
        for cell in cells:
            cell.fit(pen, scale)
        covered = sum(float(np.prod(cell.extent)) * cell.inches_per_metre**2 for cell in cells)
        for order, pack in ((own_order, pack_rows), (by_height, pack_boxes)):
            places, wide, tall = pack([(cells[k].width, cells[k].height) for k in order], room)
            wide = max(wide, _NARROWEST_PAGE - 2 * MARGIN)
            share = covered / (wide * tall) - (_REORDERED if order is by_height else 0.0)
            found.append((max(0.0, tall - _TALLEST), -share, scale, order, places, wide, tall))
    _, _, scale, order, places, wide, tall = min(found, key=lambda each: each[:2])
    for k, (left, top) in zip(order, places, strict=True):
        cells[k].fit(pen, scale)
        cells[k].left, cells[k].top = MARGIN + left, top
    if len(cells) == 1:
        cells[0].width = wide
    return wide + 2 * MARGIN, tall, float(scale)


def _wrapped(pen: Pen, cell: Cell) -> list[str]:
    """Return the captions as lines that end within the cell."""
    width, height = cell.pattern.size[:2]
    captions = {"pattern": _size(width, height)} | dict(cell.captions)
    all_room = CAPTIONS_ALONE if cell.alone else cell.width - 0.1
    gap = pen.measure(_BETWEEN, _CAPTION_SIZE)[0]
    lines: list[str] = []
    room = 0.0
    for key, value in captions.items():
        entry = f"{key} {value}"
        taken = pen.measure(entry, _CAPTION_SIZE)[0]
        if lines and gap + taken < room:
            lines[-1] += _BETWEEN + entry
            room -= gap + taken
        else:
            lines.append(entry)
            room = all_room - taken
    return lines


def draw_cell(pen: Pen, cell: Cell, top: float, scale: float, page_scale: float) -> None:
    """Draw a piece.

    Args:
        cell: placed by :func:`lay_out`.
        top: where the cells begin [in].
        scale: upper end of the colours [J/m2].
        page_scale: of lengths, that of most pieces [in/m].
    """
    top -= cell.top
    title = top + STRIP - 0.08 if cell.alone else top
    pen.write(cell.left, title - 0.13, cell.name, _TITLE_SIZE, fontweight="bold")
    for index, text in enumerate(cell.caption_lines):
        pen.write(cell.left, title - 0.32 - 0.15 * index, text, _CAPTION_SIZE, color=GREY)
    size, shown = cell.inches_per_metre, []
    frames = _frames(cell, top)
    for view, (left, bottom, right, upper) in zip(cell.views, frames, strict=True):
        width, height = view.size[:2] * size
        x, y = 0.5 * (left + right - float(width)), 0.5 * (bottom + upper - float(height))
        drawn = DrawnView(view, left=x, bottom=y, inches_per_metre=size, dpi=DPI)
        drawn.draw(pen.axes, energy_colours(cell.density, scale))
        shown.append(drawn)
    room = LabelRoom()
    if cell.shows_body:
        for drawn, frame, words in zip(shown, frames, ("on the body", "pattern"), strict=True):
            _heading(pen, room, drawn, words, frame[3] + 0.24)
    floor = top - cell.height + 0.02
    if cell.alone or size != page_scale:
        end = draw_scale_bar(pen, cell.left, floor, size)
        room.take_box(cell.left, floor, end, floor + 0.08)
    datum = cell.pattern.lines.get(cell.datum, [None])[0] if cell.datum is not None else None
    has_grain = datum is None or _grain(pen, room, shown[-1], datum, cell.grain_angle)
    unnamed: dict[str, None] = {}
    # Names may stand below and above a view, and beside it.
    pages = [(left, bottom - _FOOT + 0.02, right, upper + 0.2) for left, bottom, right, upper in frames]
    for drawn, page in zip(shown, pages, strict=True):
        unnamed |= dict.fromkeys(draw_lines(pen, room, drawn, cell.datum, page))
    if not has_grain and datum is not None and not _grain(pen, room, shown[-1], datum, cell.grain_angle, pages[-1]):
        unnamed["grain"] = None
    if unnamed:
        text = f"not labelled for want of room: {', '.join(unnamed)}"
        pen.write(cell.left, floor + 0.04, text, 7, color=GREY)


def _frames(cell: Cell, top: float) -> list[tuple[float, float, float, float]]:
    """Return left, bottom, right and upper edge of the room of each view of a cell whose upper edge is at `top` [in]."""
    heights = [cell.inches_per_metre * float(view.size[1]) for view in cell.views]
    upper = top - cell.head
    if cell.stacked:
        below = upper - heights[0] - _FOOT - _HEADING
        right = cell.left + cell.width
        return [(cell.left, upper - heights[0], right, upper), (cell.left, below - heights[1], right, below)]
    widths = [cell.inches_per_metre * float(view.size[0]) for view in cell.views]
    spare = (cell.width - sum(widths)) / len(widths)
    ends = cell.left + np.cumsum([0.0, *(width + spare for width in widths)])
    return [(left, upper - max(heights), right, upper) for left, right in pairwise(ends.tolist())]


def _heading(pen: Pen, room: LabelRoom, drawn: DrawnView, words: str, y: float) -> None:
    x = 0.5 * (drawn.box[0] + drawn.box[2])
    width, height = pen.measure(words, 8.5)
    pen.write(x, y, words, 8.5, color=GREY, ha="center", fontstyle="italic")
    room.take_box(x - 0.5 * width, y - 0.5 * height, x + 0.5 * width, y + 0.5 * height)


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
    turn = np.radians(grain_angle)
    along = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ (along / length)
    along *= 1.0 if along[1] >= 0 else -1.0
    across = np.array([along[1], -along[0]])
    text_width, text_height = pen.measure("grain", LABEL_SIZE)
    if page is None:
        place = _grain_inside(drawn, 0.5 * (line[0] + line[-1]), along, across, length, text_height)
    else:
        place = _grain_outside(room, drawn, float(np.arctan2(along[1], along[0])), page)
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


def _grain_outside(
    room: LabelRoom, drawn: DrawnView, angle: float, page: tuple[float, float, float, float]
) -> tuple[FloatArray, float] | None:
    """Return the middle of the arrow and half its length [in] beside the cloth; None if there is no room."""
    left, bottom, right, top = drawn.box
    spots = [
        Spot(x=x, y=bottom + share * (top - bottom), angle=angle)
        for x in (right + 0.25, left - 0.2, right + 0.45, right + 0.9)
        for share in (0.5, 0.25, 0.75, 0.1, 0.9)
    ]
    free = room.place(spots, 0.8, 0.35, page)
    return None if free is None else (np.array([free.x - 0.05, free.y]), 0.35)


def _size(width: float, height: float) -> str:
    """Return width and height in the unit of the larger one."""
    factor, word = (100, "cm") if max(width, height) >= 0.00999 else (1000, "mm")
    return f"{factor * width:.1f} × {factor * height:.1f} {word}"
