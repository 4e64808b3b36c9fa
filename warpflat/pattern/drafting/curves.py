"""Cubic Béziers, and clean curves of them from the many points of a mesh border: few, within a tolerance, corners kept."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from warpflat.core import (
    BoolArray,
    FloatArray,
    arc_lengths,
    points_at_lengths,
    polyline_length,
    segment_lengths,
    turning_angles,
)
from warpflat.pattern.drafting.polygons import mapped

__all__ = [
    "CHORD",
    "TOLERANCE",
    "Curve",
    "adjust_lengths",
    "as_cubic",
    "chords",
    "cubic_weights",
    "curve_through",
    "farthest",
    "fit_curve",
    "split_bezier",
]


#: A vertex inside an edge that turns by more than this [rad] is a corner, not a sample of a curve.
CORNER = np.radians(45.0)
#: Along a border that is smoothed a corner shows over this many tolerances to either side, and by more than this [rad].
CORNER_REACH, CORNER_SMOOTHED = 12.0, np.radians(50.0)
#: An edge bends alike in both halves if its turning, times the shares of its length by which it lies beyond the middle, adds up to less
#: than this [rad]: more than what rounding of layouts to 1 um makes of one that is its own mirror image.
EVEN = 5e-4
#: By how much more the last point of a border weighs than the first one where it is fitted.
LATER = 1.05
#: How far [m] a curve may lie from the points of a clean border.
TOLERANCE = 1e-4
#: The length of a fitted curve, up to any of its points, is off by at most this [m] wherever that can be had.
LENGTH = 6e-5
#: An error of length [m] that counts as much as an error of place by one tolerance.
LENGTH_WEIGHT = 8e-6
#: A curve of another length than its points' chords may lie this many tolerances from them.
OTHER_LENGTHS = 3.0
#: A curve of more segments is taken where its error is less than this share of that of a simpler one.
CLEARLY = 0.9
#: A curve that must keep near its points gets the lengths of one that runs inside them by these shares of the
#: tolerance, until it does keep near. The second number says by how much less its lengths then count.
INSIDE, NEAR = (0.8, 0.5, 0.2, 0.0), 4.0
#: A line through points has a kink where it turns by more than this [rad], and by so many times more than beside it.
KINK, KINK_AGAIN = np.radians(12.0), 2.0
#: It is straight where it turns by less than this [rad]; elsewhere it gets so many chords for one.
STRAIGHT, FINER = 1e-4, 8
#: The chords by which a curve is drawn, cut or read stay this close [m] to it.
CHORD = 2e-5


def cubic_weights(t: FloatArray) -> FloatArray:
    """Return the weights of a cubic Bézier's control points at parameters (#T by 4): Bernstein's polynomials."""
    s = 1 - t
    return np.stack([s**3, 3 * s**2 * t, 3 * s * t**2, t**3], axis=1)


def as_cubic(control: FloatArray) -> FloatArray:
    """Return the cubic (4 by 2) of a Bézier of degree two (3 by 2); a cubic as it is."""
    if len(control) == 4:
        return control
    a, b, c = control
    return np.stack([a, (a + 2 * b) / 3, (2 * b + c) / 3, c])


def split_bezier(control: FloatArray, t: float) -> tuple[FloatArray, FloatArray]:
    """Return the two parts of a Bézier (#C by 2) before and after a parameter, by de Casteljau's scheme."""
    before, points, after = [control[0]], control, [control[-1]]
    while len(points) > 1:
        points = (1 - t) * points[:-1] + t * points[1:]
        before.append(points[0])
        after.append(points[-1])
    return np.array(before), np.array(after[::-1])


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
        # A chord over a parameter step h strays at most h^2/8 max|B''|, and |B''| <= 6 max|second difference|.
        second = self.bezier[:, :-2] - 2 * self.bezier[:, 1:-1] + self.bezier[:, 2:]
        bend = np.sqrt((second * second).sum(axis=2).max(axis=1))
        counts = np.maximum(1, np.ceil(np.sqrt(0.75 * bend / tolerance))).astype(np.int64)
        counts[self.straight] = 1
        ends = counts.cumsum()
        number = np.repeat(np.arange(len(counts)), counts)
        t = (np.arange(ends[-1]) - (ends - counts)[number]) / counts[number]
        points = np.einsum("tk,tkd->td", cubic_weights(t), self.bezier[number])
        return np.concatenate([points, self.bezier[-1:, 3]])

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
        return Curve(bezier=mapped(self.bezier, matrix), straight=self.straight)

    def reversed(self) -> Curve:
        """Return the curve run the other way."""
        return Curve(bezier=self.bezier[::-1, ::-1], straight=self.straight[::-1])


def curve_through(points: FloatArray) -> FloatArray:
    """Return a line through points on a curve, with more points where it bends: cubic splines by chord length between its kinks.

    Chords h on a radius R are shorter than their arcs by h^2 / (24 R^2) of their length, 1 mm in 1 m for 10 mm on 65 mm; the spline is
    shorter by a share of the fourth order.

    Args:
        points: #P by 2 [m].

    Returns:
        #Q by 2 [m], the points among them; they themselves where the line is straight.
    """
    from scipy.interpolate import CubicSpline

    turns = np.abs(turning_angles(points))
    beside = np.maximum(np.append(turns[1:], 0.0), np.append(0.0, turns[:-1]))
    kinks = np.flatnonzero((turns > KINK) & (turns > KINK_AGAIN * beside)) + 1
    arc = arc_lengths(points)
    if np.diff(arc).min() < 1e-9 or not (turns > STRAIGHT).any():
        return points
    made = []
    for a, b in pairwise([0, *kinks.tolist(), len(points) - 1]):
        bends = np.append(0.0, np.append(turns[a : b - 1], 0.0))
        if b - a < 2 or bends.max() <= STRAIGHT:
            made.append(points[a:b])
            continue
        curve = CubicSpline(arc[a : b + 1], points[a : b + 1])
        shares = np.arange(FINER) / FINER
        bent = np.maximum(bends[:-1], bends[1:]) > STRAIGHT
        steps = [arc[a + k] + (shares if bent[k] else shares[:1]) * (arc[a + k + 1] - arc[a + k]) for k in range(b - a)]
        made.append(curve(np.concatenate(steps)))
    return np.concatenate([*made, points[-1:]])


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
    apart = np.concatenate([[True], segment_lengths(points) > 1e-9])
    keep = np.flatnonzero(apart) if apart.sum() > 1 else np.array([0, len(points) - 1])
    clean = points[keep]
    clean[-1] = points[-1]
    wanted = None if lengths is None else lengths[keep]
    arc = arc_lengths(clean)
    # Mirrored edges are fitted from mirrored ends: from the one farther from where they bend.
    from_end = bool(np.abs(turning_angles(clean)) @ (arc[1:-1] / arc[-1] - 0.5) > EVEN)
    if from_end:
        clean, wanted = clean[::-1], None if wanted is None else wanted[-1] - wanted[::-1]
    # Corners; along a zigzag only those that are so over a longer stretch, too.
    sharp, arc = CORNER if tolerance <= TOLERANCE else CORNER_SMOOTHED, arc_lengths(clean)
    corners: list[int] = (np.flatnonzero(np.abs(turning_angles(clean)) > sharp) + 1).tolist()
    if tolerance > TOLERANCE:
        reach = np.array([-1, 1]) * CORNER_REACH * tolerance
        around = ((i, *points_at_lengths(clean, arc[i] + reach)) for i in corners)
        corners = [i for i, a, b in around if abs(float(turning_angles(np.stack([a, clean[i], b]))[0])) > sharp]
    breaks = [0, *corners, len(clean) - 1]
    runs = []
    for a, b in pairwise(breaks):
        run = clean[a : b + 1]
        curve = _fit_run(run, tolerance, None if wanted is None else wanted[a : b + 1] - wanted[a])
        for share in INSIDE if near else ():
            if farthest(curve.sample(), run) <= tolerance:
                break
            # The lengths [m] (#P) of a curve that runs inside the points, no more than a share of the tolerance.
            step, turn = segment_lengths(run), np.abs(turning_angles(run))
            both = (np.concatenate([turn[:1], turn]) + np.concatenate([turn, turn[-1:]])) / 2
            longer = np.maximum(0.0, step * both**2 / 24 - share * tolerance * both)
            inside = np.concatenate([[0.0], np.cumsum(step + longer)])
            # Measured on the chords by which the curve is drawn.
            curve = _fit_run(run, tolerance, inside, room=tolerance - CHORD / 2)
        runs.append(curve)
    whole = Curve(
        bezier=np.concatenate([run.bezier for run in runs]), straight=np.concatenate([run.straight for run in runs])
    )
    return whole.reversed() if from_end else whole


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
    if farthest(points[[0, -1]], points) <= tolerance:
        return chords(points[[0, -1]])
    # The largest product of turning angle and step along the points [m]. A curve of equal length strays from a coarse
    # border by a share of it, to one side at corners and to the other side at chords.
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    bend = float((np.abs(turning_angles(points)) * np.maximum(step[:-1], step[1:])).max())
    # By how much less an error of length counts. A zigzag smoothed away is longer than the curve by the square of its width.
    leeway = NEAR if room is not None else 1.0 if lengths is not None else max(1.0, (tolerance / TOLERANCE) ** 2)
    if lengths is not None and room is None and tolerance > TOLERANCE:
        # What bends along a zigzag is to be smoothed away.
        bend = 0.0
    far = room if room is not None else tolerance if lengths is None else OTHER_LENGTHS * tolerance
    allowed = far + bend / 24 if room is None else far
    arc = arc_lengths(points) if lengths is None else lengths
    best, least = chords(points), np.inf
    tried: FloatArray = np.zeros(0)
    for smoothing in tolerance**2 * len(points) * np.array([1.0, 0.5, 0.25, 0.1, 0.03, 0.01, 0.001, 0.0]):
        spline = _smoothing_spline(points, arc / arc[-1], float(smoothing))
        # Once its lengths are right, a spline with the same knots is the same to some micrometres.
        if spline is None or np.array_equal(spline[0], tried):
            continue
        tried, control = spline
        control, length_error = adjust_lengths(tried, control, points, arc, tolerance, LENGTH_WEIGHT * leeway)
        bezier = _bezier(tried, control)
        # Crowded parameters may throw control points far out although the curve meets all data.
        if not np.isfinite(bezier).all() or np.abs(bezier - points[0]).max() > 2 * np.abs(points - points[0]).max():
            continue
        curve = Curve(bezier=bezier, straight=np.zeros(len(bezier), dtype=bool))
        samples = curve.sample(tolerance / 10)
        away = farthest(samples, points)
        if away > far + bend / 6 or farthest(points, samples) > far + bend / 4:
            continue
        length_error = max(length_error, abs(polyline_length(samples) - float(arc[-1])))
        # The larger of both errors, of place and length, over what is allowed.
        score = max(away / allowed, length_error / (LENGTH * leeway))
        if len(bezier) < len(points) and score < CLEARLY * least:
            best, least = curve, score
        if least <= 1.0:
            break
    return best


def _smoothing_spline(points: FloatArray, at: FloatArray, smoothing: float) -> tuple[FloatArray, FloatArray] | None:
    """Return knots and control points (#C by 2 [m]) of a cubic smoothing spline, or None if there is none.

    Args:
        points: #P by 2 [m].
        at: #P, their parameters from 0 to 1.
        smoothing: FITPACK's bound for the sum of squared distances [m2].
    """
    from scipy.interpolate import splprep

    degree = min(3, len(points) - 1)
    # Of two places that need a knot alike, as on a border that is its own mirror image, one gets it first, whatever the rounding.
    weights = np.linspace(1.0, LATER, len(points))
    # The ends must stay: they weigh a thousandfold, and the last micrometres are corrected below.
    weights[[0, -1]] = 1e3
    try:
        # full_output silences FITPACK's warnings: the caller measures whether the fit is close enough.
        knots, coefficients, _ = splprep(points.T, u=at, w=weights, k=degree, s=smoothing, full_output=1)[0][0]
    except ValueError:
        return None
    control = np.array(coefficients).T
    if degree == 2:
        knots, control = np.repeat([0.0, 1.0], 4), as_cubic(control)
    control[[0, -1]] = points[[0, -1]]
    return (knots, control) if np.isfinite(control).all() else None


def _bezier(knots: FloatArray, control: FloatArray) -> FloatArray:
    """Return the segments (#S by 4 by 2) of a cubic B-spline, by inserting each inner knot twice more (Boehm 1980)."""
    before, start, end, after = knots[2:-5], knots[3:-4], knots[4:-3], knots[5:-2]
    one, two = (
        control[1:-2] + ((at - before) / (after - before))[:, None] * (control[2:-1] - control[1:-2])
        for at in (start, end)
    )
    share = (start[1:] - start[:-1]) / (end[1:] - start[:-1])
    nodes = np.concatenate([control[:1], two[:-1] + share[:, None] * (one[1:] - two[:-1]), control[-1:]])
    return np.stack([nodes[:-1], one, two, nodes[1:]], axis=1)


def chords(points: FloatArray) -> Curve:
    """Return the straight lines from point to point."""
    a, b = points[:-1], points[1:]
    return Curve(
        bezier=np.stack([a, a + (b - a) / 3, b - (b - a) / 3, b], axis=1), straight=np.ones(len(a), dtype=bool)
    )


def farthest(line: FloatArray, points: FloatArray) -> float:
    """Return the largest distance [m] of a point from a line."""
    import shapely

    return float(np.max(shapely.distance(shapely.LineString(line), shapely.points(points))))


#: A control point's move counts this many times less than the same error in a point's place.
MOVE_TOLERANCES = 20.0
#: Largest number of Gauss-Newton steps, and of quadrature points between two points of the border.
GAUSS_NEWTON, GAUSS = 8, 6
_QUADRATURE = np.polynomial.legendre.leggauss(GAUSS)


def adjust_lengths(
    knots: FloatArray,
    control: FloatArray,
    points: FloatArray,
    arc: FloatArray,
    tolerance: float,
    length_weight: float,
) -> tuple[FloatArray, float]:
    """Move the control points of a spline as little as possible, so that its length up to each point is `arc`.

    Gauss-Newton on the errors of place, the errors of length and, softly, the control points' own moves.

    Args:
        knots, control: of a cubic B-spline; #control by 2 [m].
        points: #P by 2 [m], near the spline.
        arc: #P, the wanted length [m] up to each point.
        tolerance: error of place [m] that counts as 1.
        length_weight: error of length [m] that counts as 1.

    Returns:
        Control points (#control by 2 [m]), and by how much [m] the length is still off at worst.
    """
    system = _LengthSystem(knots, control, points, arc, tolerance, length_weight)
    fit = system.at(control)
    for _ in range(GAUSS_NEWTON):
        move = system.move(fit)
        for share in (1.0, 0.5, 0.25, 0.1):
            tried = system.at(fit.control + share * move)
            if tried.objective < fit.objective:
                break
        else:
            break
        fit = tried
        if np.abs(move).max() < 1e-7:
            break
    return fit.control, float(np.abs(np.cumsum(fit.length_error)).max())


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fit:
    """The errors of a fitted spline.

    Attributes:
        control: #control by 2 [m].
        objective: what is minimised.
        place_error: #P - 2 by 2, distance from the inner points in tolerances.
        length_error: #P - 1, by how much [m] the spline is too long between each two points.
        rate: #Q by 2, derivative of length by the slope at each point of quadrature, times its weight.
    """

    control: FloatArray
    objective: float
    place_error: FloatArray
    length_error: FloatArray
    rate: FloatArray


class _LengthSystem:
    """The equations of one Gauss-Newton step towards given lengths.

    Up to each point the length depends on all control points before it, so the normal equations would be dense.
    Therefore the errors e of the lengths are unknowns as well, bound by e_j - e_{j-1} = excess length between two
    points. With the multipliers of these equations in place of e, and all unknowns in their order along the curve, the
    matrix is banded. Where few control points follow many points the band would be as wide as the matrix, and the normal
    equations are small.
    """

    def __init__(
        self,
        knots: FloatArray,
        control: FloatArray,
        points: FloatArray,
        arc: FloatArray,
        tolerance: float,
        length_weight: float,
    ) -> None:
        at, count = arc / arc[-1], len(control)
        span = np.diff(at)
        node, weight = _QUADRATURE
        self._weights = (span[:, None] * weight / 2).ravel()
        self._points, self._steps, self._start = points[1:-1], np.diff(arc), control
        self._tolerance, self._length_weight = tolerance, length_weight
        self._control_weight = 1.0 / (MOVE_TOLERANCES * tolerance)
        between = (at[:-1, None] + span[:, None] * (node + 1) / 2).ravel()
        number, value, slope = _cubic_basis(knots, np.concatenate([at[1:-1], between]))
        self._at_points, self._value = number[: len(at) - 2], value[: len(at) - 2]
        self._at_quadrature, self._slope = number[len(at) - 2 :], slope[len(at) - 2 :]
        self._few = count * count <= 4 * len(span)
        if self._few:
            by_point = self._summed(np.arange(len(at) - 2), self._at_points, self._value)[:, 1:-1]
            self._fixed = by_point.T @ by_point / tolerance**2 + self._control_weight**2 * np.eye(count - 2)
            return
        # Places of the unknowns in their order: x and y of each control point but the ends, and one for each span.
        middle = (knots[1:-3] + knots[2:-2] + knots[3:-1])[1:-1] / 3.0
        order = np.argsort(np.concatenate([np.repeat(middle, 2), 0.5 * (at[:-1] + at[1:])]), kind="stable")
        place = np.empty(len(order), dtype=np.int64)
        place[order] = np.arange(len(order))
        self._of_control = np.full((count, 2), -1, dtype=np.int64)
        self._of_control[1:-1] = place[: 2 * count - 4].reshape(-1, 2)
        self._of_span = place[2 * count - 4 :]
        # The entries that stay the same in all steps, and the places of the others.
        moved, span = self._of_control, self._of_span
        pairs = (moved[self._at_points][:, :, None], moved[self._at_points][:, None, :])
        rows, columns = (np.broadcast_to(of, (len(self._at_points), 4, 4, 2)) for of in pairs)
        products = self._value[:, :, None, None] * self._value[:, None, :, None] / self._tolerance**2
        inner = moved[1:-1].ravel()
        diagonal = np.full(len(span), -2.0)
        diagonal[0] = -1.0
        beside = np.ones(len(span) - 1)
        entries = [
            (rows, columns, np.broadcast_to(products, rows.shape)),
            (inner, inner, np.full(len(inner), self._control_weight**2)),
            (span, span, diagonal),
            (span[1:], span[:-1], beside),
            (span[:-1], span[1:], beside),
        ]
        row, column, value = (np.concatenate([entry[k].ravel() for entry in entries]) for k in range(3))
        free = (row >= 0) & (column >= 0)
        row, column, value = row[free], column[free], value[free]
        of_rate = moved[self._at_quadrature]
        self._free = of_rate >= 0
        to = of_rate[self._free]
        by = np.broadcast_to(np.repeat(span, GAUSS)[:, None, None], of_rate.shape)[self._free]
        self._band = int(max(np.abs(row - column).max(), np.abs(by - to).max()))
        self._size = len(inner) + len(span)
        fixed = np.bincount(self._flat(row, column), value, minlength=(3 * self._band + 1) * self._size)
        self._fixed = fixed.astype(np.float64, copy=False)
        self._to = np.concatenate([self._flat(by, to), self._flat(to, by)])

    def _flat(self, row: NDArray[np.int64], column: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the indices of entries in the flattened band that LAPACK's `gbsv` takes, whose upper rows are its own."""
        return (2 * self._band + row - column) * self._size + column

    def at(self, control: FloatArray) -> _Fit:
        """Evaluate the fit of a spline with these control points, whose ends are those of the start."""
        tangent = np.einsum("qk,qkd->qd", self._slope, control[self._at_quadrature])
        speed = np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-12)
        length_error = (self._weights * speed).reshape(-1, GAUSS).sum(axis=1) - self._steps
        place_error = (np.einsum("pk,pkd->pd", self._value, control[self._at_points]) - self._points) / self._tolerance
        moved = (control - self._start) * self._control_weight
        off = np.cumsum(length_error) / self._length_weight
        return _Fit(
            control=control,
            objective=float((place_error**2).sum() + off @ off + (moved**2).sum()),
            place_error=place_error,
            length_error=length_error,
            rate=(self._weights / speed)[:, None] * tangent,
        )

    def move(self, fit: _Fit) -> FloatArray:
        """Return the Gauss-Newton step from a fit (#control by 2 [m]); the ends stay."""
        gradient = (fit.control - self._start) * self._control_weight**2
        for axis in range(2):
            along = self._value * fit.place_error[:, axis, None] / self._tolerance
            gradient[:, axis] += np.bincount(self._at_points.ravel(), along.ravel(), minlength=len(gradient))
        move, gradient = np.zeros_like(fit.control), gradient[1:-1]
        if self._few:
            # The normal equations.
            span = np.repeat(np.arange(len(self._steps)), GAUSS)
            rate = [self._summed(span, self._at_quadrature, self._slope * fit.rate[:, axis, None]) for axis in range(2)]
            by_span = np.stack(rate, axis=2)[:, 1:-1].reshape(len(self._steps), -1)
            length_rate = np.cumsum(by_span, axis=0) / self._length_weight
            off = np.cumsum(fit.length_error) / self._length_weight
            matrix = length_rate.T @ length_rate
            matrix[::2, ::2] += self._fixed
            matrix[1::2, 1::2] += self._fixed
            move[1:-1] = np.linalg.solve(matrix, -gradient.ravel() - length_rate.T @ off).reshape(-1, 2)
            return move
        # Thousands of small banded systems: `scipy.linalg.solve_banded` takes longer to check its arguments than to solve one.
        from scipy.linalg.lapack import dgbsv

        rates = (self._slope[:, :, None] * fit.rate[:, None, :])[self._free] / -self._length_weight
        band = self._fixed + np.bincount(self._to, np.concatenate([rates, rates]), minlength=len(self._fixed))
        right = np.empty(self._size)
        right[self._of_control[1:-1]] = -gradient
        right[self._of_span] = fit.length_error / self._length_weight
        _, _, solved, failed = dgbsv(
            self._band, self._band, band.reshape(3 * self._band + 1, self._size), right, overwrite_ab=True
        )
        if failed:
            raise np.linalg.LinAlgError("the spline's equations are singular")
        move[1:-1] = solved[self._of_control[1:-1]]
        return move

    def _summed(self, row: NDArray[np.int64], number: NDArray[np.int64], value: FloatArray) -> FloatArray:
        """Return a matrix with a column for each control point: the sum of values (#N by 4) by row (#N) and number (#N by 4)."""
        shape = int(row[-1]) + 1, len(self._start)
        flat = (row[:, None] * shape[1] + number).ravel()
        return np.asarray(np.bincount(flat, value.ravel(), shape[0] * shape[1]).reshape(shape), dtype=np.float64)


def _cubic_basis(knots: FloatArray, at: FloatArray) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Return the cubic B-splines that are not zero at each place: numbers, values and slopes, #N by 4 each (de Boor 1972)."""
    from scipy.interpolate import BSpline

    square = BSpline.design_matrix(at, knots[1:-1], 2)
    number = square.indices.reshape(-1, 3)[:, :1].astype(np.int64) + np.arange(5)
    lower = np.zeros((len(at), 5))
    lower[:, 1:4] = square.data.reshape(-1, 3)
    start, end = knots[number], knots[np.minimum(number + 3, len(knots) - 1)]
    share = np.divide(lower, end - start, out=np.zeros_like(lower), where=end > start)
    value = share[:, :-1] * (at[:, None] - start[:, :-1]) + share[:, 1:] * (end[:, 1:] - at[:, None])
    return number[:, :-1], value, 3.0 * (share[:, :-1] - share[:, 1:])
