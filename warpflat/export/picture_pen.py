"""Text and lines on a page of pictures."""

from __future__ import annotations

from typing import Any

from warpflat.core.arrays import FloatArray
from warpflat.export.picture_views import HALO_LAYER, INK

__all__ = ["DPI", "GRAIN", "GREY", "LABEL_SIZE", "MARGIN", "PAGE_WIDTH", "POINT", "Pen"]

DPI = 150
PAGE_WIDTH = 12.5  # [in], at most
MARGIN = 0.25  # [in]
POINT = 1.0 / 72.0  # [in]
GREY = (0.36, 0.38, 0.42)
GRAIN = (0.02, 0.27, 0.66)
LABEL_SIZE = 7.5  # [pt]


class Pen:
    """Text and lines on the page, measured in inches from its lower left corner."""

    def __init__(self, renderer: Any) -> None:
        self._renderer = renderer
        self.dpi = DPI
        self._measured: dict[tuple[str, float, str], tuple[float, float]] = {}
        self.axes: Any = None
        self.page_width = PAGE_WIDTH

    def open_page(self, figure: Any, width: float, height: float) -> None:
        """Lay axes over the whole page, of this width and height [in], whose units are inches."""
        self.page_width = width
        self.axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.axes.set_axis_off()
        self.axes.set_xlim(0.0, width)
        self.axes.set_ylim(0.0, height)
        self.axes.set_autoscale_on(False)

    def measure(self, text: str, size: float, weight: str = "normal") -> tuple[float, float]:
        """Return width and height of a line of text [in] at a size [pt]."""
        from matplotlib.font_manager import FontProperties

        key = (text, size, weight)
        if key not in self._measured:
            font = FontProperties(size=size, weight=weight)
            width, height, _ = self._renderer.get_text_width_height_descent(text, font, ismath=False)
            self._measured[key] = width / DPI, height / DPI
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
        from matplotlib.patheffects import withStroke

        options = {"color": INK, "ha": "left", "va": "center", "zorder": 8, "parse_math": False} | options
        drawn = self.axes.text(x, y, text, fontsize=size, **options)
        if halo:
            drawn.set_path_effects([withStroke(linewidth=2.4, foreground=(1.0, 1.0, 1.0, 0.85))])

    def line(
        self, points: FloatArray, *, width: float, colour: Any = INK, style: Any = "-", halo: bool = False
    ) -> None:
        """Draw a polyline (#N by 2); with a halo it stays visible on dark colours."""
        from matplotlib.lines import Line2D

        x, y = points.T
        if halo:
            below: dict[str, Any] = {"color": (1.0, 1.0, 1.0, 0.7), "linewidth": width + 1.6, "zorder": HALO_LAYER}
            self.axes.add_artist(Line2D(x, y, **below))
        self.axes.add_artist(Line2D(x, y, color=colour, linewidth=width, linestyle=style, zorder=5))

    def arrow(self, ends: FloatArray, *, width: float, colour: Any, head: float, halo: bool = False) -> None:
        """Draw a straight line (2 by 2) with a filled head at either end."""
        from matplotlib.patches import FancyArrowPatch
        from matplotlib.patheffects import withStroke

        style = f"<|-|>,head_length={head},head_width={0.42 * head}"
        options = {"arrowstyle": style, "color": colour, "linewidth": width, "shrinkA": 0, "shrinkB": 0, "zorder": 6}
        patch = FancyArrowPatch(tuple(ends[0]), tuple(ends[1]), **options)
        if halo:
            patch.set_path_effects([withStroke(linewidth=width + 1.6, foreground=(1.0, 1.0, 1.0, 0.7))])
        self.axes.add_patch(patch)
