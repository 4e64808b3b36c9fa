"""Sewn cloth is drawn together around a thin body, and the body grows into it: where a pattern from outside starts to be draped.

The cloth is drawn together as rigidly as it can be, outside the body, by projective dynamics (Bouaziz et al. 2014): each triangle is laid
as near to its place as it goes without strain, and one sparse factor joins them. It is first gathered around the thin body, then the
body grows, then the cloth settles on it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_array, diags_array

from warpflat.core import BoolArray, FloatArray, IntArray, factor_symmetric, nearest_on_polyline
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.sewn_cloth import SewnCloth
from warpflat.garment.draping.thin_body import ThinBody

__all__ = ["AsRigid", "sew_around", "stretches"]

# Rounds around the thin body, while it grows, and around the whole one. The factor is renewed after so many, or where contact comes to
# more than this share of the vertices: before free cloth has fallen through a wrist, which the thin body has 9 mm in radius.
_GATHER, _GROW, _SETTLE, _RENEWED, _NEW_CONTACT = 60, 60, 30, 2, 0.02
# The cloth is kept so far off the body [m]; planes farther than this do not count.
_OFF, _REACH = 0.002, 0.12
# Stiffness over the cloth's: of inertia, of openings that stay around their limbs, of contact, of what stays, and of bending.
_INERTIA, _RING, _HOLD, _STAY, _BEND = 0.02, 0.1, 1.0, 1e3, 0.02
# What hangs from no shoulder goes back to its height by this share until the body has grown. What hangs free falls by so much [m] a round.
_KEEP, _FALL = 0.1, 0.003


def sew_around(
    cloth: SewnCloth,
    start: FloatArray,
    body: Body | ThinBody,
    *,
    fixed: BoolArray | None = None,
    level: BoolArray | None = None,
    rings: Sequence[tuple[IntArray, FloatArray]] = (),
) -> FloatArray:
    """Draw sewn cloth together around a body, nearly without strain.

    Args:
        cloth: the sewn cloth.
        start: #V by 3, where its vertices are [m].
        body: what it stays outside of; a thin one grows.
        fixed: #V, the vertices that stay there.
        level: #V, those that keep their height until the body has grown.
        rings: openings (#R, their vertices) and the limb that goes through each (#P by 3 [m]); its middle is drawn to the limb until the
            body has grown.

    Returns:
        #V by 3 [m].
    """
    rigid = AsRigid(cloth)
    gather, grow = (_GATHER, _GROW) if isinstance(body, ThinBody) else (0, 0)
    stays, kept = (np.zeros(len(start), bool) if given is None else given for given in (fixed, level))
    x, touching = start.copy(), np.zeros(len(start), bool)
    for number in range(gather + grow + _SETTLE):
        if isinstance(body, ThinBody) and number <= gather + grow:
            body.grow(float(np.clip((number - gather) / grow, 0.0, 1.0)))
        centre, normal = body.nearest(x)
        depth = np.einsum("ij,ij->i", x - centre, normal)
        near = (depth < _OFF) & (np.linalg.norm(x - centre, axis=1) < _REACH)
        if number % _RENEWED == 0 or (near & ~touching).sum() > _NEW_CONTACT * len(x):
            touching = near
            around = np.zeros(len(x))
            if number < gather + grow:
                for ring, _ in rings:
                    around[ring] = _RING
            rigid.hold(_INERTIA + np.maximum(_HOLD * touching, around) + _STAY * stays)
        target = np.where((near & touching)[:, None], x + (_OFF - depth)[:, None] * normal, x)
        if grow:
            grown = number >= gather + grow
            target[:, 1] += (
                _KEEP * (start[:, 1] - x[:, 1]) * (kept & (not grown)) - _FALL * (number >= gather // 2) * ~near
            )
            if not grown:
                for ring, limb in rings:
                    middle = x[ring].mean(axis=0)
                    target[ring] += nearest_on_polyline(middle, limb) - middle
        target[stays] = start[stays]
        x = rigid.step(x, target)
    return x


class AsRigid:
    """Cloth that is drawn to targets as rigidly as possible.

    Attributes:
        membrane: #V by #V, the Dirichlet form of the flat cloth.
    """

    def __init__(self, cloth: SewnCloth) -> None:
        # The derivative of the places along warp and weft in each cell, 2 #C by #V, and the cells' areas, twice each.
        corner, _, gradient, area = cloth.cells()
        rows = np.broadcast_to(np.arange(2 * len(corner)).reshape(-1, 1, 2), gradient.shape)
        places, shape = (rows.ravel(), np.repeat(corner.ravel(), 2)), (2 * len(corner), len(cloth.designed))
        self._derivative = coo_array((gradient.ravel(), places), shape=shape).tocsr()
        self._stiffness = np.repeat(area, 2)
        # Bending is the squared Laplacian at inner vertices, scaled by the mesh so that it weighs as the membrane does.
        laplacian, of_vertex = cloth.laplacian()
        self.membrane = -laplacian
        own = cloth.vertex_areas()
        inner = np.where(of_vertex > 0.0, own.mean() / np.maximum(own, 0.2 * own.mean()), 0.0)
        self._whole = self.membrane + _BEND * (laplacian.T @ diags_array(inner) @ laplacian)

    def hold(self, weight: FloatArray) -> None:
        """Hold vertices at their targets, by #V weights over the mean stiffness of the cloth."""
        self._pull = self.membrane.diagonal().mean() * weight
        self._solve = factor_symmetric(self._whole + diags_array(self._pull))

    def step(self, x: FloatArray, target: FloatArray) -> FloatArray:
        """Return the places after a step from x to targets, #V by 3 each [m]."""
        turned = _nearest_isometries((self._derivative @ x).reshape(-1, 2, 3)).reshape(-1, 3)
        right = self._derivative.T @ (self._stiffness[:, None] * turned) + self._pull[:, None] * target
        return np.asarray(self._solve(right))


def stretches(cloth: SewnCloth, positions: FloatArray) -> FloatArray:
    """Return #C, how much the more stretched thread of each cell is longer than in the flat pattern, as a share."""
    return np.asarray(np.linalg.norm(cloth.threads(positions), axis=2).max(axis=0) - 1.0)


def _nearest_isometries(frames: FloatArray) -> FloatArray:
    """Return the pairs of orthonormal rows nearest to pairs of rows F (#C by 2 by 3): (F F^T)^(-1/2) F, in closed form."""
    square = np.einsum("cik,cjk->cij", frames, frames)
    square[:, [0, 1], [0, 1]] += 1e-12
    root = np.sqrt(square[:, 0, 0] * square[:, 1, 1] - square[:, 0, 1] ** 2)
    root = np.maximum(root, 1e-12)[:, None, None] * np.eye(2)
    # The square root of a symmetric 2 by 2 matrix C is (C + sqrt(det C) I) / sqrt(tr C + 2 sqrt(det C)).
    middle = (square + root) / np.sqrt(np.trace(square + root, axis1=1, axis2=2))[:, None, None]
    return np.asarray(np.linalg.solve(middle, frames))
