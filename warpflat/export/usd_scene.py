"""Material, cameras and light of a USD scene, for viewers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.surface.mesh import Surface

__all__ = ["add_cameras", "add_light", "add_material", "add_texture_coordinates", "rows_on_table"]

# A camera of 35 mm film and a long lens, so that patterns are hardly foreshortened.
_APERTURE, _FOCAL = (36.0, 24.0), 70.0
_ROOM = 1.12  # what a camera sees, over what it looks at


def add_material(stage: Any, meshes: list[Any]) -> None:
    """Define `/World/Looks/energy`, a preview material with the vertex colours, and bind meshes to it."""
    from pxr import Gf, Sdf, UsdGeom, UsdShade

    UsdGeom.Scope.Define(stage, "/World/Looks")
    material = UsdShade.Material.Define(stage, "/World/Looks/energy")
    reader = UsdShade.Shader.Define(stage, "/World/Looks/energy/colour")
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
    reader.CreateInput("fallback", Sdf.ValueTypeNames.Float3).Set(Gf.Vec3f(0.5))
    surface = UsdShade.Shader.Define(stage, "/World/Looks/energy/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    colour = reader.CreateOutput("result", Sdf.ValueTypeNames.Float3)
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(colour)
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.9)
    surface.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    out = surface.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput().ConnectToSource(out)
    for mesh in meshes:
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def add_texture_coordinates(mesh: Any, surface: Surface, faces: IntArray, positions: NDArray[np.float32]) -> None:
    """Author `primvars:st` of a mesh: the place of each corner in the pattern [m].

    Args:
        mesh: of the surface or of the pattern, whose corners are the same.
        surface: the piece.
        faces: its faces in the pattern's numbering.
        positions: #P by 2, the pattern [m].
    """
    from pxr import Sdf, UsdGeom, Vt

    corners = positions[faces[surface.faces >= 0]]
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
    st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(corners)))
    st.GetAttr().SetCustomDataByKey("unit", "m")


def add_cameras(stage: Any, everything: FloatArray, patterns: FloatArray) -> None:
    """Define `/World/cameras/all` and `/World/cameras/patterns`, which look along -Z at boxes (2 by 3, low and high) [m]."""
    from pxr import Gf, UsdGeom

    UsdGeom.Scope.Define(stage, "/World/cameras")
    for name, box in (("all", everything), ("patterns", patterns)):
        size, middle = box[1] - box[0], box.mean(axis=0)
        across = [_ROOM * max(float(size[axis]), 1e-3) * _FOCAL / _APERTURE[axis] for axis in (0, 1)]
        away = max(across) + 0.5 * float(size[2])
        camera = UsdGeom.Camera.Define(stage, f"/World/cameras/{name}")
        place = Gf.Vec3d(float(middle[0]), float(middle[1]), float(middle[2]) + away)
        UsdGeom.Xformable(camera).AddTranslateOp().Set(place)
        # Lenses are measured in tenths of the stage's unit.
        camera.CreateHorizontalApertureAttr(_APERTURE[0] / 100.0)
        camera.CreateVerticalApertureAttr(_APERTURE[1] / 100.0)
        camera.CreateFocalLengthAttr(_FOCAL / 100.0)
        near, far = max(1e-3, 0.01 * away), 10.0 * away
        camera.CreateClippingRangeAttr(Gf.Vec2f(near, far))
        camera.CreateFocusDistanceAttr(away)


def add_light(stage: Any) -> None:
    """Define `/World/light/dome` and `/World/light/key`, a sun from the upper left."""
    from pxr import Gf, UsdGeom, UsdLux

    UsdGeom.Scope.Define(stage, "/World/light")
    UsdLux.DomeLight.Define(stage, "/World/light/dome").CreateIntensityAttr(0.6)
    key = UsdLux.DistantLight.Define(stage, "/World/light/key")
    key.CreateIntensityAttr(1.5)
    key.CreateAngleAttr(2.0)
    UsdGeom.Xformable(key).AddRotateXYZOp().Set(Gf.Vec3f(-35.0, -30.0, 0.0))


def rows_on_table(sizes: FloatArray, gap: float) -> FloatArray:
    """Return the lower left corner of each of several boxes, laid out in rows, so many that the whole is near to 16 by 9.

    Args:
        sizes: #B by 2 [m].
        gap: between boxes and between rows [m].
    """
    whole = float((sizes[:, 0] + gap).sum())
    layouts = [_rows(sizes, gap, max(1.05 * whole / rows, float(sizes[:, 0].max()))) for rows in range(1, 5)]

    def unlikeness(corners: FloatArray) -> float:
        wide, high = (corners + sizes).max(axis=0)
        return abs(math.log(max(wide, 1e-9) / max(high, 1e-9) * 9.0 / 16.0))

    return min(layouts, key=unlikeness)


def _rows(sizes: FloatArray, gap: float, width: float) -> FloatArray:
    """Return the lower left corners of boxes in rows of at most this width [m]."""
    corners = np.zeros_like(sizes)
    x = y = deep = 0.0
    for number, (wide, high) in enumerate(sizes.tolist()):
        if x > 0.0 and x + wide > width:
            x, y, deep = 0.0, y - deep - gap, 0.0
        corners[number] = x, y - high
        x, deep = x + wide + gap, max(deep, high)
    corners[:, 1] -= corners[:, 1].min()
    return corners
