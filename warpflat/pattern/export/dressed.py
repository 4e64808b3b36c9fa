"""A worn garment with the part of the body around it, as one mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpflat.core import FloatArray, IntArray
from warpflat.flat import join_labels, triangulate
from warpflat.pattern.export.colours import SKIN
from warpflat.pattern.export.geometry import outline_edges
from warpflat.pattern.export.views import Facets, make_facets

__all__ = ["Body", "crop_body", "dress"]

# How far the mannequin shows around the garment [m].
_AROUND = 0.06
# A part of the body with a smaller share of the largest part's triangles is not drawn.
_SCRAP = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """The body under a garment.

    Attributes:
        vertices: #V by 3 [m], Y up, facing +Z.
        faces: #F by 3 or 4.
    """

    vertices: FloatArray
    faces: IntArray


def dress(
    body: Body, worn: FloatArray, faces: IntArray, room: FloatArray | None = None
) -> tuple[FloatArray, Facets, FloatArray]:
    """Return a worn garment and then the body around it: vertices, facets, and the colours of the body's faces (sRGB).

    Outlines of pieces, which have vertices of their own, show the seams; the body has none.

    Args:
        body: under it.
        worn: #P by 3, the garment's vertices [m].
        faces: #F by 4.
        room: places around which the body is shown (#N by 3 [m]); those of the garment if not given.
    """
    near, skin = crop_body(body, worn if room is None else room)
    all_faces = np.concatenate([faces, np.column_stack([near + len(worn), np.full(len(near), -1)])])
    facets = make_facets(all_faces.astype(np.int32), outline_edges(faces))
    return np.concatenate([worn, skin]), facets, np.tile(SKIN, (len(near), 1))


def crop_body(body: Body, worn: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return what of a body is near a garment (#P by 3), as triangles and vertices.

    Arms end beside the garment, as those of a dress form do: they would take a third of the page. Their ends are closed.
    """
    triangles, vertices, ends = triangulate(body.faces)[0], body.vertices, list[IntArray]()
    for axis, sign in ((1, 1.0), (1, -1.0), (0, 1.0), (0, -1.0)):
        limit = float((sign * worn[:, axis]).max()) + _AROUND
        triangles, vertices, edges = _cut(triangles, vertices, sign * vertices[:, axis] - limit)
        ends += [edges] if axis == 0 else []
    # Small parts of hands and arms would hang in the air.
    label = join_labels(len(vertices), triangles[:, :2].ravel(), triangles[:, 1:].ravel())[triangles[:, 0]]
    size = np.bincount(label)
    triangles = triangles[size[label] >= _SCRAP * size.max(initial=0)]
    for end in ends:
        edges = end[np.isin(end, triangles).all(axis=1)]
        if len(edges):
            # With vertices of its own: light does not bend around its edge.
            rim = vertices[edges.ravel()]
            copies = len(vertices) + np.arange(len(rim)).reshape(-1, 2)
            cap = np.column_stack([copies, np.full(len(copies), len(vertices) + len(rim))])
            vertices = np.concatenate([vertices, rim, rim.mean(axis=0)[None]])
            triangles = np.concatenate([triangles, cap])
    return triangles.astype(np.int32), vertices


def _cut(triangles: IntArray, vertices: FloatArray, beyond: FloatArray) -> tuple[IntArray, FloatArray, IntArray]:
    """Leave out what of a mesh lies where `beyond` (#V) is positive; return triangles, vertices and the edges of the cut."""
    outside = beyond[triangles] > 0.0
    number = outside.sum(axis=1)
    found, edges = [triangles[number == 0]], []
    for several, alone_is_outside in ((1, True), (2, False)):
        crossed = triangles[number == several]
        # The vertex that is alone on its side comes first.
        first = (outside[number == several] == alone_is_outside).argmax(axis=1)
        a, b, c = np.take_along_axis(crossed, (first[:, None] + np.arange(3)) % 3, axis=1).T
        p, q = len(vertices) + np.arange(2 * len(a)).reshape(2, -1)
        ends = np.concatenate([b, c])
        share = (beyond[np.tile(a, 2)] / (beyond[np.tile(a, 2)] - beyond[ends]))[:, None]
        vertices = np.concatenate([vertices, (1.0 - share) * vertices[np.tile(a, 2)] + share * vertices[ends]])
        parts = ((p, b, c), (p, c, q)) if alone_is_outside else ((a, p, q),)
        found += [np.column_stack(part) for part in parts]
        # As a face beyond the cut would have them, so that it looks outwards.
        edges.append(np.column_stack([p, q] if alone_is_outside else [q, p]))
    return np.concatenate(found), vertices, np.concatenate(edges)
