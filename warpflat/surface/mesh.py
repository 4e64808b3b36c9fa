"""The surface: a 3D mesh of quads and/or triangles with named feature lines."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray, IntArray

__all__ = ["Surface", "forget", "is_large", "known_of_faces", "once_per_faces", "once_per_surface", "read_only", "tell"]

Result = TypeVar("Result")

_UNKNOWN: Any = object()


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """One piece of surface in space, checked and ready to be flattened.

    Made by :func:`warpflat.make_surface`, which validates and mends; nothing checks it again.

    Attributes:
        vertices: #V by 3, positions [m], float64.
        faces: #F by 4, vertex indices, int32, consistently wound; a triangle has -1 in its last column.
        lines: feature lines by name: vertex indices along mesh edges, int32; a closed line repeats its first vertex.
        name: what the piece is called in files and messages.
        input_vertices: #I by 3, positions [m] as they were read, in their order, for files that refer to it.
        input_index: #V, for each vertex its row in `input_vertices`.
        notes: what was mended on the way in, one sentence each.
        sources: files from which it was read; none of them is ever replaced by its own results.
        of_faces: what has been worked out of the faces (see `once_per_faces`).
    """

    vertices: FloatArray
    faces: IntArray
    lines: Mapping[str, IntArray] = field(default_factory=dict)
    name: str = "piece"
    input_vertices: FloatArray
    input_index: IntArray
    notes: tuple[str, ...] = ()
    sources: tuple[Path, ...] = ()
    of_faces: dict[str, Any] = field(default_factory=dict, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Without what can be worked out again."""
        return {**vars(self), "of_faces": {}}

    @property
    def is_quad(self) -> BoolArray:
        """#F, true for quads."""
        return self.faces[:, 3] >= 0


def once_per_surface(measure: Callable[[Surface], Result]) -> Callable[[Surface], Result]:
    """A function of a surface, worked out once for each and kept as long as that lives; surfaces do not change."""
    known: WeakKeyDictionary[Surface, Result] = WeakKeyDictionary()
    _known_of_surfaces[_name(measure)] = known

    @wraps(measure)
    def remembered(surface: Surface) -> Result:
        if surface not in known:
            known[surface] = measure(surface)
        return known[surface]

    return remembered


_known_of_surfaces: dict[str, WeakKeyDictionary[Surface, Any]] = {}


def tell(surface: Surface, results: Mapping[Callable[[Surface], Any], Any]) -> None:
    """What functions `once_per_surface` would find out of a surface."""
    for measure, result in results.items():
        _known_of_surfaces[_name(measure)][surface] = result


def once_per_faces(measure: Callable[[Surface], Result]) -> Callable[[Surface], Result]:
    """The same of what the places of the vertices do not change: a surface that was made from another by `dataclasses.replace`, with the
    same array of faces, has its results too."""
    name = _name(measure)

    @wraps(measure)
    def remembered(surface: Surface) -> Result:
        known = surface.of_faces
        if known.get("faces") is not surface.faces:
            known = known_of_faces(surface.faces)
            object.__setattr__(surface, "of_faces", known)
        # Asked for once: another thread may forget it.
        result: Result = known.get(name, _UNKNOWN)
        if result is _UNKNOWN:
            result = known[name] = measure(surface)
        return result

    return remembered


def forget(surface: Surface, measure: Callable[[Surface], Any]) -> None:
    """Let go of what a function `once_per_faces` has worked out of a surface; it is worked out again when it is next asked for."""
    surface.of_faces.pop(_name(measure), None)


def known_of_faces(faces: IntArray, results: Mapping[Callable[[Surface], Any], Any] | None = None) -> dict[str, Any]:
    """`Surface.of_faces` for surfaces that have these faces (#F by 4): what functions `once_per_faces` would find out of them."""
    return {"faces": faces} | {_name(measure): result for measure, result in (results or {}).items()}


def _name(measure: Callable[..., Any]) -> str:
    return f"{measure.__module__}.{measure.__qualname__}"


def read_only(arrays: Result) -> Result:
    """The same object, its arrays not to be written to any more: what is kept for a surface is shared by all who ask for it."""
    for value in vars(arrays).values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return arrays


# On the way to the relaxation of more triangles so much is freed that giving it back is worth a twentieth of the time.
_MUCH_IS_FREED = 50_000


def is_large(surface: Surface) -> bool:
    """Whether what is worked out on the way to a piece's relaxation is worth to be let go of."""
    return len(surface.vertices) > _MUCH_IS_FREED
