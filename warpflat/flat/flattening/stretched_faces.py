"""Stretched faces: far larger in the pattern than on the body, where the cloth shears too easily."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.text import area_words, format_count
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.model.strain import face_areas

__all__ = ["StretchedFaces", "find_stretched_faces"]

# A face is stretched from this many times its area on the body.
_STRETCHED = 2.0
# The area that stretched faces take up too much is reported from this share of the body's area.
_LEAST_SHARE = 1e-3


@dataclass(frozen=True, kw_only=True)
class StretchedFaces:
    """Faces that are more than twice as large in the pattern as on the body.

    Attributes:
        faces: their number.
        area_m2: their area on the body.
        flat_area_m2: their area in the pattern.
        times: flat area over body area of the worst face.
        face: index of the worst face, from 0.
        at: middle of the worst face on the body [m].
        in_pattern: middle of the worst face in the pattern [m].
    """

    faces: int
    area_m2: float
    flat_area_m2: float
    times: float
    face: int
    at: tuple[float, float, float]
    in_pattern: tuple[float, float]

    def message(self) -> str:
        """Return a warning about the faces, with what may help."""
        body, flat = ", ".join(f"{100 * x:.1f}" for x in self.at), ", ".join(f"{1e3 * x:.0f}" for x in self.in_pattern)
        return (
            f"{format_count(self.faces, 'face')} of {area_words(self.area_m2)} on the body take up "
            f"{area_words(self.flat_area_m2)} of the pattern: face {self.face} around ({body}) cm, "
            f"in the pattern ({flat}) mm, {self.times:.3g} times its area; the cloth would have to shear so far "
            f"there: make a dart or a seam, or take a fabric that shears less"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the entry `opened` of `metrics.json`."""
        return {**vars(self), "at": list(self.at), "in_pattern": list(self.in_pattern)}


def find_stretched_faces(network: SpringNetwork, positions: FloatArray) -> StretchedFaces | None:
    """Find the faces of a pattern that are more than twice as large as on the body; None if they take up hardly any area.

    Args:
        network: the piece's springs, with its cuts made.
        positions: #P by 2, the pattern [m].
    """
    surface = network.surface
    flat, body = face_areas(network, positions)
    chosen = np.flatnonzero(flat > _STRETCHED * body)
    if (flat - body)[chosen].sum() <= _LEAST_SHARE * body.sum():
        return None
    worst = int(chosen[np.argmax((flat / np.maximum(body, 1e-300))[chosen])])
    corners = surface.faces[worst][surface.faces[worst] >= 0]
    x, y, z = surface.vertices[corners].mean(axis=0).tolist()
    u, v = positions[corners].mean(axis=0).tolist()
    return StretchedFaces(
        faces=len(chosen),
        area_m2=float(body[chosen].sum()),
        flat_area_m2=float(flat[chosen].sum()),
        times=float(flat[worst] / max(body[worst], 1e-300)),
        face=worst,
        at=(x, y, z),
        in_pattern=(u, v),
    )
