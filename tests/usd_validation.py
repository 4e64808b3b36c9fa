"""Checks of a written USD file that go beyond what opening it shows."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np

__all__ = ["validate_usd"]


def validate_usd(path: str | os.PathLike[str]) -> list[str]:
    """Everything that is wrong with a USD file, one sentence each; an empty list means that it is fine.

    Runs the validators that come with USD (where this build of USD has them), which do not look at meshes, and on
    every frame, between the frames, and at the default time: the topology of each mesh and curve, the lengths of
    primvars, normals and widths, finite points, the extent; and for each change of topology that the points before
    and after it differ in number, so that they are not interpolated across it.

    Raises:
        InputError: the file cannot be opened.
    """
    from pxr import Tf, Usd, UsdGeom

    from warpflat.core.errors import InputError

    try:
        stage = Usd.Stage.Open(os.fspath(path))
    except Tf.ErrorException as error:
        raise InputError(f"{path} is not a USD file that can be opened") from error
    messages = list(_validators(stage))
    for prim in stage.Traverse():
        for check, schema in ((_check_mesh, UsdGeom.Mesh), (_check_curves, UsdGeom.BasisCurves)):
            if prim.IsA(schema):
                geometry = schema(prim)
                for time in _times(geometry):
                    messages += [f"{prim.GetPath()} at {time}: {text}" for text in check(geometry, time)]
                messages += [f"{prim.GetPath()}: {text}" for text in _check_changes(geometry)]
    return messages


def _validators(stage: Any) -> Iterator[str]:
    try:
        from pxr import UsdValidation
    except ImportError:
        return
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    for error in UsdValidation.ValidationContext(validators).Validate(stage):
        yield error.GetErrorAsString()


def _samples(geometry: Any) -> list[float]:
    times = {time for attribute in geometry.GetPrim().GetAttributes() for time in attribute.GetTimeSamples()}
    return sorted(times)


def _times(geometry: Any) -> Iterator[Any]:
    from pxr import Usd

    yield Usd.TimeCode.Default()
    times = _samples(geometry)
    for index, time in enumerate(times):
        yield Usd.TimeCode(time)
        if index + 1 < len(times):
            yield Usd.TimeCode(0.5 * (time + times[index + 1]))


def _check_mesh(mesh: Any, time: Any) -> Iterator[str]:
    from pxr import UsdGeom

    counts = mesh.GetFaceVertexCountsAttr().Get(time)
    indices = mesh.GetFaceVertexIndicesAttr().Get(time)
    points = mesh.GetPointsAttr().Get(time)
    if counts is None or indices is None or points is None:
        yield "points, counts or indices have no value"
        return
    fine, reason = UsdGeom.Mesh.ValidateTopology(indices, counts, len(points))
    if not fine:
        yield reason
    if not len(counts) or min(counts) < 3:
        yield "no faces, or one with fewer than three corners"
    sizes = {"constant": 1, "uniform": len(counts), "vertex": len(points), "faceVarying": len(indices)}
    yield from _check_lengths(mesh, time, sizes)
    normals = mesh.GetNormalsAttr().Get(time)
    if normals is None or len(normals) != sizes.get(mesh.GetNormalsInterpolation()):
        yield "normals are missing or of a wrong length"
    yield from _check_points(mesh, points, time)


def _check_curves(curves: Any, time: Any) -> Iterator[str]:
    counts = curves.GetCurveVertexCountsAttr().Get(time)
    points = curves.GetPointsAttr().Get(time)
    if counts is None or points is None:
        yield "points or counts have no value"
        return
    if sum(counts) != len(points) or min(counts, default=0) < 2:
        yield f"{len(points)} points do not make curves of {list(counts)} vertices"
    sizes = {"constant": 1, "uniform": len(counts), "vertex": len(points)}
    widths = curves.GetWidthsAttr().Get(time)
    if widths is None or len(widths) != sizes.get(curves.GetWidthsInterpolation()):
        yield "widths are missing or of a wrong length"
    yield from _check_lengths(curves, time, sizes)
    yield from _check_points(curves, points, time)


def _check_lengths(geometry: Any, time: Any, sizes: dict[str, int]) -> Iterator[str]:
    from pxr import UsdGeom

    for primvar in UsdGeom.PrimvarsAPI(geometry).GetPrimvarsWithAuthoredValues():
        value, wanted = primvar.ComputeFlattened(time), sizes.get(primvar.GetInterpolation())
        if value is None or len(value) != wanted:
            yield f"{primvar.GetName()} needs {wanted} values, has {'none' if value is None else len(value)}"
        elif not np.isfinite(np.asarray(value)).all():
            yield f"{primvar.GetName()} is not finite"


def _check_points(geometry: Any, points: Any, time: Any) -> Iterator[str]:
    place = np.asarray(points)
    if not np.isfinite(place).all():
        yield "points are not finite"
    attribute = geometry.GetExtentAttr()
    extent = attribute.Get(time)
    if extent is None:
        yield "no extent"
        return
    if not time.IsDefault() and attribute.GetNumTimeSamples() and time.GetValue() not in attribute.GetTimeSamples():
        # Where the number of points changes they are held and the extent is interpolated all the same.
        return
    low, high = np.asarray(extent)
    slack = 1e-6 * (1.0 + np.abs(place).max(initial=0.0))
    if len(place) and ((place.min(axis=0) < low - slack).any() or (place.max(axis=0) > high + slack).any()):
        yield "the extent does not hold the points"


def _check_changes(geometry: Any) -> Iterator[str]:
    from pxr import UsdGeom

    if geometry.GetPrim().IsA(UsdGeom.Mesh):
        topology = [geometry.GetFaceVertexCountsAttr(), geometry.GetFaceVertexIndicesAttr()]
    else:
        topology = [geometry.GetCurveVertexCountsAttr()]
    points = geometry.GetPointsAttr()
    changes = sorted({time for attribute in topology for time in attribute.GetTimeSamples()})
    for time in changes[1:]:
        before = max((sample for sample in points.GetTimeSamples() if sample < time), default=None)
        if before is None:
            continue
        if all(np.array_equal(attribute.Get(before), attribute.Get(time)) for attribute in topology):
            continue
        if len(points.Get(before)) == len(points.Get(time)):
            yield f"the topology changes at {time} and the number of points does not: they are interpolated across it"
