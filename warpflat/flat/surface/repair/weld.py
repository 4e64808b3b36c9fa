"""Welding: vertices at one place become one vertex."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.flat.surface.connectivity import components, euler_characteristic, join_labels
from warpflat.flat.surface.half_edges import half_edges
from warpflat.flat.surface.repair.polygons import distinct_corners

__all__ = ["is_sheet", "t_junction", "weld_map", "welding"]

# Share of the bounding box's diagonal within which vertices count as one place: float32's resolution.
_SAME_PLACE = 1e-7
# A vertex lies on an edge if it is within the first share of the edge's length, and at least the second from the edge's ends.
_ON_EDGE, _OFF_ENDS = 1e-3, 1e-2


def weld_map(vertices: FloatArray) -> IntArray:
    """Return #V, for each vertex the first vertex at the same place (to 1e-7 of the bounding box's diagonal)."""
    from scipy.spatial import cKDTree

    size = len(vertices)
    order = np.lexsort(vertices.T)
    same = (vertices[order[1:]] == vertices[order[:-1]]).all(axis=1)
    group = np.empty(size, dtype=np.int64)
    group[order] = np.concatenate([[0], np.cumsum(~same)])
    _, first = np.unique(group, return_index=True)
    close = _SAME_PLACE * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    pairs = cKDTree(vertices[first]).query_pairs(close, output_type="ndarray")
    if len(pairs):
        group = join_labels(len(first), *pairs.T).astype(np.int64)[group]
        _, first = np.unique(group, return_index=True)
    return first[group].astype(np.int32)


def is_sheet(faces: IntArray) -> bool:
    """Return whether faces form one part without handles and with one border, which lies flat without a cut."""
    he = half_edges(faces)
    if len(faces) == 0 or (he.count > 2).any() or components(faces).max() > 0 or not (he.count == 1).any():
        return False
    return euler_characteristic(faces) == 1


def welding(
    vertices: FloatArray,
    faces: IntArray,
    *,
    parts: int,
    weld: Literal[True] | None,
    split_corners: bool,
    part_chosen: bool,
) -> tuple[IntArray | None, str]:
    """Decide whether to weld a mesh, and how.

    Args:
        vertices: #V by 3, positions [m].
        faces: #F by 4.
        parts: number of connected components of the faces.
        weld: the user's choice; None to decide by the mesh.
        split_corners: the format has a vertex per corner of a face or per texture coordinate: weld, unless the faces
            form one sheet as they stand and welding would close it.
        part_chosen: the user chose one of several parts: they are meant to stay apart.

    Returns:
        #V, the vertex to use for each, or None to leave all; and a note ("" for none).
    """
    soup = parts > 1 and 2 * parts > len(faces)
    if weld is None and not split_corners and parts == 1:
        return None, ""
    place = weld_map(vertices)
    used = np.unique(faces[faces >= 0])
    joined = len(used) - len(np.unique(place[used]))
    if joined == 0:
        return None, ""
    if weld is None:
        distinct, keep, _ = distinct_corners(np.where(faces >= 0, place[faces], -1))
        sheet = is_sheet(distinct[keep].astype(np.int32))
        if split_corners or soup:
            if not sheet and is_sheet(faces):
                return (
                    None,
                    f"{joined:,} vertices left apart from another at the same place: joining would close the piece",
                )
        elif part_chosen or not sheet:
            return None, ""
    return place, f"vertices that lay at the same place as another one joined to it: {joined:,}"


def t_junction(vertices: FloatArray, faces: IntArray, part: NDArray[np.integer]) -> tuple[int, int, int] | None:
    """Return a vertex at the border of one part that lies on a border edge of another, and this edge's ends; None where there is none.

    Args:
        vertices: #V by 3, positions [m].
        faces: #F by 4.
        part: #F, the part of each.
    """
    from scipy.spatial import cKDTree

    he = half_edges(faces)
    border = np.flatnonzero(he.count[he.edge] == 1)
    ends, component = he.edges[he.edge[border]], part[he.face[border]]
    start, vector = vertices[ends[:, 0]], vertices[ends[:, 1]] - vertices[ends[:, 0]]
    length = np.linalg.norm(vector, axis=1)
    if not length.any():
        return None
    places, first = np.unique(he.tail[border], return_index=True)
    near = cKDTree(vertices[places]).query_ball_point(start + 0.5 * vector, (0.5 + _ON_EDGE) * length)
    for edge, found in enumerate(near):
        found = np.asarray(found, dtype=np.int64)
        found = found[component[first[found]] != component[edge]]
        to = vertices[places[found]] - start[edge]
        along = to @ vector[edge] / max(length[edge] ** 2, np.finfo(float).tiny)
        off = np.linalg.norm(to - along[:, None] * vector[edge], axis=1)
        on = (off < _ON_EDGE * length[edge]) & (along > _OFF_ENDS) & (along < 1.0 - _OFF_ENDS)
        if on.any():
            return int(places[found[np.argmax(on)]]), int(ends[edge, 0]), int(ends[edge, 1])
    return None
