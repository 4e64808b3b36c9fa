"""Maps of strain, energy and drape: values, their scale and their colours."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from warpflat.app.studio.frame import PieceFrame
from warpflat.core import FloatArray, IntArray
from warpflat.flat import shear_angles
from warpflat.garment import Drape
from warpflat.pattern import LEAST_GAP, SMALLEST_SCALE, Scale, VertexColours, energy_scale, face_areas

__all__ = ["MAPS", "MapScale", "drape_gaps", "drape_scale", "face_values", "piece_scale", "vertex_values"]

#: Titles of the maps, with their units.
MAPS: Mapping[str, str] = {
    "energy": "strain energy [J/m²]",
    "warp": "strain along the warp, as worn [%]",
    "weft": "strain along the weft, as worn [%]",
    "shear": "shear, as worn [degrees]",
    "drape": "drape: gap to the body [mm]",
}
# A map of less than this shows nothing [%, degrees].
_LEAST_STRAIN = 0.01


@dataclass(frozen=True, kw_only=True)
class MapScale(Scale):
    """The scale of a map, in its unit.

    Attributes:
        kind: key of `MAPS`.
    """

    kind: str

    @property
    def is_blank(self) -> bool:
        """Whether there is nothing to be seen: everything is smaller than what counts."""
        return self.high <= {"energy": SMALLEST_SCALE, "drape": 0.0}.get(self.kind, _LEAST_STRAIN)


def face_values(kind: str, frame: PieceFrame) -> FloatArray:
    """Return the values of a map of a piece, #F, in the map's unit."""
    if kind == "energy":
        return frame.worn.energy_density
    strain = frame.worn.strain
    return shear_angles(strain) if kind == "shear" else 100.0 * strain[:, 0 if kind == "warp" else 1]


def piece_scale(kind: str, frames: Iterable[PieceFrame]) -> MapScale:
    """Return the scale of a map of several pieces, whose ends are round numbers."""
    shown = list(frames)
    values = np.concatenate([face_values(kind, frame) for frame in shown])
    areas = np.concatenate([frame.worn.area for frame in shown])
    if kind == "energy":
        return MapScale(kind=kind, high=energy_scale(values, areas))
    most = Scale.both_ways(values, areas, _LEAST_STRAIN).high
    step = 10.0 ** np.floor(np.log10(most))
    most = float(np.ceil(most / step * 2.0 - 1e-9) / 2.0 * step)
    return MapScale(kind=kind, low=-most, high=most, colours="RdBu_r")


def drape_gaps(drape: Drape, piece: str) -> FloatArray:
    """Return the gap between body and cloth at each vertex of a piece's pattern, #P [mm]."""
    return 1e3 * drape.gap[drape.cloth.welded[drape.cloth.piece_vertices[piece]]]


def drape_scale(drape: Drape) -> MapScale:
    """Return the scale of the gap, which ends at a whole number."""
    widest = Scale.from_zero(1e3 * drape.gap, drape.areas, LEAST_GAP).high
    return MapScale(kind="drape", high=float(np.ceil(widest)), colours="YlOrRd")


def vertex_values(values: FloatArray, positions: FloatArray, faces: IntArray) -> FloatArray:
    """Return the mean of the faces' values (#F) around each vertex, #P.

    Args:
        values: #F.
        positions: #P by 2 or 3 [m].
        faces: #F by 4.
    """
    return VertexColours(faces, face_areas(positions, faces), len(positions)).mean(values).astype(np.float64)
