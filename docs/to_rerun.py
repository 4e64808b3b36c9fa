"""Log the meshes of a frames.usdc to rerun: python docs/to_rerun.py FRAMES.usdc FILM.rrd"""

from __future__ import annotations

import sys

import numpy as np
import rerun as rr
from pxr import Usd, UsdGeom


def encode(colours: np.ndarray) -> np.ndarray:
    """Return linear Rec. 709, as USD has it, as sRGB, as rerun has it (IEC 61966-2-1)."""
    return np.where(colours <= 0.0031308, 12.92 * colours, 1.055 * np.maximum(colours, 0.0) ** (1 / 2.4) - 0.055)


def log_film(source: str, target: str) -> int:
    """Write the film of a USD file as a recording of rerun; return the number of frames."""
    stage = Usd.Stage.Open(source)
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    rr.init("warpflat")
    rr.save(target)
    rr.log("/", rr.ViewCoordinates.RIGHT_HAND_Y_UP, static=True)
    frames = range(int(stage.GetStartTimeCode()), int(stage.GetEndTimeCode()) + 1)
    for frame in frames:
        rr.set_time("frame", sequence=frame)
        for mesh in meshes:
            points = np.array(mesh.GetPointsAttr().Get(frame))
            counts = np.array(mesh.GetFaceVertexCountsAttr().Get(frame))
            corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(frame))
            colours = mesh.GetDisplayColorPrimvar()
            shade = encode(np.array(colours.ComputeFlattened(frame)))  # one for each vertex, or one for all
            if colours.GetInterpolation() == UsdGeom.Tokens.constant:
                shade = np.tile(shade, (len(points), 1))
            # A fan of triangles for each face.
            first = np.repeat(np.cumsum(counts) - counts, counts - 2)
            step = np.concatenate([np.arange(1, count - 1) for count in counts])
            triangles = np.column_stack([corners[first], corners[first + step], corners[first + step + 1]])
            path = UsdGeom.Xformable(mesh).ComputeLocalToWorldTransform(frame)
            world = np.c_[points, np.ones(len(points))] @ np.array(path)
            rr.log(
                str(mesh.GetPath()),
                rr.Mesh3D(vertex_positions=world[:, :3], triangle_indices=triangles, vertex_colors=shade),
            )
    return len(frames)


if __name__ == "__main__":
    print(log_film(*sys.argv[1:3]), "frames")
