"""One piece in `frames.usdc`: its prims, and the topology and lines of its latest frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.export.geometry import Polylines, face_areas, polylines_of
from warpflat.export.usd_colours import VertexColours
from warpflat.export.usd_prims import MeshSamples, SampledLines
from warpflat.surface.mesh import Surface

__all__ = ["FIRST_FRAME", "FramePiece", "check_frame"]

FIRST_FRAME = 1


@dataclass(kw_only=True)
class FramePiece:
    """State of a piece: a few arrays of its size, whatever the number of frames."""

    name: str
    surface: Surface
    path: str
    colours: tuple[VertexColours, VertexColours]  # of surface and pattern; one and the same until a cut
    on_surface: MeshSamples
    on_pattern: MeshSamples
    surface_cuts: SampledLines
    pattern_lines: SampledLines
    pattern_cuts: SampledLines
    faces: IntArray
    to_surface: IntArray
    lines: dict[str, Polylines]
    cuts: dict[str, Polylines] = field(default_factory=dict)
    measures: dict[str, Any] = field(default_factory=dict)
    frames: int = 0
    last_positions: NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 2), dtype=np.float32))
    low: FloatArray = field(default_factory=lambda: np.full(2, np.inf))
    high: FloatArray = field(default_factory=lambda: np.full(2, -np.inf))

    def change_faces(self, faces: ArrayLike | None, count: int, what: str) -> bool:
        """Take over new faces of a pattern with `count` vertices, and return whether they differ from those before.

        Raises:
            ValueError: they are not the faces of the surface in the pattern's numbering.
        """
        if faces is None:
            return False
        new, own = np.ascontiguousarray(faces, dtype=np.int32), self.surface.faces
        if new is self.faces or np.array_equal(new, self.faces):
            return False
        used = own >= 0
        if new.shape != own.shape or not np.array_equal(new >= 0, used) or new.max() >= count:
            raise ValueError(f"{what}: the faces are not those of the surface in the pattern's numbering")
        to_surface = np.zeros(count, dtype=np.int32)
        to_surface[new[used]] = own[used]
        if not np.array_equal(to_surface[new[used]], own[used]):
            raise ValueError(f"{what}: a pattern vertex stands for two vertices of the surface")
        self.faces, self.to_surface = new, to_surface
        areas = face_areas(self.surface.vertices, own)
        self.colours = self.colours[0], VertexColours(new, areas, count)
        return True

    def change_lines(
        self, lines: Mapping[str, Any] | None, cuts: Mapping[str, Any] | None, count: int, *, new_faces: bool
    ) -> bool:
        """Take over new lines and cuts of a pattern with `count` vertices, and return whether they or the faces are new.

        Raises:
            ValueError: a line refers to other vertices.
        """
        if not new_faces and lines is None and cuts is None:
            return False
        self.lines = self.lines if lines is None else polylines_of(lines)
        self.cuts = self.cuts if cuts is None else polylines_of(cuts)
        for line, parts in (*self.lines.items(), *self.cuts.items()):
            if any(part.max() >= count or part.min() < 0 for part in parts):
                raise ValueError(
                    f"line {line!r} of piece {self.name!r} refers to vertices beyond the {count} positions"
                )
        return True

    def cuts_on_surface(self) -> dict[str, Polylines]:
        """Return the cuts in the surface's numbering, where both sides of a crack are one line."""
        return {key: _on_surface(parts, self.to_surface) for key, parts in self.cuts.items()}


def check_frame(what: str, flat: NDArray[np.float32], density: NDArray[np.float32], face_count: int) -> None:
    """Check the shapes and values of a frame.

    Raises:
        ValueError: positions or energies are of a wrong shape, or not finite.
    """
    if flat.ndim != 2 or flat.shape[1] != 2 or len(flat) == 0:
        raise ValueError(f"{what}: positions must be #P by 2, not {flat.shape}")
    if density.shape != (face_count,):
        raise ValueError(f"{what}: {density.shape} energy densities for {face_count} faces")
    if not (np.isfinite(flat).all() and np.isfinite(density).all()):
        raise ValueError(f"{what}: positions or energy densities are not finite")


def _on_surface(parts: Polylines, to_surface: IntArray) -> Polylines:
    """Return lines in the surface's numbering, where both sides of a crack are one line."""
    return [
        np.array(line, dtype=np.int32) for line in dict.fromkeys(tuple(to_surface[part].tolist()) for part in parts)
    ]
