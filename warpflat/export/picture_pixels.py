"""An image that is put on a page pixel by pixel, without the resampling of matplotlib."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from numpy.typing import NDArray

__all__ = ["Pixels"]


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
