"""A mesh of a USD stage, in metres and Y up, with the curves that are drawn beside it.

The process that reads a file loads this module only: see :mod:`warpflat.flat.surface.io.read`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.text import list_some, quote_value
from warpflat.core.usd_layers import check_layers
from warpflat.core.usd_process import UNREADABLE
from warpflat.flat.surface.io.raw_mesh import ALL_PRIMS, RawMesh, line_name, numbered, objects_in_turn
from warpflat.flat.surface.repair.polygons import pad_corners

__all__ = ["read_usd_stage"]

#: Returns world positions of a prim's points [m], Y up, and whether its transform mirrors.
ToMetres = Callable[[Any, Any], tuple[FloatArray, bool]]


def read_usd_stage(path: Path, *, prim: str | None, metres_per_unit: float | None) -> tuple[RawMesh, list[str]]:
    """Read one mesh prim of a stage, or several as one, wound as USD's right-handed faces are.

    Its curves are linear BasisCurves beside or below the mesh, or in the group MESH_lines beside it (as in a film of ours); a periodic one
    repeats its first point. What is marked are rows of edges with a crease, as in Blender.

    Args:
        path: .usd, .usda, .usdc or .usdz.
        prim: the path of the mesh prim, or its name where that is unique; needed if there are several; `ALL_PRIMS` for all.
        metres_per_unit: overrides what the stage says.

    Returns:
        The mesh, in metres and Y up, and the files of which the stage is composed.

    Raises:
        InputError: without the file's name: if the file is no stage, or there is no such mesh.
    """
    from pxr import UsdUtils

    # With a delegate USD prints no warnings: they become a note, or a part of the error.
    warnings = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        mesh, layers = _read(path, prim, metres_per_unit)
    except InputError as error:
        warned = _warned(warnings)
        raise InputError(f"{error} (USD warns: {warned})" if warned else str(error)) from error
    # Any error of USD is the file's fault, of whatever type it is.
    except Exception as error:
        raise InputError(UNREADABLE) from error
    if warned := _warned(warnings):
        mesh.notes.append(f"the stage was not read whole: {warned}")
    return mesh, layers


def _warned(warnings: Any) -> str:
    """Return the first of USD's warnings in one line, and the number of the others."""
    texts = [" ".join(str(item.commentary).split()) for item in warnings.TakeUncoalescedDiagnostics()]
    if not texts:
        return ""
    # USD ends each with the task and an address in memory, which differs from run to run.
    first = texts[0].partition(" (instantiating stage")[0].rstrip(".")
    return first + (f", and {len(texts) - 1} more" if len(texts) > 1 else "")


def _read(path: Path, prim: str | None, metres_per_unit: float | None) -> tuple[RawMesh, list[str]]:
    from pxr import Pcp, Usd, UsdGeom

    check_layers(path)
    stage = Usd.Stage.Open(str(path))
    if not stage:
        raise InputError(UNREADABLE)
    # What a prim refers to in a layer may be missing there.
    for each in stage.TraverseAll():
        if any(isinstance(error, Pcp.ErrorUnresolvedPrimPath) for error in each.GetPrimIndex().localErrors):
            raise InputError(f"{each.GetPath()} is not whole: a layer does not have what it refers to there")
    chosen = [p for p in stage.Traverse(Usd.TraverseInstanceProxies()) if p.IsA(UsdGeom.Mesh)]
    paths = [str(p.GetPath()) for p in chosen]
    if not chosen:
        raise InputError("holds no mesh prim")
    if prim is None and len(chosen) > 1:
        raise InputError(f"holds {len(chosen)} mesh prims; choose one with prim = one of: {list_some(paths)}")
    if prim is not None and prim != ALL_PRIMS:
        chosen = [p for p in chosen if str(p.GetPath()) == prim] or [p for p in chosen if p.GetName() == prim]
        if len(chosen) != 1:
            what = "names several mesh prims" if chosen else "is not a mesh prim"
            raise InputError(f"prim {prim!r} {what}; {nearest(prim, paths)}")
    notes = [
        f"{each.GetPath()} repeats meshes, of which each was read once; make its instances real, or save each as a mesh"
        for each in stage.Traverse()
        if each.IsA(UsdGeom.PointInstancer)
    ]
    if metres_per_unit is None:
        metres_per_unit = float(UsdGeom.GetStageMetersPerUnit(stage))
        if not 0.0 < metres_per_unit < np.inf:
            raise InputError(
                f"metersPerUnit is {metres_per_unit:g}; it must be a number above 0, such as 0.01 where the stage is in centimetres"
            )
        if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
            notes.append(f"the stage has no metersPerUnit: USD's default {metres_per_unit:g} was taken")
    z_up = UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())

    def to_metres(points: Any, of: Any) -> tuple[FloatArray, bool]:
        matrix = np.array(cache.GetLocalToWorldTransform(of), dtype=np.float64)
        world = np.asarray(points, dtype=np.float64).reshape(-1, 3) @ matrix[:3, :3] + matrix[3, :3]
        if z_up:
            world = np.column_stack([world[:, 0], world[:, 2], -world[:, 1]])
        return world * metres_per_unit, bool(np.linalg.det(matrix[:3, :3]) < 0)

    parts = [_read_mesh(one, to_metres, notes) for one in chosen]
    start = np.cumsum([0, *(len(part.vertices) for part in parts)]).tolist()
    corners = np.concatenate([part.corners + at for part, at in zip(parts, start, strict=False)])
    polygons, texture = pad_corners(corners, np.concatenate([part.sizes for part in parts])), None
    if any(np.isfinite(part.texture).any() for part in parts):
        texture = np.full((*polygons.shape, 2), np.nan)
        texture[polygons >= 0] = np.concatenate([part.texture for part in parts])
    mesh = RawMesh(
        vertices=np.concatenate([part.vertices for part in parts]),
        polygons=polygons,
        scale=1.0,
        name=chosen[0].GetName(),
        curves=_read_curves(chosen[0], to_metres, notes) if len(chosen) == 1 else {},
        notes=notes,
        objects=objects_in_turn([one.GetName() for one in chosen], start[:-1], polygons),
        marked=[row + at for part, at in zip(parts, start, strict=False) for row in part.creases],
        texture=texture,
        face_material=numbered([name for part in parts for name in part.materials]),
        face_group=numbered([name for part in parts for name in part.groups]),
    )
    return mesh, [layer.realPath for layer in stage.GetUsedLayers() if layer.realPath]


@dataclass(kw_only=True)
class _Part:
    """One mesh prim: the number of corners of each face, all corners and their texture (#C by 2), names of faces, rows of creases."""

    vertices: FloatArray
    sizes: NDArray[np.int64]
    corners: NDArray[np.int64]
    texture: FloatArray
    materials: list[str]
    groups: list[str]
    creases: list[NDArray[np.int64]]


def _read_mesh(one: Any, to_metres: ToMetres, notes: list[str]) -> _Part:
    """Read a mesh prim, without the faces that are holes."""
    from pxr import Usd, UsdGeom, UsdShade

    mesh = UsdGeom.Mesh(one)
    counts, flat = _value(mesh.GetFaceVertexCountsAttr()), _value(mesh.GetFaceVertexIndicesAttr())
    points = _value(mesh.GetPointsAttr())
    at = mesh.GetPath()
    if points is None or len(points) == 0 or counts is None or flat is None or len(counts) == 0:
        raise InputError(f"mesh {at} has no faces")
    all_sizes, all_corners = np.asarray(counts, dtype=np.int64), np.asarray(flat, dtype=np.int64)
    holes = np.asarray(_value(mesh.GetHoleIndicesAttr()) or [], dtype=np.int64)
    if all_sizes.sum() != len(all_corners) or all_sizes.min() < 0:
        raise InputError(
            f"mesh {at} is broken: its face sizes add up to {all_sizes.sum()}, but it lists {len(all_corners)} corners"
        )
    if len(all_corners) and (all_corners.min() < 0 or all_corners.max() >= len(points)):
        raise InputError(f"mesh {at} is broken: its faces refer to vertices beyond its {len(points):,} points")
    short = np.flatnonzero(all_sizes < 3)
    if len(short):
        raise InputError(f"mesh {at}: face {short[0]} has {all_sizes[short[0]]} corners; a face needs at least 3")
    if len(holes) and (holes.min() < 0 or holes.max() >= len(all_sizes)):
        raise InputError(f"mesh {at} is broken: its holes refer to faces beyond its {len(all_sizes):,} faces")
    kept = np.ones(len(all_sizes), dtype=bool)
    kept[holes] = False
    if not kept.any():
        raise InputError(f"mesh {at} has no faces: all are holes")
    sizes, corners = all_sizes[kept], all_corners[np.repeat(kept, all_sizes)]
    vertices, mirrored = to_metres(points, one)
    # Of the texture coordinates `st` comes first, then any other primvar of pairs with a value for each corner or point.
    texture = np.full((len(all_corners), 2), np.nan)
    kinds = ("texCoord2f[]", "texCoord2d[]", "texCoord2h[]", "float2[]", "double2[]")
    ways = (UsdGeom.Tokens.faceVarying, UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying)
    known = [
        primvar
        for primvar in UsdGeom.PrimvarsAPI(one).GetPrimvarsWithValues()
        if str(primvar.GetTypeName()) in kinds and primvar.GetInterpolation() in ways
    ]
    known.sort(key=lambda primvar: primvar.GetPrimvarName() != "st")
    if known:
        flattened = known[0].ComputeFlattened() or known[0].ComputeFlattened(Usd.TimeCode.EarliestTime())
        values = np.asarray(flattened if flattened is not None else [], dtype=np.float64).reshape(-1, 2)
        of_corners = known[0].GetInterpolation() == UsdGeom.Tokens.faceVarying
        if len(values) == len(all_corners if of_corners else points):
            texture = values if of_corners else values[all_corners]
        else:
            notes.append(f"texture coordinates of mesh {at} are broken and were left out")
    texture = texture[np.repeat(kept, all_sizes)]
    # Faces without a subset that binds a material have that of the mesh.
    bound = UsdShade.MaterialBindingAPI(one).GetDirectBinding().GetMaterialPath()
    of_mesh = bound.name if bound else ""
    materials, groups = _subsets(one, len(all_sizes), materials=True), _subsets(one, len(all_sizes))
    if (_value(mesh.GetOrientationAttr()) == UsdGeom.Tokens.leftHanded) != mirrored:
        # Faces are wound the other way, from the same first corner.
        first, size = np.repeat(np.cumsum(sizes) - sizes, sizes), np.repeat(sizes, sizes)
        turned = first + (size - np.arange(len(corners)) + first) % size
        corners, texture = corners[turned], texture[turned]
    rows = np.asarray(_value(mesh.GetCreaseIndicesAttr()) or [], dtype=np.int64)
    lengths = np.asarray(_value(mesh.GetCreaseLengthsAttr()) or [], dtype=np.int64)
    if len(rows) and (lengths.sum() != len(rows) or lengths.min() < 2 or rows.min() < 0 or rows.max() >= len(points)):
        notes.append(f"creases of mesh {at} are broken and were left out")
        rows = rows[:0]
    return _Part(
        vertices=vertices,
        sizes=sizes,
        corners=corners,
        texture=texture,
        materials=[name or of_mesh for name, stays in zip(materials, kept.tolist(), strict=True) if stays],
        groups=[name for name, stays in zip(groups, kept.tolist(), strict=True) if stays],
        creases=np.split(rows, np.cumsum(lengths)[:-1]) if len(rows) else [],
    )


def _read_curves(mesh: Any, to_metres: ToMetres, notes: list[str]) -> dict[str, FloatArray]:
    """Read the curves that are drawn on a mesh prim, by name."""
    from pxr import Usd, UsdGeom

    def children(prim: Any) -> list[Any]:
        return list(prim.GetFilteredChildren(Usd.TraverseInstanceProxies())) if prim else []

    beside = children(mesh.GetParent())
    below = list(Usd.PrimRange(mesh, Usd.TraverseInstanceProxies()))
    # The curves of other groups are drawn on other meshes: a film has those of the pattern beside those of the surface.
    group = next((p for p in beside if p.GetName() == f"{mesh.GetName()}_lines"), None)
    found: dict[str, FloatArray] = {}
    for prim in [p for p in beside + below + children(group) if p.IsA(UsdGeom.BasisCurves)]:
        lines, name = UsdGeom.BasisCurves(prim), prim.GetName()
        points, counts = _value(lines.GetPointsAttr()), _value(lines.GetCurveVertexCountsAttr())
        if points is None or counts is None or len(points) != sum(counts):
            notes.append(f"curves {quote_value(name)} have no points and were left out")
            continue
        if _value(lines.GetTypeAttr()) != UsdGeom.Tokens.linear:
            notes.append(f"curves {quote_value(name)} are not linear and were left out: convert them to polylines")
            continue
        periodic = _value(lines.GetWrapAttr()) == UsdGeom.Tokens.periodic
        place, _ = to_metres(points, prim)
        start = 0
        for number, count in enumerate(counts, start=1):
            part = place[start : start + count]
            start += count
            if periodic:
                part = np.concatenate([part, part[:1]])
            found[line_name(name, number, len(counts), found)] = part
    return found


def _subsets(mesh: Any, count: int, *, materials: bool = False) -> list[str]:
    """Return for each face of a mesh the name of the subset that holds it, of those for materials or of the others; else ""."""
    from pxr import UsdGeom

    names = [""] * count
    for subset in UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(mesh)):
        binds = subset.GetFamilyNameAttr().Get() == "materialBind"
        if subset.GetElementTypeAttr().Get() == UsdGeom.Tokens.face and binds == materials:
            for face in _value(subset.GetIndicesAttr()) or []:
                if 0 <= face < count:
                    names[face] = subset.GetPrim().GetName()
    return names if materials or any(names) else [mesh.GetName()] * count


def _value(attribute: Any) -> Any:
    """Return an attribute's default, or its first time sample."""
    from pxr import Usd

    value = attribute.Get()
    return attribute.Get(Usd.TimeCode.EarliestTime()) if value is None else value
