"""Splines brought to lengths: against dense least squares."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import BSpline, splprep

from warpflat.core.polyline import arc_lengths
from warpflat.pattern.drafting.curves import MOVE_TOLERANCES, _LengthSystem, adjust_lengths

FloatArray = NDArray[np.float64]
TOLERANCE, WEIGHED = 1e-4, 8e-6


def spline_through(count: int, smoothing: float, noise: float = 0.0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Knots and control points of a fit, and its points, unevenly far apart."""
    rng = np.random.default_rng(count)
    t = np.linspace(0.0, 1.0, count)
    t[1:-1] += 0.3 / count * rng.uniform(-1.0, 1.0, count - 2)
    points = np.column_stack([0.4 * t, 0.1 * np.sin(5.0 * t)]) + noise * rng.normal(size=(count, 2))
    weights = np.ones(count)
    weights[[0, -1]] = 1e3
    arc = arc_lengths(points)
    knots, control, _ = splprep(points.T, u=arc / arc[-1], w=weights, k=3, s=smoothing, full_output=1)[0][0]
    control = np.array(control).T
    control[[0, -1]] = points[[0, -1]]
    return knots, control, points


def errors(
    control: FloatArray, start: FloatArray, knots: FloatArray, points: FloatArray, arc: FloatArray
) -> FloatArray:
    """What is minimised the squares of: places, lengths up to each point, and how far the control points have moved."""
    spline, at = BSpline(knots, control, 3), arc / arc[-1]
    node, weight = np.polynomial.legendre.leggauss(6)
    half = np.diff(at)[:, None] / 2.0
    speed = np.linalg.norm(spline(at[:-1, None] + half * (node + 1.0), 1), axis=-1)
    length = np.cumsum((half * weight * speed).sum(axis=1)) - arc[1:]
    away, moved = (spline(at) - points)[1:-1] / TOLERANCE, (control - start)[1:-1] / (MOVE_TOLERANCES * TOLERANCE)
    return np.concatenate([away.ravel(), length / WEIGHED, moved.ravel()])


@pytest.mark.parametrize(("count", "smoothing"), [(5, 0.0), (12, 0.0), (30, 1e-6), (60, 1e-5), (60, 1e-9)])
def test_a_step_is_that_of_least_squares(count: int, smoothing: float):
    knots, start, points = spline_through(count, smoothing, 2e-4)
    arc = 1.001 * arc_lengths(points)
    rng = np.random.default_rng(1)
    control = start.copy()
    control[1:-1] += 1e-3 * rng.normal(size=control[1:-1].shape)
    now = errors(control, start, knots, points, arc)
    columns = []
    for k in np.ndindex(control[1:-1].shape):
        other = control.copy()
        other[1:-1][k] += 1e-7
        columns.append((errors(other, start, knots, points, arc) - now) / 1e-7)
    expected = -np.linalg.lstsq(np.column_stack(columns), now, rcond=None)[0].reshape(-1, 2)
    system = _LengthSystem(knots, start, points, arc, TOLERANCE, WEIGHED)
    fit = system.at(control)
    assert fit.objective == pytest.approx(now @ now, rel=1e-9)
    move = system.move(fit)
    assert not move[[0, -1]].any()
    np.testing.assert_allclose(move[1:-1], expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.parametrize(("count", "smoothing"), [(30, 1e-6), (200, 1e-5), (800, 1e-7)])
def test_steps_end_where_the_errors_weigh_least(count: int, smoothing: float):
    knots, start, points = spline_through(count, smoothing)
    arc = arc_lengths(points)
    control, off = adjust_lengths(knots, start.copy(), points, arc, TOLERANCE, WEIGHED)
    before, after = (errors(of, start, knots, points, arc) for of in (start, control))
    assert after @ after < before @ before
    lengths = slice(2 * count - 4, 3 * count - 5)
    assert off == pytest.approx(WEIGHED * np.abs(after[lengths]).max(), rel=1e-6)
    np.testing.assert_array_equal(control[[0, -1]], start[[0, -1]])
    # Where the errors weigh least in all, no step leads on.
    system = _LengthSystem(knots, start, points, arc, TOLERANCE, WEIGHED)
    assert np.abs(system.move(system.at(control))).max() < 1e-6
