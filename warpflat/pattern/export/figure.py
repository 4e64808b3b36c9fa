"""The kit of all pictures: a page, text, lines and scales on it, pixels put on it as they are, and its file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Polygon
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from warpflat.core import FloatArray, report_activity
from warpflat.pattern.export.colours import Scale
from warpflat.pattern.export.letters import all_letters
from warpflat.pattern.files.output import atomic_path

__all__ = [
    "DPI",
    "GRAIN",
    "GREY",
    "INK",
    "LABEL_SIZE",
    "MARGIN",
    "PAGE_WIDTH",
    "Pen",
    "Pixels",
    "drawn_page",
    "keep_words_on_page",
    "new_figure",
    "picture_of",
    "write_figure",
    "write_moving_picture",
]

DPI = 150
PAGE_WIDTH = 12.5  # [in], at most
MARGIN = 0.25  # [in]
INK = (0.10, 0.11, 0.14)
GREY = (0.36, 0.38, 0.42)
GRAIN = (0.02, 0.27, 0.66)
LABEL_SIZE = 7.5  # [pt]
_HALO, _HALO_LAYER = (1.0, 1.0, 1.0, 0.7), 3.5  # below the outline
_SEGMENTS_TO_A_LINE = 500
# A page has so many pixels at most.
_MOST_PIXELS = 2.4e7


def new_figure(width: float, height: float, *, dpi: int = DPI, **options: Any) -> Figure:
    """Return a white page of a size [in], with an Agg canvas; options are Matplotlib's."""
    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white", **options)
    FigureCanvasAgg(figure)
    return figure


@contextmanager
def drawn_page(path: str | os.PathLike[str], width: float, height: float, *, dpi: int = DPI) -> Iterator[Pen]:
    """Give the pen of a white page of a size [in] in a block, and write the page after it; atomically, with all letters.

    Raises:
        InputError: the file cannot be written.
    """
    report_activity(f"drawing {os.path.basename(path)}")
    with all_letters():
        pen = Pen(width, height, dpi=dpi)
        yield pen
    write_figure(path, pen.figure)


def picture_of(figure: Figure) -> Image.Image:
    """Draw a figure of :func:`new_figure` once, as opaque RGB."""
    keep_words_on_page(figure)
    canvas: Any = figure.canvas
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def write_figure(path: str | os.PathLike[str], figure: Figure) -> None:
    """Write the pixels of a figure of :func:`new_figure` at its own resolution, with all letters; atomically.

    Raises:
        InputError: the file cannot be written.
    """
    with all_letters():
        image, metadata = picture_of(figure), PngInfo()
    metadata.add_text("Software", "warpflat")
    resolution = float(figure.dpi)
    with atomic_path(path) as temporary:
        # Pages are large and mostly white: zlib's fastest level takes half the time of the usual one, and 1.2 times the bytes.
        image.save(temporary, format="PNG", dpi=(resolution, resolution), pnginfo=metadata, compress_level=1)


def write_moving_picture(
    path: str | os.PathLike[str], pictures: Sequence[Image.Image], *, each: int, last: int
) -> None:
    """Write pictures of one size as a moving WebP that begins anew after its end; atomically.

    Args:
        path: the file, ``*.webp``.
        pictures: RGB.
        each, last: how long each is shown, and the last one [ms].

    Raises:
        InputError: the file cannot be written.
    """
    more = {"save_all": True, "append_images": pictures[1:]} if len(pictures) > 1 else {}
    durations = [*[each] * (len(pictures) - 1), last]
    with atomic_path(path) as temporary:
        pictures[0].save(temporary, format="WEBP", duration=durations, loop=0, quality=80, **more)


def keep_words_on_page(figure: Any) -> None:
    """Shorten level texts of a figure with an Agg canvas that would run over its left or right edge, with dots at their ends."""
    renderer, page = figure.canvas.get_renderer(), figure.bbox
    for axes in figure.axes:
        axes.apply_aspect()  # which moves what stands in them, otherwise when they are drawn
    for text in [*figure.texts, *(text for axes in figure.axes for text in axes.texts)]:
        whole, share = text.get_text().split("\n"), 1.0
        while whole != [""] and not text.get_rotation() and share > 0.01:
            box = text.get_window_extent(renderer)
            if box.x0 >= page.x0 - 1.0 and box.x1 <= page.x1 + 1.0:
                break
            at = {"left": box.x0, "right": box.x1}.get(text.get_ha(), 0.5 * (box.x0 + box.x1))
            room = {"left": page.x1 - at, "right": at - page.x0}.get(text.get_ha(), 2 * min(page.x1 - at, at - page.x0))
            share *= min(max(room, 0.0) / box.width, 0.95)
            most = int(share * max(map(len, whole)))
            text.set_text("\n".join(line if len(line) <= most else f"{line[:most].rstrip()}…" for line in whole))


class Pen:
    """A page, and text and lines on it, measured in inches from its lower left corner.

    Attributes:
        figure: Matplotlib's.
        axes: over the whole page, in inches: an axis for each drawing takes longer than all that is drawn in it.
        width, height: of the page [in].
        dpi: pixels per inch.
    """

    def __init__(self, width: float, height: float, *, dpi: int = DPI) -> None:
        self.figure = new_figure(width, height, dpi=dpi)
        self.dpi = self._asked_dpi = float(dpi)
        self.axes: Any = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self._measured: dict[tuple[str, float, str], tuple[float, float]] = {}
        self.width, self.height = width, height
        self.clear()

    def clear(self) -> None:
        """Take away all that was drawn, but for scales of colours."""
        self.axes.clear()
        self.axes.set_axis_off()
        self.resize(self.width, self.height)

    def resize(self, width: float, height: float) -> None:
        """Give the page another size [in]; one of hundreds of pieces has fewer pixels per inch."""
        self.width, self.height = float(width), float(height)
        self.dpi = min(self._asked_dpi, float(np.sqrt(_MOST_PIXELS / (width * height))))
        self.figure.set_dpi(self.dpi)
        self.figure.set_size_inches(width, height)
        self.axes.set(xlim=(0.0, width), ylim=(0.0, height), autoscale_on=False)

    def measure(self, text: str, size: float, weight: str = "normal") -> tuple[float, float]:
        """Return width and height of a line of text [in] at a size [pt]."""
        key = (text, size, weight)
        if key not in self._measured:
            font = FontProperties(size=size, weight=weight)
            canvas: Any = self.figure.canvas
            width, height, _ = canvas.get_renderer().get_text_width_height_descent(text, font, ismath=False)
            # Letters without ink, as a soft hyphen, have no height.
            self._measured[key] = max(width, 1.0) / self.dpi, max(height, 1.0) / self.dpi
        return self._measured[key]

    def shorten(self, text: str, size: float, room: float, weight: str = "normal") -> str:
        """Return a line of text, at a size [pt], cut with dots at its end where it takes more room [in]."""
        if self.measure(text, size, weight)[0] <= room:
            return text
        # The longest beginning that fits, by halving.
        fits, too_long = 1, len(text)
        while too_long - fits > 1:
            middle = (fits + too_long) // 2
            if self.measure(f"{text[:middle].rstrip()}…", size, weight)[0] <= room:
                fits = middle
            else:
                too_long = middle
        return f"{text[:fits].rstrip()}…"

    def write(self, x: float, y: float, text: str, size: float, *, halo: bool = False, **options: Any) -> None:
        """Write a text; with a halo it stays legible over colours and lines."""
        options = {"color": INK, "ha": "left", "va": "center", "zorder": 8, "parse_math": False} | options
        drawn = self.axes.text(x, y, text, fontsize=size, **options)
        if halo:
            drawn.set_path_effects([withStroke(linewidth=2.4, foreground=(1.0, 1.0, 1.0, 0.85))])

    def badge(self, x: float, y: float, text: str, colour: Any) -> None:
        """Write a number on a white patch, which hides what lies below it."""
        box = {
            "boxstyle": "round,pad=0.3,rounding_size=0.8",
            "facecolor": "white",
            "edgecolor": colour,
            "linewidth": 0.7,
            "alpha": 0.94,
        }
        self.write(x, y, text, 7.5, ha="center", fontweight="bold", color=colour, bbox=box, zorder=9)

    def line(self, points: FloatArray, *, width: float, colour: Any = INK, halo: bool = False, **look: Any) -> None:
        """Draw a polyline (#N by 2); with a halo it stays visible on dark colours. The look is that of Matplotlib's lines."""
        if halo:
            self.axes.add_artist(Line2D(*points.T, color=_HALO, linewidth=width + 1.6, zorder=_HALO_LAYER))
        self.axes.add_artist(Line2D(*points.T, color=colour, linewidth=width, **{"zorder": 5} | look))

    def segments(self, ends: FloatArray, **look: Any) -> None:
        """Draw straight segments (#S by 2 by 2) as lines with gaps, many to a line: a line each takes longer than all that is drawn."""
        broken = np.pad(ends, ((0, 0), (0, 1), (0, 0)), constant_values=np.nan)
        for first in range(0, len(ends), _SEGMENTS_TO_A_LINE):
            part = broken[first : first + _SEGMENTS_TO_A_LINE].reshape(-1, 2)
            self.line(part, **{"solid_capstyle": "round"} | look)

    def polygon(self, points: FloatArray, **look: Any) -> None:
        """Draw a closed outline (#N by 2); the look is that of Matplotlib's patches."""
        # As an artist it moves no limits, which would be looked for along each of its sides.
        self.axes.add_artist(Polygon(points, **look))

    def scale_bar(self, left: float, y: float, inches_per_metre: float) -> float:
        """Draw a bar of a round length whose lower left corner is at (`left`, `y`) [in]; return where its words end."""
        steps = np.outer(10.0 ** np.arange(-6, 4), [1.0, 2.0, 5.0]).ravel()
        metres = float(steps[max(int(np.searchsorted(steps, 1.3 / inches_per_metre, side="right")) - 1, 0)])
        wide = metres * inches_per_metre
        for part, fill in enumerate((INK, "white")):
            start, end = left + 0.5 * part * wide, left + 0.5 * (part + 1) * wide
            corners = np.array([(start, y), (end, y), (end, y + 0.06), (start, y + 0.06)])
            self.polygon(corners, facecolor=fill, edgecolor=INK, linewidth=0.7, zorder=6)
        text = f"{100 * metres:.0f} cm" if metres >= 0.00999 else f"{1000 * metres:.3g} mm"
        self.write(left + wide + 0.08, y + 0.03, text, 9, color=GREY)
        return left + wide + 0.08 + self.measure(text, 9)[0]

    def colour_bar(
        self, scale: Scale, left: float, bottom: float, wide: float, tall: float, *, extend: str = "", unit: str = ""
    ) -> Any:
        """Draw a scale of colours in a box [in], along its longer side; return Matplotlib's colour bar.

        Args:
            scale: of the colours.
            left, bottom, wide, tall: of the box.
            extend: which ends have a tip for what lies beyond, as Matplotlib names them; those that are not 0 if not given.
            unit: written beside it.
        """
        box = (left / self.width, bottom / self.height, wide / self.width, tall / self.height)
        extend = extend or ("max" if scale.low == 0.0 else "both")
        along = "horizontal" if wide > tall else "vertical"
        bar = self.figure.colorbar(
            scale.mappable, cax=self.figure.add_axes(box), orientation=along, extend=extend, label=unit
        )
        bar.ax.tick_params(labelsize=8)
        return bar

    def arrow(self, ends: FloatArray, *, width: float, colour: Any, head: float, halo: bool = False) -> None:
        """Draw a straight line (2 by 2) with a filled head at either end."""
        style = f"<|-|>,head_length={head},head_width={0.42 * head}"
        options = {"arrowstyle": style, "color": colour, "linewidth": width, "shrinkA": 0, "shrinkB": 0, "zorder": 6}
        patch = FancyArrowPatch(tuple(ends[0]), tuple(ends[1]), **options)
        if halo:
            patch.set_path_effects([withStroke(linewidth=width + 1.6, foreground=_HALO)])
        self.axes.add_patch(patch)


class Pixels(Artist):
    """RGBA pixels (#R by #C by 4, row 0 at the bottom) at a place on a figure that is drawn at the resolution for which they were made."""

    def __init__(self, pixels: NDArray[np.uint8], *, left: int, bottom: int, zorder: float) -> None:
        """Place `pixels` (#R by #C by 4, row 0 at the top) on the page.

        Args:
            pixels: RGBA.
            left, bottom: place of their lower left corner on the page [pixels].
            zorder: layer.
        """
        super().__init__()
        self.pixels = np.ascontiguousarray(pixels[::-1])
        self._corner = (left, bottom)
        self.set_zorder(zorder)

    def draw(self, renderer: Any) -> None:
        """Draw the pixels."""
        context = renderer.new_gc()
        renderer.draw_image(context, *self._corner, self.pixels)
        context.restore()
