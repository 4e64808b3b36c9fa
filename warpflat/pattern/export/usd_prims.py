"""Prims of a USD stage: meshes and lines sampled over time, material, cameras, light.

USD interpolates two samples of a point array linearly where they are equally long, and holds the earlier one where they
are not; indices are always held. After a change of topology of equal length, the old faces would be drawn through
points half-way to the new ones. Therefore the first sample of a new topology always has another length than the one
before: where the lengths would agree, the last point is stored twice. No face uses the second copy.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpflat.core import CannotWriteError, FloatArray, IntArray, find_unused_name
from warpflat.flat import Surface
from warpflat.pattern.export.geometry import Polylines
from warpflat.pattern.files.output import atomic_path

__all__ = [
    "FIRST_FRAME",
    "FRAME_RATE",
    "MeshSamples",
    "SampledLines",
    "add_cameras",
    "add_light",
    "add_material",
    "add_texture_coordinates",
    "begin_stage",
    "bounding_box",
    "define_group",
    "define_mesh",
    "define_subsets",
    "export_stage",
    "last_values_as_defaults",
    "part_path",
    "require_usd",
    "set_face_map",
    "set_points",
    "usd_errors",
    "valid_name",
]


#: Number of a film's first frame.
FIRST_FRAME = 1
#: Frames of a film in a second.
FRAME_RATE = 24.0


@contextmanager
def usd_errors(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn USD's exceptions into one line that says that a file cannot be written.

    Their own text names places in USD's source.

    Raises:
        InputError: instead of USD's exception.
    """
    from pxr import Tf

    try:
        yield
    except Tf.ErrorException as error:
        message = next((" ".join(one.commentary.split())[:200] for one in error.args), "USD failed")
        raise CannotWriteError(f"cannot write {path}: {message} (folder still there? disk full?)") from error


def export_stage(stage: Any, path: str | os.PathLike[str]) -> None:
    """Write a stage's root layer, whole or not at all.

    Raises:
        InputError: the file cannot be written.
    """
    with atomic_path(path) as temporary:
        with usd_errors(path):
            stage.GetRootLayer().Export(str(temporary))
        require_usd(temporary, path)


def require_usd(written: Path, path: str | os.PathLike[str]) -> None:
    """Open a file once that USD has written as `path`, since USD may fail without an error.

    Raises:
        InputError: it is incomplete.
    """
    from pxr import Sdf

    with usd_errors(path):
        if not Sdf.Layer.FindOrOpen(str(written)):
            raise CannotWriteError(f"cannot write {path}: USD has left it incomplete (folder still there? disk full?)")


def valid_name(name: str, taken: set[str]) -> str:
    """Return `name` as a USD identifier that is not in `taken`, to which it is added."""
    from pxr import Tf

    unique = find_unused_name(Tf.MakeValidIdentifier(name), taken, joint="_")
    taken.add(unique)
    return unique


def part_path(piece: str, kind: str) -> str:
    """Return the path of a part of a film's piece, such as its ``"surface"`` or ``"pattern"``.

    It carries the name of the piece: programs that show names of meshes alone, as Blender does, tell the pieces apart by it.

    Args:
        piece: path of the piece's group.
        kind: of the part.
    """
    return f"{piece}/{piece.rpartition('/')[2]}_{kind}"


def define_group(stage: Any, path: str, *, label: str | None = None, kind: str | None = None) -> Any:
    """Define an Xform prim, with its label as display name where that differs from its identifier."""
    from pxr import Usd, UsdGeom

    prim = UsdGeom.Xform.Define(stage, path).GetPrim()
    _label(prim, label)
    if kind:
        Usd.ModelAPI(prim).SetKind(kind)
    return prim


def begin_stage(stage: Any, *, root: str = "/World", kind: str = "assembly", is_film: bool = False) -> None:
    """Set a stage to metres and Y up, and define its default prim; a film begins at frame 1."""
    from pxr import UsdGeom

    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    if is_film:
        stage.SetTimeCodesPerSecond(FRAME_RATE)
        stage.SetFramesPerSecond(FRAME_RATE)
        stage.SetStartTimeCode(FIRST_FRAME)
        stage.SetEndTimeCode(FIRST_FRAME)
    stage.SetDefaultPrim(define_group(stage, root, kind=kind))


def define_mesh(
    stage: Any, path: str, faces: IntArray | None = None, points: ArrayLike | None = None, colour: Sequence[float] = ()
) -> Any:
    """Define a polygon mesh (no subdivision), seen from both sides.

    Args:
        stage, path: where.
        faces: for all time, #F by 3, or by 4 with -1 as the fourth of a triangle.
        points: for all time, #P by 3 [m].
        colour: of all of it, linear Rec. 709, if it has one.
    """
    from pxr import Gf, UsdGeom

    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateOrientationAttr(UsdGeom.Tokens.rightHanded)
    mesh.CreateDoubleSidedAttr(True)
    if faces is not None:
        set_faces(mesh, faces)
    if points is not None:
        set_points(mesh, points)
    if colour:
        mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set([Gf.Vec3f(*map(float, colour))])
    return mesh


def set_faces(mesh: Any, faces: IntArray, time: Any = None) -> None:
    """Author the faces of a mesh (#F by 3, or by 4 with -1 as the fourth of a triangle), from a time on or for all of it."""
    from pxr import Usd, Vt

    used, time = faces >= 0, Usd.TimeCode.Default() if time is None else time
    mesh.CreateFaceVertexCountsAttr().Set(Vt.IntArray.FromNumpy(used.sum(axis=1, dtype=np.int32)), time)
    corners = np.ascontiguousarray(faces[used], dtype=np.int32)
    mesh.CreateFaceVertexIndicesAttr().Set(Vt.IntArray.FromNumpy(corners), time)


def set_points(mesh: Any, points: ArrayLike, time: Any = None) -> None:
    """Author the points of a mesh (#P by 3 [m]) and the box around them, at a time or for all of it."""
    from pxr import Usd, Vt

    stored = np.ascontiguousarray(points, dtype=np.float32)
    time = Usd.TimeCode.Default() if time is None else time
    mesh.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(stored), time)
    mesh.CreateExtentAttr().Set(Vt.Vec3fArray.FromNumpy(bounding_box(stored)), time)


def define_subsets(mesh: Any, family: str, faces: Mapping[str, NDArray[Any]]) -> None:
    """Define GeomSubsets that part a mesh, with the names of their faces (#S each) as display names."""
    from pxr import UsdGeom, Vt

    taken = set[str]()
    for name, rows in faces.items():
        indices = Vt.IntArray.FromNumpy(rows.astype(np.int32))
        subset = UsdGeom.Subset.CreateGeomSubset(
            mesh, valid_name(name, taken), UsdGeom.Tokens.face, indices, family, UsdGeom.Tokens.partition
        )
        subset.GetPrim().SetDisplayName(name)


def last_values_as_defaults(stage: Any, prims: Iterable[Any]) -> None:
    """Author the last value of every sampled attribute as its default, for readers that do not ask for a time."""
    for prim in prims:
        for attribute in prim.GetAuthoredAttributes():
            if attribute.GetNumTimeSamples():
                attribute.Set(attribute.Get(stage.GetEndTimeCode()))


def set_face_map(layer: Any, mesh: str, key: str, values: FloatArray, *, unit: str, state: str) -> None:
    """Author a value per face of a mesh that a layer has, as a primvar; one that is there is replaced.

    Args:
        layer: an `Sdf.Layer`.
        mesh: path of the mesh.
        key: name of the primvar.
        values: #F.
        unit: of the values.
        state: of the cloth, in which they hold.
    """
    from pxr import Sdf, UsdGeom, Vt

    prim, name = layer.GetPrimAtPath(mesh), f"primvars:{key}"
    attribute = prim.attributes.get(name) or Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.FloatArray)
    attribute.SetInfo("interpolation", UsdGeom.Tokens.uniform)
    attribute.default = Vt.FloatArray.FromNumpy(values.astype(np.float32))
    attribute.customData = {"unit": unit, "state": state}


def bounding_box(points: NDArray[Any], margin: float = 0.0) -> NDArray[Any]:
    """Return the corners (2 by #D) of the box around `points` (#P by #D) [m]."""
    # By columns: NumPy takes ten times as long for all of them at once.
    corners = np.array([[column.min() for column in points.T], [column.max() for column in points.T]])
    return np.asarray(corners + np.array([[-margin], [margin]], dtype=corners.dtype))


class MeshSamples:
    """A mesh over time: points, energies of faces and colours of vertices of computed layouts, topology only where it changes."""

    def __init__(self, stage: Any, path: str, *, normals: FloatArray, per_face: bool, scale: float) -> None:
        """Define the mesh.

        Args:
            stage, path: where.
            normals: for the whole time; #F by 3 if `per_face`, else #V by 3.
            per_face: whose normals they are.
            scale: energy of the last colour [J/m2].
        """
        from pxr import Sdf, UsdGeom, Vt

        quantity, unit = "strainEnergyDensity", "J/m2"
        self.mesh = define_mesh(stage, path)
        self.mesh.CreateNormalsAttr().Set(Vt.Vec3fArray.FromNumpy(normals.astype(np.float32)))
        self.mesh.SetNormalsInterpolation(UsdGeom.Tokens.uniform if per_face else UsdGeom.Tokens.vertex)
        self._density = (
            UsdGeom.PrimvarsAPI(self.mesh)
            .CreatePrimvar(quantity, Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.uniform)
            .GetAttr()
        )
        self._density.SetCustomDataByKey("unit", unit)
        self._colours = self.mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex).GetAttr()
        self._colours.SetCustomData({"quantity": quantity, "unit": unit, "rangeMin": 0.0, "rangeMax": float(scale)})
        self._stored = 0
        self._padding = 0

    def write(self, time: Any, points: NDArray[np.float32], faces: IntArray | None = None) -> None:
        """Write the points (#P by 3) [m]; `faces` (#F by 4) begin a new topology."""
        if faces is not None:
            self._padding = 1 if len(points) == self._stored else 0
            set_faces(self.mesh, faces, time)
        stored = self._padded(points)
        set_points(self.mesh, stored, time)
        self._stored = len(stored)

    def write_energy(self, time: Any, density: Any, colours: NDArray[np.float32]) -> None:
        """Write the energies of the faces [J/m2], and the colours of the vertices (#P by 3, linear Rec. 709)."""
        from pxr import Vt

        self._density.Set(density, time)
        self._colours.Set(Vt.Vec3fArray.FromNumpy(self._padded(colours)), time)

    def _padded(self, rows: NDArray[Any]) -> NDArray[Any]:
        return np.concatenate([rows, rows[-1:]]) if self._padding else np.ascontiguousarray(rows)


class SampledLines:
    """A group of named polylines along a mesh, each a BasisCurves prim that is shown only while it exists."""

    def __init__(self, stage: Any, path: str, *, width: float, colour: Sequence[float]) -> None:
        self.stage = stage
        self.path = path
        self.prim: Any = None
        self._width = width
        self._colour = colour
        self._used_names: set[str] = set()
        self._members: dict[str, _Line] = {}
        self._rows = np.empty(0, dtype=np.int32)
        self._ends = np.zeros(1, dtype=np.int64)

    def write(self, time: Any, lines: Mapping[str, Polylines], points: NDArray[np.float32], *, changed: bool) -> None:
        """Write each line's points at `time`; `changed` says that the lines or the mesh under them are new."""
        from pxr import UsdGeom

        if lines and self.prim is None:
            self.prim = define_group(self.stage, self.path)
            UsdGeom.Imageable(self.prim).CreatePurposeAttr(UsdGeom.Tokens.guide)
        if changed:
            # Show the lines that are there from `time` on, and hide the others.
            rows = []
            for name, parts in lines.items():
                if name not in self._members:
                    path = f"{self.path}/{valid_name(name, self._used_names)}"
                    self._members[name] = _Line(self.stage, path, name, self._width, self._colour)
                rows.append(self._members[name].begin(time, parts))
            for name, member in self._members.items():
                if name not in lines:
                    member.show(time, False)
            self._rows = np.concatenate([*rows, np.empty(0, dtype=np.int32)])
            self._ends = np.cumsum([0, *map(len, rows)])
        if lines:
            stored, margin = points[self._rows], np.float32(0.5 * self._width)
            low, high = (limit.reduceat(stored, self._ends[:-1], axis=0) for limit in (np.minimum, np.maximum))
            boxes = np.stack([low - margin, high + margin], axis=1)
            for name, first, last, box in zip(lines, self._ends[:-1], self._ends[1:], boxes, strict=True):
                self._members[name].write(time, stored[first:last], box)


class _Line:
    """One named polyline."""

    def __init__(self, stage: Any, path: str, name: str, width: float, colour: Sequence[float]) -> None:
        from pxr import Gf, UsdGeom, Vt

        self._curves = UsdGeom.BasisCurves.Define(stage, path)
        _label(self._curves.GetPrim(), name)
        self._curves.CreateTypeAttr(UsdGeom.Tokens.linear)
        self._curves.CreateWrapAttr(UsdGeom.Tokens.nonperiodic)
        self._curves.CreateWidthsAttr(Vt.FloatArray([width]))
        self._curves.SetWidthsInterpolation(UsdGeom.Tokens.constant)
        colours = Vt.Vec3fArray([Gf.Vec3f(*(float(channel) for channel in colour))])
        self._curves.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set(colours)
        self._stored = 0
        self._shown = False
        self._points: Any = None
        self._extent: Any = None

    def begin(self, time: Any, parts: Polylines) -> IntArray:
        """Show the line from a time on, with this many points in each part; return the vertices that it runs through."""
        from pxr import Vt

        self.show(time, True)
        length = sum(len(part) for part in parts)
        padding = 1 if length == self._stored else 0
        counts = np.array([len(part) for part in parts], dtype=np.int32)
        counts[-1] += padding
        self._curves.CreateCurveVertexCountsAttr().Set(Vt.IntArray.FromNumpy(counts), time)
        self._stored = length + padding
        return np.concatenate([*parts, parts[-1][-1:]] if padding else parts)

    def write(self, time: Any, points: NDArray[np.float32], box: NDArray[np.float32]) -> None:
        """Write the line's points (#P by 3 [m]) at a time, and the box around it (2 by 3 [m])."""
        from pxr import Vt

        if self._points is None:
            self._points, self._extent = self._curves.CreatePointsAttr(), self._curves.CreateExtentAttr()
        self._points.Set(Vt.Vec3fArray.FromNumpy(points), time)
        self._extent.Set(Vt.Vec3fArray.FromNumpy(box), time)

    def show(self, time: Any, shown: bool) -> None:
        """Show or hide the line from a time on; one that is there from the first frame on needs no word of it."""
        from pxr import UsdGeom

        if shown == self._shown:
            return
        self._shown, words = shown, (UsdGeom.Tokens.invisible, UsdGeom.Tokens.inherited)
        if shown and (time.IsDefault() or time.GetValue() <= FIRST_FRAME):
            return
        attribute = self._curves.CreateVisibilityAttr()
        if attribute.GetNumTimeSamples() == 0:
            # Before its first sample an attribute has that sample's value.
            attribute.Set(words[not shown], FIRST_FRAME)
        attribute.Set(words[shown], time)


def _label(prim: Any, label: str | None) -> None:
    """Set the display name of a prim where it differs from its identifier."""
    if label and label != prim.GetName():
        prim.SetDisplayName(label)


# A camera of the width of 35 mm film, 16:9 as most programs render, and a long lens, so that patterns are hardly foreshortened.
_APERTURE, _FOCAL = (36.0, 20.25), 70.0
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
    """Define `/World/light/dome` and `/World/light/key`, a sun from the upper left.

    The sun's light is normalised: its intensity is what falls on a surface that faces it, however small its disc of 2 degrees is.
    Without that, renderers that follow UsdLux, as Blender's import does, multiply by that disc, a thousandth.
    """
    from pxr import Gf, UsdGeom, UsdLux

    UsdGeom.Scope.Define(stage, "/World/light")
    UsdLux.DomeLight.Define(stage, "/World/light/dome").CreateIntensityAttr(0.6)
    key = UsdLux.DistantLight.Define(stage, "/World/light/key")
    key.CreateIntensityAttr(2.5)
    key.CreateNormalizeAttr(True)
    key.CreateExposureAttr(0.0)
    key.CreateAngleAttr(2.0)
    UsdGeom.Xformable(key).AddRotateXYZOp().Set(Gf.Vec3f(-35.0, -30.0, 0.0))
