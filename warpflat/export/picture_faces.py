"""Coloured faces in a Matplotlib axis, drawn as pixels: thousands of polygons, one by one, take longer than all else on a page."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.cm import ScalarMappable

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.export.raster import rasterise, shade
from warpflat.surface.triangles import triangulate

__all__ = ["ColouredFaces"]

_PER_PIXEL = 2  # samples along either side


class ColouredFaces(Artist):
    """Faces in the plane, each in one colour, without seams between them.

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
