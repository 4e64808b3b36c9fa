"""Darts on a pattern: measures of the crack that a relaxed cut opens, and the dart drawn in its place.

A crack opens with curved edges that need not be equally long. A drawn dart has a point short of the bust point, and two
straight legs of one length, since they are sewn to each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.polyline import arc_lengths
from warpflat.core.vectors import turn_between, unit
from warpflat.flat.surface.cut.dart_legs import check_tip_back
from warpflat.flat.surface.overlap import OVERLAP, overlap_width, overlapping

__all__ = [
    "DartMeasure",
    "DrawnDart",
    "DrawnFishEye",
    "FishEyeMeasure",
    "dart_measure",
    "fish_eye_measure",
    "mouth_first",
    "shape_dart",
    "shape_fish_eye",
]

# The outline beside a dart follows a leg's end over this length [m], or over so many times the end's shift.
_BLEND, _BLEND_PER_SHIFT = 0.05, 8.0


@dataclass(frozen=True, kw_only=True)
class DartMeasure:
    """A crack from the border to a tip, as it lies in the plane.

    Attributes:
        opening: distance of its two ends on the border [m].
        angle: between the straight legs at the tip [rad], positive where the crack gapes, negative where it overlaps.
        left_leg, right_leg: straight lengths from the tip to the border [m].
        intake: cloth that a dart of this angle takes up across legs of the mean length [m]; negative for an overlap.
    """

    opening: float
    angle: float
    left_leg: float
    right_leg: float
    intake: float


@dataclass(frozen=True, kw_only=True)
class FishEyeMeasure:
    """A crack with a tip at either end, as it lies in the plane.

    Attributes:
        length: from tip to tip [m].
        intake: its widest gap between matching points [m]; negative for an overlap.
        overlap: width of the widest place in which its two sides lie over each other [m]; 0 if it gapes all along.
        station: which of the matching points are the widest, counted along the cut.
        first_angle, last_angle: at the two tips, between the lines to the widest points [rad]; negative for an overlap.
    """

    length: float
    intake: float
    overlap: float
    station: int
    first_angle: float
    last_angle: float


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnDart:
    """A dart with straight legs of equal length.

    Attributes:
        tip: where it ends [m].
        left_end, right_end: where its legs meet the outline [m]; left as seen when looking from the border to the tip.
        leg_length: of either leg [m].
        angle: between the legs [rad].
        intake: distance of the leg ends [m].
        fold_point: on the fold line, where the outline runs across the dart: cut along left_end, fold_point, right_end
            and the cloth, folded to the left, ends at the seam.
    """

    tip: FloatArray
    left_end: FloatArray
    right_end: FloatArray
    leg_length: float
    angle: float
    intake: float
    fold_point: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnFishEye:
    """A diamond: two tips on one axis and two points beside it, with legs equal in pairs.

    Attributes:
        first_tip, last_tip: [m]
        left_point, right_point: where it is widest [m].
        intake: the distance of these two [m].
        first_leg, last_leg: length of the legs that meet in the first and in the last tip [m].
    """

    first_tip: FloatArray
    last_tip: FloatArray
    left_point: FloatArray
    right_point: FloatArray
    intake: float
    first_leg: float
    last_leg: float


def dart_measure(positions: FloatArray, left: IntArray, right: IntArray) -> DartMeasure:
    """Measure the crack that a dart's cut has opened.

    Args:
        positions: #P by 2, the layout [m], not mirrored.
        left, right: the vertices along both sides of the cut, matched, as a :class:`~warpflat.flat.surface.cut.crack.Crack` has
            them: from the border to the tip or from the tip to the border. At the tip both are one vertex.

    Raises:
        InputError: if the cut has no tip (it parts the cloth) or two (a fish-eye dart), or a leg has no length.
    """
    x, (a, b) = positions, mouth_first(left, right)
    tip = x[a[-1]]
    to_left, to_right = x[a[0]] - tip, x[b[0]] - tip
    legs = float(np.linalg.norm(to_left)), float(np.linalg.norm(to_right))
    if min(legs) <= 0:
        raise InputError(f"the dart at vertex {int(a[-1])} has a leg of no length")
    angle = turn_between(to_left, to_right)
    return DartMeasure(
        opening=float(np.linalg.norm(to_left - to_right)),
        angle=angle,
        left_leg=legs[0],
        right_leg=legs[1],
        intake=sum(legs) * float(np.sin(angle / 2)),
    )


def shape_dart(
    positions: FloatArray, left: IntArray, right: IntArray, outline: IntArray, *, tip_back: float = 0.0
) -> DrawnDart:
    """Draw the dart that a crack stands for.

    The tip moves from the crack's tip towards the border along the bisector; the intake on the outline stays. Both legs
    get the mean of their lengths: each end moves along its own leg, by half the difference, and takes the outline
    beside it along, less and less: over 50 mm, or more where an end moves by over 6 mm, so that the outline nowhere turns by more than
    about 11 degrees. So the ends lie on the outline and the outline is smooth when sewn.

    Args:
        positions: #P by 2, the layout [m], not mirrored.
        left, right: as for :func:`dart_measure`.
        outline: #O, the loop of border vertices that the crack belongs to, either way round, the first not repeated.
        tip_back: how far the tip is moved back from the crack's tip (the bust point) [m].

    Raises:
        InputError: as :func:`dart_measure`; if the crack overlaps instead of gaping; if `tip_back` is negative or
            leaves no dart; if the crack's ends are not on the outline.
    """
    x, (a, b) = positions, mouth_first(left, right)
    measure = dart_measure(positions, left, right)
    if measure.angle <= 0:
        raise InputError(f"the cut at vertex {int(a[0])} {overlapping(measure.opening)}")
    check_tip_back(tip_back, min(measure.left_leg, measure.right_leg) * float(np.cos(measure.angle / 2)))
    crack_tip = x[a[-1]]
    bisector = unit(x[a[0]] - crack_tip) + unit(x[b[0]] - crack_tip)
    if not bisector.any():
        raise InputError("the two legs of the dart point in opposite directions; it has no bisector")
    tip = crack_tip + tip_back * unit(bisector)
    legs = [float(np.linalg.norm(x[side[0]] - tip)) for side in (a, b)]
    leg = 0.5 * sum(legs)
    left_end, right_end = (tip + unit(x[side[0]] - tip) * leg for side in (a, b))
    # The outline from the left end away from the crack, half way round at most.
    at = np.flatnonzero(outline == a[0])
    if len(at) == 0:
        raise InputError(f"vertex {int(a[0])}, where the cut meets the border, is not on the given outline")
    rolled = np.roll(outline, -int(at[0]))
    if rolled[-1] != a[1] and rolled[1 % len(rolled)] != a[1]:
        raise InputError(f"vertices {int(a[0])} and {int(a[1])} of the cut are no neighbours on the outline")
    if rolled[1 % len(rolled)] == a[1]:
        rolled = np.roll(rolled[::-1], 1)
    beside = x[rolled[: len(rolled) // 2]]
    # The cosine is steepest in its middle: pi/2 times shift over blend.
    reach, blend = arc_lengths(beside), max(_BLEND, _BLEND_PER_SHIFT * abs(legs[0] - leg))
    fade = np.where(reach < blend, 0.5 + 0.5 * np.cos(np.pi * reach / blend), 0.0)
    beside = beside + np.multiply.outer(fade, left_end - beside[0])
    beside[0] = left_end
    # Pressed to the left, half of the dart lies on the cloth beside it, mirrored in that leg. The mirrored fold line ends where it meets
    # the outline; if it does not meet it, the fold is as long as the legs.
    fold, along, fold_length = unit(0.5 * (left_end + right_end) - tip), unit(left_end - tip), leg
    mirrored = 2 * (fold @ along) * along - fold
    for p, q in pairwise(beside):
        side = q - p
        cross = mirrored[0] * side[1] - mirrored[1] * side[0]
        if abs(cross) <= 1e-12 * float(np.linalg.norm(side)):
            continue
        offset = p - tip
        ray = (offset[0] * side[1] - offset[1] * side[0]) / cross
        share = (offset[0] * mirrored[1] - offset[1] * mirrored[0]) / cross
        if ray > 0 and -1e-9 <= share <= 1 + 1e-9:
            fold_length = float(ray)
            break
    return DrawnDart(
        tip=tip,
        left_end=left_end,
        right_end=right_end,
        leg_length=leg,
        angle=turn_between(left_end - tip, right_end - tip),
        intake=float(np.linalg.norm(left_end - right_end)),
        fold_point=tip + fold_length * fold,
    )


def fish_eye_measure(positions: FloatArray, left: IntArray, right: IntArray) -> FishEyeMeasure:
    """Measure the crack of a cut with both ends inside.

    Args:
        positions: #P by 2, the layout [m], not mirrored.
        left, right: the vertices along both sides of the cut, matched; the first and the last are shared.

    Raises:
        InputError: if the cut does not end in two tips, or they lie on one another.
    """
    x, a, b = positions, left, right
    if a[0] != b[0] or a[-1] != b[-1] or len(a) < 3:
        raise InputError(f"the cut from vertex {int(a[0])} to {int(a[-1])} is no fish-eye dart: it needs two tips")
    axis = x[a[-1]] - x[a[0]]
    length = float(np.linalg.norm(axis))
    if length <= 0:
        raise InputError(f"the tips of the fish-eye dart, vertices {int(a[0])} and {int(a[-1])}, lie on one another")
    gap = np.linalg.norm(x[a] - x[b], axis=1)
    station = int(np.argmax(gap))
    wide = x[a[station]], x[b[station]]
    # The middle of the crack and the way along it there: the axis is another way where a crack is bent.
    middle = 0.5 * (x[a] + x[b])
    along = middle[station + 1] - middle[station - 1]
    across = wide[0] - wide[1]
    return FishEyeMeasure(
        length=length,
        intake=float(np.copysign(gap[station], along[0] * across[1] - along[1] * across[0])),
        overlap=overlap_width(np.concatenate([x[b[:-1]], x[a[:0:-1]]])),
        station=station,
        first_angle=turn_between(wide[1] - x[a[0]], wide[0] - x[a[0]]),
        last_angle=turn_between(wide[0] - x[a[-1]], wide[1] - x[a[-1]]),
    )


def shape_fish_eye(positions: FloatArray, left: IntArray, right: IntArray, *, tip_back: float = 0.0) -> DrawnFishEye:
    """Draw the diamond that a fish-eye crack stands for, symmetric about the line of its tips.

    Args:
        positions, left, right: as for :func:`fish_eye_measure`.
        tip_back: how far both tips are moved towards each other [m].

    Raises:
        InputError: as :func:`fish_eye_measure`; if the crack overlaps; if `tip_back` is negative or leaves no dart.
    """
    x, a, b = positions, left, right
    measure = fish_eye_measure(positions, left, right)
    first, last = x[a[0]], x[a[-1]]
    axis = unit(last - first)
    middle = 0.5 * (x[a[measure.station]] + x[b[measure.station]])
    along = float((middle - first) @ axis)
    if measure.first_angle <= 0 or measure.last_angle <= 0 or measure.overlap > OVERLAP:
        raise InputError(f"the cut from vertex {int(a[0])} to {int(a[-1])} {overlapping(measure.overlap)}")
    check_tip_back(tip_back, min(along, measure.length - along), "shorter half")
    across = np.array([-axis[1], axis[0]]) * 0.5 * measure.intake
    centre = first + along * axis
    tips = first + tip_back * axis, last - tip_back * axis
    return DrawnFishEye(
        first_tip=tips[0],
        last_tip=tips[1],
        left_point=centre + across,
        right_point=centre - across,
        intake=measure.intake,
        first_leg=float(np.linalg.norm(centre + across - tips[0])),
        last_leg=float(np.linalg.norm(centre + across - tips[1])),
    )


def mouth_first(left: IntArray, right: IntArray) -> tuple[IntArray, IntArray]:
    """Return both sides of a crack, from the border to the tip; reversed sides change places.

    Args and errors are those of :func:`dart_measure`.
    """
    starts, ends = left[0] == right[0], left[-1] == right[-1]
    if starts and ends:
        raise InputError(
            f"the cut from vertex {int(left[0])} to {int(left[-1])} has two tips: measure it as a fish-eye dart"
        )
    if not (starts or ends):
        raise InputError(f"the cut from vertex {int(left[0])} to {int(left[-1])} has no tip: it parts the cloth")
    return (right[::-1], left[::-1]) if starts else (left, right)
