"""Colours of the pieces in `frames.usdc`: energies of every frame on one scale."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.export.geometry import corner_average
from warpflat.export.usd_piece import FIRST_FRAME, FramePiece, density_attribute

__all__ = ["FrameColours"]


class FrameColours:
    """Colours of a piece, frame by frame; its topology is read only where it changes."""

    def __init__(self, piece: FramePiece) -> None:
        self._piece = piece
        own = piece.surface.faces
        self._face = np.nonzero(own >= 0)[0].astype(np.int32)
        self._surface = (own[own >= 0], len(piece.surface.vertices))
        self._pattern = self._surface
        pattern = piece.on_pattern.mesh
        self._indices, self._points = pattern.GetFaceVertexIndicesAttr(), pattern.GetPointsAttr()
        self._changes = set(self._indices.GetTimeSamples())
        self._density = density_attribute(piece.on_pattern)
        self._on_surface, self._on_pattern = (
            samples.mesh.GetDisplayColorPrimvar().GetAttr() for samples in (piece.on_surface, piece.on_pattern)
        )

    def colour(self, number: int, scale: float, table: NDArray[np.float32]) -> None:
        """Author the colours of a frame, if the piece has it: energies [J/m2] up to `scale` as rows of `table`."""
        if number >= FIRST_FRAME + self._piece.frames:
            return
        if number in self._changes:
            # Copies: what USD hands out may lie in the file, which grows.
            vertex, size = np.array(self._indices.Get(number)), len(self._points.Get(number))
            same = size == self._surface[1] and np.array_equal(vertex, self._surface[0])
            self._pattern = self._surface if same else (vertex, size)
        density = np.asarray(self._density.Get(number), dtype=np.float64)
        colours = self._vertex_colours(density, *self._surface, scale, table)
        self._on_surface.Set(colours, number)
        if self._pattern is not self._surface:
            colours = self._vertex_colours(density, *self._pattern, scale, table)
        self._on_pattern.Set(colours, number)

    def _vertex_colours(
        self,
        density: FloatArray,
        vertex: IntArray,
        size: int,
        scale: float,
        table: NDArray[np.float32],
    ) -> Any:
        """Return the colours of `size` vertices.

        Args:
            density: #F [J/m2].
            vertex: #C, the vertex of each corner.
            size: number of vertices.
            scale: energy of the last colour [J/m2].
            table: colours, linear RGB.
        """
        from pxr import Vt

        share = corner_average(density, self._piece.areas, self._face, vertex, size) / scale
        step = np.clip(share * (len(table) - 1) + 0.5, 0, len(table) - 1).astype(np.int32)
        return Vt.Vec3fArray.FromNumpy(table[step])
