"""Pieces that stay upright: the chord of the datum points up, since the datum is the grain.

Nothing else says how a piece lies on the cloth, so that it would turn for ever to please a guard bound to the plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from warpflat.core.arrays import ComplexArray, FloatArray
from warpflat.core.sums import dot

__all__ = ["GrainAlignment", "align_grain", "hold_grain", "remove_rotation"]


@dataclass(frozen=True, kw_only=True)
class GrainAlignment:
    """A piece and the two of its vertices that lie one above the other.

    Attributes:
        lower, upper: vertex indices.
        vertices: those of the piece; all, if not given.
    """

    lower: int
    upper: int
    vertices: slice = field(default_factory=lambda: slice(None))


def align_grain(pieces: Sequence[GrainAlignment], position: FloatArray) -> None:
    """Turn each piece about its centre so that its chord points up; the positions (#V by 2 [m]) are changed in place."""
    for piece in pieces:
        _turn(piece, position)


def _turn(piece: GrainAlignment, position: FloatArray) -> tuple[ComplexArray, complex]:
    """Turn a piece; where its vertices then are, and by what they were turned."""
    place = _complex(position[piece.vertices])
    chord = complex(*(position[piece.upper] - position[piece.lower]))
    turn = 1j * abs(chord) / chord if chord else 1.0 + 0.0j
    centre = place.mean()
    place -= centre
    place *= turn
    place += centre
    return place, turn


def hold_grain(
    pieces: Sequence[GrainAlignment],
    position: FloatArray,
    velocity: FloatArray,
    load: FloatArray,
    force: FloatArray,
    weight: FloatArray,
) -> None:
    """Turn each piece so, and balance what would turn it back; the first three arrays are changed in place.

    Args:
        pieces: which.
        position, velocity: #V by 2 [m], [m/s]; the latter is rid of what turning there is in it.
        load: #V by 2 [N]; is made one that is spread over a piece and balances the torque with which its cloth would turn.
        force: #V by 2, of the cloth, with the load as it was, in the layout as it was [N].
        weight: #V, by which motion is averaged.
    """
    for piece in pieces:
        here = piece.vertices
        moving, held = (_complex(vectors[here]) for vectors in (velocity, load))
        place, turn = _turn(piece, position)
        arm, inertia = _arm(place, weight[here])
        # Forces are of the layout before it was turned.
        arm *= turn.conjugate()
        torque = (dot(_vectors(arm), force[here]) - dot(_vectors(arm), load[here])) / inertia
        arm *= turn
        if velocity[here].any():
            moving *= turn
            moving -= (_moment(arm, velocity[here], weight[here]) / inertia) * arm
        np.multiply(arm, weight[here], out=held)
        held *= -torque


def remove_rotation(
    pieces: Sequence[GrainAlignment], position: FloatArray, force: FloatArray, weight: FloatArray
) -> None:
    """Rid forces (#V by 2 [N]) in place of those parts that only turn pieces as a whole. Arguments as of `hold_grain`."""
    for piece in pieces:
        here = piece.vertices
        arm, inertia = _arm(_complex(position[here]), weight[here])
        torque = dot(_vectors(arm), force[here]) / inertia
        arm *= weight[here]
        arm *= torque
        _complex(force[here])[:] -= arm


def _arm(place: ComplexArray, weight: FloatArray) -> tuple[ComplexArray, float]:
    """#V, velocities of a rigid turn by 1 rad/s about the weighted mean, and the moment of inertia."""
    centre = complex(*(dot(weight, part) for part in _vectors(place).T)) / weight.sum()
    arm = place - centre
    arm *= 1j
    return arm, max(_moment(arm, _vectors(arm), weight), 1e-300)


def _moment(arm: ComplexArray, vectors: FloatArray, weight: FloatArray) -> float:
    """The weighted sum of the scalar products of vectors."""
    return sum(float(np.einsum("i,i,i->", weight, _vectors(arm)[:, k], vectors[:, k])) for k in range(2))


def _complex(vectors: FloatArray) -> ComplexArray:
    """#V by 2 as #V, x + iy; the same memory."""
    return vectors.view(np.complex128)[:, 0]


def _vectors(values: ComplexArray) -> FloatArray:
    """#V as #V by 2; the same memory."""
    return values.view(np.float64).reshape(-1, 2)
