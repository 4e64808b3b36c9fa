"""Sewn pieces that would lie over themselves are parted by contact, under their seams."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from devices import DEVICE
from surface_meshes import quads_between

from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.surface.injective import is_injective
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.garment.construction.sewing import sew
from warpflat.garment.construction.sewn import Stitching

ALONG, ACROSS = 31, 4


def band(place: np.ndarray, name: str) -> Flattening:
    faces = quads_between((ALONG, ACROSS), turned=True)
    return flatten(make_surface(place.reshape(-1, 3), faces, name=name), device=DEVICE)


@pytest.fixture(scope="module")
def pieces() -> dict[str, Flattening]:
    """A ring of more than a turn, on a ramp, and a belt as long as its outer edge."""
    angle, radius = np.meshgrid(2.2 * np.pi * np.linspace(0, 1, ALONG), np.linspace(0.2, 0.1, ACROSS), indexing="ij")
    ring = np.stack([radius * np.cos(angle), 0.015 * angle, radius * np.sin(angle)], axis=-1)
    step = np.linalg.norm(np.diff(ring[:, 0], axis=0), axis=1)
    x, y = np.meshgrid(np.append(0.0, np.cumsum(step)), np.linspace(0.0, 0.05, ACROSS), indexing="ij")
    return {"ring": band(ring, "ring"), "belt": band(np.stack([x, y, 0 * x], axis=-1), "belt")}


SEAM = Stitching(name="waist", pieces=("ring", "belt"), vertices=(4 * np.arange(ALONG), 4 * np.arange(ALONG)))


def test_a_sewn_piece_is_parted_and_its_seam_holds(pieces: dict[str, Flattening]):
    made = sew(pieces, [SEAM])
    assert made.converged
    assert made.largest_difference < 1e-5
    ring = made.pieces["ring"]
    assert [stage.name for stage in ring.stages[-2:]] == ["sew", "contact"]
    assert ring.contact_energy > 0.0
    assert any("sewn, the piece lies over itself by" in n and "contact has parted it" in n for n in ring.notes)
    for piece in made.pieces.values():
        assert is_injective(piece.network.surface, piece.positions)
        assert piece.flipped_faces == 0
        cells = shapely.polygons(piece.positions[piece.faces])
        assert shapely.union_all(cells).area == pytest.approx(shapely.area(cells).sum(), rel=1e-12)
    assert made.energy_after == pytest.approx(sum(p.stages[-1].model_energy_j for p in made.pieces.values()))


def test_without_a_gap_it_stays_as_it_lies(pieces: dict[str, Flattening]):
    ring = sew(pieces, [SEAM], options=RelaxOptions(gap_mm=0.0)).pieces["ring"]
    assert ring.stages[-1].name == "sew"
    assert ring.overlap > 0.0
