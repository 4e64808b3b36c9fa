"""The cap over a folded dart: the neighbours' cut lines mirrored on its legs and its fold, so that it folds flat."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, InputError, points_at_lengths, unit
from warpflat.pattern.drafting.hem_allowance import HEM_SLANT
from warpflat.pattern.drafting.names import dart_words
from warpflat.pattern.drafting.polygons import (
    GRID,
    angle_between,
    cut_off,
    intersection,
    normal_towards,
    parallelogram,
    polygons_only,
    reflect,
    rotation,
    union,
)
from warpflat.pattern.drafting.sides import MITRE_REACH, Side, Wedge

if TYPE_CHECKING:
    from shapely import Geometry, Polygon

__all__ = ["WIDEST_DART", "dart_allowance"]


#: The fold of a dart that meets the border at a slant reaches past the mouth to be caught there, up to this many legs.
WEDGE_REACH = 2.0
#: A dart that opens wider than this [rad] cannot be pressed to one side: it is cut out with allowances on its legs.
WIDEST_DART = np.radians(90.0)


def dart_allowance(
    sides: Sequence[Side | Wedge], strips: list[Geometry], index: int, before: int, after: int, body: Polygon
) -> tuple[tuple[FloatArray, FloatArray], list[Geometry], list[str]]:
    """Prolong a dart's legs through the allowance, and shape the cap over it.

    The neighbour's cut line is mirrored on the leg, then on the fold, so that the cap folds flat. A note says where the
    cap would have to reach too far for that. The strips beside the dart are trimmed in place.

    Returns:
        The unit vectors in which the left and the right leg run on, what is added to the strips, and notes.

    Raises:
        InputError: the dart has no edge on one side.
    """
    wedge, left, right = sides[index], sides[before], sides[after]
    if not isinstance(wedge, Wedge) or not isinstance(left, Side) or not isinstance(right, Side):
        raise InputError("two darts meet in one point of the border: leave an edge between them")
    mouth_left, mouth_right = wedge.left[0], wedge.right[-1]
    # The legs run straight on, but bend at a hem so that it folds up flat: what is turned up is then as long, from side to side, as
    # what it lies on. Both bend by the same angle, so that the wedge can be folded on its middle.
    on_left, on_right = unit(mouth_left - wedge.tip), unit(mouth_right - wedge.tip)
    if left.kind == right.kind == "hem":
        depth = max(left.width, right.width)
        hem_left, hem_right = _secant_direction(left.points[::-1], depth), _secant_direction(right.points, depth)
        leg_left, leg_right = _secant_direction(wedge.left, depth), _secant_direction(wedge.right[::-1], depth)
        above = angle_between(hem_left, leg_left) + angle_between(hem_right, leg_right)
        bend = (angle_between(hem_left, on_left) + angle_between(hem_right, on_right) - above) / 2
        if abs(bend) <= HEM_SLANT:
            on_left, on_right = rotation(-bend) @ on_left, rotation(bend) @ on_right
    strips[before], end_left = _end_at_leg(strips[before], left.width, mouth_left, on_left, left.arrives, mouth_right)
    strips[after], end_right = _end_at_leg(strips[after], right.width, mouth_right, on_right, -right.leaves, mouth_left)
    # The wedge is folded on the chord of a leg, which a curved leg leaves.
    lobes = [_between_leg_and_chord(wedge.left), _between_leg_and_chord(wedge.right)]
    if wedge.fold_to == "left":
        covered, mouth, beyond = union([body, strips[before], end_left, lobes[0]]), mouth_left, on_left
    else:
        covered, mouth, beyond = union([body, strips[after], end_right, lobes[1]]), mouth_right, on_right
    leg = max(float(np.linalg.norm(mouth_left - wedge.tip)), float(np.linalg.norm(mouth_right - wedge.tip)))
    spare = 4 * max(left.width, right.width)
    notes: list[str] = []
    cap, whole = _half_cap(wedge, body, covered, mouth, beyond, WEDGE_REACH * leg + spare)
    if not whole:
        cap, _ = _half_cap(wedge, body, covered, mouth, beyond, leg + spare)
        notes.append(
            f"{dart_words(wedge.name)} meets the border at so low an angle that its wedge is not caught in the seam: "
            "turn the dart, or open it less"
        )
    return (on_left, on_right), [end_left, end_right, *lobes, cap, reflect(cap, wedge.tip, wedge.middle)], notes


def _half_cap(
    wedge: Wedge, body: Polygon, covered: Geometry, mouth: FloatArray, beyond: FloatArray, radius: float
) -> tuple[Geometry, bool]:
    """Return one half of the cap, and whether `radius` leaves it whole.

    What the wedge covers is mirrored on the leg and, past the mouth, on the prolonged leg.

    Args:
        wedge, body: the dart and its piece.
        covered: what the wedge lies on.
        mouth: end of the leg at the border [m].
        beyond: unit vector in which the leg runs on.
        radius: greatest distance from the tip [m].
    """
    import shapely

    tip, near = wedge.tip, unit(mouth - wedge.tip)
    ends = [tip + radius * near, tip + radius * wedge.middle]
    half: Geometry = shapely.Polygon([tip, *ends])
    outwards = normal_towards(near, -wedge.middle)
    if beyond @ outwards > 0:
        half = union([half, shapely.Polygon([mouth, mouth + radius * near, mouth + radius * beyond])])
    elif beyond @ outwards < 0:
        half = cut_off(half, mouth, beyond, outwards, radius)
    turned = union([reflect(covered, mouth, beyond), reflect(body, mouth, near)])
    cap = intersection(turned, half)
    cap = union([part for part in shapely.get_parts(cap) if part.distance(shapely.Point((mouth + tip) / 2)) < 1e-6])
    return cap, cap.distance(shapely.LineString(ends)) > GRID


def _between_leg_and_chord(leg: FloatArray) -> Geometry:
    """Return what lies between a leg and its chord, on either side."""
    import shapely

    if len(leg) < 3:
        return shapely.Polygon()
    # Rounded first: where a leg touches its chord, the areas on either side would otherwise cross by the last bit.
    noded = shapely.union_all([shapely.LinearRing(leg)], grid_size=GRID)
    return polygons_only(shapely.union_all(shapely.get_parts(shapely.polygonize([noded])), grid_size=GRID))


def _end_at_leg(
    strip: Geometry, width: float, mouth: FloatArray, leg: FloatArray, along: FloatArray, other_mouth: FloatArray
) -> tuple[Geometry, Geometry]:
    """End a strip on the prolonged leg of a dart.

    Args:
        strip, width: allowance beside the edge, and its width [m].
        mouth: end of the leg at the border [m].
        leg: unit vector in which the leg runs on.
        along: unit vector in which the edge runs into the mouth.
        other_mouth: end of the other leg [m].

    Returns:
        The trimmed strip, and what is added to it.
    """
    import shapely

    if width <= 0:
        return strip, shapely.Polygon()
    inwards = normal_towards(leg, other_mouth - mouth)
    trimmed = cut_off(strip, mouth, leg, inwards, 3 * width)
    run_on = parallelogram(mouth, along, (0, MITRE_REACH * width), normal_towards(along, leg), (0, width))
    return trimmed, cut_off(run_on, mouth, leg, inwards, 3 * width)


def _secant_direction(line: FloatArray, length: float) -> FloatArray:
    """Return the unit vector from a line's first point to the one at `length` [m] along it, or to its last."""
    return unit(points_at_lengths(line, length) - line[0])
