"""A garment whose sewn pattern is known and taken as it is, compared with what flattening gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.input_files import guarded
from warpflat.core.polyline import polyline_length
from warpflat.fabric.fabric import DEFAULT_FABRIC, Fabric
from warpflat.fabric.library import as_fabric
from warpflat.flattening.as_cut import CutPattern, distances_laid, laid_as_cut
from warpflat.garment.garment import Garment
from warpflat.garment.sew_pieces import meeting_borders, name_seams
from warpflat.garment.to_pattern import pattern_of_garment
from warpflat.pattern.pieces import Pattern
from warpflat.surface.io.sewn_panels import SewnPanel, read_sewn_panels
from warpflat.surface.mesh import Surface
from warpflat.surface.triangles import triangulate

__all__ = ["WornPattern", "garment_as_cut", "read_cut_pattern"]


def garment_as_cut(
    panels: Sequence[SewnPanel],
    surfaces: Sequence[Surface],
    *,
    fabric: Fabric,
    name: str,
    flattened: Garment | None = None,
    device: str | None = None,
) -> Garment:
    """Return the garment of panels as they were cut, sewn where their borders meet as it is worn.

    Args:
        panels: with their patterns.
        surfaces: theirs, with their lines.
        fabric: of all of them.
        name: of the garment.
        flattened: the same pieces as flattening gives them, to be compared.
        device: Warp device.
    """
    pieces = {
        surface.name: laid_as_cut(surface, panel.cut, fabric=fabric, device=device)
        for panel, surface in zip(panels, surfaces, strict=True)
    }
    seams = []
    for pair in meeting_borders({surface.name: surface for surface in surfaces}):
        one, other = (
            polyline_length(pieces[piece].positions[row]) for piece, row in zip(pair.pieces, pair.vertices, strict=True)
        )
        seams.append(replace(pair, sides=pair.pieces, ratio=one / other, eased=True))
    compared = None
    if flattened is not None:
        compared = CutPattern(
            unit=panels[0].unit,
            area_ratio=sum(panel.area for panel in panels) / sum(panel.worn_area for panel in panels),
            distances={
                each: distances_laid(flattened.pieces[each].positions, piece.positions)
                for each, piece in pieces.items()
            },
        )
    return Garment(name=name, pieces=pieces, stitching=seams, as_cut=compared)


@dataclass(frozen=True, kw_only=True, eq=False)
class WornPattern:
    """The sewn pattern of a worn garment's file.

    Attributes:
        pattern: pieces and seams.
        surfaces: by piece how it is worn: #V by 3 [m], the same vertices in the pattern, #V by 2 [m], and triangles, #T by 3.
    """

    pattern: Pattern
    surfaces: Mapping[str, tuple[FloatArray, FloatArray, IntArray]]


def read_cut_pattern(path: str | PathLike[str], *, units: str | None, name: str) -> WornPattern:
    """Read the sewn pattern that a worn garment's file has as its texture; its pieces name no cloth.

    Args:
        path: of a mesh.
        units: of its points, where it does not say.
        name: of the pattern.

    Raises:
        InputError: one line that names the file.
    """
    panels = read_sewn_panels(path, units=units, name=name)
    surfaces = name_seams([panel.surface for panel in panels])
    garment = garment_as_cut(panels, surfaces, fabric=as_fabric(DEFAULT_FABRIC), name=name)
    with guarded(Path(path), "mesh"):
        pattern, _ = pattern_of_garment({"": garment}, name=name, twice=False)
    pieces = {size: [replace(piece, fabric="") for piece in row] for size, row in pattern.pieces.items()}
    return WornPattern(
        pattern=replace(pattern, pieces=pieces),
        surfaces={
            each: (piece.surface.vertices, piece.positions, triangulate(piece.surface.faces)[0])
            for each, piece in garment.pieces.items()
        },
    )
