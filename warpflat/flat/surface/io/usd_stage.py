"""A mesh of a USD stage, in metres and Y up, with the curves that are drawn beside it.

The process that reads a file loads this module only: see :mod:`warpflat.flat.surface.io.read`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.text import quote_value
from warpflat.core.usd_layers import check_layers
from warpflat.core.usd_process import UNREADABLE

__all__ = ["ALL_PRIMS", "UsdMesh", "numbered", "read_usd_stage"]

#: Stands for all mesh prims of a stage.
ALL_PRIMS = "*"


@dataclass(kw_only=True)
class UsdMesh:
    """A mesh of a stage, or several as one, with its curves.

    Attributes:
        name: of the prim, the first of several.
        vertices: #V by 3 [m], Y up.
        sizes: #F, the number of corners of each face.
        corners: the vertex indices of all faces' corners, one face after the other, wound as USD's right-handed faces are.
        curves: linear BasisCurves beside or below the mesh, or in the group MESH_lines beside it (as in a film of ours), by
            name, #P by 3 [m]; a periodic one repeats its first point.
        notes: what could not be read, one sentence each.
        layers: the files of which the stage is composed.
        groups: the meshes as (first vertex, name of the prim), in their order.
        creases: rows of vertices, as of edges that are marked with a crease in Blender.
        texture: #C by 2, the texture coordinates of all faces' corners, nan where there are none.
        face_material, face_group: #F, a number for the material and the subset or mesh of each face, and their names.
    """

    name: str
    vertices: FloatArray
    sizes: NDArray[np.int64]
    corners: NDArray[np.int64]
    texture: FloatArray
    face_material: tuple[NDArray[np.int64], tuple[str, ...]]
    face_group: tuple[NDArray[np.int64], tuple[str, ...]]
    curves: dict[str, FloatArray] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    layers: list[str] = field(default_factory=list)
    groups: list[tuple[int, str]] = field(default_factory=list)
    creases: list[NDArray[np.int64]] = field(default_factory=list)


def read_usd_stage(path: Path, *, prim: str | None, metres_per_unit: float | None) -> UsdMesh:
    """Read one mesh prim of a stage.

    Args:
        path: .usd, .usda, .usdc or .usdz.
        prim: the path of the mesh prim, or its name where that is unique; needed if there are several; `ALL_PRIMS` for all.
        metres_per_unit: overrides what the stage says.

    Raises:
        InputError: without the file's name: if the file is no stage, or there is no such mesh.
    """
    from pxr import UsdUtils

    # With a delegate USD prints no warnings: they become a note, or a part of the error.
    warnings = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        mesh = _read(path, prim, metres_per_unit)
    except InputError as error:
        warned = _warned(warnings)
        raise InputError(f"{error} (USD warns: {warned})" if warned else str(error)) from error
    # Any error of USD is the file's fault, of whatever type it is.
    except Exception as error:
        raise InputError(UNREADABLE) from error
    if warned := _warned(warnings):
        mesh.notes.append(f"the stage was not read whole: {warned}")
    return mesh


def _warned(warnings: Any) -> str:
    """Return the first of USD's warnings in one line, and the number of the others."""
    texts = [" ".join(str(item.commentary).split()) for item in warnings.TakeUncoalescedDiagnostics()]
    if not texts:
        return ""
    # USD ends each with the task and an address in memory, which differs from run to run.
    first = texts[0].partition(" (instantiating stage")[0].rstrip(".")
    return first + (f", and {len(texts) - 1} more" if len(texts) > 1 else "")


def _read(path: Path, prim: str | None, metres_per_unit: float | None) -> UsdMesh:
    from pxr import Pcp, Usd, UsdGeom, UsdShade

    check_layers(path)
    stage = Usd.Stage.Open(str(path))
    if not stage:
        raise InputError(UNREADABLE)
    # What a prim refers to in a layer may be missing there.
    for each in stage.TraverseAll():
        if any(isinstance(error, Pcp.ErrorUnresolvedPrimPath) for error in each.GetPrimIndex().localErrors):
            raise InputError(f"{each.GetPath()} is not whole: a layer does not have what it refers to there")
    meshes = [p for p in stage.Traverse(Usd.TraverseInstanceProxies()) if p.IsA(UsdGeom.Mesh)]
    paths = [str(p.GetPath()) for p in meshes]
    if not meshes:
        raise InputError("holds no mesh prim")
    chosen = meshes
    if prim is None and len(meshes) > 1:
        some = ", ".join(paths[:8]) + (f" and {len(paths) - 8} more" if len(paths) > 8 else "")
        raise InputError(f"holds {len(meshes)} mesh prims; choose one with prim = one of: {some}")
    if prim is not None and prim != ALL_PRIMS:
        chosen = [p for p in meshes if str(p.GetPath()) == prim] or [p for p in meshes if p.GetName() == prim]
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
        """Return world positions [m], Y up, and whether the transform mirrors."""
        matrix = np.array(cache.GetLocalToWorldTransform(of), dtype=np.float64)
        world = np.asarray(points, dtype=np.float64).reshape(-1, 3) @ matrix[:3, :3] + matrix[3, :3]
        if z_up:
            world = np.column_stack([world[:, 0], world[:, 2], -world[:, 1]])
        return world * metres_per_unit, bool(np.linalg.det(matrix[:3, :3]) < 0)

    parts = list[tuple[FloatArray, NDArray[np.int64], NDArray[np.int64]]]()
    textures = list[FloatArray]()
    materials, groups = list[str](), list[str]()
    creases = list[NDArray[np.int64]]()
    for one in chosen:
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
        texture = _texture(one, all_corners, len(points))
        if texture is None:
            notes.append(f"texture coordinates of mesh {at} are broken and were left out")
            texture = np.full((len(all_corners), 2), np.nan)
        texture = texture[np.repeat(kept, all_sizes)]
        # Faces without a subset that binds a material have that of the mesh.
        bound = UsdShade.MaterialBindingAPI(one).GetDirectBinding().GetMaterialPath()
        of_mesh = bound.name if bound else ""
        of_faces = [name or of_mesh for name in _subsets(one, len(all_sizes), materials=True)]
        for names, found in ((materials, of_faces), (groups, _subsets(one, len(all_sizes)))):
            names += [name for name, stays in zip(found, kept.tolist(), strict=True) if stays]
        left_handed = _value(mesh.GetOrientationAttr()) == UsdGeom.Tokens.leftHanded
        if left_handed != mirrored:
            # Faces are wound the other way, from the same first corner.
            first, size = np.repeat(np.cumsum(sizes) - sizes, sizes), np.repeat(sizes, sizes)
            turned = first + (size - np.arange(len(corners)) + first) % size
            corners, texture = corners[turned], texture[turned]
        before = sum(len(points) for points, _, _ in parts)
        rows = np.asarray(_value(mesh.GetCreaseIndicesAttr()) or [], dtype=np.int64)
        lengths = np.asarray(_value(mesh.GetCreaseLengthsAttr()) or [], dtype=np.int64)
        if len(rows) and (
            lengths.sum() != len(rows) or lengths.min() < 2 or rows.min() < 0 or rows.max() >= len(points)
        ):
            notes.append(f"creases of mesh {at} are broken and were left out")
        elif len(rows):
            creases += np.split(rows + before, np.cumsum(lengths)[:-1])
        parts.append((vertices, sizes, corners))
        textures.append(texture)
    start = np.cumsum([0, *(len(vertices) for vertices, _, _ in parts)]).tolist()
    out = UsdMesh(
        name=chosen[0].GetName(),
        vertices=np.concatenate([vertices for vertices, _, _ in parts]),
        sizes=np.concatenate([sizes for _, sizes, _ in parts]),
        corners=np.concatenate([corners + at for (_, _, corners), at in zip(parts, start, strict=False)]),
        texture=np.concatenate(textures),
        face_material=numbered(materials),
        face_group=numbered(groups),
        notes=notes,
        layers=[layer.realPath for layer in stage.GetUsedLayers() if layer.realPath],
        groups=[(at, one.GetName()) for one, at in zip(chosen, start, strict=False)],
        creases=creases,
    )
    for curves in _curve_prims(chosen[0]) if len(chosen) == 1 else []:
        lines = UsdGeom.BasisCurves(curves)
        name = lines.GetPrim().GetName()
        points, counts = _value(lines.GetPointsAttr()), _value(lines.GetCurveVertexCountsAttr())
        if points is None or counts is None or len(points) != sum(counts):
            out.notes.append(f"curves {quote_value(name)} have no points and were left out")
            continue
        if _value(lines.GetTypeAttr()) != UsdGeom.Tokens.linear:
            out.notes.append(f"curves {quote_value(name)} are not linear and were left out: convert them to polylines")
            continue
        periodic = _value(lines.GetWrapAttr()) == UsdGeom.Tokens.periodic
        place, _ = to_metres(points, lines.GetPrim())
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
    return out


def numbered(names: list[str]) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    """Return a number for each name, from 0 in their order, and the names."""
    number = {name: k for k, name in enumerate(dict.fromkeys(names))}
    return np.fromiter(map(number.__getitem__, names), dtype=np.int64, count=len(names)), tuple(number)


def _texture(mesh: Any, corners: NDArray[np.int64], points: int) -> FloatArray | None:
    """Return the texture coordinates of a mesh's corners (#C by 2), all nan where it has none; None where they are broken.

    `st` comes first, then any other primvar of pairs with a value for each corner or point.
    """
    from pxr import Usd, UsdGeom

    kinds = ("texCoord2f[]", "texCoord2d[]", "texCoord2h[]", "float2[]", "double2[]")
    ways = (UsdGeom.Tokens.faceVarying, UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying)
    known = [
        primvar
        for primvar in UsdGeom.PrimvarsAPI(mesh).GetPrimvarsWithValues()
        if str(primvar.GetTypeName()) in kinds and primvar.GetInterpolation() in ways
    ]
    known.sort(key=lambda primvar: primvar.GetPrimvarName() != "st")
    if not known:
        return np.full((len(corners), 2), np.nan)
    flat = known[0].ComputeFlattened() or known[0].ComputeFlattened(Usd.TimeCode.EarliestTime())
    values = np.asarray(flat if flat is not None else [], dtype=np.float64).reshape(-1, 2)
    each = known[0].GetInterpolation() == UsdGeom.Tokens.faceVarying
    if len(values) != (len(corners) if each else points):
        return None
    return values if each else values[corners]


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


def _curve_prims(mesh: Any) -> list[Any]:
    from pxr import Usd, UsdGeom

    def children(prim: Any) -> list[Any]:
        return list(prim.GetFilteredChildren(Usd.TraverseInstanceProxies())) if prim else []

    beside = children(mesh.GetParent())
    below = list(Usd.PrimRange(mesh, Usd.TraverseInstanceProxies()))
    # The curves of other groups are drawn on other meshes: a film has those of the pattern beside those of the surface.
    group = next((p for p in beside if p.GetName() == f"{mesh.GetName()}_lines"), None)
    return [p for p in beside + below + children(group) if p.IsA(UsdGeom.BasisCurves)]
