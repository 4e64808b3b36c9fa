"""Bent quads laid flat.

Four points in space do not say along which diagonal their quad is creased: both ways of splitting it can be unfolded, into
different flat quads. The mesh around tells. Along a crease, as along a ruling of a cylinder, the surface is straight, so its
normal does not turn; across it does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.kernels.surface_cells import average_normals, find_bends, find_creases
from warpflat.kernels.surface_cells import lay_cells as lay_each
from warpflat.launching import launch_each
from warpflat.surface.topology import HalfEdges, order_by, places_of

__all__ = ["lay_cells", "quad_creases"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


def quad_creases(vertices: FloatArray, faces: IntArray, *, sides: HalfEdges | None = None) -> NDArray[np.int8]:
    """Along which diagonal each quad is creased.

    Args:
        vertices: #V by 3, positions [m]. Vertices at the same place count as one, so that a cut changes nothing.
        faces: #F by 4, -1 in the last column of a triangle.
        sides: of the faces, if they are known.

    Returns:
        #F, 0 for the diagonal of corners 0-2, 1 for 1-3, and -1 for a triangle and where a quad is flat, not convex, or
        twisted, with neither diagonal straighter on the surface than the other. Where the mesh around tells nothing, as beside
        a quad without neighbours, it is the longer one: a rectangle's diagonals are equal until it is creased, and then the
        other one is shorter.
    """
    crease = np.full(len(faces), -1, dtype=np.int8)
    is_quad = faces[:, 3] >= 0
    if not is_quad.any():
        return crease
    normal, bent = np.empty((len(faces), 3)), np.empty(len(faces), dtype=np.int8)
    launch_each(find_bends, len(faces), [vertices, faces], [normal, bent])
    if not bent.any():
        return crease
    count, place = len(vertices), places_of(vertices, faces, sides=sides)
    if (place != np.arange(count)).any():
        faces = np.where(faces >= 0, place[faces], -1).astype(np.int32)
    # The fourth corner of a triangle is that of one vertex more, of which nobody asks.
    at = faces if is_quad.all() else np.where(faces >= 0, faces, np.int32(count))
    corner, offset = order_by(at.ravel(), count + 1)
    at_vertex = np.empty((count, 3))
    launch_each(average_normals, count, [offset, corner, normal], [at_vertex])
    launch_each(find_creases, len(faces), [vertices, faces, bent, at_vertex], [crease])
    return crease


def lay_cells(
    vertices: FloatArray, faces: IntArray, crease: NDArray[np.int8], cell: IntArray
) -> tuple[FloatArray, FloatArray]:
    """The cells of all faces laid flat; the four of a creased quad come from the one quad that it unfolds into.

    Args:
        vertices: #V by 3, positions [m].
        faces: #F by 4, -1 in the last column of a triangle.
        crease: #F, as `quad_creases` has it.
        cell: #F, the first of each face's cells (`corner_triangles`).

    Returns:
        #C by 2 by 2, edges from a cell's corner 0 to corners 1 and 2 as columns, the first along x [m]; and #C, its area,
        of a quad's by half [m2].
    """
    count = 0 if len(faces) == 0 else int(cell[-1]) + (4 if faces[-1, 3] >= 0 else 1)
    edges, area = np.empty((count, 2, 2)), np.empty(count)
    launch_each(lay_each, len(faces), [vertices, faces, crease, cell], [edges, area])
    return edges, area
