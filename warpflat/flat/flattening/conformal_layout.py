"""A least-squares conformal layout: angles are kept as well as they can be, and the border is free."""

from __future__ import annotations

import numpy as np
from scipy.sparse import block_array, coo_array

from warpflat.core.arrays import FloatArray
from warpflat.core.sparse import factor_symmetric
from warpflat.flat.surface.cells import make_cells
from warpflat.flat.surface.connectivity import border_loops
from warpflat.flat.surface.laplacian import cotangent_matrix
from warpflat.flat.surface.mesh import Surface, once_per_surface

__all__ = ["conformal_layout"]


@once_per_surface
def conformal_layout(surface: Surface) -> FloatArray:
    """Lay out a piece so that its Dirichlet energy exceeds its area by as little as can be (Levy et al. 2002; Mullen et al. 2008).

    Two vertices of the border that are far apart are held. Faces may be mirrored, and the piece may lie over itself. Scaled to the
    surface's area. #V by 2 [m].
    """
    count, loops = len(surface.vertices), border_loops(surface.faces, surface.vertices)
    begin, end = np.concatenate(loops), np.concatenate([np.roll(loop, -1) for loop in loops])
    # The area is a sum over the border's edges, half of x_begin y_end - x_end y_begin.
    half = np.full(len(begin), 0.5)
    turn = coo_array((np.append(half, -half), (np.append(begin, end), np.append(end, begin))), shape=(count, count))
    matrix = cotangent_matrix(surface)
    whole = block_array([[matrix, -turn], [turn, matrix]]).tocsc()
    outer = surface.vertices[loops[0]]
    first = int(np.linalg.norm(outer - outer.mean(axis=0), axis=1).argmax())
    distance = np.linalg.norm(outer - outer[first], axis=1)
    pins = loops[0][[first, int(distance.argmax())]]
    pinned = np.append(pins, pins + count)
    free = np.setdiff1d(np.arange(2 * count), pinned)
    layout = np.zeros(2 * count)
    layout[pinned[1]] = 1.0
    layout[free] = factor_symmetric(whole[free][:, free])(-(whole[free] @ layout))
    x, y = layout.reshape(2, count)
    area = 0.5 * float((x[begin] * y[end] - x[end] * y[begin]).sum())
    return (
        np.sqrt(make_cells(surface).area.sum() / area) * np.column_stack([x, y])
        if area > 0.0
        else np.column_stack([x, y])
    )
