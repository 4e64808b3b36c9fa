"""A sewn garment as USD, as Style3D has it: one mesh of welded points in metres, its pattern as `st` in millimetres.

Corners on both sides of a seam share their point and have a place of their own in `st`. Each piece is a GeomSubset. The edges of seams
are creases, as marked seams are.
"""

from __future__ import annotations

import os
from collections.abc import Mapping

import numpy as np

from warpflat.core import FloatArray, IntArray
from warpflat.flat import triangulate, vertex_normals
from warpflat.pattern.export.usd_prims import begin_stage, define_mesh, define_subsets, export_stage

__all__ = ["write_sewn_usd"]

# Pieces lie this far apart in `st` [m].
_GAP = 0.05
# Sharpness of a crease, which no subdivision smooths.
_SHARP = 10.0


def write_sewn_usd(
    path: str | os.PathLike[str],
    points: FloatArray,
    faces: IntArray,
    flat: FloatArray,
    flat_faces: IntArray,
    pieces: Mapping[str, slice],
) -> None:
    """Write one mesh, `/Root/garment`; the file appears whole or not at all.

    Args:
        path: of the file.
        points: #V by 3, the sewn mesh [m], Y up.
        faces: #F by 4, of it, -1 in the last column of a triangle.
        flat: #P by 2, the patterns in their own numbering [m].
        flat_faces: #F by 4, the same faces in that numbering.
        pieces: the faces of each piece, by name.

    Raises:
        InputError: the file cannot be written.
    """
    from pxr import Kind, Sdf, Usd, UsdGeom, Vt

    stage = Usd.Stage.CreateInMemory()
    begin_stage(stage, root="/Root", kind=Kind.Tokens.component)
    mesh = define_mesh(stage, "/Root/garment", faces, points)
    triangles, _ = triangulate(faces)
    normals = vertex_normals(points, triangles).astype(np.float32)
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    # The pieces in a row.
    used, laid, right = flat_faces >= 0, flat.copy(), 0.0
    for rows in pieces.values():
        mine = np.unique(flat_faces[rows][used[rows]])
        low = laid[mine].min(axis=0)
        laid[mine] += [right - low[0], -low[1]]
        right = float(laid[mine, 0].max()) + _GAP
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
    st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(1e3 * laid, dtype=np.float32)))
    st.SetIndices(Vt.IntArray.FromNumpy(np.ascontiguousarray(flat_faces[used], dtype=np.int32)))
    st.GetAttr().SetCustomDataByKey("unit", "mm")
    define_subsets(mesh, "piece", {name: np.arange(rows.start, rows.stop) for name, rows in pieces.items()})
    # Edges of the sewn mesh that are two edges in the plane.
    sewn, plane = list[IntArray](), list[IntArray]()
    corners = np.where(faces[:, 3] >= 0, 4, 3)
    for count in (3, 4):
        alike = corners == count
        for k in range(count):
            sewn.append(faces[alike][:, [k, (k + 1) % count]])
            plane.append(flat_faces[alike][:, [k, (k + 1) % count]])
    edges, ends = np.concatenate(sewn), np.concatenate(plane)
    turned = edges[:, 0] > edges[:, 1]
    edges[turned], ends[turned] = edges[turned][:, ::-1], ends[turned][:, ::-1]
    # An edge of a seam has faces on both sides, which meet in space and not in the plane.
    both, first, place = np.unique(edges, axis=0, return_index=True, return_inverse=True)
    apart = (ends != ends[first[place.ravel()]]).any(axis=1)
    seams = both[np.unique(place.ravel()[apart])]
    mesh.CreateCreaseIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(seams.ravel(), dtype=np.int32)))
    mesh.CreateCreaseLengthsAttr(Vt.IntArray([2] * len(seams)))
    mesh.CreateCreaseSharpnessesAttr(Vt.FloatArray([_SHARP] * len(seams)))
    export_stage(stage, path)
