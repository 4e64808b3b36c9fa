"""A spline brought to given lengths up to each of its points, as little moved as may be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray

__all__ = ["with_lengths"]

#: A control point's way from where the fit put it weighs as much as this share of the same error in a point's place.
HELD = 20.0
#: Steps in which a fit is brought to its lengths, and points of its quadrature between two points of the border.
GAUSS_NEWTON, GAUSS = 8, 6
_QUADRATURE = np.polynomial.legendre.leggauss(GAUSS)


def with_lengths(
    knots: FloatArray,
    control: FloatArray,
    points: FloatArray,
    arc: FloatArray,
    tolerance: float,
    weighed: float,
) -> tuple[FloatArray, float]:
    """Control points moved as little as gives the curve, up to each of the points, the length `arc`.

    Gauss-Newton on places, lengths and, softly, the control points themselves. The second value is by how much [m] the
    length is still off, at worst.
    """
    system = _LengthSystem(knots, control, points, arc, tolerance, weighed)
    now = system.at(control)
    for _ in range(GAUSS_NEWTON):
        move = system.move(now)
        for share in (1.0, 0.5, 0.25, 0.1):
            then = system.at(now.control + share * move)
            if then.objective < now.objective:
                break
        else:
            break
        now = then
        if np.abs(move).max() < 1e-8:
            break
    return now.control, float(np.abs(np.cumsum(now.longer)).max())


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fit:
    """A spline on its way to its lengths: what is minimised, how far it is from the points (in tolerances), how much longer [m] than it
    should be between each two of them, and the slopes there are in the quadrature, over their sizes, with the weights."""

    control: FloatArray
    objective: float
    away: FloatArray
    longer: FloatArray
    rate: FloatArray


class _LengthSystem:
    """The equations of a step of Gauss-Newton towards given lengths.

    Up to each point the length depends on all control points before it, and normal equations would be dense. So the errors e of the
    lengths are unknowns as well, bound by e_j - e_{j-1} = what is longer between two points; with the multipliers of that in place of e,
    and all unknowns in their order along the curve, the equations are a narrow band.
    """

    def __init__(
        self,
        knots: FloatArray,
        control: FloatArray,
        points: FloatArray,
        arc: FloatArray,
        tolerance: float,
        weighed: float,
    ) -> None:
        at, count = arc / arc[-1], len(control)
        span = np.diff(at)
        node, weight = _QUADRATURE
        self._weights = (span[:, None] * weight / 2).ravel()
        self._points, self._steps, self._start = points[1:-1], np.diff(arc), control
        self._tolerance, self._weighed, self._held = tolerance, weighed, 1.0 / (HELD * tolerance)
        between = (at[:-1, None] + span[:, None] * (node + 1) / 2).ravel()
        number, value, slope = _cubics(knots, np.concatenate([at[1:-1], between]))
        self._near, self._value = number[: len(at) - 2], value[: len(at) - 2]
        self._beside, self._slope = number[len(at) - 2 :], slope[len(at) - 2 :]
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
        """What stays the same in all steps, and where the rest goes."""
        moved, span = self._of_control, self._of_span
        pairs = (moved[self._near][:, :, None], moved[self._near][:, None, :])
        rows, columns = (np.broadcast_to(of, (len(self._near), 4, 4, 2)) for of in pairs)
        products = self._value[:, :, None, None] * self._value[:, None, :, None] / self._tolerance**2
        inner = moved[1:-1].ravel()
        diagonal = np.full(len(span), -2.0)
        diagonal[0] = -1.0
        beside = np.ones(len(span) - 1)
        entries = [
            (rows, columns, np.broadcast_to(products, rows.shape)),
            (inner, inner, np.full(len(inner), self._held**2)),
            (span, span, diagonal),
            (span[1:], span[:-1], beside),
            (span[:-1], span[1:], beside),
        ]
        row, column, value = (np.concatenate([entry[k].ravel() for entry in entries]) for k in range(3))
        free = (row >= 0) & (column >= 0)
        row, column, value = row[free], column[free], value[free]
        of_rate = moved[self._beside]
        self._free = of_rate >= 0
        to = of_rate[self._free]
        by = np.broadcast_to(np.repeat(span, GAUSS)[:, None, None], of_rate.shape)[self._free]
        self._band = int(max(np.abs(row - column).max(), np.abs(by - to).max()))
        self._size = len(inner) + len(span)
        self._fixed = np.bincount(self._flat(row, column), value, minlength=(2 * self._band + 1) * self._size)
        self._to = np.concatenate([self._flat(by, to), self._flat(to, by)])

    def _flat(self, row: NDArray[np.int64], column: NDArray[np.int64]) -> NDArray[np.int64]:
        """Where entries are in the flattened band that `scipy.linalg.solve_banded` takes."""
        return (self._band + row - column) * self._size + column

    def at(self, control: FloatArray) -> _Fit:
        """How a spline with these control points fits; the ends are the start's."""
        tangent = np.einsum("qk,qkd->qd", self._slope, control[self._beside])
        speed = np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-12)
        longer = (self._weights * speed).reshape(-1, GAUSS).sum(axis=1) - self._steps
        away = (np.einsum("pk,pkd->pd", self._value, control[self._near]) - self._points) / self._tolerance
        moved = (control - self._start) * self._held
        off = np.cumsum(longer) / self._weighed
        return _Fit(
            control=control,
            objective=float((away**2).sum() + off @ off + (moved**2).sum()),
            away=away,
            longer=longer,
            rate=(self._weights / speed)[:, None] * tangent,
        )

    def move(self, fit: _Fit) -> FloatArray:
        """#control by 2, the step of Gauss-Newton from here; the ends stay."""
        from scipy.linalg import solve_banded

        rate = (self._slope[:, :, None] * fit.rate[:, None, :])[self._free] / -self._weighed
        band = self._fixed + np.bincount(self._to, np.concatenate([rate, rate]), minlength=len(self._fixed))
        pull = (fit.control - self._start) * self._held**2
        for axis in range(2):
            along = self._value * fit.away[:, axis, None] / self._tolerance
            pull[:, axis] += np.bincount(self._near.ravel(), along.ravel(), minlength=len(pull))
        right = np.empty(self._size)
        right[self._of_control[1:-1]] = -pull[1:-1]
        right[self._of_span] = fit.longer / self._weighed
        band = band.reshape(2 * self._band + 1, self._size)
        solved = solve_banded((self._band, self._band), band, right, overwrite_ab=True, check_finite=False)
        move = np.zeros_like(fit.control)
        move[1:-1] = solved[self._of_control[1:-1]]
        return move


def _cubics(knots: FloatArray, at: FloatArray) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """The four cubic B-splines that are not zero at each place: #N by 4 each, their numbers, values and slopes."""
    from scipy.interpolate import BSpline

    cubic, square = (BSpline.design_matrix(at, knots, degree) for degree in (3, 2))
    number = cubic.indices.reshape(-1, 4).astype(np.int64)
    # A B-spline's slope is three times the difference of two of one degree less, each over how far it reaches.
    lower = np.zeros((len(at), 5))
    lower[:, 1:4] = square.data.reshape(-1, 3)
    each = number[:, :1] + np.arange(5)
    reach = knots[np.minimum(each + 3, len(knots) - 1)] - knots[each]
    share = 3.0 * np.divide(lower, reach, out=np.zeros_like(lower), where=reach > 0.0)
    return number, cubic.data.reshape(-1, 4), share[:, :-1] - share[:, 1:]
