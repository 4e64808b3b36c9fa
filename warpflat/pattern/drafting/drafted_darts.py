"""Darts of a drafted piece: which are folded and which cut away, their lines, and notes on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpflat.core import FloatArray, resample
from warpflat.flat import are_curved
from warpflat.pattern.drafting.curves import TOLERANCE, farthest, fit_curve
from warpflat.pattern.drafting.dart_allowance import WIDEST_DART
from warpflat.pattern.drafting.drafted import DraftedDart, DraftedEdge, drawn_leg
from warpflat.pattern.drafting.measures import length_words
from warpflat.pattern.drafting.names import dart_words
from warpflat.pattern.drafting.piece_parts import DEFAULT_ALLOWANCE, SAME_POINT, Dart
from warpflat.pattern.drafting.pieces import Piece
from warpflat.pattern.drafting.seam_difference import SEAM_TOLERANCE
from warpflat.pattern.drafting.sides import Wedge

__all__ = ["dart_notes", "draft_dart", "fisheye_legs", "fold_darts", "smooth_fisheye"]


#: The least width [m] between the allowances of both legs of a dart that is cut away.
LEAST_WASTE = 0.005
#: Points of the fold between curved legs.
FOLD_POINTS = 33


def fold_darts(piece: Piece, edges: Sequence[DraftedEdge]) -> tuple[tuple[DraftedEdge, ...], dict[str, Wedge]]:
    """Decide which darts of a piece are folded: return its edges, whose legs have their allowance, and by dart what is folded.

    Legs of folded darts have no allowance, those of others a seam's.
    """
    by_name, wedges = {edge.name: edge for edge in edges}, dict[str, Wedge]()
    for dart in piece.darts:
        left, right = by_name[dart.left], by_name[dart.right]
        # A wedge is pressed downwards, or towards the middle if the dart runs along the grain.
        (x, y), (u, v) = left.line[0], right.line[-1]
        away = np.abs((left.line[0] + right.line[-1]) / 2 - left.line[-1])
        fold_to = dart.fold_to or ("left" if (y < v if away[0] > away[1] else abs(x) < abs(u)) else "right")
        wedge = Wedge(name=dart.name, left=left.line, right=right.line, fold_to=fold_to)
        # A dart is cut away if its mouth is so wide that something is left between the legs' allowances. Legs that are one
        # line (a dart of no width) have nothing to fold.
        given = {leg.name: leg.edge.allowance for leg in (left, right)}
        widths = {name: DEFAULT_ALLOWANCE["seam"] if width is None else width for name, width in given.items()}
        both, mouth = sum(widths.values()), float(np.linalg.norm(left.line[0] - right.line[-1]))
        has_room = both == 0 or mouth >= both + LEAST_WASTE
        folded = SAME_POINT < wedge.opening <= WIDEST_DART and not (dart.cut and dart.pleat is None and has_room)
        if folded:
            wedges[dart.name] = wedge
        for name, width in widths.items():
            by_name[name] = replace(by_name[name], width=0.0 if folded else width)
    return tuple(by_name.values()), wedges


def draft_dart(
    dart: Dart, left: FloatArray, right: FloatArray, wedge: Wedge | None, cut_line: FloatArray
) -> DraftedDart:
    """Draft a dart with the line on which it is folded, from its tip to the cut line (#P by 2 [m] each), if it has a wedge."""
    import shapely

    opening = float(np.linalg.norm(left[0] - right[-1]))
    if wedge is None:
        return DraftedDart(dart=dart, tip=left[-1], fold=None, fold_to="", opening=opening)
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
    if dart.pleat is not None:
        fold = drawn_leg(fold[::-1], dart.pleat)[::-1]
    return DraftedDart(dart=dart, tip=wedge.tip, fold=fold, fold_to=wedge.fold_to, opening=opening)


def dart_notes(drafted: DraftedDart, left: DraftedEdge, right: DraftedEdge, units: str) -> list[str]:
    """Return what the cutter should know of a dart whose legs have their allowance, with lengths in the units of the pattern."""
    dart, mouth, notes = drafted.dart, length_words(drafted.opening, units), list[str]()
    bend = length_words(max(farthest(leg.line[[0, -1]], leg.line) for leg in (left, right)), units)
    if dart.pleat is None and abs(left.length - right.length) > SEAM_TOLERANCE:
        notes.append(
            f"{dart_words(dart.name)}: its legs differ by {length_words(abs(left.length - right.length), units)}"
        )
    if drafted.fold is None and left.width > 0:
        why = f"its legs bend by {bend}" if dart.cut else "it opens too wide"
        notes.append(f"{dart_words(dart.name)} is cut away, not folded: {why}; sew its legs as a seam")
    if dart.pleat is not None:
        notes.append(f"pleat {dart.name}: fold {mouth}, sew {length_words(dart.pleat, units)} down from the edge")
    elif drafted.fold is not None and dart.cut:
        notes.append(
            f"{dart_words(dart.name)} is folded, not cut away: its mouth of {mouth} has no room for the "
            f"allowances of its legs, which bend by {bend}; pin leg on leg"
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
