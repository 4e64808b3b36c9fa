"""Maps of strain, energy and drape: values, their scale and their colours."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from warpflat.app.studio.frame import PieceFrame
from warpflat.core import FloatArray, IntArray, weighted_percentile
from warpflat.flat import shear_angles
from warpflat.garment import Drape
from warpflat.pattern import SMALLEST_SCALE, corner_average, energy_colours, energy_scale, face_areas

__all__ = ["MAPS", "Scale", "drape_gaps", "drape_scale", "face_values", "piece_scale", "vertex_values"]

#: Titles of the maps, with their units.
MAPS: Mapping[str, str] = {
    "energy": "strain energy [J/m²]",
    "warp": "strain along the warp, as worn [%]",
    "weft": "strain along the weft, as worn [%]",
    "shear": "shear, as worn [degrees]",
    "drape": "drape: gap to the body [mm]",
}
# Strains beyond what 98 % of the cloth has get the last colour; a map of less than this shows nothing [%, degrees].
_SHARE, _LEAST_STRAIN = 0.98, 0.01
_LEAST_GAP = 5.0
# Blue is cloth that is pushed together, red is cloth that is stretched (ColorBrewer's RdBu and YlOrRd).
_BOTH_WAYS = np.array([[33, 102, 172], [146, 197, 222], [247, 247, 247], [244, 165, 130], [178, 24, 43]]) / 255.0
_ONE_WAY = np.array([[255, 255, 229], [254, 217, 118], [253, 141, 60], [227, 26, 28], [128, 0, 38]]) / 255.0


@dataclass(frozen=True, kw_only=True)
class Scale:
    """The scale of a map.

    Attributes:
        kind: key of `MAPS`.
        low, high: its ends, in the map's unit.
    """

    kind: str
    low: float
    high: float

    @property
    def is_blank(self) -> bool:
        """Whether there is nothing to be seen: everything is smaller than what counts."""
        return self.high <= {"energy": SMALLEST_SCALE, "drape": 0.0}.get(self.kind, _LEAST_STRAIN)

    def colours(self, values: FloatArray) -> FloatArray:
        """Return sRGB colours (#N by 3, 0 to 1) of values (#N)."""
        if self.kind == "energy":
            return energy_colours(values, self.high)
        anchors = _ONE_WAY if self.kind == "drape" else _BOTH_WAYS
        place = np.clip((values - self.low) / (self.high - self.low), 0.0, 1.0) * (len(anchors) - 1)
        return np.column_stack([np.interp(place, np.arange(len(anchors)), channel) for channel in anchors.T])


def face_values(kind: str, frame: PieceFrame) -> FloatArray:
    """Return the values of a map of a piece, #F, in the map's unit."""
    if kind == "energy":
        return frame.worn.energy_density
    strain = frame.worn.strain
    return shear_angles(strain) if kind == "shear" else 100.0 * strain[:, 0 if kind == "warp" else 1]


def piece_scale(kind: str, frames: Iterable[PieceFrame]) -> Scale:
    """Return the scale of a map of several pieces: 98 % of the cloth lies within it."""
    shown = list(frames)
    values = np.concatenate([face_values(kind, frame) for frame in shown])
    areas = np.concatenate([frame.worn.area for frame in shown])
    if kind == "energy":
        return Scale(kind=kind, low=0.0, high=energy_scale(values, areas))
    most = max(weighted_percentile(np.abs(values), areas, _SHARE), _LEAST_STRAIN)
    step = 10.0 ** np.floor(np.log10(most))
    most = float(np.ceil(most / step * 2.0 - 1e-9) / 2.0 * step)
    return Scale(kind=kind, low=-most, high=most)


def drape_gaps(drape: Drape, piece: str) -> FloatArray:
    """Return the gap between body and cloth at each vertex of a piece's pattern, #P [mm]."""
    return 1e3 * drape.gap[drape.cloth.welded[drape.cloth.piece_vertices[piece]]]


def drape_scale(drape: Drape) -> Scale:
    """Return the scale of the gap: 98 % of the cloth lies within it."""
    widest = max(_LEAST_GAP, 1e3 * weighted_percentile(drape.gap, drape.areas, _SHARE))
    return Scale(kind="drape", low=0.0, high=float(np.ceil(widest)))


def vertex_values(values: FloatArray, positions: FloatArray, faces: IntArray) -> FloatArray:
    """Return the mean of the faces' values (#F) around each vertex, #P.

    Args:
        values: #F.
        positions: #P by 2 or 3 [m].
        faces: #F by 4.
    """
    face, slot = np.nonzero(faces >= 0)
    weights = face_areas(positions, faces)
    return corner_average(values, weights, face.astype(np.int32), faces[face, slot], len(positions))
