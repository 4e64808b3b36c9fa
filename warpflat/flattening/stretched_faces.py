"""Faces that the pattern has opened: far larger flat than on the body, where the cloth shears too easily to hold them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.text import counted
from warpflat.model.network import SpringNetwork
from warpflat.model.strain import face_areas

__all__ = ["StretchedFaces", "find_stretched_faces"]

# Faces so many times as large as on the body are told of, if they take up this share of the body's area too much.
_OPENED = 2.0
_MATTERS = 1e-3


@dataclass(frozen=True, kw_only=True)
class StretchedFaces:
    """Faces that are more than twice as large in the pattern as on the body.

    Attributes:
        faces: how many.
        area_m2: theirs on the body.
        flat_area_m2: theirs in the pattern.
        times: how many times as large the worst one is.
        face: its number, from 0.
        at: the worst one's middle on the body [m].
        in_pattern: and in the pattern [m].
    """

    faces: int
    area_m2: float
    flat_area_m2: float
    times: float
    face: int
    at: tuple[float, float, float]
    in_pattern: tuple[float, float]

    def words(self, model: str) -> str:
        """A note on them, and what may help."""
        body, flat = ", ".join(f"{100 * x:.1f}" for x in self.at), ", ".join(f"{1e3 * x:.0f}" for x in self.in_pattern)
        springs = 'model = "springs" or ' if model == "membrane" else ""
        return (
            f"{counted(self.faces, 'face')} of {1e4 * self.area_m2:.3g} cm2 on the body take up {1e4 * self.flat_area_m2:.3g} cm2 of "
            f"the pattern: face {self.face} around ({body}) cm, in the pattern ({flat}) mm, {self.times:.3g} times its area; the cloth "
            f"would have to shear so far there: make a dart or a seam, or take {springs}a fabric that shears less"
        )

    def as_dict(self) -> dict[str, Any]:
        """The entry `opened` in `metrics.json`."""
        return {**vars(self), "at": list(self.at), "in_pattern": list(self.in_pattern)}


def find_stretched_faces(network: SpringNetwork, positions: FloatArray) -> StretchedFaces | None:
    """Find the faces of a pattern that are more than twice as large as on the body; None where they make up next to nothing.

    Args:
        network: the piece's springs, with its cuts made.
        positions: #P by 2, the pattern [m].
    """
    surface = network.surface
    flat, body = face_areas(network, positions)
    chosen = np.flatnonzero(flat > _OPENED * body)
    if (flat - body)[chosen].sum() <= _MATTERS * body.sum():
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
