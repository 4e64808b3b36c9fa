"""Patterns recovered from the shapes in which their cloth hangs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cloths import cloth_of, grid, sheet
from scipy.interpolate import RegularGridInterpolator

import warpflat
from warpflat.core.errors import InputError
from warpflat.core.vectors import laid_upon
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.recover_pattern import recover_cloth
from warpflat.garment.draping.relax_drape import relax_drape
from warpflat.garment.draping.sewn_cloth import SewnCloth

SIDE = 0.4


def hung(n: int, shape: RegularGridInterpolator | None = None) -> tuple[SewnCloth, np.ndarray]:
    """A sheet over a grid, and which of its vertices are held: three of its upper edge."""
    u, v = (each.ravel() for each in np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n)))
    bow = np.column_stack([0.95 * SIDE * u, SIDE * v, 0.075 * np.sin(np.pi * u)])
    space = bow if shape is None else shape(np.column_stack([v, u]))
    held = (v == 1.0) & np.isin(u, (0.0, 0.5, 1.0))
    return sheet(SIDE * np.column_stack([u, v]), space, grid(n, n), cloth_of()), held


def apart(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Distances after the best rigid motion."""
    return np.linalg.norm(laid_upon(q, p) - q, axis=1)


def test_a_sheet_draped_on_one_mesh_is_recovered_on_another():
    (first, held), n = hung(21), 21
    given = relax_drape(first, None, held=held, options=DrapeOptions(tolerance=2e-3))
    assert given.converged
    axis = np.linspace(0, 1, n)
    shape = RegularGridInterpolator([axis, axis], given.positions.reshape(n, n, 3), method="cubic")
    second, held = hung(17, shape)
    wrong = second.flat * [1.03, 0.98] + 0.03 * second.flat[:, 1:] * [1.0, 0.0]
    assert apart(wrong, second.flat).mean() > 4e-3
    found = recover_cloth(replace(second, flat=wrong), held)
    assert found.converged
    assert apart(found.cloth.flat, second.flat).mean() < 2e-4
    # Draped again, it stays in the shape that was given.
    again = relax_drape(found.cloth, None, held=held)
    assert np.linalg.norm(again.positions - second.designed, axis=1).mean() < 1e-3


def test_a_scan_of_hanging_cloth_gives_the_pattern_without_its_stretch():
    """Its own weight makes a curtain longer by w g L^2 / 2 K."""
    rows, length, stiffness = 17, 1.0, 60.0
    fabric = cloth_of(stiffness_warp=stiffness, stiffness_weft=stiffness)
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(0.0, 0.3, 6), np.linspace(0.0, length, rows)))
    stretch = fabric.areal_density * 9.80665 / stiffness
    worn = length - (length - y) - stretch * (length * (length - y) - 0.5 * (length - y) ** 2)
    top = np.flatnonzero(y == length).astype(np.int32)
    surface = warpflat.make_surface(np.column_stack([x, worn, 0 * x]), grid(rows, 6), lines={"top": top})
    flat = warpflat.flatten(surface, fabric=fabric)
    found = warpflat.recover_pattern(flat, hold=["top"])
    assert found.converged
    piece = found.apply(flat)
    assert isinstance(piece, warpflat.Flattening)
    assert np.ptp(flat.positions[:, 1]) == pytest.approx(length * (1.0 + 0.5 * stretch), abs=1e-3)
    assert np.ptp(piece.positions[:, 1]) == pytest.approx(length, abs=1e-3)
    with pytest.raises(InputError, match="nothing holds the cloth"):
        warpflat.recover_pattern(flat, hold=[])
    with pytest.raises(InputError, match="line 'tip' is unknown"):
        warpflat.recover_pattern(flat, hold=["tip"])
