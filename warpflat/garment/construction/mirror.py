"""Mirror images: of vertices across a line, found by walking over the mesh to both sides at once, and of a garment's pieces."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from warpflat.core import FloatArray, InputError, IntArray, reflected
from warpflat.flat import Surface, half_edges, join_labels
from warpflat.garment.construction.edges import SAME_PIECE
from warpflat.garment.construction.meet import SAME_PLACE

__all__ = ["even_sides", "image_laid", "match_images", "mirror_images", "mirror_partners", "mirror_plane"]


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


def mirror_plane(points: FloatArray, images: FloatArray) -> tuple[FloatArray, float]:
    """Return the plane at which points (#P by 3 [m]) are mirrored nearest to their images (#P by 3): its unit normal, and its distance [m].

    The sum of squares is least for the normal n in which the middles of points and images spread least and their differences most:
    sum 4 (n . (m - mean m))^2 - (n . (p - q))^2. The plane goes through the mean of the middles.
    """
    middle, apart = 0.5 * (points + images), points - images
    spread = middle - middle.mean(axis=0)
    normal = np.linalg.eigh(4.0 * spread.T @ spread - apart.T @ apart)[1][:, 0]
    normal = normal * np.sign(normal[np.abs(normal).argmax()])
    return normal, float(middle.mean(axis=0) @ normal)


def mirror_images(surfaces: Mapping[str, Surface]) -> dict[str, tuple[str, IntArray]]:
    """Return for each piece of a garment its mirror image, perhaps itself, and for each of its vertices the image's.

    Matched are faces, vertex by vertex, in one plane of symmetry of all pieces in space; pieces without an image are left out.
    """
    from scipy.spatial import cKDTree

    points = np.concatenate([surface.vertices for surface in surfaces.values()])
    middle = points.mean(axis=0)
    tree = cKDTree(points)
    some = points[:: max(1, len(points) // 200)]

    # The normal of a plane of symmetry is a principal axis.
    axes = np.linalg.eigh(np.cov((points - middle).T))[1].T
    axis = next(
        (one for one in axes if np.median(tree.query(reflected(some, one, float(middle @ one)))[0]) < SAME_PLACE), None
    )
    if axis is None:
        return {}
    place = join_labels(len(points), *tree.query_pairs(SAME_PLACE, output_type="ndarray").T)
    away, nearest = tree.query(reflected(points, axis, float(middle @ axis)))
    opposite = np.where(away < 2.0 * SAME_PLACE, place[nearest], -1)
    return match_images(surfaces, place, opposite)


def match_images(
    surfaces: Mapping[str, Surface], place: IntArray, opposite: IntArray
) -> dict[str, tuple[str, IntArray]]:
    """Return for each piece its mirror image, perhaps itself, and for each of its vertices the image's; without pieces that have none.

    Matched face by face: along a line at which a piece is cut open, a vertex is two of the piece.

    Args:
        surfaces: of the pieces.
        place, opposite: of the vertices of all, one piece after another, a number of their place and of its mirror image, -1 for none.
    """
    names = list(surfaces)
    first = np.cumsum([0, *(len(surface.vertices) for surface in surfaces.values())])
    where: dict[frozenset[int], tuple[int, dict[int, int]]] = {}
    for number, surface in enumerate(surfaces.values()):
        for face in surface.faces.tolist():
            own = {int(place[first[number] + vertex]): vertex for vertex in face if vertex >= 0}
            where[frozenset(own)] = number, own
    found = {}
    for number, (name, surface) in enumerate(surfaces.items()):
        partners, mates = np.full(len(surface.vertices), -1, dtype=np.int32), set[int]()
        for face in surface.faces.tolist():
            corners = [vertex for vertex in face if vertex >= 0]
            there = opposite[first[number] + np.array(corners)].tolist()
            mate, own = where.get(frozenset(there), (-1, {}))
            mates.add(mate)
            for vertex, at in zip(corners, there, strict=True):
                partners[vertex] = own.get(at, -1)
        mate = next(iter(mates))
        if (
            len(mates) == 1
            and mate >= 0
            and len(surfaces[names[mate]].vertices) == len(partners) == len(set(partners.tolist()))
        ):
            found[name] = names[mate], partners
    return found


def image_laid(layout: FloatArray, mate: FloatArray, partners: IntArray) -> FloatArray:
    """Return the mirror image of another piece's layout, moved onto a layout (#P by 2 [m]), vertex by vertex.

    Args:
        layout: #P by 2 [m].
        mate: of its mirror image, whose `partners` (#P) are the vertices' own.
    """
    image = mate[partners] * [-1.0, 1.0]
    return np.asarray(image + layout.mean(axis=0) - image.mean(axis=0))


def even_sides(layouts: Mapping[str, FloatArray], images: Mapping[str, tuple[str, IntArray]]) -> dict[str, FloatArray]:
    """Return layouts (#P by 2 [m]) of which each is the mean of itself and of its mirror image's; as they are unless all are nearly that.

    All or none: seams between pieces of which one has moved would not be equal any more.
    """
    made = dict[str, FloatArray]()
    for name, (mate, partners) in images.items():
        own, other = layouts[name], image_laid(layouts[name], layouts[mate], partners)
        if np.abs(own - other).max() < SAME_PIECE:
            made[name] = 0.5 * (own + other)
    return made if made.keys() == layouts.keys() else dict(layouts)
