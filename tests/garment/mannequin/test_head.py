"""A head over a mannequin's neck."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import body_of_size

from warpflat.flat.surface.connectivity import border_loops, euler_characteristic
from warpflat.garment.mannequin.head import head_of
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.profiles import convex_girth
from warpflat.garment.mannequin.scan_measures import ScanMeasure


def check(vertices: np.ndarray, faces: np.ndarray, girth: float) -> None:
    """It is closed, faces outwards, is as wide as the tape says, and convex."""
    assert border_loops(faces) == []
    assert euler_characteristic(faces) == 2
    corner = vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert (np.einsum("ta,ta->t", normal, corner[:, 0] - vertices.mean(axis=0)) > 0.0).all()
    # Around the forehead, above the nose.
    brow = vertices[:, 1].max() - 0.42 * np.ptp(vertices[:, 1])
    around = vertices[np.abs(vertices[:, 1] - brow) < 0.025]
    assert convex_girth(around) == pytest.approx(girth, rel=0.03)


@pytest.mark.parametrize("stature", [1.60, 1.75])
def test_a_head_has_its_girth_and_reaches_up_to_the_stature(stature: float):
    body = Mannequin.from_size("EU 38", resolution_mm=40.0, stature=stature, head=0.56)
    vertices, faces = head_of(body)
    check(vertices, faces, 0.56)
    assert vertices[:, 1].max() == pytest.approx(stature)
    # The neck goes up into it, and its nape is the head's.
    neck = body.vertices[body.layout.body_faces].reshape(-1, 3)
    neck = neck[neck[:, 1].argmax()]
    assert vertices[:, 1].min() < neck[1]
    low = vertices[vertices[:, 1] < neck[1] + 0.03]
    assert low[:, 2].min() == pytest.approx(neck[2], abs=0.02)
    np.testing.assert_allclose(np.abs(vertices[:, 0].min()), vertices[:, 0].max(), atol=1e-3)


def test_a_scan_has_its_head_where_the_tape_lay():
    body = body_of_size(40.0)
    heads = [
        head_of(replace(body, measures={"head": ScanMeasure(height=height, girth=0.6)}))[0] for height in (1.5, 1.55)
    ]
    np.testing.assert_allclose(heads[1][:, 1] - heads[0][:, 1], 0.05, atol=1e-9)
    assert head_of(replace(body, lengths={})) is None
