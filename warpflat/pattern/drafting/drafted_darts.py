"""Darts of a drafted piece: which are folded and which cut away, their lines, and notes on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpflat.core import FloatArray, resample
from warpflat.flat import are_curved
from warpflat.pattern.drafting.curves import TOLERANCE, farthest, fit_curve
from warpflat.pattern.drafting.dart_allowance import WIDEST_DART
from warpflat.pattern.drafting.drafted import DraftedDart, DraftedEdge, drawn_leg
from warpflat.pattern.drafting.piece_parts import DEFAULT_ALLOWANCE, SAME_POINT, Dart
from warpflat.pattern.drafting.pieces import Piece
from warpflat.pattern.drafting.seam_difference import SEAM_TOLERANCE
from warpflat.pattern.drafting.sides import Wedge

__all__ = ["DartLegs", "dart_legs", "dart_line", "dart_notes", "fisheye_legs", "smooth_fisheye"]


#: The least width [m] between the allowances of both legs of a dart that is cut away.
LEAST_WASTE = 0.005
#: Points of the fold between curved legs.
FOLD_POINTS = 33


@dataclass(frozen=True, kw_only=True, eq=False)
class DartLegs:
    """A dart with its drafted legs.

    Attributes:
        dart: as it came in.
        left, right: the legs, left from the border, right to the border.
        wedge: what is folded; None where the dart is cut away.
    """

    dart: Dart
    left: DraftedEdge
    right: DraftedEdge
    wedge: Wedge | None

    @property
    def mouth(self) -> float:
        """Opening of the dart at the border [m]."""
        return float(np.linalg.norm(self.left.line[0] - self.right.line[-1]))

    @property
    def bend(self) -> float:
        """Largest distance of a leg from its chord [m]."""
        return max(farthest(leg.line[[0, -1]], leg.line) for leg in (self.left, self.right))


def dart_legs(piece: Piece, edges: Sequence[DraftedEdge]) -> dict[str, DartLegs]:
    """Decide which darts of a piece are folded, and give all legs their allowance: none if folded, else a seam's."""
    by_name = {edge.name: edge for edge in edges}
    found = {}
    for dart in piece.darts:
        left, right = by_name[dart.left], by_name[dart.right]
        # A wedge is pressed downwards, or towards the middle if the dart runs along the grain.
        (x, y), (u, v) = left.line[0], right.line[-1]
        away = np.abs((left.line[0] + right.line[-1]) / 2 - left.line[-1])
        fold_to = dart.fold_to or ("left" if (y < v if away[0] > away[1] else abs(x) < abs(u)) else "right")
        wedge = Wedge(name=dart.name, left=left.line, right=right.line, fold_to=fold_to)
        legs = DartLegs(dart=dart, left=left, right=right, wedge=wedge)
        # A dart is cut away if its mouth is so wide that something is left between the legs' allowances. Legs that are one
        # line (a dart of no width) have nothing to fold.
        widths = _leg_width(left) + _leg_width(right)
        has_room = widths == 0 or legs.mouth >= widths + LEAST_WASTE
        folded = SAME_POINT < wedge.opening <= WIDEST_DART and not (dart.cut and dart.pleat is None and has_room)
        found[dart.name] = replace(
            legs,
            left=replace(left, width=0.0 if folded else _leg_width(left)),
            right=replace(right, width=0.0 if folded else _leg_width(right)),
            wedge=wedge if folded else None,
        )
    return found


def _leg_width(leg: DraftedEdge) -> float:
    return DEFAULT_ALLOWANCE["seam"] if leg.edge.allowance is None else leg.edge.allowance


def dart_line(legs: DartLegs, cut_line: FloatArray) -> DraftedDart:
    """Draw the line on which a dart is folded, from its tip to the cut line (#P by 2 [m])."""
    import shapely

    left, right, wedge = legs.left.line, legs.right.line, legs.wedge
    if wedge is None:
        return DraftedDart(dart=legs.dart, tip=left[-1], fold=None, fold_to="", opening=legs.mouth)
    reach = float(np.linalg.norm(cut_line - wedge.tip, axis=1).max()) + 0.01
    ray = shapely.LineString([wedge.tip, wedge.tip + reach * wedge.middle]).intersection(shapely.Polygon(cut_line))
    parts = [part for part in shapely.get_parts(ray) if part.length > 0]
    first = min(parts, key=lambda part: part.distance(shapely.Point(wedge.tip)))
    ends = np.asarray(first.coords)[[0, -1]]
    far = ends[np.argmax(np.linalg.norm(ends - wedge.tip, axis=1))]
    fold = np.stack([wedge.tip, far])
    if are_curved(left, right):
        # The middle line of two lines with one start, by shares of their lengths.
        shares = np.linspace(0.0, 1.0, FOLD_POINTS)
        fold = np.concatenate([(resample(left[::-1], shares) + resample(right, shares)) / 2, fold[1:]])
    if legs.dart.pleat is not None:
        fold = drawn_leg(fold[::-1], legs.dart.pleat)[::-1]
    return DraftedDart(dart=legs.dart, tip=wedge.tip, fold=fold, fold_to=wedge.fold_to, opening=legs.mouth)


def dart_notes(legs: DartLegs) -> list[str]:
    """Return what the cutter should know of a dart whose legs have their allowance."""
    dart, left, right = legs.dart, legs.left, legs.right
    notes = []
    if dart.pleat is None and abs(left.length - right.length) > SEAM_TOLERANCE:
        notes.append(f"dart {dart.name}: its legs differ by {abs(left.length - right.length) * 1000:.1f} mm")
    if legs.wedge is None and left.width > 0:
        why = f"its legs bend by {legs.bend * 1000:.0f} mm" if dart.cut else "it opens too wide"
        notes.append(f"dart {dart.name} is cut away, not folded: {why}; sew its legs as a seam")
    if dart.pleat is not None:
        return [
            *notes,
            f"pleat {dart.name}: fold {legs.mouth * 1000:.0f} mm, sew {dart.pleat * 1000:.0f} mm down from the edge",
        ]
    if legs.wedge is not None and dart.cut:
        notes.append(
            f"dart {dart.name} is folded, not cut away: its mouth of {legs.mouth * 1000:.0f} mm has no room for the "
            f"allowances of its legs, which bend by {legs.bend * 1000:.0f} mm; pin leg on leg"
        )
    return notes


def fisheye_legs(line: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the two sides (#P by 2 [m]) of a fish-eye dart's closed line, both from its lower tip to its upper one."""
    distance = np.linalg.norm(line[:, None] - line[None], axis=2)
    a, b = sorted(map(int, np.unravel_index(int(distance.argmax()), distance.shape)))
    first, second = line[a : b + 1], np.concatenate([line[b:], line[: a + 1]])
    if tuple(first[0, ::-1]) > tuple(first[-1, ::-1]):
        return second, first[::-1]
    return first, second[::-1]


def smooth_fisheye(points: FloatArray, tolerance: float | None) -> FloatArray:
    """Return a fish-eye dart's closed line with both sides as clean curves, the first point not repeated."""
    first, second = (fit_curve(leg, tolerance or TOLERANCE).sample() for leg in fisheye_legs(points))
    return np.concatenate([first[:-1], second[:0:-1]])
