"""The garment on its mannequin, at the top of a picture: front, side and back, coloured by energy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.export.colours import energy_colours
from warpflat.export.geometry import area_vectors, outline_edges
from warpflat.export.picture_pen import GREY, PAGE_WIDTH, Pen
from warpflat.export.picture_views import DrawnView, Facets, View, make_facets
from warpflat.surface.mesh import Surface

__all__ = ["Body", "GarmentViews"]

_VIEWS = (("front", 0.0), ("left side", 90.0), ("back", 180.0))
_HEIGHT, _HEAD, _FOOT = 5.6, 0.42, 0.45  # [in], as all that follows
_LEFT, _RIGHT = 0.55, 1.75
# How far the mannequin shows above and below the garment, as a share of the garment's height.
_AROUND = 0.12
# The garment lies on the mannequin: it is drawn this much nearer to the eye [m].
_NEARER = 0.012
_SKIN = (0.88, 0.86, 0.83)


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """The body under a garment.

    Attributes:
        vertices: #V by 3 [m], Y up, facing +Z.
        faces: #F by 4.
    """

    vertices: FloatArray
    faces: IntArray


class GarmentViews:
    """A garment on its mannequin, seen from three sides, as a band across the page."""

    def __init__(self, body: Body, surfaces: Sequence[Surface], densities: Sequence[FloatArray]) -> None:
        """
        Args:
            body: under it.
            surfaces: the pieces in space.
            densities: #F [J/m2] for each piece.
        """
        self._density = np.concatenate(densities)
        worn = np.concatenate([surface.vertices for surface in surfaces])
        low, high = float(worn[:, 1].min()), float(worn[:, 1].max())
        room = _AROUND * (high - low)
        height = np.where(body.faces >= 0, body.vertices[body.faces, 1], body.vertices[body.faces[:, :1], 1])
        near = body.faces[((height > low - room) & (height < high + room)).all(axis=1)]
        counts = np.cumsum([0, *(len(surface.vertices) for surface in surfaces)])
        pieces = [
            np.where(surface.faces >= 0, surface.faces + first, -1)
            for surface, first in zip(surfaces, counts, strict=False)
        ]
        cloth = np.concatenate(pieces).astype(np.int32)
        skin = np.where(near >= 0, near + counts[-1], -1).astype(np.int32)
        facets = make_facets(np.concatenate([cloth, skin]))
        # Outlines of pieces show the seams; the body has none.
        facets = Facets(
            faces=cloth[:0],
            triangles=facets.triangles,
            face_of_triangle=facets.face_of_triangle,
            outline=np.concatenate([outline_edges(faces.astype(np.int32)) for faces in pieces]),
            used=facets.used,
        )
        self._skin_faces = len(skin)
        points = np.concatenate([worn, body.vertices])
        self._views = [(title, _view(points, len(worn), facets, angle)) for title, angle in _VIEWS]
        widths = sum(float(view.size[0]) for _, view in self._views)
        tallest = max(float(view.size[1]) for _, view in self._views)
        wide = PAGE_WIDTH - _LEFT - _RIGHT
        self._scale = min(0.9 * wide / widths, _HEIGHT / tallest)
        self._gap = (wide - widths * self._scale) / len(_VIEWS)
        self.height = _HEAD + tallest * self._scale + _FOOT

    def draw(self, pen: Pen, top: float, scale: float) -> None:
        """Draw the band whose upper edge is at `top` [in], colours up to `scale` [J/m2]."""
        colours = np.concatenate([energy_colours(self._density, scale), np.tile(_SKIN, (self._skin_faces, 1))])
        left = _LEFT
        for title, view in self._views:
            width, height = view.size[:2] * self._scale
            left += 0.5 * self._gap
            drawn = DrawnView(
                view, left=left, bottom=top - _HEAD - float(height), inches_per_metre=self._scale, dpi=pen.dpi
            )
            drawn.draw(pen.axes, colours)
            pen.write(left + 0.5 * float(width), top - 0.18, title, 10, color=GREY, ha="center", fontstyle="italic")
            left += float(width) + 0.5 * self._gap


def _view(points: FloatArray, cloth: int, facets: Facets, degrees: float) -> View:
    """Return the mesh as it is seen by somebody who walked `degrees` around it to its left."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    directions = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    seen = points @ directions.T
    vectors = area_vectors(seen, facets.triangles)
    seen[:cloth, 2] += _NEARER
    return View(points=seen, facets=facets, lines={}, vectors=vectors)
