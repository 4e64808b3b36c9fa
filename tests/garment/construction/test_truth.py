"""What `benchmarks/truth.py` measures, on panels that are known; and the garments of WARPFLAT_DATA within its bounds."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from real_files import DATA, needs_data
from surface_meshes import quads_between

from warpflat.core.errors import InputError
from warpflat.flat.surface.io.raw_mesh import RawMesh
from warpflat.flat.surface.io.read import read_mesh_file
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.garment.construction.sewn_panels import SewnPanel, sewn_panels

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))

import truth


def _rolled(unit: float) -> RawMesh:
    """Return two panels of 300 x 200 mm that are worn rolled up to cylinders beside each other, with their pattern as texture."""
    across, along = np.meshgrid(np.linspace(0.0, 0.3, 13), np.linspace(0.0, 0.2, 9))
    flat = np.column_stack([across.ravel(), along.ravel()])
    worn = np.column_stack([0.1 * np.sin(flat[:, 0] / 0.1), flat[:, 1], 0.1 * np.cos(flat[:, 0] / 0.1)])
    corner = (13 * np.arange(8)[:, None] + np.arange(12)).ravel()
    quads = np.stack([corner, corner + 1, corner + 14, corner + 13], axis=1)
    turned = flat[:, ::-1] * [-1.0, 1.0] + [1.0, 0.4]
    return RawMesh(
        vertices=np.concatenate([worn, worn + np.array([1.0, 0.0, 0.0])]),
        polygons=np.concatenate([quads, quads + len(worn)]),
        scale=1.0,
        texture=np.concatenate([flat[quads], turned[quads]]) / unit,
    )


@pytest.mark.parametrize("unit", [1.0, 0.01, 0.001])
def test_panels_that_can_lie_flat_are_met(unit):
    panels = sewn_panels(_rolled(unit), 1.0)
    assert [len(panel.cut) for panel in panels] == [117, 117]
    assert [panel.area for panel in panels] == pytest.approx([0.06, 0.06])
    found = truth.layouts(panels, "woven")
    for name in ("sewn", "alone"):
        for panel, layout in zip(panels, found[name], strict=True):
            # Twelve chords are shorter than their arc, half of it on either side of the middle.
            shorter = 0.5 * (300.0 - 12 * 200.0 * np.sin(0.125))
            assert truth.measure(panel, layout)[1:] == pytest.approx([shorter, shorter], abs=0.01), name
    assert any("body 300 x 200" in line for line in truth.table(panels, found))


def test_a_panel_is_laid_turned_and_mirrored_and_never_scaled():
    panel = sewn_panels(_rolled(1.0), 1.0)[0]
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])
    for mirror in (1.0, -1.0):
        assert max(truth.measure(panel, panel.cut @ turn * [mirror, 1.0] + [3.0, -1.0])) < 1e-9
    mean, most, outline = truth.measure(panel, 1.01 * panel.cut)
    # One per cent of the distance from the middle: of the corner, 180 mm, at most.
    radius = np.linalg.norm(panel.cut - panel.cut.mean(axis=0), axis=1)
    assert mean == pytest.approx(10.0 * radius.mean(), rel=1e-6)
    assert most == pytest.approx(10.0 * np.percentile(radius, 95), rel=1e-6)
    assert outline == pytest.approx(10.0 * np.percentile(radius[truth.outline(panel)], 95), rel=1e-6)


def test_a_texture_that_is_no_pattern_is_refused():
    raw = _rolled(1.0)
    with pytest.raises(InputError, match="true size"):
        sewn_panels(raw, 0.6)
    raw.texture = None
    with pytest.raises(InputError, match="no texture"):
        sewn_panels(raw, 1.0)


@needs_data
def test_a_worn_sleeve_lies_on_its_panel():
    file = DATA / "garments" / "Female_T_Shirt.usd"
    _, raw, scale, _ = read_mesh_file(file, units=None, prim=None, name=None)
    panels = sewn_panels(raw, scale)
    assert [truth.is_band(panel) for panel in panels] == [False, False, False, False, True]
    for name, (layout,) in truth.layouts(panels[2:3], "woven").items():
        # Its cloth is worn stretched: all ways are as far off, but for LSCM.
        assert truth.measure(panels[2], layout)[0] < (2.5 if name == "LSCM" else 1.9), name


def test_cloth_that_hangs_is_taken_off_its_weight() -> None:
    """A strip of .6 m in rest, hung up: at a height y of its rest it is strained by its share of what hangs below."""
    hang = 0.03
    u, y = (each.ravel() for each in np.meshgrid(np.linspace(0.0, 0.2, 11), np.linspace(0.0, 0.6, 241)))
    at = np.arange(2651).reshape(241, 11)
    faces = quads_between(at)
    worn = np.column_stack([u, y + 0.5 * hang * y**2, np.zeros(len(u))])
    panel = SewnPanel(
        surface=make_surface(worn, faces), cut=np.column_stack([u, y]), unit="m",
        polygons=np.arange(len(faces), dtype=np.int32), corners=faces.astype(np.int32), of_file=at.ravel().astype(np.int32),
    )  # fmt: skip
    (freed,) = truth.unhung([panel], hang)
    # The weight is that of the worn area, which is longer than the cloth by a share of the second order.
    assert np.ptp(worn[:, 1]) == pytest.approx(0.6054, abs=1e-6)
    assert np.ptp(freed.vertices[:, 1]) == pytest.approx(0.6, abs=1.2e-4)
    assert np.array_equal(freed.vertices[:, [0, 2]], worn[:, [0, 2]])
