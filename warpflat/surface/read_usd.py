"""A mesh of a USD stage, in metres and Y up, with the curves that are drawn beside it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.errors import InputError, nearest
from warpflat.inputs import note_read
from warpflat.memory import require_memory_for_usd

__all__ = ["UsdMesh", "read_usd"]


@dataclass(kw_only=True)
class UsdMesh:
    """What was read of a stage.

    Attributes:
        name: the prim's name.
        vertices: #V by 3 [m], Y up.
        polygons: one row of vertex indices per face, filled up with -1.
        curves: linear BasisCurves beside or below the mesh, or in the group MESH_lines beside it (as in a film of ours), by
            name, #P by 3 [m]; a periodic one repeats its first point.
        notes: what could not be taken over, one sentence each.
    """

    name: str
    vertices: NDArray[np.float64]
    polygons: NDArray[np.int64]
    curves: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def read_usd(path: Path, *, prim: str | None = None, metres_per_unit: float | None = None) -> UsdMesh:
    """Read one mesh prim.

    Args:
        path: .usd, .usda, .usdc or .usdz.
        prim: the path of the mesh prim, or its name where that is unique; needed if there are several.
        metres_per_unit: overrides what the stage says.

    Raises:
        InputError: without the file's name: if the file is no stage, or there is no such mesh.
    """
    require_memory_for_usd()
    from pxr import Tf, Usd, UsdGeom

    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise InputError("not a readable USD file") from error
    if not stage:
        raise InputError("not a readable USD file")
    for layer in stage.GetUsedLayers():
        if layer.realPath:
            note_read(layer.realPath)
    chosen = _choose(stage, prim)
    mesh = UsdGeom.Mesh(chosen)
    notes: list[str] = []
    if metres_per_unit is None:
        metres_per_unit = float(UsdGeom.GetStageMetersPerUnit(stage))
        if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
            notes.append(f"the stage has no metersPerUnit: USD's default {metres_per_unit:g} was taken")
    z_up = UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())

    def to_metres(points: Any, of: Any) -> tuple[NDArray[np.float64], bool]:
        """World positions [m], Y up, and whether the transform mirrors."""
        matrix = np.array(cache.GetLocalToWorldTransform(of), dtype=np.float64)
        world = np.asarray(points, dtype=np.float64).reshape(-1, 3) @ matrix[:3, :3] + matrix[3, :3]
        if z_up:
            world = np.column_stack([world[:, 0], world[:, 2], -world[:, 1]])
        return world * metres_per_unit, bool(np.linalg.det(matrix[:3, :3]) < 0)

    polygons = _polygons(mesh)
    vertices, mirrored = to_metres(_value(mesh.GetPointsAttr()), chosen)
    left_handed = _value(mesh.GetOrientationAttr()) == UsdGeom.Tokens.leftHanded
    if left_handed != mirrored:
        polygons = _turned(polygons)
    out = UsdMesh(name=chosen.GetName(), vertices=vertices, polygons=polygons, notes=notes)
    for curves in _curve_prims(chosen):
        _add_curves(out, UsdGeom.BasisCurves(curves), to_metres)
    return out


def _value(attribute: Any) -> Any:
    """An attribute's default, or its first time sample."""
    from pxr import Usd

    value = attribute.Get()
    return attribute.Get(Usd.TimeCode.EarliestTime()) if value is None else value


def _choose(stage: Any, prim: str | None) -> Any:
    from pxr import Usd, UsdGeom

    meshes = [p for p in stage.Traverse(Usd.TraverseInstanceProxies()) if p.IsA(UsdGeom.Mesh)]
    paths = [str(p.GetPath()) for p in meshes]
    if not meshes:
        raise InputError("holds no mesh prim")
    if prim is None:
        if len(meshes) > 1:
            shown = ", ".join(paths[:8]) + (f" and {len(paths) - 8} more" if len(paths) > 8 else "")
            raise InputError(f"holds {len(meshes)} mesh prims; choose one with prim = one of: {shown}")
        return meshes[0]
    found = [p for p in meshes if str(p.GetPath()) == prim] or [p for p in meshes if p.GetName() == prim]
    if len(found) != 1:
        what = "is not a mesh prim" if not found else "names several mesh prims"
        raise InputError(f"prim {prim!r} {what}; {nearest(prim, paths)}")
    return found[0]


def _polygons(mesh: Any) -> NDArray[np.int64]:
    counts, flat = _value(mesh.GetFaceVertexCountsAttr()), _value(mesh.GetFaceVertexIndicesAttr())
    points = _value(mesh.GetPointsAttr())
    at = mesh.GetPath()
    if points is None or len(points) == 0 or counts is None or flat is None or len(counts) == 0:
        raise InputError(f"mesh {at} has no faces")
    count, index = np.asarray(counts, dtype=np.int64), np.asarray(flat, dtype=np.int64)
    if count.sum() != len(index) or count.min() < 0:
        raise InputError(
            f"mesh {at} is broken: its face sizes add up to {count.sum()}, but it lists {len(index)} corners"
        )
    if len(index) and (index.min() < 0 or index.max() >= len(points)):
        raise InputError(f"mesh {at} is broken: its faces refer to vertices beyond its {len(points):,} points")
    short = np.flatnonzero(count < 3)
    if len(short):
        raise InputError(f"mesh {at}: face {short[0]} has {count[short[0]]} corners; a face needs at least 3")
    polygons = np.full((len(count), max(int(count.max()), 4)), -1, dtype=np.int64)
    polygons[np.arange(polygons.shape[1]) < count[:, None]] = index
    holes = _value(mesh.GetHoleIndicesAttr())
    return polygons if not holes else np.delete(polygons, np.asarray(holes, dtype=np.int64), axis=0)


def _turned(polygons: NDArray[np.int64]) -> NDArray[np.int64]:
    """Faces wound the other way, from the same first corner."""
    size = (polygons >= 0).sum(axis=1)[:, None]
    column = np.arange(polygons.shape[1])[None, :]
    swapped = np.where((column > 0) & (column < size), size - column, column)
    return np.take_along_axis(polygons, swapped, axis=1)


def _curve_prims(mesh: Any) -> list[Any]:
    from pxr import Usd, UsdGeom

    def children(prim: Any) -> list[Any]:
        return list(prim.GetFilteredChildren(Usd.TraverseInstanceProxies())) if prim else []

    beside = children(mesh.GetParent())
    below = list(Usd.PrimRange(mesh, Usd.TraverseInstanceProxies()))
    # The curves of other groups are drawn on other meshes: a film has those of the pattern beside those of the surface.
    group = next((p for p in beside if p.GetName() == f"{mesh.GetName()}_lines"), None)
    return [p for p in beside + below + children(group) if p.IsA(UsdGeom.BasisCurves)]


def _add_curves(out: UsdMesh, curves: Any, to_metres: Any) -> None:
    from pxr import UsdGeom

    name = curves.GetPrim().GetName()
    points, counts = _value(curves.GetPointsAttr()), _value(curves.GetCurveVertexCountsAttr())
    if points is None or counts is None or len(points) != sum(counts):
        out.notes.append(f"curves {name!r} have no points and were left out")
        return
    if _value(curves.GetTypeAttr()) != UsdGeom.Tokens.linear:
        out.notes.append(f"curves {name!r} are not linear and were left out: convert them to polylines")
        return
    periodic = _value(curves.GetWrapAttr()) == UsdGeom.Tokens.periodic
    place, _ = to_metres(points, curves.GetPrim())
    start = 0
    for number, count in enumerate(counts):
        part = place[start : start + count]
        start += count
        if periodic:
            part = np.concatenate([part, part[:1]])
        key = name if len(counts) == 1 else f"{name}_{number + 1}"
        while key in out.curves:
            key += "_"
        out.curves[key] = part
