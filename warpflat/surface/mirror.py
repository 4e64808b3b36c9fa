"""Mirror images of vertices, found by walking over the mesh from a line to both sides at once."""

from __future__ import annotations

from collections import deque
from itertools import pairwise

import numpy as np

from warpflat.core.arrays import IntArray
from warpflat.core.errors import InputError
from warpflat.surface.half_edges import half_edges

__all__ = ["mirror_partners"]


def mirror_partners(faces: IntArray, axis: IntArray, *, vertex_count: int) -> IntArray:
    """Return #V, the mirror image of each vertex across a line; itself on the line, -1 for vertices that no face uses.

    Only the connectivity of the faces counts, not their positions: the grid on a scan has mirror images though the body leans.

    Args:
        faces: #F by 4, consistently wound, -1 in the last column of a triangle.
        axis: vertices along mesh edges from border to border, faces on both sides.
        vertex_count: #V.

    Raises:
        InputError: the line runs along the border, or the mesh is not its own mirror image about it.
    """
    he = half_edges(faces)
    before = np.empty_like(he.next)
    before[he.next] = np.arange(len(he.next))
    at = {(t, h): i for i, (t, h) in enumerate(zip(he.tail.tolist(), he.head.tolist(), strict=True))}
    partner = np.full(vertex_count, -1, dtype=np.int32)
    partner[axis] = axis
    waiting: deque[tuple[int, int]] = deque()
    for a, b in pairwise(axis.tolist()):
        if (a, b) not in at or (b, a) not in at:
            raise InputError(f"the line has no faces on both sides between its vertices {a} and {b}")
        waiting.append((at[a, b], at[b, a]))
    done = np.zeros(len(he.tail), dtype=bool)
    while waiting:
        here, there = waiting.popleft()
        if done[here]:
            continue
        # Around the face on this side with its winding, around the other one against it.
        start = here
        while not done[here]:
            done[here] = True
            _pair(partner, int(he.head[here]), int(he.tail[there]))
            _pair(partner, int(he.tail[here]), int(he.head[there]))
            beyond, image = (at.get((int(he.head[h]), int(he.tail[h])), -1) for h in (here, there))
            if (beyond < 0) != (image < 0):
                raise InputError(_unlike(int(he.tail[here])))
            if beyond >= 0 and not done[beyond]:
                waiting.append((beyond, image))
            here, there = int(he.next[here]), int(before[there])
        if here != start or he.tail[there] != partner[he.head[here]]:
            raise InputError(_unlike(int(he.tail[here])))
    return partner


def _pair(partner: IntArray, vertex: int, image: int) -> None:
    """Note two vertices as each other's mirror images.

    Raises:
        InputError: one of them has another image already.
    """
    if partner[vertex] not in (-1, image) or partner[image] not in (-1, vertex):
        raise InputError(_unlike(vertex))
    partner[vertex], partner[image] = image, vertex


def _unlike(vertex: int) -> str:
    return (
        f"the mesh is not its own mirror image about the line (first seen at vertex {vertex}): symmetry needs a mesh whose "
        "faces lie alike on both sides, as a mannequin's do"
    )
