"""Pieces that stay upright: the chord of the datum points up, since the datum is the grain.

Nothing else says how a piece lies on the cloth, so that it would turn for ever to please a guard bound to the plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpflat.sums import dot

__all__ = ["Upright", "held_upright", "without_turning"]

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True)
class Upright:
    """A piece and the two of its vertices that lie one above the other.

    Attributes:
        lower, upper: vertex indices.
        vertices: those of the piece; all, if not given.
    """

    lower: int
    upper: int
    vertices: slice = field(default_factory=lambda: slice(None))


def held_upright(
    pieces: Sequence[Upright], position: FloatArray, velocity: FloatArray, force: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Each piece turned about its centre so that its chord points up.

    Args:
        pieces: which.
        position, velocity: #V by 2 [m], [m/s].
        force: #V by 2, of the cloth, in the layout as it is given [N].
        weight: #V, by which motion is averaged.

    Returns:
        #V by 2 each: positions; velocities without what turning there was in them; and the load [N], spread over a piece, that
        balances the torque with which its cloth would turn.
    """
    place, moving, pull = _complex(position).copy(), _complex(velocity).copy(), _complex(force)
    load = np.zeros_like(place)
    for piece in pieces:
        here = piece.vertices
        chord = place[piece.upper] - place[piece.lower]
        length = float(np.abs(chord))
        turn = 1j * length / chord if length > 0.0 else 1.0 + 0.0j
        centre = place[here].mean()
        place[here] = centre + turn * (place[here] - centre)
        moving[here] *= turn
        arm, weighted = _arms(place[here], weight[here])
        inertia = max(_along(arm, weighted), 1e-300)
        moving[here] -= (_along(weighted, moving[here]) / inertia) * arm
        load[here] = (-_along(arm, turn * pull[here]) / inertia) * weighted
    return _vectors(place), _vectors(moving), _vectors(load)


def without_turning(
    pieces: Sequence[Upright], position: FloatArray, force: FloatArray, weight: FloatArray
) -> FloatArray:
    """#V by 2, forces [N] without those parts that only turn pieces as a whole. Arguments as of `held_upright`."""
    place, left = _complex(position), _complex(force).copy()
    for piece in pieces:
        here = piece.vertices
        arm, weighted = _arms(place[here], weight[here])
        left[here] -= (_along(arm, left[here]) / max(_along(arm, weighted), 1e-300)) * weighted
    return _vectors(left)


def _complex(vectors: FloatArray) -> ComplexArray:
    """#V by 2 as #V, x + iy; the same memory."""
    return np.ascontiguousarray(vectors).view(np.complex128)[:, 0]


def _along(a: ComplexArray, b: ComplexArray) -> float:
    """The sum of the scalar products of vectors."""
    return dot(a.view(np.float64), b.view(np.float64))


def _arms(at: ComplexArray, weight: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Velocities of a rigid turn by 1 rad/s, and the same times the weights by which motion is averaged: the stiffnesses."""
    arm = 1j * (at - (weight * at).sum() / weight.sum())
    return arm, weight * arm


def _vectors(values: ComplexArray) -> FloatArray:
    """#V as #V by 2; the same memory."""
    return values.view(np.float64).reshape(-1, 2)
