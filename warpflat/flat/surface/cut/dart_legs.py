"""The legs of a dart as a pattern shows them: those of its crack, bent so that they meet short of the crack's tip."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError

__all__ = ["are_curved", "check_tip_back", "pull_back"]


#: Legs are straight if they stray from their chord by no more than this [m], or this share of its length.
STRAIGHT, STRAIGHT_SHARE = 2e-3, 0.04


def are_curved(*legs: FloatArray) -> bool:
    """Return whether one of the legs (#P by 2 [m] each) leaves its chord so far that the wedge cannot be folded."""
    import shapely

    for leg in legs:
        chord = shapely.LineString(leg[[0, -1]])
        if shapely.distance(chord, shapely.points(leg)).max() > max(STRAIGHT, STRAIGHT_SHARE * chord.length):
            return True
    return False


def check_tip_back(tip_back: float, room: float, of: str = "dart's length") -> None:
    """Check that a tip can be moved back by a distance [m] within the room [m] that there is; `of` names the room."""
    if not (np.isfinite(tip_back) and 0 <= tip_back < room):
        raise InputError(
            f"tip_back is {tip_back * 1e3:.1f} mm; it must be 0 or more and less than the {of}, {room * 1e3:.1f} mm"
        )


def pull_back(left: FloatArray, right: FloatArray, tip_back: float) -> tuple[FloatArray, FloatArray]:
    """Return both legs of a dart with their tip moved back towards the border.

    Each is turned and shrunk about its end on the border, both by one share: legs of one length stay so, and a curved
    leg keeps its curve.

    Args:
        left, right: #P by 2 [m], from the border to the tip, which they share.
        tip_back: from the old tip to the new one [m].

    Raises:
        InputError: `tip_back` is negative or leaves no dart.
    """
    tip = left[-1]
    to_left, to_right = left[0] - tip, right[0] - tip
    chords = float(np.linalg.norm(to_left)), float(np.linalg.norm(to_right))
    cosine = float(to_left @ to_right) / max(chords[0] * chords[1], np.finfo(float).tiny)
    check_tip_back(tip_back, min(chords) * float(np.sqrt(max(0.0, 0.5 + 0.5 * cosine))))
    if tip_back == 0:
        return left, right
    # Points whose distances from both ends are to each other as the legs': where their circle is tip_back off the tip.
    normal = chords[0] ** 2 * to_right - chords[1] ** 2 * to_left
    size = float(np.linalg.norm(normal))
    normal = normal / size
    offset = tip_back**2 * (chords[0] ** 2 - chords[1] ** 2) / (2 * size)
    along = np.array([-normal[1], normal[0]])
    along = along if along @ (to_left + to_right) > 0 else -along
    moved = tip + offset * normal + float(np.sqrt(tip_back**2 - offset**2)) * along
    return _ending_at(left, moved), _ending_at(right, moved)


def _ending_at(leg: FloatArray, tip: FloatArray) -> FloatArray:
    """Return a line turned and scaled about its first point so that it ends at `tip`."""
    plane = leg[:, 0] + 1j * leg[:, 1]
    goal = complex(tip[0], tip[1])
    moved = plane[0] + (plane - plane[0]) * ((goal - plane[0]) / (plane[-1] - plane[0]))
    bent = np.column_stack([moved.real, moved.imag])
    bent[[0, -1]] = leg[0], tip
    return bent
