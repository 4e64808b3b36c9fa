"""The garment on its mannequin, at the top of a picture: front, side and back, coloured by energy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core import FloatArray, IntArray
from warpflat.flat import Surface, join_labels, triangulate
from warpflat.pattern.export.colours import energy_colours
from warpflat.pattern.export.figure import GREY, Pen
from warpflat.pattern.export.geometry import outline_edges
from warpflat.pattern.export.picture_views import SIDES, DrawnView, Silhouette, make_facets, view_from_side

__all__ = ["Body", "GarmentViews", "crop_body"]

_HEIGHT, _HEAD, _FOOT = 9.0, 0.26, 0.30  # [in], as all that follows
_LEAST_GAP = 0.25
# How far the mannequin shows around the garment [m].
_AROUND = 0.06
# A part of the body with a smaller share of the largest part's triangles is not drawn.
_SCRAP = 0.1
# The garment lies on the mannequin: it is drawn this much nearer to the eye [m].
_NEARER = 0.012
# Drafted pieces, such as patches, are drawn over it, this much nearer [m].
_OVER = 0.004
_SKIN, _DRAFTED = (0.88, 0.86, 0.83), (0.62, 0.64, 0.68)


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

    def __init__(
        self,
        body: Body,
        surfaces: Sequence[Surface],
        densities: Sequence[FloatArray],
        drafted: Sequence[Surface] = (),
        words: str = "",
    ) -> None:
        """
        Args:
            body: under it.
            surfaces: the pieces in space.
            densities: #F [J/m2] for each piece.
            drafted: pieces that were not flattened, as collars and flounces.
            words: in a line below.
        """
        self._density = np.concatenate(densities)
        self._words = words
        self._drafted_faces = sum(len(surface.faces) for surface in drafted)
        surfaces = [*surfaces, *drafted]
        worn = np.concatenate([surface.vertices for surface in surfaces])
        near, skin_points = crop_body(body, worn)
        counts = np.cumsum([0, *(len(surface.vertices) for surface in surfaces)])
        pieces = [
            np.where(surface.faces >= 0, surface.faces + first, -1)
            for surface, first in zip(surfaces, counts, strict=False)
        ]
        cloth = np.concatenate(pieces).astype(np.int32)
        skin = np.column_stack([near, np.full(len(near), -1)]) + counts[-1]
        skin[:, 3] = -1
        # Outlines of pieces show the seams; the body has none.
        seams = np.concatenate([outline_edges(faces.astype(np.int32)) for faces in pieces])
        facets = make_facets(np.concatenate([cloth, skin]).astype(np.int32), seams)
        self._skin_faces = len(skin)
        points = np.concatenate([worn, skin_points])
        self._views = [(title, view_from_side(points, facets, degrees)) for title, degrees in SIDES]
        for _, view in self._views:
            view.points[: len(worn), 2] += _NEARER
            view.points[len(worn) - sum(len(surface.vertices) for surface in drafted) : len(worn), 2] += _OVER
        self._width = sum(float(view.size[0]) for _, view in self._views)
        self._tallest = max(float(view.size[1]) for _, view in self._views)
        self._area = sum(Silhouette(view).area for _, view in self._views)
        self._scale, self._gap = 1.0, _LEAST_GAP

    def size(self, share: float, room: float) -> tuple[float, float]:
        """Return width and height of the band [in] at a share of the largest scale on a page with so much room [in]."""
        scale = self._scale_at(share, room)
        return min(self._width * scale + len(SIDES) * _LEAST_GAP, room), _HEAD + self._tallest * scale + _FOOT

    def covered(self, share: float, room: float) -> float:
        """Return the area of the page that the views cover [in2]; arguments as of :meth:`size`."""
        return self._area * self._scale_at(share, room) ** 2

    def place(self, share: float, room: float, width: float, *, beside: bool) -> None:
        """Choose the scale, and gaps that fill a width [in] unless pieces stand `beside` the views."""
        self._scale = self._scale_at(share, room)
        self._gap = _LEAST_GAP if beside else max((width - self._width * self._scale) / len(SIDES), _LEAST_GAP)

    def _scale_at(self, share: float, room: float) -> float:
        return share * min((room - len(SIDES) * _LEAST_GAP) / self._width, _HEIGHT / self._tallest)

    def draw(self, pen: Pen, left: float, top: float, scale: float) -> None:
        """Draw the band whose upper left corner is at (`left`, `top`) [in], colours up to `scale` [J/m2]."""
        pen.write(left, top - _HEAD - self._tallest * self._scale - 0.16, self._words, 8, color=GREY)
        plain = [np.tile(_DRAFTED, (self._drafted_faces, 1)), np.tile(_SKIN, (self._skin_faces, 1))]
        colours = np.concatenate([energy_colours(self._density, scale), *plain])
        for title, view in self._views:
            width, height = view.size[:2] * self._scale
            left += 0.5 * self._gap
            drawn = DrawnView(view, left=left, bottom=top - _HEAD - float(height), inches_per_metre=self._scale)
            drawn.draw(pen.axes, colours)
            pen.write(left + 0.5 * float(width), top - 0.12, title, 9, color=GREY, ha="center", fontstyle="italic")
            left += float(width) + 0.5 * self._gap


def crop_body(body: Body, worn: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return what of a body is near a garment (#P by 3), as triangles and vertices.

    Arms end beside the garment, as those of a dress form do: they would take a third of the page. Their ends are closed.
    """
    triangles, vertices, ends = triangulate(body.faces)[0], body.vertices, list[IntArray]()
    for axis, sign in ((1, 1.0), (1, -1.0), (0, 1.0), (0, -1.0)):
        limit = float((sign * worn[:, axis]).max()) + _AROUND
        triangles, vertices, edges = _cut(triangles, vertices, sign * vertices[:, axis] - limit)
        ends += [edges] if axis == 0 else []
    # Small parts of hands and arms would hang in the air.
    label = join_labels(len(vertices), triangles[:, :2].ravel(), triangles[:, 1:].ravel())[triangles[:, 0]]
    size = np.bincount(label)
    triangles = triangles[size[label] >= _SCRAP * size.max(initial=0)]
    for end in ends:
        edges = end[np.isin(end, triangles).all(axis=1)]
        if len(edges):
            # With vertices of its own: light does not bend around its edge.
            rim = vertices[edges.ravel()]
            copies = len(vertices) + np.arange(len(rim)).reshape(-1, 2)
            cap = np.column_stack([copies, np.full(len(copies), len(vertices) + len(rim))])
            vertices = np.concatenate([vertices, rim, rim.mean(axis=0)[None]])
            triangles = np.concatenate([triangles, cap])
    return triangles.astype(np.int32), vertices


def _cut(triangles: IntArray, vertices: FloatArray, beyond: FloatArray) -> tuple[IntArray, FloatArray, IntArray]:
    """Leave out what of a mesh lies where `beyond` (#V) is positive; return triangles, vertices and the edges of the cut."""
    outside = beyond[triangles] > 0.0
    number = outside.sum(axis=1)
    found, edges = [triangles[number == 0]], []
    for several, alone_is_outside in ((1, True), (2, False)):
        crossed = triangles[number == several]
        # The vertex that is alone on its side comes first.
        first = (outside[number == several] == alone_is_outside).argmax(axis=1)
        a, b, c = np.take_along_axis(crossed, (first[:, None] + np.arange(3)) % 3, axis=1).T
        p, q = len(vertices) + np.arange(2 * len(a)).reshape(2, -1)
        ends = np.concatenate([b, c])
        share = (beyond[np.tile(a, 2)] / (beyond[np.tile(a, 2)] - beyond[ends]))[:, None]
        vertices = np.concatenate([vertices, (1.0 - share) * vertices[np.tile(a, 2)] + share * vertices[ends]])
        parts = ((p, b, c), (p, c, q)) if alone_is_outside else ((a, p, q),)
        found += [np.column_stack(part) for part in parts]
        # As a face beyond the cut would have them, so that it looks outwards.
        edges.append(np.column_stack([p, q] if alone_is_outside else [q, p]))
    return np.concatenate(found), vertices, np.concatenate(edges)
