"""The page of `picture.png`: rows of two views with dimensions, grain, labels and a scale bar, and one colour bar."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.export.colours import energy_colours
from warpflat.export.labels import LabelRoom, Spot
from warpflat.export.picture_lines import draw_lines
from warpflat.export.picture_pen import DPI, GRAIN, GREY, LABEL_SIZE, PAGE_WIDTH, POINT, Pen
from warpflat.export.picture_views import INK, DrawnView, View

__all__ = ["TOP_MARGIN", "Row", "draw_colour_bar", "draw_row", "lay_out", "page_height"]

TOP_MARGIN = 0.30  # [in], as all that follows
_LEFT, _RIGHT = 0.55, 1.75  # the colour bar stands in the right margin
_BETWEEN = 1.35  # from surface to pattern: the height's dimension line, and labels that do not fit inside
_BESIDE = 0.75  # right of the pattern, for labels
_NAMES_LEFT = 1.0  # left of the surface, for labels, where two pieces stand side by side
_LITTLE_SMALLER = 0.8
_BELOW = 0.95  # a row's foot: the width's dimension line and the scale bar
_SMALLEST_BAND, _SMALLEST_PATTERN = 1.0, 2.4
_COLOUR_BAR = (1.9, 3.6)  # its least and its greatest height
_BAR_WIDTH = 0.2
_BAR_TIP = 0.05  # of its length, for what lies above the scale
_SHORTEST_GRAIN = 0.28  # half its length
_TICK_SIZE = 8.5  # [pt]


@dataclass(kw_only=True, eq=False)
class Row:
    """One piece on the page: its name, captions, two views, and where they lie, from `left` to `right` [in]."""

    name: str
    captions: Mapping[str, str]
    density: FloatArray
    on_body: View
    pattern: View
    datum: str | None
    grain_angle: float = 0.0
    caption_lines: list[str] = field(default_factory=list)
    inches_per_metre: float = 1.0
    band: float = 0.0
    left: float = _LEFT
    right: float = PAGE_WIDTH - _RIGHT

    @property
    def areas(self) -> FloatArray:
        """#F, the areas of the faces on the body [m2]."""
        facets, vectors = self.on_body.facets, self.on_body.vectors
        lengths = np.zeros(len(facets.triangles)) if vectors is None else np.linalg.norm(vectors, axis=1)
        summed = np.bincount(facets.face_of_triangle, weights=lengths, minlength=len(facets.faces))
        return summed.astype(np.float64)

    @property
    def head(self) -> float:
        """Room for the name, the captions and the words above the views."""
        return 0.34 + 0.20 * len(self.caption_lines) + 0.44

    @property
    def height(self) -> float:
        """Height of the whole row [in]."""
        return self.head + self.band + _BELOW


def lay_out(pen: Pen, rows: Sequence[Row]) -> list[list[Row]]:
    """Choose the scale and the place of each piece, and return the pieces of each band across the page, from the top.

    All pieces have the same scale, so that they can be compared; only a piece that would become too small to read is
    drawn larger. Each has its own scale bar. Narrow pieces stand side by side.
    """
    wide = PAGE_WIDTH - _LEFT - _RIGHT - _BETWEEN - _BESIDE
    high = 6.0 if len(rows) == 1 else 4.4 if len(rows) < 4 else 3.4
    sizes = [(row.on_body.size[:2], row.pattern.size[:2]) for row in rows]
    fits = [
        min(wide / max(float(body[0] + flat[0]), 1e-9), high / max(float(body[1]), float(flat[1]), 1e-9))
        for body, flat in sizes
    ]
    scale = min(fits)
    # The scale at which any two stand side by side, where that is not much smaller.
    room = 0.5 * (PAGE_WIDTH - _LEFT - _RIGHT) - _NAMES_LEFT - _BETWEEN - _BESIDE
    paired = room / max(float(body[0] + flat[0]) for body, flat in sizes)
    if len(rows) > 1 and paired > _LITTLE_SMALLER * scale:
        scale = min(scale, paired)
    for row, fit, (body, flat) in zip(rows, fits, sizes, strict=True):
        readable = _SMALLEST_PATTERN / max(float(flat.max()), 1e-9)
        row.inches_per_metre = max(scale, min(fit, readable))
        row.band = max(_SMALLEST_BAND, row.inches_per_metre * float(max(body[1], flat[1])))
    rows[0].band = max(rows[0].band, _COLOUR_BAR[0])
    bands = _bands(rows)
    for band in bands:
        width = (PAGE_WIDTH - _LEFT - _RIGHT) / len(band)
        for place, row in enumerate(band):
            row.left, row.right = _LEFT + place * width, _LEFT + (place + 1) * width
            row.caption_lines = _wrapped(pen, row)
        # The views of a band stand at one height.
        lines = max(len(row.caption_lines) for row in band)
        tallest = max(row.band for row in band)
        for row in band:
            row.caption_lines += [""] * (lines - len(row.caption_lines))
            row.band = tallest
    return bands


def _bands(rows: Sequence[Row]) -> list[list[Row]]:
    """Return the pieces in bands, as many to each as fit side by side."""
    bands: list[list[Row]] = []
    for row in rows:
        if bands:
            wider = [*bands[-1], row]
            if max(map(_least_width, wider)) * len(wider) <= PAGE_WIDTH - _LEFT - _RIGHT + 1e-9:
                bands[-1] = wider
                continue
        bands.append([row])
    return bands


def _least_width(row: Row) -> float:
    """Return how wide a piece is with its two views and their labels [in]."""
    views = float(row.on_body.size[0] + row.pattern.size[0]) * row.inches_per_metre
    return _NAMES_LEFT + views + _BETWEEN + _BESIDE


def page_height(bands: Sequence[Sequence[Row]]) -> float:
    """Return the height of the page [in]."""
    return TOP_MARGIN + sum(band[0].height for band in bands) + 0.15


def _wrapped(pen: Pen, row: Row) -> list[str]:
    """Return the captions as lines that end before the next piece or the colour bar."""
    width, height = row.pattern.size[:2]
    captions = {"pattern": _size(width, height)} | dict(row.captions)
    lines: list[str] = []
    for key, value in captions.items():
        entry = f"{key} {value}"
        longer = f"{lines[-1]}   ·   {entry}" if lines else entry
        if lines and pen.measure(longer, 9.5)[0] < row.right - row.left:
            lines[-1] = longer
        else:
            lines.append(entry)
    return lines


def draw_row(pen: Pen, row: Row, top: float, scale: float) -> None:
    """Draw a piece whose upper edge is at `top` [in], its colours up to `scale` [J/m2]."""
    pen.write(row.left, top - 0.14, row.name, 15, fontweight="bold")
    for index, text in enumerate(row.caption_lines):
        pen.write(row.left, top - 0.42 - 0.20 * index, text, 9.5, color=GREY)
    middle = top - row.head - 0.5 * row.band
    size = row.inches_per_metre
    body, flat = row.on_body.size * size, row.pattern.size * size
    spare = row.right - row.left - _BETWEEN - _BESIDE - float(body[0] + flat[0])
    left = row.left + 0.3 * spare
    shown = []
    for view, extent in ((row.on_body, body), (row.pattern, flat)):
        bottom = middle - 0.5 * float(extent[1])
        drawn = DrawnView(view, left=left, bottom=bottom, inches_per_metre=size, dpi=DPI)
        drawn.draw(pen.axes, energy_colours(row.density, scale))
        shown.append(drawn)
        left += float(body[0]) + _BETWEEN + 0.35 * spare
    room = LabelRoom()
    on_body, pattern = shown
    for drawn, words in ((on_body, "on the body"), (pattern, "pattern")):
        _heading(pen, room, drawn, words, top - row.head + 0.16)
    _dimensions(pen, room, pattern)
    _scale_bar(pen, room, on_body, size)
    datum = row.pattern.lines.get(row.datum, [None])[0] if row.datum is not None else None
    has_grain = datum is None or _grain(pen, room, pattern, datum, row.grain_angle, inside=True)
    floor = top - row.height + 0.02
    left_end = 0.1 if row.left == _LEFT else row.left + 0.05
    between = 0.5 * (on_body.box[2] + pattern.box[0])
    unnamed: dict[str, None] = {}
    for drawn, left, right in ((on_body, left_end, between), (pattern, between, row.right + 0.05)):
        page = (left, floor, right, top - row.head + 0.2)
        unnamed |= dict.fromkeys(draw_lines(pen, room, drawn, row.datum, page))
    if not has_grain and datum is not None and not _grain(pen, room, pattern, datum, row.grain_angle, inside=False):
        unnamed["grain"] = None
    if unnamed:
        text = f"not labelled for want of room: {', '.join(unnamed)}"
        pen.write(row.left, floor + 0.06, text, 7.5, color=GREY)


def _heading(pen: Pen, room: LabelRoom, drawn: DrawnView, words: str, y: float) -> None:
    x = 0.5 * (drawn.box[0] + drawn.box[2])
    width, height = pen.measure(words, 9.5)
    pen.write(x, y, words, 9.5, color=GREY, ha="center", fontstyle="italic")
    room.take_box(x - 0.5 * width, y - 0.5 * height, x + 0.5 * width, y + 0.5 * height)


def _grain(pen: Pen, room: LabelRoom, drawn: DrawnView, datum: IntArray, grain_angle: float, *, inside: bool) -> bool:
    """Draw a grain arrow, turned by `grain_angle` degrees from the datum line; return False if there is no room.

    It lies on the pattern if `inside`, else right of it.
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
    if inside:
        place = _grain_inside(drawn, 0.5 * (line[0] + line[-1]), along, across, length, text_height)
    else:
        place = _grain_outside(room, drawn, float(np.arctan2(along[1], along[0])))
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


def _grain_outside(room: LabelRoom, drawn: DrawnView, angle: float) -> tuple[FloatArray, float] | None:
    """Return the middle of the arrow and half its length [in] beside the cloth; None if there is no room."""
    _, bottom, right, top = drawn.box
    spots = [
        Spot(x=right + far, y=bottom + share * (top - bottom), angle=angle)
        for far in (0.45, 0.9)
        for share in (0.5, 0.25, 0.75, 0.1, 0.9)
    ]
    free = room.place(spots, 0.8, 0.35, (0.0, 0.0, PAGE_WIDTH, np.inf))
    return None if free is None else (np.array([free.x - 0.05, free.y]), 0.35)


def _dimensions(pen: Pen, room: LabelRoom, drawn: DrawnView) -> None:
    """Draw width and height of the pattern, as in a technical drawing."""
    left, bottom, right, top = drawn.box
    width, height = drawn.view.size[:2]
    y, x = bottom - 0.22, left - 0.26
    for start, end, ticks in (
        ((left, y), (right, y), ((left, left), (right, right))),
        ((x, bottom), (x, top), ((bottom, bottom), (top, top))),
    ):
        ends = np.array([start, end])
        if np.ptp(ends, axis=0).max() > 0.3:
            pen.arrow(ends, width=0.6, colour=GREY, head=3.5)
        else:
            pen.line(ends, width=0.6, colour=GREY)
        for tick, _ in ticks:
            mark = [(tick, y + 0.14), (tick, y - 0.06)] if start[1] == end[1] else [(x + 0.18, tick), (x - 0.06, tick)]
            pen.line(np.array(mark), width=0.6, colour=GREY)
        room.take_line(ends, 0.1, passable=True)
    text = _length(width)
    text_width, text_height = pen.measure(text, 9)
    middle = 0.5 * (left + right)
    pen.write(middle, y - 0.14, text, 9, ha="center", color=GREY)
    room.take_box(middle - 0.5 * text_width, y - 0.14 - 0.5 * text_height, middle + 0.5 * text_width, y - 0.07)
    text = _length(height)
    text_width, text_height = pen.measure(text, 9)
    middle = 0.5 * (bottom + top)
    if top - bottom > text_width + 0.1:
        pen.write(x - 0.12, middle, text, 9, ha="center", color=GREY, rotation=90, rotation_mode="anchor")
        room.take_box(x - 0.2, middle - 0.5 * text_width, x - 0.04, middle + 0.5 * text_width)
    else:
        pen.write(x - 0.10, middle, text, 9, ha="right", color=GREY)
        room.take_box(x - 0.10 - text_width, middle - 0.08, x - 0.1, middle + 0.08)


def _scale_bar(pen: Pen, room: LabelRoom, drawn: DrawnView, inches_per_metre: float) -> None:
    """Draw a bar of a round length below the pattern."""
    from matplotlib.patches import Rectangle

    steps = np.outer(10.0 ** np.arange(-6, 4), [1.0, 2.0, 5.0]).ravel()
    metres = float(steps[max(int(np.searchsorted(steps, 1.3 / inches_per_metre, side="right")) - 1, 0)])
    wide = metres * inches_per_metre
    left = max(0.5 * (drawn.box[0] + drawn.box[2] - wide), 0.2)
    y = drawn.box[1] - 0.42
    for part in range(2):
        fill = INK if part == 0 else "white"
        box = Rectangle(
            (left + 0.5 * part * wide, y), 0.5 * wide, 0.06, facecolor=fill, edgecolor=INK, linewidth=0.7, zorder=6
        )
        pen.axes.add_patch(box)
    pen.write(left + 0.5 * wide, y - 0.12, _length(metres, digits=0), 9, ha="center", color=GREY)
    room.take_box(left - 0.1, y - 0.22, left + wide + 0.1, y + 0.08)


def draw_colour_bar(
    pen: Pen,
    row: Row,
    scale: float,
    density: FloatArray,
    areas: FloatArray,
    quantity: str,
    *,
    top: float,
) -> None:
    """Draw the colour bar beside the first row, whose upper edge is at `top` [in], and the share of the area above its end."""
    from matplotlib.patches import Polygon

    from warpflat.export.picture_pixels import Pixels

    above = density > scale
    tall = float(np.clip(row.band, *_COLOUR_BAR))
    top = top - row.head - max(0.0, 0.5 * (row.band - tall))
    left, bottom = PAGE_WIDTH - _RIGHT + 0.45, max(top - tall, 0.75)
    right = left + _BAR_WIDTH
    end = bottom + (top - bottom) / (1.0 + _BAR_TIP) if above.any() else top
    first, last = round(bottom * DPI), round(end * DPI)
    shades = energy_colours((np.arange(last - first)[::-1, None] + 0.5) / (last - first), 1.0)
    strip = np.full((last - first, round(_BAR_WIDTH * DPI), 4), 255, dtype=np.uint8)
    strip[..., :3] = np.round(255.0 * shades)
    pen.axes.add_artist(Pixels(strip, left=round(left * DPI), bottom=first, zorder=1))
    outline = [(left, bottom), (right, bottom), (right, end), (left, end)]
    if above.any():
        tip = (0.5 * (left + right), top)
        # It starts one pixel lower, so that no white shows between.
        corners = [(left, end - 1.0 / DPI), (right, end - 1.0 / DPI), (right, end), tip, (left, end)]
        pen.axes.add_patch(Polygon(corners, facecolor=energy_colours([1.0], 1.0)[0], linewidth=0, zorder=1))
        outline.insert(3, tip)
    pen.axes.add_patch(Polygon(outline, fill=False, edgecolor="black", linewidth=0.6, zorder=6))
    places, words, power = _ticks(scale, end - bottom)
    for place, word in zip(bottom + (end - bottom) * places / scale, words, strict=True):
        pen.line(np.array([(right, place), (right + 3 * POINT, place)]), width=0.6, colour="black")
        pen.write(right + 6.5 * POINT, place, word, _TICK_SIZE, color="black", va="center_baseline")
    if power:
        pen.write(left, top + 3 * POINT, power, 8, color="black", va="bottom")
    wide = max(pen.measure(word, _TICK_SIZE)[0] for word in words)
    aside: dict[str, Any] = {"rotation": 90, "rotation_mode": "anchor", "ha": "center", "va": "top"}
    pen.write(right + 12.5 * POINT + wide, 0.5 * (bottom + end), f"{quantity} [J/m²]", 9.5, **aside)
    total = float(areas.sum())
    if above.any() and total > 0.0:
        share = float(areas[above].sum()) / total
        text = f"clipped: {_percent(share)} of the\narea is above, up to\n{density.max():.3g} J/m²"
        pen.write(left - 0.08, bottom - 0.12, text, 7.5, color=GREY, va="top", linespacing=1.35)


def _ticks(scale: float, length: float) -> tuple[FloatArray, list[str], str]:
    """Return round values from 0 to `scale` for a bar of this length [in], their words, and their power of ten."""
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    most = int(np.clip(length / (2.0 * _TICK_SIZE * POINT), 1, 9))
    values = np.asarray(MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, scale))
    values = values[values <= scale * (1.0 + 1e-9)]
    formatter: Any = ScalarFormatter()
    formatter.create_dummy_axis()
    formatter.axis.set_view_interval(0.0, scale)
    formatter.set_powerlimits((-3, 4))
    words = formatter.format_ticks(values)
    return values, words, formatter.get_offset()


def _percent(share: float) -> str:
    """Return a share in percent."""
    return f"{100 * share:.1f} %" if share >= 0.001 else "under 0.1 %"


def _length(metres: float, *, digits: int = 1) -> str:
    """Return a length as pattern makers write it: in centimetres, or in millimetres if it is below one."""
    value, word = (100 * metres, "cm") if metres >= 0.00999 else (1000 * metres, "mm")
    number = f"{value:.{digits}f}" if digits or value >= 1 else f"{value:.3g}"
    return f"{number} {word}"


def _size(width: float, height: float) -> str:
    """Return width and height in the unit of the larger one."""
    factor, word = (100, "cm") if max(width, height) >= 0.00999 else (1000, "mm")
    return f"{factor * width:.1f} × {factor * height:.1f} {word}"
