"""A cut panel graded for another wearer: its pattern grows as its worn cloth does from the one body to the other.

What a maker has put into a pattern, such as ease, gathers, the stretch of a knit and the grain, is in neither body. So the known pattern
stays the rest shape of the cloth, and only the growth is added: of the cloth's deformation from its place on the one body to its place on
the other, the stretch, without the turn.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpflat.core import FloatArray
from warpflat.flat import Surface, face_creases, laplacian_of, make_cells, read_only, store_results

__all__ = ["graded_layout", "stretches_worn"]

# As-rigid iterations end with one that moves the panel by no more than this share of its size, or after so many.
_SMALL_STEP, _MOST_STEPS = 1e-6, 200
# A cell that has lost all but this share of its size in one direction tells nothing of growth.
_COLLAPSED = 0.05
# Nor does one of less than this share of the square of its edges.
_SLIVER = 1e-6


def graded_layout(surface: Surface, carried: FloatArray, cut: FloatArray) -> FloatArray:
    """Return a cut panel as it grows with its wearer, #V by 2 [m]; its grain still runs along +y, in the mean.

    The shape of each cell grows by the stretch of its worn cloth. The layout is the one nearest to those shapes, each of them turned as it
    likes, in least squares (Liu et al., "A local/global approach to mesh parameterization", 2008).

    Args:
        surface: as worn on the one body, #V vertices.
        carried: #V by 3 [m], as worn on the other one.
        cut: #V by 2 [m], the same vertices in the pattern.
    """
    cells = make_cells(surface)
    corner = cells.corner
    flat = _edges(cut, corner)
    # By how much each cell is stretched from the one body to the other, in the pattern's axes, #C by 2 by 2, symmetric. The stretch is that
    # of the map between both places, turned back by the rotation with which the cloth lies on the one body.
    det = np.linalg.det(flat)
    known = np.abs(det) > _SLIVER * np.einsum("cae,cae->c", flat, flat)
    back = np.linalg.inv(np.where(known[:, None, None], flat, np.eye(2)))
    metric = [
        np.einsum("cae,caf->cef", each @ back, each @ back)
        for each in (_edges(surface.vertices, corner), _edges(carried, corner))
    ]
    known &= np.linalg.eigvalsh(metric[0])[:, 0] > _COLLAPSED**2
    metric = [np.where(known[:, None, None], each, np.eye(2)) for each in metric]
    loose = np.linalg.inv(_root(metric[0]))
    growth = _root(loose @ metric[1] @ loose)
    # It is averaged over the cells around each vertex, as single cells of draped cloth are creased.
    weight = np.repeat(np.abs(det) * cells.weight * known, 3)
    at, count = cells.corner.ravel(), len(cells.around.offset) - 1
    share = np.bincount(at, weight, minlength=count)
    entries = np.repeat(growth.reshape(-1, 4), 3, axis=0) * weight[:, None]
    total = np.stack([np.bincount(at, column, minlength=count) for column in entries.T], axis=1)
    # A vertex among creased cells only grows as the panel does.
    mean = total.sum(axis=0) / max(float(share.sum()), 1e-300)
    smooth = np.where(share[:, None] > 0.0, total / np.maximum(share, 1e-300)[:, None], mean)
    shapes = smooth[cells.corner].mean(axis=1).reshape(-1, 2, 2) @ flat
    one, other = shapes[:, :, 0], shapes[:, :, 1]
    length = np.maximum(np.linalg.norm(one, axis=1), 1e-12)
    along = np.einsum("ca,ca->c", one, other) / length
    height = (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]) / length
    grown = replace(surface)
    laid = replace(cells, laid=np.stack([length, along, height], axis=1))
    store_results(grown, {face_creases: face_creases(surface), make_cells: read_only(laid)})
    laplacian, size = laplacian_of(grown), float(np.linalg.norm(np.ptp(cut, axis=0)))
    layout = cut
    for _ in range(_MOST_STEPS):
        before, layout = layout, laplacian.as_rigid_step(layout)
        if np.sqrt(np.mean((layout - before) ** 2)) <= _SMALL_STEP * size:
            break
    # The turn of the shapes in the layout, in the mean, is undone; the middle stays.
    turn = np.einsum("c,cae,cbe->ab", cells.weight, shapes, _edges(layout, corner))
    angle = np.arctan2(turn[0, 1] - turn[1, 0], turn[0, 0] + turn[1, 1])
    cosine, sine = np.cos(angle), np.sin(angle)
    return (layout - layout.mean(axis=0)) @ np.array([[cosine, -sine], [sine, cosine]]) + cut.mean(axis=0)


def stretches_worn(surface: Surface, cut: FloatArray) -> FloatArray:
    """Return by how much each cell is stretched as it is worn, #C by 2, the principal ones; 1 where it is as it was cut.

    Args:
        surface: as worn, #V vertices.
        cut: #V by 2 [m], the same vertices in the pattern.
    """
    corner = make_cells(surface).corner
    flat = _edges(cut, corner)
    known = np.abs(np.linalg.det(flat)) > _SLIVER * np.einsum("cae,cae->c", flat, flat)
    return np.linalg.svd(_edges(surface.vertices, corner)[known] @ np.linalg.inv(flat[known]), compute_uv=False)


def _edges(points: FloatArray, corner: np.ndarray) -> FloatArray:
    """Return the edges of cells from corner 0 to corners 1 and 2, as columns, #C by 2 or 3 by 2 [m]."""
    return np.stack([points[corner[:, 1]] - points[corner[:, 0]], points[corner[:, 2]] - points[corner[:, 0]]], axis=2)


def _root(matrix: FloatArray) -> FloatArray:
    """Return the square roots of symmetric positive definite 2 by 2 matrices, by Cayley and Hamilton."""
    root = np.sqrt(np.maximum(np.linalg.det(matrix), 1e-24))
    trace = np.trace(matrix, axis1=1, axis2=2)
    return (matrix + root[:, None, None] * np.eye(2)) / np.sqrt(trace + 2.0 * root)[:, None, None]
