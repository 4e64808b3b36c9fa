"""The strip at the top of `picture.png`: the scale of lengths and that of colours."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.export.colours import SMALLEST_SCALE, energy_colours
from warpflat.export.picture_pen import DPI, GREY, MARGIN, POINT, Pen
from warpflat.export.picture_views import INK

__all__ = ["STRIP", "STRIP_WORDS", "colour_bar_room", "draw_colour_bar", "draw_scale_bar", "length_text"]

STRIP = 0.66  # [in], as all that follows
STRIP_WORDS = 0.52  # where the words of the strip end
_BAR_HEIGHT = 0.17
_BAR_TIP = 0.03  # of its length, for what lies above the scale
_NOTE, _POWER, _PLAIN = 2.0, 0.7, 0.35  # room right of the bar: for what it leaves out, for a power of ten, for neither
_SHORTEST_BAR = 1.2
_WORDS_SIZE = 9.5  # [pt]
_TICK_SIZE = 8.5  # [pt]


def draw_scale_bar(pen: Pen, left: float, y: float, inches_per_metre: float) -> float:
    """Draw a bar of a round length whose lower left corner is at (`left`, `y`) [in]; return where its words end."""
    from matplotlib.patches import Rectangle

    steps = np.outer(10.0 ** np.arange(-6, 4), [1.0, 2.0, 5.0]).ravel()
    metres = float(steps[max(int(np.searchsorted(steps, 1.3 / inches_per_metre, side="right")) - 1, 0)])
    wide = metres * inches_per_metre
    for part in range(2):
        fill = INK if part == 0 else "white"
        box = Rectangle(
            (left + 0.5 * part * wide, y), 0.5 * wide, 0.06, facecolor=fill, edgecolor=INK, linewidth=0.7, zorder=6
        )
        pen.axes.add_patch(box)
    text = length_text(metres, digits=0)
    pen.write(left + wide + 0.08, y + 0.03, text, 9, color=GREY)
    return left + wide + 0.08 + pen.measure(text, 9)[0]


def colour_bar_room(pen: Pen, scale: float, density: FloatArray, quantity: str) -> float:
    """Return how much room the colour bar needs at least, from its words to the right edge of the page [in]; arguments as it takes them."""
    words = pen.measure(_bar_words(scale, density, quantity), _WORDS_SIZE)[0]
    return words + (MARGIN if _is_flat(scale, density) else 0.15 + _SHORTEST_BAR + _right_of_bar(scale, density))


def _is_flat(scale: float, density: FloatArray) -> bool:
    return scale <= SMALLEST_SCALE and not (density > scale).any()


def _bar_words(scale: float, density: FloatArray, quantity: str) -> str:
    return f"{quantity}: none, the cloth lies flat without strain" if _is_flat(scale, density) else f"{quantity} [J/m²]"


def _right_of_bar(scale: float, density: FloatArray) -> float:
    return _NOTE if (density > scale).any() else _POWER if _ticks(scale, 1.0)[2] else _PLAIN


def draw_colour_bar(
    pen: Pen, scale: float, density: FloatArray, areas: FloatArray, quantity: str, *, left: float, top: float
) -> None:
    """Draw the colour bar from `left` [in] to the right margin, and the share of the area above its end.

    The page must leave :func:`colour_bar_room`. A surface without strain needs no scale: words say so.

    Args:
        scale: upper end of the colours [J/m2].
        density, areas: #F [J/m2] and [m2] of all faces.
        quantity: what the colours show.
        left, top: of the strip [in].
    """
    from matplotlib.patches import Polygon

    from warpflat.export.picture_pixels import Pixels

    above = density > scale
    words = _bar_words(scale, density, quantity)
    pen.write(left, top - 0.24, words, _WORDS_SIZE)
    if _is_flat(scale, density):
        return
    left += pen.measure(words, _WORDS_SIZE)[0] + 0.15
    right = pen.page_width - _right_of_bar(scale, density)
    upper = top - 0.24 + 0.5 * _BAR_HEIGHT
    lower = upper - _BAR_HEIGHT
    end = left + (right - left) / (1.0 + _BAR_TIP) if above.any() else right
    first, last = round(left * DPI), round(end * DPI)
    shades = energy_colours((np.arange(last - first) + 0.5) / (last - first), 1.0)
    strip = np.full((round(_BAR_HEIGHT * DPI), last - first, 4), 255, dtype=np.uint8)
    strip[..., :3] = np.round(255.0 * shades)
    pen.axes.add_artist(Pixels(strip, left=first, bottom=round(lower * DPI), zorder=1))
    outline = [(left, lower), (end, lower), (end, upper), (left, upper)]
    if above.any():
        tip = (right, 0.5 * (lower + upper))
        # It starts one pixel earlier, so that no white shows between.
        corners = [(end - 1.0 / DPI, lower), (end, lower), tip, (end, upper), (end - 1.0 / DPI, upper)]
        pen.axes.add_patch(Polygon(corners, facecolor=energy_colours([1.0], 1.0)[0], linewidth=0, zorder=1))
        outline.insert(2, tip)
    pen.axes.add_patch(Polygon(outline, fill=False, edgecolor="black", linewidth=0.6, zorder=6))
    places, numbers, power = _ticks(scale, end - left)
    for place, word in zip(left + (end - left) * places / scale, numbers, strict=True):
        pen.line(np.array([(place, lower), (place, lower - 3 * POINT)]), width=0.6, colour="black")
        pen.write(place, lower - 5 * POINT, word, _TICK_SIZE, color="black", ha="center", va="top")
    if power:
        pen.write(right + 0.16, lower - 5 * POINT, power, 8, color="black", va="top")
    total = float(areas.sum())
    if above.any() and total > 0.0:
        share = float(areas[above].sum()) / total
        text = f"clipped: {_percent(share)} of the area\nis above, up to {density.max():.3g} J/m²"
        pen.write(right + 0.12, 0.5 * (lower + upper), text, 7.5, color=GREY, linespacing=1.35)


def _ticks(scale: float, length: float) -> tuple[FloatArray, list[str], str]:
    """Return round values from 0 to `scale` for a bar of this length [in], their words, and their power of ten."""
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    most = int(np.clip(length / (5.0 * _TICK_SIZE * POINT), 1, 9))
    values = np.asarray(MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, scale))
    values = values[values <= scale * (1.0 + 1e-9)]
    formatter = ScalarFormatter()
    formatter.create_dummy_axis()
    formatter.axis.set_view_interval(0.0, scale)  # type: ignore[union-attr]
    formatter.set_powerlimits((-3, 4))
    words = formatter.format_ticks(values)  # type: ignore[arg-type]
    return values, words, formatter.get_offset()


def _percent(share: float) -> str:
    """Return a share in percent."""
    return f"{100 * share:.1f} %" if share >= 0.001 else "under 0.1 %"


def length_text(metres: float, *, digits: int = 1) -> str:
    """Return a length as pattern makers write it: in centimetres, or in millimetres if it is below one."""
    value, word = (100 * metres, "cm") if metres >= 0.00999 else (1000 * metres, "mm")
    number = f"{value:.{digits}f}" if digits or value >= 1 else f"{value:.3g}"
    return f"{number} {word}"
