"""The surface: a 3D mesh of quads and/or triangles with named feature lines."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.sums import range_offsets

__all__ = [
    "Surface",
    "join_surfaces",
    "once_per_faces",
    "once_per_surface",
    "read_only",
    "store_results",
]

Result = TypeVar("Result")

_UNKNOWN: Any = object()


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """One piece of surface in space, checked and ready to be flattened.

    Made by :func:`warpflat.make_surface`, which repairs and checks it; nothing checks it again.

    Attributes:
        vertices: #V by 3, positions [m], float64.
        faces: #F by 4, vertex indices, int32, consistently wound; a triangle has -1 in its last column.
        lines: feature lines by name: vertex indices along mesh edges, int32; a closed line repeats its first vertex.
        name: of the piece, in files and messages.
        input_vertices: #I by 3, positions [m] as they were read, in their order, for files that refer to it; the vertices if not given.
        input_index: #V, for each vertex its row in `input_vertices`.
        notes: repairs made when it was read, one sentence each.
        sources: files from which it was read; its own results never replace them.
        of_faces: results of functions of the faces alone (see `once_per_faces`).
    """

    vertices: FloatArray
    faces: IntArray
    lines: Mapping[str, IntArray] = field(default_factory=dict)
    name: str = "piece"
    input_vertices: FloatArray = None  # type: ignore[assignment]  # never None once made
    input_index: IntArray = None  # type: ignore[assignment]
    notes: tuple[str, ...] = ()
    sources: tuple[Path, ...] = ()
    of_faces: dict[str, Any] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        """Take the vertices as those that were read, if these are not given."""
        if self.input_vertices is None:
            object.__setattr__(self, "input_vertices", self.vertices)
            object.__setattr__(self, "input_index", np.arange(len(self.vertices), dtype=np.int32))

    def __repr__(self) -> str:
        lines = f", lines {', '.join(self.lines)}" if len(self.lines) in range(1, 9) else f", {len(self.lines)} lines"
        return f"<Surface {self.name!r}: {len(self.vertices):,} vertices, {len(self.faces):,} faces{lines}>"

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to pickle, without results that can be computed again."""
        return {**vars(self), "of_faces": {}}

    @property
    def is_quad(self) -> BoolArray:
        """#F, true for quads."""
        return self.faces[:, 3] >= 0


def join_surfaces(surfaces: Sequence[Surface]) -> Surface:
    """Return several surfaces as one, without their lines: vertices and faces of the first, then of the next."""
    first = range_offsets([len(surface.vertices) for surface in surfaces])
    return Surface(
        vertices=np.concatenate([surface.vertices for surface in surfaces]),
        faces=np.concatenate(
            [np.where(s.faces >= 0, s.faces + at, -1) for s, at in zip(surfaces, first, strict=False)]
        ),
        name=" + ".join(surface.name for surface in surfaces),
    )


def once_per_surface(measure: Callable[[Surface], Result]) -> Callable[[Surface], Result]:
    """Decorate a function of a surface: its result is computed once and kept as long as the surface lives. Surfaces do not change."""
    known: WeakKeyDictionary[Surface, Result] = WeakKeyDictionary()
    _known_of_surfaces[_name(measure)] = known

    @wraps(measure)
    def remembered(surface: Surface) -> Result:
        if surface not in known:
            known[surface] = measure(surface)
        return known[surface]

    return remembered


_known_of_surfaces: dict[str, WeakKeyDictionary[Surface, Any]] = {}


def store_results(surface: Surface, results: Mapping[Callable[[Surface], Any], Any]) -> None:
    """Store the results that functions decorated with `once_per_surface` would compute of a surface."""
    for measure, result in results.items():
        _known_of_surfaces[_name(measure)][surface] = result


def once_per_faces(measure: Callable[[Surface], Result]) -> Callable[[Surface], Result]:
    """Decorate a function of a surface whose result does not depend on positions: it is computed once per array of faces.

    A surface made from another by `dataclasses.replace`, with the same array of faces, shares its results.
    """
    name = _name(measure)

    @wraps(measure)
    def remembered(surface: Surface) -> Result:
        known = surface.of_faces
        if known.get("faces") is not surface.faces:
            known = {"faces": surface.faces}
            object.__setattr__(surface, "of_faces", known)
        # Read only once, as another thread may drop it.
        result: Result = known.get(name, _UNKNOWN)
        if result is _UNKNOWN:
            result = known[name] = measure(surface)
        return result

    return remembered


def _name(measure: Callable[..., Any]) -> str:
    return f"{measure.__module__}.{measure.__qualname__}"


def read_only(arrays: Result) -> Result:
    """Make the arrays of an object read-only and return it: kept results are shared."""
    for value in vars(arrays).values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return arrays
