"""A harmonic layout with a convex border, which cannot have mirrored faces."""

from __future__ import annotations

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.core.polyline import arc_lengths, polyline_length
from warpflat.flat.surface.connectivity import border_loops
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.normals import flat_areas
from warpflat.flat.surface.triangles import triangulate
from warpflat.flat.surface.tubes import tube_borders

__all__ = ["harmonic_layout", "refuse_tubes"]


def harmonic_layout(surface: Surface, *, border: FloatArray | None = None) -> FloatArray:
    """Lay out a piece without folds: the border on a convex curve, every other vertex a convex mean of its neighbours (Floater 1997).

    Mean value weights (Floater 2003), which are positive on any triangles. Holes are closed by a vertex each while the
    map is computed.

    Args:
        surface: one piece.
        border: places of the vertices of its outer border, in the order of `border_loops`, #B by 2 [m]; on a circle of the surface's area
            if not given.

    Returns:
        #V by 2 [m].
    """
    from scipy.sparse import coo_matrix, diags
    from scipy.sparse.linalg import spsolve

    triangles, _ = triangulate(surface.faces)
    loops = border_loops(surface.faces, surface.vertices)
    points = [surface.vertices]
    caps = [triangles]
    for number, loop in enumerate(loops[1:]):
        centre = np.full(len(loop), len(surface.vertices) + number)
        points.append(surface.vertices[loop].mean(axis=0)[None])
        caps.append(np.column_stack([np.roll(loop, -1), loop, centre]))
    p, t = np.concatenate(points), np.concatenate(caps).astype(np.int64)
    rows, columns, weights = [], [], []
    for k in range(3):
        i, j, other = t[:, k], t[:, (k + 1) % 3], t[:, (k + 2) % 3]
        u, v = p[j] - p[i], p[other] - p[i]
        lu, lv = np.linalg.norm(u, axis=1), np.linalg.norm(v, axis=1)
        cosine = np.clip(np.einsum("ij,ij->i", u, v) / np.maximum(lu * lv, 1e-300), -0.999999, 0.999999)
        half_tangent = np.sqrt((1 - cosine) / (1 + cosine))
        rows += [i, i]
        columns += [j, other]
        weights += [half_tangent / np.maximum(lu, 1e-300), half_tangent / np.maximum(lv, 1e-300)]
    size = len(p)
    matrix = coo_matrix((np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))), shape=(size, size))
    matrix = matrix.tocsr()
    matrix = diags(1.0 / np.asarray(matrix.sum(axis=1)).ravel()) @ matrix

    outer = loops[0]
    if border is None:
        arc = arc_lengths(surface.vertices[outer], closed=True)
        angle = 2 * np.pi * arc[:-1] / arc[-1]
        area = flat_areas(surface.vertices, triangles).sum()
        border = np.sqrt(area / np.pi) * np.column_stack([np.cos(angle), np.sin(angle)])
    layout = np.zeros((size, 2))
    layout[outer] = border
    inner = np.setdiff1d(np.arange(size), outer)
    if len(inner):
        system = (diags(np.ones(len(inner))) - matrix[inner][:, inner]).tocsc()
        layout[inner] = spsolve(system, matrix[inner][:, outer] @ layout[outer]).reshape(-1, 2)
    return layout[: len(surface.vertices)]


def refuse_tubes(surface: Surface) -> None:
    """Refuse a closed tube.

    Raises:
        InputError: the surface is one.
    """
    for loop in tube_borders(surface):
        size = polyline_length(surface.vertices[loop], closed=True)
        raise InputError(
            f"piece {surface.name!r} is a closed tube (a second border, {100 * size:.0f} cm long, runs around it at "
            f"vertex {int(surface.input_index[loop[0]])}): cut it open along a line first; warpflat.open_tube(surface) does"
        )
