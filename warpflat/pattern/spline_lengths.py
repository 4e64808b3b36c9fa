"""Splines adjusted so that they have given lengths up to each of their points, with as little change as possible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray

__all__ = ["adjust_lengths"]

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
        if np.abs(move).max() < 1e-8:
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
        self._assemble()

    def _assemble(self) -> None:
        """Assemble the entries that stay the same in all steps, and the places of the others."""
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
        move = np.zeros_like(fit.control)
        move[1:-1] = (self._move_few if self._few else self._move_many)(fit, gradient[1:-1])
        return move

    def _summed(self, row: NDArray[np.int64], number: NDArray[np.int64], value: FloatArray) -> FloatArray:
        """Return a matrix with a column for each control point: the sum of values (#N by 4) by row (#N) and number (#N by 4)."""
        shape = int(row[-1]) + 1, len(self._start)
        flat = (row[:, None] * shape[1] + number).ravel()
        return np.asarray(np.bincount(flat, value.ravel(), shape[0] * shape[1]).reshape(shape), dtype=np.float64)

    def _move_few(self, fit: _Fit, gradient: FloatArray) -> FloatArray:
        """Solve the normal equations for the moves of the inner control points, #control - 2 by 2."""
        span = np.repeat(np.arange(len(self._steps)), GAUSS)
        rate = [self._summed(span, self._at_quadrature, self._slope * fit.rate[:, axis, None]) for axis in range(2)]
        by_span = np.stack(rate, axis=2)[:, 1:-1].reshape(len(self._steps), -1)
        length_rate = np.cumsum(by_span, axis=0) / self._length_weight
        off = np.cumsum(fit.length_error) / self._length_weight
        matrix = length_rate.T @ length_rate
        matrix[::2, ::2] += self._fixed
        matrix[1::2, 1::2] += self._fixed
        solved = np.linalg.solve(matrix, -gradient.ravel() - length_rate.T @ off)
        return np.asarray(solved, dtype=np.float64).reshape(-1, 2)

    def _move_many(self, fit: _Fit, gradient: FloatArray) -> FloatArray:
        """Solve the banded equations for the moves of the inner control points, #control - 2 by 2."""
        # Thousands of small systems: `scipy.linalg.solve_banded` takes longer to check its arguments than to solve one.
        from scipy.linalg.lapack import dgbsv

        rate = (self._slope[:, :, None] * fit.rate[:, None, :])[self._free] / -self._length_weight
        band = self._fixed + np.bincount(self._to, np.concatenate([rate, rate]), minlength=len(self._fixed))
        right = np.empty(self._size)
        right[self._of_control[1:-1]] = -gradient
        right[self._of_span] = fit.length_error / self._length_weight
        _, _, solved, failed = dgbsv(
            self._band, self._band, band.reshape(3 * self._band + 1, self._size), right, overwrite_ab=True
        )
        if failed:
            raise np.linalg.LinAlgError("the spline's equations are singular")
        moved: FloatArray = solved[self._of_control[1:-1]]
        return moved


def _cubic_basis(knots: FloatArray, at: FloatArray) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Return the cubic B-splines that are not zero at each place: numbers, values and slopes, #N by 4 each."""
    from scipy.interpolate import BSpline

    cubic, square = (BSpline.design_matrix(at, knots, degree) for degree in (3, 2))
    number = cubic.indices.reshape(-1, 4).astype(np.int64)
    # A cubic B-spline's slope is three times the difference of two quadratic ones, each over the width of its support.
    lower = np.zeros((len(at), 5))
    lower[:, 1:4] = square.data.reshape(-1, 3)
    each = number[:, :1] + np.arange(5)
    reach = knots[np.minimum(each + 3, len(knots) - 1)] - knots[each]
    share = 3.0 * np.divide(lower, reach, out=np.zeros_like(lower), where=reach > 0.0)
    return number, cubic.data.reshape(-1, 4), share[:, :-1] - share[:, 1:]
