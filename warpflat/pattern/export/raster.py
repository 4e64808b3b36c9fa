"""Triangles to pixels with hidden surfaces removed: a scan converter and a shader, as kernels on the CPU.

Drawing libraries draw polygons one by one, which takes tens of seconds for a million faces. Here one kernel runs over
the triangles and keeps the nearest at each sample. Another runs over the pixels and looks up colours and light, once
for each, or for each sample where several triangles meet.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpflat.core import FloatArray, IntArray, launch_quietly, start_warp, unit
from warpflat.kernels.raster import put_nearest, shade_pixels

__all__ = ["Samples", "rasterise", "shade"]

#: Where light comes from: right, up, towards the viewer. The faces' reverse shows little of a map, since that belongs to the front.
LIGHT, BACK = (-0.42, 0.55, 0.72), (0.80, 0.80, 0.79)
_DEPTHS = 2**31 - 1  # steps of depth: what is left of 64 bits beside the sign and the triangle


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """The nearest triangle at each sample of an image, row 0 at the top.

    Attributes:
        front: #R by #C, depth in steps (greater is nearer) times 2^32 plus the index of the triangle; -1 for none. The
            greatest value at a sample is that of the nearest triangle, and of the last among equally near ones.
        back: the depth of step 0.
        step: the depth of a step.
    """

    front: NDArray[np.int64]
    back: float
    step: float

    @cached_property
    def triangle(self) -> IntArray:
        """Index of the triangle (#R by #C), -1 where there is none."""
        return self.front.astype(np.int32)

    def depth_at(self, row: NDArray[Any], column: NDArray[Any]) -> FloatArray:
        """Return the depth at samples (of any shape) to within a step, -inf where there is no triangle."""
        front = self.front[row, column]
        return np.where(front >= 0, self.back + self.step * (front >> 32), -np.inf)


def rasterise(points: FloatArray, triangles: IntArray, shape: tuple[int, int]) -> Samples:
    """Find the nearest triangle at the centre of each sample.

    Args:
        points: #V by 3: column, row (from the top; a sample's centre lies at a half) and depth, greater is nearer.
        triangles: #T by 3, of either winding; those without area cover nothing.
        shape: rows and columns of samples.
    """
    start_warp()
    front = np.full(shape, -1, dtype=np.int64)
    depth = points[:, 2]
    back, nearest = (float(depth.min()), float(depth.max())) if len(points) else (0.0, 0.0)
    step = (nearest - back) / _DEPTHS or 1.0
    inputs = [_shared(points, wp.vec3d), _shared(triangles, wp.vec3i), wp.float64(back), wp.float64(1.0 / step)]
    launch_quietly(put_nearest, dim=len(triangles), inputs=inputs, outputs=[_shared(front, wp.int64)], device="cpu")
    return Samples(front=front, back=back, step=step)


def shade(
    samples: Samples,
    per_pixel: int,
    points: FloatArray,
    triangles: IntArray,
    colours: FloatArray,
    *,
    face: IntArray,
    normals: FloatArray | None = None,
    at_vertices: bool = True,
) -> NDArray[np.uint8]:
    """Return RGBA pixels (#R by #C by 4): the mean colour of their samples, and the covered share as opacity.

    A pixel whose samples all show the same triangle is shaded once, in its middle; others sample by sample.

    Args:
        samples: rows and columns are multiples of `per_pixel`.
        per_pixel: samples of a pixel along either side.
        points, triangles: as they were rasterised.
        colours: #F by 3, sRGB.
        face: #T, the face of each triangle.
        normals: of any length, towards the viewer where the face's front is seen; None for no light.
        at_vertices: whether the normals are those of vertices (#V by 3), to be blended over triangles, or those of triangles (#T by 3).
    """
    rows, columns = (size // per_pixel for size in samples.front.shape)
    pixels = np.zeros((rows, columns, 4), dtype=np.uint8)
    directions = np.zeros((1, 3)) if normals is None else normals
    light = unit(np.array(LIGHT))
    inputs = [
        _shared(samples.triangle, wp.int32),
        per_pixel,
        _shared(points.astype(np.float32), wp.vec3f),
        _shared(triangles, wp.vec3i),
        _shared(face, wp.int32),
        _shared(colours.astype(np.float32), wp.vec3f),
        _shared(directions.astype(np.float32), wp.vec3f),
        normals is not None,
        at_vertices,
        wp.vec3f(*light),
        wp.vec3f(*BACK),
    ]
    launch_quietly(shade_pixels, dim=(rows, columns), inputs=inputs, outputs=[_shared(pixels, wp.vec4ub)], device="cpu")
    return pixels


def _shared(array: NDArray[Any], dtype: Any) -> Any:
    """Return a Warp array over NumPy's memory."""
    return wp.array(np.ascontiguousarray(array), dtype=dtype, device="cpu", copy=False)
