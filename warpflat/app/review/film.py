"""`frames.usdc` is packed for a page: only layouts that were computed, quantised, as differences, compressed.

USD interpolates frames between two of them linearly, and so does the page.
"""

from __future__ import annotations

import base64
import zlib
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core import (
    FARTHEST,
    UNREADABLE,
    FloatArray,
    InputError,
    IntArray,
    check_layers,
    read_apart,
    reading,
)
from warpflat.flat import border_edges, triangulate
from warpflat.pattern import (
    DRAFTED,
    DRAFTED_CLOTH,
    LEAST_GAP,
    LEAST_PRESSURE,
    SKIN,
    Scale,
    VertexColours,
    energy_colours,
    face_areas,
    part_path,
)

__all__ = ["MAPS", "FilmPiece", "Shape", "open_film", "pack_film", "pack_foreign_film"]

# Bytes of all layouts before compression; beyond, every second frame is left out, or every third ...
_ROOM = 4_000_000
# Bytes of a vertex in a layout: two coordinates of 16 bits, and a colour.
_VERTEX = 5
_COLOURS = 256
#: Maps beside energy and strain, by the name of their primvar: unit on the page, how many of these the file's unit is, and the least
#: upper end of a scale.
MAPS: Mapping[str, tuple[str, float, float]] = {"pressure": ("Pa", 1.0, LEAST_PRESSURE), "gap": ("mm", 1e3, LEAST_GAP)}
# No value of a map is larger.
_MOST_OF_MAP = 1e9
# A body of more vertices than these is not shown.
_MOST_OF_BODY = 100_000
# Of zlib: the last level takes eight times as long as this one, and spares a twentieth of the bytes.
_LEVEL = 6


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """A piece in one topology.

    Attributes:
        faces: #F by 4, in the pattern's numbering.
        surface: #P by 3, the place on the surface of each vertex of the pattern [m].
    """

    faces: IntArray
    surface: FloatArray


class FilmPiece:
    """One piece of a `frames.usdc`."""

    def __init__(self, stage: Any, prim: Any) -> None:
        from pxr import UsdGeom

        self.stage = stage  # prims live as long as it does
        self._pattern = UsdGeom.Mesh(stage.GetPrimAtPath(part_path(str(prim.GetPath()), "pattern")))
        self._surface = UsdGeom.Mesh(stage.GetPrimAtPath(part_path(str(prim.GetPath()), "surface")))
        self.name = prim.GetDisplayName() or prim.GetName()
        self.prim = prim
        self.times = []
        if self._pattern and self._pattern.GetPointsAttr().GetNumTimeSamples():
            numbers = prim.GetAttribute("warpflat:stage_number")
            last = max(numbers.GetTimeSamples() if numbers else (), default=stage.GetEndTimeCode())
            self.times = list(range(int(stage.GetStartTimeCode()), int(last) + 1))
        self.changes = [int(time) for time in self._pattern.GetFaceVertexIndicesAttr().GetTimeSamples()]
        place = UsdGeom.Xformable(self._pattern).ComputeLocalToWorldTransform(0.0).ExtractTranslation()
        self.offset = [float(value) for value in place]
        colour = self._pattern.GetDisplayColorPrimvar()
        self.scale = float(colour.GetAttr().GetCustomData().get("rangeMax", 1.0))
        tags = prim.GetAttribute("warpflat:interpolated")
        self.computed = [time for time in self.times if not (tags and tags.Get(time))]
        primvars = UsdGeom.PrimvarsAPI(self._pattern)
        self._density = primvars.GetPrimvar("strainEnergyDensity").GetAttr()
        #: Further maps, #F each: values, and in which state of the cloth they hold.
        self.maps: dict[str, tuple[FloatArray, str]] = {}
        for key in MAPS:
            attribute = primvars.GetPrimvar(key).GetAttr()
            if attribute and attribute.HasAuthoredValue():
                state = str(attribute.GetCustomData().get("state", ""))
                self.maps[key] = np.array(attribute.Get(), dtype=np.float64), state

    @cached_property
    def shapes(self) -> list[Shape]:
        """The topologies, one after the other."""
        on_surface = np.array(self._surface.GetFaceVertexIndicesAttr().Get(), dtype=np.int32)
        space = np.array(self._surface.GetPointsAttr().Get(), dtype=np.float64)
        shapes = []
        for time in self.changes:
            counts = np.asarray(self._pattern.GetFaceVertexCountsAttr().Get(time))
            corners = np.array(self._pattern.GetFaceVertexIndicesAttr().Get(time), dtype=np.int32)
            origin = np.zeros(int(corners.max()) + 1, dtype=np.int32)
            origin[corners] = on_surface
            shapes.append(Shape(faces=_faces(counts, corners), surface=space[origin]))
        return shapes

    def number(self, time: int) -> int:
        """Return the number of the topology at a frame."""
        return max(bisect_right(self.changes, time) - 1, 0)

    def positions(self, time: int) -> FloatArray:
        """Return the pattern at a frame, #P by 2 [m]."""
        count = len(self.shapes[self.number(time)].surface)
        return np.array(self._pattern.GetPointsAttr().Get(time), dtype=np.float64)[:count, :2]

    def density(self, time: int) -> FloatArray:
        """Return the energies at a frame, #F [J/m2]."""
        return np.array(self._density.Get(time), dtype=np.float64)

    def key_frames(self) -> list[int]:
        """Return the computed frames without those at which the piece stands still, before and after; all others follow from them."""
        points = [np.array(self._pattern.GetPointsAttr().Get(time)) for time in self.computed]
        moves = [True, *(not np.array_equal(a, b) for a, b in pairwise(points)), True]
        return [time for time, moved in zip(self.computed, pairwise(moves), strict=True) if any(moved)]

    def measure(self, key: str, time: int) -> Any:
        """Return a measure of a frame, None if there is none."""
        attribute = self.prim.GetAttribute(f"warpflat:{key}")
        return attribute.Get(time) if attribute else None


def _faces(counts: NDArray[Any], corners: NDArray[Any]) -> IntArray:
    """Return the faces (#F by 4, -1 as the fourth of a triangle) whose corners stand one after the other."""
    faces = np.full((len(counts), 4), -1, dtype=np.int32)
    faces[np.arange(4) < counts[:, None]] = corners
    return faces


def open_film(path: Path) -> list[FilmPiece]:
    """Open the pieces of a `frames.usdc` that have frames.

    Raises:
        InputError: it is no USD file.
    """
    from pxr import Tf, Usd

    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise InputError("is not a USD file that can be opened; run the scene again") from error
    found = [
        FilmPiece(stage, prim)
        for prim in stage.GetDefaultPrim().GetChildren()
        if stage.GetPrimAtPath(part_path(str(prim.GetPath()), "pattern"))
    ]
    return [piece for piece in found if piece.times]


def pack_foreign_film(path: Path) -> dict[str, Any] | None:
    """Pack a film of a folder that others may have changed: it is read in a process of its own, every frame of it.

    Raises:
        InputError: it cannot be read as a film.
    """
    packed: dict[str, Any] | None
    with reading(path, "film"):
        packed = read_apart(f"{__name__}:read_whole_film", path)
    return packed


def read_whole_film(path: Path) -> dict[str, Any] | None:
    """Read all frames of a film, and pack it.

    Raises:
        InputError: without the file's name: it is no film. Any error of USD is the file's fault, of whatever type it is.
    """
    try:
        check_layers(path)
        pieces = open_film(path)
        for piece in pieces:
            for time in piece.times:
                faces = piece.shapes[piece.number(time)].faces
                if not np.abs(piece.positions(time)).max() < FARTHEST:
                    raise ValueError("a point that is no number")
                if len(piece.density(time)) != len(faces):
                    raise ValueError("energies of other faces")
                if any(len(values) != len(faces) for values, _ in piece.maps.values()):
                    raise ValueError("a map of other faces")
            if not all(np.abs(values).max(initial=0.0) < _MOST_OF_MAP for values, _ in piece.maps.values()):
                raise ValueError("a value of a map that is no number")
        return pack_film(pieces)
    except InputError:
        raise
    except Exception as error:
        raise InputError(UNREADABLE) from error


def pack_film(pieces: Sequence[FilmPiece]) -> dict[str, Any] | None:
    """Pack a film for the page's viewer; None if even two frames of it are too large.

    The entry `data` is the base64 text of what `zlib` has compressed; `pieces` says what lies in it, in its order.
    """
    # Frames are taken evenly, with those before and after each change of topology, as many as there is room for.
    times, keys = pieces[0].times, {piece.name: piece.key_frames() for piece in pieces}
    for stride in range(1, len(times) + 1):
        kept = {*times[::stride], times[-1]}
        for piece in pieces:
            kept |= {time for change in piece.changes for time in (change - 1, change) if time >= times[0]}
        shown, stored = sorted(kept), {name: list[int]() for name in keys}
        for name, own in keys.items():
            for time in shown:
                after = bisect_left(own, time)
                # Layouts of keys, and between keys of which one is not shown.
                if own[after] == time or not kept.issuperset(own[after - 1 : after + 1]):
                    stored[name].append(time)
        vertices = sum(len(stored[piece.name]) * len(piece.shapes[-1].surface) for piece in pieces)
        if _VERTEX * vertices <= _ROOM:
            break
    else:
        return None
    # The maps that all pieces have, each with its unit on the page, its state, and the upper end of its scale there.
    maps = dict[str, dict[str, Any]]()
    for key, (unit, factor, least) in MAPS.items():
        if not all(key in piece.maps for piece in pieces):
            continue
        values = np.concatenate([piece.maps[key][0] for piece in pieces])
        areas = np.concatenate([face_areas(piece.shapes[0].surface, piece.shapes[0].faces) for piece in pieces])
        high = Scale.from_zero(factor * values, areas, least).high
        maps[key] = {"unit": unit, "high": high, "state": pieces[0].maps[key][1]}
    packer = zlib.compressobj(_LEVEL)
    parts, entries = list[bytes](), list[dict[str, Any]]()
    for piece in pieces:
        entry, blocks = _packed(piece, stored[piece.name], maps)
        entries.append(entry)
        parts += [packer.compress(block) for block in blocks]
    parts.append(packer.flush())
    first, computed = pieces[0], set(pieces[0].computed)
    still = _packed_still(first.stage)
    table = np.round(255.0 * energy_colours(np.arange(_COLOURS) / (_COLOURS - 1), 1.0)).astype(np.uint8)
    return {
        "frames": shown,
        "of": first.times[-1],
        "rate": 24,
        "stages": [first.measure("stage", time) or "" for time in shown],
        "computed": [time in computed for time in shown],
        "scale": first.scale,
        "colours": base64.b64encode(table.tobytes()).decode("ascii"),
        "pieces": entries,
        "maps": maps,
        "still": still,
        "data": base64.b64encode(b"".join(parts)).decode("ascii"),
    }


def _packed_still(stage: Any) -> list[dict[str, Any]]:
    """Return what of a garment's film does not move, for the page: its body, and drafted pieces; without what cannot be shown."""
    from pxr import UsdGeom

    drafted = stage.GetPrimAtPath(DRAFTED)
    prims = [("body", stage.GetPrimAtPath("/World/mannequin/body"))]
    prims += [("drafted", prim) for prim in (drafted.GetChildren() if drafted else ())]
    found = []
    for kind, prim in prims:
        mesh = UsdGeom.Mesh(prim)
        if not mesh:
            continue
        points = np.array(mesh.GetPointsAttr().Get() or (), dtype=np.float64).reshape(-1, 3)
        counts = np.array(mesh.GetFaceVertexCountsAttr().Get() or (), dtype=np.int64)
        corners = np.array(mesh.GetFaceVertexIndicesAttr().Get() or (), dtype=np.int64)
        usable = len(counts) and counts.sum() == len(corners) and set(counts.tolist()) <= {3, 4}
        if not usable or corners.min() < 0 or corners.max() >= len(points) or len(points) > _MOST_OF_BODY:
            continue
        used, corners = np.unique(corners, return_inverse=True)
        points = points[used]
        if not np.abs(points).max() < FARTHEST:
            continue
        triangles, _ = triangulate(_faces(counts, corners.reshape(-1)))
        box = _Box(points)
        data = zlib.compress(_planes(triangles.astype(np.uint32)) + _planes(box.steps(points)), _LEVEL)
        found.append(
            {
                "kind": kind,
                "colour": SKIN if kind == "body" else DRAFTED_CLOTH,
                "space": box.as_list(),
                "vertices": len(points),
                "triangles": len(triangles),
                "data": base64.b64encode(data).decode("ascii"),
            }
        )
    return found


def _packed(
    piece: FilmPiece, stored: Sequence[int], maps: Mapping[str, Mapping[str, Any]]
) -> tuple[dict[str, Any], list[bytes]]:
    """Return what the page must know of a piece, and its arrays."""
    space, blocks, topologies = _Box(piece.shapes[0].surface), list[bytes](), list[dict[str, int]]()
    painted = list[VertexColours]()
    for change, shape in zip(piece.changes, piece.shapes, strict=True):
        triangles, _ = triangulate(shape.faces)
        edges = border_edges(shape.faces)
        topologies.append(
            {
                "first": change,
                "vertices": len(shape.surface),
                "triangles": len(triangles),
                "edges": len(edges),
            }
        )
        blocks += [_planes(triangles.astype(np.uint32)), _planes(edges.astype(np.uint32))]
        blocks.append(_planes(space.steps(shape.surface)))
        paint = VertexColours(shape.faces, face_areas(shape.surface, shape.faces), len(shape.surface))
        painted.append(paint)
        for key, scale in maps.items():
            values = MAPS[key][1] * piece.maps[key][0]
            blocks.append(paint.levels(values, scale["high"], _COLOURS).astype(np.uint8).tobytes())
    layouts = [piece.positions(time) for time in stored]
    box = _Box(np.concatenate(layouts))
    before: tuple[int, NDArray[np.uint16], NDArray[np.uint8]] | None = None
    for time, positions in zip(stored, layouts, strict=True):
        number = piece.number(time)
        # Rows of the page's table of colours.
        colours = painted[number].levels(piece.density(time), piece.scale, _COLOURS).astype(np.uint8)
        steps = box.steps(positions)
        same = before is not None and before[0] == number
        blocks.append(_planes(steps - before[1] if same and before else steps))
        blocks.append((colours - before[2] if same and before else colours).tobytes())
        before = number, steps, colours
    entry = {
        "name": piece.name,
        "offset": piece.offset,
        "space": space.as_list(),
        "box": box.as_list(),
        "topologies": topologies,
        "frames": list(stored),
    }
    return entry, blocks


class _Box:
    """A box around points, with 65,535 steps along its longest side."""

    def __init__(self, points: FloatArray) -> None:
        self._low = points.min(axis=0)
        self._size = float((points.max(axis=0) - self._low).max()) or 1.0

    def steps(self, points: FloatArray) -> NDArray[np.uint16]:
        """Return places as steps from the box's corner."""
        return np.round((points - self._low) / self._size * 65535.0).clip(0, 65535).astype(np.uint16)

    def as_list(self) -> list[float]:
        """Return the corner and the size [m]."""
        return [*self._low.tolist(), self._size]


def _planes(values: NDArray[Any]) -> bytes:
    """Return numbers as planes: first the lowest byte of all, column by column; that compresses well."""
    columns = np.ascontiguousarray(values.T)
    order = columns.astype(columns.dtype.newbyteorder("<")).view(np.uint8).reshape(-1, columns.dtype.itemsize)
    return np.ascontiguousarray(order.T).tobytes()
