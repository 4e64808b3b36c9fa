"""The mannequin as USD: bricks as named subsets of one mesh, profiles and lines as curves."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.flat import vertex_normals
from warpflat.pattern import (
    SKIN,
    begin_stage,
    bounding_box,
    define_group,
    define_mesh,
    define_subsets,
    export_stage,
    usd_errors,
    valid_name,
)

if TYPE_CHECKING:
    from warpflat.garment.mannequin.mannequin import Mannequin

__all__ = ["write_mannequin_usd"]

_WIDTH = 0.0015
_LINE = (0.55, 0.05, 0.10)


def write_mannequin_usd(mannequin: Mannequin, path: str | os.PathLike[str]) -> None:
    """Write ``/World/mannequin``: ``body`` with a GeomSubset per brick, and ``lines`` with one BasisCurves each.

    Metres, Y up. A brick's or line's name as it is typed is its display name.

    Raises:
        InputError: if the file cannot be written.
    """
    from pxr import Gf, Kind, Usd, UsdGeom, Vt

    with usd_errors(path):
        stage = Usd.Stage.CreateInMemory()
        begin_stage(stage)
        group = define_group(stage, "/World/mannequin", kind=Kind.Tokens.component)
        group.SetDocumentation(mannequin.source)
        _mesh(stage, mannequin, "body", on_body=True)
        _mesh(stage, mannequin, "tube", on_body=False)
        UsdGeom.Scope.Define(stage, "/World/mannequin/lines")
        taken: set[str] = set()
        for name, points in mannequin.lines().items():
            closed = bool(np.array_equal(points[0], points[-1]))
            curve = UsdGeom.BasisCurves.Define(stage, f"/World/mannequin/lines/{valid_name(name, taken)}")
            curve.GetPrim().SetDisplayName(name)
            places = (points[:-1] if closed else points).astype(np.float32)
            curve.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(places))
            curve.CreateCurveVertexCountsAttr(Vt.IntArray([len(places)]))
            curve.CreateTypeAttr(UsdGeom.Tokens.linear)
            curve.CreateWrapAttr(UsdGeom.Tokens.periodic if closed else UsdGeom.Tokens.nonperiodic)
            curve.CreateWidthsAttr(Vt.FloatArray([_WIDTH]))
            curve.SetWidthsInterpolation(UsdGeom.Tokens.constant)
            curve.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(bounding_box(places, 0.5 * _WIDTH)))
            curve.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set(Vt.Vec3fArray([Gf.Vec3f(*_LINE)]))
    export_stage(stage, path)


def _mesh(stage: Any, mannequin: Mannequin, part: str, *, on_body: bool) -> None:
    """Add the body, or the tube around both legs as a guide that renderers leave out."""
    from pxr import UsdGeom, Vt

    layout = mannequin.layout
    chosen = layout.on_body == on_body
    corners, face_brick = layout.faces[chosen], layout.face_brick[chosen]
    mesh = define_mesh(stage, f"/World/mannequin/{part}", corners, mannequin.vertices, SKIN)
    if not on_body:
        mesh.CreatePurposeAttr(UsdGeom.Tokens.guide)
    normals = vertex_normals(mannequin.vertices, corners).astype(np.float32)
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    bricks = {name: np.flatnonzero(face_brick == index) for index, name in enumerate(layout.bricks)}
    define_subsets(mesh, "brick", {name: faces for name, faces in bricks.items() if len(faces)})
