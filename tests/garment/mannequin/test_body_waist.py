"""The waist of a body, at which a garment on it is cut, is a place in the body's own file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from real_files import needs_data
from scans import scan, triangles_of

from warpflat.app.scene.found_seams import waist_of_body


@needs_data
def test_the_waist_of_a_body_is_a_place_in_its_own_file(tmp_path: Path) -> None:
    vertices, faces = scan("female")
    # In its file it has Z up, is in centimetres, and stands away from the origin.
    moved = 100.0 * np.stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]], axis=1) + [40.0, 30.0, 20.0]
    trimesh.Trimesh(moved, triangles_of(faces), process=False).export(tmp_path / "body.obj")
    x, y, z = waist_of_body(tmp_path / "body.obj", 0.01)
    # Its height is that of `test_mannequin_scan`.
    assert z == pytest.approx(0.2 + 1.028, abs=0.006)
    assert (x, y) == pytest.approx((0.4, 0.3), abs=0.08)
