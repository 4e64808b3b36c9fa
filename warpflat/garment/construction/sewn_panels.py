"""The sewn pattern that a worn garment's file has as its texture, in true size, as CLO, Style3D and GarmentCode write it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike

import numpy as np

from warpflat.core import FloatArray, InputError, IntArray, format_count, make_file_name
from warpflat.flat import (
    ALL_PRIMS,
    METRES_PER_UNIT,
    POSSIBLE,
    RawMesh,
    Surface,
    area_vectors,
    check_size,
    flat_areas,
    make_surface,
    overlap_area,
    parts_of_faces,
    read_mesh_file,
    triangulate,
)
from warpflat.garment.construction.file_seams import COUNTED, MOST_ISLANDS, file_seams
from warpflat.garment.construction.read_pieces import make_piece_name

__all__ = ["SewnPanel", "read_sewn_panels", "sewn_panels", "with_cuts"]

# How far the area of the texture may differ from the cloth's, in all and for a panel that counts.
_TRUE_SIZE = 0.25
# No place of a texture lies farther out, in its own unit.
_FARTHEST = 1e6
# Panels may cover so much of each other, or of themselves.
_OVERLAP = 1e-3
_RIGHT = "--seams uv cuts along its islands and flattens them; --seams auto looks for seams"


@dataclass(frozen=True, kw_only=True, eq=False)
class SewnPanel:
    """A sewn panel: how it is worn, and how it was cut.

    Attributes:
        surface: as worn, #V vertices.
        cut: #V by 2, the same vertices in the pattern [m], the right side of the cloth towards the viewer.
        unit: of the texture.
        polygons: #P, the faces of the file that it has.
        corners: #P by k, its vertex at each of their corners; -1 where there is none, or repair has dropped it.
        of_file: #V, the vertices of the file.
    """

    surface: Surface
    cut: FloatArray
    unit: str
    polygons: IntArray
    corners: IntArray
    of_file: IntArray

    @property
    def area(self) -> float:
        """The area of the cloth as it was cut [m2]."""
        return float(flat_areas(self.cut, triangulate(self.surface.faces)[0]).sum())

    @property
    def worn_area(self) -> float:
        """Its area as it is worn [m2]."""
        return float(flat_areas(self.surface.vertices, triangulate(self.surface.faces)[0]).sum())


def read_sewn_panels(
    path: str | PathLike[str], *, units: str | None = None, prim: str | None = None, name: str | None = None
) -> list[SewnPanel]:
    """Read the sewn panels of a file; see :func:`sewn_panels`.

    Args:
        path: of a mesh file.
        units: of its points, where it does not say.
        prim: the mesh of a USD stage, or of a GLB scene, to take; all of them if not given.
        name: of panels that have none in the file; the file's stem if not given.

    Raises:
        InputError: one line that names the file.
    """
    file, raw, scale, sources = read_mesh_file(path, units=units, prim=prim or ALL_PRIMS, name=name)
    try:
        panels = sewn_panels(raw, scale, name=name or make_file_name(file.stem))
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    known = tuple(dict.fromkeys(sources))
    for panel in panels:
        check_size(panel.surface, file, scale)
    found = [replace(panel, surface=replace(panel.surface, sources=known)) for panel in panels]
    first = found[0].surface
    return [replace(found[0], surface=replace(first, notes=(*raw.notes, *first.notes))), *found[1:]]


def sewn_panels(raw: RawMesh, scale: float, *, name: str = "panel") -> list[SewnPanel]:
    """Return the panels of a garment whose texture is its sewn pattern; each has the name of its group, or is numbered.

    The unit of the texture is the one in which its area comes nearest to the cloth's. A panel whose islands lie face down is turned over.

    Args:
        raw: the mesh as it stands.
        scale: metres per unit of its points.
        name: of panels without one of their own.

    Raises:
        InputError: there is no texture, or it is no pattern: not of true size in any unit, or of a panel that lies over itself.
    """
    parts_of_faces(raw.vertices * scale, raw.polygons, weld=True)
    seams = file_seams(raw).get("uv")
    if seams is None or raw.texture is None:
        raise InputError(
            'the file has no texture coordinates, so there is no pattern to take; leave pattern = "uv" out; --seams auto looks for seams'
        )
    if len(seams.names) > MOST_ISLANDS:
        raise InputError(
            f"{seams.describe()} are too many for a sewn pattern, which has at most {MOST_ISLANDS} pieces; {_RIGHT}"
        )
    lacking = int((~np.isfinite(raw.texture).all(axis=2) & (raw.polygons >= 0)).any(axis=1).sum())
    if lacking:
        raise InputError(
            f"{format_count(lacking, 'face')} of {len(raw.polygons):,} have no texture coordinates; {_RIGHT}"
        )
    farthest = float(np.nanmax(np.abs(raw.texture)))
    if farthest > _FARTHEST:
        raise InputError(
            f"its texture reaches out to {farthest:.3g}; a sewn pattern keeps within {_FARTHEST:g}; {_RIGHT}"
        )
    found = list[SewnPanel]()
    for number, title in enumerate(_titles(raw, seams.island, name)):
        rows = np.flatnonzero(seams.island == number)
        polygons, texture = raw.polygons[rows], raw.texture[rows]
        used = polygons >= 0
        places, corner = np.unique(texture[used], axis=0, return_inverse=True)
        corners = np.full(polygons.shape, -1, dtype=np.int64)
        corners[used] = corner.ravel()
        of_file = np.zeros(len(places), dtype=np.int64)
        of_file[corner.ravel()] = polygons[used]
        worn = raw.vertices[of_file] * scale
        if float(np.ptp(worn, axis=0).max()) < POSSIBLE[0]:
            continue
        surface = make_surface(worn, corners, name=title, weld=False, source=f"island {title!r}")
        # The last entry is that of corners that a face does not have.
        vertex = np.full(len(places) + 1, -1, dtype=np.int32)
        vertex[surface.input_index] = np.arange(len(surface.vertices))
        found.append(
            SewnPanel(
                surface=surface, cut=places[surface.input_index], unit="", polygons=rows.astype(np.int32),
                corners=vertex[corners], of_file=of_file[surface.input_index].astype(np.int32),
            )
        )  # fmt: skip
    if not found:
        raise InputError(
            f"every island of its texture is a crumb of less than {1e3 * POSSIBLE[0]:g} mm; is the unit right?"
        )
    areas = np.array([[panel.area, panel.worn_area] for panel in found])
    flat, worn_area = areas.sum(axis=0)
    if not flat > 0.0:
        raise InputError(f"the islands of its texture have no area; {_RIGHT}")
    unit = min(METRES_PER_UNIT, key=lambda each: abs(np.log(METRES_PER_UNIT[each] ** 2 * flat / worn_area)))
    metres = METRES_PER_UNIT[unit]
    ratio = metres**2 * flat / worn_area
    each = metres**2 * areas[:, 0] / np.maximum(areas[:, 1], 1e-300)
    counted = areas[:, 1] > COUNTED * worn_area
    if not (abs(ratio - 1.0) <= _TRUE_SIZE and (np.abs(each[counted] - 1.0) <= _TRUE_SIZE).all()):
        raise InputError(
            f"its texture is no pattern of true size: in {unit}, the nearest unit, it has {ratio:.2f} times the area of the cloth, single "
            f"islands {each[counted].min():.2f} to {each[counted].max():.2f} times; {1 - _TRUE_SIZE:g} to {1 + _TRUE_SIZE:g} would be "
            f"right; {_RIGHT}"
        )
    panels = list[SewnPanel]()
    for panel in found:
        cut = metres * panel.cut
        facing = area_vectors(cut, triangulate(panel.surface.faces)[0])[:, 2].sum()
        panels.append(replace(panel, cut=cut * [-1.0, 1.0] if facing < 0.0 else cut, unit=unit))
    for panel in panels:
        # Islands may lie over each other, as layers that are stacked in the plane do.
        own = overlap_area(panel.surface, panel.cut, np.empty(0, dtype=np.int32)) / panel.area
        if own > _OVERLAP:
            raise InputError(
                f"island {panel.surface.name!r} of its texture lies over itself with {100 * own:.1f} % of its area, or partly face down: "
                f"that is no pattern; {_RIGHT}"
            )
    return panels


def with_cuts(raw: RawMesh, panels: Sequence[SewnPanel], cuts: Sequence[FloatArray]) -> RawMesh:
    """Return the mesh of a file with other cuts of its panels as its texture; what belongs to no panel has none.

    Corners of faces that repair has dropped go with the nearest vertex of the old texture.

    Args:
        raw: the mesh of which they are the panels.
        panels: of :func:`sewn_panels`.
        cuts: for each of them #V by 2, in the unit of the old texture.
    """
    from scipy.spatial import cKDTree

    assert raw.texture is not None
    texture = np.full_like(raw.texture, np.nan)
    for panel, cut in zip(panels, cuts, strict=True):
        places, corners = raw.texture[panel.polygons], panel.corners
        known = corners >= 0
        near = cKDTree(places[known]).query(np.nan_to_num(places.reshape(-1, 2)))[1].reshape(corners.shape)
        texture[panel.polygons] = cut[corners[known][near]]
    return replace(raw, texture=texture)


def _titles(raw: RawMesh, island: np.ndarray, name: str) -> list[str]:
    """Return the name of each island: that of its group or material where each has its own, or a number."""
    count = int(island.max()) + 1
    for given in (raw.face_group, raw.face_material):
        if given is None:
            continue
        of = [int(np.bincount(given[0][island == number]).argmax()) for number in range(count)]
        own = [make_piece_name(given[1][each]) if given[1][each] else "" for each in of]
        if all(own) and len(set(own)) == count:
            return own
    return [f"{name}_{number + 1}" if count > 1 else name for number in range(count)]
