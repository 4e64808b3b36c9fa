"""One mesh on a page: the surface seen from its front, lit, or the pattern in its plane, coloured by energy; and its silhouette."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.collections import PathCollection
from matplotlib.path import Path
from numpy.typing import NDArray

from warpflat.core import BoolArray, FloatArray, IntArray
from warpflat.flat import Surface, area_vectors, mean_normals, triangulate
from warpflat.pattern.export.figure import DPI, HALO_LAYER, INK, Pixels
from warpflat.pattern.export.geometry import outline_edges
from warpflat.pattern.export.raster import Lighting, Samples, rasterise, shade

__all__ = [
    "SIDES",
    "DrawnView",
    "Facets",
    "Silhouette",
    "View",
    "make_facets",
    "pattern_view",
    "surface_view",
    "view_from_side",
]

#: From where a worn garment or a body is shown, with degrees for :func:`view_from_side`.
SIDES = (("front", 0.0), ("left side", 90.0), ("back", 180.0))

_FINE = 500_000  # triangles, about as many as pixels: from here on smooth light and smooth edges show no difference
_SEGMENTS_TO_A_PATH = 500
_MARGIN = 3  # pixels around the image of a mesh
_LIGHT = (-0.42, 0.55, 0.72)  # where it comes from: right, up, towards the viewer
_BACK = (0.80, 0.80, 0.79)
_COLUMNS = 120  # of a silhouette


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


def make_facets(faces: IntArray, outline: IntArray | None = None) -> Facets:
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
    outline = outline_edges(faces) if outline is None else outline
    return Facets(faces=drawn, triangles=triangles, face_of_triangle=face, outline=outline, used=used)


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """A mesh as seen on the page.

    Attributes:
        points: #V by 3, to the right, upwards, towards the viewer [m].
        facets: its faces.
        lines: feature lines, each a list of vertex-index arrays.
        vectors: #T by 3, the normals of the triangles in the view's directions, as long as their areas [m2]; None for a
            flat pattern, which needs no light and hides nothing.
    """

    points: FloatArray
    facets: Facets
    lines: Mapping[str, list[IntArray]]
    vectors: FloatArray | None

    @cached_property
    def low(self) -> FloatArray:
        """Left, bottom and back [m]."""
        return np.asarray(self.points[self.facets.used].min(axis=0))

    @cached_property
    def size(self) -> FloatArray:
        """Width, height and depth [m]."""
        return np.asarray(self.points[self.facets.used].max(axis=0) - self.low)


def surface_view(surface: Surface, facets: Facets, lines: Mapping[str, list[IntArray]]) -> View:
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
    towards = towards / np.linalg.norm(towards)
    right = np.cross(upwards, towards)
    right /= np.linalg.norm(right)
    directions = np.array([right, np.cross(towards, right), towards])
    centred = surface.vertices - surface.vertices.mean(axis=0)
    return View(points=centred @ directions.T, facets=facets, lines=lines, vectors=vectors @ directions.T)


def pattern_view(positions: FloatArray, facets: Facets, lines: Mapping[str, list[IntArray]]) -> View:
    """Return the view of a pattern (#P by 2) in its plane."""
    points = np.column_stack([positions, np.zeros(len(positions))])
    return View(points=points, facets=facets, lines=lines, vectors=None)


def view_from_side(points: FloatArray, facets: Facets, degrees: float) -> View:
    """Return a mesh (#V by 3) as seen by somebody who walked `degrees` around it to its left."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    seen = points @ np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]).T
    return View(points=seen, facets=facets, lines={}, vectors=area_vectors(seen, facets.triangles))


class DrawnView:
    """A view at a place on the page: where its points are, and which of them are visible."""

    def __init__(self, view: View, *, left: float, bottom: float, inches_per_metre: float) -> None:
        """Rasterise a view whose lower left corner comes to (`left`, `bottom`) [in]."""
        self.view = view
        self._fine = len(view.facets.triangles) > _FINE
        self._per_pixel = 1 if self._fine else 2
        self._low = view.low
        self._scale = inches_per_metre
        # On the grid of pixels, so that the image is shown as it is and not resampled.
        self.left, self.bottom = round(left * DPI) / DPI, round(bottom * DPI) / DPI
        pixels = np.ceil(view.size[:2] * inches_per_metre * DPI).astype(int) + 2 * _MARGIN
        self._columns, self._rows = int(pixels[0]), int(pixels[1])
        self._grid = self._to_samples(view.points)
        shape = (self._rows * self._per_pixel, self._columns * self._per_pixel)
        self._samples: Samples = rasterise(self._grid, view.facets.triangles, shape)

    def to_page(self, points: FloatArray) -> FloatArray:
        """Return the places on the page (#N by 2 [in]) of points in the view's directions (#N by 2 or 3) [m]."""
        return np.asarray((points[:, :2] - self._low[:2]) * self._scale + (self.left, self.bottom))

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Left, bottom, right, top [in]."""
        width, height = self.view.size[:2] * self._scale
        return self.left, self.bottom, self.left + float(width), self.bottom + float(height)

    def covers(self, spots: FloatArray) -> BoolArray:
        """Return whether the mesh is at places on the page (#N, for #N by 2 [in])."""
        per_inch = DPI * self._per_pixel
        margin = _MARGIN * self._per_pixel
        column = np.floor((spots[:, 0] - self.left) * per_inch + margin).astype(int)
        row = len(self._samples.triangle) - 1 - np.floor((spots[:, 1] - self.bottom) * per_inch + margin).astype(int)
        inside = (column >= 0) & (row >= 0)
        inside &= (column < self._samples.triangle.shape[1]) & (row < len(self._samples.triangle))
        hit = self._samples.triangle[np.where(inside, row, 0), np.where(inside, column, 0)] >= 0
        return np.asarray(inside & hit)

    def draw(self, axes: Any, face_colours: FloatArray) -> None:
        """Draw the coloured faces (#F by 3, sRGB), the mesh where it is coarse, and the outline."""
        left, bottom = (round(place * DPI) - _MARGIN for place in (self.left, self.bottom))
        # Of a fine mesh each triangle has a normal, else each vertex.
        facets, normals = self.view.facets, self.view.vectors
        if normals is not None and not self._fine:
            normals = mean_normals(normals, facets.triangles, len(self.view.points))
        axes.add_artist(
            Pixels(
                shade(
                    self._samples,
                    self._per_pixel,
                    self._grid,
                    facets.triangles,
                    face_colours,
                    face=facets.face_of_triangle,
                    lighting=Lighting(normals=normals, at_vertices=not self._fine, direction=_LIGHT, back=_BACK),
                ),
                left=left,
                bottom=bottom,
                zorder=1,
            )
        )
        faces = self.view.facets.faces
        is_quad = faces[:, 3] >= 0
        covered = float((self._samples.triangle >= 0).sum()) / self._per_pixel**2
        if covered >= 50.0 * max(len(faces), 1):
            closed = np.where(is_quad[:, None], faces, faces[:, [0, 1, 2, 0]])
            sides = np.stack([closed, np.roll(closed, -1, axis=1)], axis=-1).reshape(-1, 2)
            edges = np.unique(np.sort(sides[sides[:, 0] != sides[:, 1]], axis=1), axis=0)
            self.draw_segments(axes, edges.astype(np.int32), width=0.35, colour=(*INK, 0.38), zorder=2)
        self.draw_segments(axes, self.view.facets.outline, width=1.5, zorder=4)

    def draw_segments(
        self, axes: Any, edges: IntArray, *, width: float, colour: Any = INK, halo: bool = False, zorder: float
    ) -> None:
        """Draw the visible parts of edges (#E by 2 vertex indices); with a halo they stay visible on dark colours."""
        if len(edges):
            # Segments are the visible parts of edges (#S by 2 by 2 [in]).
            a, b = self.view.points[edges[:, 0]], self.view.points[edges[:, 1]]
            if self.view.vectors is None:
                segments = np.stack([self.to_page(a), self.to_page(b)], axis=1)
            else:
                pixels = np.linalg.norm((b - a)[:, :2], axis=1) * self._scale * DPI
                count = np.clip(np.ceil(pixels / 3.0), 1, 400).astype(int)
                edge = np.repeat(np.arange(len(edges)), count)
                step = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
                begin, end = ((step + shift) / count[edge] for shift in (0.0, 1.0))
                start, stop = (a[edge] + (b - a)[edge] * share[:, None] for share in (begin, end))
                seen = self._is_visible(self._to_samples(0.5 * (start + stop)))
                goes_on = (edge[1:] == edge[:-1]) & seen[1:] & seen[:-1]
                first, last = seen & ~np.insert(goes_on, 0, False), seen & ~np.append(goes_on, False)
                segments = np.stack([self.to_page(start[first]), self.to_page(stop[last])], axis=1)
            # Many to a path: a path each takes longer to set up than all of them to draw.
            parts = [segments[i : i + _SEGMENTS_TO_A_PATH] for i in range(0, len(segments), _SEGMENTS_TO_A_PATH)]
            paths = [Path(part.reshape(-1, 2), np.tile([Path.MOVETO, Path.LINETO], len(part))) for part in parts]
            layers = [((1.0, 1.0, 1.0, 0.7), width + 1.6, HALO_LAYER)] if halo else []
            for ink, thickness, layer in (*layers, (colour, width, zorder)):
                look: dict[str, Any] = {
                    "edgecolors": [ink],
                    "linewidths": thickness,
                    "capstyle": "round",
                    "zorder": layer,
                }
                axes.add_collection(PathCollection(paths, facecolors="none", **look), autolim=False)

    def visible_line(self, line: IntArray) -> FloatArray:
        """Return the longest visible stretch of a polyline of vertices (#N by 2 [in])."""
        points = self.to_page(self.view.points[line])
        seen = np.concatenate([[False], self._is_visible(self._grid[line]), [False]])
        changes = np.flatnonzero(seen[1:] != seen[:-1])
        if len(changes) == 0:
            return points[:0]
        begins, ends = changes[::2], changes[1::2]
        longest = int(np.argmax(ends - begins))
        return points[begins[longest] : ends[longest]]

    def _to_samples(self, points: FloatArray) -> FloatArray:
        """Return points [m] in samples."""
        per_metre = self._scale * DPI
        result = np.empty((len(points), 3))
        result[:, 0] = ((points[:, 0] - self._low[0]) * per_metre + _MARGIN) * self._per_pixel
        result[:, 1] = (self._rows - ((points[:, 1] - self._low[1]) * per_metre + _MARGIN)) * self._per_pixel
        result[:, 2] = points[:, 2]
        return result

    def _is_visible(self, spots: FloatArray) -> BoolArray:
        """Return whether points on the mesh (#N by 3, in samples) are in front, within the mesh's own slope."""
        if self.view.vectors is None:
            return np.ones(len(spots), dtype=bool)
        rows, columns = self._samples.triangle.shape
        row = np.clip(np.floor(spots[:, 1]).astype(int), 1, rows - 2)
        column = np.clip(np.floor(spots[:, 0]).astype(int), 1, columns - 2)
        around = np.arange(9)[:, None]
        least = self._samples.depth_at(row + around // 3 - 1, column + around % 3 - 1).min(axis=0)
        return np.asarray(spots[:, 2] >= least - 0.01 * float(np.linalg.norm(self.view.size)))


class Silhouette:
    """How far the cloth of a view lies from the upper and the lower edge of its box, in columns of one width.

    Attributes:
        width, height: of the box [m].
        below_top: #C, from the upper edge down to the cloth [m]; infinite in a column without cloth.
        above_bottom: #C, likewise from the lower edge up.
        area: that the view covers [m2].
    """

    def __init__(self, view: View) -> None:
        width, height = (max(float(size), 1e-9) for size in view.size[:2])
        self.width, self.height = width, height
        pitch = width / _COLUMNS
        rows = int(np.clip(np.ceil(height / pitch), 1, 10 * _COLUMNS))
        grid = np.empty((len(view.points), 3))
        grid[:, 0] = (view.points[:, 0] - view.low[0]) / pitch
        grid[:, 1] = rows * (1.0 - (view.points[:, 1] - view.low[1]) / height)
        grid[:, 2] = view.points[:, 2]
        covered = rasterise(grid, view.facets.triangles, (rows, _COLUMNS)).triangle >= 0
        any_cloth, step = covered.any(axis=0), height / rows
        self.below_top = np.where(any_cloth, covered.argmax(axis=0) * step, np.inf)
        self.above_bottom = np.where(any_cloth, covered[::-1].argmax(axis=0) * step, np.inf)
        self.area = float(covered.sum()) * pitch * step

    def columns(self, left: float, right: float) -> slice:
        """Return the columns between two places, measured from the left edge [m]."""
        first, last = (int(np.floor(place / self.width * _COLUMNS)) for place in (left, right))
        return slice(max(first, 0), max(last + 1, 0))

    def room_above(self, left: float, right: float) -> float:
        """Return how far the cloth between two places lies below the upper edge [m]; infinite if there is none."""
        return float(self.below_top[self.columns(left, right)].min(initial=np.inf))

    def room_below(self, left: float, right: float) -> float:
        """Return how far the cloth between two places lies above the lower edge [m]; infinite if there is none."""
        return float(self.above_bottom[self.columns(left, right)].min(initial=np.inf))

    def overlap_below(self, lower: Silhouette, shift: float) -> float:
        """Return how far the box of another view may reach up into this one's, without cloth upon cloth [m].

        Args:
            lower: the view below.
            shift: of its left edge to the right of this one's [m].
        """
        places = (np.arange(_COLUMNS) + 0.5) * self.width / _COLUMNS - shift
        number = np.floor(places / lower.width * _COLUMNS).astype(int)
        inside = (number >= 0) & (number < _COLUMNS)
        gaps: FloatArray = self.above_bottom[inside] + lower.below_top[number[inside]]
        return float(gaps.min(initial=np.inf))
