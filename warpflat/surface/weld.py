"""Which vertices at one place are one vertex."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.surface.polygons import distinct_corners
from warpflat.surface.topology import components, euler_characteristic, half_edges

__all__ = ["is_sheet", "weld_map", "welding"]

# Share of the bounding box's diagonal within which vertices count as one place: float32's resolution.
_SAME_PLACE = 1e-7


def weld_map(vertices: NDArray[np.float64]) -> NDArray[np.int32]:
    """#V, for each vertex the first vertex at the same place (to 1e-7 of the bounding box's diagonal)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
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
        graph = coo_matrix((np.ones(len(pairs), dtype=np.int8), pairs.T), shape=(len(first), len(first)))
        group = connected_components(graph, directed=False)[1][group]
        _, first = np.unique(group, return_index=True)
    return first[group].astype(np.int32)


def is_sheet(faces: NDArray[np.int32]) -> bool:
    """Whether faces form one part without handles and with one border: something that lies flat without a cut."""
    he = half_edges(faces)
    if len(faces) == 0 or (he.count > 2).any() or components(faces).max() > 0 or not (he.count == 1).any():
        return False
    return euler_characteristic(faces) == 1


def welding(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    *,
    weld: bool | None,
    split_corners: bool,
    part_chosen: bool,
) -> tuple[NDArray[np.int32] | None, str]:
    """Whether to weld, and how.

    Args:
        vertices: #V by 3, positions [m].
        faces: #F by 4.
        weld: the user's word; None to judge by the mesh.
        split_corners: the format has a vertex per corner of a face or per texture coordinate: weld, unless the faces
            form one sheet as they stand and welding would close it.
        part_chosen: the user chose one of several parts: they are meant to stay apart.

    Returns:
        #V, for each vertex the one to use, or None to leave all; and what to note ("" for nothing).
    """
    if weld is False:
        return None, ""
    parts = int(components(faces).max()) + 1
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
