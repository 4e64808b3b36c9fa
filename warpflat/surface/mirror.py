"""Which vertex of a mesh is the mirror image of which: its connectivity walked from a line to both sides at once."""

from __future__ import annotations

from collections import deque
from itertools import pairwise

import numpy as np

from warpflat.core.arrays import IntArray
from warpflat.core.errors import InputError
from warpflat.surface.topology import half_edges

__all__ = ["mirror_partners"]


def mirror_partners(faces: IntArray, axis: IntArray, *, vertex_count: int) -> IntArray:
    """#V, for each vertex its partner across a line; itself on the line, -1 for vertices that no face uses.

    Only how faces hang together counts, not where they lie: a scan's grid has partners too, though the body leans.

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
            for vertex, image in ((he.head[here], he.tail[there]), (he.tail[here], he.head[there])):
                if partner[vertex] not in (-1, image) or partner[image] not in (-1, vertex):
                    raise InputError(_unlike(int(vertex)))
                partner[vertex], partner[image] = image, vertex
            beyond = (
                at.get((int(he.head[here]), int(he.tail[here]))),
                at.get((int(he.head[there]), int(he.tail[there]))),
            )
            if (beyond[0] is None) != (beyond[1] is None):
                raise InputError(_unlike(int(he.tail[here])))
            if beyond[0] is not None and beyond[1] is not None and not done[beyond[0]]:
                waiting.append((beyond[0], beyond[1]))
            here, there = int(he.next[here]), int(before[there])
        if here != start or he.tail[there] != partner[he.head[here]]:
            raise InputError(_unlike(int(he.tail[here])))
    return partner


def _unlike(vertex: int) -> str:
    return (
        f"the mesh is not its own mirror image about the line (first seen at vertex {vertex}): symmetry needs a mesh whose "
        "faces lie alike on both sides, as a mannequin's do"
    )
