"""As-rigid iterations (Liu et al. 2008): a layout is unfolded, and comes near to the shapes that its faces have on the body."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.flat.surface.cells import LEAST_AREA, make_cells
from warpflat.flat.surface.injective import is_injective, winds_twice
from warpflat.flat.surface.laplacian import laplacian_of
from warpflat.flat.surface.mesh import Surface

__all__ = ["as_rigid_layout"]

# As-rigid iterations end with one that moves the piece by no more than this share of its size, or after so many.
_SMALL_STEP = 1e-3
_MOST_STEPS = 20


def as_rigid_layout(surface: Surface, positions: FloatArray) -> FloatArray | None:
    """Return what as-rigid iterations make of a layout: none of its cells mirrored; None where that fails.

    Once a layout is injective, they end before one that is not, unless the last one is injective again.
    """
    cells, laplacian = make_cells(surface), laplacian_of(surface)
    size = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    layouts = [positions]
    while len(layouts) <= _MOST_STEPS:
        layouts.append(laplacian.as_rigid_step(layouts[-1]))
        if np.sqrt(np.mean((layouts[-1] - layouts[-2]) ** 2)) <= _SMALL_STEP * size:
            break

    def is_unfolded(layout: FloatArray) -> bool:
        return bool(cells.least_shares(layout).min() > LEAST_AREA)

    if is_unfolded(layouts[-1]) and is_injective(surface, layouts[-1]):
        return layouts[-1]
    found, apart = None, False
    for layout in filter(is_unfolded, layouts):
        lies_over_itself = not is_injective(surface, layout)
        if apart and lies_over_itself:
            break
        found, apart = layout, not lies_over_itself
    return None if found is None or (not apart and winds_twice(surface, cells, found)) else found
