"""The rotation gauge of a piece: the chord of its datum, the grain, keeps pointing along +y.

Nothing else fixes the rotation of a piece on the cloth, and the guard, which is bound to the directions of the plane,
would turn it for ever. Where a cut has parted a piece, each part is aligned on its own: held together, one part's torque
would turn the other for ever.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from warpflat.core.arrays import ComplexArray, FloatArray, IntArray
from warpflat.core.sums import dot
from warpflat.flat.surface.connectivity import components_of
from warpflat.flat.surface.mesh import Surface

__all__ = ["GrainAlignment", "align_grain", "grain_alignments", "hold_grain", "remove_rotation"]


@dataclass(frozen=True, kw_only=True)
class GrainAlignment:
    """A piece, or a part of one, and the two ends of its chord, whose direction is kept.

    Attributes:
        lower, upper: vertex indices of the ends.
        vertices: the piece's vertices, as a range or as indices; all, if not given.
        direction: in which the chord points, a unit vector.
    """

    lower: int
    upper: int
    vertices: slice | IntArray = field(default_factory=lambda: slice(None))
    direction: tuple[float, float] = (0.0, 1.0)


def grain_alignments(
    surface: Surface, datum: IntArray, positions: FloatArray, *, first: int = 0
) -> list[GrainAlignment]:
    """Return the alignments of a piece: one for each part into which cuts have parted it.

    A part that has at least two vertices of the datum keeps their chord upright. Any other keeps the direction that its chord has now.

    Args:
        surface: the piece, cut.
        datum: vertex indices.
        positions: #V by 2, its present layout [m].
        first: number of its first vertex in the network.
    """
    count, part = len(surface.vertices), components_of(surface)
    if not part.any():
        whole = slice(first, first + count)
        return [GrainAlignment(lower=first + int(datum[0]), upper=first + int(datum[-1]), vertices=whole)]
    part_of, used = np.full(count, -1), surface.faces >= 0
    part_of[surface.faces[used]] = np.broadcast_to(part[:, None], surface.faces.shape)[used]
    found = []
    for number in range(int(part.max()) + 1):
        own, line = np.flatnonzero(part_of == number), datum[part_of[datum] == number]
        direction = 0.0, 1.0
        if len(line) > 1:
            lower, upper = int(line[0]), int(line[-1])
        else:
            lower, upper = (int(own[end]) for end in (positions[own, 1].argmin(), positions[own, 1].argmax()))
            chord = positions[upper] - positions[lower]
            direction = tuple((chord / np.linalg.norm(chord)).tolist())
        vertices = (own + first).astype(np.int32)
        found.append(GrainAlignment(lower=first + lower, upper=first + upper, vertices=vertices, direction=direction))
    return found


def align_grain(pieces: Sequence[GrainAlignment], position: FloatArray) -> None:
    """Turn each piece about its centre so that its chord points in its direction, in place; positions: #V by 2 [m]."""
    for piece in pieces:
        _turn(piece, position)


def _turn(piece: GrainAlignment, position: FloatArray) -> tuple[ComplexArray, complex]:
    """Turn a piece; return its vertices' places as complex numbers, and the factor by which they were turned."""
    place = _complex(position[piece.vertices])
    chord = complex(*(position[piece.upper] - position[piece.lower]))
    turn = complex(*piece.direction) * abs(chord) / chord if chord else 1.0 + 0.0j
    centre = place.mean()
    place -= centre
    place *= turn
    place += centre
    position[piece.vertices] = _vectors(place)
    return place, turn


def hold_grain(
    pieces: Sequence[GrainAlignment],
    position: FloatArray,
    velocity: FloatArray,
    load: FloatArray,
    force: FloatArray,
    weight: FloatArray,
) -> None:
    """Turn each piece so that its chord points in its direction, and balance the torque that would turn it back.

    Position, velocity and load are changed in place.

    Args:
        pieces: the pieces.
        position, velocity: #V by 2 [m], [m/s]; the velocities lose their rotation.
        load: #V by 2 [N]; becomes the load, spread over a piece, that balances the torque of its cloth.
        force: #V by 2, forces of the cloth and of the load before, in the layout before [N].
        weight: #V, weights of the mean motion.
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
            moving -= (_moment(arm, _vectors(moving), weight[here]) / inertia) * arm
            velocity[here] = _vectors(moving)
        np.multiply(arm, weight[here], out=held)
        held *= -torque
        load[here] = _vectors(held)


def remove_rotation(
    pieces: Sequence[GrainAlignment], position: FloatArray, force: FloatArray, weight: FloatArray
) -> None:
    """Remove from the forces (#V by 2 [N]), in place, the parts that only turn pieces as a whole.

    See `hold_grain` for the arguments.
    """
    for piece in pieces:
        here = piece.vertices
        arm, inertia = _arm(_complex(position[here]), weight[here])
        torque = dot(_vectors(arm), force[here]) / inertia
        arm *= weight[here]
        arm *= torque
        force[here] -= _vectors(arm)


def _arm(place: ComplexArray, weight: FloatArray) -> tuple[ComplexArray, float]:
    """Return the velocities of a rotation by 1 rad/s about the weighted mean, #V, and the moment of inertia."""
    centre = complex(*(dot(weight, part) for part in _vectors(place).T)) / weight.sum()
    arm = place - centre
    arm *= 1j
    return arm, max(_moment(arm, _vectors(arm), weight), 1e-300)


def _moment(arm: ComplexArray, vectors: FloatArray, weight: FloatArray) -> float:
    """Return the weighted sum of the scalar products of vectors."""
    return sum(float(np.einsum("i,i,i->", weight, _vectors(arm)[:, k], vectors[:, k])) for k in range(2))


def _complex(vectors: FloatArray) -> ComplexArray:
    """View #V by 2 vectors as #V complex numbers x + iy, in the same memory."""
    return vectors.view(np.complex128)[:, 0]


def _vectors(values: ComplexArray) -> FloatArray:
    """View #V complex numbers as #V by 2 vectors, in the same memory."""
    return values.view(np.float64).reshape(-1, 2)
