"""The layout from which a piece is relaxed: its development, as-rigid iterations from there, or one's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from warpflat.core.arrays import IntArray
from warpflat.core.errors import InputError
from warpflat.flat.flattening.conformal_layout import conformal_layout
from warpflat.flat.flattening.develop import (
    Development,
    close_cracks,
    develop,
    flat_layout,
    geodesic_layout,
    profile_layout,
    turn_upright,
)
from warpflat.flat.flattening.harmonic_layout import refuse_tubes
from warpflat.flat.surface.as_rigid import as_rigid_layout
from warpflat.flat.surface.cells import make_cells
from warpflat.flat.surface.injective import is_injective
from warpflat.flat.surface.laplacian import factor_pays
from warpflat.flat.surface.mesh import Surface

__all__ = ["choose_start", "given_start"]


def choose_start(surface: Surface, datum: IntArray) -> Development:
    """Return the start of a piece: its development, or what as-rigid iterations make of it where a factor is cheap.

    Draped meshes are developed by geodesic distances, which crush some faces, and are far from rest. A few as-rigid iterations unfold
    these and are much nearer, for a factor that the relaxation needs as well. Where they leave folds, a conformal map often
    has none; it is taken if it does not lie over itself, either. Grids whose profiles are laid out are near enough.

    Raises:
        InputError: the surface is a closed tube.
    """
    if (
        not factor_pays(surface)
        or flat_layout(surface, datum) is not None
        or profile_layout(surface, datum) is not None
    ):
        return develop(surface, datum)
    # The geodesic layout, with cracks closed where there are any; it may be folded.
    whole, index = close_cracks(surface, datum) or (surface, np.arange(len(surface.vertices), dtype=np.int32))
    first = geodesic_layout(whole, index[datum])
    rigid = None if first is None else as_rigid_layout(surface, first[index])
    if rigid is not None:
        return Development(positions=turn_upright(rigid, datum), method="geodesic", as_rigid=True, mended=True)
    refuse_tubes(surface)
    rigid = as_rigid_layout(surface, conformal_layout(surface))
    if rigid is not None and is_injective(surface, rigid):
        return Development(positions=turn_upright(rigid, datum), method="conformal", as_rigid=True, mended=True)
    development = develop(surface, datum)
    rigid = as_rigid_layout(surface, development.positions)
    if rigid is None:
        return development
    return replace(development, positions=turn_upright(rigid, datum), as_rigid=True, mended=True)


def given_start(surface: Surface, datum: IntArray, start: ArrayLike) -> Development:
    """Return a layout of one's own as the start: turned over if it is mirrored as a whole, scaled to the surface's area, upright.

    Args:
        surface: one piece.
        datum: vertex indices; its chord will point up.
        start: #V by 2, or the vertices of the file by 2, in any unit.

    Raises:
        InputError: it is no such layout, or it mirrors some of the faces.
    """
    name = f"start of piece {surface.name!r}"
    positions = np.asarray(start)
    if positions.dtype.kind not in "iuf" or positions.ndim != 2 or positions.shape[1] != 2:
        raise InputError(f"{name}: shape {positions.shape}; must be a row of two numbers for each vertex")
    count, read = len(surface.vertices), len(surface.input_vertices)
    if len(positions) not in (count, read):
        raise InputError(f"{name}: {len(positions):,} rows; must be {count:,}, a row for each vertex")
    positions = positions.astype(np.float64)
    if len(positions) != count:
        positions = positions[surface.input_index]
    missing = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if len(missing):
        vertex = int(surface.input_index[missing[0]])
        raise InputError(f"{name}: vertex {vertex} has no place in it; must be finite numbers")
    cells = make_cells(surface)
    shares = cells.least_shares(positions)
    if np.median(shares) < 0.0:
        positions = positions * [-1.0, 1.0]
        shares = cells.least_shares(positions)
    mirrored = int((shares <= 0.0).sum())
    if mirrored:
        raise InputError(f"{name}: mirrors {mirrored:,} of {len(shares):,} faces; must mirror none")
    p = positions[cells.corner]
    a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    flat = 0.5 * float(cells.weight @ (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
    positions = positions * np.sqrt(cells.area.sum() / flat)
    return Development(positions=turn_upright(positions, datum), method="given", mended=True)
