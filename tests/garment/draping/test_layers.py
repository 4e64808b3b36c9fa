"""Cloth does not pass through cloth: sheets that fall on a held one stay on the side they came from."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from cloths import cloth_of, grid
from devices import DEVICE

from warpflat.garment.draping.layers import APART, Layers
from warpflat.garment.draping.relax_drape import relax_drape
from warpflat.garment.draping.sewn_cloth import SewnCloth

ROWS, SPACING = 9, 0.01


def sheets(*heights: float, shift: float = 0.3) -> SewnCloth:
    """Level sheets of one cloth at some heights, each a piece of its own, shifted against the one before by a share of the spacing."""
    count, faces = ROWS**2, grid(ROWS, ROWS)
    u, v = (SPACING * each.ravel() for each in np.meshgrid(np.arange(ROWS), np.arange(ROWS)))
    flat = np.tile(np.column_stack([u, v]), (len(heights), 1))
    space = [
        np.column_stack([u + k * shift * SPACING, np.full(count, y), -v - k * shift * SPACING])
        for k, y in enumerate(heights)
    ]
    every = np.concatenate([faces + k * count for k in range(len(heights))]).astype(np.int32)
    return SewnCloth(
        fabric=cloth_of(), designed=np.concatenate(space), faces=every, flat_faces=every, flat=flat,
        welded=np.arange(len(flat), dtype=np.int32), warp=np.tile([0.0, 1.0], (len(every), 1)),
        weft=np.tile([1.0, 0.0], (len(every), 1)), lines={},
        piece_faces={f"p{k}": slice(k * len(faces), (k + 1) * len(faces)) for k in range(len(heights))},
        piece_vertices={f"p{k}": slice(k * count, (k + 1) * count) for k in range(len(heights))},
    )  # fmt: skip


def test_a_sheet_comes_to_rest_on_another():
    cloth = sheets(0.0, 2.0 * APART)
    lower = np.arange(len(cloth.designed)) < ROWS**2
    u, v = cloth.flat.T
    worn = relax_drape(cloth, None, held=lower | (u == 0.0))
    height = worn.positions[~lower & (u > 0.04) & (u < 0.07) & (v > 0.01) & (v < 0.07), 1]
    # Each presses the other one: both together carry the weight.
    sunk = 0.5 * cloth.fabric.areal_density * 9.80665 / 1e4
    assert worn.converged
    np.testing.assert_allclose(height, APART - sunk, atol=1e-4)


@pytest.mark.parametrize("upper", [0.004, -0.004])
def test_a_vertex_keeps_its_side_until_it_lies_deep(upper: float):
    cloth = sheets(0.0, upper)
    layers, x = Layers(cloth, wp.get_device(DEVICE)), cloth.designed.copy()
    moved = slice(ROWS**2, None)
    up = lambda: np.sign(layers.beside[2].numpy()[2 * ROWS**2 :, 1].sum())  # noqa: E731
    assert layers.renew(x)
    assert not layers.renew(x + 1e-3)
    assert up() == np.sign(upper)
    # A little beyond the other layer, and a step along it.
    x[moved] += [0.006, -upper - 0.5 * APART * np.sign(upper), 0.0]
    assert layers.renew(x)
    assert up() == np.sign(upper)
    assert layers.stiffness(x).nnz > 0
    x[moved, 1] -= 0.006 * np.sign(upper)
    assert layers.renew(x)
    assert up() == -np.sign(upper)
    assert layers.stiffness(x).nnz == 0
