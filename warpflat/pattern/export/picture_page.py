"""The page of `picture.png`: pieces in cells that are packed on it, each with its views, grain and labels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from matplotlib.patches import Rectangle

from warpflat.core import FloatArray, IntArray
from warpflat.pattern.drafting.placement import LabelRoom, Spot
from warpflat.pattern.export.colours import energy_colours
from warpflat.pattern.export.figure import GRAIN, GREY, INK, LABEL_SIZE, MARGIN, PAGE_WIDTH, Pen
from warpflat.pattern.export.labels import draw_lines
from warpflat.pattern.export.picture_garment import GarmentViews
from warpflat.pattern.export.picture_views import DrawnView, Silhouette, View

__all__ = [
    "BETWEEN",
    "CAPTIONS_ALONE",
    "STRIP",
    "Cell",
    "draw_cell",
    "draw_scale_bar",
    "lay_out",
    "pack_boxes",
    "pack_rows",
    "place_views",
]


# All lengths in inches. Above all cells there is a strip with the scales of length and colour.
STRIP, _STRIP_WORDS = 0.66, 0.52  # its height, and where its words end
_BESIDE, _BESIDE_ALONE = 0.2, 0.12  # either side of a view, for names; those of one piece may stand in the margin
_FOOT = 0.22  # below a view, for names
_HIGHEST = 0.15  # a view below the upper edge
_SMALLEST_PATTERN, _NARROWEST, _NARROWEST_PAGE = 2.0, 1.6, 8.5
_TALLEST_PIECE = 8.0  # half as much again if its views are stacked
_TALLEST, _TALLEST_WORN = 15.0, 24.0  # all cells, and with the garment on its body
_SCALES = 0.95 ** np.arange(54)
_BAND_SCALES = (1.0, 0.9, 0.8, 0.7)  # of the garment on its body
_REORDERED = 0.02  # how much more of the page pieces must cover to stand otherwise than in rows, in their own order
_BETWEEN, _CAPTION_SIZE, _TITLE_SIZE = "  ·  ", 7.5, 10.5  # [pt]
_STACKED = 2.6  # width of two views side by side over their height, from which they stand one below the other
CAPTIONS_ALONE = 4.6  # wide, left of the colour bar
_LONGEST_NAME = 5.4  # two of them have room side by side
_SHORTEST_GRAIN = 0.28  # half its length
_HEADING, _HALF_HEADING = 0.34, 0.4  # above the cloth, with its heading; half the width of one
BETWEEN = 0.34  # cloth of a view from that of the view above, with names between
_ABOVE = 0.2  # cloth below words, with a name between


@dataclass(frozen=True, kw_only=True)
class _Words:
    """A box of words above the views of a piece [in]: between `left` and `right`, down to `bottom` below the cell's upper edge."""

    left: float
    right: float
    bottom: float


@dataclass(kw_only=True, eq=False)
class Cell:
    """One piece on the page: its name, captions, views, and its place from `left` to the right and from `top` down [in].

    The name of one that is `alone` on its page stands beside the colour bar, above the cell; its views stand as near to these words and
    to each other as their outlines allow. Views that are `stacked` stand one below the other.
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
    height: float = 0.0
    places: list[tuple[float, float]] = field(default_factory=list)
    words: list[_Words] = field(default_factory=list)

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

    @cached_property
    def silhouettes(self) -> list[Silhouette]:
        """Those of the views."""
        return [Silhouette(view) for view in self.views]

    @property
    def covered(self) -> float:
        """The area of the page that the views cover [in2]."""
        return self.inches_per_metre**2 * sum(shape.area for shape in self.silhouettes)

    def stack_if_wide(self) -> None:
        """Choose whether the two views stand side by side."""
        width, height = self.extent
        self.stacked = len(self.views) > 1 and float(width) > _STACKED * float(height)

    def fit(self, pen: Pen, scale: float, narrowest: float) -> None:
        """Choose scale [in/m], width and captions; a piece that would become too small to read is drawn larger.

        The name is shortened to its room. A page with this piece `alone` is `narrowest` [in] at least.
        """
        beside = 2 * (_BESIDE_ALONE if self.alone else _BESIDE) * self.columns
        widest = (PAGE_WIDTH - 2 * MARGIN - beside) / max(float(self.extent[0]), 1e-9)
        readable = _SMALLEST_PATTERN / max(float(self.pattern.size[:2].max()), 1e-9)
        self.inches_per_metre = max(scale, min(widest, readable))
        longest = CAPTIONS_ALONE - 0.15 if self.alone else _LONGEST_NAME
        self.name = pen.shorten(self.name, _TITLE_SIZE, longest, "bold")
        named = pen.measure(self.name, _TITLE_SIZE, "bold")[0] + 0.15
        self.width = max(self.inches_per_metre * float(self.extent[0]) + beside, _NARROWEST, named)
        if self.alone:
            self.width = max(self.width, narrowest - 2 * MARGIN)
        # The captions are lines that end within the cell.
        width, height = self.pattern.size[:2]
        factor, word = (100, "cm") if max(width, height) >= 0.00999 else (1000, "mm")
        captions = {"pattern": f"{factor * width:.1f} × {factor * height:.1f} {word}"} | dict(self.captions)
        all_room = CAPTIONS_ALONE if self.alone else self.width - 0.1
        gap = pen.measure(_BETWEEN, _CAPTION_SIZE)[0]
        lines: list[str] = []
        room = 0.0
        for key, value in captions.items():
            entry = pen.shorten(f"{key} {value}", _CAPTION_SIZE, all_room)
            taken = pen.measure(entry, _CAPTION_SIZE)[0]
            if lines and gap + taken < room:
                lines[-1] += _BETWEEN + entry
                room -= gap + taken
            else:
                lines.append(entry)
                room = all_room - taken
        self.caption_lines = lines
        # The views stand below the words.
        words = max(named, *(pen.measure(line, _CAPTION_SIZE)[0] for line in self.caption_lines), 0.0)
        above = STRIP - 0.08 if self.alone else 0.0
        self.words = [_Words(left=0.0, right=words, bottom=0.25 + 0.15 * len(self.caption_lines) - above)]
        if self.alone:
            self.words.append(_Words(left=CAPTIONS_ALONE - 0.1, right=PAGE_WIDTH, bottom=_STRIP_WORDS - STRIP))
        self.places = place_views(
            self.silhouettes,
            self.inches_per_metre,
            width=self.width,
            stacked=self.stacked,
            words=self.words,
            top=_HIGHEST - (STRIP if self.alone else 0.0),
            has_headings=self.shows_body,
        )
        ends = [
            low + self.inches_per_metre * shape.height
            for (_, low), shape in zip(self.places, self.silhouettes, strict=True)
        ]
        self.height = max(ends) + _FOOT


def place_views(
    silhouettes: Sequence[Silhouette],
    scale: float,
    *,
    width: float,
    stacked: bool,
    words: Sequence[_Words],
    top: float,
    has_headings: bool,
) -> list[tuple[float, float]]:
    """Place the views of a piece side by side or one below the other, as near to words and to each other as their outlines allow.

    Args:
        silhouettes: of the views, from the left or from the top.
        scale: [in/m].
        width: of the cell [in].
        stacked: whether they stand one below the other.
        words: above them.
        top: the highest place of a view, below the cell's upper edge [in].
        has_headings: whether a word stands above the middle of each view.

    Returns:
        For each view how far its box is to the right and below the cell's upper left corner [in].
    """
    sizes = [(scale * shape.width, scale * shape.height) for shape in silhouettes]
    spare = (width - sum(wide for wide, _ in sizes)) / len(sizes)
    places, left = list[tuple[float, float]](), 0.0
    for shape, (wide, _) in zip(silhouettes, sizes, strict=True):
        x = 0.5 * (width - wide) if stacked else left + 0.5 * spare
        left += wide + spare
        heading_left, heading_right = x + 0.5 * wide - _HALF_HEADING, x + 0.5 * wide + _HALF_HEADING
        heading = _HEADING - _heading_room(shape, scale)
        # The view's upper edge is no higher than any of these.
        limits = [top]
        for box in words:
            room = shape.room_above((box.left - x) / scale, (box.right - x) / scale)
            limits.append(box.bottom + _ABOVE - scale * room)
            if has_headings and box.left < heading_right and box.right > heading_left:
                limits.append(box.bottom + heading)
        if stacked and places:
            above, (x_above, low_above) = silhouettes[len(places) - 1], places[-1]
            bottom = low_above + scale * above.height + BETWEEN
            limits.append(bottom - scale * above.overlap_below(shape, (x - x_above) / scale))
            if has_headings:
                room = above.room_below((heading_left - x_above) / scale, (heading_right - x_above) / scale)
                limits.append(bottom + heading - scale * room)
        places.append((x, max(limits)))
    if not stacked:
        # The lower ones are as low as they must be; others stand in the middle of their room.
        floor = max(low + high for (_, low), (_, high) in zip(places, sizes, strict=True))
        places = [(x, 0.5 * (low + floor - high)) for (x, low), (_, high) in zip(places, sizes, strict=True)]
    return places


def _heading_room(shape: Silhouette, scale: float) -> float:
    """Return how far the cloth below the heading of a view is from the view's upper edge [in]."""
    half = _HALF_HEADING / scale
    room = scale * shape.room_above(0.5 * shape.width - half, 0.5 * shape.width + half)
    return min(room, scale * shape.height)


def lay_out(
    pen: Pen, cells: Sequence[Cell], worn: GarmentViews | None = None, *, narrowest: float = 0.0
) -> tuple[float, float, float]:
    """Choose the scale and the place of each piece, from the upper left corner; return width and height of the page, and the scale [in/m].

    All pieces have the same scale, so that they can be compared; only one that would become too small to read is
    drawn larger. A garment on its body comes first, at a scale of its own. The scales are those that leave least of the page empty.
    The page is `narrowest` [in] at least.
    """
    narrowest = max(narrowest, _NARROWEST_PAGE)
    room, tallest = PAGE_WIDTH - 2 * MARGIN, _TALLEST if worn is None else _TALLEST_WORN
    if worn is None and len(cells) == 1:
        # One piece has its views side by side or one below the other.
        cell = cells[0]
        tried = []
        for stacked in (False, True) if cell.alone and len(cell.views) > 1 else (cell.stacked,):
            cell.stacked = stacked
            scale = _largest_scale(cell, room)
            cell.fit(pen, scale, narrowest)
            empty = 1.0 - cell.covered / ((cell.width + 2 * MARGIN) * (cell.height + STRIP))
            tried.append((max(0.0, cell.height - _TALLEST), empty, stacked, scale))
        _, _, cell.stacked, scale = min(tried)
        cell.fit(pen, scale, narrowest)
        cell.left, cell.top = MARGIN, 0.0
        return cell.width + 2 * MARGIN, cell.height, scale
    own_order = list(range(len(cells)))
    by_height = sorted(range(len(cells)), key=lambda k: -float(cells[k].extent[1]))
    found = []
    for scale in min(_largest_scale(cell, room) for cell in cells) * _SCALES:
        for cell in cells:
            cell.fit(pen, scale, narrowest)
        covered = sum(cell.covered for cell in cells)
        for share in _BAND_SCALES if worn is not None else (1.0,):
            band = [] if worn is None else [worn.size(share, room)]
            shown = covered + (0.0 if worn is None else worn.covered(share, room))
            for order, pack in ((own_order, pack_rows), (by_height, pack_boxes)):
                places, wide, tall = pack([*band, *((cells[k].width, cells[k].height) for k in order)], room)
                wide = max(wide, narrowest - 2 * MARGIN)
                empty = _REORDERED * (order is by_height) - shown / ((wide + 2 * MARGIN) * (tall + STRIP))
                found.append((max(0.0, tall - tallest), empty, scale, share, order, places, wide, tall))
    _, _, scale, share, order, places, wide, tall = min(found, key=lambda each: each[:2])
    if worn is not None:
        worn.place(share, room, wide, beside=any(top < worn.size(share, room)[1] for _, top in places[1:]))
        places = places[1:]
    for k, (left, top) in zip(order, places, strict=True):
        cells[k].fit(pen, scale, narrowest)
        cells[k].left, cells[k].top = MARGIN + left, top
    return wide + 2 * MARGIN, tall, float(scale)


def _largest_scale(cell: Cell, room: float) -> float:
    """Return the largest scale of a piece on a page with so much room [in/m]."""
    beside = 2 * (_BESIDE_ALONE if cell.alone else _BESIDE) * cell.columns
    tallest = _TALLEST_PIECE * (1.5 if cell.stacked else 1.0)
    return min((room - beside) / max(float(cell.extent[0]), 1e-9), tallest / max(float(cell.extent[1]), 1e-9))


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
    size, shown = cell.inches_per_metre, list[DrawnView]()
    for view, (left, low) in zip(cell.views, cell.places, strict=True):
        y = top - low - size * float(view.size[1])
        drawn = DrawnView(view, left=cell.left + left, bottom=y, inches_per_metre=size)
        drawn.draw(pen.axes, energy_colours(cell.density, scale))
        shown.append(drawn)
    room = LabelRoom()
    for box in cell.words:
        room.take_box(cell.left + box.left, top - box.bottom, cell.left + box.right, top - box.bottom + 0.5)
    if cell.shows_body:
        for drawn, shape, words in zip(shown, cell.silhouettes, ("on the body", "pattern"), strict=True):
            y = drawn.box[3] - _heading_room(shape, size) + 0.24
            x = 0.5 * (drawn.box[0] + drawn.box[2])
            width, height = pen.measure(words, 8.5)
            pen.write(x, y, words, 8.5, color=GREY, ha="center", fontstyle="italic")
            room.take_box(x - 0.5 * width, y - 0.5 * height, x + 0.5 * width, y + 0.5 * height)
    floor, start = top - cell.height + 0.02, cell.left
    if cell.alone or size != page_scale:
        end = draw_scale_bar(pen, cell.left, floor, size)
        room.take_box(cell.left, floor, end, floor + 0.08)
        start = end + 0.15
    datum = cell.pattern.lines.get(cell.datum, [None])[0] if cell.datum is not None else None
    has_grain = datum is None or _grain(pen, room, shown[-1], datum, cell.grain_angle)
    unnamed: dict[str, None] = {}
    # Left, bottom, right and upper edge of the room for the names of each view [in].
    outside = _BESIDE - _BESIDE_ALONE if cell.alone else 0.0
    left, right = cell.left - outside, cell.left + cell.width + outside
    boxes = [view.box for view in shown]
    if cell.stacked:
        pages = [(left, max(box[1] - _FOOT, floor), right, box[3] + 0.2) for box in boxes]
    else:
        sides = pairwise([left, *(0.5 * (a[2] + b[0]) for a, b in pairwise(boxes)), right])
        pages = [(start_, floor, end_, box[3] + 0.2) for (start_, end_), box in zip(sides, boxes, strict=True)]
    for drawn, page in zip(shown, pages, strict=True):
        others = [other for other in shown if other is not drawn]
        unnamed |= dict.fromkeys(draw_lines(pen, room, drawn, cell.datum, page, others))
    if not has_grain and datum is not None and not _grain(pen, room, shown[-1], datum, cell.grain_angle, pages[-1]):
        unnamed["grain"] = None
    if unnamed:
        _write_unnamed(pen, room, list(unnamed), start, cell.left + cell.width, floor)


def draw_scale_bar(pen: Pen, left: float, y: float, inches_per_metre: float) -> float:
    """Draw a bar of a round length whose lower left corner is at (`left`, `y`) [in]; return where its words end."""
    steps = np.outer(10.0 ** np.arange(-6, 4), [1.0, 2.0, 5.0]).ravel()
    metres = float(steps[max(int(np.searchsorted(steps, 1.3 / inches_per_metre, side="right")) - 1, 0)])
    wide = metres * inches_per_metre
    for part in range(2):
        fill = INK if part == 0 else "white"
        box = Rectangle(
            (left + 0.5 * part * wide, y), 0.5 * wide, 0.06, facecolor=fill, edgecolor=INK, linewidth=0.7, zorder=6
        )
        pen.axes.add_patch(box)
    text = f"{100 * metres:.0f} cm" if metres >= 0.00999 else f"{1000 * metres:.3g} mm"
    pen.write(left + wide + 0.08, y + 0.03, text, 9, color=GREY)
    return left + wide + 0.08 + pen.measure(text, 9)[0]


def _write_unnamed(pen: Pen, room: LabelRoom, names: Sequence[str], left: float, right: float, floor: float) -> None:
    """Write at the foot of a cell which names had no room, between names that stand there [in]; their number where there is little room."""
    all_names = ", ".join(names)
    texts = [
        f"not labelled for want of room: {all_names}",
        pen.shorten(f"not labelled: {all_names}", 7, right - left - 0.1),
        f"not labelled: {len(names)}",
    ]
    for text in texts:
        width, height = pen.measure(text, 7)
        spots = [
            Spot(x=x + 0.5 * width, y=floor + 0.04, angle=0.0)
            for x in np.arange(left, right - width - 0.1 + 1e-6, 0.1).tolist()
        ]
        page = (left - 0.1, floor - 0.1, right + 0.1, floor + 0.3)
        if spot := room.place(spots, width, height, page):
            pen.write(spot.x, spot.y, text, 7, color=GREY, ha="center")
            return


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


def pack_rows(sizes: Sequence[tuple[float, float]], width: float) -> tuple[list[tuple[float, float]], float, float]:
    """Place boxes in turn from left to right, in rows one below the other; arguments and results as of :func:`pack_boxes`."""
    places, right, top, foot, widest = list[tuple[float, float]](), 0.0, 0.0, 0.0, 0.0
    for wide, high in sizes:
        if right + wide > width * (1.0 + 1e-9):
            right, top = 0.0, foot
        places.append((right, top))
        right, foot = right + wide, max(foot, top + high)
        widest = max(widest, right)
    return places, widest, foot


def pack_boxes(sizes: Sequence[tuple[float, float]], width: float) -> tuple[list[tuple[float, float]], float, float]:
    """Place boxes in turn, each as high as it goes and then as far to the left (bottom-left rule on a skyline).

    Burke, Kendall and Whitwell, "A new placement heuristic for the orthogonal stock-cutting problem", 2004, describe such skylines.

    Args:
        sizes: width and height of each box, no wider than the page.
        width: of the page.

    Returns:
        The left and upper edge of each box, measured from the page's upper left corner; the width and the height that they take.
    """
    # Where the free room begins: from each place to the right, up to the next place.
    skyline, places = [(0.0, 0.0)], []
    for wide, high in sizes:
        spots = [(_depth(skyline, left, wide), left) for left, _ in skyline if left + wide <= width * (1.0 + 1e-9)]
        top, left = min(spots)
        places.append((left, top))
        right, after = left + wide, _depth(skyline, left + wide, 0.0)
        skyline = [spot for spot in skyline if not left <= spot[0] <= right]
        skyline = sorted([*skyline, (left, top + high), (right, after)])
    taken = [(left + wide, top + high) for (left, top), (wide, high) in zip(places, sizes, strict=True)]
    return places, max(right for right, _ in taken), max(foot for _, foot in taken)


def _depth(skyline: Sequence[tuple[float, float]], left: float, wide: float) -> float:
    """Return how far down the boxes reach between `left` and `left + wide`."""
    before = [depth for start, depth in skyline if start <= left + 1e-9]
    return max([before[-1], *(depth for start, depth in skyline if left < start < left + wide - 1e-9)])
