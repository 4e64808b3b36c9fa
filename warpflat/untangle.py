"""Unfolding a layout in which a few cells are mirrored, without touching the rest of it.

Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov 2021, Foldover-free maps in 50 lines of code: minimise
(|f|^2 + det^2 + 1) / chi(det) per cell, with f from the surface to the plane and chi(d) = (d + sqrt(e^2 + d^2)) / 2, while e
is lowered: a barrier that also sees, and turns back, what already lies behind it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.network import CellArrays

__all__ = ["untangle"]

FloatArray = NDArray[np.float64]

_RINGS = (3, 8)
_ROUNDS = 8


def untangle(cells: CellArrays, positions: FloatArray, *, least: float) -> FloatArray | None:
    """The layout with its mirrored cells turned back, moved in as few rings of cells around them as will do.

    Args:
        cells: of the surface.
        positions: #V by 2, a layout [m] with some cells mirrored.
        least: area in the plane over area on the surface that every cell shall have at least.

    Returns:
        #V by 2 [m], or None if some cells resisted.
    """
    rest: FloatArray = np.linalg.inv(cells.edges).astype(np.float64)
    for rings in _RINGS:
        free = _around(cells, rest, positions, rings, least)
        layout = _unfold(cells, rest, positions, free, least)
        if layout is not None and not _winds_twice(cells, layout):
            return layout
    return None


def _winds_twice(cells: CellArrays, positions: FloatArray) -> bool:
    """Whether the faces go around some inner vertex more than once, or around a border vertex by more than a full turn.

    Every cell may be the right way up and the layout be a staircase all the same. A quad's corner is one of its four cells.
    """
    p = positions[cells.corner]
    whole = cells.weight == 1.0
    turn = np.zeros(len(positions))
    for k in range(3):
        u, v = p[:, (k + 1) % 3] - p[:, k], p[:, (k + 2) % 3] - p[:, k]
        angle = np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], np.einsum("ij,ij->i", u, v))
        counts = whole | (k == 1)
        turn += np.bincount(cells.corner[counts, k], angle[counts], minlength=len(turn))
    return bool((turn > 2 * np.pi + 1e-6).any())


def _area_ratios(corner: NDArray[np.int32], rest: FloatArray, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    p = positions[corner]
    f = np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=2) @ rest
    return f, f[:, 0, 0] * f[:, 1, 1] - f[:, 0, 1] * f[:, 1, 0]


def _around(cells: CellArrays, rest: FloatArray, positions: FloatArray, rings: int, least: float) -> NDArray[np.bool_]:
    """#V, the vertices within so many rings of a cell that has less than its least area."""
    signed = _area_ratios(cells.corner, rest, positions)[1]
    free = np.zeros(len(positions), dtype=bool)
    free[cells.corner[signed < least]] = True
    for _ in range(rings):
        free[cells.corner[free[cells.corner].any(axis=1)]] = True
    return free


def _unfold(
    cells: CellArrays, rest: FloatArray, positions: FloatArray, free: NDArray[np.bool_], least: float
) -> FloatArray | None:
    from scipy.optimize import minimize

    touched = free[cells.corner].any(axis=1)
    corner, inverse, weight = cells.corner[touched], rest[touched], cells.area[touched] / cells.area[touched].mean()
    index = np.flatnonzero(free)
    layout = positions.copy()
    signed = _area_ratios(corner, inverse, layout)[1]
    softness = max(0.1, -float(signed.min()))

    def energy(flat: FloatArray) -> tuple[float, FloatArray]:
        layout[index] = flat.reshape(-1, 2)
        f, det = _area_ratios(corner, inverse, layout)
        root = np.sqrt(softness**2 + det**2)
        # (det + root) / 2, without the cancellation that it would suffer from far behind the barrier
        chi = np.where(det > 0, 0.5 * (det + root), 0.5 * softness**2 / (root - np.minimum(det, 0.0)))
        shape = np.einsum("cij,cij->c", f, f) + det**2 + 1.0
        cofactor = np.stack([np.stack([f[:, 1, 1], -f[:, 1, 0]], 1), np.stack([-f[:, 0, 1], f[:, 0, 0]], 1)], 1)
        slope = 2.0 * det / chi - shape / (chi * root)
        stress = (2.0 * f / chi[:, None, None] + slope[:, None, None] * cofactor) * weight[:, None, None]
        pull = stress @ np.swapaxes(inverse, 1, 2)
        gradient = np.empty_like(layout)
        for axis in (0, 1):
            share = np.column_stack([-(pull[:, axis, 0] + pull[:, axis, 1]), pull[:, axis, 0], pull[:, axis, 1]])
            gradient[:, axis] = np.bincount(corner.ravel(), share.ravel(), minlength=len(layout))
        return float((weight * shape / chi).sum()), gradient[index].ravel()

    for _ in range(_ROUNDS):
        result = minimize(
            energy, layout[index].ravel(), jac=True, method="L-BFGS-B", options={"maxiter": 100, "maxcor": 20}
        )
        layout[index] = result.x.reshape(-1, 2)
        if not np.isfinite(layout).all():
            return None
        if float(_area_ratios(corner, inverse, layout)[1].min()) >= least:
            return layout
        softness *= 0.4
    return None
