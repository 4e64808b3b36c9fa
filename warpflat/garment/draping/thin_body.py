"""The body around which cloth is sewn: its limbs run on beyond their ends, and it is thin at first, so that every limb is a stick.

Cloth between two legs that stand a few millimetres apart has no side of its own, and neither has a hem at the end of an arm. Around
sticks that go on it has. The thin body is the body less a share of the largest inscribed ball at each vertex, towards its medial axis
(shrinking balls, Ma, Bae and Choi 2012).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from warpflat.core import BoolArray, FloatArray, IntArray, unit
from warpflat.flat import border_loops, mesh_edges, vertex_normals
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.limbs import DRAWN_OUT
from warpflat.garment.mannequin.sampled import neighbour_mean

__all__ = ["ThinBody", "draw_out_limbs"]

# Limbs are drawn out in steps of so much [m]; an arm gets narrower by this share in a step.
_STEP, _NARROWS = 0.02, 0.03
# Beside its end a limb is looked at from so far to so far [m]. Legs end below this share of the body's height.
_BESIDE, _LOW = (0.05, 0.10), 0.3
# The thin body has lost this share of its inscribed balls. No ball is larger than this [m].
_THIN, _LARGEST = 0.65, 0.3
# Rounds of the shrinking ball, and of averaging its radius over neighbours.
_ROUNDS, _SMOOTH = 12, 30


def draw_out_limbs(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Return a body with tubes beyond the ends of its arms and legs; its neck, the highest border, stays as it is.

    Args:
        vertices: #V by 3 [m].
        faces: #F by 4, open at neck, wrists and ankles.
    """
    loops = sorted(border_loops(faces), key=lambda loop: float(vertices[loop, 1].mean()))
    rows, more = [vertices], [faces]
    for loop in loops[:-1]:
        middle = vertices[loop].mean(axis=0)
        far = np.linalg.norm(vertices - middle, axis=1)
        way = middle - vertices[(far > _BESIDE[0]) & (far < _BESIDE[1])].mean(axis=0)
        is_leg = middle[1] < vertices[:, 1].min() + _LOW * np.ptp(vertices[:, 1])
        length, narrows = (DRAWN_OUT["leg"], 0.0) if is_leg else (DRAWN_OUT["arm"], _NARROWS)
        way = np.array([0.0, -1.0, 0.0]) if is_leg else unit(way)
        steps = np.arange(1, round(length / _STEP) + 1)[:, None, None]
        rings = middle + (1.0 - narrows * steps) * (vertices[loop] - middle) + _STEP * steps * way
        count = sum(map(len, rows))
        ring = np.vstack([loop, count + np.arange(rings[..., 0].size).reshape(len(steps), -1)])
        ahead = np.roll(ring, -1, axis=1)
        # The tube runs along the border the other way round than the body's faces do.
        more.append(np.stack([ahead[:-1], ring[:-1], ring[1:], ahead[1:]], axis=-1).reshape(-1, 4).astype(np.int32))
        rows.append(rings.reshape(-1, 3))
    return np.concatenate(rows), np.concatenate(more)


class ThinBody:
    """A body that grows from the thin one to itself, on the search tree of a :class:`Body`."""

    def __init__(self, body: Body, without: BoolArray | None = None, passing: BoolArray | None = None) -> None:
        """Find the inscribed balls.

        Args:
            body: in its own size; it is moved.
            without: #V, vertices of the body that are not there for the cloth that passes.
            passing: of the cloth's vertices, which pass through what is not there.
        """
        self._body, self._trees = body, [body]
        vertices, triangles = body.vertices, body.triangles
        normal = vertex_normals(vertices, triangles)
        # The radius of the largest ball inside the surface that touches it at each vertex, averaged over neighbours.
        tree, radius = cKDTree(vertices), np.full(len(vertices), _LARGEST)
        for _ in range(_ROUNDS):
            far, near = tree.query(vertices - radius[:, None] * normal)
            off = vertices - vertices[near]
            height = np.einsum("ij,ij->i", off, normal)
            smaller = np.einsum("ij,ij->i", off, off) / (2.0 * np.maximum(height, 1e-9))
            inside = (far < radius - 1e-5) & (height > 1e-6)
            radius = np.where(inside, np.minimum(smaller, radius), radius)
        mean = neighbour_mean(mesh_edges(triangles), len(vertices))
        for _ in range(_SMOOTH):
            radius = 0.5 * radius + 0.5 * (mean @ radius)
        self._inwards = _THIN * radius[:, None] * normal
        self._passing = np.empty(0, np.int64)
        if without is not None and passing is not None and passing.any():
            self._passing = np.flatnonzero(passing)
            kept = triangles[~without[triangles].any(axis=1)]
            self._trees.append(Body(vertices, kept, device=body.device))

    def grow(self, share: float) -> None:
        """Let it grow to a share of the way from the thin body (0) to the whole one (1)."""
        for tree in self._trees:
            tree.move(self._body.vertices - (1.0 - share) * self._inwards)

    def nearest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the nearest places (#P by 3 [m]) and unit normals for the cloth's vertices: see :meth:`Body.nearest`."""
        centre, normal = self._body.nearest(points)
        if len(self._passing):
            centre[self._passing], normal[self._passing] = self._trees[1].nearest(points[self._passing])
        return centre, normal
