"""The kit of all pictures: a page, text and lines on it, pixels put on it as they are, and its PNG file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from warpflat.core import FloatArray, IntArray, atomic_path
from warpflat.flat import triangulate
from warpflat.pattern.export.raster import rasterise, shade

__all__ = [
    "DPI",
    "GRAIN",
    "GREY",
    "HALO_LAYER",
    "INK",
    "LABEL_SIZE",
    "MARGIN",
    "PAGE_WIDTH",
    "POINT",
    "ColouredFaces",
    "Pen",
    "Pixels",
    "keep_words_on_page",
    "new_figure",
    "write_figure",
    "write_moving_picture",
]

DPI = 150
PAGE_WIDTH = 12.5  # [in], at most
MARGIN = 0.25  # [in]
POINT = 1.0 / 72.0  # [in]
INK = (0.10, 0.11, 0.14)
GREY = (0.36, 0.38, 0.42)
GRAIN = (0.02, 0.27, 0.66)
LABEL_SIZE = 7.5  # [pt]
HALO_LAYER = 3.5  # below the outline
# Pages are large and mostly white: zlib's fastest level takes half the time of the usual one, and 1.2 times the bytes.
_LEVEL = 1
_PER_PIXEL = 2  # samples along either side


def new_figure(width: float, height: float, *, dpi: int = DPI, **options: Any) -> Figure:
    """Return a white page of a size [in], with an Agg canvas; options are Matplotlib's."""
    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white", **options)
    FigureCanvasAgg(figure)
    return figure


def write_figure(path: str | os.PathLike[str], figure: Figure) -> None:
    """Draw a figure of :func:`new_figure` once, and write its pixels as opaque RGB at its own resolution; atomically.

    Raises:
        InputError: the file cannot be written.
    """
    keep_words_on_page(figure)
    canvas: Any = figure.canvas
    canvas.draw()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    metadata = PngInfo()
    metadata.add_text("Software", "warpflat")
    resolution = float(figure.dpi)
    with atomic_path(path) as temporary:
        image.save(temporary, format="PNG", dpi=(resolution, resolution), pnginfo=metadata, compress_level=_LEVEL)


def write_moving_picture(
    path: str | os.PathLike[str], pictures: Sequence[Image.Image], durations: Sequence[int]
) -> None:
    """Write pictures of one size as a moving WebP that begins anew after its end; atomically.

    Args:
        path: the file, ``*.webp``.
        pictures: RGB.
        durations: of each [ms].

    Raises:
        InputError: the file cannot be written.
    """
    more = {"save_all": True, "append_images": pictures[1:]} if len(pictures) > 1 else {}
    with atomic_path(path) as temporary:
        pictures[0].save(temporary, format="WEBP", duration=list(durations), loop=0, quality=80, **more)


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
    """Text and lines on the page, measured in inches from its lower left corner."""

    def __init__(self, figure: Any) -> None:
        self._figure = figure
        self._renderer = figure.canvas.get_renderer()
        self._measured: dict[tuple[str, float, str], tuple[float, float]] = {}
        self.axes: Any = None
        self.page_width = PAGE_WIDTH

    def open_page(self) -> None:
        """Lay axes over the whole page, whose units are inches."""
        width, height = self._figure.get_size_inches()
        self.page_width = float(width)
        self.axes = self._figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.axes.set_axis_off()
        self.axes.set_xlim(0.0, width)
        self.axes.set_ylim(0.0, height)
        self.axes.set_autoscale_on(False)

    def measure(self, text: str, size: float, weight: str = "normal") -> tuple[float, float]:
        """Return width and height of a line of text [in] at a size [pt]."""
        key = (text, size, weight)
        if key not in self._measured:
            font = FontProperties(size=size, weight=weight)
            width, height, _ = self._renderer.get_text_width_height_descent(text, font, ismath=False)
            # Letters without ink, as a soft hyphen, have no height.
            self._measured[key] = max(width, 1.0) / DPI, max(height, 1.0) / DPI
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

    def line(
        self, points: FloatArray, *, width: float, colour: Any = INK, style: Any = "-", halo: bool = False
    ) -> None:
        """Draw a polyline (#N by 2); with a halo it stays visible on dark colours."""
        x, y = points.T
        if halo:
            below: dict[str, Any] = {"color": (1.0, 1.0, 1.0, 0.7), "linewidth": width + 1.6, "zorder": HALO_LAYER}
            self.axes.add_artist(Line2D(x, y, **below))
        self.axes.add_artist(Line2D(x, y, color=colour, linewidth=width, linestyle=style, zorder=5))

    def arrow(self, ends: FloatArray, *, width: float, colour: Any, head: float, halo: bool = False) -> None:
        """Draw a straight line (2 by 2) with a filled head at either end."""
        style = f"<|-|>,head_length={head},head_width={0.42 * head}"
        options = {"arrowstyle": style, "color": colour, "linewidth": width, "shrinkA": 0, "shrinkB": 0, "zorder": 6}
        patch = FancyArrowPatch(tuple(ends[0]), tuple(ends[1]), **options)
        if halo:
            patch.set_path_effects([withStroke(linewidth=width + 1.6, foreground=(1.0, 1.0, 1.0, 0.7))])
        self.axes.add_patch(patch)


class Pixels(Artist):
    """RGBA pixels at a place on a figure that is drawn at the resolution for which they were made."""

    def __init__(self, pixels: NDArray[np.uint8], *, left: int, bottom: int, zorder: float) -> None:
        """Place `pixels` (#R by #C by 4, row 0 at the top) on the page.

        Args:
            pixels: RGBA.
            left, bottom: place of their lower left corner on the page [pixels].
            zorder: layer.
        """
        super().__init__()
        self._pixels = np.ascontiguousarray(pixels[::-1])
        self._corner = (left, bottom)
        self.set_zorder(zorder)

    def draw(self, renderer: Any) -> None:
        """Draw the pixels."""
        context = renderer.new_gc()
        renderer.draw_image(context, *self._corner, self._pixels)
        context.restore()


class ColouredFaces(Artist):
    """Faces in the plane, each in one colour, without seams between them, as pixels: a polygon each takes longer than all else on a page.

    Attributes:
        points: #P by 2, in the units of the axis.
        mappable: the scale of the colours.
    """

    def __init__(self, points: FloatArray, faces: IntArray, values: FloatArray, mappable: ScalarMappable) -> None:
        """Prepare faces in the units of the axis to which they are added.

        Args:
            points: #P by 2.
            faces: #F by 4.
            values: #F.
            mappable: their colours.
        """
        super().__init__()
        self.mappable = mappable
        self.points, self._colours = points, np.asarray(mappable.to_rgba(values))[:, :3]
        self._triangles, self._face = triangulate(faces)
        self.set_zorder(1)

    def draw(self, renderer: Any) -> None:
        """Draw the pixels, at the renderer's resolution."""
        assert self.axes is not None
        at = self.axes.transData.transform(self.points)
        low = np.floor(at.min(axis=0)) - 1.0
        columns, rows = (np.ceil(at.max(axis=0)) + 1.0 - low).astype(int).tolist()
        grid = np.zeros((len(at), 3))
        grid[:, :2] = (at - low) * _PER_PIXEL
        # Row 0 is at the bottom, as the renderer has it.
        samples = rasterise(grid, self._triangles, (rows * _PER_PIXEL, columns * _PER_PIXEL))
        pixels = shade(samples, _PER_PIXEL, grid, self._triangles, self._colours, face=self._face)
        context = renderer.new_gc()
        renderer.draw_image(context, *low, pixels)
        context.restore()
