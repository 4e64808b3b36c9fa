"""A worn garment with the part of the body around it, as one mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpflat.core import FloatArray, IntArray
from warpflat.flat import border_edges, join_labels, triangulate
from warpflat.pattern.export.colours import SKIN
from warpflat.pattern.export.views import Facets

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
    facets = Facets.of(all_faces.astype(np.int32), border_edges(faces))
    return np.concatenate([worn, skin]), facets, np.tile(SKIN, (len(near), 1))


def crop_body(body: Body, worn: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return what of a body is near a garment (#P by 3), as triangles and vertices.

    Arms end beside the garment, as those of a dress form do: they would take a third of the page. Their ends are closed.
    """
    import trimesh

    low, high = worn.min(axis=0) - _AROUND, worn.max(axis=0) + _AROUND
    inwards = [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]
    whole = trimesh.Trimesh(body.vertices, triangulate(body.faces)[0], process=False)
    near = whole.slice_plane([low, high, low, high], inwards)
    triangles, vertices = np.asarray(near.faces), np.asarray(near.vertices)
    # Small parts of hands and arms would hang in the air.
    label = join_labels(len(vertices), triangles[:, :2].ravel(), triangles[:, 1:].ravel())[triangles[:, 0]]
    size = np.bincount(label)
    triangles = triangles[size[label] >= _SCRAP * size.max(initial=0)]
    border = border_edges(triangles)
    for end in (low[0], high[0]):
        # Turned round, so that the face beyond the edges looks outwards.
        edges = border[(np.abs(vertices[border, 0] - end) < 1e-9).all(axis=1)][:, ::-1]
        if len(edges):
            # With vertices of its own: light does not bend around its edge.
            rim = vertices[edges.ravel()]
            copies = len(vertices) + np.arange(len(rim)).reshape(-1, 2)
            cap = np.column_stack([copies, np.full(len(copies), len(vertices) + len(rim))])
            vertices = np.concatenate([vertices, rim, rim.mean(axis=0)[None]])
            triangles = np.concatenate([triangles, cap])
    return triangles.astype(np.int32), vertices
