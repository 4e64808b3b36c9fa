"""An image that is put on a page pixel by pixel, as it is: matplotlib's own would resample it."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from numpy.typing import NDArray

__all__ = ["Pixels"]


class Pixels(Artist):
    """RGBA pixels at a place on a figure that is drawn at the resolution for which they were made."""

    def __init__(self, pixels: NDArray[np.uint8], *, left: int, bottom: int, zorder: float) -> None:
        """Of `pixels` (#R by #C by 4, row 0 at the top), from so many pixels right of and above the page's lower left."""
        super().__init__()
        self._pixels = np.ascontiguousarray(pixels[::-1])
        self._corner = (left, bottom)
        self.set_zorder(zorder)

    def draw(self, renderer: Any) -> None:
        """Put them there."""
        context = renderer.new_gc()
        renderer.draw_image(context, *self._corner, self._pixels)
        context.restore()
