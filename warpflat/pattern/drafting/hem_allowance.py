"""The end of a hem, shaped so that it covers the seam allowance exactly once it is turned up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import polyline_length, turn_between
from warpflat.pattern.drafting.polygons import (
    cut_off,
    difference,
    intersection,
    normal_towards,
    parallelogram,
    reflect,
    union,
)
from warpflat.pattern.drafting.sides import MITRE_REACH, Side, Wedge

if TYPE_CHECKING:
    from shapely import Geometry, Polygon

__all__ = ["HEM_SLANT", "fold_hem"]


#: A hem folds up along itself; its ends mirror the side seams if these meet it at 90 degrees, give or take this [rad].
HEM_SLANT = np.radians(40.0)


def fold_hem(
    sides: Sequence[Side | Wedge], strips: list[Geometry], index: int, after: int, body: Polygon
) -> list[Geometry] | None:
    """Mirror a hem's end on the hem line, so that turned up it covers the seam allowance exactly.

    Args:
        sides: of the piece, in order.
        strips: the allowance of every side; those of the hem and the seam are trimmed in place.
        index, after: two sides that follow each other.
        body: the piece.

    Returns:
        What is added to the strips; None where no hem is folded between these sides.
    """
    import shapely

    side, follows = sides[index], sides[after]
    if not isinstance(side, Side) or not isinstance(follows, Side) or {side.kind, follows.kind} != {"hem", "seam"}:
        return None
    a, b = side.arrives, follows.leaves
    if abs(turn_between(a, b) - np.pi / 2) >= HEM_SLANT:
        return None
    # Of the hem and of the seam the number, the side, and the way from the corner along it.
    ends = ((index, side, -a), (after, follows, b))
    (hem, hem_side, inwards), (seam, seam_side, along) = ends if side.kind == "hem" else ends[::-1]
    hem_width, width, corner, beyond = hem_side.width, seam_side.width, side.points[-1], -along
    # Beside a seam that is shorter than the hem is deep there is nothing to mirror.
    if not (width > 0 and 0 < hem_width <= polyline_length(seam_side.points)):
        return None
    # Cloth beside the edge at the hem's other end, on which a short hem is turned up, too.
    other = index - 1 if hem == index else (after + 1) % len(sides)
    far, far_side = strips[other], sides[other]
    if isinstance(far_side, Wedge):
        far = shapely.Polygon(np.concatenate([far_side.left, far_side.right[1:]])).buffer(0)
    down, out = normal_towards(inwards, beyond), normal_towards(beyond, -inwards)
    reach = hem_width + MITRE_REACH * width
    run_on = parallelogram(corner, beyond, (0, reach), out, (0, width))
    run_on = intersection(run_on, parallelogram(corner, inwards, (-3 * reach, reach), -down, (0, 3 * reach)))
    strips[seam] = cut_off(strips[seam], corner, inwards, down, 3 * width)
    worn = union([body, strips[seam], run_on, far])
    # A slightly curved hem leaves the mirror line; the first millimetres below it are hem in any case.
    core = intersection(parallelogram(corner, inwards, (0, reach), down, (0, 0.003)), strips[hem])
    turned = union([reflect(worn, corner, inwards), core])
    below = parallelogram(corner, inwards, (-reach, hem_width), down, (0, 2 * hem_width))
    # Along the hem its own strip says how deep it is, curved or not; only what reaches past the corner is added.
    strips[hem] = difference(strips[hem], difference(below, turned))
    past = intersection(turned, parallelogram(corner, inwards, (-reach, 1e-5), down, (0, hem_width)))
    return [run_on, past]
