"""Bent quads laid flat.

Four points in space do not say along which diagonal their quad is creased: both ways of splitting it can be unfolded, into
different flat quads. The mesh around it decides: the surface is straight along a crease, as along a ruling of a cylinder, so its
normal does not turn along the crease, but across it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.launch import launch_each
from warpflat.core.sorting import counting_sort
from warpflat.flat.surface.connectivity import coincident_vertices
from warpflat.flat.surface.mesh import Surface, once_per_faces, read_only
from warpflat.kernels.unfold import average_normals, find_bends, find_creases
from warpflat.kernels.unfold import lay_cells as lay_each

__all__ = ["VertexLists", "corners_around", "corners_of", "lay_cells", "quad_creases", "vertex_normals"]


@dataclass(frozen=True, kw_only=True)
class VertexLists:
    """Lists of items around each vertex.

    Attributes:
        offset: #V+1, the place where the entries of each vertex begin.
        entry: the items.
    """

    offset: IntArray
    entry: IntArray


def quad_creases(
    vertices: FloatArray,
    faces: IntArray,
    *,
    border: IntArray | None = None,
    around: tuple[IntArray, IntArray] | None = None,
) -> NDArray[np.int8]:
    """Find the diagonal along which each quad is creased.

    Args:
        vertices: #V by 3, positions [m]. Vertices at the same place count as one, so that a cut changes nothing.
        faces: #F by 4, -1 in the last column of a triangle.
        border: the sorted vertices on the border, if they are known.
        around: the result of `corners_around`, if it is known.

    Returns:
        #F, 0 for the diagonal of corners 0-2, 1 for 1-3, and -1 for a triangle and where a quad is flat, not convex, or
        twisted, with neither diagonal straighter on the surface than the other. Where the mesh around does not decide, as for
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
    count, place = len(vertices), coincident_vertices(vertices, faces, border=border)
    if (place != np.arange(count)).any():
        faces, around = np.where(faces >= 0, place[faces], -1).astype(np.int32), None
    offset, corner = around or corners_around(faces, count)
    at_vertex = np.empty((count, 3))
    launch_each(average_normals, count, [offset, corner, normal], [at_vertex])
    launch_each(find_creases, len(faces), [vertices, faces, bent, at_vertex], [crease])
    return crease


def corners_around(faces: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """List the faces' corners around each vertex.

    Args:
        faces: #F by 4, -1 in the last column of a triangle.
        count: #V.

    Returns:
        #V+1, the place where the corners of each vertex begin, and the corners, each 4 times its face plus its column.
    """
    if (faces[:, 3] >= 0).all():
        corner, offset = counting_sort(faces.ravel(), count)
        return offset, corner
    # The missing corners of triangles are sorted behind all others, as those of a vertex #V, and left out.
    corner, offset = counting_sort(np.where(faces >= 0, faces, np.int32(count)).ravel(), count + 1)
    return offset[:-1], corner[: offset[count]]


@once_per_faces
def corners_of(surface: Surface) -> VertexLists:
    """Return the faces' corners around each vertex (see `corners_around`), computed once per array of faces."""
    offset, entry = corners_around(surface.faces, len(surface.vertices))
    return read_only(VertexLists(offset=offset, entry=entry))


def vertex_normals(surface: Surface) -> FloatArray:
    """Return #V by 3, unit normals: the area-weighted mean of the faces around each vertex; 0 without faces, or where they cancel."""
    normal, at_vertex = np.empty((len(surface.faces), 3)), np.empty((len(surface.vertices), 3))
    launch_each(
        find_bends, len(normal), [surface.vertices, surface.faces], [normal, np.empty(len(normal), dtype=np.int8)]
    )
    around = corners_of(surface)
    launch_each(average_normals, len(at_vertex), [around.offset, around.entry, normal], [at_vertex])
    return at_vertex


def lay_cells(vertices: FloatArray, faces: IntArray, crease: NDArray[np.int8], cell: IntArray) -> FloatArray:
    """Lay the cells of all faces flat. The four cells of a creased quad come from the quad that it unfolds into.

    Args:
        vertices: #V by 3, positions [m].
        faces: #F by 4, -1 in the last column of a triangle.
        crease: #F, the result of `quad_creases`.
        cell: #F, the first of each face's cells (`corner_triangles`).

    Returns:
        #C by 3: with a cell's corner 0 at the origin and corner 1 along x, x of corner 1, x and y of corner 2 [m].
    """
    count = 0 if len(faces) == 0 else int(cell[-1]) + (4 if faces[-1, 3] >= 0 else 1)
    laid = np.empty((count, 3))
    launch_each(lay_each, len(faces), [vertices, faces, crease, cell], [laid])
    return laid
