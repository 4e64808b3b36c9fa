"""The blueprint of a body, on which the grid is laid: profiles, the curves about neck and armhole, the arms.

Size tables and scans both answer with a :class:`Blueprint`; one builder lays the same grid on either.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from warpflat.core import FloatArray

__all__ = ["NOTCH", "Blueprint", "LegCurves", "LegProfile", "Profile", "QuarterCurves"]

#: How high up the armhole the across-chest row ends; the armhole runs slantwise there, which leaves the quads room.
NOTCH = 0.22


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """One closed horizontal curve with the places of the vertical lines on it.

    Attributes:
        curve: #P by 2, (x, z) [m], from centre front over the body's left side, not repeated.
        side_left, centre_back, side_right: arc lengths [m] along the curve.
        princess: share of each quarter from its centre line to the princess line, by quarter name.
        girth: what a tape must read around the finished row [m].
    """

    curve: FloatArray
    side_left: float
    centre_back: float
    side_right: float
    princess: Mapping[str, float]
    girth: float


@dataclass(frozen=True, kw_only=True, eq=False)
class QuarterCurves:
    """The curves that bound one quarter of the chest, the shoulder and the neck. All #P by 3 [m].

    Attributes:
        neckline: from the centre line to the side neck point.
        shoulder: from the side neck point to the shoulder point; the same in front and back.
        armhole: from the shoulder point to the underarm point.
        notch: share of the armhole at which the across-chest row ends.
        chest: the across-chest row, from the centre line to the notch.
        centre: the centre line from the bust level to the neckline.
    """

    neckline: FloatArray
    shoulder: FloatArray
    armhole: FloatArray
    notch: float
    chest: FloatArray
    centre: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class LegProfile:
    """One closed horizontal curve around a leg.

    Attributes:
        curve: #P by 2, (x, z) [m], from the inseam forward, not repeated.
        outseam: share of the curve's length; the creases lie halfway to it.
        girth: what a tape must read around the finished row [m].
        spread: how much wider than the mean the columns next to the inseam are, as a share.
    """

    curve: FloatArray
    outseam: float
    girth: float
    spread: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LegCurves:
    """The lower body below the hip.

    Attributes:
        heights: height [m] of every leg level but the first.
        profile: the profile of a side, ``left`` or ``right``, at a height [m] from the ankle to the thigh.
        crotch: #P by 3 [m], the crotch curve in the midplane, from the hip's centre front to its centre back.
        point: share of the crotch curve's length at which the crotch point lies.
        attract: maps #P by 3 points of seat and thighs [m] to the body's surface, those outside it to themselves; None for none.
    """

    heights: Mapping[str, float]
    profile: Callable[[str, float], LegProfile]
    crotch: FloatArray
    point: float
    attract: Callable[[FloatArray], FloatArray] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Blueprint:
    """A body, ready for the grid.

    Attributes:
        profile: the profile at a height [m] between the ankle and the bust.
        heights: height [m] of every closed level.
        quarters: the curves of the four quarters by name.
        arms: the closed curves around the two arms, ``left`` and ``right``, by their place, rising: 0 is the biceps, 1 the elbow, 2 the
            wrist; each #P by 3 [m], from the underarm line forward, the opposite point on the overarm line.
        legs: crotch curve and legs.
        neck: length of the neck base along its curve [m].
        collar: #P by 3 [m], closed curve at the upper end of the neck, from centre front over the left.
        attract: maps #P by 3 points of chest and shoulder to the places [m] on the body to draw them to; None for none.
    """

    profile: Callable[[float], Profile]
    heights: Mapping[str, float]
    quarters: Mapping[str, QuarterCurves]
    arms: Mapping[str, Mapping[float, FloatArray]]
    legs: LegCurves
    neck: float
    collar: FloatArray
    attract: Callable[[FloatArray], FloatArray] | None = None
