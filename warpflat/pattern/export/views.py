"""One mesh on a page: the surface seen from its front, lit, or the pattern in its plane, coloured by a map."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core import BoolArray, FloatArray, IntArray, unit
from warpflat.flat import Surface, area_vectors, border_edges, mean_normals, mesh_edges, triangulate
from warpflat.pattern.export.colours import Scale
from warpflat.pattern.export.figure import GREY, INK, PAGE_WIDTH, Pen, Pixels, drawn_page
from warpflat.pattern.export.raster import Samples, rasterise, shade

__all__ = [
    "PIXELS_AROUND",
    "SIDES",
    "DrawnView",
    "Facets",
    "Shot",
    "View",
    "draw_row",
    "row_size",
    "write_maps",
]

#: From where a worn garment or a body is shown, with degrees for :meth:`View.from_side`.
SIDES = (("front", 0.0), ("left side", 90.0), ("back", 180.0))

_FINE = 500_000  # triangles, about as many as pixels
PIXELS_AROUND = 3  # the image of a mesh
_COARSE = 120  # pixels across a view, enough to tell its area
# A page of maps: above each row, around all of them, beside them for the scale, and between views [in].
_ABOVE, _AROUND, _BAR, _GAP = 0.48, 0.3, 1.0, 0.2


@dataclass(frozen=True, kw_only=True, eq=False)
class Facets:
    """The faces of a mesh as triangles, with their outline.

    Attributes:
        faces: #F by 4, whose edges are drawn where they are coarse.
        triangles, face_of_triangle: #T by 3 and #T.
        outline: #B by 2.
        used: the vertices that have a face.
    """

    faces: IntArray
    triangles: IntArray
    face_of_triangle: IntArray
    outline: IntArray
    used: NDArray[np.int64]

    @classmethod
    def of(cls, faces: IntArray, outline: IntArray | None = None) -> Facets:
        """Return the facets of faces (#F by 4).

        Args:
            faces: those that are coloured.
            outline: #B by 2, edges that are drawn in place of the border; the edges of a coarse mesh are not drawn then.
        """
        triangles, face = triangulate(faces)
        has_face = np.zeros(int(faces.max(initial=-1)) + 1, dtype=bool)
        has_face[triangles] = True
        used = np.flatnonzero(has_face)
        drawn = faces if outline is None else faces[:0]
        outline = border_edges(faces) if outline is None else outline
        return cls(faces=drawn, triangles=triangles, face_of_triangle=face, outline=outline, used=used)


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """A mesh as seen on the page.

    Attributes:
        points: #V by 3, to the right, upwards, towards the viewer [m].
        facets: its faces.
        lines: feature lines, each a list of vertex-index arrays.
        vectors: #T by 3, the normals of the triangles in the view's directions, as long as their areas [m2]; None for a
            flat pattern, which needs no light and hides nothing.
        directions: 3 by 3, where right, up and the viewer are in space.
    """

    points: FloatArray
    facets: Facets
    lines: Mapping[str, list[IntArray]]
    vectors: FloatArray | None
    directions: FloatArray = field(default_factory=lambda: np.eye(3))

    @classmethod
    def of_surface(cls, surface: Surface, facets: Facets, lines: Mapping[str, list[IntArray]]) -> View:
        """Return a surface seen from its front: along its mean normal, a little from the side and from above, Y upwards.

        A surface that faces all directions (a skirt) is seen from +Z, one that lies flat on the ground from above.
        """
        vectors = area_vectors(surface.vertices, facets.triangles)
        total, mean = float(np.linalg.norm(vectors, axis=1).sum()), vectors.sum(axis=0)
        length = float(np.linalg.norm(mean))
        front = mean / length if length > 0.12 * total and length > 0.0 else np.array([0.0, 0.0, 1.0])
        aside, above = np.radians(22.0), np.radians(12.0)
        if abs(front[1]) > 0.85:
            towards = np.array([np.sin(aside), np.copysign(2.0, front[1]), np.copysign(1.0, front[1])])
            upwards = np.array([0.0, 0.0, -np.copysign(1.0, front[1])])
        else:
            azimuth = np.arctan2(front[0], front[2]) + aside
            elevation = np.clip(np.arcsin(np.clip(front[1], -1.0, 1.0)) + above, -1.2, 1.2)
            level = np.cos(elevation)
            towards = np.array([level * np.sin(azimuth), np.sin(elevation), level * np.cos(azimuth)])
            upwards = np.array([0.0, 1.0, 0.0])
        towards = unit(towards)
        right = unit(np.cross(upwards, towards))
        directions = np.array([right, np.cross(towards, right), towards])
        return cls._seen(surface.vertices, facets, directions, lines)

    @classmethod
    def of_pattern(cls, positions: FloatArray, facets: Facets, lines: Mapping[str, list[IntArray]]) -> View:
        """Return the view of a pattern (#P by 2) in its plane."""
        points = np.column_stack([positions, np.zeros(len(positions))])
        return cls(points=points, facets=facets, lines=lines, vectors=None)

    @classmethod
    def from_side(cls, points: FloatArray, facets: Facets, degrees: float) -> View:
        """Return a mesh (#V by 3) as seen by somebody who walked `degrees` around it to its left."""
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        return cls._seen(points, facets, np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]), {})

    @classmethod
    def around(cls, points: FloatArray, facets: Facets, sides: Iterable[tuple[str, float]] = SIDES) -> dict[str, View]:
        """Return a mesh (#V by 3) as seen from some sides, by their titles (see :meth:`from_side`)."""
        return {title: cls.from_side(points, facets, degrees) for title, degrees in sides}

    @classmethod
    def _seen(
        cls, points: FloatArray, facets: Facets, directions: FloatArray, lines: Mapping[str, list[IntArray]]
    ) -> View:
        seen = points @ directions.T
        vectors = area_vectors(seen, facets.triangles)
        return cls(points=seen, facets=facets, lines=lines, vectors=vectors, directions=directions)

    @cached_property
    def low(self) -> FloatArray:
        """Left, bottom and back [m]."""
        return np.asarray(self.points[self.facets.used].min(axis=0))

    @cached_property
    def size(self) -> FloatArray:
        """Width, height and depth [m]."""
        return np.asarray(self.points[self.facets.used].max(axis=0) - self.low)

    @cached_property
    def area(self) -> float:
        """What it covers on the page, roughly [m2]."""
        per_metre = _COARSE / max(float(self.size[:2].max()), 1e-9)
        return Shot(self, per_metre).covered / per_metre**2


class Shot:
    """A view in pixels: where its vertices are, and what is seen at each sample.

    Attributes:
        view: that is seen.
        grid: #V by 3, its vertices in samples, and their depth [m].
        samples: the nearest triangles.
    """

    def __init__(
        self, view: View, per_metre: float, *, low: FloatArray | None = None, size: FloatArray | None = None
    ) -> None:
        """Rasterise a view.

        Args:
            view: that is seen.
            per_metre: pixels.
            low, size: left and lower end, and width and height, of what is shown [m]; all of the view if not given.
        """
        self.view, self._per_metre = view, per_metre
        self._low = view.low[:2] if low is None else low[:2]
        # Smooth light and smooth edges show no difference where triangles are as many as pixels.
        self._fine = len(view.facets.triangles) > _FINE
        self._per_pixel = 1 if self._fine else 2
        pixels = np.ceil((view.size if size is None else size)[:2] * per_metre).astype(int) + 2 * PIXELS_AROUND
        self._columns, self._rows = int(pixels[0]), int(pixels[1])
        self.grid = self.to_samples(view.points)
        shape = (self._rows * self._per_pixel, self._columns * self._per_pixel)
        self.samples: Samples = rasterise(self.grid, view.facets.triangles, shape)

    def to_samples(self, points: FloatArray) -> FloatArray:
        """Return points in the view's directions (#N by 3 [m]) in samples; depths stay as they are."""
        right, up = ((points[:, :2] - self._low) * self._per_metre + PIXELS_AROUND).T * self._per_pixel
        return np.column_stack([right, self._rows * self._per_pixel - up, points[:, 2]])

    def pixels(self, face_colours: FloatArray) -> NDArray[np.uint8]:
        """Return the lit faces in their colours (#F by 3, sRGB) as RGBA pixels (#R by #C by 4)."""
        facets, normals = self.view.facets, self.view.vectors
        # Of a fine mesh each triangle has a normal, else each vertex.
        if normals is not None and not self._fine:
            normals = mean_normals(normals, facets.triangles, len(self.view.points))
        return shade(
            self.samples, self._per_pixel, self.grid, facets.triangles, face_colours,
            face=facets.face_of_triangle, normals=normals, at_vertices=not self._fine,
        )  # fmt: skip

    @property
    def covered(self) -> float:
        """How many pixels the mesh covers."""
        return float((self.samples.front >= 0).sum()) / self._per_pixel**2

    def covers(self, pixels: FloatArray) -> BoolArray:
        """Return whether the mesh is at places (#N by 2, pixels to the right and up from the lower left corner), #N."""
        column, up = np.floor((pixels + PIXELS_AROUND) * self._per_pixel).astype(int).T
        rows, columns = self.samples.front.shape
        row = rows - 1 - up
        inside = (column >= 0) & (row >= 0) & (column < columns) & (row < rows)
        return np.asarray(inside & (self.samples.front[np.where(inside, row, 0), np.where(inside, column, 0)] >= 0))

    def is_visible(self, spots: FloatArray) -> BoolArray:
        """Return whether points on the mesh (#N by 3, in samples) are in front, within the mesh's own slope."""
        if self.view.vectors is None:
            return np.ones(len(spots), dtype=bool)
        rows, columns = self.samples.front.shape
        row = np.clip(np.floor(spots[:, 1]).astype(int), 1, rows - 2)
        column = np.clip(np.floor(spots[:, 0]).astype(int), 1, columns - 2)
        around = np.arange(9)[:, None]
        least = self.samples.depth_at(row + around // 3 - 1, column + around % 3 - 1).min(axis=0)
        return np.asarray(spots[:, 2] >= least - 0.01 * float(np.linalg.norm(self.view.size)))


class DrawnView:
    """A view at a place on the page: where its points are, and which of them are visible."""

    def __init__(self, pen: Pen, view: View, *, left: float, bottom: float, inches_per_metre: float) -> None:
        """Rasterise a view whose lower left corner comes to (`left`, `bottom`) [in]."""
        self.view, self._pen, self._scale = view, pen, inches_per_metre
        self.move_to(left, bottom)
        self._shot = Shot(view, inches_per_metre * pen.dpi)

    def move_to(self, left: float, bottom: float) -> None:
        """Choose another place for the lower left corner [in]; what was drawn stays."""
        # On the grid of pixels, so that the image is shown as it is and not resampled.
        self.left, self.bottom = (round(place * self._pen.dpi) / self._pen.dpi for place in (left, bottom))

    def to_page(self, points: FloatArray) -> FloatArray:
        """Return the places on the page (#N by 2 [in]) of points in the view's directions (#N by 2 or 3) [m]."""
        return np.asarray((points[:, :2] - self.view.low[:2]) * self._scale + (self.left, self.bottom))

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Left, bottom, right, top [in]."""
        width, height = self.view.size[:2] * self._scale
        return self.left, self.bottom, self.left + float(width), self.bottom + float(height)

    def covers(self, spots: FloatArray) -> BoolArray:
        """Return whether the mesh is at places on the page (#N, for #N by 2 [in])."""
        return self._shot.covers((spots - (self.left, self.bottom)) * self._pen.dpi)

    def draw(self, face_colours: FloatArray, *, outline: float = 1.5) -> None:
        """Draw the coloured faces (#F by 3, sRGB), the mesh where it is coarse, and the outline, so wide [pt]."""
        left, bottom = (round(place * self._pen.dpi) - PIXELS_AROUND for place in (self.left, self.bottom))
        self._pen.axes.add_artist(Pixels(self._shot.pixels(face_colours), left=left, bottom=bottom, zorder=1))
        faces = self.view.facets.faces
        if self._shot.covered >= 50.0 * max(len(faces), 1):
            self.draw_segments(mesh_edges(faces), width=0.35, colour=(*INK, 0.38), zorder=2)
        self.draw_segments(self.view.facets.outline, width=outline, zorder=4)

    def draw_segments(self, edges: IntArray, **look: Any) -> None:
        """Draw the visible parts of edges (#E by 2 vertex indices); the look is that of :meth:`Pen.segments`."""
        a, b = self.view.points[edges[:, 0]], self.view.points[edges[:, 1]]
        if self.view.vectors is not None:
            pixels = np.linalg.norm((b - a)[:, :2], axis=1) * self._scale * self._pen.dpi
            count = np.clip(np.ceil(pixels / 3.0), 1, 400).astype(int)
            edge = np.repeat(np.arange(len(edges)), count)
            step = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
            begin, end = ((step + shift) / count[edge] for shift in (0.0, 1.0))
            start, stop = (a[edge] + (b - a)[edge] * share[:, None] for share in (begin, end))
            seen = self._shot.is_visible(self._shot.to_samples(0.5 * (start + stop)))
            goes_on = (edge[1:] == edge[:-1]) & seen[1:] & seen[:-1]
            a, b = start[seen & ~np.insert(goes_on, 0, False)], stop[seen & ~np.append(goes_on, False)]
        self._pen.segments(np.stack([self.to_page(a), self.to_page(b)], axis=1), **look)

    def visible_line(self, line: IntArray) -> FloatArray:
        """Return the longest visible stretch of a polyline of vertices (#N by 2 [in])."""
        points = self.to_page(self.view.points[line])
        seen = np.concatenate([[False], self._shot.is_visible(self._shot.grid[line]), [False]])
        changes = np.flatnonzero(seen[1:] != seen[:-1])
        if len(changes) == 0:
            return points[:0]
        begins, ends = changes[::2], changes[1::2]
        longest = int(np.argmax(ends - begins))
        return points[begins[longest] : ends[longest]]


def row_size(views: Mapping[str, View]) -> tuple[float, float]:
    """Return width and height of views side by side on one floor, without gaps [m]."""
    wide, high, _ = np.array([view.size for view in views.values()]).T
    return float(wide.sum()), float(high.max())


def draw_row(
    pen: Pen,
    views: Mapping[str, View],
    colours: Sequence[FloatArray],
    *,
    left: float,
    bottom: float,
    inches_per_metre: float,
    gap: float,
    above: float = 0.12,
) -> list[DrawnView]:
    """Draw views side by side on one floor, each with its title above it.

    Args:
        pen: of the page.
        views: by title.
        colours: of the faces of each (#F by 3, sRGB).
        left, bottom: of the first [in].
        inches_per_metre: their scale.
        gap: from one to the next [in].
        above: how far its title is above each [in].
    """
    drawn = []
    for (title, view), shades in zip(views.items(), colours, strict=True):
        drawn.append(DrawnView(pen, view, left=left, bottom=bottom, inches_per_metre=inches_per_metre))
        drawn[-1].draw(shades)
        start, _, end, top = drawn[-1].box
        pen.write(0.5 * (start + end), top + above, title, 9, color=GREY, ha="center", fontstyle="italic")
        left = end + gap
    return drawn


def write_maps(
    path: str | os.PathLike[str],
    title: str,
    views: Mapping[str, View],
    maps: Mapping[str, tuple[Scale, Sequence[FloatArray]]],
    *,
    tallest: float,
) -> None:
    """Draw a row for each map: its name, the views in its colours, and its scale; atomically.

    Args:
        path: the file, ``*.png``.
        title: of the page; none if it is empty.
        views: by title.
        maps: by name, the scale, and the colours of the faces of each view (#F by 3, sRGB).
        tallest: greatest height of a view [in].

    Raises:
        InputError: the file cannot be written.
    """
    (wide, high), gaps = row_size(views), _GAP * (len(views) - 1)
    room = PAGE_WIDTH - _BAR - 2 * _AROUND - gaps
    per_metre = min(room / wide, tallest / high)
    left, tall = _AROUND + 0.5 * (room - per_metre * wide), per_metre * high
    bottom = len(maps) * (tall + _ABOVE) + _AROUND
    with drawn_page(path, PAGE_WIDTH, bottom + (_AROUND if title else 0.0)) as pen:
        pen.write(_AROUND, bottom + 0.1, title, 11)
        for name, (scale, colours) in maps.items():
            pen.write(_AROUND, bottom - 0.14, name, 11, fontweight="bold")
            bottom -= tall + _ABOVE
            draw_row(pen, views, colours, left=left, bottom=bottom, inches_per_metre=per_metre, gap=_GAP)
            pen.colour_bar(scale, PAGE_WIDTH - 0.75, bottom + 0.1 * tall, 0.16, 0.75 * tall)
