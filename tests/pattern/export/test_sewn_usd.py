"""A sewn garment as USD: welded points in metres, the pattern in millimetres with seams open, pieces as subsets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom
from usd_validation import validate_usd

import warpflat
from warpflat.pattern.export.sewn_usd import write_sewn_usd


def test_points_are_welded_and_the_pattern_is_open(tmp_path: Path):
    """A square of two triangles and a quad beside it, folded along the seam between them; their patterns lie upon each other."""
    points = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (1, 0, 1), (1, 1, 1)], dtype=float)
    faces = np.array([(0, 1, 2, -1), (0, 2, 3, -1), (1, 4, 5, 2)], dtype=np.int32)
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    flat = np.concatenate([square, square])
    flat_faces = np.array([(0, 1, 2, -1), (0, 2, 3, -1), (4, 5, 6, 7)], dtype=np.int32)
    file = tmp_path / "worn.usdc"
    pieces = {"front left": slice(0, 2), "back": slice(2, 3)}
    write_sewn_usd(file, points, faces, flat, flat_faces, pieces)
    assert validate_usd(file) == []
    stage = Usd.Stage.Open(str(file))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Root/garment"))
    np.testing.assert_array_equal(mesh.GetPointsAttr().Get(), points)
    st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    assert st.GetInterpolation() == "faceVarying"
    places = np.array(st.ComputeFlattened())
    corners = np.split(places, np.cumsum(mesh.GetFaceVertexCountsAttr().Get())[:-1])
    for corner, face in zip(corners, flat_faces, strict=True):
        wanted = flat[face[face >= 0]]
        np.testing.assert_allclose(np.diff(corner, axis=0), 1e3 * np.diff(wanted, axis=0), atol=1e-3)
    # The second piece lies beside the first.
    assert corners[2][:, 0].min() > corners[0][:, 0].max()
    subsets = UsdGeom.Subset.GetAllGeomSubsets(mesh)
    assert {each.GetPrim().GetDisplayName(): list(each.GetIndicesAttr().Get()) for each in subsets} == {
        "front left": [0, 1],
        "back": [2],
    }
    assert [set(pair) for pair in np.reshape(mesh.GetCreaseIndicesAttr().Get(), (-1, 2))] == [{1, 2}]
    assert warpflat.read_surface(file).vertices.shape == (6, 3)
