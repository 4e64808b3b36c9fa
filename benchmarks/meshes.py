"""The surfaces on which speeds are compared: a dome and a bodice as regular grids, irregular triangles and with a crack, and
the meshes of a folder of real ones."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, KDTree

from warpflat.flat.surface.connectivity import border_loops
from warpflat.flat.surface.cut.cut_mesh import cut_along
from warpflat.flat.surface.io.read import read_surface
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import bodice, dome

FloatArray = NDArray[np.float64]

# Width over height of the parameter square, so that its triangles are about as long as wide on the surface.
_ASPECT = {"dome": 1.0, "bodice": 1.2}


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """A surface to be flattened and the line it is developed from (None: the package chooses)."""

    name: str
    surface: Surface
    datum: NDArray[np.int32] | None

    @property
    def is_regular(self) -> bool:
        """Whether it is a grid of quads without cracks, on which more is asked of us."""
        return self.name.endswith("grid")


def grid(shape: str, size: int) -> Mesh:
    """About `size` vertices in a regular grid of quads, which get both diagonals."""
    surface = {"dome": dome, "bodice": bodice}[shape](resolution=round(size**0.5) | 1)
    return Mesh(name=f"{shape}, grid", surface=surface, datum=surface.lines["centre"])


def cracked(shape: str, size: int) -> Mesh:
    """The grid with a crack from the bottom up to three fifths of the height, at a third of the width."""
    whole = grid(shape, size).surface
    side = round(len(whole.vertices) ** 0.5)
    index = np.arange(side * side, dtype=np.int32).reshape(side, side)
    column = index[: round(0.6 * side), round(side / 3)]
    made = cut_along(whole.faces, [column], vertex_count=len(whole.vertices))
    centre = whole.lines["centre"]
    surface = make_surface(
        whole.vertices[made.vertex_origin], made.faces, lines={"centre": centre}, name=f"{shape}_cracked"
    )
    return Mesh(name=f"{shape}, crack", surface=surface, datum=surface.lines["centre"])


def irregular(shape: str, size: int) -> Mesh:
    """About `size` vertices of an irregular triangle mesh: a jittered hexagonal pattern in the parameters, by Delaunay."""
    aspect = _ASPECT[shape]
    spacing = (aspect / size * 2.0 / 3.0**0.5) ** 0.5
    random = np.random.default_rng(size)
    border = [np.linspace(0.0, length, max(3, round(length / spacing) + 1)) for length in (aspect, 1.0)]
    edge = np.concatenate(
        [
            np.column_stack([border[0], np.zeros_like(border[0])]),
            np.column_stack([border[0], np.ones_like(border[0])]),
            np.column_stack([np.zeros(len(border[1]) - 2), border[1][1:-1]]),
            np.column_stack([np.full(len(border[1]) - 2, aspect), border[1][1:-1]]),
        ]
    )
    rows = np.arange(0.5, 1.0 / (spacing * 3.0**0.5 / 2.0)) * spacing * 3.0**0.5 / 2.0
    columns = np.arange(0.25, aspect / spacing) * spacing
    inner = np.stack(np.meshgrid(columns, rows), axis=-1)
    inner[1::2, :, 0] += 0.5 * spacing
    inner = inner.reshape(-1, 2) + random.uniform(-0.25, 0.25, (inner.size // 2, 2)) * spacing
    margin = 0.6 * spacing
    inside = (inner > margin).all(axis=1) & (inner < np.array([aspect, 1.0]) - margin).all(axis=1)
    # The datum, the middle, runs along edges: points on it, and none beside it.
    middle = np.column_stack([np.full(len(border[1]), 0.5 * aspect), border[1]])
    inside &= np.abs(inner[:, 0] - 0.5 * aspect) > margin
    on_edge = np.abs(edge[:, 0] - 0.5 * aspect) > 0.25 * spacing
    points = np.concatenate([middle, edge[on_edge], inner[inside]])
    triangles = Delaunay(points).simplices
    a, b, c = (points[triangles[:, k]] for k in range(3))
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles = np.where(doubled[:, None] < 0, triangles[:, ::-1], triangles)[np.abs(doubled) > 1e-3 * spacing**2]
    vertices = _lift(shape)(points[:, 0] / aspect, points[:, 1])
    surface = make_surface(vertices, triangles, name=f"{shape}_irregular")
    return Mesh(name=f"{shape}, irregular", surface=surface, datum=_line_at(surface, vertices[: len(middle)]))


def garment(file: str | Path, size: int, *, units: str = "m") -> Mesh:
    """About `size` vertices of an irregular triangle mesh on the surface of a garment's piece: jittered hexagonal points in its flat
    piece, within its outline, by Delaunay, and lifted smoothly (Clough and Tocher 1965)."""
    from scipy.interpolate import CloughTocher2DInterpolator
    from shapely import LineString, Polygon, contains_xy, prepare

    import warpflat

    flat = warpflat.flatten(read_surface(file, units=units), fabric="isotropic", device="cpu")
    surface, layout = flat.surface, flat.positions
    outline = Polygon(layout[max(border_loops(surface.faces), key=len)])
    spacing = (outline.area / size * 2.0 / 3.0**0.5) ** 0.5
    ring = LineString(outline.exterior.coords)
    around = np.array([ring.interpolate(s).coords[0] for s in np.arange(0.0, ring.length - 0.5 * spacing, spacing)])
    (west, south, east, north) = outline.bounds
    rows, columns = np.arange(south, north, spacing * 3.0**0.5 / 2.0), np.arange(west, east, spacing)
    inner = np.stack(np.meshgrid(columns, rows), axis=-1)
    inner[1::2, :, 0] += 0.5 * spacing
    inner = inner.reshape(-1, 2)
    inner = inner + np.random.default_rng(size).uniform(-0.25, 0.25, inner.shape) * spacing
    within = outline.buffer(-0.6 * spacing)
    prepare(within)
    points = np.concatenate([around, inner[contains_xy(within, inner[:, 0], inner[:, 1])]])
    triangles = Delaunay(points).simplices
    middle = points[triangles].mean(axis=1)
    prepare(outline)
    triangles = triangles[contains_xy(outline, middle[:, 0], middle[:, 1])]
    a, b, c = (points[triangles[:, k]] for k in range(3))
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles = np.where(doubled[:, None] < 0, triangles[:, ::-1], triangles)[np.abs(doubled) > 1e-3 * spacing**2]
    vertices = CloughTocher2DInterpolator(layout, surface.vertices)(points)
    # Points of the outline lie on the border of what is interpolated, and by rounding beyond it.
    outside = np.isnan(vertices[:, 0])
    vertices[outside] = surface.vertices[KDTree(layout).query(points[outside])[1]]
    lifted = make_surface(vertices, triangles, name=f"{Path(file).stem}_{size}")
    return Mesh(name=f"{Path(file).stem}, garment", surface=lifted, datum=None)


def _line_at(surface: Surface, points: FloatArray) -> NDArray[np.int32]:
    """Vertices at the given points (in case the door has renumbered them)."""
    return KDTree(surface.vertices).query(points)[1].astype(np.int32)


def _lift(shape: str) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """Formulas of `warpflat.flat.surface.shapes`, at any parameters."""

    def on_dome(u: FloatArray, w: FloatArray) -> FloatArray:
        x, y = 0.5 * (u - 0.5), 0.5 * (w - 0.5)
        return np.column_stack([x, y, np.sqrt(0.45**2 - x**2 - y**2)])

    def on_bodice(u: FloatArray, w: FloatArray) -> FloatArray:
        t, y = (u - 0.5) * np.pi, 0.45 * w
        waist = 1.0 - 0.20 * np.exp(-(((y - 0.10) / 0.10) ** 2))
        bust = sum(0.045 * np.exp(-(((t - t0) / 0.30) ** 2 + ((y - 0.28) / 0.055) ** 2)) for t0 in (-0.55, 0.55))
        return np.column_stack([(0.170 * waist + bust) * np.sin(t), y, (0.115 * waist + bust) * np.cos(t)])

    return {"dome": on_dome, "bodice": on_bodice}[shape]


def real_meshes() -> list[Mesh]:
    """Return the meshes of the folder that WARPFLAT_DATA names, or none if it is not set."""
    folder = os.environ.get("WARPFLAT_DATA")
    if not folder:
        return []
    files = [Path(folder) / f"{name}.obj" for name in ("garment_shirtfront", "front_bodice_raw")]
    return [Mesh(name=file.stem, surface=read_surface(file, units="m"), datum=None) for file in files if file.is_file()]


KINDS: dict[str, Callable[[str, int], Mesh]] = {"grid": grid, "irregular": irregular, "crack": cracked}
