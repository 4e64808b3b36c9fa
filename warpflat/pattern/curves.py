"""From the many points of a mesh border to a clean curve: few cubic Béziers within a tolerance, corners kept."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

__all__ = ["Curve", "arc_lengths", "fit_curve", "turning_angles"]

#: A vertex inside an edge that turns by more than this [rad] is a corner, not a sample of a curve.
CORNER = np.radians(50.0)
#: Fits per smoothing, each with parameters corrected by the one before.
PARAMETER_PASSES = 3
#: The chords by which a curve is drawn or cut stay this close [m] to it.
CHORD = 2e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """A chain of cubic Béziers.

    Attributes:
        bezier: #S by 4 by 2, control points [m]; each segment starts where the one before it ends.
        straight: #S, segments that are straight lines.
    """

    bezier: NDArray[np.float64]
    straight: NDArray[np.bool_]

    def sample(self, tolerance: float = CHORD) -> NDArray[np.float64]:
        """#P by 2 [m]: points on the curve whose chords stray at most `tolerance` [m]; ends and joints are exact."""
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
        return float(arc_lengths(self.sample(1e-6))[-1])

    @property
    def nodes(self) -> NDArray[np.float64]:
        """#S + 1 by 2 [m], the ends of the segments."""
        return np.concatenate([self.bezier[:, 0], self.bezier[-1:, 3]])

    def transformed(self, matrix: NDArray[np.float64]) -> Curve:
        """The curve under a 2 by 3 affine matrix."""
        return Curve(bezier=self.bezier @ matrix[:, :2].T + matrix[:, 2], straight=self.straight)

    def reversed(self) -> Curve:
        """The same curve run the other way."""
        return Curve(bezier=self.bezier[::-1, ::-1], straight=self.straight[::-1])


def arc_lengths(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """#P, the length [m] along a polyline up to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def turning_angles(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """#P - 2, the signed angle [rad] by which an open polyline turns at each inner point, to the left positive."""
    step = np.diff(points, axis=0)
    cross = step[:-1, 0] * step[1:, 1] - step[:-1, 1] * step[1:, 0]
    return np.arctan2(cross, np.einsum("ij,ij->i", step[:-1], step[1:]))


def fit_curve(points: NDArray[np.float64], tolerance: float = 1e-4) -> Curve:
    """A smooth curve through the points with as few segments as keep within `tolerance` [m] of every point.

    The ends are exact, so neighbouring edges still share their corners; a sharp inner vertex stays a corner. Between
    corners the curve is a smoothing cubic spline (Dierckx's FITPACK through scipy), given as Béziers.

    Args:
        points: #P by 2 [m]; repeated points are dropped.
        tolerance: largest distance [m] of a point from the curve.
    """
    keep = np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9])
    clean = points[keep]
    if len(clean) < 2:
        clean = points[[0, -1]]
    clean[-1] = points[-1]
    breaks = [0, *(np.flatnonzero(np.abs(turning_angles(clean)) > CORNER) + 1).tolist(), len(clean) - 1]
    runs = [_fit_run(clean[a : b + 1], tolerance) for a, b in pairwise(breaks)]
    return Curve(
        bezier=np.concatenate([run.bezier for run in runs]), straight=np.concatenate([run.straight for run in runs])
    )


def _fit_run(points: NDArray[np.float64], tolerance: float) -> Curve:
    """One stretch without corners."""
    line = _polyline_curve(points[[0, -1]])
    if _chord_distance(points).max() <= tolerance:
        return line
    if len(points) == 2:
        return line
    parameter = arc_lengths(points) / arc_lengths(points)[-1]
    # Between two points of a coarse border the curve may bulge as far as their chord cuts the bend, not further.
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    sagitta = float((np.abs(turning_angles(points)) * np.maximum(step[:-1], step[1:])).max()) / 4
    best = _polyline_curve(points)
    for smoothing in tolerance**2 * len(points) * np.array([1.0, 0.5, 0.25, 0.1, 0.03, 0.01, 0.001, 0.0]):
        for _ in range(PARAMETER_PASSES):
            bezier = _spline_bezier(points, parameter, float(smoothing))
            if bezier is None:
                break
            curve = Curve(bezier=bezier, straight=np.zeros(len(bezier), dtype=bool))
            samples = curve.sample(tolerance / 10)
            close = _stray(samples, points) <= tolerance and _stray(points, samples) <= tolerance + sagitta
            if close and len(bezier) < len(best.bezier):
                best = curve
            parameter = _projected(samples, points, parameter)
        if len(best.bezier) < len(points) - 1:
            break
    return best


def _spline_bezier(
    points: NDArray[np.float64], parameter: NDArray[np.float64], smoothing: float
) -> NDArray[np.float64] | None:
    from scipy.interpolate import BSpline, splprep

    degree = min(3, len(points) - 1)
    weights = np.ones(len(points))
    # The spline may not move its ends: weigh them a thousandfold, then put the last micrometres right.
    weights[[0, -1]] = 1e3
    try:
        # full_output: whether the fit is close enough is measured by the caller, FITPACK's own doubts are no news.
        fit = splprep(points.T, u=parameter, w=weights, k=degree, s=smoothing, full_output=1)
        knots, coefficients, _ = fit[0][0]
    except ValueError:
        return None
    spline = BSpline(knots, np.array(coefficients).T, degree)
    breaks = np.unique(knots)
    at, slope = spline(breaks), spline(breaks, 1)
    third = np.diff(breaks)[:, None] / 3
    result = np.stack([at[:-1], at[:-1] + third * slope[:-1], at[1:] - third * slope[1:], at[1:]], axis=1)
    # Crowded parameters may throw control points far out, between data that are met: no curve for cloth.
    if not np.isfinite(result).all() or np.abs(result - points[0]).max() > 2 * np.abs(points - points[0]).max():
        return None
    result[0, :2] += points[0] - result[0, 0]
    result[-1, 2:] += points[-1] - result[-1, 3]
    result[1:, 0] = result[:-1, 3]
    return result


def _projected(
    line: NDArray[np.float64], points: NDArray[np.float64], before: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Where along the fitted line each point lies: better parameters for the next fit (Hoschek's correction)."""
    import shapely

    curve = shapely.LineString(line)
    along = np.asarray(shapely.line_locate_point(curve, shapely.points(points), normalized=True))
    along[[0, -1]] = 0.0, 1.0
    return along if (np.diff(along) > 0).all() else before


def _polyline_curve(points: NDArray[np.float64]) -> Curve:
    a, b = points[:-1], points[1:]
    return Curve(
        bezier=np.stack([a, a + (b - a) / 3, b - (b - a) / 3, b], axis=1), straight=np.ones(len(a), dtype=bool)
    )


def _chord_distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
    import shapely

    chord = shapely.LineString(points[[0, -1]])
    return np.asarray(shapely.distance(chord, shapely.points(points)), dtype=np.float64)


def _stray(line: NDArray[np.float64], points: NDArray[np.float64]) -> float:
    import shapely

    return float(np.max(shapely.distance(shapely.LineString(line), shapely.points(points))))


def _evaluate(control: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
    s = 1 - t
    weights = np.stack([s**3, 3 * s**2 * t, 3 * s * t**2, t**3], axis=1)
    return weights @ control
