"""The ease of a worn garment by level: its girth around the trunk over the body's; and a garment made wider or narrower there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from warpflat.core import FloatArray, unit
from warpflat.flat import vertex_normals
from warpflat.garment.construction.carry import skin_under
from warpflat.garment.mannequin.body_landmarks import model_places
from warpflat.garment.mannequin.body_model import finer_body
from warpflat.garment.mannequin.common_body import CommonBody
from warpflat.garment.mannequin.profiles import convex_girth
from warpflat.garment.mannequin.scan_levels import TRUNK
from warpflat.garment.mannequin.slicer import UP, Slicer, largest

__all__ = ["EASE_LEVELS", "level_ease", "widened"]

#: Levels at which ease is measured, from the top down.
EASE_LEVELS = TRUNK
# Above the bust what is asked there fades out, up to here.
_TOP = "front_neck"


def level_ease(
    body: CommonBody, layers: Sequence[tuple[FloatArray, NDArray[np.int64]]]
) -> dict[str, tuple[float, float]]:
    """Return by level the girths of the garment and of the body [m]; without levels at which it is open, or that it does not cover.

    Where armholes reach below a level, the section runs on into the sleeves: a tape lies on the cloth of the trunk alone.

    Args:
        body: on which it is worn.
        layers: of the garment, vertices (#V by 3 [m]) and triangles (#T by 3).
    """
    skin = Slicer(body.vertices, finer_body()[1])
    slicers = [Slicer(vertices, triangles) for vertices, triangles in layers]
    places, nearest, found = model_places(), cKDTree(body.vertices), {}
    of_arm = places.strips["arms"]
    for name in EASE_LEVELS:
        height = body.level(name)
        trunk = largest(skin.cut(UP, height)).points[:, [0, 2]]
        middle = 0.5 * (trunk.min(axis=0) + trunk.max(axis=0))
        rings = []
        for part in (part for slicer in slicers for part in slicer.cut(UP, height) if part.closed):
            sleeve = of_arm[nearest.query(part.points)[1]]
            points = part.points[~sleeve][:, [0, 2]]
            if len(points) > 2 and (points.min(axis=0) < middle).all() and (points.max(axis=0) > middle).all():
                rings.append(convex_girth(points) if sleeve.any() else part.length)
        if rings:
            found[name] = max(rings), convex_girth(trunk)
    return found


def widened(
    body: CommonBody, layers: Sequence[tuple[FloatArray, NDArray[np.int64]]], wished: Mapping[str, float]
) -> list[FloatArray]:
    """Return the vertices of a garment's layers [m], moved to or off the trunk until its ease is as wished.

    A level that is not wished keeps its ease; between levels it changes evenly, below the last one as there.

    Args:
        body: on which it is worn.
        layers: as :func:`level_ease` takes them.
        wished: ease by level [m].
    """
    has = level_ease(body, layers)
    more = {name: wished.get(name, girths[0] - girths[1]) - (girths[0] - girths[1]) for name, girths in has.items()}
    if not more:
        return [vertices for vertices, _ in layers]
    order = sorted(more, key=body.level)
    heights = [*(body.level(name) for name in order), max(body.level(_TOP), body.level(order[-1]) + 0.05)]
    # A tape that lies so much farther off is longer by a whole turn's share.
    off = [*(more[name] / (2.0 * np.pi) for name in order), 0.0]
    skin = vertex_normals(body.vertices, finer_body()[1])
    arm = model_places().strips["arms"].astype(float)
    out = []
    for vertices, triangles in layers:
        near, weight, _ = skin_under(
            vertices, vertex_normals(vertices, triangles), body.vertices, CommonBody.skin_triangles()
        )
        way = unit(np.einsum("pk,pka->pa", weight, skin[near]) * [1.0, 0.0, 1.0])
        here = np.interp(vertices[:, 1], heights, off) * (1.0 - np.einsum("pk,pk->p", weight, arm[near]))
        out.append(vertices + here[:, None] * way)
    return out
