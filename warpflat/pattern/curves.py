"""Clean curves from the many points of a mesh border: few cubic Béziers within a tolerance, corners kept."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray, IndexArray
from warpflat.core.polyline import arc_lengths, points_at_lengths, polyline_length, segment_lengths, turning_angles
from warpflat.pattern.spline_lengths import adjust_lengths

__all__ = ["Curve", "chords", "fit_curve"]

#: A vertex inside an edge that turns by more than this [rad] is a corner, not a sample of a curve.
CORNER = np.radians(45.0)
#: Along a border that is smoothed a corner shows over this many tolerances to either side, and by more than this [rad].
CORNER_REACH, CORNER_SMOOTHED = 12.0, np.radians(50.0)
#: How far [m] a curve may lie from the points of a clean border.
TOLERANCE = 1e-4
#: The length of a fitted curve, up to any of its points, is off by at most this [m] wherever that can be had.
LENGTH = 6e-5
#: An error of length [m] that counts as much as an error of place by one tolerance.
LENGTH_WEIGHT = 8e-6
#: A curve of another length than its points' chords may lie this many tolerances from them.
OTHER_LENGTHS = 3.0
#: A curve that must keep near its points gets the lengths of one that runs inside them by these shares of the
#: tolerance, until it does keep near. The second number says by how much less its lengths then count.
INSIDE, NEAR = (0.8, 0.5, 0.2, 0.0), 4.0
#: The chords by which a curve is drawn or cut stay this close [m] to it.
CHORD = 2e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """A chain of cubic Béziers.

    Attributes:
        bezier: #S by 4 by 2, control points [m]; each segment starts where the one before it ends.
        straight: #S, segments that are straight lines.
    """

    bezier: FloatArray
    straight: BoolArray

    def sample(self, tolerance: float = CHORD) -> FloatArray:
        """Return points on the curve (#P by 2 [m]) whose chords stray at most `tolerance` [m]; joints are exact."""
        parts = []
        for control, straight in zip(self.bezier, self.straight, strict=True):
            if straight:
                parts.append(control[:1])
                continue
            # A chord over a parameter step h strays at most h^2/8 max|B''|, and |B''| <= 6 max|second difference|.
            bend = float(np.linalg.norm(np.diff(control, n=2, axis=0), axis=1).max())
            count = max(1, int(np.ceil(np.sqrt(0.75 * bend / tolerance))))
            parts.append(_evaluate(control, np.arange(count) / count))
        return np.concatenate([*parts, self.bezier[-1:, 3]])

    @property
    def length(self) -> float:
        """Length [m] along the curve, by its fine samples."""
        return polyline_length(self.sample(1e-6))

    @property
    def nodes(self) -> FloatArray:
        """#S + 1 by 2 [m], the ends of the segments."""
        return np.concatenate([self.bezier[:, 0], self.bezier[-1:, 3]])

    def transformed(self, matrix: FloatArray) -> Curve:
        """Return the curve under a 2 by 3 affine matrix."""
        return Curve(bezier=self.bezier @ matrix[:, :2].T + matrix[:, 2], straight=self.straight)

    def reversed(self) -> Curve:
        """Return the curve run the other way."""
        return Curve(bezier=self.bezier[::-1, ::-1], straight=self.straight[::-1])


def fit_curve(
    points: FloatArray,
    tolerance: float = TOLERANCE,
    *,
    lengths: FloatArray | None = None,
    near: bool = False,
) -> Curve:
    """Fit a smooth curve near the points, of few segments, that is as long as the line of chords through them.

    The ends are exact, so neighbouring edges still share their corners; a sharp inner vertex stays a corner. Between
    corners the curve is a smoothing cubic spline (Dierckx's FITPACK through scipy) whose coefficients are then moved
    until its length up to every point is that of the chords. The result is in Bézier form.

    A curve through the points themselves would be longer than their chords by as much as it bends. The two sides of a
    seam, equal on the mesh, would then differ once they are drawn. An arc of radius R through chords h keeps their
    length if it runs h^2 / (24 R) inside: 0.07 mm for chords of 10 mm on a radius of 60 mm. Where that is farther than
    the tolerance, `near` says which of the two is given up.

    Args:
        points: #P by 2 [m]; repeated points are dropped.
        tolerance: largest distance [m] of a point from the curve, besides what equal length takes. One wider than that
            of clean borders is meant to smooth a zigzag away, and the curve's length counts less.
        lengths: #P, the wanted length [m] of the curve up to each point; None for that of the chords.
        near: keep within the tolerance everywhere, and the chords' length only as far as that allows.
    """
    keep = _distinct(points)
    clean = points[keep]
    clean[-1] = points[-1]
    wanted = None if lengths is None else lengths[keep]
    from_end = _bends_more_at_end(clean)
    if from_end:
        clean, wanted = clean[::-1], None if wanted is None else wanted[-1] - wanted[::-1]
    breaks = [0, *_corners(clean, tolerance), len(clean) - 1]
    runs = []
    for a, b in pairwise(breaks):
        run = clean[a : b + 1]
        curve = _fit_run(run, tolerance, None if wanted is None else wanted[a : b + 1] - wanted[a])
        runs.append(_within_tolerance(curve, run, tolerance) if near else curve)
    whole = Curve(
        bezier=np.concatenate([run.bezier for run in runs]), straight=np.concatenate([run.straight for run in runs])
    )
    return whole.reversed() if from_end else whole


def _bends_more_at_end(points: FloatArray) -> bool:
    """Return whether a line bends more in its second half, and is fitted from its other end.

    FITPACK places its knots from one end to the other, and the left and the right half of a piece run against each
    other.
    """
    arc = arc_lengths(points)
    return bool(np.abs(turning_angles(points)) @ (arc[1:-1] / arc[-1] - 0.5) > 1e-9)


def _corners(points: FloatArray, tolerance: float) -> list[int]:
    """Return the inner points that are corners; along a zigzag, those that are so over a longer stretch too."""
    sharp = CORNER if tolerance <= TOLERANCE else CORNER_SMOOTHED
    found: list[int] = (np.flatnonzero(np.abs(turning_angles(points)) > sharp) + 1).tolist()
    if tolerance <= TOLERANCE:
        return found
    arc = arc_lengths(points)
    corners = []
    for i in found:
        near, far = points_at_lengths(points, arc[i] + np.array([-1, 1]) * CORNER_REACH * tolerance)
        if abs(float(turning_angles(np.stack([near, points[i], far]))[0])) > sharp:
            corners.append(i)
    return corners


def _distinct(points: FloatArray) -> IndexArray:
    keep = np.concatenate([[True], segment_lengths(points) > 1e-9])
    return np.flatnonzero(keep) if keep.sum() > 1 else np.array([0, len(points) - 1])


def _within_tolerance(curve: Curve, points: FloatArray, tolerance: float) -> Curve:
    """Return the curve, or one that is as much longer as it takes to keep within the tolerance of the points."""
    # Measured on the chords by which the curve is drawn.
    room = tolerance - CHORD / 2
    for share in INSIDE:
        if _stray(curve.sample(), points) <= tolerance:
            break
        curve = _fit_run(points, tolerance, _lengths_inside(points, share * tolerance), room=room)
    return curve


def _lengths_inside(points: FloatArray, depth: float) -> FloatArray:
    """Return the lengths [m] (#P) of a curve that runs no more than `depth` [m] inside the points.

    Over a chord h an arc that turns by t is longer by h t^2 / 24, and by t for each metre that it runs farther outside.
    """
    step, turn = segment_lengths(points), np.abs(turning_angles(points))
    both = (np.concatenate([turn[:1], turn]) + np.concatenate([turn, turn[-1:]])) / 2
    longer = np.maximum(0.0, step * both**2 / 24 - depth * both)
    return np.concatenate([[0.0], np.cumsum(step + longer)])


@dataclass(frozen=True, kw_only=True, eq=False)
class _FitGoal:
    """The lengths and tolerances that the curve of one stretch has to meet.

    Attributes:
        points: #P by 2 [m], what it runs along.
        arc: #P, the wanted length [m] up to each point.
        tolerance: [m].
        room: largest distance [m] of a point from a curve along a straight stretch.
        bend: largest product of turning angle and step along the points [m]. A curve of equal length strays from a coarse
            border by a share of it, to one side at corners and to the other side at chords.
        slack: by how much less an error of length counts.
        strict: the room holds everywhere, whatever the bend.
    """

    points: FloatArray
    arc: FloatArray
    tolerance: float
    room: float
    bend: float
    slack: float
    strict: bool

    def score(self, curve: Curve, length_error: float) -> float:
        """Return the larger of both errors, of place and length, over what is allowed; infinite if it is too far."""
        samples = curve.sample(self.tolerance / 10)
        stray = _stray(samples, self.points)
        if stray > self.room + self.bend / 6 or _stray(self.points, samples) > self.room + self.bend / 4:
            return np.inf
        length_error = max(length_error, abs(float(arc_lengths(samples)[-1] - self.arc[-1])))
        allowed = self.room if self.strict else self.room + self.bend / 24
        return max(stray / allowed, length_error / (LENGTH * self.slack))


def _fit_goal(points: FloatArray, tolerance: float, lengths: FloatArray | None, room: float | None) -> _FitGoal:
    """Return what a curve along the points is measured by (arguments as for `_fit_run`)."""
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    bend = float((np.abs(turning_angles(points)) * np.maximum(step[:-1], step[1:])).max())
    slack = 1.0
    strict = room is not None
    if room is not None:
        slack = NEAR
    elif lengths is None:
        # A zigzag smoothed away is longer than the curve by the square of its width.
        room, slack = tolerance, max(1.0, (tolerance / TOLERANCE) ** 2)
    else:
        room = OTHER_LENGTHS * tolerance
        # What bends along a zigzag is to be smoothed away.
        bend = 0.0 if tolerance > TOLERANCE else bend
    arc = arc_lengths(points) if lengths is None else lengths
    return _FitGoal(points=points, arc=arc, tolerance=tolerance, room=room, bend=bend, slack=slack, strict=strict)


def _fit_run(
    points: FloatArray,
    tolerance: float,
    lengths: FloatArray | None = None,
    *,
    room: float | None = None,
) -> Curve:
    """Fit one stretch without corners: of the curves that are close and as long as they should be, the simplest.

    Args:
        points: #P by 2 [m].
        tolerance: [m].
        lengths: #P, the wanted length [m] up to each point; None for that of the chords.
        room: largest distance [m] of a point from the curve; None for the tolerance, or more if `lengths` are given.
    """
    if len(points) == 2 or _chord_distance(points).max() <= tolerance:
        return chords(points[[0, -1]])
    goal = _fit_goal(points, tolerance, lengths, room)
    best, least = chords(points), np.inf
    for smoothing in tolerance**2 * len(points) * np.array([1.0, 0.5, 0.25, 0.1, 0.03, 0.01, 0.001, 0.0]):
        fit = _length_keeping_spline(points, goal.arc, float(smoothing), tolerance, LENGTH_WEIGHT * goal.slack)
        if fit is None:
            continue
        bezier, length_error = fit
        curve = Curve(bezier=bezier, straight=np.zeros(len(bezier), dtype=bool))
        score = goal.score(curve, length_error)
        if len(bezier) < len(points) and score < least:
            best, least = curve, score
        if least <= 1.0:
            break
    return best


def _length_keeping_spline(
    points: FloatArray, arc: FloatArray, smoothing: float, tolerance: float, length_weight: float
) -> tuple[FloatArray, float] | None:
    """Fit a spline, and move its coefficients until it has the wanted lengths.

    Args:
        points, arc: #P by 2 [m], and #P, the wanted length up to each [m].
        smoothing: FITPACK's bound for the sum of squared distances [m2].
        tolerance: [m].
        length_weight: [m], an error of length that counts as much as one tolerance of place.

    Returns:
        Control points (#S by 4 by 2), and by how much [m] the length up to some point is off; None if there is no
        curve.
    """
    from scipy.interpolate import BSpline, splprep

    at = arc / arc[-1]
    degree = min(3, len(points) - 1)
    weights = np.ones(len(points))
    # The ends must stay: they weigh a thousandfold, and the last micrometres are corrected below.
    weights[[0, -1]] = 1e3
    try:
        # full_output silences FITPACK's warnings: the caller measures whether the fit is close enough.
        fit = splprep(points.T, u=at, w=weights, k=degree, s=smoothing, full_output=1)
        knots, coefficients, _ = fit[0][0]
    except ValueError:
        return None
    control = np.array(coefficients).T
    if degree == 2:
        knots, control = _as_cubic(control)
    control[[0, -1]] = points[[0, -1]]
    if not np.isfinite(control).all():
        return None
    control, off = adjust_lengths(knots, control, points, arc, tolerance, length_weight)
    spline = BSpline(knots, control, 3)
    breaks = np.unique(knots)
    place, slope = spline(breaks), spline(breaks, 1)
    third = np.diff(breaks)[:, None] / 3
    result = np.stack([place[:-1], place[:-1] + third * slope[:-1], place[1:] - third * slope[1:], place[1:]], axis=1)
    result[0, 0], result[-1, 3] = points[0], points[-1]
    result[1:, 0] = result[:-1, 3]
    # Crowded parameters may throw control points far out although the curve meets all data.
    if not np.isfinite(result).all() or np.abs(result - points[0]).max() > 2 * np.abs(points - points[0]).max():
        return None
    return result, off


def _as_cubic(control: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Raise a parabola to a cubic: its knots and control points."""
    a, b, c = control
    return np.repeat([0.0, 1.0], 4), np.stack([a, (a + 2 * b) / 3, (2 * b + c) / 3, c])


def chords(points: FloatArray) -> Curve:
    """Return the straight lines from point to point."""
    a, b = points[:-1], points[1:]
    return Curve(
        bezier=np.stack([a, a + (b - a) / 3, b - (b - a) / 3, b], axis=1), straight=np.ones(len(a), dtype=bool)
    )


def _chord_distance(points: FloatArray) -> FloatArray:
    """Return each point's distance [m] from the chord between the first and the last."""
    import shapely

    chord = shapely.LineString(points[[0, -1]])
    return np.asarray(shapely.distance(chord, shapely.points(points)), dtype=np.float64)


def _stray(line: FloatArray, points: FloatArray) -> float:
    """Return the largest distance [m] of a point from a line."""
    import shapely

    return float(np.max(shapely.distance(shapely.LineString(line), shapely.points(points))))


def _evaluate(control: FloatArray, t: FloatArray) -> FloatArray:
    """Evaluate one cubic Bézier (4 by 2) at parameters t."""
    s = 1 - t
    weights = np.stack([s**3, 3 * s**2 * t, 3 * s * t**2, t**3], axis=1)
    return weights @ control
